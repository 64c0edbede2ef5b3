"""Files: whole or not at all, and named by their SHA-256."""

from __future__ import annotations

import contextlib
import glob
import hashlib
import io
import json
import os
import shutil
import signal
import tempfile
import threading
import time
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from identification.common.findings import CompstiffError, error
from identification.common.locks import Taken, folders_locked

FileStamp = tuple[int, int, int, int]
Content = bytes | Iterator[bytes]       # of a file, or its blocks
# Output files of this process that are in place: from then on an interrupt finds the work done.
written: list[Path] = []
# Output files that were there before, of another call, and are to be overwritten.
earlier: list[Path] = []
PAUSES = (0.01, 0.02, 0.05, 0.1, 0.2, 0.4, 0.6, 0.6)       # [s]
LONGEST_NAME = 255      # bytes of a file's name, on every usual file system
TEMPORARY = ".part"


def file_stamp(file: Path) -> FileStamp | None:
    """Device, inode, size and time of a file, which change when it does; None where there is none."""
    with contextlib.suppress(OSError):
        state = file.stat()
        return state.st_dev, state.st_ino, state.st_size, state.st_mtime_ns
    return None


@dataclass(frozen=True)
class AsRead:
    """Files as they were before they were read."""

    stamps: tuple[tuple[Path, FileStamp | None], ...] = ()

    @classmethod
    def of(cls, files: Iterable[Path]) -> AsRead:
        """As they are now; folders do not count."""
        return cls(tuple((file, file_stamp(file)) for file in files if not file.is_dir()))

    def check(self) -> None:
        """Raises CompstiffError (CS0080) for the first that is another one now."""
        for file, stamp in self.stamps:
            if file_stamp(file) != stamp:
                raise error("CS0080", "changed while it was worked on; nothing was written", file=str(file),
                            hint="call again once it is finished: what was computed may belong to neither state")


NOTHING_READ = AsRead()


def sha256(file: str | Path) -> str:
    """Hexadecimal SHA-256 of a file's bytes."""
    with open(file, "rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def with_room(size: int) -> io.BytesIO:
    """A stream with room for about so many bytes, to be truncated where its content ends: one that grows is copied on the way,
    and held twice meanwhile."""
    stream = io.BytesIO()
    stream.seek(size)
    stream.write(b"\n")
    stream.seek(0)
    return stream


def json_bytes(content: dict[str, Any]) -> bytes:
    """A JSON file, indented. Raises ValueError for values that JSON does not have (NaN, infinity)."""
    return (json.dumps(content, indent=1, allow_nan=False) + "\n").encode()


def check_writable(paths: Iterable[Path], *, overwrite: bool) -> None:
    """Raises (CS0003) for the first path that exists, if only as a link, unless `overwrite`, and (CS0004) for a folder that is
    not there, or a name that is too long."""
    for path in paths:
        longest = max(len(os.fsencode(part)) for part in path.parts or ("",))
        if longest > LONGEST_NAME:
            raise error("CS0004", f"a name of {longest} bytes, at most {LONGEST_NAME} are possible", file=str(path),
                        hint="give a shorter name; some files get their name from another's, such as part.mod.json")
        if path.is_dir():
            raise error("CS0004", "is a folder, a file name was expected", file=str(path))
        if os.path.lexists(path) and not overwrite:      # a link that leads nowhere is a file, too
            raise error("CS0003", "exists already and is not overwritten", file=str(path),
                        hint="give another name, or --force to overwrite it")
        if not path.parent.is_dir():
            raise error("CS0004", f"cannot be written: there is no folder {path.parent}", file=str(path),
                        hint="make the folder first")
        if path.is_file():
            earlier.append(path)


def check_distinct(inputs: Iterable[Path], outputs: Iterable[Path]) -> None:
    """Raises CompstiffError (CS0006) where an output is one of the inputs, or two outputs are one file."""
    taken = {os.path.realpath(file): "input" for file in inputs}        # which a circle of links does not stop
    for file in outputs:
        real = os.path.realpath(file)
        if real in taken:
            raise error("CS0006", f"would overwrite an {taken[real]} of this call", file=str(file),
                        hint="give the output another name")
        taken[real] = "output"


def write_whole(files: Mapping[Path, Content], *, overwrite: bool = True, read: AsRead = NOTHING_READ) -> None:
    """Writes all files or none: each to a temporary name beside its target, then all renamed (docs/formats.md#conventions).
    What comes in blocks is made while it is written.

    One call at a time writes into a folder, so that what two calls write is never mixed; overwrite: files that came to be there
    meanwhile, too. read: what the content was made from. Raises CompstiffError: CS0080 that changed, CS0081 another call goes
    on writing there, what check_writable raises, and when the system refuses CS0004 (no space, no permission), CS0050
    (another program has a target open, on Windows). Then no target has changed.
    """
    try:
        with folders_locked(path.parent for path in files) as alone:
            check_writable(files, overwrite=overwrite)
            if alone:
                for path in files:
                    sweep(path)
            _write(files, read)
    except Taken as reason:
        raise error("CS0081", "another call goes on writing into this folder", file=str(reason),
                    hint="wait for it to end, or give another folder; nothing was changed") from reason


def temporary_name(path: Path) -> str:
    """How the names of temporary files beside a target begin."""
    whole = os.fsencode(f".{path.name}")
    return os.fsdecode(whole[:LONGEST_NAME - len(f".12345678{TEMPORARY}")]) + "."


def sweep(path: Path) -> None:
    """Deletes the temporary files that killed processes left beside a target."""
    for left in path.parent.glob(f"{glob.escape(temporary_name(path))}????????{TEMPORARY}"):
        with contextlib.suppress(OSError):
            left.unlink()


def _write(files: Mapping[Path, Content], read: AsRead) -> None:
    temporary: dict[Path, str] = {}
    try:
        for path, content in files.items():
            handle, name = tempfile.mkstemp(prefix=temporary_name(path), suffix=TEMPORARY, dir=path.parent)
            temporary[path] = name
            with os.fdopen(handle, "wb") as stream:
                stream.writelines([content] if isinstance(content, bytes) else content)
                stream.flush()
                os.fsync(stream.fileno())
            os.chmod(name, _mode(path))
        read.check()
        with _uninterrupted():
            _into_place(temporary)
            written.extend(temporary)
    except OSError as reason:
        raise error("CS0004", f"cannot be written: {reason.strerror or reason}",
                    file=str(reason.filename or next(iter(files))),
                    hint="check free space and permissions; nothing was changed") from reason
    finally:
        for name in temporary.values():
            with contextlib.suppress(OSError):      # it is in its place; or, on Windows, not to be deleted
                os.unlink(name)


def _into_place(temporary: dict[Path, str]) -> None:
    """Renames all to their targets. Where one cannot be, those before it get back what they had. Raises OSError, CS0050."""
    kept: dict[Path, str | None] = {}
    try:
        for path, name in temporary.items():
            if len(temporary) > 1:
                kept[path] = _copy_beside(path)
            try:
                replace_file(name, path)
            except BaseException:
                last = kept.pop(path, None)
                if last:
                    os.unlink(last)
                raise
    except BaseException:
        for path, before in kept.items():
            with contextlib.suppress(OSError, CompstiffError):
                replace_file(before, path) if before else path.unlink()
        raise
    for before in kept.values():
        if before:
            with contextlib.suppress(OSError):
                os.unlink(before)


def _copy_beside(path: Path) -> str | None:
    """A second name, or a copy, of what is there now; None where nothing is."""
    if not path.exists():
        return None
    handle, name = tempfile.mkstemp(prefix=temporary_name(path), suffix=TEMPORARY, dir=path.parent)
    os.close(handle)
    shutil.copy2(path, name)
    return name


def replace_file(name: str, path: Path) -> None:
    """Renames a file over another one. Windows refuses that while somebody has the other one open: it is tried again for two
    seconds. Raises OSError; CompstiffError (CS0050): it stays open."""
    for pause in (*PAUSES, None):
        try:
            os.replace(name, path)
            return
        except PermissionError as reason:
            if not path.exists() or path.is_dir():
                raise
            if pause is None:
                raise error("CS0050", "cannot be replaced: another program has it open, or it is read-only", file=str(path),
                            hint="close it there (a table in Excel, a report in a viewer) and call again; nothing was changed"
                            ) from reason
            time.sleep(pause)


@contextlib.contextmanager
def _uninterrupted() -> Iterator[None]:
    """Ctrl-C is dropped in here: between two renames it would leave some files new and some old."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


def _mode(file: Path) -> int:
    """Permissions of the file that is replaced, else what the umask leaves of rw-rw-rw-."""
    with contextlib.suppress(FileNotFoundError):
        return file.stat().st_mode & 0o777
    mask = os.umask(0)
    os.umask(mask)
    return 0o666 & ~mask

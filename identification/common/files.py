"""Files: whole or not at all, and named by their SHA-256."""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import shutil
import signal
import tempfile
import threading
import time
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

from identification.common.findings import CompstiffError, error

# Output files of this process that are in place: from then on an interrupt finds the work done.
written: list[Path] = []
PAUSES = (0.01, 0.02, 0.05, 0.1, 0.2, 0.4, 0.6, 0.6)       # [s]


def sha256(file: str | Path) -> str:
    """Hexadecimal SHA-256 of a file's bytes."""
    with open(file, "rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def json_bytes(content: dict[str, Any]) -> bytes:
    """A JSON file, indented. Raises ValueError for values that JSON does not have (NaN, infinity)."""
    return (json.dumps(content, indent=1, allow_nan=False) + "\n").encode()


def check_writable(paths: Iterable[Path], *, overwrite: bool) -> None:
    """Raises (CS0003) for the first path that exists, unless `overwrite`, and (CS0004) for a folder that is not there."""
    for path in paths:
        if path.is_dir():
            raise error("CS0004", "is a folder, a file name was expected", file=str(path))
        if path.exists() and not overwrite:
            raise error("CS0003", "exists already and is not overwritten", file=str(path),
                        hint="give another name, or --force to overwrite it")
        if not path.parent.is_dir():
            raise error("CS0004", f"cannot be written: there is no folder {path.parent}", file=str(path),
                        hint="make the folder first")


def check_distinct(inputs: Iterable[Path], outputs: Iterable[Path]) -> None:
    """Raises CompstiffError (CS0006) where an output is one of the inputs, or two outputs are one file."""
    taken = {file.resolve(): "input" for file in inputs}
    for file in outputs:
        if file.resolve() in taken:
            raise error("CS0006", f"would overwrite an {taken[file.resolve()]} of this call", file=str(file),
                        hint="give the output another name")
        taken[file.resolve()] = "output"


def write_whole(files: dict[Path, bytes]) -> None:
    """Writes all files or none: each to a temporary name beside its target, then all renamed (docs/formats.md#conventions).

    Raises CompstiffError when the system refuses: CS0004 (no space, no permission), CS0050 (another program has a target open,
    on Windows). Then no target has changed.
    """
    temporary: dict[Path, str] = {}
    try:
        for path, content in files.items():
            handle, name = tempfile.mkstemp(prefix=f".{path.name}.", suffix=".part", dir=path.parent)
            temporary[path] = name
            with os.fdopen(handle, "wb") as stream:
                stream.write(content)
                stream.flush()
                os.fsync(stream.fileno())
            os.chmod(name, _mode(path))
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
    handle, name = tempfile.mkstemp(prefix=f".{path.name}.", suffix=".part", dir=path.parent)
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

"""Whether a file that somebody else writes is finished.

No file system says so. Three things are asked together: size, time and identity stayed the same for some seconds; nobody has it
open for writing (where the kernel tells); and a RAPID module has its end.
"""

from __future__ import annotations

import errno
import os
import re
import signal
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from pathlib import Path

from identification.common.files import FileStamp, file_stamp

_MODULE = re.compile(rb"^\s*MODULE\s", re.MULTILINE | re.IGNORECASE)
# A comment that names it is no end, nor is a string; an exclamation mark in a string begins no comment.
_END = re.compile(rb'(?:^|[\r\n])(?:[^!"\r\n]|"[^"\r\n]*")*?\bENDMODULE\b', re.IGNORECASE)


@dataclass
class Settled:
    """Which files stayed as they are for `settle` seconds. The clock is this process's own: the times of a file may come from
    another machine, and only have to stay the same."""

    settle: float
    clock: Callable[[], float] = time.monotonic
    _since: dict[Path, tuple[FileStamp, float]] = field(default_factory=dict)

    def look(self, paths: Iterable[Path]) -> list[FileStamp] | None:
        """Looks at all these files now: how they are, if all have been like this for long enough and nobody has one open for
        writing; else None."""
        stamps = [self._look(path) for path in paths]
        settled = [stamp for stamp in stamps if stamp is not None]
        return settled if len(settled) == len(stamps) else None

    def kept_shut(self, paths: Iterable[Path]) -> OSError | None:
        """Of the first of these files that stayed as it is for long enough, and that the system will not open: why."""
        now = self.clock()
        for path in paths:
            _, since = self._since.get(path, (None, float("inf")))
            if now - since >= self.settle:
                try:
                    os.close(_opened(path))
                except FileNotFoundError:
                    continue
                except OSError as reason:
                    return reason
        return None

    def _look(self, file: Path) -> FileStamp | None:
        now, stamp = self.clock(), file_stamp(file)
        if stamp is None:
            self._since.pop(file, None)
            return None
        before = self._since.get(file)
        if before is None or before[0] != stamp:
            self._since[file] = before = (stamp, now)
        return stamp if now - before[1] >= self.settle and not open_for_writing(file) else None


def open_for_writing(file: Path) -> bool:
    """Whether a process of this machine has the file open for writing, or it cannot be opened. False where the kernel does not
    say: another user's file, a network folder. On Windows whether anybody has it open without sharing it."""
    try:
        handle = _opened(file)
    except OSError:
        return True
    try:
        import fcntl
    except ImportError:
        os.close(handle)
        return _open_elsewhere(file)
    # A lease is broken with SIGIO, which by default ends the process.
    ignored = signal.signal(signal.SIGIO, signal.SIG_IGN)
    try:
        # A read lease is granted only while nobody writes (fcntl(2)); it is given back at once.
        fcntl.fcntl(handle, fcntl.F_SETLEASE, fcntl.F_RDLCK)
        fcntl.fcntl(handle, fcntl.F_SETLEASE, fcntl.F_UNLCK)
    except OSError as reason:
        return reason.errno in (errno.EAGAIN, errno.EWOULDBLOCK)
    finally:
        os.close(handle)
        signal.signal(signal.SIGIO, ignored)
    return False


def _opened(file: Path) -> int:
    """A handle to read the file by, which waits for no writer. Raises OSError."""
    return os.open(file, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0))


def _open_elsewhere(file: Path) -> bool:
    """Windows renames no file, not even to its own name, that is open without sharing its deletion, as programs open files."""
    try:
        os.rename(file, file)
    except OSError:
        return True
    return False


def lacks_its_end(file: Path) -> bool:
    """Whether a file has a RAPID MODULE without its ENDMODULE."""
    text = file.read_bytes()
    return len(_MODULE.findall(text)) > len(_END.findall(text))

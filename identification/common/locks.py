"""One process at a time: a lock on a file of its own, which ends with its process, on every system."""

from __future__ import annotations

import contextlib
import os
import time
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from filelock import BaseFileLock


PATIENCE_S = 60.0
# Who only asks whether a lock is held, as a health check does, has it for a moment itself.
MOMENT_S = 1.0


class Taken(Exception):
    """Another process, or another part of this one, has the lock."""


def lock(file: Path) -> BaseFileLock:
    """Takes the lock of this file, which is made if need be and stays; `release()` gives it back. Waits for a moment;
    then raises Taken. Raises OSError."""
    from filelock import FileLock, Timeout

    held = FileLock(file, timeout=MOMENT_S)
    try:
        held.acquire(poll_interval=0.02)
    except Timeout as reason:
        raise Taken(str(file)) from reason
    return held


@contextlib.contextmanager
def folders_locked(folders: Iterable[Path]) -> Iterator[bool]:
    """One process, and one part of it, at a time in these folders; no file is made for it. True where the system locks all of
    them: Windows and some network folders do not. Waits for up to PATIENCE_S; then raises Taken with the folder."""
    with contextlib.ExitStack() as held:
        try:
            import fcntl
        except ImportError:
            yield False
            return
        alone = True
        # Always in one order, so that two processes never wait for each other.
        for folder in sorted({os.path.realpath(folder) for folder in folders}):
            try:
                handle = os.open(folder, os.O_RDONLY)
            except OSError:
                alone = False
                continue
            held.callback(os.close, handle)
            until = time.monotonic() + PATIENCE_S
            while True:
                try:
                    fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
                    break
                except BlockingIOError as reason:
                    if time.monotonic() > until:
                        raise Taken(folder) from reason
                    time.sleep(0.01)
                except OSError:
                    alone = False
                    break
        yield alone

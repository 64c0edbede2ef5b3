"""One process at a time: a lock on a file of its own, which ends with its process, on every system."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from filelock import BaseFileLock


class Taken(Exception):
    """Another process, or another part of this one, has the lock."""


def lock(file: Path) -> BaseFileLock:
    """Takes the lock of this file, which is made if need be and stays; `release()` gives it back. Raises Taken, OSError."""
    from filelock import FileLock, Timeout

    held = FileLock(file, timeout=0)
    try:
        held.acquire()
    except Timeout as reason:
        raise Taken(str(file)) from reason
    return held

"""A lock that one process has: who asks for a moment is waited for, who stays is named."""

from __future__ import annotations

import fcntl
import threading
from pathlib import Path

import pytest

from identification.common.locks import Taken, lock


def test_who_only_asks_for_it_is_waited_for(tmp_path: Path) -> None:
    """A container's health check takes the lock to see whether it is held; a watch that begins meanwhile must not end."""
    file = tmp_path / "lock"
    with file.open("w") as asking:
        fcntl.flock(asking, fcntl.LOCK_EX)
        threading.Timer(0.2, fcntl.flock, (asking, fcntl.LOCK_UN)).start()
        lock(file).release()


def test_who_keeps_it_is_not(tmp_path: Path) -> None:
    file = tmp_path / "lock"
    held = lock(file)
    with pytest.raises(Taken):
        lock(file)
    held.release()
    lock(file).release()

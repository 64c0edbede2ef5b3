"""A lock that one process has: who asks for a moment is waited for, who stays is named."""

from __future__ import annotations

import errno
import fcntl
import os
import threading
from pathlib import Path

import pytest

from identification.common.files import TEMPORARY, temporary_name, write_whole
from identification.common.locks import Taken, folders_locked, lock


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


def test_a_folder_that_the_system_does_not_lock_is_written_into_and_not_swept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Some network folders have no locks: a temporary file there may be another process' own. The other folders are locked."""
    def no_locks(handle: int, how: int) -> None:
        raise OSError(errno.ENOLCK, "no locks")

    with folders_locked([tmp_path]) as alone:
        assert alone
    handle = os.open(tmp_path, os.O_RDONLY)
    with folders_locked([tmp_path / "a none", tmp_path]) as alone:
        assert not alone
        with pytest.raises(BlockingIOError):
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    os.close(handle)
    left = tmp_path / f"{temporary_name(tmp_path / 'a.csv')}12345678{TEMPORARY}"
    left.write_text("another's")
    with monkeypatch.context() as patched:
        patched.setattr(fcntl, "flock", no_locks)
        write_whole({tmp_path / "a.csv": b"1"})
        assert left.exists()
    write_whole({tmp_path / "a.csv": b"2"})
    assert not left.exists()
    assert (tmp_path / "a.csv").read_bytes() == b"2"

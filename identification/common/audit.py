"""One line of JSON for everything that is done to a machine: who, when, from which computer, with which file and result."""

from __future__ import annotations

import errno
import getpass
import json
import os
import socket
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from identification.common.findings import error


def append(file: Path, entry: dict[str, Any]) -> None:
    """Appends the entry with user, host and time, onto the disk. Raises CompstiffError (CS0004)."""
    now = datetime.now(UTC).isoformat(timespec="milliseconds")
    line = {"time": now, "user": _user(), "host": socket.gethostname(), **entry}
    try:
        handle = os.open(file, os.O_RDWR | os.O_APPEND | os.O_CREAT | getattr(os, "O_BINARY", 0), 0o644)
        try:
            end = os.lseek(handle, 0, os.SEEK_END)
            # A line that a full disk tore stays by itself; what comes behind it is whole.
            torn = bool(end) and os.lseek(handle, end - 1, os.SEEK_SET) >= 0 and os.read(handle, 1) != b"\n"
            content = ("\n" * torn + json.dumps(line, allow_nan=False) + "\n").encode()
            if os.write(handle, content) < len(content):
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
            os.fsync(handle)
        finally:
            os.close(handle)
    except OSError as reason:
        raise error("CS0004", f"the log of what is applied cannot be written: {reason.strerror}", file=str(file),
                    hint="give another file with --log") from reason


def _user() -> str:
    """The login name; where the system knows none (a service, a container) that is said."""
    try:
        return getpass.getuser()
    except (OSError, KeyError, ImportError):      # ImportError: Windows without USERNAME, Python up to 3.12
        return "unknown"

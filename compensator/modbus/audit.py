"""One line of JSON for every push that is applied: who, when, which file, which table, with what result."""

from __future__ import annotations

import getpass
import json
import os
import socket
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from identification.common.findings import error

NAME = "push-log.jsonl"


def append(file: Path, entry: dict[str, Any]) -> None:
    """Appends the entry with user, host and time, onto the disk. Raises CompstiffError (CS0004)."""
    now = datetime.now(UTC).isoformat(timespec="milliseconds")
    line = {"time": now, "user": _user(), "host": socket.gethostname(), **entry}
    try:
        handle = os.open(file, os.O_WRONLY | os.O_APPEND | os.O_CREAT, 0o644)
        try:
            os.write(handle, (json.dumps(line, allow_nan=False) + "\n").encode())
            os.fsync(handle)
        finally:
            os.close(handle)
    except OSError as reason:
        raise error("CS0004", f"the log of pushes cannot be written: {reason.strerror}", file=str(file),
                    hint="give another file with --log") from reason


def _user() -> str:
    try:
        return getpass.getuser()
    except (OSError, KeyError):
        return f"uid {os.getuid()}"

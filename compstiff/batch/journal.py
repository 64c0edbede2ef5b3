"""The journal of a watched folder: what was begun and what was done, one line each, on the disk before the next step.

A process that is killed leaves at most a torn last line. A program that was begun and not done is taken again; its outputs are
written whole, so the second time gives the same files.
"""

from __future__ import annotations

import contextlib
import json
import os
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from identification.common.files import sweep
from identification.common.findings import Finding, counted, error
from identification.common.locks import Taken, lock

NAME = "compstiff-watch.jsonl"
LOCK = "compstiff-watch.lock"
FORMAT = "compstiff-watch"


class Journal:
    """The open journal of a folder, held by one process alone.

    last: of each program name the line of the job that was done last. outputs: every path (relative to the folder) a job was
    begun for: these files are the journal's own.
    """

    def __init__(self, folder: Path) -> None:
        """Raises CompstiffError: CS6005 another process holds it, CS0004 it cannot be written."""
        self.path = folder / NAME
        self.last: dict[str, dict[str, Any]] = {}
        self.outputs: set[str] = set()
        self.findings: tuple[Finding, ...] = ()
        try:
            self._lock = lock(folder / LOCK)
        except Taken as reason:
            raise error("CS6005", "another watch writes to this folder", file=str(self.path),
                        hint="end it first, or give each its own folder") from reason
        except OSError as reason:
            raise error("CS0004", f"cannot be written: {reason.strerror}", file=str(self.path)) from reason
        try:
            self._handle = os.open(self.path, os.O_RDWR | os.O_CREAT | os.O_APPEND | getattr(os, "O_BINARY", 0), 0o666)
        except OSError as reason:
            self._lock.release()
            raise error("CS0004", f"cannot be written: {reason.strerror}", file=str(self.path)) from reason
        self._read()

    def _read(self) -> None:
        text = self.path.read_bytes()
        broken = 0
        for line in text.split(b"\n"):
            if not line:
                continue
            try:
                entry = json.loads(line)
                if entry["event"] == "told":
                    broken = 0
                elif entry["event"] == "begun":
                    self.outputs |= set(entry["outputs"])
                    # Its files may be those of this job, done or not, and no more those of the one before.
                    self.last.get(entry["program"], {}).pop("key", None)
                else:
                    self.last[entry["program"]] = entry
            except (ValueError, KeyError, TypeError, RecursionError):
                broken += 1
        if text and not text.endswith(b"\n"):
            os.write(self._handle, b"\n")
        if broken:
            self.findings = (Finding("CS6007", "warning", f"{counted(broken, 'line')} cannot be read; what stood there is done "
                                     "again", file=str(self.path), hint="a crash leaves one torn line; more: check the disk"),)

    def told(self) -> None:
        """Says that somebody was told of the lines that cannot be read: they stay, and are no news at the next start."""
        if self.findings:
            self._append({"event": "told"})

    def sweep(self) -> None:
        """Deletes the temporary files that a killed process left beside the outputs."""
        for name in self.outputs:
            sweep(self.path.parent / name)

    def begun(self, program: str, key: str, outputs: list[str]) -> None:
        """Says that a program is about to be corrected into these files."""
        self._append({"event": "begun", "program": program, "key": key, "outputs": outputs})
        self.outputs |= set(outputs)

    def done(self, program: str, key: str, **more: Any) -> None:
        """Says that a program was dealt with; until its content changes it is not taken again."""
        self.last[program] = self._append({"event": "done", "program": program, "key": key, **more})

    def forget_failures(self) -> None:
        """Takes programs that could not be corrected for not yet done."""
        self.last = {program: entry for program, entry in self.last.items() if entry.get("exit_code") == 0}

    def _append(self, entry: dict[str, Any]) -> dict[str, Any]:
        entry = {"format": FORMAT, "version": 1, "time": datetime.now(UTC).isoformat(timespec="seconds"), **entry}
        line = (json.dumps(entry, allow_nan=False) + "\n").encode()
        try:
            if os.write(self._handle, line) < len(line):
                raise OSError(None, "no space left")
            os.fsync(self._handle)
        except OSError as reason:
            raise error("CS0004", f"cannot be written: {reason.strerror}; without it a program could be taken twice",
                        file=str(self.path), hint="free some space and start the watch again") from reason
        return entry

    def close(self) -> None:
        """Gives the journal back."""
        with contextlib.suppress(OSError):
            os.close(self._handle)
        self._lock.release()


def sync_folder(folder: Path) -> None:
    """Puts the names of a folder on the disk: a rename that was done is not lost when the power fails."""
    with contextlib.suppress(OSError):
        handle = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)

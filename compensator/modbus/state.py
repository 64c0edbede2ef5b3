"""What survives a power cut: the active table in a state directory, one rename from the old one to the new one.

`active.csv` is the table itself. Its header (id, window ...) stands beside it in `active.json`, under the SHA-256 of the
`active.csv` it belongs to, for the table before and the one that comes: that file is renamed into place first, so that the
rename of `active.csv` alone decides which table is active.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from compensator.modbus.wire import Header, OffsetTable, crc32, to_micrometres, to_registers
from identification.common.files import write_whole
from identification.common.findings import CompstiffError, error
from identification.common.locks import Taken, lock

COLUMNS = "target,ox_um,oy_um,oz_um"


class TableStore:
    """Keeps nothing: a device without a state directory."""

    def load(self) -> OffsetTable | None:
        """The table committed last."""
        return None

    def commit(self, table: OffsetTable) -> None:
        """Makes the table the one that a restart finds. Raises CompstiffError (CS0004); then the one before is."""


class TableFiles(TableStore):
    """Keeps the table in a directory; hold `locked(folder)` while using it."""

    def __init__(self, folder: Path) -> None:
        self.table, self.headers = folder / "active.csv", folder / "active.json"
        self.known: dict[str, dict[str, int]] = {}

    def load(self) -> OffsetTable | None:
        for left in self.table.parent.glob(".active.*.part"):
            left.unlink()
        if not self.table.exists():
            return None
        try:
            content = self.table.read_bytes()
            digest = hashlib.sha256(content).hexdigest()
            header = Header(**json.loads(self.headers.read_text(encoding="utf-8"))["tables"][digest])
            rows = np.loadtxt(content.decode().splitlines()[1:], delimiter=",", dtype=np.int64, ndmin=2)
            registers = to_registers(rows[:, 1:])
        except (OSError, ValueError, KeyError, TypeError) as reason:
            why = f"{self.headers.name} does not know it" if isinstance(reason, KeyError) else str(reason)
            raise _not_ours(self.table, why) from reason
        if (len(registers), crc32(registers)) != (header.rows, header.crc):
            raise _not_ours(self.table, "count or CRC differ")
        self.known = {digest: header.as_dict()}
        return OffsetTable(header, registers)

    def commit(self, table: OffsetTable) -> None:
        content = table_csv(table)
        digest = hashlib.sha256(content).hexdigest()
        headers = {**self.known, digest: table.header.as_dict()}
        record = {"format": "compstiff-active", "version": 1, "tables": headers}
        write_whole({self.headers: (json.dumps(record, indent=1) + "\n").encode(), self.table: content})
        self.known = {digest: table.header.as_dict()}
        # From the rename on the new table is the one on disk; should this fail, only a power cut could still undo it.
        with contextlib.suppress(OSError):
            _sync_folder(self.table.parent)


def table_csv(table: OffsetTable) -> bytes:
    """active.csv: every row of the table."""
    offset = to_micrometres(table.registers)
    rows = np.column_stack([table.header.first + np.arange(len(offset)), offset])
    # One format for all rows: twice as fast as row by row, and the client waits for it.
    return (COLUMNS + "\n" + "%d,%d,%d,%d\n" * len(rows) % tuple(rows.ravel().tolist())).encode()


@contextlib.contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Makes the directory and holds its lock. Raises CompstiffError: CS5101 another cell holds it, CS0004 not writable."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        held = lock(folder / "lock")
    except Taken as reason:
        raise error("CS5101", "another cell is running on this state directory", file=str(folder),
                    hint="stop that one, or give another --state") from reason
    except OSError as reason:
        raise error("CS0004", f"cannot be used as a state directory: {reason.strerror}", file=str(folder)) from reason
    try:
        yield
    finally:
        held.release()


def _not_ours(file: Path, why: str) -> CompstiffError:
    return error("CS5102", f"is not as the cell wrote it ({why})", file=str(file),
                 hint="move the state directory away and push again")


def _sync_folder(folder: Path) -> None:
    handle = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)

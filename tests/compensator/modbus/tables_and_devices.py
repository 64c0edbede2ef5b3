"""What the Modbus tests share: tables, a device in this process, a push with short timeouts, and what must hold after it."""

from __future__ import annotations

import asyncio
import csv
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from compensator.modbus import link as linking
from compensator.modbus import registers as at
from compensator.modbus.device import OffsetDevice
from compensator.modbus.embedded import Served, serve_cell
from compensator.modbus.link import Address, ExceptionReply, Link, LinkLost
from compensator.modbus.registers import Command
from compensator.modbus.server import Endpoint
from compensator.modbus.state import TableFiles, TableStore
from compensator.modbus.transfer import OLD, UNKNOWN, identify, push_table
from compensator.modbus.wire import OffsetTable, to_registers
from identification.common.findings import Finding, Refused, Unconfirmed
from identification.model.cell import Cell

ROBOT = "irb6660-205-1.90"
LIMIT_UM = 2000
ROWS = 90           # three pages, the last of ten rows
TIMEOUT_S = 10.0        # a reply that comes may come late on a machine with much else to do
LEASE_S = 0.3
# Requests of one push: identity, active, begin, pages, commit, read-back.
IDENTITY, BEFORE, BEGIN, PAGES, COMMIT, READ_BACK = 0, 1, 2, (3, 4, 5), 6, 7
linking.FIRST_PAUSE_S = 0.005


def random_table(
    seed: int, rows: int = ROWS, window: int = 1, windows: int = 1, first: int = 0, total: int | None = None
) -> OffsetTable:
    """Random offsets up to 1 mm a component."""
    registers = to_registers(np.random.default_rng(seed).integers(-1000, 1001, (rows, 3)))
    return OffsetTable.of(registers, first, rows if total is None else total, window, windows)


def offset_device(folder: Path | None = None, **options) -> OffsetDevice:
    return OffsetDevice(TableFiles(folder) if folder else TableStore(), LIMIT_UM, ROBOT, **{"lease_s": LEASE_S, **options})


def restart(device: OffsetDevice, store: TableStore) -> None:
    """The device as it is when it has started anew with what the store keeps; who holds it holds that one."""
    vars(device).update(vars(OffsetDevice(store, LIMIT_UM, ROBOT)))


def served_and_stopped(cell: Cell, endpoint: Endpoint) -> Served:
    """The cell, served and stopped at once. In a thread of its own: the browser of other tests keeps a loop in this one."""
    async def listen() -> Served:
        stop = asyncio.Event()
        stop.set()
        return await serve_cell(cell, endpoint, None, stop)

    with ThreadPoolExecutor(1) as pool:
        return pool.submit(lambda: asyncio.run(listen())).result()


def load(device: OffsetDevice, table: OffsetTable) -> None:
    """Commits a table without a network."""
    for command in ([Command.ABORT, *(device.receiving.header.registers() if device.receiving else table.header.registers())],
                    [Command.BEGIN, *table.header.registers()]):
        device.write(at.COMMAND, command)
    for page in range(table.header.pages):
        device.write(at.PAGE, table.page(page))
    device.write(at.COMMAND, [Command.COMMIT, *table.header.registers()])


@dataclass(frozen=True)
class Ending:
    """How a push ended: its exit code and what it said, with its finding where it was stopped."""

    code: int
    text: str
    finding: Finding | None = None


def push(
    port: int, table: OffsetTable, *, timeout_s: float = TIMEOUT_S, retries: int = 2, patience_s: float = 1.0, tls=None
) -> Ending:
    """One push, as the command does it."""
    with Link(Address("127.0.0.1", port, 1, timeout_s, retries, tls)) as link:
        try:
            identify(link, ROBOT)
            return Ending(0, push_table(link, table, patience_s, lambda page, pages: None))
        except (LinkLost, ExceptionReply) as reason:
            return Ending(4, f"{UNKNOWN}: {reason}")
        except (Refused, Unconfirmed) as stopped:
            return Ending(stopped.exit_code, stopped.findings[0].message, stopped.findings[0])


def rows_on_disk(folder: Path) -> list[list[int]] | None:
    """The offsets in active.csv."""
    file = folder / "active.csv"
    if not file.exists():
        return None
    with file.open(newline="") as stream:
        rows = list(csv.reader(stream))
    assert rows[0] == ["target", "ox_um", "oy_um", "oz_um"]
    assert [int(row[0]) for row in rows[1:]] == list(range(len(rows) - 1))
    return [[int(um) for um in row[1:]] for row in rows[1:]]


def offsets_of(table: OffsetTable) -> list[list[int]]:
    return (table.registers.astype(int) - 32768).tolist()


def check_honest(ending: Ending, active: list[list[int]] | None, old: OffsetTable, new: OffsetTable) -> None:
    """The active table is the old or the new one, whole, and the exit code and message say which."""
    assert active in (offsets_of(old), offsets_of(new))
    if ending.code == 0:
        assert active == offsets_of(new), ending
    elif OLD in ending.text:
        assert active == offsets_of(old), ending
    else:
        assert UNKNOWN in ending.text, ending
        assert ending.code == 4


class DeviceProcess:
    """`compstiff cell` as a process of its own, to be killed. cell.yaml and the state directory lie in `folder`."""

    def __init__(self, folder: Path, *, keeps: bool = True) -> None:
        self.state, self.port = folder / "state", 0
        self.options = ["--state", str(self.state)] if keeps else []
        self.file = folder / "cell.yaml"
        self.file.write_text(f"robot: {ROBOT}\ntool: {{position_mm: [120, 0, 250]}}\nmodbus: {{port: 1}}\n")
        self.start()

    def start(self) -> None:
        self.process = subprocess.Popen(
            [sys.executable, "-m", "compstiff", "cell", str(self.file), "--port", str(self.port), *self.options],
            stderr=subprocess.PIPE, stdout=subprocess.DEVNULL, text=True)
        assert self.process.stderr
        line = self.process.stderr.readline()
        while not self.options and line and not line.startswith("listening"):
            line = self.process.stderr.readline()
        if not line.startswith("listening on 127.0.0.1:"):
            self.kill()
            raise AssertionError(line)
        self.port = int(line.split(":")[1].split()[0])

    def kill(self) -> None:
        """kill -9."""
        self.process.kill()
        self._gone()

    def _gone(self) -> int:
        code = self.process.wait(20)
        assert self.process.stderr
        self.process.stderr.close()
        return code

    def __enter__(self) -> DeviceProcess:
        return self

    def __exit__(self, *_: object) -> None:
        self.kill()

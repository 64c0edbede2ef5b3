"""The device's side of the register map: sequence, CRC, limits, one writer at a time, a table active whole or not at all.

No Modbus in here: `read` and `write` take addresses and register values and raise `RefusedWrite` with a Modbus
exception code.
"""

from __future__ import annotations

import math
import struct
import time
import zlib
from collections.abc import Callable
from dataclasses import dataclass

from compensator.modbus import registers as at
from compensator.modbus.registers import Command, Refusal, Result, Robot, State
from compensator.modbus.state import TableStore
from compensator.modbus.wire import (
    EMPTY,
    NO_OFFSET,
    PAGE_ROWS,
    Header,
    OffsetTable,
    acceptable,
    crc32,
    from_bytes,
    joined,
    split,
)
from identification.common.findings import CompstiffError

# A writer that has been silent this long has lost its transfer to whoever begins the next.
LEASE_S = 5.0
# A robot whose heartbeat has not changed this long no longer counts as running.
ROBOT_STALE_S = 5.0


class RefusedWrite(Exception):
    """A request that is answered by a Modbus exception."""

    def __init__(self, code: Refusal, result: Result = Result.NONE) -> None:
        self.code, self.result = code, result
        super().__init__(f"{code.name}: {result.name}")


@dataclass
class Receiving:
    """A transfer that is not committed yet."""

    header: Header
    pages: list[bytes]
    touched: float


class OffsetDevice:
    """A Modbus device that holds one table of offsets. limit_um: longest offset accepted; robot: its name; clock in seconds."""

    def __init__(
        self, store: TableStore, limit_um: int, robot: str, clock: Callable[[], float] = time.monotonic,
        lease_s: float = LEASE_S, window_rows: int = at.WINDOW_ROWS,
    ) -> None:
        self.store, self.limit_um, self.clock, self.lease_s, self.window_rows = store, limit_um, clock, lease_s, window_rows
        self.robot_id = zlib.crc32(robot.encode())
        self.active = store.load()
        self.receiving: Receiving | None = None
        self.result = Result.NONE
        self.commits = 0
        self.robot = [0] * at.ROBOT_REGISTERS
        self.robot_seen = -math.inf
        # Whether the robot has run with the active table; a restart cannot know and believes it.
        self.ran = self.active is not None
        self._table: list[int] = []
        self._show_table()

    def read(self, address: int, count: int) -> list[int]:
        """Registers `address` ... Raises RefusedWrite(ADDRESS) outside the map."""
        if address >= at.TABLE:
            values = self._table[address - at.TABLE:address - at.TABLE + count]
        elif address < at.IDENTITY + at.IDENTITY_REGISTERS:
            values = self._identity()[address:address + count]
        else:
            values = []
            for start, block in ((at.STATUS, self._status), (at.ACTIVE, self._header), (at.ROBOT, lambda: self.robot),
                                 (at.ANSWER, self._answer)):
                if start <= address < start + 16:
                    values = block()[address - start:address - start + count]
        if len(values) != count:
            raise RefusedWrite(Refusal.ADDRESS)
        return values

    def write(self, address: int, values: list[int]) -> None:
        """One write request. Raises RefusedWrite; what is refused changes nothing but the register `last result`."""
        try:
            if address == at.PAGE:
                self._page(values)
            elif address == at.COMMAND:
                self._command(values)
            elif address >= at.ROBOT and address + len(values) <= at.ROBOT + at.ROBOT_REGISTERS:
                self._robot(address - at.ROBOT, values)
            else:
                raise RefusedWrite(Refusal.ADDRESS)
        except RefusedWrite as refused:
            self.result = refused.result or self.result
            raise

    def _command(self, values: list[int]) -> None:
        if len(values) != at.COMMAND_REGISTERS or values[0] not in tuple(Command):
            raise RefusedWrite(Refusal.VALUE, Result.HEADER)
        header = Header.from_registers(values[1:])
        if values[0] == Command.BEGIN:
            self._begin(header)
        elif values[0] == Command.COMMIT:
            self._commit(header)
        elif self.receiving and self.receiving.header.id == header.id:
            self.receiving = None

    def _begin(self, header: Header) -> None:
        if not (header.id and 1 <= header.rows <= self.window_rows and header.first + header.rows <= header.total
                and 1 <= header.window <= header.windows):
            raise RefusedWrite(Refusal.VALUE, Result.HEADER)
        now = self.clock()
        if self.receiving and self.receiving.header == header:
            self.receiving.touched = now        # repeated: the pages that are here stay
            return
        if self.receiving and now - self.receiving.touched < self.lease_s:
            raise RefusedWrite(Refusal.BUSY, Result.OTHER_WRITER)
        self.receiving = Receiving(header, [], now)

    def _page(self, values: list[int]) -> None:
        receiving = self.receiving
        if len(values) < 3:
            raise RefusedWrite(Refusal.VALUE, Result.PAGE_LENGTH)
        page = values[2]
        if not receiving or receiving.header.id != joined(values[:2]) or page > len(receiving.pages):
            raise RefusedWrite(Refusal.SEQUENCE, Result.SEQUENCE)
        if page >= receiving.header.pages or len(values) != 3 + 3 * receiving.header.page_rows(page):
            raise RefusedWrite(Refusal.VALUE, Result.PAGE_LENGTH)
        # Kept as it came; what it says is judged at the commit, over the whole table at once.
        rows = struct.pack(f">{len(values) - 3}H", *values[3:])
        if page == len(receiving.pages):
            receiving.pages.append(rows)
        elif receiving.pages[page] != rows:
            self.receiving = None
            raise RefusedWrite(Refusal.SEQUENCE, Result.PAGE_CHANGED)
        receiving.touched = self.clock()

    def _commit(self, header: Header) -> None:
        if header and header == self._active_header():
            # Repeated, because the reply was lost: it is done.
            if self.receiving and self.receiving.header == header:
                self.receiving = None
            return
        receiving = self.receiving
        if not receiving or receiving.header != header or len(receiving.pages) < header.pages:
            raise RefusedWrite(Refusal.SEQUENCE, Result.SEQUENCE)
        registers = from_bytes(b"".join(receiving.pages))
        if crc32(registers) != header.crc:
            self.receiving = None
            raise RefusedWrite(Refusal.SEQUENCE, Result.CRC)
        if not acceptable(registers, self.limit_um):
            self.receiving = None
            raise RefusedWrite(Refusal.VALUE, Result.OFFSET)
        receiving.touched = self.clock()
        if self.robot[1] == Robot.RUNNING and self.clock() - self.robot_seen < ROBOT_STALE_S:
            raise RefusedWrite(Refusal.BUSY, Result.ROBOT_RUNNING)
        table = OffsetTable(header, registers)
        try:
            self.store.commit(table)
        except CompstiffError as reason:
            raise RefusedWrite(Refusal.FAILURE, Result.STORAGE) from reason
        self.active, self.receiving = table, None
        self.commits += 1
        self.ran = False
        self._show_table()

    def _robot(self, place: int, values: list[int]) -> None:
        if not values:
            raise RefusedWrite(Refusal.VALUE)
        if place == 0 and values[0] != self.robot[0]:
            self.robot_seen = self.clock()
        self.robot[place:place + len(values)] = values
        self.ran = self.ran or (self.robot[1] == Robot.RUNNING and self._robot_has_active())

    def _robot_has_active(self) -> bool:
        return self.active is not None and self.robot[3:5] == list(split(self.active.header.id))

    def _finished(self) -> int:
        window = self._active_header().window
        done = self.ran and self._robot_has_active() and self.robot[1] == Robot.WINDOW_DONE and self.robot[5] == window
        return window if done else 0

    def _active_header(self) -> Header:
        return self.active.header if self.active else EMPTY

    def _show_table(self) -> None:
        self._table = self.active.registers.ravel().tolist() if self.active else []

    def _heartbeat(self) -> int:
        return int(2 * self.clock()) & 0xFFFF

    def _identity(self) -> list[int]:
        return [*at.MAGIC, at.MAP_VERSION, PAGE_ROWS, self.window_rows, self.limit_um, *split(self.robot_id)]

    def _status(self) -> list[int]:
        receiving = self.receiving
        return [State.RECEIVING if receiving else State.IDLE, self.result, *split(receiving.header.id if receiving else 0),
                len(receiving.pages) if receiving else 0, self.commits & 0xFFFF, self._heartbeat(),
                self._finished()]

    def _header(self) -> list[int]:
        return self._active_header().registers()

    def _answer(self) -> list[int]:
        header, row = self._active_header(), self.robot[2]
        offset = self._table[3 * row:3 * row + 3] or [NO_OFFSET[0]] * 3
        return [*split(header.id), header.rows, self._heartbeat(), row, *offset, (row + sum(offset)) & 0xFFFF,
                header.window, header.windows]

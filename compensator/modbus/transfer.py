"""One table into the device: begin, pages, commit, read back; and when that fails, find out what is active.

A table's id is made from its content, and every step may be repeated. Whatever happens on the way, `push_table` ends in one
of these: the table is active and read back; the one before is, read back after this transfer was withdrawn so that nothing
late can commit it; another one is; or nothing can be said.
"""

from __future__ import annotations

import time
import zlib
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from compensator.modbus import registers as at
from compensator.modbus.link import Address, ExceptionReply, Link, LinkLost
from compensator.modbus.registers import Command, Refusal, Result
from compensator.modbus.wire import EMPTY, HEADER_REGISTERS, PAGE_ROWS, Header, OffsetTable, joined
from identification.common.findings import CompstiffError, Finding, Refused, Unconfirmed

# Transfers that lose their place (a restarted device, another writer) begin again this often.
ROUNDS = 5
PATIENCE_S = 12.0
POLL_S = 0.1
OLD, UNKNOWN = "old table active (read back)", "state unknown"
AGAIN = "pushing again is safe and settles it"

Progress = Callable[[int, int], None]


@dataclass(frozen=True)
class Identity:
    """What the device says of itself: rows of a table at most, longest offset [um]."""

    window_rows: int
    limit_um: int


class _OutOfSequence(Exception):
    """The device does not know this transfer (any more)."""


def identify(link: Link, robot: str) -> Identity:
    """Reads the identity registers. Raises Refused (CS5010) for another device or robot; LinkLost, ExceptionReply."""
    try:
        values = link.read(at.IDENTITY, at.IDENTITY_REGISTERS)
    except ExceptionReply as reply:
        if reply.code in (Refusal.FUNCTION, Refusal.ADDRESS):
            raise _wrong_device(link.address, str(reply)) from reply
        raise
    if tuple(values[:2]) != at.MAGIC:
        raise _wrong_device(link.address, f"registers 0 and 1 are {values[0]} and {values[1]}")
    if values[2] != at.MAP_VERSION:
        raise _wrong_device(link.address, f"its register map has version {values[2]}, this program knows {at.MAP_VERSION}")
    if values[3] != PAGE_ROWS or not values[4]:
        raise _wrong_device(link.address, f"it states pages of {values[3]} and windows of {values[4]} rows")
    if joined(values[6:8]) != zlib.crc32(robot.encode()):
        raise _wrong_device(link.address, f"it is not the cell of the robot {robot}")
    return Identity(min(values[4], at.WINDOW_ROWS), values[5])


def read_active(link: Link) -> Header:
    """The header of the active table, EMPTY where there is none."""
    return Header.from_registers(link.read(at.ACTIVE, HEADER_REGISTERS))


def read_table(link: Link) -> OffsetTable:
    """The active table with its offsets, read until the header is the same before and after."""
    for _ in range(ROUNDS):
        header = read_active(link)
        if not header:
            break
        registers = np.array(link.read(at.TABLE, 3 * header.rows), np.uint16).reshape(-1, 3)
        if read_active(link) == header:
            return OffsetTable(header, registers)
    return OffsetTable(EMPTY, np.empty((0, 3), np.uint16))


def push_table(
    link: Link, table: OffsetTable, patience_s: float, progress: Progress, previous: Header | None = None
) -> str:
    """Makes the table the active one and reads it back; returns how it went, for the log. previous: the window of this program
    before it, where this call knows that one active.

    Raises Unconfirmed: CS5012 the device is lost or does not confirm, CS5013 busy. Refused: CS5011 it refuses the content,
    CS5014 another table is active after the commit.
    """
    sent_commit = False
    before: Header | None = None
    try:
        before = read_active(link)
        if before == table.header:
            return "already active"
        for _ in range(ROUNDS):
            try:
                _send_pages(link, table, patience_s, progress)
                sent_commit = True
                _write(link, at.COMMAND, [Command.COMMIT, *table.header.registers()], patience_s)
                break
            except _OutOfSequence:
                active = read_active(link)
                if sent_commit and active not in (before, EMPTY):
                    break
        active = read_active(link)
    except (LinkLost, ExceptionReply) as reason:
        return _settle(link, table, before, previous, reason, sent_commit)
    if active == table.header:
        return "committed"
    if active == before:
        return _settle(link, table, before, previous, LinkLost(f"the transfer lost its place {ROUNDS} times"), sent_commit)
    raise Refused(another(active))


def withdraw(link: Link, table: OffsetTable) -> Header:
    """Withdraws the transfer, so that no late commit can succeed, and reads what is active."""
    link.write(at.COMMAND, [Command.ABORT, *table.header.registers()])
    return read_active(link)


def _send_pages(link: Link, table: OffsetTable, patience_s: float, progress: Progress) -> None:
    header = table.header
    _write(link, at.COMMAND, [Command.BEGIN, *header.registers()], patience_s)
    for page in range(header.pages):
        _write(link, at.PAGE, table.page(page), patience_s)
        progress(page + 1, header.pages)


def _write(link: Link, address: int, values: list[int], patience_s: float) -> None:
    """A write that waits while the device is busy. Raises _OutOfSequence, LinkLost, ExceptionReply."""
    until = time.monotonic() + patience_s
    while True:
        try:
            return link.write(address, values)
        except ExceptionReply as reply:
            if reply.code == Refusal.SEQUENCE:
                raise _OutOfSequence from reply
            if reply.code != Refusal.BUSY or time.monotonic() > until:
                raise
        time.sleep(POLL_S)


def _settle(
    link: Link, table: OffsetTable, before: Header | None, previous: Header | None, reason: Exception, sent_commit: bool
) -> str:
    """After a failure: what is active? Returns where it is this table after all, else raises."""
    why = ""
    try:
        active = withdraw(link, table)
        if isinstance(reason, ExceptionReply):
            why = _explained(link.read(at.RESULT, 1)[0])
    except (LinkLost, ExceptionReply):
        header = table.header
        sent = ("a commit was sent" if sent_commit else "no commit was sent, so this call changed nothing"
                if header.windows == 1 else f"no commit of window {header.window} of {header.windows} was sent")
        raise Unconfirmed(Finding("CS5012", "error", f"the cell at {link.address} is not reachable or did not confirm: "
                                  f"{reason}; {UNKNOWN} ({sent})", hint=AGAIN)) from reason
    if active == table.header:
        return "committed, the reply was lost"
    if before is not None and active != before:
        raise Refused(another(active)) from reason
    state = in_place(active) if active == previous else unchanged(active)
    code = reason.code if isinstance(reason, ExceptionReply) else 0
    if code == Refusal.VALUE:
        raise Refused(Finding("CS5011", "error", f"the cell refused the table{why}; {state}",
                              hint="compare limits.max_offset_mm of both sides")) from reason
    if code == Refusal.BUSY:
        raise Unconfirmed(Finding("CS5013", "error", f"the cell is busy{why}; {state}", hint=AGAIN)) from reason
    raise Unconfirmed(Finding("CS5012", "error", f"the cell at {link.address} did not confirm: {reason}{why}; {state}",
                              hint=AGAIN)) from reason


def _explained(result: int) -> str:
    texts = {Result.OFFSET: "an offset over its limit", Result.STORAGE: "its state directory cannot be written",
             Result.OTHER_WRITER: "another writer's transfer is under way", Result.HEADER: "the header of the table",
             Result.ROBOT_RUNNING: "the robot is running with the active table", Result.PAGE_LENGTH: "the length of a page"}
    known = {int(key): text for key, text in texts.items()}
    return f": {known[result]}" if result in known else ""


def unchanged(active: Header) -> str:
    """That the table from before this call is active, in words."""
    return OLD if active else f"{OLD}: none"


def in_place(active: Header) -> str:
    """That this window of the program is active, in words."""
    return f"window {active.window} of {active.windows} is active (read back)"


def another(active: Header) -> Finding:
    """That neither the table that was sent nor the one before is active (CS5014), but this one, or none."""
    what = f"table {active.name} with {active.rows} rows is active (read back)" if active else "no table is active (read back)"
    return Finding("CS5014", "error", f"the active table is neither this one nor the one before: {what}",
                   hint="somebody else pushed at the same time; settle who may, then push again" if active else
                   "the cell was restarted, and without --state it keeps no table; push again")


def unreachable(address: Address, reason: Exception) -> Unconfirmed:
    """A device that could not even be asked."""
    return Unconfirmed(Finding("CS5012", "error", f"the cell at {address} is not reachable or did not confirm: {reason}; "
                               f"{UNKNOWN} (nothing was sent, so this call changed nothing)", hint=AGAIN))


def _wrong_device(address: Address, why: str) -> CompstiffError:
    return Refused(Finding("CS5010", "error", f"what listens at {address} is not this cell: {why}",
                           hint="check modbus.host, port and unit in cell.yaml, and robot"))

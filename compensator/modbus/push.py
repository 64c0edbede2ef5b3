"""`push`: the offsets of a program into the device, dry or applied: check, compare with what is active, transfer, log."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from compensator.modbus.link import Address, ExceptionReply, Link, LinkLost
from compensator.modbus.offset_file import Offsets, check_offsets, tables_of
from compensator.modbus.receiver import Receiver
from compensator.modbus.registers import WINDOW_ROWS
from compensator.modbus.transfer import (
    PATIENCE_S,
    UNKNOWN,
    Identity,
    Progress,
    identify,
    in_place,
    read_table,
    unchanged,
    unreachable,
    withdraw,
)
from compensator.modbus.windows import ROBOT_PATIENCE_S, push_windows
from compensator.modbus.wire import ROUNDING_UM, OffsetTable, to_micrometres
from identification.common import audit
from identification.common.findings import CompstiffError, Finding, Interrupted, Refused, counted
from identification.model.cell import Cell
from identification.model.controller import check_rapid

LOG = "push-log.jsonl"


@dataclass(frozen=True)
class Waiting:
    """How long to wait: patience_s for a busy device, robot_s for a sign of the robot. restart: from the first window."""

    patience_s: float = PATIENCE_S
    robot_s: float = ROBOT_PATIENCE_S
    restart: bool = False


@dataclass(frozen=True, eq=False)
class PushResult:
    """What a push would send, or has sent. limit [m] of an offset; tables: the offsets as the device wants them; active: the
    table that was active before, None if not asked; endings: how each window went, none in a dry run."""

    offsets: Offsets
    address: Address
    limit: float
    tables: list[OffsetTable]
    active: OffsetTable | None
    findings: tuple[Finding, ...]
    endings: tuple[str, ...] = ()

    @property
    def applied(self) -> bool:
        """Whether anything was sent."""
        return bool(self.endings)

    @property
    def difference(self) -> dict[str, Any] | None:
        """What the active window, or else the first, changes in the active table (JSON values); None where the device was not
        asked."""
        if self.active is None:
            return None
        old = self.active
        new = next((table for table in self.tables if table.header == old.header), self.tables[0])
        first = max(new.header.first, old.header.first)
        count = max(min(new.header.first + new.header.rows, old.header.first + old.header.rows) - first, 0)
        change = (to_micrometres(new.registers[first - new.header.first:][:count])
                  - to_micrometres(old.registers[first - old.header.first:][:count])) if count else np.zeros((0, 3))
        return {"same": new.header == old.header, "rows_in_both": count, "rows_changed": int(change.any(axis=1).sum()),
                "rows_only_new": new.header.rows - count, "rows_only_active": old.header.rows - count,
                "largest_change_mm": round(1e-3 * float(np.linalg.norm(change, axis=1).max()), 6) if count else 0.0}

    def as_dict(self) -> dict[str, Any]:
        """JSON values."""
        offsets, address = self.offsets, self.address
        turn = np.degrees(np.nanmax(offsets.turn)) if np.isfinite(offsets.turn).any() else None
        return {
            "target": {"host": address.host, "port": address.port, "unit": address.unit, "tls": address.tls is not None},
            "rows": len(offsets.offset), "first_target": offsets.first,
            "largest_offset_mm": round(1e3 * float(offsets.length.max()), 6),
            "largest_at_target": offsets.first + offsets.worst,
            "limit_mm": round(1e3 * self.limit, 6), "turn_not_sent_deg": turn,
            "tables": [table.header.as_dict() for table in self.tables],
            "active_before": self.active.header.as_dict() if self.active and self.active.header else None,
            "difference": self.difference, "applied": self.applied, "results": list(self.endings),
        }

    def lines(self) -> list[str]:
        """What the terminal shows."""
        offsets, tables = self.offsets, self.tables
        last = offsets.first + len(offsets.offset) - 1
        cut = f"table {tables[0].header.name}" if len(tables) == 1 else f"{len(tables)} windows"
        pages = sum(table.header.pages for table in tables)
        end = (f"new table active (read back): {tables[-1].header.name}, {self.endings[-1]}" if self.applied
               else "dry run: nothing was sent")
        return [
            f"cell: {self.address}",
            f"rows: {len(offsets.offset)}, targets {offsets.first} to {last}, {counted(pages, 'page')}, {cut}",
            f"largest offset: {1e3 * offsets.length.max():.4f} mm at target {offsets.first + offsets.worst}, limit "
            f"{1e3 * self.limit:g} mm; sent in whole micrometres",
            *self._difference_lines(), end]

    def _difference_lines(self) -> list[str]:
        change = self.difference
        if self.active is None or change is None:
            return []
        header = self.active.header
        if not header:
            return ["active table: none"]
        if change["same"]:
            return [f"active table: {header.name}, {header.rows} rows: this one, nothing differs"]
        return [f"active table: {header.name}, {header.rows} rows: {change['rows_changed']} of {change['rows_in_both']} "
                f"common rows differ, by up to {change['largest_change_mm']:.3f} mm; {counted(change['rows_only_new'], 'row')} "
                f"new, {change['rows_only_active']} go"]


def push(
    cell: Cell, offsets: Offsets, address: Address, *, apply: bool = False, waiting: Waiting | None = None,
    receiver: Receiver | None = None, log: Path | None = None, progress: Progress = lambda page, pages: None,
    say: Callable[[str], None] = lambda text: None,
) -> PushResult:
    """Sends the offsets to the device at the address if `apply`; else says what would be sent (a dry run needs no device).

    receiver: the RAPID module to write, before anything is sent. log: file that keeps every push that is applied. progress:
    called with page and pages; say: with a line for each of several windows. Raises Refused: CS5003 over the cell's limit,
    CS5004 too large for a register, CS5010 another device, CS5011 over the device's limit, CS5014 another writer;
    Unconfirmed: CS5012 the device is lost or does not confirm (of a dry run a warning, CS5015), CS5013 busy, CS5016 no sign
    of the robot; Interrupted (CS5018); CompstiffError: CS0003 the receiver exists, CS0004 a file cannot be written,
    CS0060 a receiver for another maker's robot.

    >>> cell = compstiff.read_cell("cell.yaml")
    >>> address = compstiff.Address(cell.modbus.host, cell.modbus.port, cell.modbus.unit)
    >>> dry_run = compstiff.push(cell, compstiff.read_offsets("offsets.csv", reach_mm=10.0), address)
    >>> print(dry_run.lines()[-1])
    dry run: nothing was sent
    """
    if receiver:
        check_rapid(cell.robot, "--receiver writes RAPID")
    check_offsets(offsets, cell.max_offset)
    result = _compared(cell, offsets, address, needed=apply)
    if receiver:
        receiver.write(result.tables, cell.max_offset, offsets.source)
    if not apply:
        return result
    try:
        endings = _transferred(result, waiting or Waiting(), log, progress, say)
    except KeyboardInterrupt as interrupt:
        raise Interrupted(_after_interrupt(result)) from interrupt
    return replace(result, endings=tuple(endings))


def _compared(cell: Cell, offsets: Offsets, address: Address, *, needed: bool) -> PushResult:
    """Asks the device what it holds. needed: raise Unconfirmed (CS5012) if it cannot be asked, else a warning (CS5015)."""
    try:
        with Link(address if needed else replace(address, retries=0)) as link:
            identity = identify(link, cell.robot.name)
            _check_limit(offsets, identity)
            active = read_table(link)
    except (LinkLost, ExceptionReply) as reason:
        if needed:
            raise unreachable(address, reason) from reason
        warning = Finding("CS5015", "warning", f"the cell at {address} could not be asked ({reason}): not compared with the "
                          "active table", hint="start the cell, or check modbus.host and port")
        tables, several = _windows(offsets, WINDOW_ROWS)
        return PushResult(offsets, address, cell.max_offset, tables, None, (*offsets.findings, *several, warning))
    tables, several = _windows(offsets, identity.window_rows)
    return PushResult(offsets, address, cell.max_offset, tables, active, (*offsets.findings, *several))


def _windows(offsets: Offsets, rows: int) -> tuple[list[OffsetTable], tuple[Finding, ...]]:
    """The tables of up to so many rows, and a note (CS5021) where they are several."""
    tables = tables_of(offsets, rows)
    return tables, () if len(tables) == 1 else (Finding(
        "CS5021", "note", f"{len(offsets.offset)} rows go in {len(tables)} windows of up to {rows}: each is active whole or "
        "not at all, the program as a whole is not", file=offsets.source),)


def _check_limit(offsets: Offsets, identity: Identity) -> None:
    largest = int(np.ceil(1e6 * offsets.length.max() - 1e-6))
    if largest > identity.limit_um + ROUNDING_UM:
        raise Refused(Finding("CS5011", "error", f"the largest offset, {1e-3 * largest:.3f} mm at target "
                              f"{offsets.first + offsets.worst}, is over the cell's own limit, {1e-3 * identity.limit_um:.3f} "
                              "mm", file=offsets.source, hint="nothing was sent; compare limits.max_offset_mm of both sides"))


def _transferred(
    planned: PushResult, waiting: Waiting, log: Path | None, progress: Progress, say: Callable[[str], None]
) -> list[str]:
    """Pushes all windows and logs it; returns how each went. Raises what push_windows raises, CS0004 for the log."""
    offsets, address = planned.offsets, planned.address
    entry = {"offsets": offsets.source, "sha256": offsets.sha256, "cell": str(address),
             "tables": [table.header.name for table in planned.tables], "rows": len(offsets.offset)}

    def keep(**more: Any) -> None:
        if log:
            audit.append(log, {**entry, **more})

    keep(result="started")
    try:
        with Link(address) as link:
            try:
                endings = push_windows(link, planned.tables, patience_s=waiting.patience_s, robot_s=waiting.robot_s,
                                       restart=waiting.restart, progress=progress, say=say)
            except (LinkLost, ExceptionReply) as reason:
                raise unreachable(address, reason) from reason
    except CompstiffError as stopped:
        keep(result=stopped.findings[0].message, exit_code=stopped.exit_code)
        raise
    except KeyboardInterrupt:
        keep(result="interrupted", exit_code=Interrupted.exit_code)
        raise
    keep(result="; ".join(endings), exit_code=0)
    return endings


def _after_interrupt(planned: PushResult) -> Finding:
    """Withdraws what Ctrl-C left half done and says what is active."""
    before = planned.active.header if planned.active else None
    try:
        with Link(replace(planned.address, retries=0)) as link:
            for table in planned.tables:
                active = withdraw(link, table)
    except (LinkLost, ExceptionReply):
        return Finding("CS5018", "error", f"interrupted; {UNKNOWN}", hint="push again to settle it")
    if any(table.header == active for table in planned.tables):
        state = in_place(active) if active.windows > 1 else "new table active (read back)"
    elif active == before:
        state = unchanged(active)
    else:
        state = f"table {active.name} is active (read back)" if active else "no table is active (read back)"
    return Finding("CS5018", "error", f"interrupted; {state}")

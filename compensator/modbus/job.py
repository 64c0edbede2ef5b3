"""What `push` does, dry or applied: plan, compare, transfer, log."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from compensator.modbus import audit
from compensator.modbus.link import Address, ExceptionReply, Link, LinkLost
from compensator.modbus.offset_file import Offsets, windows
from compensator.modbus.push import OLD, UNKNOWN, Device, Progress, Table, identify, read_table, unreachable, withdraw
from compensator.modbus.registers import WINDOW_ROWS
from compensator.modbus.walk import push_windows
from compensator.modbus.wire import ROUNDING_UM, to_micrometres
from identification.common.files import sha256
from identification.common.findings import CompstiffError, Finding, Refused
from identification.model.cell import Cell


@dataclass(frozen=True, eq=False)
class Plan:
    """Offsets, cut into tables as the device wants them; active: the table that is active now, None if not asked."""

    offsets: Offsets
    tables: list[Table]
    active: Table | None
    findings: tuple[Finding, ...]


@dataclass(frozen=True)
class Waiting:
    """How long to wait: patience_s for a busy cell, robot_s for a sign of the robot. restart: from the first window."""

    patience_s: float
    robot_s: float
    restart: bool


def limit_um(cell: Cell) -> int:
    """The limit as the cell states it in a register."""
    return min(math.floor(1e6 * cell.max_offset + 1e-6), 0xFFFF)


def plan_push(cell: Cell, offsets: Offsets, address: Address, *, needed: bool) -> Plan:
    """Asks the cell what it holds. needed: raise Unconfirmed (CS5012) if it cannot be asked, else a warning (CS5015).

    Raises Refused: CS5010 another device, CS5011 the cell's own limit is lower.
    """
    try:
        with Link(address if needed else replace(address, retries=0)) as link:
            device = identify(link, cell.robot.name)
            _check_limit(offsets, device)
            active = read_table(link)
    except (LinkLost, ExceptionReply) as reason:
        if needed:
            raise unreachable(address, reason) from reason
        warning = Finding("CS5015", "warning", f"the cell at {address} could not be asked ({reason}): not compared with the "
                          "active table", hint="start the cell, or check modbus.host and port")
        return Plan(offsets, windows(offsets, WINDOW_ROWS), None, (warning,))
    tables = windows(offsets, device.window_rows)
    findings = () if len(tables) == 1 else (Finding(
        "CS5021", "note", f"{len(offsets.offset)} rows go in {len(tables)} windows of up to {device.window_rows}: each is "
        "active whole or not at all, the program as a whole is not"),)
    return Plan(offsets, tables, active, findings)


def apply_push(
    plan: Plan, address: Address, waiting: Waiting, log: Path, progress: Progress, say: Callable[[str], None]
) -> list[str]:
    """Pushes all windows and logs it; returns how each went. Raises what push_windows raises, CS0004 for the log."""
    entry = {"offsets": plan.offsets.source, "sha256": sha256(plan.offsets.source), "cell": str(address),
             "tables": [table.header.name for table in plan.tables], "rows": len(plan.offsets.offset)}
    audit.append(log, {**entry, "result": "started"})
    try:
        with Link(address) as link:
            try:
                done = push_windows(link, plan.tables, patience_s=waiting.patience_s, robot_s=waiting.robot_s,
                                    restart=waiting.restart, progress=progress, say=say)
            except (LinkLost, ExceptionReply) as reason:
                raise unreachable(address, reason) from reason
    except CompstiffError as stopped:
        audit.append(log, {**entry, "result": stopped.findings[0].message, "exit_code": stopped.exit_code})
        raise
    except KeyboardInterrupt:
        audit.append(log, {**entry, "result": "interrupted", "exit_code": 130})
        raise
    audit.append(log, {**entry, "result": "; ".join(done), "exit_code": 0})
    return done


def after_interrupt(plan: Plan, address: Address) -> Finding:
    """Withdraws what Ctrl-C left half done and says what is active."""
    before = plan.active.header if plan.active else None
    try:
        with Link(replace(address, retries=0)) as link:
            for table in plan.tables:
                active = withdraw(link, table)
    except (LinkLost, ExceptionReply):
        return Finding("CS5018", "error", f"interrupted; {UNKNOWN}", hint="push again to settle it")
    ours = next((table.header for table in plan.tables if table.header == active), None)
    if ours and ours != before:
        state = f"window {ours.window} of {ours.windows} of the new table is active (read back)"
    else:
        state = OLD if active == before else f"table {active.name} is active (read back)"
    return Finding("CS5018", "error", f"interrupted; {state}")


def summary(plan: Plan, address: Address, limit: float, done: list[str]) -> dict[str, Any]:
    """JSON values."""
    offsets = plan.offsets
    turn = np.degrees(np.nanmax(offsets.turn)) if np.isfinite(offsets.turn).any() else None
    return {
        "target": {"host": address.host, "port": address.port, "unit": address.unit, "tls": address.tls is not None},
        "rows": len(offsets.offset), "first_target": offsets.first,
        "largest_offset_mm": round(1e3 * float(offsets.length.max()), 6), "largest_at_target": offsets.first + offsets.worst,
        "limit_mm": round(1e3 * limit, 6), "turn_not_sent_deg": turn,
        "tables": [table.header.as_dict() for table in plan.tables],
        "active_before": plan.active.header.as_dict() if plan.active and plan.active.header else None,
        "difference": difference(plan), "applied": bool(done), "results": done,
    }


def difference(plan: Plan) -> dict[str, Any] | None:
    """What would change in the active table by the first window; None where the cell was not asked."""
    if plan.active is None:
        return None
    new, old = plan.tables[0], plan.active
    if new.header.window != old.header.window or new.header.windows != old.header.windows:
        new = next((table for table in plan.tables if table.header == old.header), new)
    first = max(new.header.first, old.header.first)
    count = max(min(new.header.first + new.header.rows, old.header.first + old.header.rows) - first, 0)
    change = (to_micrometres(new.words[first - new.header.first:][:count])
              - to_micrometres(old.words[first - old.header.first:][:count])) if count else np.zeros((0, 3))
    return {"same": new.header == old.header, "rows_in_both": count, "rows_changed": int(change.any(axis=1).sum()),
            "rows_only_new": new.header.rows - count, "rows_only_active": old.header.rows - count,
            "largest_change_mm": round(1e-3 * float(np.linalg.norm(change, axis=1).max()), 6) if count else 0.0}


def lines(plan: Plan, address: Address, limit: float) -> list[str]:
    """The plan for the terminal."""
    offsets, tables = plan.offsets, plan.tables
    shown = difference(plan)
    last = offsets.first + len(offsets.offset) - 1
    cut = f"table {tables[0].header.name}" if len(tables) == 1 else f"{len(tables)} windows"
    pages = sum(table.header.pages for table in tables)
    text = [
        f"cell: {address}",
        f"rows: {len(offsets.offset)}, targets {offsets.first} to {last}, {pages} pages, {cut}",
        f"largest offset: {1e3 * offsets.length.max():.4f} mm at target {offsets.first + offsets.worst}, limit "
        f"{1e3 * limit:g} mm; sent in whole micrometres",
    ]
    if plan.active is None or shown is None:
        return text
    header = plan.active.header
    if not header:
        return [*text, "active table: none"]
    if shown["same"]:
        return [*text, f"active table: {header.name}, {header.rows} rows: this one, nothing differs"]
    return [*text, f"active table: {header.name}, {header.rows} rows: {shown['rows_changed']} of {shown['rows_in_both']} "
            f"common rows differ, by up to {shown['largest_change_mm']:.3f} mm; {shown['rows_only_new']} rows are new, "
            f"{shown['rows_only_active']} go"]


def _check_limit(offsets: Offsets, device: Device) -> None:
    largest = int(np.ceil(1e6 * offsets.length.max() - 1e-6))
    if largest > device.limit_um + ROUNDING_UM:
        raise Refused(Finding("CS5011", "error", f"the largest offset, {1e-3 * largest:.3f} mm at target "
                              f"{offsets.first + offsets.worst}, is over the cell's own limit, {1e-3 * device.limit_um:.3f} mm",
                              file=offsets.source, hint="nothing was sent; compare limits.max_offset_mm of both sides"))

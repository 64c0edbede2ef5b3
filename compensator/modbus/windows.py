"""Windows one after the other, each when the robot has finished the one before."""

from __future__ import annotations

import time
from collections.abc import Callable

from compensator.modbus import registers as at
from compensator.modbus.link import ExceptionReply, Link, LinkLost
from compensator.modbus.transfer import AGAIN, UNKNOWN, Progress, another, in_place, push_table, read_active
from compensator.modbus.wire import OffsetTable
from identification.common.findings import Finding, Refused, Unconfirmed

POLL_S = 0.2
ROBOT_PATIENCE_S = 600.0


def push_windows(
    link: Link, tables: list[OffsetTable], *, patience_s: float, robot_s: float, restart: bool, progress: Progress,
    say: Callable[[str], None],
) -> list[str]:
    """Pushes all tables; returns how each went. Where a window of this very program is active, goes on from there.

    Each window is a table of its own: active whole or not at all. Raises what push_table raises, and Unconfirmed (CS5016)
    where the robot gives no sign for `robot_s`.
    """
    start = 0 if restart else _resume(link, tables)
    endings = []
    for number, table in enumerate(tables[start:], start):
        if number > start:
            _wait_for_robot(link, tables[number - 1], robot_s)
        previous = tables[number - 1].header if number > start else None
        endings.append(push_table(link, table, patience_s, progress, previous))
        if len(tables) > 1:
            say(f"window {number + 1} of {len(tables)}: targets {table.header.first} to "
                f"{table.header.first + table.header.rows - 1}, {endings[-1]}")
    return endings


def _resume(link: Link, tables: list[OffsetTable]) -> int:
    """Index of the window to begin with: the active one, if it is one of these and not the last."""
    active = read_active(link)
    return next((index for index, table in enumerate(tables[:-1]) if table.header == active), 0)


def _wait_for_robot(link: Link, table: OffsetTable, robot_s: float) -> None:
    """Until the robot says that it has finished this window."""
    heartbeat, seen = -1, time.monotonic()
    header = table.header
    while True:
        try:
            [finished], [beat] = link.read(at.FINISHED, 1), link.read(at.ROBOT, 1)
            active = read_active(link)
        except (LinkLost, ExceptionReply) as reason:
            raise Unconfirmed(Finding("CS5016", "error", f"the cell was lost while the robot worked on window {header.window} "
                                      f"of {header.windows}, which was active: {reason}; {UNKNOWN}", hint=AGAIN)) from reason
        if active != header:
            raise Refused(another(active))
        if finished == header.window:
            return
        if beat != heartbeat:
            heartbeat, seen = beat, time.monotonic()
        if time.monotonic() - seen > robot_s:
            raise Unconfirmed(Finding(
                "CS5016", "error", f"no sign of the robot for {robot_s:g} s; {in_place(header)}, "
                "the next was not sent",
                hint="push again: it goes on from this window, --restart begins with the first"))
        time.sleep(POLL_S)

"""Whether a log is one of this program, and of one pass: which target each row belongs to, and what lies beside the path."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from compensator.forces.log import ForceLog
from compensator.forces.log_path import ENDS, ENDS_SHARE, why_unknown
from compensator.path.arc_length import nearest_target
from compensator.path.robot_path import RobotPath
from compensator.toolpath import OtherFiles
from identification.common.findings import CompstiffError, Finding, Level, counted, error

Indices = NDArray[np.intp]
# A log with more than this share of its samples off the path is that of another program.
MOST_LOST = 0.9
# A log comes back to a target where the number falls by more than this, and goes twice over the program with more than this
# share of its targets; a logger that rounds flickers between neighbours, and a path length between places so near [m].
BACK, MOST_AGAIN, BACK_BY = 5, 0.1, 5e-3
# A log by path length that goes on behind the end of the path by more than this share is of more than the path; where the
# program calls routines that no file at hand holds, by more than its own end may be off (log_path.py).
BEYOND = 0.02
# So many targets are named in the order in which they are driven.
NAMED = 8
ALL_HERE = OtherFiles()
JOIN = "Join all modules of the job (compstiff post CELL MAIN.mod OTHER.mod ... -o job.mod)"


def targets_of(log: ForceLog, path: RobotPath) -> Indices:
    """Target (M,) of each row, -1 where it is not on the path."""
    if log.key == "target":
        return log.place.astype(np.intp)
    length = path.length
    known = ~np.isnan(length)
    if not known.any():
        raise error("CS3005", "the program has no target of known position to place the log on", file=log.source,
                    hint=why_unknown(path))
    inside = (log.place >= -1e-3) & (log.place <= np.nanmax(length) + 1e-3)
    return np.where(inside, nearest_target(length, np.where(inside, log.place, 0.0)), -1)


def said_of_lost(
    log: ForceLog, on: NDArray[np.bool_], others: OtherFiles = ALL_HERE, taken: Callable[[], str] = str
) -> list[Finding]:
    """What is said of samples off the path; on (M,): rows on it; others: what of the program stands in other files; taken: as
    what the log would lie on the path (misread_places.py). Raises CompstiffError: CS3005 nearly all are off, CS3007 a log by
    path length goes on behind a program that another file starts."""
    number = int(log.weight.sum())
    lost = int(log.weight[~on].sum())
    if lost > MOST_LOST * number:
        few = "none" if not on.any() else f"only {number - lost}"
        raise error("CS3005", f"{few} of the {number} samples {'lies' if number - lost < 2 else 'lie'} on this path",
                    file=log.source, hint=("" if log.sent else _called(others)) or taken() or "is it the log of this program, "
                    "with TCP positions in its work object?")
    if not lost:
        return []
    beyond = _beyond(log, on, others)
    surely = bool(_beyond(log, on))
    level: Level = "error" if surely and not others.started else "warning" if beyond or lost > 0.01 * number else "note"
    found = Finding("CS3007", level, f"{lost} of {counted(number, 'sample')} not on the path, not used",
                    file=log.source, line=int(log.line[np.argmin(on)]), hint=_why_beyond(beyond, others) if beyond else "")
    if level == "error":
        raise CompstiffError(found)
    return [found]


def _why_beyond(beyond: float, others: OtherFiles) -> str:
    """What to do with a log that goes on by so much [m] behind the end of the program."""
    goes_on = f"the log goes on for {1e3 * beyond:.0f} mm behind the end of "
    if not others.started:
        return (f"{goes_on}a program that has no routine main: where a log of the whole job was when this part of it began is "
                f"not known. {JOIN}, or keep the rows from its first target on to its last")
    return f"{goes_on}the program: " + (
        _called(others) or "more turns of a loop (a WHILE counts as one), a second start, another program? Keep the rows of "
        "one pass: others may stand at its end")


def _called(others: OtherFiles) -> str:
    """What may stand behind it where the program calls routines that no file at hand holds; "" where it calls none."""
    if not others.called:
        return ""
    return (f"does {', '.join(others.called[:NAMED])} drive, of another file? Then a log by path length or time lies elsewhere "
            f"behind it. {JOIN}, or log x_mm y_mm z_mm")


def _beyond(log: ForceLog, on: NDArray[np.bool_], others: OtherFiles = ALL_HERE) -> float:
    """By how much [m] a log by path length goes on behind the end of the path; 0.0 where it does not."""
    if log.key != "path_mm" or log.sent or log.spread is not None or not on.any():
        return 0.0
    end, last = float(log.place[on].max()), float(np.nanmax(log.place))
    return last - end if last >= end + (max(ENDS, ENDS_SHARE * end) if others.called else BEYOND * end) else 0.0


def check_once(log: ForceLog, target: Indices, driven: Indices | None) -> list[Finding]:
    """Raises CompstiffError (CS3119) for a log that comes back to targets which it had left: several passes in one file, whose
    means would be those of none; or one whose target numbers count on as the program drives, where that is not the order of
    the text. Where such a log differs little from one numbered by the text, that is a warning. target (M,): -1 off the path.
    driven: `Toolpath.driven`, the order in which a log names targets."""
    rows = np.flatnonzero(target >= 0)
    number: Indices = target[rows]
    place = log.place[rows]
    counted_on = None
    if log.key == "target" and driven is not None:
        # Targets that are not driven come last, and those that are driven again are left out.
        found, places = np.unique(driven, return_index=True)
        last = max(number.max(initial=0), found.max(initial=0))
        turn: Indices = np.full(last + 1, len(driven), dtype=np.intp)
        turn[found] = places
        counted_on = _counted_on(log, number, driven, turn)
        number = turn[number]
        place = number.astype(float)
    furthest, least = np.maximum.accumulate(number), np.maximum.accumulate(place) - (0 if log.key == "target" else BACK_BY)
    back = (number < furthest - BACK) & (place < least)
    returned = np.unique(number[back])
    if len(returned) <= MOST_AGAIN * len(np.unique(number)):
        return [] if counted_on is None else [replace(
            counted_on, level="warning", message=counted_on.message + "; taken as numbered by the text")]
    if counted_on is not None:
        raise CompstiffError(counted_on)
    first = int(np.argmax(back))
    line = int(log.line[rows[first]])
    raise error("CS3119", f"the log comes back to {counted(len(returned), 'target')} that it had left, from target "
                f"{target[rows[first - 1]]} to {target[rows[first]]}: is it of several passes?", file=log.source, line=line,
                hint="one pass a file, that of the program that is corrected; rows in the order of time")


def _counted_on(log: ForceLog, number: Indices, driven: Indices, turn: Indices) -> Finding | None:
    """What is to be said of a log whose target numbers, number (M,), only rise, where the program drives these targets in
    another order; turn: when each is driven. None where it is not so."""
    if not len(number) or (np.diff(number) < 0).any():
        return None
    logged = np.unique(number)
    logged = logged[np.isin(logged, driven)]
    falls = np.flatnonzero(np.diff(turn[logged]) < 0)
    if not len(falls):
        return None
    before, behind = logged[falls[0]], logged[falls[0] + 1]
    return Finding("CS3119", "error", f"the column target only rises, and the program drives target {behind} before {before}: "
                   "does the log count targets as they are driven, or were its rows sorted?", file=log.source,
                   hint="targets are numbered by the text, and rows stand in the order of time: those of a routine count where "
                   "it stands, one call after the other; here the program drives "
                   f"{', '.join(map(str, driven[:NAMED]))} ... in turn")

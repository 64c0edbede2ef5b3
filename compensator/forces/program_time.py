"""A force log with time alone, placed on a program: the program's own timing, the estimate of `time_placement.py`, and what is
refused."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from compensator.forces.log import ForceLog
from compensator.forces.time_alignment import (
    LOWEST_SCORE,
    LOWEST_SHARE,
    MOST_ODD,
    Program,
    TimePlacement,
    air_moves,
    kinds_of_cut,
    place_by_time,
)
from compensator.path.robot_path import RobotPath
from compensator.path.timing import drive
from compensator.toolpath import Move
from identification.common.findings import Finding, Refused, counted, error

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

# Fewer samples than this say nothing about time.
FEWEST_SAMPLES = 100
HINT = "log the column target, or x_mm y_mm z_mm (TCP in the work object), with the forces"


def program_of(path: RobotPath) -> Program:
    """The program in time, as the robot can drive it. Raises CompstiffError (CS3060) where the feed or the way of a move is not
    known."""
    toolpath, robot_time = path.toolpath, drive(path)
    legs = robot_time.route.legs
    unknown = np.flatnonzero(np.isnan(robot_time.duration) | (legs.linear & np.isnan(robot_time.programmed)))
    if len(unknown):
        first = int(unknown[0])
        why = "its feed is not known" if legs.linear[first] else "the robot's way to it is not known"
        raise error("CS3060", f"a log with time alone needs the time of every move: target {first}: {why} "
                    f"({counted(len(unknown), 'such target')})", file=toolpath.source, line=int(toolpath.line[first]),
                    target=first,
                    hint=f"declare the speed in this file, or {HINT}")
    length = path.length
    by_joints = np.asarray(np.isin(toolpath.move, (Move.JOINT, Move.ABSOLUTE)))
    air = air_moves(toolpath.feed, by_joints)
    step = np.diff(path.base_from_tcp.position, axis=0, prepend=path.base_from_tcp.position[:1])
    direction = step / np.maximum(np.linalg.norm(step, axis=1), 1e-9)[:, None]
    if path.cell.force_log.kind != "base":
        # The sensor's frame turns with the tool's; a fixed rotation between them is part of what is estimated.
        direction = np.einsum("nji,nj->ni", path.base_from_tcp.rotation, direction)
    return Program(robot_time.time, length, air, kinds_of_cut(toolpath.feed, air, length), direction)


def placed_by_time(log: ForceLog, path: RobotPath) -> ForceLog:
    """A log with time alone as one placed by path length, NaN outside the program, with the spread of each row.

    Raises CompstiffError: CS3060 a move without known time, CS3062 time runs backwards, CS3063 a log that says nothing; Refused
    (CS3061) where no place is believed.
    """
    time, source = log.place, log.source
    if len(time) < FEWEST_SAMPLES:
        raise error("CS3063", f"{counted(len(time), 'sample')} {'is' if len(time) == 1 else 'are'} too few to place a log by "
                    f"time alone, at least {FEWEST_SAMPLES} are needed", file=source, hint=HINT)
    back = np.flatnonzero(np.diff(time) < 0)
    if len(back):
        row = int(back[0]) + 1
        raise error("CS3062", f"time_s {time[row]:g} stands before the one above it, {time[row - 1]:g}", file=source,
                    line=int(log.line[row]), hint="samples must be in the order of time, one pass a file")
    if not np.ptp(log.force, axis=0).any() or time[-1] == time[0]:
        raise error("CS3063", "the force never changes, or time does not: nothing says where the cut begins", file=source,
                    hint=HINT)
    program = program_of(path)
    if not program.time[-1] > 0:
        raise error("CS3063", "the program takes no time: it has no move of known length", file=source, hint=HINT)
    found = place_by_time(program, time, log.force)
    toolpath = path.toolpath.source
    if not found.believed:
        raise Refused(Finding(
            "CS3061", "error", f"the log cannot be placed by time alone: {100 * found.share:.0f} % of the force follows the "
            f"program, at least {100 * LOWEST_SHARE:.0f} % must; its score is {found.score:.1f} against {_rival(found)}, at "
            f"least {LOWEST_SCORE:g} is needed; {_odd(program, found)}",
            file=source,
            hint=f"is it the log of {toolpath}, from before its start to after its end? Passes that are alike cannot be told "
                 f"apart: {HINT}"))
    spread = _spread(program, found)
    typical, largest = 1e3 * np.nanquantile(spread, [0.5, 0.95])
    findings = [Finding(
        "CS3064", "warning", f"placed by time alone: the program starts at {found.start:.2f} s of the log's clock, override "
        f"{100 * found.override:.1f} %, stretches slip by up to {found.slip:.2f} s; {100 * found.share:.0f} % of the force "
        f"follows the program, score {found.score:.0f} against {_rival(found)}; 1 sigma of the time {np.median(found.std):.3f} "
        f"s, of the place {typical:.1f} mm (under {largest:.1f} mm for 95 % of the samples)", file=source)]
    if found.odd:
        low, high = (min(int(np.searchsorted(program.time, time)), len(program.time) - 1) for time in found.odd[0])
        findings.append(Finding("CS3065", "warning", f"between targets {low} and {high} the force does not follow the "
                                "program: is there no stock, or did the program stand still?", file=toolpath,
                                line=int(path.toolpath.line[low]), target=low))
    return replace(log, key="path_mm", place=found.place, spread=np.nan_to_num(spread),
                   findings=(*log.findings, *findings))


def _rival(found: TimePlacement) -> str:
    return f"the best other place {found.rival:.1f} s away" if np.isfinite(found.rival) else "no other place"


def _odd(program: Program, found: TimePlacement) -> str:
    if not found.odd:
        return "every stretch follows the program"
    ends = [np.searchsorted(program.time, stretch) for stretch in found.odd[:5]]
    places = ", ".join(f"{low} to {high}" for low, high in ends)
    return (f"in {len(found.odd)} of its stretches (targets {places}"
            f"{' ...' if len(found.odd) > 5 else ''}) the force does not follow the program, at most {MOST_ODD} may be so")


def _spread(program: Program, found: TimePlacement) -> Array:
    """1 sigma (M,) [m] of each sample's place: that of its time at the speed of the move it lies on; NaN outside."""
    inside = ~np.isnan(found.place)
    leg = np.minimum(np.searchsorted(program.length, np.where(inside, found.place, 0.0)), len(program.length) - 1)
    step, duration = np.diff(program.length, prepend=0.0), np.diff(program.time, prepend=0.0)
    speed = step / np.maximum(duration, 1e-9) * (duration > 0)
    return np.where(inside, found.std * speed[leg], np.nan)

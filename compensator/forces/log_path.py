"""A force log by path length, whatever its columns: TCP positions and joint angles are matched forwards, time is estimated.
Done once a program: targets that are added to it later lie on the same path."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from compensator.forces.half_ways import on_half_ways
from compensator.forces.home import counted_from_home
from compensator.forces.log import ForceLog
from compensator.forces.map_matching import match_nearest_pass
from compensator.forces.misread_places import SHORT, UNITS, misread
from compensator.forces.target_numbers import said_of_numbers
from compensator.forces.time_log import place_by_time
from compensator.forces.twice_placed import said_of_both
from compensator.path.arc_length import polyline
from compensator.path.robot_path import RobotPath
from identification.common.arrays import Array
from identification.common.findings import CompstiffError, Finding, counted, error
from identification.model.kinematics import forward

# The middle of all samples is off the path by more than this [m] where TCP, work object or program differ: what zones and delay
# put a sample off cancels in the middle, and a corrected pass stands off by less (engineering judgement).
BESIDE = 5e-4
# A log by path length is of the path without targets of unknown position where it ends so near to its end [m], [share].
ENDS, ENDS_SHARE = 1e-3, 1e-3
# A log of which no more than this share is left is not used.
LEAST = 0.1


def on_path(log: ForceLog, path: RobotPath) -> ForceLog:
    """The log with the key `path_mm`, NaN where a sample is not on the path; a log that names the target nearest to the tool as
    it is where it tells nothing between targets (half_ways.py). Rows whose place nobody knows are left out.

    Raises CompstiffError: CS3004 a target beyond the program, CS3005 no target of known position, CS3010 several tools or work
    objects, CS3121 positions come late in a log without time, CS3124 path lengths behind a target of unknown position, and what
    `place_by_time` raises.
    """
    placed, unknown = placed_rows(log, path)
    return placed.rows(~unknown) if unknown.any() else placed


def placed_rows(log: ForceLog, path: RobotPath) -> tuple[ForceLog, NDArray[np.bool_]]:
    """The log as of `on_path`, with all its rows, and which of them (M,) have no known place. Raises as `on_path`."""
    if log.twice is not None:
        log = replace(log, twice=None, findings=(*log.findings, *said_of_both(log.source, log.twice, path)))
    if not log.on_path and log.key == "path_mm":
        _check_unit(log, log.place[:, None], path.length[np.isfinite(path.length), None], "path_mm is")
        log = counted_from_home(log, path)
        own = log.spread is None and log.predicted is None
        return _before_unknown(replace(log, place=_in_time(log, log.place, path), on_path=True, counted=own), path)
    placed = _on_path(log, path)
    return placed, np.zeros(len(placed.place), dtype=bool)


def _on_path(log: ForceLog, path: RobotPath) -> ForceLog:
    if log.on_path:
        return log
    if log.key == "target":
        _check_targets(log, path)
        if not any(finding.code == "CS3132" for finding in log.findings):
            log = replace(log, findings=(*log.findings, *said_of_numbers(log, path)))
        if path.cell.force_log.form.target == "ahead":
            return _on_the_way(log, path)
        return log if any(finding.code == "CS3132" for finding in log.findings) else on_half_ways(log, path)
    if log.key == "time":
        return replace(place_by_time(log, path), on_path=True)
    points, length = polyline(path.world_position, path.toolpath.move)
    if not len(points):
        raise error("CS3005", "the program has no target of known position to place the log on", file=log.source,
                    hint=why_unknown(path))
    position = _world_positions(log, path)
    place, passes = match_nearest_pass(points, length, position)
    if not np.isfinite(place).any() or np.ptp(place[np.isfinite(place)]) < SHORT * length[-1]:
        taken = misread(log, path)
        if taken:
            raise error("CS3005", f"{counted(int(log.weight.sum()), 'sample', 'do')} not lie along this path", file=log.source,
                        hint=taken)
        if log.key == "position":
            _check_unit(log, position, points, "x_mm y_mm z_mm are")
    beside = position - np.column_stack([np.interp(place, length, axis) for axis in points.T])
    return replace(log, key="path_mm", place=_in_time(log, place, path), findings=(*log.findings, *_beside(log, beside),
                   *_of_passes(log, place, beside, passes)), on_path=True, sent=True, beside=beside)


def _reach(points: Array) -> float:
    """The longest side [m] of the box around points (n, 3)."""
    return float(np.max(np.ptp(points, axis=0)))


def _unit_of(position: Array, points: Array) -> str:
    """The unit in which positions (M, 3) would reach as far as the path, points (K, 3); "" for none."""
    reach = _reach(position) if len(position) else 0.0
    ratio = _reach(points) / reach if reach > 0 else 0.0
    return next((unit for unit, factor in UNITS.items() if 0.8 * factor < ratio < 1.25 * factor), "")


def _check_unit(log: ForceLog, position: Array, points: Array, named: str) -> None:
    """Raises CompstiffError (CS3005) where positions (M, k) reach as far as the path, points (K, k), but for a unit."""
    unit = _unit_of(position, points) if len(points) else ""
    if unit:
        raise error("CS3005", f"{counted(int(log.weight.sum()), 'sample', 'do')} not lie on this path: all are within "
                    f"{1e3 * _reach(position):.3g} mm, the program reaches over {1e3 * _reach(points):.3g} mm", file=log.source,
                    hint=f"the log seems to be in {unit}: {named} in millimetres")


def _in_time(log: ForceLog, place: Array, path: RobotPath) -> Array:
    """The places (M,) [m] at which the samples were taken, where the positions in the log are late (position_late_ms of
    cell.yaml): that which is in the log so much later, earlier where that is negative. NaN at its ends.
    Raises CompstiffError (CS3121): no time."""
    late = 1e-3 * path.cell.force_log.form.position_late_ms
    if not late:
        return place
    if log.time is None:
        raise error("CS3121", f"force_log.position_late_ms is {1e3 * late:g} in cell.yaml, and the log has no time",
                    file=log.source, hint="log time_s, or state force_log.rate_hz")
    on = ~np.isnan(place)
    if not on.any():
        return place
    moved = np.interp(log.time + late, log.time[on], place[on], left=np.nan, right=np.nan)
    return np.asarray(np.where(on, moved, np.nan))


def _beside(log: ForceLog, beside: Array) -> list[Finding]:
    """Samples that lie beside the path by (M, 3) [m], NaN where they are not on it."""
    on = ~np.isnan(beside).any(axis=1)
    if not on.any():
        return []
    middle = np.median(beside[on], axis=0)
    if np.linalg.norm(middle) < BESIDE:
        return []
    return [Finding("CS3120", "warning", f"the samples lie beside the path, by {1e3 * np.linalg.norm(middle):.2g} mm in the "
                    f"middle ({', '.join(f'{1e3 * axis:+.2f}' for axis in middle)} mm, world frame)", file=log.source,
                    hint="does the logger use another TCP or work object than the program, or is the log of another one?")]


def _of_passes(log: ForceLog, place: Array, beside: Array, passes: int) -> list[Finding]:
    """What is said of a log that goes along the path several times; place (M,), beside (M, 3): of the pass that is taken."""
    if passes < 2:
        return []
    on = np.flatnonzero(~np.isnan(place))
    off = float(np.median(np.linalg.norm(beside[on], axis=1)))
    return [Finding("CS3128", "warning", f"the log goes along this path {passes} times, as layer upon layer does: that of rows "
                    f"{log.line[on[0]]} to {log.line[on[-1]]} is taken, {1e3 * off:.2f} mm off it in the middle", log.source,
                    int(log.line[on[0]]), hint="the nearest, and of passes as near the first; is another one meant, keep its "
                    "rows alone; a log of a job of several modules lies on all of them joined (compstiff post)")]


def _before_unknown(log: ForceLog, path: RobotPath) -> tuple[ForceLog, NDArray[np.bool_]]:
    """The log, and its samples (M,) behind the first target of unknown position between others, or the first move that is not
    counted, since the way there is not known. A log that ends where the path without such does counts as that one.

    Raises CompstiffError (CS3124) where these are nearly all."""
    known = np.flatnonzero(~np.isnan(path.length))
    of_moves = [before for before, behind in path.toolpath.uncounted
                if np.isfinite(path.length[[max(before, 0), behind]]).all()]
    gaps = np.sort(np.concatenate([known[:-1][np.diff(known) > 1], np.array(of_moves, dtype=np.intp)]))
    whole = float(path.length[known[-1]]) if len(known) else 0.0
    unknown = np.zeros(len(log.place), dtype=bool)
    if len(gaps) and abs(float(np.nanmax(log.place)) - whole) > max(ENDS, ENDS_SHARE * whole):
        unknown = log.place > path.length[gaps[0]] if gaps[0] >= 0 else ~unknown
    number = int(log.weight[unknown].sum())
    if not number:
        return log, unknown
    line = int(path.toolpath.line[gaps[0] + 1])
    where = (f"before the move in line {line} the program drives along other targets, which are not counted (CS2016)"
             if gaps[0] in of_moves else f"in line {line}: {_reason(path, int(gaps[0]) + 1)}")
    finding = Finding("CS3124", "warning", f"{counted(number, 'sample')} left out, since the way there is not known: {where}",
                      file=path.toolpath.source, line=line,
                      hint="declare it in numbers in this file, or join the files (CS2016); or log the column target, or "
                      "x_mm y_mm z_mm")
    if unknown.mean() >= 1 - LEAST:
        raise CompstiffError(replace(finding, level="error"))
    return replace(log, findings=(*log.findings, finding)), unknown


def _reason(path: RobotPath, target: int) -> str:
    return path.toolpath.block[target] or "its position is not known"


def why_unknown(path: RobotPath) -> str:
    """What is said of the first target whose position is not known; "" where all are."""
    unknown = np.flatnonzero(np.isnan(path.length))
    if not len(unknown):
        return ""
    first = int(unknown[0])
    return (f"the move in line {path.toolpath.line[first]} counts as one target, and {_reason(path, first)}: write a move to a "
            "robtarget in numbers for each position")


def _check_targets(log: ForceLog, path: RobotPath) -> None:
    count = len(path.toolpath)
    if log.place.max() >= count:
        row = int(np.argmax(log.place >= count))
        from_one = log.place.min() == 1 and log.place.max() == count
        raise error("CS3004", f"target {log.place[row]:g} is beyond the program, which has {counted(count, 'target')} "
                    f"(0 to {count - 1})", file=log.source, line=int(log.line[row]),
                    hint="its numbers seem to begin at 1: targets count from 0" if from_one
                    else why_unknown(path) or "is it the log of this program?")


def _on_the_way(log: ForceLog, path: RobotPath) -> ForceLog:
    """The samples of a target as taken evenly on the way to it, from the target before."""
    note = Finding("CS3040", "note", "the column target names the target that the tool moves to (force_log.target): its "
                   "samples count as taken evenly on the way there", file=log.source)
    length = path.length
    return replace(log.on_stretches(np.insert(length[:-1], 0, length[0]), length), findings=(*log.findings, note))


def _world_positions(log: ForceLog, path: RobotPath) -> Array:
    """TCP positions of the samples (M, 3) [m] in the world, external axes at their resting values; one tool and one work object
    are required."""
    used = path.used_frames
    if not len(used.tools if log.key == "joints" else used.workobjects):
        raise error("CS3005", "the program has no target of known position to place the log on", file=log.source,
                    hint=why_unknown(path))
    if log.key == "joints":
        if len(used.tools) != 1:
            raise error("CS3010", f"a log placed by joint angles needs one tool, the program uses {len(used.tools)}",
                        file=log.source, hint="log the column target or path_mm")
        if path.axes.moves:
            raise error("CS4509", "a log placed by joint angles does not tell where the external axes stood, and they move "
                        "during the program", file=log.source, hint="log the TCP in the work object (x_mm y_mm z_mm), the "
                        "column target or path_mm")
        return path.axes.world_from_base.apply(forward(path.cell.robot, log.place, used.tools[0]).position)
    if len(used.workobjects) != 1:
        raise error("CS3010", f"a log placed by TCP position needs one work object, the program uses "
                    f"{len(used.workobjects)}", file=log.source, hint="log the column target or path_mm")
    return used.workobjects[0].apply(log.place)

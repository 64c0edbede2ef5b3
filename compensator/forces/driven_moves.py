"""A log placed along the moves in the order in which the program drives them, where that is not the order of the text: routines
that are called in another order, that no call leads to, error handlers and trap routines."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from compensator.forces.log import ForceLog
from compensator.forces.log_path import on_path
from compensator.forces.program_time import moves_in_air
from compensator.forces.source import Key
from compensator.path.robot_path import RobotPath, robot_path
from identification.common.findings import CompstiffError, Finding, counted, verb

Indices = NDArray[np.intp]
# Of two orders of different length [share] a log by path length is of the one whose end it reaches to so much nearer.
APART, NEARER = 0.02, 0.2


def as_driven(log: ForceLog, path: RobotPath) -> ForceLog:
    """The log with the key `path_mm`, placed along the moves as they are driven, or as they stand in the text where the log
    fits that better. Rows of a move that was driven before are left out, so that of targets which are driven twice the first
    pass counts.

    Raises what `on_path` raises.
    """
    order = path.toolpath.driven
    if order is None or log.on_path or log.key == "target" or log.predicted is not None or path.axes.moves:
        return on_path(log, path)
    run = robot_path(path.toolpath.taken(order), path.cell)
    if not (np.isfinite(run.length).all() and np.isfinite(path.length).all()):
        return on_path(log, path)
    if log.key == "path_mm":
        if _of_text(float(log.place.max()), float(run.length[-1]), float(path.length[-1])):
            return on_path(log, path)
        placed = on_path(log, run)
    else:
        try:
            placed = on_path(log, run)
        except CompstiffError:
            return on_path(log, path)
        if log.key != "time":
            by_text = on_path(log, path)
            if np.isfinite(by_text.place).sum() > np.isfinite(placed.place).sum():
                return by_text
    return _in_text(placed, log.key, path, run, order)


def _of_text(end: float, driven: float, text: float) -> bool:
    """Whether a log that ends at this path length [m] is of all moves of the text, not of those that are driven."""
    return abs(driven - text) > APART * text and abs(end - text) < NEARER * abs(end - driven)


def _in_text(log: ForceLog, key: Key, path: RobotPath, run: RobotPath, order: Indices) -> ForceLog:
    """A log along the moves as driven, by the path length of the text. key: what placed it."""
    place = np.full(len(log.place), np.nan)
    on = np.flatnonzero(np.isfinite(log.place))
    at = np.clip(log.place[on], 0.0, run.length[-1])
    behind = np.clip(np.searchsorted(run.length, at), 1, len(order) - 1)
    before = behind - 1
    start, end = order[before], order[behind]
    way = run.length[behind] - run.length[before]
    share = (at - run.length[before]) / np.where(way > 0, way, 1.0)
    # Where a call leads on, the text has another move to the next target: a sample is at the nearer end.
    share = np.where(end == start + 1, share, np.round(share))
    ends_at = np.where(end == start + 1, path.length[end], path.length[np.where(share > 0.5, end, start)])
    starts_at = np.where(end == start + 1, path.length[start], ends_at)
    place[on] = starts_at + share * (ends_at - starts_at)
    keep = np.ones(len(place), dtype=bool)
    keep[on] = np.isin(np.where(share > 0.5, behind, before), np.unique(order, return_index=True)[1])
    findings = (*log.findings, _note(log, key, path, order))
    log = replace(log, place=place, findings=findings)
    if not keep.all():
        log = log.rows(keep)
    if (np.diff(order) < 0).any():
        # Time no longer goes forwards along the path.
        log = replace(log.rows(np.argsort(place[keep], kind="stable")), time=None)
    return log


def _note(log: ForceLog, key: Key, path: RobotPath, order: Indices) -> Finding:
    """What is said of it: a warning where cuts are left out, and no position shows that the log is of none of them."""
    idle = np.setdiff1d(np.arange(len(path.toolpath)), order)
    cuts = bool((~moves_in_air(path.toolpath)[idle]).any()) and key in ("path_mm", "time")
    words = [f"{counted(len(idle), 'target')} that no call leads to, of an error handler, a trap or an idle routine, "
             f"{verb(len(idle), 'have')} no sample"] if len(idle) else []
    if len(np.unique(order)) < len(order):
        words.append("of targets that are driven more than once the first time counts")
    said = "; ".join(["followed along the moves as the calls drive them, which is not the order of the text", *words])
    return Finding("CS3122", "warning" if cuts else "note", said, file=log.source,
                   hint="was an idle routine started by itself? Then give it as a program of its own" if cuts else "")

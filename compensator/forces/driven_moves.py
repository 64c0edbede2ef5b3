"""A log placed along the moves in the order in which the program drives them, where that is not the order of the text: routines
that are called in another order, that no call leads to, error handlers and trap routines."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from compensator.forces.log import ForceLog
from compensator.forces.log_path import on_path
from compensator.forces.program_time import moves_in_air
from compensator.forces.source import Key
from compensator.path.driven_path import DrivenPath, driven_path
from compensator.path.robot_path import RobotPath
from identification.common.findings import CompstiffError, Finding, counted, verb

# Of two orders of different length [share] a log by path length is of the one whose end it reaches to so much nearer.
APART, NEARER = 0.02, 0.2


def as_driven(log: ForceLog, path: RobotPath) -> ForceLog:
    """The log with the key `path_mm`, placed along the moves as they are driven, or as they stand in the text where the log
    fits that better. Rows of a move that was driven before are left out, so that of targets which are driven twice the first
    pass counts.

    Raises what `on_path` raises.
    """
    if log.on_path or log.key == "target" or log.predicted is not None:
        return on_path(log, path)
    driven = driven_path(path)
    if driven is None or (log.key == "path_mm" and _of_text(
            float(log.place.max()), float(driven.run.length[-1]), float(path.length[-1]))):
        return on_path(log, path)
    try:
        placed = on_path(log, driven.run)
    except CompstiffError:
        return on_path(log, path)
    if log.key in ("position", "joints"):
        by_text = on_path(log, path)
        if np.isfinite(by_text.place).sum() > np.isfinite(placed.place).sum():
            return by_text
    return _in_text(placed, log.key, driven)


def _of_text(end: float, driven: float, text: float) -> bool:
    """Whether a log that ends at this path length [m] is of all moves of the text, not of those that are driven."""
    return abs(driven - text) > APART * text and abs(end - text) < NEARER * abs(end - driven)


def _in_text(log: ForceLog, key: Key, driven: DrivenPath) -> ForceLog:
    """A log along the moves as driven, by the path length of the text. key: what placed it."""
    place, keep = np.full(len(log.place), np.nan), np.ones(len(log.place), dtype=bool)
    on = np.flatnonzero(np.isfinite(log.place))
    place[on], keep[on] = driven.in_text(log.place[on])
    log = replace(log, place=place, findings=(*log.findings, _said(log, key, driven)))
    if not keep.all():
        log = log.rows(keep)
    if (np.diff(driven.order) < 0).any():
        # Time no longer goes forwards along the path.
        log = replace(log.rows(np.argsort(place[keep], kind="stable")), time=None)
    return log


def _said(log: ForceLog, key: Key, driven: DrivenPath) -> Finding:
    """What is said of it: a warning where cuts are left out, and no position shows that the log is of none of them."""
    toolpath = driven.path.toolpath
    idle = np.setdiff1d(np.arange(len(toolpath)), driven.order)
    cuts = bool((~moves_in_air(toolpath)[idle]).any()) and key in ("path_mm", "time")
    words = [f"{counted(len(idle), 'target')} that no call leads to, of an error handler, a trap or an idle routine, "
             f"{verb(len(idle), 'have')} no sample"] if len(idle) else []
    if not driven.first.all():
        words.append("of targets that are driven more than once the first time counts")
    said = "; ".join(["followed along the moves as the calls drive them, which is not the order of the text", *words])
    return Finding("CS3122", "warning" if cuts else "note", said, file=log.source,
                   hint="was an idle routine started by itself? Then give it as a program of its own" if cuts else "")

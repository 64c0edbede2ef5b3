"""Logs that name the targets of a corrected program by number, which counts the targets that were added to it too."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from compensator.forces.log import ForceLog
from compensator.forces.one_pass import check_once
from compensator.path.robot_path import RobotPath
from identification.common.added_targets import AddedTargets, Indices
from identification.common.findings import Finding, Refused


def by_given_targets(log: ForceLog, path: RobotPath, added: AddedTargets) -> ForceLog:
    """A log that names targets, placed along the planned path if its numbers are those of the written program; else as it is.

    Raises Refused (CS4128) where they may be either's: the written program may have been driven, or the planned one with the
    offsets pushed; and what `check_once` raises.
    """
    if log.key != "target" or log.on_path or len(added.number) != len(path.toolpath) or not len(log.place):
        return log
    highest, planned, written = int(log.place.max()), len(path.toolpath), len(added.given)
    which = added.numbered(highest)
    if which is None:
        raise Refused(Finding(
            "CS4128", "error", f"the log names targets up to {highest}; the planned program has {planned}, the corrected one "
            f"{written}: from target {added.first} on a number means different targets in the two, and the log does not tell "
            "which was driven", file=log.source,
            hint="log until the last target is reached, or log path_mm or x_mm y_mm z_mm in place of target"))
    if not which or highest >= written:
        return log
    place, order, number = added.place(path.length), path.toolpath.driven, added.given[log.place.astype(np.intp)]
    again = check_once(replace(log, place=number.astype(float)), number, order)
    led = _led_to(order, added)
    behind = np.where(np.append(led[1:], True), place, np.append(place[1:], place[-1]))
    before = np.where(led, place, np.insert(place[:-1], 0, place[0]))
    ahead = path.cell.force_log.form.target == "ahead"
    start, end = (before, place) if ahead else (0.5 * (before + place), 0.5 * (place + behind))
    note = Finding("CS4127", "note", f"its target numbers are those of the corrected program ({written} targets, "
                   f"{written - planned} of them added, by {Path(added.source).name}): placed so along the planned one",
                   file=log.source)
    log = replace(log.on_stretches(start, end), findings=(*log.findings, note, *again))
    return log if order is None or (np.diff(order) > 0).all() else log.along_the_path()


def _led_to(order: Indices | None, added: AddedTargets) -> NDArray[np.bool_]:
    """The targets (W,) of the written program to which another one leads than that before them in the text; order: as
    `Toolpath.driven`, of the planned targets."""
    led = np.zeros(len(added.number), dtype=bool)
    led[0] = True
    if order is not None:
        first, turn = np.unique(order, return_index=True)
        led[first] = (turn == 0) | (order[turn - 1] != first - 1)
    # One before which others were added is reached from the last of these.
    return np.asarray(led[added.given] & (np.diff(added.given, prepend=-1) > 0))

"""Moves in the air: what their forces tell of the sensor's zero, and of a pass that cut nothing."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from compensator.forces.log import ForceLog
from compensator.forces.program_time import moves_in_air
from compensator.forces.target_forces import TargetForces
from compensator.forces.target_rows import TargetRows
from compensator.forces.zero import Zero
from compensator.path.robot_path import RobotPath
from identification.common.arrays import Array
from identification.common.findings import Finding, counted, verb

# A force in air under this [N], and under this share of the largest, is drift that is no more than worth a note.
SMALL, SMALL_SHARE = 5.0, 0.05
# A log shows no cut where under this share of the targets at the cutting feed, of so many at least, has a force, and one of
# under so much in the middle [N].
HARDLY_ANY, SOME, WEAK = 0.1, 50, 10.0


def drifted(mean: Array, path: RobotPath, rows: TargetRows, zero: Zero, forced: NDArray[np.bool_]) -> float:
    """1 sigma [N] of each axis of the sensor's zero after a tare, over the time of the program: what the mean loads (N, 6) of
    moves at the air feed show beyond their noise, and between them evenly; those that cut all the same are not asked. 0 without
    a tare, or where that is no drift."""
    in_air = moves_in_air(path.toolpath)
    air = np.flatnonzero(in_air & np.append(in_air[1:], True) & (rows.samples > 0))
    if zero.bias is None or zero.noise is None or not len(air):
        return 0.0
    force = np.linalg.norm(mean[:, :3], axis=1)
    size = force[air]
    small = min(SMALL, SMALL_SHARE * float(force[forced].max(initial=0.0)))
    if np.median(size) > small:
        return 0.0
    # A drift of that middle is at most twice as much anywhere; more is a touch, or a cut that is driven with MoveJ.
    calm = size <= 2 * small
    air, size = air[calm], size[calm]
    noise = np.sum(zero.noise[:3] ** 2) / rows.samples[air]
    drift = np.sqrt(np.maximum(size**2 - noise, 0.0))
    # Samples are time.
    time = np.cumsum(rows.samples)
    return float(np.sqrt(np.average(np.interp(time, time[air], drift) ** 2, weights=np.maximum(rows.samples, 1e-9)) / 3))


def said_of_trial(log: ForceLog, path: RobotPath, forces: TargetForces) -> list[Finding]:
    """A pass that cut next to nothing: a trial run above the part."""
    cuts = ~moves_in_air(path.toolpath) & (forces.samples > 0)
    forced = cuts & forces.forced
    size = float(np.median(np.linalg.norm(forces.wrench[forced, :3], axis=1))) if forced.any() else 0.0
    if log.predicted is not None or cuts.sum() < SOME or forced.sum() > HARDLY_ANY * cuts.sum() or size > WEAK:
        return []
    return [Finding("CS3077", "warning", f"of {cuts.sum()} targets at the cutting feed {int(forced.sum()) or 'none'} with a "
                    f"force{f', {size:.1f} N in the middle' if forced.any() else ''}: was this pass driven in the air?",
                    file=log.source, hint="correct needs the log of a pass that cuts; right where it only grazes the part")]


def said_of_air(log: ForceLog, path: RobotPath, forces: TargetForces) -> list[Finding]:
    """Where moves at the air feed show a force it is likely the sensor's bias, or what that has become."""
    in_air = moves_in_air(path.toolpath)
    # The stretch of a target reaches into the move behind it, which may cut.
    air = np.flatnonzero(in_air & np.append(in_air[1:], True) & (forces.samples > 0))
    where = "at the air feed"
    if not in_air.any() and forces.tare is None and forces.forced.all():
        # At one feed everywhere a program still begins and ends in the air.
        air, where = np.unique([0, len(path.toolpath) - 1]), "to the first and the last target"
    touched = air[forces.forced[air]]
    if 2 * len(touched) <= len(air):
        return []
    size = np.linalg.norm(forces.wrench[touched, :3], axis=1)
    why = "no bias was taken off"
    hint = "name targets in the air with --tare FIRST:LAST, or state force_log.bias_n in cell.yaml"
    if forces.tare is not None:
        why = "the bias that was taken off is not theirs"
        hint = "does the sensor's zero drift, or does a payload turn whose mass cell.yaml does not state?"
    small = np.median(size) < min(SMALL, SMALL_SHARE * float(np.linalg.norm(forces.wrench[:, :3], axis=1).max()))
    return [Finding("CS3041", "note" if small else "warning", f"{len(touched)} of {counted(len(air), 'move')} {where} "
                    f"{verb(len(touched), 'show')} a force, {np.median(size):.1f} N in the middle, and "
                    f"{verb(len(touched), 'are')} moved with the others: {why}",
                    file=log.source, line=None, target=int(touched[0]), hint=hint)]

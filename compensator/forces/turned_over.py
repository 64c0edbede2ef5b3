"""One axis of the force turned over, which leaves its size as it is: seen by the way as it turns, by cutter and moments.

A force that follows the feed keeps its direction against it as the path turns. With one axis across the spindle turned over, or
with two that change places, or on the path of a mirrored part, it does so against the feed of the path's mirror image, and not
against its own. On a path to and fro on a line both are alike. Along the spindle a flat end mill on a level way is pulled out
of its holder by its helix, and hardly ever pushed in. Moments about the sensor's origin are those of the force at the tool's
tip, but for the cutter's radius and the depth, which are short beside the way from the sensor to it.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import numpy as np
from numpy.typing import NDArray

from compensator.forces.cut_direction import FEWEST, FOLLOWS, TOLD, TURNS, Travel
from compensator.path.robot_path import RobotPath
from identification.common.arrays import Array
from identification.common.findings import Finding
from identification.model.cell import Cell
from identification.model.quaternion_order import other_order

# A cutter is flat whose corner is at most this share of its radius, a way level that climbs by less than this share of it; the
# mean force towards the spindle is more than such a share of that across it: of the sets of coefficients that materials.py
# holds possible one in thirty pushes so.
FLAT, LEVEL, PUSHED = 0.1, 0.02, 0.15
# Moments tell where the sensor is so far from the tip [m], and the force stands across the way there by such a share; they fit
# where the factor lies between these and this share of their energy is left at most; another reading is named that leaves so
# much less.
AWAY, ACROSS, FACTOR, FITS, LESS = 0.1, 0.3, (0.7, 1.4), 0.15, 4.0
# A turn about the sensor's own axis is named of so many degrees at least, where the stated one leaves this share of the energy.
# What a cutter's radius of 25 mm leaves of an arm of 280 is under that.
LEAST_TURN, LEFT_BY_TURN = 10, 0.02
# No edge of a cutter is farther from its tip [m] (engineering judgement: half a face mill, and its depth).
LONGEST_ARM = 0.12


def said_of_mirror(cuts: Travel | None, force: Array, source: str) -> list[Finding]:
    """A warning (CS3125) where the force (N, 3) [N], base frame, follows the path's mirror image."""
    if cuts is None or cuts.turns <= TURNS:
        return []
    # Any plane that holds the spindle does: what follows the one follows the others.
    across = cuts.left[0]
    feed = cuts.feed - 2 * np.outer(cuts.feed @ across, across)
    here, there = (travel.against(force).follows for travel in (cuts, replace(cuts, feed=feed, left=np.cross(cuts.up, feed))))
    if there <= FOLLOWS or there <= TOLD * here:
        return []
    return [Finding(
        "CS3125", "warning", f"as the path turns, {100 * here:.0f} % of the force keeps its direction against the feed; on the "
        f"path of the mirrored part it would be {100 * there:.0f} %", file=source,
        hint="is one of the force axes across the tool turned over, do two stand in another order, or is this the program of a "
        "mirrored part, or the log of one?")]


def said_of_axial(cuts: Travel | None, path: RobotPath, force: Array, source: str) -> list[Finding]:
    """A warning (CS3126) where a flat end mill, as cell.yaml states it, is pushed into its holder. force (N, 3) [N] on the
    tool, base frame."""
    cutter = path.cell.cutting
    if cuts is None or not cutter.tool_diameter_mm or cutter.corner_radius_mm is None or (
            cutter.corner_radius_mm > FLAT * cutter.tool_diameter_mm / 2):
        return []
    step = path.steps[cuts.which]
    level = np.abs(np.einsum("ni,ni->n", step, cuts.up)) < LEVEL * np.linalg.norm(step, axis=1)
    if level.sum() < FEWEST:
        return []
    local = force[cuts.which][level]
    upward = float(np.average(np.einsum("ni,ni->n", local, cuts.up[level]), weights=cuts.weight[level]))
    across = float(np.sqrt(np.average(
        np.sum(np.cross(local, cuts.up[level]) ** 2, axis=1), weights=cuts.weight[level])))
    if upward <= PUSHED * across:
        return []
    return [Finding(
        "CS3126", "warning", f"on level ways the flat end mill is pushed into its holder, by {upward:.0f} N at {across:.0f} N "
        "across it: a helix pulls it out", file=source,
        hint="is the force axis along the tool turned over? Hang a weight on the tool. Right for a cutter of left-hand helix "
        "(downcut), and for a tip that rubs")]


def said_of_moments(
    load: Array, base_from_axes: Array, lever: Array, forced: NDArray[np.bool_], cell: Cell, source: str
) -> list[Finding]:
    """A warning (CS3127) where the moments are not those of the force at the tool's tip. load (N, 6) [N, N m] in the log's
    axes; base_from_axes (N, 3, 3); lever (N, 3) [m]: from the log's origin to the tip, base frame."""
    if not forced.any():
        return []
    if cell.force_log.kind != "sensor":
        return _of_no_cutter(load[forced], cell, source)
    arm = np.einsum("nji,nj->ni", base_from_axes, lever)[forced]
    force, moment = load[forced, :3], load[forced, 3:]
    made = np.cross(arm, force)
    reach = float(np.sqrt(np.mean(np.sum(arm**2, axis=1))))
    if reach < AWAY or np.sum(made**2) <= ACROSS**2 * reach**2 * np.sum(force**2) or not moment.any():
        return []
    readings = {signs: _held_against(np.cross(arm, force * signs), moment) for signs in product((1.0, -1.0), repeat=3)}
    factor, left = readings[1.0, 1.0, 1.0]
    turned_by = _turned_by(arm, force, moment, left)
    if FACTOR[0] < factor < FACTOR[1] and left <= FITS and not turned_by:
        return []
    signs = min(readings, key=lambda signs: (readings[signs][0] <= 0, readings[signs][1]))
    other, least = readings[signs]
    turned = [name for name, sign in zip(("fx", "fy", "fz"), signs, strict=True) if sign < 0]
    if turned and least <= FITS and left > LESS * least:
        how = f"with {' and '.join(turned)} turned over they would be, {other:.2f} times"
    elif left <= FITS and not turned_by:
        how = f"they are {factor:.2f} times those"
    elif turn := _fitting_turn(cell, arm, force, moment, left):
        how = f"with {turn} they would be"
    elif turned_by:
        how = f"with the sensor turned by {turned_by:+d} degrees more about its own z than cell.yaml states they would be"
    else:
        how = f"{100 * left:.0f} % of them is not"
    return [Finding(
        "CS3127", "warning", f"the moments in this log are not those of its forces at the tool's tip: {how}", file=source,
        hint="are the force and the moment columns of one unit and gain, their axes those of the sensor, and are "
        "force_log.sensor_position_mm and sensor_quaternion right (sensor in the flange frame)? A known weight on the tool "
        "tells")]


def _held_against(own: Array, moment: Array) -> tuple[float, float]:
    """How many times moments (k, 3) [N m] are those that forces make, `own` (k, 3), and the share of their energy that this
    leaves."""
    factor = float(np.sum(own * moment) / np.sum(own**2))
    return factor, float(np.sum((moment - factor * own) ** 2) / np.sum(moment**2))


def _turned_by(arm: Array, force: Array, moment: Array, left: float) -> int:
    """By how many degrees more than stated the sensor is turned about its own z axis, as the moments tell; 0: not seen. As it
    is clamped, or its axes are read; the weight on it may be too light to tell."""
    if left < LEFT_BY_TURN:
        return 0
    found = {}
    for degrees in range(-180, 180):
        c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
        factor, least = _held_against(np.cross(arm @ np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]), force), moment)
        found[degrees] = least if FACTOR[0] < factor < FACTOR[1] else np.inf
    best = min(found, key=lambda degrees: found[degrees])
    return best if abs(best) >= LEAST_TURN and left > LESS * found[best] and found[best] <= FITS else 0


def _fitting_turn(cell: Cell, arm: Array, force: Array, moment: Array, left: float) -> str:
    """Another turn of the sensor that would make the moments those of the forces, in words; "" for none. arm (k, 3) [m] to the
    tip, force and moment (k, 3) [N, N m], the sensor's axes as stated; left: what the stated turn leaves of the moments."""
    if cell.force_log.flange_from_sensor is None:
        return ""
    stated = cell.force_log.flange_from_sensor.rotation
    turns = {"force_log.sensor_quaternion turned the other way (it is the sensor's in the flange frame)": stated.T,
             "force_log.sensor_quaternion read as x y z w": other_order(stated), "a sensor that is not turned": np.eye(3)}
    found = {}
    for words, turn in turns.items():
        factor, least = _held_against(np.cross(arm @ (turn.T @ stated).T, force), moment)
        found[words] = least if FACTOR[0] < factor < FACTOR[1] else np.inf
    best = min(found, key=lambda words: found[words])
    return best if found[best] <= FITS and left > LESS * found[best] else ""


def _of_no_cutter(load: Array, cell: Cell, source: str) -> list[Finding]:
    """A warning (CS3127) where moments that are said to be about the tool's tip have an arm that no cutter has. load (k, 6)
    [N, N m] as logged."""
    force, moment = (float(np.sqrt(np.mean(np.sum(part**2, axis=1)))) for part in (load[:, :3], load[:, 3:]))
    if moment <= LONGEST_ARM * force:
        return []
    size = f"{1e3 * moment / force:.0f} mm times its forces" if force else f"{moment:.3g} N m and its forces nothing"
    return [Finding(
        "CS3127", "warning", f"the moments in this log are {size} (RMS), and in the frame {cell.force_log.kind} about the "
        "tool's tip: no cutting edge is so far from it", file=source,
        hint="are they about the sensor's own origin, and along its own axes? Then force_log.frame: sensor, with "
        "sensor_position_mm and sensor_quaternion")]

"""What still readings say that no weight does: something that touches or pulls, and a centre of mass that cannot be."""

from __future__ import annotations

import numpy as np

from compensator.forces.payload import Payload, estimate_payload
from identification.common.arrays import Array
from identification.common.findings import Finding
from identification.model.cell import Cell
from identification.model.gravity import FREE_FALL
from identification.model.rotations import Frame

# What pulls beside a weight is over this [N], and over this share of what the force changes by, since sensors are true to 1 %
# (1 sigma an axis), or it is one orientation alone. Of more orientations than this one can be left out.
PULLED, UNTRUE, FEWEST_LEFT = 1.5, 0.01, 4
# Moments are off those of an arm by more than so long a one [m]; a centre stands on the robot's side of the sensor by more than
# this [m], or so far from the stated one [m] where the mass is the stated one within this share (engineering judgement).
UNTRUE_ARM, BEHIND, OFF_STATED, SAME_MASS = 5e-3, 5e-3, 3e-2, 0.1


def said_of_pull(payload: Payload, fall: Array, theta: Array, load: Array, source: str) -> list[Finding]:
    """A warning (CS3050) where something beside a weight acts on the sensor. fall (k, 3) [m/s^2] and load (k, 6) [N, N m] in
    the log's frame, theta (k, 6) [rad], one row an orientation. The one without which the others agree is named."""
    force, scatter = load[:, :3], payload.force_scatter
    change = float(np.sqrt(np.mean(np.sum((force - force.mean(axis=0)) ** 2, axis=1))))
    alone = _alone(payload, fall, theta, load) if scatter > PULLED else ""
    if scatter < max(PULLED, UNTRUE * change) and not alone:
        return []
    return [Finding("CS3050", "warning", f"the still forces are {scatter:.2g} N an axis (1 sigma) off what a weight "
                    f"does{alone}", file=source,
                    hint="did the tool touch, do hoses pull, was the sensor cold, or zeroed again on the way? Left in, it is a "
                    "false cutting force")]


def _alone(payload: Payload, fall: Array, theta: Array, load: Array) -> str:
    """The orientation without which the others agree, in words; "" where there is not one."""
    count = len(load)
    if count <= FEWEST_LEFT:
        return ""
    left = [estimate_payload(np.delete(fall, k, axis=0), np.delete(load, k, axis=0), has_moment=False) for k in range(count)]
    scatter = np.array([np.inf if one is None else one.force_scatter for one in left])
    best = int(np.argmin(scatter))
    if scatter[best] > payload.force_scatter / 5 or (np.delete(scatter, best) < 2 * scatter[best]).any():
        return ""
    joints = ", ".join(f"{angle:.0f}" for angle in np.degrees(theta[best]))
    return f"; without orientation {best + 1} of {count} ({joints} deg) the others agree within {scatter[best]:.2g} N"


def said_of_centre(
    centre: Array, std: Array, payload: Payload, cell: Cell, flange_from_log: Frame, source: str
) -> list[Finding]:
    """A warning (CS3051) for moments that no arm gives, or a centre (3,) [m], flange frame, 1 sigma std (3,), on the robot's
    side of the sensor, or far from the one that cell.yaml states for this mass."""
    form, unsure = cell.force_log, 3 * float(np.linalg.norm(std))
    towards = cell.flange_from_tcp.position - flange_from_log.position
    reach = float(np.linalg.norm(towards))
    behind = -float((centre - flange_from_log.position) @ towards) / reach if form.kind == "sensor" and reach > 0 else 0.0
    off = float(np.linalg.norm(centre - form.centre)) if form.centre is not None else 0.0
    same = bool(form.mass) and abs(payload.mass / (form.mass or 1.0) - 1) < SAME_MASS
    if payload.moment_scatter > UNTRUE_ARM * payload.mass * FREE_FALL:
        what = f"the moments are {payload.moment_scatter:.2g} N m an axis (1 sigma) off those of this weight on any arm"
    elif behind > max(BEHIND, unsure):
        what = f"the centre of mass lies {1e3 * behind:.0f} mm behind the sensor, on the robot's side"
    elif same and off > max(OFF_STATED, unsure):
        what = f"the centre of mass is {1e3 * off:.0f} mm from the one that cell.yaml states, and the mass is the same"
    else:
        return []
    return [Finding("CS3051", "warning", what, file=source,
                    hint="are mx_nm my_nm mz_nm in the order and with the signs of the sensor, about its own origin, and is "
                    "force_log.sensor_position_mm right?")]

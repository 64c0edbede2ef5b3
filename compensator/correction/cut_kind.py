"""Climb milling, a slot or neither, by the direction of the force on the tool: what its growth with the depth is like.

Seen along the spindle a cutter turns clockwise. Linear-edge coefficients of aluminium, steel and titanium (Altintas,
Manufacturing Automation, ch. 2) give for an end mill, by the angle of the mean force to the left of the feed:

    climb, up to half of the cutter engaged    40 to 86 deg: pulled forwards, pushed left, away from the wall; that push grows
                                               with the depth by 0.7 to 1.2 of its share
    slot, and over three quarters engaged      94 to 141 deg: backwards and left; with a step aside it grows by an eighth of
                                               what it does at a wall 1.5 mm deep, in a full slot not at all, but with one
                                               along the axis (slot_cut.py)
    conventional, up to half engaged           beyond 148 deg, or to the right: the push across passes through zero as the
                                               depth grows, and no cutting stiffness describes it

A ball or a tip pushes the tool into the spindle, a helix pulls it out: where it is pushed in the angles say nothing of a slot.
The limits are engineering judgement between these figures.
"""

from __future__ import annotations

import numpy as np

from compensator.path.robot_path import RobotPath
from identification.common.arrays import Array, directions

# Angles of the force to the left of the feed [deg]: up to CLIMB it is climb milling, from SLOT to WIDE a slot's, from
# CONVENTIONAL on neither.
CLIMB, SLOT, WIDE, CONVENTIONAL = 80.0, 100.0, 130.0, 150.0
# Pushed into the spindle by more than this share of the force across the axis it is no end mill's slot.
PUSHED_IN = 0.2


def climb_share(path: RobotPath, force: Array) -> Array:
    """1 where the force (N, 3) [N] on the tool, base frame, is that of climb milling with up to half the cutter in the stock, 0
    where it is not, between them a ramp (N,)."""
    return cut_shares(path, force)[0]


def cut_shares(path: RobotPath, force: Array) -> tuple[Array, Array]:
    """The same (N,), and 1 where the force is that of a slot, or of a cutter engaged nearly as far; 0 and ramps (N,) alike."""
    angle, pushed_in = _against_feed(path, force)
    climbing = np.where(angle > 0, np.clip((SLOT - angle) / (SLOT - CLIMB), 0.0, 1.0), 0.0)
    slotting = np.minimum((angle - CLIMB) / (SLOT - CLIMB), (CONVENTIONAL - angle) / (CONVENTIONAL - WIDE))
    return np.asarray(climbing), np.asarray(np.where(pushed_in < PUSHED_IN, np.clip(slotting, 0.0, 1.0), 0.0))


def towards_spindle(path: RobotPath) -> Array:
    """Unit vectors (N, 3), base frame, along the tool's axis from its tip to the spindle, whichever way its z points."""
    axis = path.base_from_tcp.rotation[:, :, 2]
    return np.asarray(axis * np.where(np.einsum("ni,ni->n", axis, path.to_flange) < 0, -1.0, 1.0)[:, None])


def _against_feed(path: RobotPath, force: Array) -> tuple[Array, Array]:
    """The angle (N,) [deg] of the force to the left of the feed, 0 where there is none of either, and its part towards the
    spindle as a share (N,) of that across the axis."""
    along = np.zeros_like(force)
    known = np.flatnonzero(path.known)
    if len(known) > 1:
        along[known] = directions(np.gradient(path.base_from_tcp.position[known], axis=0))
    up = towards_spindle(path)
    along -= up * np.einsum("ni,ni->n", along, up)[:, None]
    along = directions(along)
    forwards, left = np.einsum("ni,ni->n", force, along), np.einsum("ni,ni->n", force, np.cross(up, along))
    pushed_in = np.einsum("ni,ni->n", force, up) / np.maximum(np.hypot(forwards, left), 1e-300)
    return np.nan_to_num(np.degrees(np.arctan2(left, forwards))), np.nan_to_num(pushed_in, posinf=np.inf)

"""The moves of a program one by one: straight, circular or by joint angles, where the robot stops and which corners it blends.

Fine points, zones that are not known, turns sharper than SHARPEST, and every change between linear moves and joint moves,
between tools or from one mechanical unit's work objects to another's are stops. A fly-by zone takes at most half a leg.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from compensator.path.arc_length import circle, turned_angle
from compensator.path.robot_path import RobotPath
from compensator.toolpath import Move
from identification.common.arrays import read_only
from identification.model.rotations import Frame, rotation_vector

Array = NDArray[np.float64]
Indices = NDArray[np.intp]
Flags = NDArray[np.bool_]

# Targets nearer to the one before than this [m], [rad] are the same place.
SAME_PLACE, SAME_TURN = 1e-6, 1e-5
# A turn beyond this is a stop, whatever the zone [rad].
SHARPEST = np.radians(150.0)


@dataclass(frozen=True, eq=False)
class Poses:
    """Where the tool of each target (N) is commanded to: base_from_tcp, the base where it stands at that target, and the joint
    angles theta (N, 6) [rad] there."""

    base_from_tcp: Frame
    theta: Array


@dataclass(frozen=True, eq=False)
class Legs:
    """The moves to N targets; leg i ends at target i.

    linear (N,): driven with the TCP on a line or an arc, judged by its feed. joint (N,): driven by joint angles. A leg that is
    neither is not known. same (N,): the target lies where the one before lies. before (N,): the target at which the leg starts.
    length (N,) [m], chord or arc. first, last (N, 3) unit tangents; turn (N, 3) [rad] rotation vector of the leg, all in the
    resting frame (external_axes.py), in which a leg is a line or an arc.
    centre [m], axis (N, 3), angle (N,) [rad] of an arc, angle 0 for a line.
    At the leg's end: radius (N,) [m] of the blend; stop (N,): the robot stands still; corner (N,) [rad]; unknown_zone (N,).
    """

    linear: Flags
    joint: Flags
    same: Flags
    before: Indices
    length: Array
    first: Array
    last: Array
    turn: Array
    centre: Array
    axis: Array
    angle: Array
    radius: Array
    stop: Flags
    corner: Array
    unknown_zone: Flags


def build_legs(path: RobotPath, poses: Poses, lost: Flags | None = None) -> Legs:
    """The legs of a program driven through these poses. lost (N,): those along which no joint angles were found: not
    linear."""
    toolpath, count = path.toolpath, len(path.toolpath)
    reached = np.asarray(~np.isnan(poses.theta).any(axis=1))
    resting = path.axes.to_rest(poses.base_from_tcp)
    position = np.where(reached[:, None], resting.position, 0.0)
    before = np.maximum(np.arange(count) - 1, 0)
    chord = position - position[before]
    length = np.linalg.norm(chord, axis=1)
    rotation = resting.rotation
    turn = np.zeros((count, 3))
    turn[1:] = rotation_vector(np.where(reached[1:, None, None] & reached[:-1, None, None],
                                        rotation[1:] @ np.swapaxes(rotation[:-1], 1, 2), np.eye(3)))
    turned = np.linalg.norm(turn, axis=1)
    usable = reached & reached[before] & (np.arange(count) > 0)
    along = np.isin(toolpath.move, (Move.LINEAR, Move.ARC_VIA, Move.ARC_END))
    carried = path.axes.carrier
    linear = usable & along & (toolpath.tool == toolpath.tool[before]) & (carried == carried[before])
    still = np.insert(~path.axes.turns, 0, True) if count else np.ones(0, dtype=bool)
    same = linear & (length < SAME_PLACE) & (turned < SAME_TURN) & still
    # A turn on the spot has no feed of the TCP: it takes what the joints need.
    joint = usable & ~same & (~linear | (length < SAME_PLACE))
    linear &= ~joint & ~same
    first = chord / np.maximum(length, SAME_PLACE)[:, None]
    last = first.copy()
    centre, axis, angle = np.zeros((count, 3)), np.zeros((count, 3)), np.zeros(count)
    via = np.flatnonzero((toolpath.move[:-1] == Move.ARC_VIA) & (toolpath.move[1:] == Move.ARC_END) & linear[:-1] & linear[1:])
    if len(via):
        straight, middle, about = circle(position[via - 1], position[via], position[via + 1])
        for end in (via, via + 1):
            curved = end[~straight]
            centre[curved], axis[curved] = middle[~straight], about[~straight]
            start = position[curved - 1] - centre[curved]
            angle[curved] = turned_angle(axis[curved], start, position[curved] - centre[curved])
            radius = np.linalg.norm(start, axis=1)
            length[curved] = radius * angle[curved]
            first[curved] = np.cross(axis[curved], start) / radius[:, None]
            last[curved] = np.cross(axis[curved], position[curved] - centre[curved]) / radius[:, None]
    if lost is not None:
        linear[lost] = False
    # A leg starts where the last one that is not on the spot ended.
    kept = np.flatnonzero(~same)
    before[kept[1:]] = kept[:-1]
    radius, stop, corner, unknown_zone = _corners(toolpath.move, toolpath.zone, linear, same, length, first, last)
    read_only(linear, joint, same, before, length, first, last, turn, centre, axis, angle, radius, stop, corner, unknown_zone)
    return Legs(linear, joint, same, before, length, first, last, turn, centre, axis, angle, radius, stop, corner,
                unknown_zone)


def _corners(
    move: NDArray[np.uint8], zone: Array, linear: Flags, same: Flags, length: Array, first: Array, last: Array
) -> tuple[Array, Flags, Array, Flags]:
    """Blend radius, stop, corner angle and unknown zone at the end of each leg (N,), as in `Legs`. A target where the one
    before lies passes its zone on to that one."""
    kept = np.flatnonzero(~same)
    group = np.cumsum(~same) - 1
    smallest = np.full(len(kept), np.inf)
    np.fmin.at(smallest, group, zone)
    missing = np.zeros(len(kept), dtype=bool)
    np.logical_or.at(missing, group, np.isnan(zone))
    via = move[kept] == Move.ARC_VIA
    follows = np.append(linear[kept[1:]], False)
    cosine = np.einsum("ij,ij->i", last[kept[:-1]], first[kept[1:]])
    angle = np.append(np.arccos(np.clip(cosine, -1.0, 1.0)), 0.0)
    half = 0.5 * np.minimum(length[kept], np.append(length[kept[1:]], np.inf))
    flying = linear[kept] & follows & (via | (~missing & (smallest > 0) & (angle < SHARPEST)))
    radius, stop, corner = np.zeros(len(same)), np.zeros(len(same), dtype=bool), np.zeros(len(same))
    unknown_zone = np.zeros(len(same), dtype=bool)
    stop[kept] = ~flying
    radius[kept] = np.where(flying, np.minimum(smallest, half), 0.0)
    corner[kept] = np.where(linear[kept] & follows, angle, 0.0)
    unknown_zone[kept] = missing & linear[kept] & follows & ~via
    return radius, stop, corner, unknown_zone

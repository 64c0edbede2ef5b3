"""Arc length along the targets, and the target that an arc length belongs to."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from compensator.toolpath import Move

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

ARC_STEP = np.radians(3.0)
# No target of a robot is farther away [m].
FARTHEST = 1e6


def arc_length(position: Array, move: NDArray[np.uint8]) -> Array:
    """Path length (N,) [m] at each target: chords, arcs for MoveC, joint and air moves included; 0 at the first.

    position (N, 3) [m] in one frame. Targets of unknown position (NaN), or of one
    no robot has, have NaN and are left out of the path.
    """
    length = np.full(len(position), np.nan)
    known = np.flatnonzero((np.abs(position) < FARTHEST).all(axis=1))
    if not len(known):
        return length
    points = position[known]
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    via = np.flatnonzero((move[known][1:-1] == Move.ARC_VIA) & (move[known][2:] == Move.ARC_END))
    if len(via):
        steps[via], steps[via + 1] = _arc_steps(points[via], points[via + 1], points[via + 2])
    length[known] = np.concatenate([[0.0], np.cumsum(steps)])
    return length


def _arc_steps(start: Array, via: Array, end: Array) -> tuple[Array, Array]:
    """Lengths (n,) of both parts of the circular arcs through three points (n, 3); the chord where they are in line."""
    straight, centre, axis = circle(start, via, end)
    radius = np.linalg.norm(start - centre, axis=1)
    first = np.where(straight, np.linalg.norm(via - start, axis=1), radius * turned_angle(axis, start - centre, via - centre))
    second = np.where(straight, np.linalg.norm(end - via, axis=1), radius * turned_angle(axis, via - centre, end - centre))
    return first, second


def circle(start: Array, via: Array, end: Array) -> tuple[NDArray[np.bool_], Array, Array]:
    """Of the circles through three points (n, 3): whether they are in line (n,), centre and axis (n, 3); the arc from start
    over via to end turns in the positive sense about the axis."""
    to_via, to_end = via - start, end - start
    normal = np.cross(to_via, to_end)
    doubled = np.einsum("ij,ij->i", normal, normal)
    chord = np.linalg.norm(to_via, axis=1) * np.linalg.norm(to_end, axis=1)
    straight = np.sqrt(doubled) <= 1e-9 * chord
    safe = np.where(straight, 1.0, doubled)[:, None]
    centre = start + (np.cross(normal, to_via) * np.einsum("ij,ij->i", to_end, to_end)[:, None]
                      - np.cross(normal, to_end) * np.einsum("ij,ij->i", to_via, to_via)[:, None]) / (2 * safe)
    return straight, centre, normal / np.sqrt(safe)


def turned_angle(axis: Array, first: Array, second: Array) -> Array:
    """Angle (n,) from first to second about the axis, 0 to 2 pi [rad]."""
    sine = np.einsum("ij,ij->i", axis, np.cross(first, second))
    return np.asarray(np.mod(np.arctan2(sine, np.einsum("ij,ij->i", first, second)), 2 * np.pi))


def polyline(position: Array, move: NDArray[np.uint8]) -> tuple[Array, Array]:
    """The path as points (K, 3) [m] and their arc length (K,) [m]: the targets of known position, arcs in steps of at most
    3 degrees."""
    length = arc_length(position, move)
    known = np.flatnonzero(~np.isnan(length))
    points, s, kind = position[known], length[known], move[known]
    via = np.flatnonzero((kind[1:-1] == Move.ARC_VIA) & (kind[2:] == Move.ARC_END))
    if not len(via):
        return points, s
    straight, centre, axis = circle(points[via], points[via + 1], points[via + 2])
    extra_points, extra_s = [points], [s]
    for arc in np.flatnonzero(~straight):
        for first in (via[arc], via[arc] + 1):
            radius = points[first] - centre[arc]
            angle = (s[first + 1] - s[first]) / np.linalg.norm(radius)
            inner = np.arange(1, int(np.ceil(angle / ARC_STEP))) / np.ceil(angle / ARC_STEP)
            turned = angle * inner[:, None]
            extra_points.append(centre[arc] + np.cos(turned) * radius + np.sin(turned) * np.cross(axis[arc], radius))
            extra_s.append(s[first] + inner * (s[first + 1] - s[first]))
    every = np.concatenate(extra_s)
    order = np.argsort(every, kind="stable")
    return np.concatenate(extra_points)[order], every[order]


def nearest_target(length: Array, place: Array) -> Indices:
    """The target (M,) each arc length `place` (M,) [m] belongs to: half a segment on either side.

    length (N,) [m] from `arc_length`; targets with NaN get nothing.
    """
    known = np.flatnonzero(~np.isnan(length))
    return np.asarray(known[np.searchsorted(borders(length), place, side="right")])


def borders(length: Array) -> Array:
    """Arc lengths half way between targets that follow each other, those of unknown position (NaN) left out."""
    known = length[~np.isnan(length)]
    return np.asarray(0.5 * (known[1:] + known[:-1]))

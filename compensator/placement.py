"""Where on the path each sample of a force log was taken, as arc length, and which target it belongs to."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from compensator.toolpath import Move

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

# A logged TCP position farther than this from the whole path ahead is not on it [m].
OFF_PATH = 5e-3
ARC_STEP = np.radians(3.0)
# No target of a robot is farther away [m].
FARTHEST = 1e6
# How many samples are looked at one by one when the log is matched forwards; the rest follow in between.
KEYS_PER_TARGET, FEWEST_KEYS = 4, 4000


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
    return np.asarray(known[np.searchsorted(_half_way(length), place, side="right")])


def borders(position: Array, move: NDArray[np.uint8]) -> Array:
    """Arc lengths half way between targets that follow each other, those of unknown position left out; as `arc_length`."""
    return _half_way(arc_length(position, move))


def _half_way(length: Array) -> Array:
    known = length[~np.isnan(length)]
    return np.asarray(0.5 * (known[1:] + known[:-1]))


def match_forwards(points: Array, s: Array, samples: Array) -> Array:
    """Arc length (M,) [m] of TCP positions `samples` (M, 3) [m] in time order; NaN where a sample is not on the path.

    points (K, 3) [m] and s (K,) [m]: the path as from `polyline`.

    The log is followed forwards: each sample is looked for a little ahead of the one before it, so that passes which
    cross or lie side by side stay apart; only where nothing is near is the search widened to the whole path ahead.
    """
    if len(points) < 2:
        near = np.linalg.norm(samples - points[0], axis=1) < OFF_PATH if len(points) else np.zeros(len(samples), bool)
        return np.where(near, 0.0, np.nan)
    starts, vectors = points[:-1], np.diff(points, axis=0)
    squares = np.maximum(np.einsum("ij,ij->i", vectors, vectors), 1e-300)
    count = min(len(samples), max(KEYS_PER_TARGET * len(points), FEWEST_KEYS))
    keys = np.unique(np.linspace(0, len(samples) - 1, count).round().astype(np.intp))

    def project(point: Array, first: int, last: int) -> tuple[float, float]:
        """Smallest distance [m] to segments first ... last - 1, and the arc length there."""
        offset = point - starts[first:last]
        share = np.clip(np.einsum("ij,ij->i", offset, vectors[first:last]) / squares[first:last], 0, 1)
        gap = offset - share[:, None] * vectors[first:last]
        distance = np.einsum("ij,ij->i", gap, gap)
        best = int(np.argmin(distance))
        index = first + best
        return float(np.sqrt(distance[best])), float(s[index] + share[best] * (s[index + 1] - s[index]))

    places = np.full(len(keys), np.nan)
    here, before = 0.0, None
    for number, key in enumerate(keys):
        point = samples[key]
        moved = 0.0 if before is None else float(np.linalg.norm(point - before))
        # The first sample may lie anywhere on the path: the earliest place that is as near as any.
        reach = s[-1] if before is None else here + 3 * moved + 1e-4
        first = max(int(np.searchsorted(s, here - 2e-4, side="right")) - 1, 0)
        for _ in range(40):         # each widens fourfold: from a millimetre to beyond any path
            last = min(max(int(np.searchsorted(s, reach, side="left")), first + 1), len(starts))
            distance, place = project(point, min(first, last - 1), last)
            if distance < OFF_PATH / 10 or last == len(starts):
                break
            reach = here + 4 * max(reach - here, 1e-3)
        if distance <= OFF_PATH:
            here = max(here, place)
            places[number] = here
            before = point
    good = ~np.isnan(places)
    if not good.any():
        return np.full(len(samples), np.nan)
    return _refine(starts, vectors, squares, s, samples, keys[good], places[good])


def _refine(
    starts: Array, vectors: Array, squares: Array, s: Array, samples: Array, keys: Indices, places: Array
) -> Array:
    """Every sample projected on the path between the places of the key samples before and after it; NaN off the path."""
    number = np.arange(len(samples))
    after = np.clip(np.searchsorted(keys, number, side="left"), 0, len(keys) - 1)
    before = np.maximum(after - 1, 0)
    low, high = places[before] - 1e-4, places[after] + 1e-4
    guess = np.interp(number, keys, places)
    middle = np.clip(np.searchsorted(s, guess, side="right") - 1, 0, len(starts) - 1)
    lengths = np.diff(s)
    place = guess
    share = (guess - s[middle]) / np.maximum(lengths[middle], 1e-300)
    best = np.sum((samples - starts[middle] - np.clip(share, 0, 1)[:, None] * vectors[middle]) ** 2, axis=1)
    for shift in (0, -1, 1, -2, 2):
        index = np.clip(middle + shift, 0, len(starts) - 1)
        offset = samples - starts[index]
        share = np.clip(np.einsum("ij,ij->i", offset, vectors[index]) / squares[index], 0, 1)
        there = np.clip(s[index] + share * lengths[index], low, high)
        share = (there - s[index]) / np.maximum(lengths[index], 1e-300)
        gap = offset - np.clip(share, 0, 1)[:, None] * vectors[index]
        distance = np.einsum("ij,ij->i", gap, gap)
        closer = (distance < best) & (share > -1e-9) & (share < 1 + 1e-9)
        best[closer] = distance[closer]
        place[closer] = there[closer]
    place[best > OFF_PATH**2] = np.nan
    return place

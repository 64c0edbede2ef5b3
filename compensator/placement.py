"""Where on the path each sample of a force log was taken, as arc length, and which target it belongs to."""

from __future__ import annotations

import math

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
# So many samples and segments are taken out of their arrays at once; so many segments are looked at one by one.
PIECE, FEW = 16_384, 12
# A sample may lie behind the one before by as much: noise [m].
BACK = 2e-4
# Squares of distances this close are the same [m^2].
SAME = 1e-18
# A place behind the sample before is taken where it is nearer by as much [m^2].
BEHIND = 1e-8
# So many places at which a log may begin are tried with so many samples.
TRIALS, TRIAL = 8, 400
# So near [m] a sample is on the path; after so many that are not, the path is searched farther ahead.
NEAR, LOST = 0.1 * OFF_PATH, 5


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
    samples = np.clip(samples, -FARTHEST, FARTHEST)
    starts, vectors = points[:-1], np.diff(points, axis=0)
    squares = np.maximum(np.einsum("ij,ij->i", vectors, vectors), 1e-300)
    count = min(len(samples), max(KEYS_PER_TARGET * len(points), FEWEST_KEYS))
    keys = np.unique(np.linspace(0, len(samples) - 1, count).round().astype(np.intp))
    segments = _Segments(starts, vectors, squares, s)
    places, _ = _follow(segments, samples[keys], _start(segments, samples, keys))
    good = ~np.isnan(places)
    if not good.any():
        return np.full(len(samples), np.nan)
    return _refine(starts, vectors, squares, s, samples, keys[good], places[good])


def _start(segments: _Segments, samples: Array, keys: Indices) -> float:
    """Where the log begins [m]: of the places that the first sample on the path is about as near to as any, the one from which
    the samples after it follow the path best; the earliest of those that are alike."""
    for key in keys:
        distance, place = segments.distances(samples[key])
        if distance.min() <= OFF_PATH:
            break
    else:
        return 0.0
    begin = int(np.searchsorted(keys, key))
    near = np.flatnonzero(distance <= distance.min() + NEAR)
    groups = np.split(near, np.flatnonzero(np.diff(place[near]) > 2 * NEAR) + 1)
    best = np.array([group[np.argmin(distance[group])] for group in groups])
    candidates = place[np.sort(best[np.argsort(distance[best], kind="stable")[:TRIALS]])]
    if len(candidates) == 1:
        return float(candidates[0])
    off = np.array([_rms_off(segments, samples[keys[begin:begin + TRIAL]], start) for start in candidates])
    return float(candidates[np.argmax(off <= 1.2 * off.min() + 1e-6)])


def _rms_off(segments: _Segments, samples: Array, here: float) -> float:
    """How far the samples (k, 3) are off the path, RMS [m], when they are followed from `here` without a leap."""
    return float(np.sqrt(np.mean(_follow(segments, samples, here, leap=False)[1] ** 2)))


def _follow(segments: _Segments, samples: Array, here: float, *, leap: bool = True) -> tuple[Array, Array]:
    """Arc length (k,) [m] of samples (k, 3), one after the other from the place `here` on, NaN where one is not on the path,
    and how far off it they are (k,) [m], at most OFF_PATH. leap: to a place farther ahead, where the log left out some of the
    path.

    Each depends on the one before and looks at a few segments: plain numbers are quicker here than small arrays, and
    are made of the arrays piece by piece.
    """
    places, off = np.full(len(samples), np.nan), np.full(len(samples), OFF_PATH)
    first, before, lost, again = 0, None, 0, LOST
    for block in range(0, len(samples), PIECE):
        for number, point in enumerate(samples[block:block + PIECE].tolist(), block):
            moved = 0.0 if before is None else math.dist(point, before)
            first = segments.holding(here - BACK, first)
            reach = here + 3 * moved + 1e-4
            distance, place, whole = segments.nearest(point, first, here - BACK, reach)
            if distance <= NEAR:
                lost, again = 0, LOST
            else:
                lost += 1
                if lost == again and leap:
                    again *= 2
                    wide, ahead = distance, place
                    while wide > NEAR and not whole:
                        reach = here + 4 * max(reach - here, 1e-3)
                        wide, ahead, whole = segments.nearest(point, first, here - BACK, reach)
                    # A corner cut by its zone is off the path, too: what follows tells.
                    following = samples[number:number + TRIAL]
                    if 2 * _rms_off(segments, following, ahead) < _rms_off(segments, following, here):
                        distance, place, lost, again = wide, ahead, 0, LOST
            if (distance <= NEAR or lost >= LOST) and distance <= OFF_PATH:
                here, before = max(here, place), point
                places[number] = here
            off[number] = min(distance, OFF_PATH)
    return places, off


class _Segments:
    """The segments of a path, PIECE of them at a time as plain numbers."""

    def __init__(self, starts: Array, vectors: Array, squares: Array, s: Array) -> None:
        self.starts, self.vectors, self.squares, self.s = starts, vectors, squares, s
        self.base, self.end = 0, 0

    def distances(self, point: Array, first: int = 0, last: int | None = None) -> tuple[Array, Array]:
        """Distance [m] of a point (3,) to each segment from `first` to before `last`, and the arc length there."""
        part = slice(first, last)
        offset = point - self.starts[part]
        along = np.clip(np.einsum("ij,ij->i", offset, self.vectors[part]) / self.squares[part], 0, 1)
        lengths = np.diff(self.s[first:None if last is None else last + 1])
        return np.linalg.norm(offset - along[:, None] * self.vectors[part], axis=1), self.s[:-1][part] + along * lengths

    def _load(self, first: int) -> None:
        self.base, self.end = first, min(first + PIECE, len(self.starts))
        part = slice(first, self.end)
        lengths = np.diff(self.s[first:self.end + 1])
        self.rows = np.column_stack([self.s[part], lengths, self.starts[part], self.vectors[part], self.squares[part]]).tolist()

    def holding(self, place: float, first: int) -> int:
        """The last segment that begins at `place` or before it, from `first` on."""
        while True:
            if not self.base <= first < self.end:
                self._load(first)
            last = self.end - 1
            while first < last and self.rows[first + 1 - self.base][0] <= place:
                first += 1
            if first < last or last == len(self.starts) - 1 or self.s[first + 1] > place:
                return first
            first += 1

    def nearest(self, point: list[float], first: int, least: float, reach: float) -> tuple[float, float, bool]:
        """Smallest distance [m] to segments from `first` on that begin before `reach`, places behind `least` counting for a
        little farther; the arc length there, and whether these are all there are."""
        x, y, z = point
        lowest = smallest = math.inf
        place = 0.0
        index = first
        for index in range(first, min(first + FEW, self.end)):
            start, length, ax, ay, az, vx, vy, vz, square = self.rows[index - self.base]
            if index > first and start >= reach:
                return math.sqrt(smallest), place, False
            ox, oy, oz = x - ax, y - ay, z - az
            share = min(max((ox * vx + oy * vy + oz * vz) / square, 0.0), 1.0)
            gap = (ox - share * vx) ** 2 + (oy - share * vy) ** 2 + (oz - share * vz) ** 2
            there = start + share * length
            # Where the path goes back over itself the way back is ahead.
            cost = gap + BEHIND if there < least else gap
            if cost < lowest - SAME:
                lowest, smallest, place = cost, gap, there
        last = max(int(np.searchsorted(self.s[:-1], reach, side="left")), first + 1)
        if last > index + 1:
            distance, places = self.distances(np.array(point), index + 1, last)
            best = int(np.argmax(distance**2 <= distance.min() ** 2 + SAME))
            if distance[best] ** 2 < lowest - SAME:
                smallest, place = float(distance[best]) ** 2, float(places[best])
        return math.sqrt(smallest), place, last == len(self.starts)


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

"""Map matching: where on the path each sample of a log of TCP positions was taken, as arc length."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from compensator.path.arc_length import FARTHEST
from identification.common.arrays import Array

Indices = NDArray[np.intp]

# A logged TCP position farther than this from the whole path ahead is not on it [m].
OFF_PATH = 5e-3
# How many samples are matched one by one in the order of time; the rest are projected in between.
KEYS_PER_TARGET, FEWEST_KEYS = 4, 4000
# So many samples and segments are taken out of their arrays at once; so many segments are looked at one by one.
PIECE, FEW = 16_384, 12
# A sample may lie behind the one before by as much: noise [m].
BACK = 2e-4
# Squares of distances this close are the same [m^2].
SAME = 1e-18
# A projection behind the sample before is taken where it is nearer by as much [m^2].
BEHIND = 1e-8
# So many candidates for the start of a log are tried with so many samples.
CANDIDATES, TRIAL = 8, 400
# So near [m] a sample is on the path; after so many misses the path is searched farther ahead.
NEAR, MISSES = 0.1 * OFF_PATH, 5


def match_forwards(points: Array, s: Array, samples: Array) -> Array:
    """Arc length (M,) [m] of TCP positions `samples` (M, 3) [m] in time order; NaN where a sample is not on the path.

    points (K, 3) [m] and s (K,) [m]: the path as from `polyline`.

    The log is matched forwards: each sample is looked for a little ahead of the one before it, so that passes which
    cross or lie side by side stay apart; only where nothing is near is the search widened to the whole path ahead.
    """
    if len(points) < 2:
        near = np.linalg.norm(samples - points[0], axis=1) < OFF_PATH if len(points) else np.zeros(len(samples), bool)
        return np.where(near, 0.0, np.nan)
    samples = np.clip(samples, -FARTHEST, FARTHEST)
    count = min(len(samples), max(KEYS_PER_TARGET * len(points), FEWEST_KEYS))
    keys = np.unique(np.linspace(0, len(samples) - 1, count).round().astype(np.intp))
    segments = _Segments(points, s)
    arc, _ = _match(segments, samples[keys], _start(segments, samples, keys))
    good = ~np.isnan(arc)
    if not good.any():
        return np.full(len(samples), np.nan)
    return _project_between(segments, samples, keys[good], arc[good])


def _start(segments: _Segments, samples: Array, keys: Indices) -> float:
    """Arc length [m] at which the log begins: of the candidates that the first sample on the path is about as near to as any,
    the one from which the samples after it match the path best; the earliest of those that are alike."""
    for key in keys:
        distance, arc = segments.projections(samples[key])
        if distance.min() <= OFF_PATH:
            break
    else:
        return 0.0
    begin = int(np.searchsorted(keys, key))
    near = np.flatnonzero(distance <= distance.min() + NEAR)
    groups = np.split(near, np.flatnonzero(np.diff(arc[near]) > 2 * NEAR) + 1)
    nearest = np.array([group[np.argmin(distance[group])] for group in groups])
    candidates = arc[np.sort(nearest[np.argsort(distance[nearest], kind="stable")[:CANDIDATES]])]
    if len(candidates) == 1:
        return float(candidates[0])
    off = np.array([_rms_distance(segments, samples[keys[begin:begin + TRIAL]], start) for start in candidates])
    return float(candidates[np.argmax(off <= 1.2 * off.min() + 1e-6)])


def _rms_distance(segments: _Segments, samples: Array, start: float) -> float:
    """How far the samples (k, 3) are off the path, RMS [m], when they are matched from arc length `start` on without a leap."""
    return float(np.sqrt(np.mean(_match(segments, samples, start, leap=False)[1] ** 2)))


def _match(segments: _Segments, samples: Array, start: float, *, leap: bool = True) -> tuple[Array, Array]:
    """Arc length (k,) [m] of samples (k, 3), one after the other from arc length `start` on, NaN where one is not on the path,
    and how far off it they are (k,) [m], at most OFF_PATH. leap: to a candidate farther ahead, where the log left out some of
    the path.

    Each depends on the one before and looks at a few segments: plain numbers are quicker here than small arrays, and
    are made of the arrays piece by piece.
    """
    arcs, off = np.full(len(samples), np.nan), np.full(len(samples), OFF_PATH)
    here, first, before, misses, next_search = start, 0, None, 0, MISSES
    for block in range(0, len(samples), PIECE):
        for number, point in enumerate(samples[block:block + PIECE].tolist(), block):
            step = 0.0 if before is None else math.dist(point, before)
            first = segments.holding(here - BACK, first)
            reach = here + 3 * step + 1e-4
            distance, arc, whole = segments.nearest(point, first, here - BACK, reach)
            if distance <= NEAR:
                misses, next_search = 0, MISSES
            else:
                misses += 1
                if misses == next_search and leap:
                    next_search *= 2
                    wide, ahead = distance, arc
                    while wide > NEAR and not whole:
                        reach = here + 4 * max(reach - here, 1e-3)
                        wide, ahead, whole = segments.nearest(point, first, here - BACK, reach)
                    # A corner cut by its zone is off the path, too: what comes after tells.
                    later = samples[number:number + TRIAL]
                    if 2 * _rms_distance(segments, later, ahead) < _rms_distance(segments, later, here):
                        distance, arc, misses, next_search = wide, ahead, 0, MISSES
            if (distance <= NEAR or misses >= MISSES) and distance <= OFF_PATH:
                here, before = max(here, arc), point
                arcs[number] = here
            off[number] = min(distance, OFF_PATH)
    return arcs, off


class _Segments:
    """The segments of a path, PIECE of them at a time as plain numbers."""

    def __init__(self, points: Array, s: Array) -> None:
        self.starts, self.vectors, self.s = points[:-1], np.diff(points, axis=0), s
        self.squares = np.maximum(np.einsum("ij,ij->i", self.vectors, self.vectors), 1e-300)
        self.base, self.end = 0, 0

    def projections(self, point: Array, first: int = 0, last: int | None = None) -> tuple[Array, Array]:
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

    def holding(self, arc: float, first: int) -> int:
        """The last segment that begins at arc length `arc` or before it, from `first` on."""
        while True:
            if not self.base <= first < self.end:
                self._load(first)
            last = self.end - 1
            while first < last and self.rows[first + 1 - self.base][0] <= arc:
                first += 1
            if first < last or last == len(self.starts) - 1 or self.s[first + 1] > arc:
                return first
            first += 1

    def nearest(self, point: list[float], first: int, least: float, reach: float) -> tuple[float, float, bool]:
        """Smallest distance [m] to segments from `first` on that begin before `reach`, projections behind `least` counting
        for a little farther; the arc length there, and whether these are all there are."""
        x, y, z = point
        lowest = smallest = math.inf
        arc = 0.0
        index = first
        for index, (start, length, ax, ay, az, vx, vy, vz, square) in enumerate(
                self.rows[first - self.base:first - self.base + FEW], first):
            if start >= reach and index > first:
                return math.sqrt(smallest), arc, False
            ox, oy, oz = x - ax, y - ay, z - az
            along = ox * vx + oy * vy + oz * vz
            # Written out: calls and powers are half of the time here.
            share = 0.0 if along <= 0.0 else 1.0 if along >= square else along / square
            ox, oy, oz = ox - share * vx, oy - share * vy, oz - share * vz
            gap = ox * ox + oy * oy + oz * oz
            there = start + share * length
            # Where the path goes back over itself the way back is ahead.
            cost = gap + BEHIND if there < least else gap
            if cost < lowest - SAME:
                lowest, smallest, arc = cost, gap, there
        last = max(int(np.searchsorted(self.s[:-1], reach, side="left")), first + 1)
        if last > index + 1:
            distances, arcs = self.projections(np.array(point), index + 1, last)
            best = int(np.argmax(distances**2 <= distances.min() ** 2 + SAME))
            if distances[best] ** 2 < lowest - SAME:
                smallest, arc = float(distances[best]) ** 2, float(arcs[best])
        return math.sqrt(smallest), arc, last == len(self.starts)


def _project_between(segments: _Segments, samples: Array, keys: Indices, arc: Array) -> Array:
    """Arc length (M,) [m] of every sample, projected on the path between those of the key samples before and after it, arc (k,)
    [m]; NaN off the path."""
    starts, vectors, squares, s = segments.starts, segments.vectors, segments.squares, segments.s
    number = np.arange(len(samples))
    after = np.clip(np.searchsorted(keys, number, side="left"), 0, len(keys) - 1)
    before = np.maximum(after - 1, 0)
    low, high = arc[before] - 1e-4, arc[after] + 1e-4
    guess = np.interp(number, keys, arc)
    middle = np.clip(np.searchsorted(s, guess, side="right") - 1, 0, len(starts) - 1)
    lengths = np.diff(s)
    projected = guess
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
        projected[closer] = there[closer]
    projected[best > OFF_PATH**2] = np.nan
    return projected

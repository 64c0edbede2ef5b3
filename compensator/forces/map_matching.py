"""Map matching: where on the path each sample of a log of TCP positions was taken, as arc length."""

from __future__ import annotations

import math

import numpy as np

from compensator.forces.path_segments import Indices, Segments
from compensator.path.arc_length import FARTHEST
from identification.common.arrays import Array

# A logged TCP position farther than this from the whole path ahead is not on it [m].
OFF_PATH = 5e-3
# How many samples are matched one by one in the order of time; the rest are projected in between, so many at once.
KEYS_PER_TARGET, FEWEST_KEYS, AT_ONCE = 4, 4000, 1 << 18
# A sample may lie behind the one before by as much: noise [m].
BACK = 2e-4
# So many candidates for the start of a log are tried with so many samples.
CANDIDATES, TRIAL = 8, 400
# What cannot be better is given up after so many of them, or twice, three times as many.
FEWEST_TRIED = 20
# So near [m] a sample is on the path; after so many misses the path is searched farther ahead, first as far as this [m].
NEAR, MISSES, AHEAD = 0.1 * OFF_PATH, 5, 4e-3
# Of a segment's length, by which what lies on it may be beyond its ends.
SLACK = 1e-9

# A later pass has at least so much of the samples of the one before it, and is that of this path where it lies so much nearer
# to it in the middle, unless the other is off it by no more than noise and zones put it [m]. It
# ends once it has come to the last part of the path, this share of it.
FEWEST_OF_PASS, NEARER, SAME_PASS, AT_END = 0.5, 0.5, 1e-4, 0.02


def match_forwards(points: Array, s: Array, samples: Array) -> Array:
    """Arc length (M,) [m] of TCP positions `samples` (M, 3) [m] in time order; NaN where a sample is not on the path.

    points (K, 3) [m] and s (K,) [m]: the path as from `polyline`.

    The log is matched forwards: each sample is looked for a little ahead of the one before it, so that passes which
    cross or lie side by side stay apart; only where nothing is near is the search widened to the whole path ahead.
    Time grows as M + K log K, whatever the log: a search looks at what lies near the sample alone, and what follows a sample
    is walked once.
    """
    if len(points) < 2:
        near = np.linalg.norm(samples - points[0], axis=1) < OFF_PATH if len(points) else np.zeros(len(samples), bool)
        return np.where(near, 0.0, np.nan)
    samples = np.clip(samples, -FARTHEST, FARTHEST)
    count = min(len(samples), max(KEYS_PER_TARGET * len(points), FEWEST_KEYS))
    keys = np.unique(np.linspace(0, len(samples) - 1, count).round().astype(np.intp))
    segments = Segments(points, s)
    arc = _match(segments, samples[keys], _start(segments, samples[keys]))
    good = ~np.isnan(arc)
    if not good.any():
        return np.full(len(samples), np.nan)
    return np.concatenate([
        _project_between(segments, samples[part:part + AT_ONCE], part, keys[good], arc[good])
        for part in range(0, len(samples), AT_ONCE)])


def match_nearest_pass(points: Array, s: Array, samples: Array) -> tuple[Array, int]:
    """`match_forwards` of that pass of a log which lies nearest to the path, and how many passes lie on it: layer upon layer a
    tool goes along the same lines, and one layer's path is as long as the others'. Of passes that lie as near the first."""
    best = found = match_forwards(points, s, samples)
    passes = 1
    while (behind := _end(found, s)) < len(samples):
        later = np.full(len(samples), np.nan)
        later[behind:] = match_forwards(points, s, samples[behind:])
        if np.isfinite(later).sum() < FEWEST_OF_PASS * np.isfinite(found[:behind]).sum():
            break
        if np.isfinite(found[:behind]).sum() < FEWEST_OF_PASS * np.isfinite(later).sum():
            # No pass: a few samples at the beginning, where the path ends too.
            best = found = later
            continue
        passes += 1
        # Samples of a later pass come near the last move of this one.
        found[behind:] = np.nan
        if found is not best and _off(points, s, samples, found) < NEARER * _off(points, s, samples, best):
            best = found
        found = later
    if found is not best and _off(points, s, samples, found) < NEARER * _off(points, s, samples, best):
        best = found
    return best, passes


def _end(arc: Array, s: Array) -> int:
    """The sample behind a pass, arc (M,): the first off the path once it has come to the last part of it."""
    on = np.flatnonzero(~np.isnan(arc))
    if not len(on):
        return len(arc)
    run = on[int(np.argmax(arc[on] >= arc[on].max() - max(OFF_PATH, AT_END * float(s[-1])))):]
    return int(run[int(np.argmax(np.diff(run, append=-1) != 1))]) + 1


def _off(points: Array, s: Array, samples: Array, arc: Array) -> float:
    """How far [m] samples (M, 3) lie off the path in the middle, by their places (M,) on it; at least SAME_PASS."""
    on = ~np.isnan(arc)
    off = samples[on] - np.column_stack([np.interp(arc[on], s, axis) for axis in points.T])
    return max(float(np.median(np.linalg.norm(off, axis=1))), SAME_PASS)


def _start(segments: Segments, samples: Array) -> float:
    """Arc length [m] at which the log begins: of the candidates that the first sample (k, 3) on the path is about as near to as
    any, the one from which the samples after it match the path best; the earliest of those that are alike."""
    for begin in range(len(samples)):
        distance, arc = segments.projections(samples[begin], segments.within(samples[begin], OFF_PATH))
        if distance.min(initial=np.inf) <= OFF_PATH:
            break
    else:
        return 0.0
    near = np.flatnonzero(distance <= distance.min() + NEAR)
    groups = np.split(near, np.flatnonzero(np.diff(arc[near]) > 2 * NEAR) + 1)
    nearest = np.array([group[np.argmin(distance[group])] for group in groups])
    candidates = arc[np.sort(nearest[np.argsort(distance[nearest], kind="stable")[:CANDIDATES]])]
    if len(candidates) == 1:
        return float(candidates[0])
    later = samples[begin:begin + TRIAL].tolist()
    off = np.sqrt([np.mean(np.square(_Walk(segments, start).along(later))) for start in candidates])
    return float(candidates[np.argmax(off <= 1.2 * off.min() + 1e-6)])


class _Walk:
    """Samples matched one after the other from an arc length on without a leap; for each of them `off`, how far it is off
    the path [m], at most OFF_PATH, `near`, where it lies on it, NaN where it is off, `arcs`, the same where it is matched: the
    first sample at once, later ones that are not quite on the path after some in a row, and `before`, where the walk stood.

    Each depends on the one before and looks at a few segments: plain numbers are quicker here than small arrays.
    """

    def __init__(self, segments: Segments, start: float) -> None:
        self.segments, self.here, self.first = segments, start, 0
        self.last: list[float] | None = None
        self.misses = MISSES
        self.off: list[float] = []
        self.near: list[float] = []
        self.arcs: list[float] = []
        self.before: list[float] = []

    def along(self, samples: list[list[float]]) -> list[float]:
        """Goes on by these samples; how far each walked so far is off the path [m]."""
        segments, here, first, last, misses = self.segments, self.here, self.first, self.last, self.misses
        for point in samples:
            step = 0.0 if last is None else math.dist(point, last)
            self.before.append(here)
            first = segments.holding(here - BACK, first)
            distance, arc = segments.nearest(point, first, here - BACK, here + 3 * step + 1e-4, OFF_PATH)
            misses = 0 if distance <= NEAR else misses + 1
            near = max(here, arc) if distance <= OFF_PATH else math.nan
            matched = (misses == 0 or misses >= MISSES) and distance <= OFF_PATH
            if matched:
                here, last = near, point
            self.near.append(near)
            self.arcs.append(near if matched else math.nan)
            self.off.append(min(distance, OFF_PATH))
        self.here, self.first, self.last, self.misses = here, first, last, misses
        return self.off


def _match(segments: Segments, samples: Array, start: float) -> Array:
    """Arc length (k,) [m] of samples (k, 3), one after the other from arc length `start` on, NaN where one is not on the path.

    After so many misses a place farther ahead is tried, where the log left out some of the path. A corner cut by its zone is
    off the path, too: the walk is always TRIAL samples ahead, and what comes after tells; behind the last one nothing does.
    """
    found, near = np.empty(len(samples)), np.empty(len(samples))
    walk, begin = _Walk(segments, start), 0
    misses, next_search = 0, MISSES
    for number in range(len(samples)):
        if len(walk.off) < min(number + TRIAL, len(samples)) - begin:
            walked = begin + len(walk.off)
            walk.along(samples[walked:walked + 2 * TRIAL].tolist())
        k = number - begin
        if walk.off[k] <= NEAR:
            misses, next_search = 0, MISSES
        else:
            misses += 1
            if misses == next_search:
                next_search *= 2
                ahead = _ahead(segments, samples[number], walk.before[k], walk.off[k])
                later = samples[number:number + TRIAL]
                if ahead is not None and (leap := _better(segments, later, ahead, walk.off[k:k + TRIAL])):
                    walk, begin, k = leap, number, 0
                    misses, next_search = 0, MISSES
        found[number], near[number] = walk.arcs[k], walk.near[k]
    matched = np.flatnonzero(~np.isnan(found))
    last = int(matched[-1]) if len(matched) else len(found)
    found[last:] = near[last:]
    return found


def _ahead(segments: Segments, sample: Array, here: float, off: float) -> float | None:
    """Where the path ahead of arc length `here` [m] is nearer to a sample (3,) than by `off` [m]: nearest within the first
    reach that comes near it, each four times as long; nearest of all where none comes near; None where none is nearer."""
    close = segments.within(sample, off, max(int(np.searchsorted(segments.s[:-1], here - BACK, side="right")) - 1, 0))
    distance, arc = segments.projections(sample, close)
    nearer = distance < off
    distance, arc, begin = distance[nearer], arc[nearer], segments.s[close[nearer]]
    if not len(distance):
        return None
    if (near := distance <= NEAR).any():
        times = math.ceil(math.log(max((begin[near][0] - here) / AHEAD, 1.0), 4.0))
        distance = np.where(begin <= here + AHEAD * 4.0**times, distance, np.inf)
    return float(arc[np.argmin(distance)])


def _better(segments: Segments, samples: Array, ahead: float, off: list[float]) -> _Walk | None:
    """The walk by samples (k, 3) from arc length `ahead` [m] on where it keeps to the path at least twice as well as one that
    is `off` it by as much (k,) [m]; given up as soon as it cannot."""
    walk, most = _Walk(segments, ahead), float(np.sum(np.square(off))) / 4
    for part in range(0, len(samples), FEWEST_TRIED):
        if float(np.sum(np.square(walk.along(samples[part:part + FEWEST_TRIED].tolist())))) >= most:
            return None
    return walk


def _project_between(segments: Segments, samples: Array, first: int, keys: Indices, arc: Array) -> Array:
    """Arc length (m,) [m] of samples (m, 3), whose numbers count from `first`, projected on the path between those of the key
    samples before and after them, arc (k,) [m]; NaN off the path."""
    starts, vectors, squares, s, lengths = segments.starts, segments.vectors, segments.squares, segments.s, segments.lengths
    number = first + np.arange(len(samples))
    after = np.clip(np.searchsorted(keys, number, side="left"), 0, len(keys) - 1)
    before = np.maximum(after - 1, 0)
    low, high = arc[before] - 1e-4, arc[after] + 1e-4
    guess = np.interp(number, keys, arc)
    middle = np.clip(np.searchsorted(s, guess, side="right") - 1, 0, len(starts) - 1)
    projected = guess
    share = (guess - s[middle]) / np.maximum(lengths[middle], 1e-300)
    best = np.sum((samples - starts[middle] - np.clip(share, 0, 1)[:, None] * vectors[middle]) ** 2, axis=1)
    for shift in (0, -1, 1, -2, 2):
        index = np.clip(middle + shift, 0, len(starts) - 1)
        # A segment that ends before what lies between the key samples, or begins behind it, holds none of it.
        some = np.flatnonzero((s[index] + (1 + SLACK) * lengths[index] >= low) & (s[index] - SLACK * lengths[index] <= high))
        index = index[some]
        vector, offset = vectors[index], samples[some] - starts[index]
        share = np.clip(np.einsum("ij,ij->i", offset, vector) / squares[index], 0, 1)
        there = np.clip(s[index] + share * lengths[index], low[some], high[some])
        share = (there - s[index]) / np.maximum(lengths[index], 1e-300)
        gap = offset - np.clip(share, 0, 1)[:, None] * vector
        distance = np.einsum("ij,ij->i", gap, gap)
        closer = (distance < best[some]) & (share > -SLACK) & (share < 1 + SLACK)
        best[some[closer]] = distance[closer]
        projected[some[closer]] = there[closer]
    projected[best > OFF_PATH**2] = np.nan
    return projected

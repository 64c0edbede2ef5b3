"""The segments of a path, to be asked for those near a point: a few one by one, or any that lie ahead, by way of boxes."""

from __future__ import annotations

import math
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from identification.common.arrays import Array

Indices = NDArray[np.intp]

# So many segments are taken out of their arrays at once, as plain numbers; so many are looked at one by one, and so many in
# one go without asking the boxes which.
PIECE, FEW, SOME = 2048, 12, 256
# So many boxes lie in a larger one.
IN_A_BOX = 16
# Squares of distances this close are the same [m^2].
SAME = 1e-18
# A projection behind the sample before is taken where it is nearer by as much [m^2].
BEHIND = 1e-8


class Segments:
    """The segments of a path: points (K, 3) [m] at arc length s (K,) [m], as from `polyline`."""

    def __init__(self, points: Array, s: Array) -> None:
        self.starts, self.vectors, self.s, self.lengths = points[:-1], np.diff(points, axis=0), s, np.diff(s)
        self.squares = np.maximum(np.einsum("ij,ij->i", self.vectors, self.vectors), 1e-300)
        self.base, self.end = 0, 0

    def __len__(self) -> int:
        return len(self.starts)

    def projections(self, point: Array, which: slice | Indices = slice(None)) -> tuple[Array, Array]:
        """Distance [m] of a point (3,) to each of these segments, and the arc length there."""
        offset, vectors = point - self.starts[which], self.vectors[which]
        along = np.clip(np.einsum("ij,ij->i", offset, vectors) / self.squares[which], 0, 1)
        return np.linalg.norm(offset - along[:, None] * vectors, axis=1), self.s[:-1][which] + along * self.lengths[which]

    @cached_property
    def _boxes(self) -> list[tuple[Array, Array]]:
        """Corners of the boxes (n, 3) around IN_A_BOX segments in a row, then around so many of these boxes, up to one."""
        ends = self.starts + self.vectors
        levels = [(np.minimum(self.starts, ends), np.maximum(self.starts, ends))]
        while len(levels[-1][0]) > 1:
            low, high = levels[-1]
            firsts = np.arange(0, len(low), IN_A_BOX)
            levels.append((np.minimum.reduceat(low, firsts), np.maximum.reduceat(high, firsts)))
        return levels

    def within(self, point: Array, distance: float, first: int = 0, last: int | None = None) -> Indices:
        """The segments from `first` to before `last` that may lie within a distance [m] of a point (3,): all that do, and those
        whose boxes do."""
        last = len(self) if last is None else last
        found = np.zeros(1, np.intp)
        for number in range(len(self._boxes) - 1, -1, -1):
            low, high = self._boxes[number]
            size = IN_A_BOX**number
            found = found[(found >= first // size) & (found * size < last)]
            gap = np.maximum(np.maximum(low[found] - point, point - high[found]), 0.0)
            found = found[np.einsum("ij,ij->i", gap, gap) <= distance**2]
            if not len(found):
                break
            if number:
                found = (IN_A_BOX * found[:, None] + np.arange(IN_A_BOX)).ravel()
                found = found[found < len(self._boxes[number - 1][0])]
        return found

    def _load(self, first: int) -> None:
        self.base, self.end = first, min(first + PIECE, len(self))
        part = slice(first, self.end)
        self.rows = np.column_stack(
            [self.s[part], self.lengths[part], self.starts[part], self.vectors[part], self.squares[part]]).tolist()

    def holding(self, arc: float, first: int) -> int:
        """The last segment that begins at arc length `arc` or before it, from `first` on; it and the next ones are at hand."""
        while self.base <= first and first + FEW < self.end:
            if self.rows[first + 1 - self.base][0] > arc:
                return first
            first += 1
        first = max(first, int(np.searchsorted(self.s[:-1], arc, side="right")) - 1)
        if not (self.base <= first and (first + FEW < self.end or self.end == len(self))):
            self._load(first)
        return first

    def nearest(self, point: list[float], first: int, least: float, reach: float, far: float) -> tuple[float, float]:
        """Smallest distance [m] to segments from `first` on that begin before `reach`, projections behind `least` counting
        for a little farther, and the arc length there; of distances over `far` [m] any."""
        x, y, z = point
        lowest = smallest = math.inf
        arc = 0.0
        rows = self.rows[first - self.base:first - self.base + FEW]
        for start, length, ax, ay, az, vx, vy, vz, square in rows:
            if start >= reach:
                return math.sqrt(smallest), arc
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
        behind, last = first + len(rows), int(np.searchsorted(self.s[:-1], reach, side="left"))
        if last > behind:
            place, which = np.array(point), slice(behind, last) if last - behind < SOME else self.within(
                np.array(point), min(math.sqrt(lowest), far), behind, last)
            distances, arcs = self.projections(place, which)
            nearest = float(distances.min(initial=math.inf)) ** 2
            if nearest < lowest - SAME:
                smallest, arc = nearest, float(arcs[np.argmax(distances**2 <= nearest + SAME)])
        return math.sqrt(smallest), arc

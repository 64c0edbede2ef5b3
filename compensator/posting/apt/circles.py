"""Arcs: from centre, axis and end point to the points a robot drives through, as MoveC or as chords."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

# The controller takes up to 240 degrees a MoveC. Below 180 degrees the tool keeps its orientation in the work object exactly,
# whichever way the controller carries it along the arc; 120 leaves room.
LARGEST_SWEEP = np.radians(120.0)
# Points of a MoveC closer than this, or at less of an angle, are refused by the controller (0.1 mm, 1 degree) [m, rad].
CLOSEST, SMALLEST_SWEEP = 2e-4, np.radians(2.0)
# How far a chord may be from its arc [m].
CHORD_ERROR = 2e-6


@dataclass(frozen=True, eq=False)
class Arc:
    """An arc, or one turn or several of a helix, from start to end (3,) [m] about `centre`.

    axis (3,): unit; the motion turns positively (right-hand rule) about it by `sweep` [rad]. The height along the axis and the
    distance from it go evenly from the start's to the end's.
    """

    start: Array
    end: Array
    centre: Array
    axis: Array
    sweep: float

    def points(self, count: int) -> Array:
        """Points (count, 3) [m] at even steps behind the start; the last is the end."""
        share = np.arange(1, count + 1)[:, None] / count
        first, height, radius = self._cylinder(self.start)
        _, end_height, end_radius = self._cylinder(self.end)
        second = np.cross(self.axis, first)
        angle = share * self.sweep
        out = (radius + share * (end_radius - radius)) * (np.cos(angle) * first + np.sin(angle) * second)
        points = self.centre + out + (height + share * (end_height - height)) * self.axis
        points[-1] = self.end
        return np.asarray(points)

    def _cylinder(self, point: Array) -> tuple[Array, float, float]:
        """Unit direction away from the axis, height along it and distance from it [m] of a point."""
        height = float((point - self.centre) @ self.axis)
        out = point - self.centre - height * self.axis
        distance = float(np.linalg.norm(out))
        return out / max(distance, 1e-12), height, distance

    @property
    def radius(self) -> float:
        """Distance of the start from the axis [m]."""
        return self._cylinder(self.start)[2]

    @property
    def rise(self) -> float:
        """Height of the end above the start along the axis [m]."""
        return float((self.end - self.start) @ self.axis)

    def tangent(self, end: bool = False) -> Array:
        """Unit direction of the motion in the circle's plane (3,), at the start or at the end."""
        return np.cross(self.axis, self._cylinder(self.end if end else self.start)[0])

    def pieces(self) -> int:
        """How many MoveC it takes, each up to `LARGEST_SWEEP`; 0 where it must be chords (a helix, or too small)."""
        count = int(np.ceil(self.sweep / LARGEST_SWEEP - 1e-9))
        half = self.sweep / count / 2
        flat = abs(self.rise) <= 1e-6
        return count if flat and half >= SMALLEST_SWEEP and 2 * self.radius * np.sin(half / 2) >= CLOSEST else 0

    def chords(self) -> int:
        """How many chords keep within `CHORD_ERROR` of it."""
        largest = 2 * np.arccos(max(1 - CHORD_ERROR / max(self.radius, CHORD_ERROR), -1.0))
        return max(int(np.ceil(self.sweep / largest)), 1)


def sweep_between(start: Array, end: Array, centre: Array, axis: Array, closed: float = 1e-6) -> float:
    """Angle [rad] in 0 < angle <= 2 pi turned about `axis` from start to end (3,); a full turn where they are within `closed`
    [m] of one another, seen along the axis."""
    across = np.eye(3) - np.outer(axis, axis)
    first, last = across @ (start - centre), across @ (end - centre)
    if np.linalg.norm(last - first) <= closed:
        return 2 * np.pi
    angle = float(np.arctan2(axis @ np.cross(first, last), first @ last)) % (2 * np.pi)
    return angle if angle > 0 else 2 * np.pi

"""The part that is milled: a slot from edge to edge, and the wall of a pocket with sharp and rolled corners and arcs.

Work object: millimetres, z up out of the part, the blank's top at z = 0. The pocket has been roughed to an allowance with a
larger tool and its floor lies free; the slot goes through solid stock. Air moves stand before, between and after.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

AIR, SLOT, POCKET = 0, 1, 2
PLACES = ("air", "slot", "slot ends", "straight wall", "arc", "rolled corner", "sharp corner", "roll in and out")
AIR_FEED_MM_S = 150.0
# All sizes [mm] are made up for tests.
RADIUS = 8.0
BLANK_X, SLOT_Y, SLOT_DEPTH = (-50.0, 50.0), 50.0, 1.5
HALF = np.array([45.0, 30.0])       # of the pocket's wall
# Radius of the tool's path in the corners of positive and negative x y: large arcs, and the small one of the top left corner.
LARGE, SMALL = 12.0, 2.0
ROUGHED = 10.0                      # radius that the roughing tool left in the top left and bottom right corners
ROLL = 10.0                         # radius of the arcs on which the tool comes to the wall and leaves it
CORNER = 10.0                       # this far before and behind a sharp corner the force is not that of the straight wall
IN_X, SAFE_Z = -5.0, 15.0


@dataclass(frozen=True)
class Part:
    """Targets (N, 3) [mm] of the planned path, the feature (N,) that the move to each cuts, and its place (N,) in PLACES.

    allowance_mm: stock on the pocket's wall.
    """

    target_mm: np.ndarray
    feature: np.ndarray
    place: np.ndarray
    allowance_mm: float

    def with_targets(self, target_mm: np.ndarray) -> Part:
        """The same path with further targets on it; raises ValueError where one of target_mm (N, 3) is not on it, in order."""
        segment, matched = 1, [0]
        for point in target_mm[1:]:
            while segment < len(self.target_mm) and _distance(point, *self.target_mm[segment - 1:segment + 1]) > 2e-3:
                segment += 1
            if segment == len(self.target_mm):
                raise ValueError(f"{point} is not on the planned path behind the target before it")
            matched.append(segment)
        return Part(target_mm, self.feature[matched], self.place[matched], self.allowance_mm)

    def inside_mm(self, feature: int, xy: np.ndarray) -> np.ndarray:
        """How far within the stock of a feature the points xy (n, 2) lie (n,), negative outside."""
        if feature == SLOT:
            return np.minimum(xy[:, 0] - BLANK_X[0], BLANK_X[1] - xy[:, 0])
        x, y = xy.T
        radius = np.where(x * y > 0, LARGE + RADIUS - self.allowance_mm, ROUGHED)
        over = np.abs(xy) - (HALF - self.allowance_mm) + radius[:, None]
        one, other = over.T
        beyond = np.sqrt(np.maximum(one, 0.0) ** 2 + np.maximum(other, 0.0) ** 2)
        return np.minimum(np.maximum(one, other), 0.0) + beyond - radius


def _distance(point: np.ndarray, first: np.ndarray, last: np.ndarray) -> float:
    """From a point to the straight line between two others [mm]."""
    along = last - first
    share = np.clip((point - first) @ along / (along @ along), 0.0, 1.0)
    return float(np.linalg.norm(point - first - share * along))


@dataclass(frozen=True)
class Steps:
    """The path in small pieces, each taken at its middle.

    segment (S,): the target that the tool moves to; share (S,) of that move done; length_mm (S,); feature, place (S,); feed
    (S, 2): direction in x and y.
    """

    segment: np.ndarray
    share: np.ndarray
    length_mm: np.ndarray
    feature: np.ndarray
    place: np.ndarray
    feed: np.ndarray

    def between(self, rows: np.ndarray) -> np.ndarray:
        """Values at the steps (S, ...) of values at the targets (N, ...)."""
        share = self.share.reshape(-1, *[1] * (rows.ndim - 1))
        return np.asarray((1 - share) * rows[self.segment - 1] + share * rows[self.segment])

    def duration_s(self, feed_mm_s: float) -> np.ndarray:
        return self.length_mm / np.where(self.feature == AIR, AIR_FEED_MM_S, feed_mm_s)

    @cached_property
    def left(self) -> np.ndarray:
        """Unit vectors (S, 3) to the left of the feed: across the machined wall."""
        return np.column_stack([-self.feed[:, 1], self.feed[:, 0], np.zeros(len(self.feed))])


def steps_of(part: Part, step_mm: float = 0.5, air_step_mm: float = 10.0) -> Steps:
    """The part's path in steps of at most that length."""
    moves = np.diff(part.target_mm, axis=0)
    length = np.linalg.norm(moves, axis=1)
    pieces = np.ceil(length / np.where(part.feature[1:] == AIR, air_step_mm, step_mm) - 1e-9).astype(int)
    segment = np.repeat(np.arange(1, len(part.target_mm)), pieces)
    place = np.concatenate([np.arange(count) for count in pieces])
    count = pieces[segment - 1]
    across = moves[segment - 1, :2]
    flat = np.linalg.norm(across, axis=1, keepdims=True)
    feed = np.where(flat > 0, across / np.maximum(flat, 1e-12), [1.0, 0.0])
    return Steps(segment, (place + 0.5) / count, length[segment - 1] / count, part.feature[segment], part.place[segment], feed)


@dataclass
class _Path:
    """A tool path under construction, points with a target every `spacing` [mm]."""

    spacing: float
    points: list[tuple[float, float, float]] = field(default_factory=list)
    feature: list[int] = field(default_factory=list)
    place: list[int] = field(default_factory=list)

    def to(self, x: float, y: float, z: float, feature: int = AIR, place: str = "air") -> None:
        self.points.append((x, y, z))
        self.feature.append(feature)
        self.place.append(PLACES.index(place))

    def line(self, x: float, y: float, feature: int, place: str) -> None:
        x0, y0, z = self.points[-1]
        count = max(round(float(np.hypot(x - x0, y - y0)) / self.spacing), 1)
        for share in np.arange(1, count + 1) / count:
            self.to(x0 + (x - x0) * share, y0 + (y - y0) * share, z, feature, place)

    def arc(self, radius: float, start_deg: float, end_deg: float, place: str) -> None:
        """Anticlockwise, in the pocket; start and end: where the tool stands seen from the centre."""
        start, end = np.radians(start_deg), np.radians(end_deg)
        x, y, z = self.points[-1]
        count = int(np.ceil(radius * (end - start) / self.spacing - 1e-9))
        for angle in start + (end - start) * np.arange(1, count + 1) / count:
            across, along = np.cos(angle) - np.cos(start), np.sin(angle) - np.sin(start)
            self.to(x + radius * across, y + radius * along, z, POCKET, place)


def slot_and_pocket(spacing_mm: float = 1.5, allowance_mm: float = 1.5, wall_depth_mm: float = 4.0, *,
                    pocket: bool = True) -> Part:
    """Both features, or the slot alone, with a target every `spacing_mm` as a CAM system posts them."""
    path = _Path(spacing_mm)
    clear = RADIUS + 4
    start, end = BLANK_X[0] - clear, BLANK_X[1] + clear
    for x in (start - 40, start - 20, start):
        path.to(x, SLOT_Y, SAFE_Z)
    path.to(start, SLOT_Y, -SLOT_DEPTH)
    path.line(BLANK_X[0] + 4, SLOT_Y, SLOT, "slot ends")
    path.line(BLANK_X[1] - clear, SLOT_Y, SLOT, "slot")
    path.line(end, SLOT_Y, SLOT, "slot ends")
    path.to(end, SLOT_Y, SAFE_Z)
    if pocket:
        x, y = HALF - RADIUS
        path.to(IN_X - ROLL, -y + ROLL, SAFE_Z)
        path.to(IN_X - ROLL, -y + ROLL, -wall_depth_mm)
        path.arc(ROLL, 180, 270, "roll in and out")
        path.line(x - CORNER, -y, POCKET, "straight wall")
        path.line(x, -y, POCKET, "sharp corner")
        path.line(x, -y + CORNER, POCKET, "sharp corner")
        path.line(x, y - LARGE, POCKET, "straight wall")
        path.arc(LARGE, 0, 90, "arc")
        path.line(-x + CORNER, y, POCKET, "straight wall")
        path.line(-x + SMALL, y, POCKET, "rolled corner")
        path.arc(SMALL, 90, 180, "rolled corner")
        path.line(-x, y - CORNER, POCKET, "rolled corner")
        path.line(-x, -y + LARGE, POCKET, "straight wall")
        path.arc(LARGE, 180, 270, "arc")
        path.arc(ROLL, 270, 360, "roll in and out")
        path.to(*path.points[-1][:2], SAFE_Z)
    return Part(np.round(np.array(path.points), 4), np.array(path.feature), np.array(path.place), allowance_mm)

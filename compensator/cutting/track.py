"""Track: a program's path in short steps, as the cutter goes through the stock."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from compensator.path.arc_length import nearest_target, polyline
from compensator.path.robot_path import RobotPath
from compensator.toolpath import Move
from identification.common.arrays import Array, read_only
from identification.common.findings import error

Indices = NDArray[np.intp]
# The axis of the tool may be so far off the vertical of the work object [rad]: by more, a flat cutter of 16 mm would stand 0.14
# mm lower on one side.
MOST_TILT = np.radians(1.0)
# Lengths along the path in the work object and in the world are one where nothing moves [m].
SAME_LENGTH = 1e-6


@dataclass(frozen=True, eq=False)
class Track:
    """S steps: start and end (S, 3) [m] of the tip, work object; place (S,) [m] of the middle along the path; target (S,) that
    the middle belongs to, move (S,) whose way it is on; chip (S,) [m]: feed a tooth; joint (S,): a joint move, whose way is not
    known; upright (S,): the tool's axis is that of the stock."""

    start: Array
    end: Array
    place: Array
    target: Indices
    move: Indices
    chip: Array
    joint: NDArray[np.bool_]
    upright: NDArray[np.bool_]

    def __post_init__(self) -> None:
        read_only(self.start, self.end, self.place, self.target, self.move, self.chip, self.joint, self.upright)

    def __len__(self) -> int:
        return len(self.place)

    @property
    def length(self) -> Array:
        """Of the steps (S,) [m]."""
        return np.asarray(np.linalg.norm(self.end - self.start, axis=1))


def track_of(path: RobotPath, teeth: int, revolution: float, step: float, aside: Array | None = None) -> Track:
    """The path of the tip in steps of at most `step` [m]; revolution [s] of the spindle; aside (N, 3) [m], work object: where
    the tool stood off the path at the targets, None: on it.

    Raises CompstiffError (CS4702) for a program whose work object is not one that stands still.
    """
    toolpath = path.toolpath
    known = np.flatnonzero(path.known & ~np.isnan(path.length))
    in_object = path.base_from_object.inverse() @ path.base_from_tcp
    points, length = polyline(np.where(path.known[:, None], in_object.position, np.nan), toolpath.move)
    same = len(known) < 2 or (len(points) >= 2 and abs(length[-1] - np.nanmax(path.length)) <= SAME_LENGTH * (1 + length[-1]))
    if len(np.unique(toolpath.workobject[known])) > 1 or not same:
        raise error("CS4702", "the engagement needs one work object that stands still, and this program has more, or moves it",
                    file=toolpath.source, hint="one program a work object, and external axes held while it cuts")
    if aside is not None:
        points = points + np.column_stack([np.interp(length, path.length[known], axis[known]) for axis in aside.T])
    span = np.diff(length)
    pieces = np.maximum(np.ceil(span / step - 1e-9), 1).astype(np.intp)
    owner = np.repeat(np.arange(len(span)), pieces)
    first = np.arange(len(owner)) - np.repeat(np.cumsum(pieces) - pieces, pieces)
    low, high = first / pieces[owner], (first + 1) / pieces[owner]
    way = points[owner + 1] - points[owner]
    start, end = points[owner] + low[:, None] * way, points[owner] + high[:, None] * way
    place = length[owner] + 0.5 * (low + high) * span[owner]
    kept = span[owner] > 0
    target = nearest_target(path.length, place)
    move = known[np.clip(np.searchsorted(path.length[known], place, side="left"), 0, len(known) - 1)]
    chip = toolpath.feed[move] * revolution / teeth
    joint = np.isin(toolpath.move[move], (Move.JOINT, Move.ABSOLUTE))
    upright = np.abs(in_object.rotation[:, 2, 2]) >= np.cos(MOST_TILT)
    return Track(start[kept], end[kept], place[kept], target[kept], move[kept], chip[kept], joint[kept],
                 (upright[move] & upright[target])[kept])

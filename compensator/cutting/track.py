"""Track: a program's path in short steps, as the cutter goes through the stock.

A ball is a ball whichever way its axis leans: in the stock it goes the way of an upright one with the same middle, whose tip
stands a radius under that. So the track of a ball is that of this tip, and what leans with the axis is its force.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from compensator.forces.program_time import moves_in_air
from compensator.path.arc_length import nearest_target, polyline
from compensator.path.robot_path import RobotPath
from identification.common.arrays import Array, read_only
from identification.common.findings import CompstiffError
from identification.model.rotations import Frame

Indices = NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class Track:
    """S steps: start and end (S, 3) [m] of the tip, of a ball of the point a radius under its middle, work object; place (S,)
    [m] of the middle along the path, length (S,) [m] of the path's piece; target (S,) that the middle belongs to, move (S,)
    whose way it is on; chip (S,) [m]: feed a tooth; joint (S,): a joint move, whose way is not known; axis (S, 3): unit vector
    of the tool towards its spindle, which is above."""

    start: Array
    end: Array
    place: Array
    length: Array
    target: Indices
    move: Indices
    chip: Array
    joint: NDArray[np.bool_]
    axis: Array

    def __post_init__(self) -> None:
        read_only(self.start, self.end, self.place, self.length, self.target, self.move, self.chip, self.joint, self.axis)

    def some(self, steps: Indices, place: Array, order: Indices) -> Track:
        """These steps (n,) at their places among place (S,) [m]; order: the targets that its own numbers stand for."""
        return Track(self.start[steps], self.end[steps], place[steps], self.length[steps], order[self.target[steps]],
                     order[self.move[steps]], self.chip[steps], self.joint[steps], self.axis[steps])

    def __len__(self) -> int:
        return len(self.place)

    @property
    def lowest(self) -> Array:
        """Least x, y and z (S, 3) [m] of each step."""
        return np.asarray(np.minimum(self.start, self.end))

    @property
    def highest(self) -> Array:
        """The largest (S, 3) [m]."""
        return np.asarray(np.maximum(self.start, self.end))


def stock_object(path: RobotPath) -> int:
    """The number of the work object that most moves have of those that may cut: no joint moves, nor at the speed of the air."""
    toolpath = path.toolpath
    linear = path.known & ~toolpath.by_joints
    cutting = linear & ~moves_in_air(toolpath)
    which = next((some for some in (cutting, linear) if some.any()), slice(None))
    return int(np.argmax(np.bincount(toolpath.workobject[which])))


def in_object(path: RobotPath, number: int) -> RobotPath:
    """The path with this work object at every target: where the arm takes the moves of others, seen from there.

    Raises CompstiffError (CS4702) where a unit moves this one and not another meanwhile, or the reverse.
    """
    toolpath, axes = path.toolpath, path.axes
    others = np.flatnonzero(toolpath.workobject != number)
    if not len(others):
        return path
    first = np.flatnonzero(toolpath.workobject == number)[:1]
    apart = others[axes.carrier[others] != axes.carrier[first]]
    if axes.moves and len(apart):
        names = [toolpath.workobjects[item].name for item in (number, int(toolpath.workobject[apart[0]]))]
        raise CompstiffError(path.finding(
            int(apart[0]), "CS4702", "error", f"an axis moves between {' and '.join(names)} during the program, and where the "
            "stock stands is known in one work object", f"state {names[0]} in all moves, those to joint angles (MoveAbsJ) too"))
    rest = axes.to_rest(path.base_from_object[first], first)[0]
    return replace(path, base_from_object=axes.to_base(Frame.shared(rest, len(toolpath))))


def refuse_other_objects(path: RobotPath, number: int, track: Track, cuts: NDArray[np.bool_]) -> None:
    """Raises CompstiffError (CS4702) where linear moves of another work object than this cut the stock. cuts (S,): the steps
    that do. A joint move may: its way is not known, nor is its force."""
    toolpath = path.toolpath
    others = np.unique(track.move[cuts & ~track.joint & (toolpath.workobject[track.move] != number)])
    if not len(others):
        return
    other = int(others[0])
    names = [toolpath.workobjects[item].name for item in (number, int(toolpath.workobject[other]))]
    raise CompstiffError(path.finding(
        other, "CS4702", "error", f"the stock stands in one work object, and this program cuts it in {' and in '.join(names)}",
        "one program a work object; moves that cut nothing may have others"))


def track_of(
    path: RobotPath, teeth: int, revolution: float, step: float, aside: Array | None = None, ball: float = 0.0
) -> Track:
    """The path of the tip in steps of at most `step` [m]; revolution [s] of the spindle; aside (N, 3) [m], work object: where
    the tool stood off the path at the targets, None: on it; ball [m]: radius of a cutter that is one, 0: it is not."""
    toolpath = path.toolpath
    known = np.flatnonzero(path.known & ~np.isnan(path.length))
    tcp = path.base_from_object.inverse() @ path.base_from_tcp
    points, length = polyline(np.where(path.known[:, None], tcp.position, np.nan), toolpath.move)
    up = tcp.rotation[known, :, 2] * np.where(tcp.rotation[known, 2:, 2] < 0, -1.0, 1.0)
    upright = np.array([0.0, 0.0, 1.0])

    def axis_at(places: Array) -> Array:
        """The tool's axis (n, 3) at path lengths (n,)."""
        found = np.column_stack([np.interp(places, path.length[known], component) for component in up.T])
        return np.asarray(found / np.maximum(np.linalg.norm(found, axis=1), 1e-12)[:, None])

    span = np.diff(length)
    if ball:
        points = points + ball * (axis_at(length) - upright)
    # The feed is that of the TCP; the middle of a ball that turns goes another.
    faster = np.linalg.norm(np.diff(points, axis=0), axis=1) / np.where(span > 0, span, 1.0) if ball else np.ones(len(span))
    if aside is not None:
        points = points + np.column_stack([np.interp(length, path.length[known], axis[known]) for axis in aside.T])
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
    done = (high - low) * span[owner]
    chip = toolpath.feed[move] * faster[owner] * revolution / teeth
    joint = toolpath.by_joints[move]
    return Track(start[kept], end[kept], place[kept], done[kept], target[kept], move[kept], chip[kept], joint[kept],
                 axis_at(place[kept]))

"""A program in short pieces: every long MoveL and every MoveC, to see how the deviation varies between its targets."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from compensator.forces.placement import TargetForces
from compensator.path.arc_length import circle, turned_angle
from compensator.path.robot_path import RobotPath
from compensator.rapid import RapidProgram
from compensator.rapid.insertion import follows_directly
from compensator.toolpath import Move, Toolpath
from identification.model.rotations import matrix_to_quaternion, quaternion_to_matrix, rotation_matrix, rotation_vector

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

# Targets nearer than this, in space [m] or in time at the programmed feed [s], are more than a controller plans ahead.
NEAREST, SHORTEST = 1e-3, 0.05
MOST_PIECES, MOST_POINTS = 400, 1_000_000
# Pieces of half an arc; it may be cut into 1, 2 or 4 arcs, each with a circle point.
ARC_PIECES = 8


@dataclass(frozen=True, eq=False)
class Grid:
    """The program in pieces. toolpath: all of it (G), arcs among them as chords. kept (N,): the program's own targets in it.
    owner (G,): the target whose move a further point belongs to, -1 at the program's own."""

    toolpath: Toolpath
    kept: Indices
    owner: Indices

    @property
    def further(self) -> NDArray[np.bool_]:
        """The points (G,) that are not the program's own targets."""
        return np.asarray(self.owner >= 0)


@dataclass(frozen=True, eq=False)
class _Points:
    """Further points (n) of one move: the target they stand before, position (n, 3) [m], quaternion (n, 4)."""

    before: int
    position: Array
    quaternion: Array


def fine_grid(program: RapidProgram, path: RobotPath, forces: TargetForces, long_move: float) -> Grid | None:
    """The moves of at least long_move [m], and arcs with halves of that length, in pieces; None without any."""
    toolpath, count = path.toolpath, len(path.toolpath)
    usable = _usable(path)
    arcs = _arcs(program, toolpath, forces, usable)
    points = [*_on_lines(program, toolpath, forces, usable, long_move),
              *(half for via in arcs for half in _on_arc(toolpath, via, long_move))]
    if not points:
        return None
    at = np.concatenate([np.full(len(move.position), move.before) for move in points])
    order = np.argsort(at, kind="stable")
    at = at[order]
    chords = np.array([[via, via + 1] for via in arcs], dtype=np.intp).ravel()
    grid = _with_points(toolpath, at, np.concatenate([move.position for move in points])[order],
                        np.concatenate([move.quaternion for move in points])[order], chords)
    return Grid(grid, np.arange(count) + np.searchsorted(at, np.arange(count), side="right"),
                np.insert(np.full(count, -1), at, at))


def _usable(path: RobotPath) -> NDArray[np.bool_]:
    """Which moves (N - 1,), from target i to i + 1, may get targets in between."""
    toolpath = path.toolpath
    alike = (toolpath.tool[1:] == toolpath.tool[:-1]) & (toolpath.workobject[1:] == toolpath.workobject[:-1])
    posed = np.asarray(~np.isnan(toolpath.position).any(axis=1))
    return np.asarray(alike & path.reached[1:] & path.reached[:-1] & (toolpath.block[1:] == "")
                      & np.isnan(toolpath.external[1:]).all(axis=1) & posed[:-1] & posed[1:])


def _on_lines(
    program: RapidProgram, toolpath: Toolpath, forces: TargetForces, usable: NDArray[np.bool_], long_move: float
) -> list[_Points]:
    """The points on the long MoveL."""
    step = np.linalg.norm(np.diff(toolpath.position, axis=0), axis=1)
    spacing = np.fmax(NEAREST, SHORTEST * toolpath.feed[1:])
    # Forces that a log places along the move may stand in its middle, those at targets do not.
    near = np.ones(len(step), dtype=bool) if not forces.named else forces.forced[1:] & forces.forced[:-1]
    long = usable & near & (toolpath.move[1:] == Move.LINEAR) & (step >= np.maximum(long_move, 2 * spacing))
    lines = [i for i in (1 + np.flatnonzero(long)).tolist() if follows_directly(program, i)]
    most = min(MOST_PIECES, max(MOST_POINTS // max(len(lines), 1), 4))
    points = []
    for i in lines:
        pieces = int(min(step[i - 1] // spacing[i - 1], most))
        share = np.arange(1, pieces) / pieces
        points.append(_Points(
            i, toolpath.position[i - 1] + share[:, None] * (toolpath.position[i] - toolpath.position[i - 1]),
            _turned(toolpath.quaternion[i - 1], toolpath.quaternion[i], share)))
    return points


def _arcs(
    program: RapidProgram, toolpath: Toolpath, forces: TargetForces, usable: NDArray[np.bool_]
) -> list[int]:
    """The circle points of the MoveC with force."""
    arcs = (usable[:-1] & usable[1:] & (forces.forced[1:-1] | forces.forced[2:]) & (toolpath.move[1:-1] == Move.ARC_VIA)
            & (toolpath.move[2:] == Move.ARC_END))
    return [i for i in (1 + np.flatnonzero(arcs)).tolist() if follows_directly(program, i)]


def _on_arc(toolpath: Toolpath, via: int, long_move: float) -> list[_Points]:
    """The points on both halves of an arc; none where it is short, or straight."""
    start, middle, end = (toolpath.position[via + k][None] for k in (-1, 0, 1))
    straight, centre, axis = circle(start, middle, end)
    to_middle, whole = (float(turned_angle(axis, start - centre, point - centre)[0]) for point in (middle, end))
    angles = (to_middle, whole - to_middle)
    if straight[0] or min(angles) * float(np.linalg.norm(middle - centre)) < long_move:
        return []
    share = np.arange(1, ARC_PIECES) / ARC_PIECES
    points = []
    for half, first in ((0, 0.0), (1, to_middle)):
        angle = first + share * angles[half]
        points.append(_Points(via + half, _on_circle(start[0], centre[0], axis[0], angle),
                              _turned(toolpath.quaternion[via - 1], toolpath.quaternion[via + 1], angle / sum(angles))))
    return points


def _with_points(toolpath: Toolpath, at: Indices, position: Array, quaternion: Array, chords: Indices) -> Toolpath:
    """The toolpath with linear targets before the targets `at`; the moves of `chords` are linear too."""
    def more(values: NDArray[Any], own: NDArray[Any]) -> NDArray[Any]:
        return np.insert(values, at, own, axis=0)

    move = toolpath.move.copy()
    move[chords] = Move.LINEAR
    like: dict[str, Any] = {name: more(getattr(toolpath, name), getattr(toolpath, name)[at]) for name in (
        "line", "column", "confdata", "has_confdata", "tool", "workobject", "feed", "zone")}
    nothing = np.full((len(at), 6), np.nan)
    return replace(
        toolpath, move=more(move, np.full(len(at), Move.LINEAR, dtype=np.uint8)), position=more(toolpath.position, position),
        quaternion=more(toolpath.quaternion, quaternion), external=more(toolpath.external, nothing),
        joints=more(toolpath.joints, nothing),
        block=more(toolpath.block, np.full(len(at), "", dtype=object)), **like)


def _turned(start: Array, end: Array, share: Array) -> Array:
    """Quaternions (n, 4) of the orientations between two, at even rate about one axis."""
    first = quaternion_to_matrix(start)
    turn = rotation_vector(quaternion_to_matrix(end) @ first.T)
    return matrix_to_quaternion(rotation_matrix(share[:, None] * turn) @ first)


def _on_circle(start: Array, centre: Array, axis: Array, angle: Array) -> Array:
    """Points (n, 3) that a start (3,) reaches by turning about a circle's axis."""
    radius = start - centre
    return np.asarray(centre + np.cos(angle)[:, None] * radius + np.sin(angle)[:, None] * np.cross(axis, radius))

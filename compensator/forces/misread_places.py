"""As what the places of a log would lie on the path that they miss: positions in another unit or frame, of the flange, or with
columns exchanged; joint angles in radians, or with two joints exchanged."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import combinations, permutations

import numpy as np

from compensator.forces.log import ForceLog
from compensator.forces.map_matching import OFF_PATH
from compensator.forces.path_segments import Segments
from compensator.path.arc_length import FARTHEST, polyline
from compensator.path.robot_path import RobotPath
from identification.common.arrays import Array
from identification.model.kinematics import forward

# What a column of millimetres may be in by mistake.
UNITS = {"metres": 1e3, "inches": 25.4, "micrometres": 1e-3}
# Places on no more than this share of the path tell nothing: those near a point of it lie on it in any unit.
SHORT = 0.02
# So many samples are looked at. More than this share of them lies on the path if they were taken rightly; what falls short of
# the best by no more than this is told too (engineering judgement).
LOOKED_AT, ENOUGH, ALIKE = 200, 0.5, 0.02
POSITIONS = "x_mm y_mm z_mm are of the TCP, in millimetres, in the program's work object"
ANGLES = "q1_deg ... q6_deg are the controller's angles in degrees"

# Words for a way to take the places, the positions (n, 3) [m] in the world, and whether of the flange.
Taken = tuple[str, Array, bool]


def misread(log: ForceLog, path: RobotPath) -> str:
    """As what the samples of a log by positions or joint angles would lie on this path, to be said; "" for nothing, and for
    another log. The log is of one tool and one work object."""
    if log.key not in ("position", "joints"):
        return ""
    rows = np.unique(np.linspace(0, len(log.place) - 1, LOOKED_AT).round().astype(np.intp))
    paths = {flange: _path(path, flange=flange) for flange in (False, True)}
    taken = _positions(log.place[rows], path) if log.key == "position" else _angles(log.place[rows], path)
    shares: dict[str, float] = {}
    for words, position, flange in taken:
        segments, length = paths[flange]
        shares.setdefault(words, _on(segments, length, position))
    best = max(shares.values(), default=0.0)
    if best <= ENOUGH:
        return ""
    told = [words for words, share in shares.items() if share >= best - ALIKE]
    return f"they do {' or '.join(told[:3])}: {POSITIONS if log.key == 'position' else ANGLES}"


def _path(path: RobotPath, *, flange: bool) -> tuple[Segments, float]:
    """The path of the TCP, or of the flange, in the world, and its length [m]."""
    position = path.world_position
    if flange:
        at = path.axes.world_from_base.apply(path.base_from_flange.position)
        position = np.where(np.isnan(position), np.nan, at)
    points, length = polyline(position, path.toolpath.move)
    return Segments(points, length), float(length[-1]) if len(length) else 0.0


def _on(segments: Segments, length: float, position: Array) -> float:
    """The share of positions (n, 3) [m] that lie on the path; 0 where they are all about one place of it."""
    arcs = []
    for point in np.clip(position, -FARTHEST, FARTHEST):
        near = segments.within(point, OFF_PATH) if len(segments) else np.empty(0, np.intp)
        distance, arc = segments.projections(point, near)
        if distance.min(initial=np.inf) <= OFF_PATH:
            arcs.append(arc[np.argmin(distance)])
    return len(arcs) / len(position) if arcs and np.ptp(arcs) >= SHORT * length else 0.0


def _positions(place: Array, path: RobotPath) -> Iterator[Taken]:
    """Ways to take positions (n, 3) [m] that were read as of the TCP in the work object, in millimetres."""
    cell, in_world = path.cell, path.used_frames.workobjects[0]
    frames: dict[str, Callable[[Array], Array]] = {"": in_world.apply, " in the world": lambda position: position}
    if not (cell.world_from_base.apply(np.eye(3)) == np.eye(3)).all():
        frames[" in the robot's base"] = cell.world_from_base.apply
    for where, apply in frames.items():
        for unit, factor in {"": 1.0, **UNITS}.items():
            if where or unit:
                what = f"in {unit}" if not where else f"as positions{where}{f', in {unit}' if unit else ''}"
                yield what, apply(factor * place), False
        yield f"as positions of the flange{where}", apply(place), True
    for order in permutations(range(3)):
        if order == (0, 1, 2):
            continue
        moved = [axis for axis in range(3) if order[axis] != axis]
        names = [f"{'xyz'[axis]}_mm" for axis in (moved if len(moved) == 2 else order)]
        yield (f"with {' and '.join(names)} exchanged" if len(moved) == 2 else f"with x y z in the columns {' '.join(names)}",
               in_world.apply(place[:, order]), False)


def _angles(place: Array, path: RobotPath) -> Iterator[Taken]:
    """Ways to take joint angles (n, 6) [rad] that were read as degrees."""
    def of(angles: Array) -> Array:
        return path.axes.world_from_base.apply(forward(path.cell.robot, angles, path.used_frames.tools[0]).position)

    yield "in radians", of(np.degrees(place)), False
    for a, b in combinations(range(6), 2):
        order = np.arange(6)
        order[[a, b]] = b, a
        yield f"with q{a + 1}_deg and q{b + 1}_deg exchanged", of(place[:, order]), False

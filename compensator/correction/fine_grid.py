"""Moves of a program in short pieces, to see how the deviation varies between its targets."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from compensator.correction.corners import corner_misses
from compensator.path.arc_length import circle, turned_angle
from compensator.path.external_axes import SAME_VALUE
from compensator.path.robot_path import RobotPath
from compensator.rapid import RapidProgram, follows_directly
from compensator.toolpath import Move, Toolpath
from identification.common.arrays import nothing_or
from identification.model.rotations import matrix_to_quaternion, quaternion_to_matrix, rotation_matrix, rotation_vector

Array = NDArray[np.float64]
Indices = NDArray[np.intp]
Mask = NDArray[np.bool_]

# Pieces of one move, and points of all of them.
MOST_PIECES, MOST_POINTS, FEWEST_PIECES = 2000, 200_000, 8
# A controller takes no MoveC whose circle point is nearer to its ends [m], or seen under a smaller angle from its start; the
# angle at the centre is twice that (ABB, RAPID instructions: MoveC, limitations: 0.1 mm, 1 degree; with a tenth to spare).
ARC_SPACING, ARC_ANGLE = 0.11e-3, np.radians(2.2)
# Pieces of half an arc are a power of two, so that arcs can be halved; so many are looked at though it is not.
LOOKED_AT = 4
# So many targets on either side of a move are on a grid with it: what is said of a point is said of its neighbours' neighbours.
AROUND = 4
# Two targets stand as far apart as they must where they do so but for the rounding of what is written.
FULL = 0.999
# Decimals of the external axes of further targets [mm or deg]: a RAPID number has seven digits.
VALUE_DECIMALS = 6


@dataclass(frozen=True, eq=False)
class Grid:
    """Some moves of a program in pieces. toolpath: these with targets of the program around them, or all of it with them (G),
    arcs among them as chords. owner (G,): the program's target that a point is, or, where it is a further one (G,), that whose
    move it belongs to. arcs (A, 2): the MoveC, by their first point and the points to their circle point.
    may (G,): points of lines that can be written as targets; divisible (G,): points of arcs that can be halved; beside_zone
    (G,): points that may not, because they would make the zone of a corner smaller; crowded (G,): since they are nearer to a
    target of the program than targets may stand."""

    toolpath: Toolpath
    owner: Indices
    further: Mask
    arcs: Indices
    may: Mask
    divisible: Mask
    beside_zone: Mask
    crowded: Mask

    @cached_property
    def kept(self) -> Indices:
        """The points (K,) that are targets of the program."""
        return np.flatnonzero(~self.further)

    @property
    def targets(self) -> Indices:
        """Which of the program's these are (K,)."""
        return self.owner[self.kept]


@dataclass(frozen=True, eq=False)
class _Points:
    """Further points (n): the target they stand before (n,), at which share (n,) of the way from the target before that;
    position (n, 3) [m], quaternion (n, 4); whether each can be written as a target, is part of an arc that can be halved, or is
    too near to a corner with a zone, or to a target (n,)."""

    before: Indices
    share: Array
    position: Array
    quaternion: Array
    may: Mask
    divisible: Mask
    beside_zone: Mask
    crowded: Mask


def spacing_of(toolpath: Toolpath, least: float, shortest: float) -> Array:
    """How near to each other the targets of each move (N,) may stand [m]: `least` [m], and `shortest` [s] at its feed."""
    return np.fmax(least, shortest * toolpath.feed)


def fine_grid(
    program: RapidProgram, path: RobotPath, spacing: Array, pieces: Array, tolerance: float, *, keep: bool, whole: bool
) -> Grid | None:
    """The moves (N,) in pieces of `pieces` (N,) [m] or more, those with inf left out; None without any. Points that may be
    written keep `spacing` (N,) [m] from the targets of the program, and away from corners with a zone, so that these are driven
    as planned, but for the tolerance [m]. keep: none may be written. whole: all targets of the program stand on the grid, not
    only those around these moves."""
    toolpath, count = path.toolpath, len(path.toolpath)
    usable = np.insert(_usable(path), 0, False)
    arc = (toolpath.move[:-1] == Move.ARC_VIA) & (toolpath.move[1:] == Move.ARC_END)
    vias = np.flatnonzero(arc & usable[:-1] & usable[1:]
                          & np.isfinite(np.minimum(pieces[:-1], pieces[1:])))
    zone = _zones_at_corners(path, tolerance)
    straight = usable & np.isfinite(pieces) & (toolpath.move == Move.LINEAR)
    lines = _on_lines(program, toolpath, straight, spacing, pieces, zone, keep=keep)
    as_written = _circle_points_as_written(path, vias)
    arcs = [(int(via), half) for via, right in zip(vias, as_written, strict=True)
            if (half := _on_arc(program, toolpath, int(via), spacing, zone, keep=keep or not right))]
    parts = [lines, *(half for _, halves in arcs for half in halves)]
    points = _Points(*(np.concatenate([getattr(part, name) for part in parts]) for name in _Points.__annotations__))
    if not len(points.before):
        return None
    order = np.argsort(points.before, kind="stable")
    points = _Points(*(getattr(points, name)[order] for name in _Points.__annotations__))
    targets = np.arange(count) if whole else _around(points.before, count)
    slots = np.searchsorted(targets, points.before)

    def placed(own: NDArray[Any], further: NDArray[Any]) -> NDArray[Any]:
        return np.insert(own, slots, further)

    no, via = np.zeros(len(targets), dtype=bool), np.array([via for via, _ in arcs], dtype=np.intp)
    owner, further = placed(targets, points.before), placed(no, np.ones(len(slots), dtype=bool))
    kept = np.flatnonzero(~further)[np.searchsorted(targets, via[:, None] + [-1, 0, 1])]
    first = np.column_stack([kept[:, 0], kept[:, 1] - kept[:, 0]])
    divisible = placed(no, points.divisible)
    divisible[kept[:, 1]] = divisible[kept[:, 0] + 1]
    return Grid(_with_points(path, points, owner, further, kept[:, 1:].ravel()), owner, further, first,
                placed(no, points.may), divisible, placed(no, points.beside_zone), placed(no, points.crowded))


def _around(moves: Indices, count: int) -> Indices:
    """The targets, of `count`, that stand AROUND these moves or nearer."""
    near = np.zeros(count, dtype=bool)
    for beside in range(-AROUND, AROUND):
        near[np.clip(moves + beside, 0, count - 1)] = True
    return np.flatnonzero(near)


def _usable(path: RobotPath) -> Mask:
    """Which moves (N - 1,), from target i to i + 1, may get targets in between."""
    toolpath = path.toolpath
    alike = (toolpath.tool[1:] == toolpath.tool[:-1]) & (toolpath.workobject[1:] == toolpath.workobject[:-1])
    posed = np.asarray(~np.isnan(toolpath.position).any(axis=1))
    return np.asarray(alike & path.reached[1:] & path.reached[:-1] & (toolpath.block[1:] == "")
                      & (np.isnan(toolpath.external[1:]) == np.isnan(toolpath.external[:-1])).all(axis=1)
                      & (path.axes.problem[1:] == "") & posed[:-1] & posed[1:])


def _circle_points_as_written(path: RobotPath, vias: Indices) -> Mask:
    """Which circle points (n,) have external axes that stand where they are written; the controller does not use what is
    written there, so that one that says otherwise cannot become a target of its own."""
    with np.errstate(invalid="ignore"):
        return np.asarray(~(np.abs(path.toolpath.external[vias] - path.axes.values[vias]) > SAME_VALUE).any(axis=1))


def _zones_at_corners(path: RobotPath, tolerance: float) -> Array:
    """How far from each target (N,) [m] another one must stand, so that the corner there is driven as planned, but for the
    tolerance [m]: a zone takes at most half the way to its neighbours, and a smaller one cuts less off the corner."""
    miss, half_sine = corner_misses(path.toolpath, path.world_position)
    return np.asarray(4 * np.maximum(miss - tolerance, 0.0) / np.maximum(half_sine, 1e-9))


def _on_lines(
    program: RapidProgram, toolpath: Toolpath, wanted: Mask, spacing: Array, pieces: Array, zone: Array, *, keep: bool
) -> _Points:
    """The points on the wanted (N,) MoveL."""
    step = np.insert(np.linalg.norm(np.diff(toolpath.position, axis=0), axis=1), 0, 0.0)
    targets = np.flatnonzero(wanted & (step >= 2 * FULL * spacing))
    most = min(MOST_PIECES, max(MOST_POINTS // max(len(targets), 1), FEWEST_PIECES))
    count = np.minimum(step[targets] // (FULL * pieces[targets]), most).astype(np.intp)
    before = np.repeat(targets, count - 1)
    number = np.arange(len(before)) - np.repeat(np.cumsum(count - 1) - (count - 1), count - 1) + 1
    share = number / np.repeat(count, count - 1)
    start, end = toolpath.position[before - 1], toolpath.position[before]
    alone = np.zeros(len(step), dtype=bool)
    alone[targets] = [not keep and follows_directly(program, i) for i in targets.tolist()]
    near = (share * step[before] < zone[before - 1]) | ((1 - share) * step[before] < zone[before])
    room = np.minimum(share, 1 - share) * step[before] >= FULL * spacing[before]
    return _Points(before, share, start + share[:, None] * (end - start),
                   _turned(toolpath.quaternion[before - 1], toolpath.quaternion[before], share),
                   alone[before] & room & ~near, np.zeros(len(before), dtype=bool), alone[before] & room & near,
                   alone[before] & ~room)


def _on_arc(
    program: RapidProgram, toolpath: Toolpath, via: int, spacing: Array, zone: Array, *, keep: bool
) -> list[_Points]:
    """The points on both halves of an arc; none where it is straight."""
    start, middle, end = (toolpath.position[via + k][None] for k in (-1, 0, 1))
    straight, centre, axis = circle(start, middle, end)
    if straight[0]:
        return []
    to_middle, whole = (float(turned_angle(axis, start - centre, point - centre)[0]) for point in (middle, end))
    angles = (to_middle, whole - to_middle)
    radius = float(np.linalg.norm(middle - centre))
    closest = max(float(spacing[via:via + 2].min()), ARC_SPACING, zone[via - 1], zone[via + 1], radius * ARC_ANGLE)
    halvings = int(max(np.log2(min(angles) * radius / closest), 0.0))
    divisible = halvings > 0 and not keep and follows_directly(program, via)
    pieces = 2**halvings if divisible else max(2**halvings, LOOKED_AT)
    share = np.arange(1, pieces) / pieces
    count, points = len(share), []
    for half, first in ((0, 0.0), (1, to_middle)):
        angle = first + share * angles[half]
        points.append(_Points(
            np.full(count, via + half), share, _on_circle(start[0], centre[0], axis[0], angle),
            _turned(toolpath.quaternion[via - 1], toolpath.quaternion[via + 1], angle / sum(angles)),
            np.zeros(count, dtype=bool), np.full(count, divisible), np.zeros(count, dtype=bool), np.zeros(count, dtype=bool)))
    return points


def _with_points(path: RobotPath, points: _Points, owner: Indices, further: Mask, chords: Indices) -> Toolpath:
    """The toolpath of the targets `owner` (G,), of which the `further` (G,) become linear targets at these points; the moves to
    the points `chords` of it are linear too. External axes are in proportion to the way."""
    toolpath, at = path.toolpath, points.before
    like: dict[str, Any] = {name: getattr(toolpath, name)[owner] for name in (
        "line", "column", "confdata", "has_confdata", "tool", "workobject", "feed", "zone", "move", "position", "quaternion",
        "external", "joints", "block")}
    like["move"][further] = like["move"][chords] = Move.LINEAR
    like["position"][further], like["quaternion"][further], like["block"][further] = points.position, points.quaternion, ""
    like["joints"][further] = np.nan
    external, standing = like["external"], path.axes.values
    external[chords] = np.where(np.isnan(external[chords]), np.nan, standing[owner[chords]])
    between = standing[at - 1] + points.share[:, None] * (standing[at] - standing[at - 1])
    external[further] = np.where(np.isnan(external[further]), np.nan, np.round(between, VALUE_DECIMALS))
    like["external"], like["joints"] = nothing_or(external), nothing_or(like["joints"])
    # A unit is switched right behind the target before.
    own = np.flatnonzero(~further)
    behind = [int(np.searchsorted(owner[own], first)) for first, _, _ in toolpath.switched]
    switched = tuple((int(own[count - 1]) + 1 if count else 0, name, on)
                     for count, (_, name, on) in zip(behind, toolpath.switched, strict=True))
    together = None if toolpath.together is None else toolpath.together[owner]
    return replace(toolpath, switched=switched, together=together, given=toolpath.number[owner], **like)


def _turned(start: Array, end: Array, share: Array) -> Array:
    """Quaternions (n, 4) at shares (n,) of the way between two orientations, (4,) or (n, 4), at even rate about one axis."""
    first, last = quaternion_to_matrix(start), quaternion_to_matrix(end)
    turn = rotation_vector(last @ np.swapaxes(first, -1, -2))
    return matrix_to_quaternion(rotation_matrix(share[:, None] * turn) @ first)


def _on_circle(start: Array, centre: Array, axis: Array, angle: Array) -> Array:
    """Points (n, 3) that a start (3,) reaches by turning about a circle's axis."""
    radius = start - centre
    return np.asarray(centre + np.cos(angle)[:, None] * radius + np.sin(angle)[:, None] * np.cross(axis, radius))

"""Intermediate targets where the deviation varies along a long move, and arcs in parts where a corrected arc is none any more.

The program is looked at on a fine grid: every long MoveL, and every MoveC, in short pieces, with the forces of the log placed
on those pieces. Of a MoveL just so many intermediate targets are taken that the offsets along its chords stay within the
tolerance of what the grid asks for; of a MoveC, as many parts. Then the text is rewritten with those targets, planned, and all
else goes on as if the CAM system had written it so.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from compensator.correction.prediction import predict_path
from compensator.correction.settings import Settings
from compensator.forces.placement import ForceLog, TargetForces, place_forces
from compensator.path.arc_length import arc_length, circle
from compensator.path.robot_path import RobotPath, robot_path
from compensator.rapid import MoreMoves, Pose, RapidProgram, follows_directly, read_rapid, with_more_moves
from compensator.toolpath import Move, Toolpath
from identification.common.findings import Finding, counted, error
from identification.model.inverse import configuration
from identification.model.rotations import matrix_to_quaternion, quaternion_to_matrix, rotation_matrix, rotation_vector
from identification.model.stiffness import IdentifiedModel

Array = NDArray[np.float64]
Indices = NDArray[np.intp]
Mask = NDArray[np.bool_]

# Targets nearer than this, in space [m] or in time at the programmed feed [s], are more than a controller plans ahead.
NEAREST, SHORTEST = 1e-3, 0.05
MOST_PIECES, MOST_POINTS = 400, 1_000_000
# Pieces of half an arc; it may be cut into 1, 2 or 4 arcs, each with a circle point.
ARC_PIECES = 8
# The scatter of a short piece's mean force is not what the tolerance asks for: so many of its sigmas do not count.
SIGMAS = 3.0


@dataclass(frozen=True, eq=False)
class Dense:
    """A program with further targets, and their forces. kept (N,): where the targets of the planned program stand in it."""

    program: RapidProgram
    path: RobotPath
    forces: TargetForces
    kept: Indices
    findings: tuple[Finding, ...]


@dataclass(frozen=True, eq=False)
class Grid:
    """The program in pieces. toolpath: all of it, arcs among them as chords. kept (N,): the program's own targets in it. owner
    (G,): the target whose move a further point belongs to, -1 at the program's own."""

    toolpath: Toolpath
    kept: Indices
    owner: Indices


def densified(
    program: RapidProgram, path: RobotPath, log: ForceLog, forces: TargetForces, model: IdentifiedModel, settings: Settings
) -> Dense | None:
    """The program with the targets that the tolerance needs; None where it needs none.

    Raises CompstiffError (CS4332) where the written text does not read back as it was meant.
    """
    grid = _grid(program, path, forces, settings)
    if grid is None:
        return None
    fine = robot_path(grid.toolpath, path.cell)
    placed = _placed(log, path, fine, grid.kept, forces, settings)
    # Where the log has no sample it asks for nothing.
    known = (placed.forced | (placed.samples > 0)) & fine.reached & (grid.toolpath.block == "")
    points = np.flatnonzero(known)
    exact = replace(model, covariance=np.zeros_like(model.covariance))      # the covariance left is that of the mean force
    predicted = predict_path(fine, placed, exact, points)
    deviation, noise = np.zeros((len(grid.owner), 3)), np.zeros(len(grid.owner))
    deviation[points] = predicted.position
    noise[points] = SIGMAS * np.sqrt(np.trace(predicted.covariance, axis1=1, axis2=2))
    allowed = settings.correction.tolerance + noise
    length = arc_length(fine.world_position, grid.toolpath.move)
    further = grid.owner >= 0
    line = further & known & (path.toolpath.move[grid.owner] == Move.LINEAR)
    weight = np.zeros(len(further)) if log.key == "target" else placed.samples.astype(float)
    chosen = needed(deviation, allowed, length, weight, ~further, line) & further
    parts = _arc_parts(path, grid, fine, deviation, np.where(known, allowed, np.inf))
    if not chosen.any() and not parts:
        return None
    for via, count in parts.items():
        step = ARC_PIECES // (2 * count)
        first = grid.kept[via - 1]
        chosen[first:grid.kept[via + 1]:step] = True
    chosen &= further
    at = np.flatnonzero(chosen | ~further)
    means = _averaged(placed, at, np.maximum.accumulate(np.nan_to_num(length)), weight)
    return _rewritten(program, path, grid, fine, chosen, parts, means, settings)


def _placed(
    log: ForceLog, before: RobotPath, path: RobotPath, kept: Indices, forces: TargetForces, settings: Settings
) -> TargetForces:
    """The log on the grid. Where it names targets, the points between two with force get forces in between."""
    if log.key != "target":
        given, fine = (arc_length(each.world_position, each.toolpath.move) for each in (before, path))
        known = ~np.isnan(given)
        # The chords of an arc are shorter than it is.
        log = replace(log, place=log.place + np.interp(log.place, given[known], (fine[kept] - given)[known]))
        air = kept[np.minimum(np.array(settings.log.tare, dtype=np.intp).reshape(-1, 2), len(kept) - 1)]
        return place_forces(log, path, path.cell, tare=[(int(first), int(last)) for first, last in air])
    own = np.zeros(len(path.toolpath), dtype=bool)
    own[kept] = True
    number = np.interp(np.arange(len(own)), kept, np.arange(len(kept)))
    low = np.floor(number).astype(np.intp)
    high = np.minimum(low + 1, len(kept) - 1)
    share = (number - low)[:, None]

    def between(values: Array) -> Array:
        return (1 - share) * values[low] + share * values[high]

    samples = np.zeros(len(own), dtype=np.intp)
    samples[kept] = forces.samples
    forced = forces.forced[low] & (own | forces.forced[high])
    return replace(forces, wrench=np.where(forced[:, None], between(forces.wrench), 0.0), samples=samples,
                   standard_error=between(forces.standard_error), forced=forced)


def windows(place: Array, at: Indices) -> tuple[Indices, Indices]:
    """The stretch of points, first to before last, that each point `at` stands for: half the way to its nearer neighbour on
    either side, so that the mean over it is what is there even where the values rise. place (G,) [m] ascending."""
    here = place[at]
    gap = np.diff(here)
    half = 0.5 * np.minimum(np.append(gap, 0.0), np.insert(gap, 0, 0.0))
    first = np.minimum(np.searchsorted(place, here - half, side="left"), at)
    last = np.maximum(np.searchsorted(place, here + half, side="right"), at + 1)
    narrow = half == 0
    return np.where(narrow, at, first), np.where(narrow, at + 1, last)


def _window_means(values: Array, weight: Array, first: Indices, last: Indices, at: Indices) -> Array:
    """Weighted means (K, n) of values (G, n) over the windows; the point's own value where nothing has weight."""
    total = np.concatenate([np.zeros((1, values.shape[1])), np.cumsum(weight[:, None] * values, axis=0)])
    mass = np.concatenate([[0.0], np.cumsum(weight)])
    size = (mass[last] - mass[first])[:, None]
    return np.where(size > 0, (total[last] - total[first]) / np.where(size > 0, size, 1.0), values[at])


def needed(deviation: Array, allowed: Array, length: Array, weight: Array, own: Mask, may: Mask) -> Mask:
    """Which points (G,) a path needs so that straight lines between them follow the deviation to what is allowed.

    deviation (G, 3) [m] at path lengths (G,) [m], weight (G,) of each in means over `windows`; own (G,): there from the start;
    may (G,): can be added. Each round adds the worst point between two neighbours.
    """
    have = own.copy()
    place = np.maximum.accumulate(np.nan_to_num(length))
    while True:
        at = np.flatnonzero(have)
        value = _window_means(deviation, weight, *windows(place, at), at)
        line = np.column_stack([np.interp(place, place[at], value[:, axis]) for axis in range(3)])
        excess = np.where(may & ~have, np.linalg.norm(line - deviation, axis=1) - allowed, -np.inf)
        worst = np.maximum.reduceat(excess, at)
        if not (worst > 0).any():
            return have
        gap = np.cumsum(have) - 1
        have |= (excess > 0) & (excess == worst[gap])


def _averaged(placed: TargetForces, at: Indices, place: Array, weight: Array) -> TargetForces:
    """The forces of the points `at` out of those of the grid."""
    first, last = windows(place, at)
    samples = np.concatenate([[0], np.cumsum(placed.samples)])
    size = np.maximum((samples[last] - samples[first]).astype(float), 1.0)[:, None]
    error = np.nan_to_num(placed.standard_error) * np.maximum(placed.samples, 1)[:, None]
    squares = np.concatenate([np.zeros((1, 3)), np.cumsum(error**2, axis=0)])
    own_error = placed.standard_error[at]
    wide = (last - first > 1)[:, None] & (weight[at] > 0)[:, None]
    forced = placed.forced[at]
    return replace(
        placed, samples=samples[last] - samples[first], forced=forced,
        wrench=np.where(forced[:, None], _window_means(placed.wrench, weight, first, last, at), 0.0),
        standard_error=np.where(wide, np.sqrt(squares[last] - squares[first]) / size, own_error))


def _grid(program: RapidProgram, path: RobotPath, forces: TargetForces, settings: Settings) -> Grid | None:
    """The long moves and arcs of the program in pieces; None without any."""
    toolpath = path.toolpath
    count = len(toolpath)
    here = np.arange(1, count)
    alike = (toolpath.tool[1:] == toolpath.tool[:-1]) & (toolpath.workobject[1:] == toolpath.workobject[:-1])
    usable = (alike & path.reached[1:] & path.reached[:-1] & (toolpath.block[1:] == "")
              & np.isnan(toolpath.external[1:]).all(axis=1))
    usable &= ~np.isnan(toolpath.position[:-1]).any(axis=1) & ~np.isnan(toolpath.position[1:]).any(axis=1)
    step = np.linalg.norm(np.diff(toolpath.position, axis=0), axis=1)
    spacing = np.fmax(NEAREST, SHORTEST * toolpath.feed[1:])
    # Forces that a log places along the move may stand in its middle, those at targets do not.
    near = np.ones(count - 1, dtype=bool) if not forces.named else forces.forced[1:] & forces.forced[:-1]
    lines = here[usable & near & (toolpath.move[1:] == Move.LINEAR) & (step >= np.maximum(settings.correction.long_move,
                                                                                      2 * spacing))]
    lines = [int(i) for i in lines if follows_directly(program, int(i))]
    arcs = here[:-1][usable[:-1] & usable[1:] & (forces.forced[1:-1] | forces.forced[2:])
                     & (toolpath.move[1:-1] == Move.ARC_VIA)
                     & (toolpath.move[2:] == Move.ARC_END)]
    arcs = [int(i) for i in arcs if follows_directly(program, int(i))]
    before, position, quaternion = [], [], []
    most = min(MOST_PIECES, max(MOST_POINTS // max(len(lines), 1), 4))
    for i in lines:
        pieces = int(min(step[i - 1] // spacing[i - 1], most))
        share = np.arange(1, pieces) / pieces
        before.append(np.full(len(share), i))
        position.append(toolpath.position[i - 1] + share[:, None] * (toolpath.position[i] - toolpath.position[i - 1]))
        quaternion.append(_turned(toolpath.quaternion[i - 1], toolpath.quaternion[i], share))
    for i in arcs:
        straight, centre, axis, angle = _halves(toolpath, i)
        if straight or min(angle) * float(np.linalg.norm(toolpath.position[i] - centre)) < settings.correction.long_move:
            continue
        share = np.arange(1, ARC_PIECES) / ARC_PIECES
        for half, start in ((0, 0.0), (1, angle[0])):
            turned = start + share * angle[half]
            before.append(np.full(len(share), i + half))
            position.append(_on_circle(toolpath.position[i - 1], centre, axis, turned))
            quaternion.append(_turned(toolpath.quaternion[i - 1], toolpath.quaternion[i + 1], turned / sum(angle)))
    if not before:
        return None
    at = np.concatenate(before)
    order = np.argsort(at, kind="stable")
    at = at[order]
    chords = np.concatenate([[i, i + 1] for i in arcs]).astype(np.intp) if arcs else np.empty(0, dtype=np.intp)
    toolpath = _with_points(toolpath, at, np.concatenate(position)[order], np.concatenate(quaternion)[order], chords)
    return Grid(toolpath, np.arange(count) + np.searchsorted(at, np.arange(count), side="right"),
                np.insert(np.full(count, -1), at, at))


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


def _halves(toolpath: Toolpath, via: int) -> tuple[bool, Array, Array, tuple[float, float]]:
    """Whether an arc is a straight line, its centre and axis (3,), and the angles of its halves."""
    start, middle, end = (toolpath.position[via + k] for k in (-1, 0, 1))
    straight, centre, axis = circle(start[None], middle[None], end[None])
    turned = []
    for point in (middle, end):
        u, v = start - centre[0], point - centre[0]
        turned.append(float(np.mod(np.arctan2(axis[0] @ np.cross(u, v), u @ v), 2 * np.pi)))
    return bool(straight[0]), centre[0], axis[0], (turned[0], turned[1] - turned[0])


def _on_circle(start: Array, centre: Array, axis: Array, angle: Array) -> Array:
    """Points (n, 3) that a start (3,) reaches by turning about a circle's axis."""
    radius = start - centre
    return np.asarray(centre + np.cos(angle)[:, None] * radius + np.sin(angle)[:, None] * np.cross(axis, radius))


def _arc_parts(path: RobotPath, grid: Grid, fine: RobotPath, deviation: Array, allowed: Array) -> dict[int, int]:
    """Into how many arcs each half of a MoveC (by its circle point) must be cut, where the corrected arc alone is not
    enough."""
    toolpath = path.toolpath
    wanted = fine.base_from_tcp.position - deviation
    parts: dict[int, int] = {}
    for via in np.flatnonzero(toolpath.move == Move.ARC_VIA):
        if not (grid.owner == via).any():       # a short arc, or one that does not stand by itself
            continue
        first = grid.kept[via - 1]
        point, room = (values[first:first + 2 * ARC_PIECES + 1] for values in (wanted, allowed))
        if np.isinf(room).any():
            continue
        for count in (0, 1, 2, 4):
            step = 2 * ARC_PIECES if count == 0 else ARC_PIECES // count
            pieces = [slice(i, i + step + 1) for i in range(0, 2 * ARC_PIECES, step)]
            if all(_off_circle(point[piece]) <= room[piece].min() for piece in pieces):
                break
        if count:
            parts[int(via)] = count
    return parts


def _off_circle(points: Array) -> float:
    """Largest distance [m] of points (n, 3) from the circle through the first, the middle and the last of them."""
    start, middle, end = points[0], points[len(points) // 2], points[-1]
    straight, centre, axis = circle(start[None], middle[None], end[None])
    if straight[0]:
        along = (end - start) / max(float(np.linalg.norm(end - start)), 1e-12)
        off = (points - start) - ((points - start) @ along)[:, None] * along
        return float(np.linalg.norm(off, axis=1).max())
    radius = points - centre[0]
    height = radius @ axis[0]
    across = np.linalg.norm(radius - height[:, None] * axis[0], axis=1) - np.linalg.norm(start - centre[0])
    return float(np.hypot(across, height).max())


def _rewritten(
    program: RapidProgram, path: RobotPath, grid: Grid, fine: RobotPath, chosen: Mask, parts: dict[int, int],
    forces: TargetForces, settings: Settings,
) -> Dense:
    """The text with the chosen points, read and planned again."""
    toolpath = path.toolpath
    more, added = [], np.zeros(len(toolpath), dtype=np.intp)

    def poses(points: Indices) -> list[Pose]:
        quadrants = _confdata(path, grid, fine, points)
        numbers = np.concatenate([1e3 * grid.toolpath.position[points], grid.toolpath.quaternion[points]], axis=1)
        return [Pose(number, quadrant) for number, quadrant in zip(numbers.tolist(), quadrants.tolist(), strict=True)]

    for target in np.unique(grid.owner[chosen & (toolpath.move[grid.owner] == Move.LINEAR)]):
        points = np.flatnonzero(chosen & (grid.owner == target))
        more.append(MoreMoves(int(target), linear=poses(points)))
        added[target] = len(points)
    for via, count in parts.items():
        step = ARC_PIECES // (2 * count)
        halves = [np.arange(grid.kept[via - 1 + half] + step, grid.kept[via + half], step) for half in (0, 1)]
        more.append(MoreMoves(via, halves=(poses(halves[0]), poses(halves[1]))))
        added[via], added[via + 1] = len(halves[0]), len(halves[1])
    again = read_rapid(with_more_moves(program, more), toolpath.source)
    kept = np.arange(len(toolpath)) + np.cumsum(added)
    got = again.toolpath
    if len(got) != len(toolpath) + added.sum() or not all(
            np.array_equal(getattr(got, name)[kept], getattr(toolpath, name), equal_nan=True)
            for name in ("position", "quaternion", "joints")):
        raise error("CS4332", "the program with intermediate targets does not read back as it was meant; nothing was written",
                    file=toolpath.source, hint="a defect in compstiff: please report it; --keep-targets does without them")
    # What is said of a target is said of the move in the program as it was given.
    owner = np.searchsorted(kept, np.arange(len(got)))
    written = replace(got, line=toolpath.line[owner], column=toolpath.column[owner], findings=toolpath.findings, given=owner)
    dense = replace(again, toolpath=written)
    return Dense(dense, robot_path(written, path.cell), forces, kept, tuple(_said(toolpath, added, parts, settings)))


def _confdata(path: RobotPath, grid: Grid, fine: RobotPath, points: Indices) -> NDArray[np.int64]:
    """confdata (n, 4) of further points: what their move's target says, and the quadrants that differ from there."""
    owner = grid.owner[points]
    confdata = path.toolpath.confdata[owner].copy()
    robot = path.cell.robot
    confdata[:, :3] += configuration(robot, fine.theta[points])[:, :3] - configuration(robot, path.theta[owner])[:, :3]
    return confdata


def _said(toolpath: Toolpath, added: Indices, parts: dict[int, int], settings: Settings) -> list[Finding]:
    findings = []
    lines = np.flatnonzero((added > 0) & (toolpath.move == Move.LINEAR))
    where = f"the correction varies along them by more than {1e6 * settings.correction.tolerance:g} um (--tolerance)"
    if len(lines):
        findings.append(Finding("CS4330", "note", f"{counted(int(added[lines].sum()), 'intermediate target')} in "
                                f"{len(lines)} long MoveL: {where}", file=toolpath.source, line=int(toolpath.line[lines[0]]),
                                target=int(lines[0])))
    if parts:
        first = min(parts)
        arcs = sum(2 * count for count in parts.values())
        findings.append(Finding("CS4331", "note", f"{len(parts)} MoveC cut into {arcs} arcs: {where}", file=toolpath.source,
                                line=int(toolpath.line[first]), target=first))
    return findings

"""Intermediate targets where the deviation varies along a move, and arcs in parts where a corrected arc is none any more.

Moves along which the log shows more than their targets do, and long ones, are looked at on a fine grid, in pieces as short as
a controller takes them, with the forces of the log placed on those pieces. Of a MoveL just so many intermediate targets are
taken that the offsets along its chords stay within the tolerance of what the grid asks for; a MoveC is halved again and again.
Then the text is rewritten with those targets, planned, and all else goes on as if the CAM system had written it so.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from compensator.correction.corners import sharp_corners
from compensator.correction.correctable import targets_to_correct
from compensator.correction.fine_grid import Grid, fine_grid, spacing_of
from compensator.correction.force_changes import pieces_to_look_at, shortest_piece
from compensator.correction.grid_forces import among_others, averaged, forces_on, noise_of, place_of, weight_of
from compensator.correction.grid_path import asks_for_all, grid_path
from compensator.correction.loaded_path import LoadedPath
from compensator.correction.needed_targets import SIGMAS, Wanted, needed_points
from compensator.correction.predict import Predicted
from compensator.correction.prediction import predict_path
from compensator.forces.target_forces import TargetForces
from compensator.path.robot_path import RobotPath, robot_path
from compensator.rapid import MoreMoves, Pose, RapidProgram, read_rapid, with_more_moves
from compensator.toolpath import Move, Toolpath
from identification.common.findings import Finding, counted, error
from identification.model.inverse import configuration

Array = NDArray[np.float64]
Indices = NDArray[np.intp]
Mask = NDArray[np.bool_]
# Points are added until the grid's points keep so much of the tolerance: the rest is for what lies between those.
AIM = 0.8


@dataclass(frozen=True, eq=False)
class LookedAt:
    """The moves that were looked at between their targets. fine: the program with the points (G,) of the grid, its targets the
    points of known force. noise (G,) [m]: 1 sigma of the deviation there, from the scatter of the force; at (n,): the points
    that are targets of the program now; arcs (P, 2): its arcs among them, by their first point and the points to the circle
    point."""

    grid: Grid
    fine: Predicted
    noise: Array
    at: Indices
    arcs: Indices

    @property
    def number(self) -> Indices:
        """Which targets (n,) of the program now the points `at` are."""
        further = self.grid.further[self.at]
        return np.asarray(self.grid.owner[self.at] + np.cumsum(further) - further)


def with_intermediate_targets(planned: Predicted) -> tuple[Predicted, Indices, LookedAt | None]:
    """The program with the targets that the tolerance needs, where the given targets (N,) stand in it, and what was looked at;
    None: no move asked for it.

    Raises CompstiffError (CS4332) where the written text does not read back as it was meant.
    """
    settings, path = planned.settings.correction, planned.path
    as_given = np.arange(len(path.toolpath))
    if not len(planned.targets):
        return planned, as_given, None
    with np.errstate(over="ignore", invalid="ignore"):      # absurd numbers in targets without force
        least, shortest = settings.min_spacing, shortest_piece(planned)
        if shortest > least.time:
            planned = replace(planned, findings=(*planned.findings, _coarse(planned, shortest)))
        spacing = spacing_of(path.toolpath, least.length, max(least.time, shortest))
        pieces = pieces_to_look_at(planned, spacing, shortest)
        pieces = np.where(np.diff(path.length, prepend=np.nan) < settings.long_move, np.inf, pieces)
        grid = fine_grid(planned.program.text, path, spacing, pieces, settings.tolerance, keep=settings.keep_targets,
                         whole=asks_for_all(planned, pieces))
        if grid is None:
            return planned, as_given, None
        looked_at, placed, by_place = _needed(planned, grid, grid_path(path, grid), spacing)
        if len(looked_at.at) == len(grid.kept) and not by_place.any():
            return planned, as_given, looked_at
        text, added = _rewritten(planned.program.text, path, looked_at)
        with_more = robot_path(text.toolpath, path.cell)
    kept = as_given + np.cumsum(added)
    of_part = averaged(planned.forces, placed, grid, place_of(looked_at.fine.path), looked_at.at, by_place)
    forces = among_others(planned.forces, kept, of_part, looked_at.number)
    targets, _ = targets_to_correct(with_more, forces)
    loaded = LoadedPath(with_more, forces, planned.model, targets, planned.loaded.learned)
    air = np.zeros(len(text.toolpath), dtype=bool)
    air[kept] = planned.program.air
    findings = _findings(path.toolpath, added, looked_at, settings.tolerance)
    return replace(planned, program=replace(planned.program, text=text, air=air), loaded=loaded,
                   prediction=predict_path(loaded), findings=(*planned.findings, *findings)), kept, looked_at


def _needed(planned: Predicted, grid: Grid, path: RobotPath, spacing: Array) -> tuple[LookedAt, TargetForces, Mask]:
    """The points of the grid, and the arcs, that the deviation along the moves asks for; the forces on the grid; and which
    points (G,) are targets of the program that take the force of their very place. spacing (N,) [m]: the closest targets each
    move may have."""
    placed = forces_on(planned, path, grid, spacing[grid.owner])
    # Where the log has no sample it asks for nothing.
    known = (placed.forced | (placed.samples > 0)) & path.reached & (grid.toolpath.block == "")
    near = grid.further | np.append(grid.further[1:], False) | np.insert(grid.further[:-1], 0, False)
    points = np.flatnonzero(known & near)
    learned = planned.loaded.learned
    as_known = replace(placed, standard_error=noise_of(placed), unknown=None, follows=None, zero_std=0.0,
                       weight_std=None)
    loaded = LoadedPath(path, as_known, planned.model, points, learned)
    # What is left of the covariance is the mean force's.
    exact = replace(planned.model, covariance=np.zeros_like(planned.model.covariance), unknown_weight=0.0,
                    differs=0.0)
    prediction = predict_path(replace(loaded, model=exact, learned=learned.exactly() if learned else None))
    deviation, noise, own = (np.zeros((len(grid.toolpath), *shape)) for shape in ((3,), (), (3,)))
    place = np.full(len(planned.path.toolpath), -1)
    place[planned.targets] = np.arange(len(planned.targets))
    looked_for = place[grid.targets]
    own[grid.kept[looked_for >= 0]] = planned.prediction.position[looked_for[looked_for >= 0]]
    deviation[:] = own
    # In the air there is nothing to correct, whatever was learned of it.
    deviation[points] = np.where(placed.forced[points, None], prediction.position, 0.0)
    by_place = _by_place(grid, known, own, deviation, noise, planned.settings.correction.tolerance)
    own[by_place] = deviation[by_place]
    noise[points] = np.sqrt(np.trace(prediction.covariance, axis1=1, axis2=2))
    axes, corner = path.axes, np.zeros(len(grid.toolpath), dtype=bool)
    corner[grid.kept] = np.isin(grid.targets, planned.targets[sharp_corners(planned.path, planned.targets)])
    have, arcs = needed_points(grid, Wanted(
        axes.turned_to_rest(deviation), axes.turned_to_rest(own), AIM * planned.settings.correction.tolerance, noise,
        planned.slope, known, placed.forced, place_of(path), weight_of(placed), path.rest_from_tcp.position,
        spacing[grid.owner], corner))
    fine = replace(planned, loaded=replace(loaded, forces=placed), prediction=prediction)
    return LookedAt(grid, fine, noise, np.flatnonzero(have), arcs), placed, by_place


def _by_place(grid: Grid, known: Mask, own: Array, deviation: Array, noise: Array, tolerance: float) -> Mask:
    """The program's targets among the points (G,) which the mean over half of either move would leave farther off than they
    were uncorrected, by more than the tolerance [m] beyond the scatter: `own` (G, 3) [m] by that mean against the `deviation`
    (G, 3) [m] at the place itself. So it is where the cut begins or ends at a target."""
    off, before = np.linalg.norm(own - deviation, axis=1), np.linalg.norm(deviation, axis=1)
    return np.asarray(~grid.further & known & (off - before > tolerance + SIGMAS * noise))


def _rewritten(program: RapidProgram, path: RobotPath, looked_at: LookedAt) -> tuple[RapidProgram, Indices]:
    """The text with the needed points, read again, and how many each move (N,) got."""
    toolpath, grid = path.toolpath, looked_at.grid
    chosen = looked_at.at[grid.further[looked_at.at]]
    added = np.bincount(grid.owner[chosen], minlength=len(toolpath))
    more = []

    def poses(target: int) -> list[Pose]:
        points = chosen[slice(*np.searchsorted(grid.owner[chosen], [target, target + 1]))]
        quadrants = _confdata(path, grid, looked_at.fine.path, points)
        numbers = np.concatenate([1e3 * grid.toolpath.position[points], grid.toolpath.quaternion[points]], axis=1)
        external: list[list[float] | None] = [None] * len(points)
        if not np.isnan(grid.toolpath.external[points]).all():
            external = grid.toolpath.external[points].tolist()
        return [Pose(*numbered) for numbered in zip(numbers.tolist(), quadrants.tolist(), external, strict=True)]

    for target in np.flatnonzero(added).tolist():
        if toolpath.move[target] == Move.LINEAR:
            more.append(MoreMoves(target, linear=poses(target)))
        elif toolpath.move[target] == Move.ARC_VIA:
            more.append(MoreMoves(target, halves=(poses(target), poses(target + 1))))
    again = read_rapid(with_more_moves(program, more), toolpath.source)
    kept = np.arange(len(toolpath)) + np.cumsum(added)
    got = again.toolpath
    if len(got) != len(toolpath) + added.sum() or not all(
            np.array_equal(getattr(got, name)[kept], getattr(toolpath, name), equal_nan=True)
            for name in ("position", "quaternion", "joints", "external")):
        raise error("CS4332", "the program with intermediate targets does not read back as it was meant; nothing was written",
                    file=toolpath.source, hint="a defect in compstiff: please report it; --keep-targets does without them")
    # What is said of a target is said of the move in the program as it was given.
    owner = np.searchsorted(kept, np.arange(len(got)))
    written = replace(got, line=toolpath.line[owner], column=toolpath.column[owner], findings=toolpath.findings, given=owner)
    return replace(again, toolpath=written), added


def _confdata(path: RobotPath, grid: Grid, fine: RobotPath, points: Indices) -> NDArray[np.int32]:
    """confdata (n, 4) of further points: what their move's target says, and the quadrants that differ from there."""
    owner = grid.owner[points]
    confdata = path.toolpath.confdata[owner].copy()
    robot = path.cell.robot
    confdata[:, :3] += configuration(robot, fine.theta[points])[:, :3] - configuration(robot, path.theta[owner])[:, :3]
    return confdata


def _coarse(planned: Predicted, shortest: float) -> Finding:
    """CS3093: pieces shorter than this [s] show the spindle's lines in place of the force."""
    return Finding("CS3093", "note", f"between targets nothing is looked at that is shorter than {1e3 * shortest:.0f} ms: the "
                   "spindle's speed is ambiguous, and shorter means of the force are tooth passing",
                   file=planned.forces.log.source, hint="state the speed: --spindle-rpm, or force_log.spindle_rpm in cell.yaml")


def _findings(toolpath: Toolpath, added: Indices, looked_at: LookedAt, tolerance: float) -> list[Finding]:
    """CS4330, CS4331: what was added where."""
    findings = []
    lines = np.flatnonzero((added > 0) & (toolpath.move == Move.LINEAR))
    where = f"the correction varies along them by more than {1e6 * tolerance:g} um (--tolerance)"
    if len(lines):
        findings.append(Finding("CS4330", "note", f"{counted(int(added[lines].sum()), 'intermediate target')} in "
                                f"{len(lines)} MoveL: {where}", file=toolpath.source, line=int(toolpath.line[lines[0]]),
                                target=int(lines[0])))
    cut = np.flatnonzero((added > 0) & (toolpath.move == Move.ARC_VIA))
    if len(cut):
        arcs = len(cut) + int(added[cut].sum() + added[cut + 1].sum()) // 2
        findings.append(Finding("CS4331", "note", f"{len(cut)} MoveC cut into {arcs} arcs: {where}", file=toolpath.source,
                                line=int(toolpath.line[cut[0]]), target=int(cut[0])))
    return findings

"""Intermediate targets where the deviation varies along a long move, and arcs in parts where a corrected arc is none any more.

The program is looked at on a fine grid: every long MoveL, and every MoveC, in short pieces, with the forces of the log placed
on those pieces. Of a MoveL just so many intermediate targets are taken that the offsets along its chords stay within the
tolerance of what the grid asks for; of a MoveC, as many parts. Then the text is rewritten with those targets, planned, and all
else goes on as if the CAM system had written it so.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from compensator.correction.correctable import targets_to_correct
from compensator.correction.fine_grid import ARC_PIECES, Grid, fine_grid
from compensator.correction.loaded_path import LoadedPath
from compensator.correction.needed_targets import Mask, arc_parts, needed_points, window_means, windows
from compensator.correction.predict import Predicted
from compensator.correction.prediction import predict_path
from compensator.forces.placement import TargetForces, place_forces
from compensator.path.robot_path import RobotPath, robot_path
from compensator.rapid import MoreMoves, Pose, RapidProgram, read_rapid, with_more_moves
from compensator.toolpath import Move, Toolpath
from identification.common.findings import Finding, counted, error
from identification.model.inverse import configuration

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

# The scatter of a short piece's mean force is not what the tolerance asks for: so many of its sigmas do not count.
SIGMAS = 3.0


@dataclass(frozen=True, eq=False)
class _Needed:
    """What the tolerance asks for. chosen (G,): the grid's points to add; parts: into how many arcs each half of a MoveC, named
    by its circle point, is cut; forces (N + added): those of the program with the chosen points."""

    grid: Grid
    chosen: Mask
    parts: dict[int, int]
    forces: TargetForces


def with_intermediate_targets(planned: Predicted) -> tuple[Predicted, Indices]:
    """The program with the targets that the tolerance needs, and where the given targets (N,) stand in it.

    Raises CompstiffError (CS4332) where the written text does not read back as it was meant.
    """
    settings, path = planned.settings.correction, planned.path
    as_given = np.arange(len(path.toolpath))
    if settings.keep_targets or not len(planned.targets):
        return planned, as_given
    with np.errstate(over="ignore", invalid="ignore"):      # absurd numbers in targets without force
        grid = fine_grid(planned.program.text, path, planned.forces, settings.long_move)
        if grid is None:
            return planned, as_given
        fine = robot_path(grid.toolpath, path.cell)
        needed = _needed(planned, grid, fine)
        if needed is None:
            return planned, as_given
        text, added = _rewritten(planned.program.text, path, fine, needed)
        with_more = robot_path(text.toolpath, path.cell)
    kept = as_given + np.cumsum(added)
    targets, _ = targets_to_correct(with_more, needed.forces)
    loaded = LoadedPath(with_more, needed.forces, planned.model, targets)
    air = np.zeros(len(text.toolpath), dtype=bool)
    air[kept] = planned.program.air
    findings = _findings(path.toolpath, added, needed.parts, settings.tolerance)
    return replace(planned, program=replace(planned.program, text=text, air=air), loaded=loaded,
                   prediction=predict_path(loaded), findings=(*planned.findings, *findings)), kept


def _needed(planned: Predicted, grid: Grid, fine: RobotPath) -> _Needed | None:
    """The points of the grid, and the parts of arcs, that the deviation along the moves asks for; None: none."""
    placed = _placed(planned, fine, grid.kept)
    # Where the log has no sample it asks for nothing.
    known = (placed.forced | (placed.samples > 0)) & fine.reached & (grid.toolpath.block == "")
    deviation, noise = _deviation(planned, fine, placed, np.flatnonzero(known))
    allowed = planned.settings.correction.tolerance + noise
    move, further = planned.path.toolpath.move, grid.further
    line = further & known & (move[grid.owner] == Move.LINEAR)
    weight = np.zeros(len(further)) if planned.forces.named else placed.samples.astype(float)
    chosen = needed_points(deviation, allowed, fine.length, weight, ~further, line) & further
    parts = arc_parts(grid, np.flatnonzero(move == Move.ARC_VIA), fine.base_from_tcp.position - deviation,
                      np.where(known, allowed, np.inf))
    if not chosen.any() and not parts:
        return None
    for via, count in parts.items():
        step = ARC_PIECES // (2 * count)
        chosen[grid.kept[via - 1]:grid.kept[via + 1]:step] = True
    chosen &= further
    at = np.flatnonzero(chosen | ~further)
    return _Needed(grid, chosen, parts, _averaged(placed, at, np.maximum.accumulate(np.nan_to_num(fine.length)), weight))


def _deviation(planned: Predicted, fine: RobotPath, placed: TargetForces, points: Indices) -> tuple[Array, Array]:
    """The predicted deviation (G, 3) [m] at these points of the grid, and what the scatter of their mean force explains of it
    (G,) [m]; zero elsewhere."""
    exact = replace(planned.model, covariance=np.zeros_like(planned.model.covariance))   # what is left is the mean force's
    prediction = predict_path(LoadedPath(fine, placed, exact, points))
    deviation, noise = np.zeros((len(fine.toolpath), 3)), np.zeros(len(fine.toolpath))
    deviation[points] = prediction.position
    noise[points] = SIGMAS * np.sqrt(np.trace(prediction.covariance, axis1=1, axis2=2))
    return deviation, noise


def _placed(planned: Predicted, fine: RobotPath, kept: Indices) -> TargetForces:
    """The log on the grid, whose points `kept` (N,) are the program's own. Where it names targets, the points between two with
    force get forces in between."""
    forces, log = planned.forces, planned.forces.log
    if not forces.named:
        given = planned.path.length
        known = ~np.isnan(given)
        # The chords of an arc are shorter than it is.
        log = replace(log, place=log.place + np.interp(log.place, given[known], (fine.length[kept] - given)[known]))
        air = kept[np.minimum(np.array(planned.settings.log.tare, dtype=np.intp).reshape(-1, 2), len(kept) - 1)]
        return place_forces(log, fine, fine.cell, tare=[(int(first), int(last)) for first, last in air],
                            trust_tare=True)       # it was judged on the program itself
    own = np.zeros(len(fine.toolpath), dtype=bool)
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
        wrench=np.where(forced[:, None], window_means(placed.wrench, weight, first, last, at), 0.0),
        standard_error=np.where(wide, np.sqrt(squares[last] - squares[first]) / size, own_error))


def _rewritten(program: RapidProgram, path: RobotPath, fine: RobotPath, needed: _Needed) -> tuple[RapidProgram, Indices]:
    """The text with the needed points, read again, and how many each move (N,) got."""
    toolpath, grid, chosen = path.toolpath, needed.grid, needed.chosen
    more, added = [], np.zeros(len(toolpath), dtype=np.intp)

    def poses(points: Indices) -> list[Pose]:
        quadrants = _confdata(path, grid, fine, points)
        numbers = np.concatenate([1e3 * grid.toolpath.position[points], grid.toolpath.quaternion[points]], axis=1)
        return [Pose(number, quadrant) for number, quadrant in zip(numbers.tolist(), quadrants.tolist(), strict=True)]

    for target in np.unique(grid.owner[chosen & (toolpath.move[grid.owner] == Move.LINEAR)]):
        points = np.flatnonzero(chosen & (grid.owner == target))
        more.append(MoreMoves(int(target), linear=poses(points)))
        added[target] = len(points)
    for via, count in needed.parts.items():
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
    return replace(again, toolpath=written), added


def _confdata(path: RobotPath, grid: Grid, fine: RobotPath, points: Indices) -> NDArray[np.int64]:
    """confdata (n, 4) of further points: what their move's target says, and the quadrants that differ from there."""
    owner = grid.owner[points]
    confdata = path.toolpath.confdata[owner].copy()
    robot = path.cell.robot
    confdata[:, :3] += configuration(robot, fine.theta[points])[:, :3] - configuration(robot, path.theta[owner])[:, :3]
    return confdata


def _findings(toolpath: Toolpath, added: Indices, parts: dict[int, int], tolerance: float) -> list[Finding]:
    """CS4330, CS4331: what was added where."""
    findings = []
    lines = np.flatnonzero((added > 0) & (toolpath.move == Move.LINEAR))
    where = f"the correction varies along them by more than {1e6 * tolerance:g} um (--tolerance)"
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

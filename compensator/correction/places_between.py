"""Where a log is held against its cut: at the targets, and along moves that are long at places between them. The program of a
slot or of a facing cut has a target a pass, and its log thousands of samples."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from compensator.correction.fine_grid import Grid, fine_grid
from compensator.correction.grid_forces import forces_on
from compensator.correction.grid_path import grid_path
from compensator.correction.loaded_path import LoadedPath
from compensator.correction.pass_offsets import PassOffsets, offsets_of_pass
from compensator.correction.predict import Predicted
from compensator.correction.prediction import predict_path
from compensator.forces.program_time import moves_in_air
from compensator.forces.target_forces import TargetForces
from compensator.path.robot_path import RobotPath
from identification.common.arrays import Array

Indices = NDArray[np.intp]
# Moves are cut into pieces of this length [m] and longer, with so many samples in each: neighbours remember each other.
PIECE, SAMPLES = 2e-3, 8


def places_between(predicted: Predicted) -> tuple[RobotPath, TargetForces, Array]:
    """The program with places along its long moves, the forces of its log there, and where the tool stood off its plan while
    the log was taken (G, 3) [m], base frame. Raises what `offsets_of_pass` raises."""
    offsets, grid = _offsets(predicted), _grid(predicted)
    if grid is None:
        aside = offsets.over(predicted.path)
        aside[predicted.targets] += predicted.prediction.position
        return predicted.path, predicted.forces, aside
    fine = grid_path(predicted.path, replace(grid, toolpath=replace(grid.toolpath, driven=_driven(predicted, grid), ways=())))
    forces = forces_on(predicted, fine, grid, np.full(len(grid.owner), PIECE))
    points = np.flatnonzero(forces.forced & fine.reached)
    aside = offsets.over(fine, grid.kept)
    aside[points] += predict_path(LoadedPath(fine, forces, predicted.model, points, predicted.loaded.learned)).position
    return fine, forces, aside


def _offsets(predicted: Predicted) -> PassOffsets:
    """Those of the pass that was logged."""
    file = predicted.settings.correction.logged_with
    return (PassOffsets.at_targets(np.zeros((len(predicted.path.toolpath), 3))) if file is None else
            offsets_of_pass(file, predicted))


def _grid(predicted: Predicted) -> Grid | None:
    """The moves with force in pieces; None where none is long enough, or the log names targets and tells nothing between
    them."""
    path, log = predicted.path, predicted.forces.log
    if predicted.forces.named or path.toolpath.ways or path.axes.moves:
        return None
    forced = predicted.forces.forced
    step = np.nan_to_num(np.diff(path.length, prepend=np.nan))
    ends = np.maximum.accumulate(np.nan_to_num(path.length))
    on = log.place[np.isfinite(log.place) & (log.place >= 0) & (log.place <= ends[-1])]
    number = np.clip(np.searchsorted(ends, on, side="left"), 1, len(step) - 1)
    rows = np.bincount(number, minlength=len(step))
    pieces = np.maximum(PIECE, SAMPLES * step / np.maximum(rows, 1))
    cut = (forced | np.insert(forced[:-1], 0, False)) & ~moves_in_air(path.toolpath) & (rows >= 2 * SAMPLES)
    pieces[~cut] = np.inf
    return fine_grid(predicted.program.text, path, np.where(cut, pieces, PIECE), pieces,
                     predicted.settings.correction.tolerance, keep=True, whole=True)


def _driven(predicted: Predicted, grid: Grid) -> Indices | None:
    """The points in the order in which they are driven: those of a move stand before the target that it leads to, where the
    program drives there from the target before it in the text."""
    order = predicted.path.toolpath.driven
    if order is None:
        return None
    first = np.concatenate([[0], grid.kept[:-1] + 1])
    led = np.diff(order, prepend=-2) != 1
    runs = [np.arange(grid.kept[target] if alone else first[target], grid.kept[target] + 1)
            for target, alone in zip(order.tolist(), led.tolist(), strict=True)]
    return np.concatenate(runs)

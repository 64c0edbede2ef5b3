"""The forces that a program will meet, worked out from its stock: a force log that nobody took, with what is not known of
it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from compensator.cutting.chips import EDGE
from compensator.cutting.coefficients import Coefficients, check_same
from compensator.cutting.cut import Cut, cut_of
from compensator.cutting.stock_file import read_stock
from compensator.forces.log import ForceLog
from compensator.forces.predicted_forces import PredictedForces, StockCut
from compensator.path.robot_path import RobotPath
from identification.common.arrays import Array
from identification.common.findings import Finding
from identification.model.cell import Cell, ForceLogFrame
from identification.model.cell_file import ForceLogFile

# Rows of the log stand for no more of the path than this where there is a cut [m], so that every place between targets has
# some; and what they weigh in a mean is their length in such [m].
A_ROW, A_SAMPLE = 0.1e-3, 0.01e-3
# The tool is moved by so much [m] to see what that changes; more where the place of the stock is known worse.
STEP = 0.1e-3
# The feed a tooth may be outside of that of the log by this factor before it is said.
OUTSIDE = 1.3


def in_base(cell: Cell) -> Cell:
    """The cell as predicted forces want it: in the base frame, on the tool, without bias, payload or gain of a sensor."""
    return replace(cell, force_log=ForceLogFrame("base", None, 1.0, weight="removed", form=ForceLogFile(
        gain_std=0.0, spindle_rpm=cell.force_log.form.spindle_rpm)))


def predicted_log(path: RobotPath, coefficients: Coefficients, stock: str | Path, rpm: float | None) -> tuple[ForceLog, Cut]:
    """Of a program whose tool stands on its plan, which is where a corrected one stands. Rows are steps along the path, forces
    in the base frame; covariance of each: the coefficients', the model's error, what edges that were logged have worn since
    (cutting.wear_std), and where the stock stands; follows: what it changes by where the tool stands off its plan.

    Raises CompstiffError: CS4721 another cutter or material, and what `cut_of` raises.
    """
    blank = read_stock(stock)
    step = max(STEP, blank.position_std)
    cut = cut_of(path, blank, rpm, step=step)
    check_same(coefficients, cut.cutter, path.cell.cutting.material, str(path.cell.source))
    force = cut.per_step @ coefficients.mean
    follows = cut.change(coefficients.mean) / step
    covariance = _not_known(cut.per_step, coefficients, _worn(path.cell, coefficients), blank.position_std * follows)
    follows = follows @ cut.path.base_from_object.rotation[cut.track.target].swapaxes(1, 2)
    # A target with a step of unknown force has none, and stays as it is.
    lost = cut.unknown[cut.track.target]
    force[lost], covariance[lost], follows[lost] = 0.0, 0.0, 0.0
    pieces = np.where(cut.engagement.cuts, np.maximum(np.ceil(cut.track.length / A_ROW), 1), 1).astype(np.intp)
    own = np.repeat(np.arange(len(force)), pieces)
    number = np.arange(len(own)) - np.repeat(np.cumsum(pieces) - pieces, pieces)
    share = (number + 0.5) / pieces[own] - 0.5
    place = cut.track.place[own] + share * cut.track.length[own]
    rows = len(own)
    nothing = np.broadcast_to(0.0, (rows, 3))
    force = force[own]
    findings = (*cut.findings(), *_outside(cut, coefficients))
    return ForceLog(
        str(coefficients.source), force, nothing, False, "path_mm", place, np.arange(1, rows + 1),
        np.maximum(np.round(cut.track.length[own] / pieces[own] / A_SAMPLE), 1.0), None, None, None, force,
        np.zeros(rows, dtype=bool), findings,
        predicted=PredictedForces(own, covariance, follows, _stated(cut, coefficients, step))), cut


def _not_known(per_step: Array, coefficients: Coefficients, worn: float, aside: Array) -> Array:
    """Covariance (S, 3, 3) [N^2] of the forces of steps, per_step (S, 3, 6) K: by the coefficients', the model's error, what
    the edges need more by 1 sigma of wear, a share, and the stock where it stands by 1 sigma aside (S, 3, 3) [N]."""
    edges = worn * per_step[:, :, EDGE] @ coefficients.mean[EDGE]
    size = np.linalg.norm(per_step @ coefficients.mean, axis=1)
    return np.asarray(np.einsum("sij,jk,slk->sil", per_step, coefficients.covariance, per_step)
                      + (coefficients.model_error * size)[:, None, None] ** 2 * np.eye(3) / 3
                      + edges[:, :, None] * edges[:, None, :] + aside @ aside.swapaxes(1, 2))


def _worn(cell: Cell, coefficients: Coefficients) -> float:
    """1 sigma of what the edges need more, or less, than when they were logged, a share; what the table says has it in its
    width."""
    return 0.0 if coefficients.chip is None else cell.cutting.wear_std


def _stated(cut: Cut, coefficients: Coefficients, step: float) -> StockCut | None:
    """The cut as it is stated; None where there is none."""
    figures = cut.figures()
    if not figures["cutting_targets"]:
        return None
    material = (cut.path.cell.cutting.material or coefficients.material or "a material that is not stated").replace("_", " ")
    return StockCut(f"{cut.cutter.words()}, in {material}, on average {figures['depth_mm']:.2f} mm deep along the axis and "
                    f"{figures['width_mm']:.2f} mm wide across the feed", cut.mean(cut.engagement.width), 2 * cut.cutter.radius,
                    cut.per_target[:, :, EDGE] @ coefficients.mean[EDGE], cut.by_top(coefficients.mean, step))


def _outside(cut: Cut, coefficients: Coefficients) -> list[Finding]:
    """A warning (CS4722) where the feed a tooth is not that of the log."""
    chip = cut.track.chip[cut.engagement.cuts & ~cut.engagement.unknown]
    if coefficients.chip is None or not len(chip):
        return []
    low, high = float(chip.min()), float(chip.max())
    if low * OUTSIDE >= coefficients.chip[0] and high <= OUTSIDE * coefficients.chip[1]:
        return []
    return [Finding("CS4722", "warning", f"the feed a tooth is {1e3 * low:.3g} to {1e3 * high:.3g} mm, that of the log which "
                    f"told the coefficients {1e3 * coefficients.chip[0]:.3g} to {1e3 * coefficients.chip[1]:.3g} mm",
                    file=str(coefficients.source), hint="the force is taken as straight in the chip's thickness; thinner chips "
                    "need more than that")]

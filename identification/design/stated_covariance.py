"""What a plan will tell, as `identify` will state it: less what the arm's own weight takes where the robot file does not state
it, and no better than the scale of the load cell.

`identify` integrates it out (fit/sag.py), so a forecast of what it will state has to: with the columns S of the weight, each of
1 sigma, and D of ln c, the rows' information on ln c shrinks by `D^T W S (S^T W S + 1)^-1 S^T W D`. The criterion and its
certificate are about the springs alone.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from identification.design.domain import Pool
from identification.design.sheet import as_measurements, sheet_of
from identification.design.task import Task
from identification.fit.fitted_model import response
from identification.fit.load_test import LoadTest
from identification.fit.noise import noise_model
from identification.fit.noise_parts import VarianceComponents
from identification.fit.sag import BesideWeight, sag_columns

Array = NDArray[np.float64]


def stated_covariance(task: Task, runs: Pool) -> Array:
    """Covariance (6, 6) of ln c after the runs as `identify` will state it."""
    information = task.information(runs) - _taken(task, runs)
    covariance = np.linalg.inv(information)
    # As far as the rows tell a compliance, it is off with their scale (fit/force_gain.py).
    moved = task.domain.rig.cell.noise.force_gain * covariance @ (information - task.prior).sum(axis=1)
    return np.asarray(covariance + np.outer(moved, moved))


def largest_log_std(task: Task, runs: Pool) -> float:
    """Largest std of the ln k that the loads can show, as `identify` will state it."""
    seen = ~np.isin(np.arange(1, 7), task.criterion.left_out)
    return float(np.sqrt(np.diag(stated_covariance(task, runs))[seen].max()))


def _taken(task: Task, runs: Pool) -> Array:
    """Information (6, 6) on ln c that the weight takes from the runs' rows; of rows measured before it has been taken."""
    rig = task.domain.rig
    if rig.cell.robot.link_mass is not None:
        return np.zeros((6, 6))
    none_kept = np.zeros(len(runs), dtype=bool)
    rows = as_measurements(sheet_of(runs, task.domain.slots, np.arange(len(runs)), task.replicates, none_kept, "P"))
    data = LoadTest.of(rig.cell, replace(rows, deflection=np.zeros_like(rows.deflection)))
    noise = noise_model(data, rig.compliance)
    design = noise.whitened(response(data, np.log(rig.compliance))[1])
    weight = sag_columns(data.load_state(rig.compliance), noise)
    weights = noise.weights(VarianceComponents())
    return np.asarray(weights.inner(design, design) - BesideWeight(weights, weight).inner(design, design))

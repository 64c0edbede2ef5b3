"""Friction in a gear begins a pose as the way there left it: no noise of the sensor, and no other friction."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from identification.fit.fitted_model import Term
from identification.fit.load_test import LoadTest
from identification.fit.posterior import posterior
from identification.measurements import read_measurements
from identification.model.cell import read_cell
from identification.model.law_of import known
from tests.runs.mistakes.planted import right

JOINT, AMPLITUDE, SLIP = 3, -8e-5, 90.0


def test_a_begin_that_nobody_knows_is_no_noise(tmp_path: Path) -> None:
    """A gear that lags behind by up to 80 urad, at each pose from another begin, in a table that was right without it: its size
    comes out, and the noise is as stated. Where no begin was allowed for, the sensor's had grown eightfold, with a memory."""
    cell_file, table = right(41, "irb6640-235-2.55").write(tmp_path)
    cell = read_cell(cell_file)
    data = LoadTest.of(cell, read_measurements(table, cell.robot))
    state = data.load_state(1 / cell.prior.stiffness)
    torque, rng = state.torque[:, JOINT - 1], np.random.default_rng(6)
    held = np.empty(len(torque))
    for visit in np.unique(state.visit):
        mine = np.flatnonzero(state.visit == visit)
        place = begin = rng.uniform(-SLIP, SLIP)
        for n in mine:
            place = min(max(place, torque[n] - SLIP), torque[n] + SLIP)
            held[n] = (torque[n] - place + begin) / SLIP
    moved = AMPLITUDE * held[:, None] * state.jacobian[:, :3, JOINT - 1]
    data = data.with_rows(replace(data.rows, deflection=data.rows.deflection + moved))
    effect = known("hysteresis")
    assert effect is not None
    term = Term(effect, JOINT, np.array([-4e-5, 80.0]), effect.typical(state, JOINT), effect.neutral(state))
    fitted = posterior(data, [term])
    (values,), std = fitted.term_values, np.sqrt(np.diag(fitted.covariance)[6:])
    assert np.all(np.abs(values - [AMPLITUDE, SLIP]) < 3 * std)
    assert std[0] < 0.1 * abs(AMPLITUDE)
    assert fitted.components.sensor < 1.5
    assert fitted.components.memory == 0

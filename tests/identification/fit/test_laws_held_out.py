"""Poses that were not fitted: predicted by one linear step as by a fit that never saw them."""

from __future__ import annotations

import numpy as np
import pytest

from identification.fit.held_out import left_out, pose_names, poses
from identification.fit.load_test import LoadTest
from identification.fit.posterior import Posterior, posterior
from identification.model.compliance import equilibrium
from tests.identification.fit.test_laws_posterior import NOISY, simulate

NARROW = NOISY + "prior: {relative_std: [0.2, 0.2, 0.2, 0.2, 0.2, 0.2]}\n"


@pytest.mark.parametrize("text", [NOISY, NARROW], ids=["wide", "narrow"])
def test_a_pose_left_out_is_predicted_as_by_a_fit_without_it(tmp_path, text: str) -> None:
    """Few poses, so that each pulls at the springs: the residual of the fit itself is far from that of a fit without it. The
    true springs are not the prior's, so that a narrow prior pulls at the fit."""
    cell, rows = simulate(tmp_path, np.random.default_rng(81), poses=4, loads=3, text=text)
    whole = LoadTest.of(cell, rows)
    model = posterior(whole)
    groups = poses(rows)
    assert len(pose_names(rows)) == groups.max() + 1 == 4
    held = left_out(model, groups)
    for number in range(4):
        out = groups == number
        rest = posterior(whole.with_rows(rows.select(~out)))
        refitted = rows.deflection[out] - predicted(whole, rest)[out]
        inside = rows.deflection[out] - predicted(whole, model)[out]
        moved = np.sqrt(np.mean((refitted - inside) ** 2))
        assert np.sqrt(np.mean((held[out] - refitted) ** 2)) < 0.3 * moved, number


def predicted(data: LoadTest, model: Posterior) -> np.ndarray:
    """Readings (n, 3) [m] of the plain springs of a fit, by the finite equilibrium."""
    cell, rows = data.cell, data.rows
    return np.asarray(equilibrium(cell.robot, rows.theta, cell.flange_from_tcp, rows.wrench, np.exp(model.map[:6])).position)

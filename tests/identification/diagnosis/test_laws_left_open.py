"""What a named cause leaves open that no row shows is in the springs' intervals."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from identification.diagnosis.replicates import FittedNoise
from identification.fit.discrepancy import discrepancies, other_ways
from identification.fit.fitted_model import Term, with_terms
from identification.fit.load_test import LoadTest
from identification.fit.noise import VarianceComponents, residual_std, sensor_sigma
from identification.fit.posterior import posterior
from identification.measurements import read_measurements
from identification.model.cell import read_cell
from identification.model.effects import effects
from tests.desk_world import desk


def load_test(folder: Path) -> LoadTest:
    cell_file, table = desk(1000, None).write(folder)
    cell = read_cell(cell_file)
    return LoadTest.of(cell, read_measurements(table, cell.robot))


@pytest.mark.parametrize("axis", range(3))
def test_one_axis_that_is_off_leaves_the_mean_of_all_three_open(tmp_path: Path, axis: int) -> None:
    """Of an axis that is off by 12 % the mean is off by 4 %: about one standard deviation, whichever axis it is."""
    data, effect = load_test(tmp_path), effects()["force_axis_gain"]
    gain = 0.12 * (np.eye(3)[axis] - 1 / 3)
    rows = data.load_state(1 / data.cell.prior.stiffness)
    named = Term(effect, None, gain[:2], effect.typical(rows, None), effect.neutral(rows))
    (common,) = discrepancies(rows, (named,))
    assert common.effect.name == "force_gain"
    (std,) = with_terms(data.prior, (common,)).term_std
    assert 0.8 * 0.04 < std < 1.6 * 0.04
    alone, beside = posterior(data, (named,)), posterior(data, (named, common))
    known, left_open = (np.sqrt(np.diag(fit.laplace))[:6] for fit in (alone, beside))
    assert known.min() < 0.01
    np.testing.assert_allclose(left_open, np.hypot(known, std), rtol=0.15)


def test_a_structure_may_stiffen_by_a_good_quarter_of_what_it_gives(tmp_path: Path) -> None:
    """docs/effects.md: by 28 %, 1 sigma of all ways together."""
    data, effect = load_test(tmp_path), effects()["base_rocking"]
    rows = data.load_state(1 / data.cell.prior.stiffness)
    typical = effect.typical(rows, None)
    term = Term(effect, None, typical, typical, effect.neutral(rows))
    sight: Any = SimpleNamespace(whitened=lambda moved: moved)
    given = np.linalg.norm(effect.contribution(rows, None, typical)[:, :3], axis=1)
    ways = np.sqrt(np.sum(other_ways(rows, sight, (term,)) ** 2, axis=(1, 2)))
    assert np.median(ways[given > 0] / given[given > 0]) == pytest.approx(0.28, rel=0.05)
    assert effect.stiffens


def test_noise_of_a_fit_is_drawn_about_what_was_fitted() -> None:
    """However little the rows tell of a part: to between a twelfth and four and a half times of it."""
    sizes: list[np.ndarray] = []
    model: Any = SimpleNamespace(draw=lambda values, weight, rng: sizes.append(values))
    fitted = VarianceComponents(sensor=2.0, setup=0.5, memory=1.0)
    FittedNoise(model, fitted, 25.0 * np.eye(6), np.ones(3)).draw(np.random.default_rng(1), 500)
    share = sizes[0] / np.exp(fitted.logs)
    np.testing.assert_allclose([share.min(), share.max()], [0.082, 4.48], rtol=2e-3)


def test_what_a_visit_may_do_beside_is_in_its_readings_sigmas(tmp_path: Path) -> None:
    """Variances add: of 3 sigma of the sensor along x and 4 along y, in quadrature with all else."""
    data = load_test(tmp_path)
    compliance, components = 1 / data.cell.prior.stiffness, VarianceComponents()
    further = np.zeros((len(data.rows), 3, 2))
    further[:, 0, 0], further[:, 1, 1] = 3.0, 4.0
    alone = residual_std(data, components, compliance)
    beside = residual_std(data, components, compliance, further)
    np.testing.assert_allclose(beside, np.hypot(alone, sensor_sigma(data) * [3.0, 4.0, 0.0]), rtol=1e-12)

"""The covariance and the intervals of a model that stands for several: those of drawing a candidate by its probability, and its
parameters from its own posterior."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from identification.diagnosis.judgement import Rival
from identification.diagnosis.left_open import RobotPart, left_open
from identification.fit.fitted_model import Term
from identification.fit.load_test import LoadTest
from identification.fit.posterior import Posterior, posterior
from identification.measurements import read_measurements
from identification.model.cell import read_cell
from identification.model.effects import effects
from tests.virtual_cell.cell import simulate


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> LoadTest:
    cell_path, rows_path = simulate(94100, "ladder12").write(tmp_path_factory.mktemp("left_open"))
    cell = read_cell(cell_path)
    return LoadTest.of(cell, read_measurements(rows_path, cell.robot))


@pytest.fixture(scope="module")
def carried(data: LoadTest) -> Posterior:
    return posterior(data)


@pytest.fixture(scope="module")
def softer(data: LoadTest) -> Posterior:
    """The same readings, one and a half per cent larger: every spring is softer by as much."""
    return posterior(data.with_rows(replace(data.rows, deflection=1.015 * data.rows.deflection)))


def drawn(model: Posterior, count: int, rng: np.random.Generator) -> np.ndarray:
    return rng.multivariate_normal(model.mean[:6], model.covariance[:6, :6], count)


def test_it_is_that_of_drawing_a_candidate_by_its_probability(carried: Posterior, softer: Posterior) -> None:
    """Springs against springs: what one predicts the other's parameters can say."""
    rng, share = np.random.default_rng(94101), 0.3
    covariance, interval = left_open(RobotPart.of(carried), [Rival(softer, share)])
    x = np.concatenate([drawn(carried, 70_000, rng), drawn(softer, 30_000, rng)])
    off = x - carried.mean[:6]
    expected = off.T @ off / len(off)
    sigma = np.sqrt(np.diag(expected))
    np.testing.assert_allclose(covariance / np.outer(sigma, sigma), expected / np.outer(sigma, sigma), atol=0.04)
    assert np.abs((interval - np.quantile(x, [0.025, 0.975], axis=0).T) / sigma[:, None]).max() < 0.1
    assert np.linalg.eigvalsh(covariance).min() > 0


def test_of_a_model_its_springs_and_its_effects_of_the_robot_are_the_robot_s() -> None:
    """Each effect has as many parameters as its start; those of the measurement lie between them."""
    terms = tuple(SimpleNamespace(effect=SimpleNamespace(of_robot=of_robot), start=np.zeros(size))
                  for of_robot, size in ((False, 2), (True, 1), (False, 3), (True, 2)))
    model: Any = SimpleNamespace(terms=terms, likeliest=100.0 + np.arange(14), mean=np.arange(14.0))
    part = RobotPart.of(model)
    assert part.kept.tolist() == [0, 1, 2, 3, 4, 5, 8, 12, 13]
    assert part.terms == (terms[1], terms[3])
    assert part.centre.tolist() == [100.0 + place for place in part.kept]
    bare: Any = SimpleNamespace(terms=terms[:1], likeliest=100.0 + np.arange(8), mean=np.arange(8.0))
    assert RobotPart.of(bare).centre.tolist() == list(range(6))


def test_without_rivals_it_is_its_own(carried: Posterior) -> None:
    covariance, interval = left_open(RobotPart.of(carried), ())
    np.testing.assert_array_equal(covariance, carried.covariance)
    np.testing.assert_array_equal(interval, carried.draws.interval(0.95))


def test_candidates_that_predict_the_same_leave_nothing_open_however_their_springs_differ(
    data: LoadTest, carried: Posterior,
) -> None:
    """The tilt of wrist bearing 5 is that of 4 with another spring of joint 4 (docs/effects.md)."""
    tilts = {}
    for joint, compliance in ((4, 2e-7), (5, 2e-7)):
        effect = effects()["bearing_tilt"]
        neutral = effect.neutral(carried.load_state)
        term = Term(effect, joint, neutral, effect.typical(carried.load_state, joint), neutral + compliance)
        tilts[joint] = posterior(data, (term,), carried)
    one, other = tilts[4], tilts[5]
    apart = abs(one.mean[3] - other.mean[3])
    covariance, interval = left_open(RobotPart.of(one), [Rival(other, 0.5)])
    rows = data.with_rows(data.rows.select(np.any(data.rows.wrench != 0, axis=1)))
    at_one, slopes = RobotPart.of(one).seen(rows)
    at_other, _ = RobotPart.of(other).seen(rows)
    spread = np.sqrt(np.einsum("np,pq,nq->n", slopes, covariance, slopes).mean())
    own = np.sqrt(np.einsum("np,pq,nq->n", slopes, one.covariance, slopes).mean())
    assert np.sqrt(np.mean((at_one - at_other) ** 2)) < 2 * own
    assert spread < 3 * own
    # The stiffness of joint 4 is another for each, and its interval holds both.
    assert apart > 3 * np.sqrt(one.covariance[3, 3])
    assert interval[3, 0] < one.mean[3] < interval[3, 1]
    assert interval[3, 0] < other.mean[3] < interval[3, 1]

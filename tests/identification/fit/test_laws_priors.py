"""The prior in x = (ln c, effects' parameters): densities of scipy.stats, and its derivatives against differences."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import norm

from identification.fit.priors import PriorKind, PriorModel
from tests.support import robot

MEAN, STD = np.array([0.3, -2.0]), np.array([0.1, 4.0])


def model(kind: PriorKind, gamma: float = 1.0) -> PriorModel:
    return PriorModel(robot().prior, kind, gamma, MEAN, STD, np.full(2, -np.inf), np.full(2, np.inf))


def places(count: int) -> np.ndarray:
    """x around the prior, softer and stiffer."""
    rng = np.random.default_rng(3)
    centre = np.concatenate([-np.log(robot().prior.stiffness), MEAN])
    return np.asarray(centre + rng.normal(0, 0.4, (count, 8)) * np.concatenate([np.ones(6), STD]))


@pytest.mark.parametrize(("kind", "gamma"), [("lognormal", 1.0), ("gaussian", 1.0), ("gaussian", 0.25)])
def test_differences_of_its_value_are_those_of_the_densities(kind: PriorKind, gamma: float) -> None:
    """ln k about the median's, or k about the mean with gamma as the power of its density."""
    prior, (one, other) = robot().prior, places(2)

    def minus_ln(x: np.ndarray) -> float:
        effects = -norm.logpdf(x[6:], MEAN, STD).sum()
        if kind == "lognormal":
            return float(effects - norm.logpdf(-x[:6], np.log(prior.stiffness), prior.log_std).sum())
        k, sigma = np.exp(-x[:6]), prior.relative_std * prior.stiffness
        return float(effects - gamma * norm.logpdf(k, prior.stiffness, sigma).sum())

    found = model(kind, gamma)
    assert found.value(one) - found.value(other) == pytest.approx(minus_ln(one) - minus_ln(other), rel=1e-9)


@pytest.mark.parametrize(("kind", "gamma"), [("lognormal", 1.0), ("gaussian", 0.25)])
def test_gradient_and_curvature_are_its_derivatives(kind: PriorKind, gamma: float) -> None:
    found, step = model(kind, gamma), 1e-5 * np.eye(8)
    for x in places(5):
        slope = [(found.value(x + d) - found.value(x - d)) / 2e-5 for d in step]
        np.testing.assert_allclose(found.gradient(x), slope, rtol=1e-6, atol=1e-6)
        bend = np.array([(found.gradient(x + d) - found.gradient(x - d)) / 2e-5 for d in step])
        gauss_newton = np.diag(found.precision(x))
        expected = np.maximum(np.diag(bend), 0.2 * gauss_newton) if kind == "gaussian" else gauss_newton
        np.testing.assert_allclose(np.diag(found.search_curvature(x))[:6], expected[:6], rtol=1e-5)
        for curvature in (found.precision(x), found.search_curvature(x)):
            np.testing.assert_allclose(np.diag(curvature)[6:], [100.0, 1 / 16])
            assert np.count_nonzero(curvature - np.diag(np.diag(curvature))) == 0
        assert np.count_nonzero(bend - np.diag(np.diag(bend))) == 0


def test_at_a_bound_only_what_would_leave_is_pressed() -> None:
    low, high = np.array([0.0, -5.0]), np.array([1.0, 5.0])
    found = PriorModel(robot().prior, term_mean=MEAN, term_std=STD, term_low=low, term_high=high)
    x = np.concatenate([np.zeros(6), [0.0, 5.0]])
    assert found.pressed(x, np.full(8, -1.0)).tolist() == [False] * 6 + [True, False]
    assert found.pressed(x, np.full(8, 1.0)).tolist() == [False] * 6 + [False, True]
    assert found.inside(np.full(8, 7.0)).tolist() == [7.0] * 6 + [1.0, 5.0]
    assert found.inside(np.array([[7.0] * 8, [-7.0] * 8])).tolist() == [[7.0] * 6 + [1.0, 5.0], [-7.0] * 6 + [0.0, -5.0]]


@pytest.mark.parametrize(("kind", "gamma", "times"), [("lognormal", 1.0, 0.0), ("gaussian", 1.0, 1.0), ("gaussian", 0.25, 2.0)])
def test_what_is_known_of_ln_k_beforehand(kind: PriorKind, gamma: float, times: float) -> None:
    """Of a log-normal k the root of ln(1 + s^2), to first order s where k is normal, wider by the root of gamma; without
    effects there are six parameters, the curvature of each at the median the inverse square of that."""
    prior = robot().prior
    found = PriorModel(prior, kind, gamma)
    wanted = times * prior.relative_std if times else np.sqrt(np.log(1 + prior.relative_std**2))
    np.testing.assert_allclose(found.log_std, wanted)
    x = -np.log(prior.stiffness)
    np.testing.assert_allclose(found.precision(x), np.diag(wanted**-2.0))
    assert found.gradient(x) == pytest.approx(np.zeros(6), abs=1e-9)
    assert found.value(x) == pytest.approx(0.0, abs=1e-12)

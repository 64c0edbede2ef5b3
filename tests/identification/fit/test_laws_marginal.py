"""The weighted draws of the posterior: their numbers by counting, their mean and width against a posterior in one dimension
that is integrated here, and which of the components each draw has."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.stats import chi2, norm

from identification.fit.linearised import Linearised
from identification.fit.marginal import DRAWS, Draws, posterior_draws, weighted_quantile
from identification.fit.noise_parts import SetUp, VarianceComponents
from identification.fit.priors import PriorKind, PriorModel
from identification.fit.variance_components import Trials
from identification.model.robot import Prior
from tests.identification.fit.test_laws_optional_parts import COUNT, noise

MEDIAN = np.exp(np.linspace(11.0, 13.0, 6))


def test_a_weighted_quantile_is_that_of_as_many_equal_values() -> None:
    """A value with three shares stands thrice; between two values it lies as far as its share of their middles."""
    values, times = np.array([5.0, 1.0, 9.0, 2.0]), np.array([3, 1, 2, 4])
    shares = times / times.sum()
    # Middles of the blocks of 1, 2, 5 and 9: at 0.05, 0.3, 0.65 and 0.9.
    assert_allclose(weighted_quantile(values, shares, [0.0, 0.05, 0.175, 0.3, 0.65, 0.8, 1.0]),
                    [1.0, 1.0, 1.5, 2.0, 5.0, 5.0 + 4.0 * 0.15 / 0.25, 9.0])


def test_draws_are_summed_up_by_their_weights() -> None:
    rng = np.random.default_rng(3)
    x = rng.standard_normal((40_000, 8)) @ np.diag(np.arange(1.0, 9.0)) + np.arange(8.0)
    x[:, 1] += x[:, 0]
    times = rng.integers(1, 4, len(x))
    draws, copies = Draws(x, times / times.sum(), 1.0), np.repeat(x, times, axis=0)
    assert_allclose(draws.mean, copies.mean(axis=0))
    assert_allclose(draws.covariance, np.cov(copies.T, bias=True), atol=1e-12)
    assert_allclose(draws.interval(0.9), np.quantile(copies, [0.05, 0.95], axis=0).T, atol=1e-2)
    for count in (1, 3, 8):
        assert draws.radius(0.95, count) == pytest.approx(chi2.ppf(0.95, count), rel=0.03)
    first = draws.first(3)
    assert_array_equal(first.x, x[:, :3])
    assert (first.weight is draws.weight, first.effective) == (True, 1.0)


def rows_of(kind: PriorKind = "lognormal", low: float = -np.inf, design: np.ndarray | None = None) -> Linearised:
    """Of an effect of joint 1 and that joint's spring."""
    prior = PriorModel(Prior(MEDIAN, np.full(6, 1.5)), kind, term_mean=np.array([0.3]), term_std=np.array([0.8]),
                       term_low=np.array([low]), term_high=np.array([9.0]))
    design = np.zeros((COUNT, 3, 7)) if design is None else design
    residual = np.random.default_rng(5).standard_normal((COUNT, 3))
    return Linearised(noise(), design, residual, np.ones(COUNT), prior, np.concatenate([0.2 - np.log(MEDIAN), [0.1]]))


def trials_of(weight: list[float], information: list[float], pull: list[float], of_effect: list[float]) -> Trials:
    """Components of which each tells so much of joint 1, nothing of the others, and of the effect."""
    gram = np.zeros((len(weight), 8, 8))
    for k in range(len(weight)):
        gram[k, 0, 0], gram[k, 0, 7], gram[k, 6, 6], gram[k, 6, 7] = information[k], pull[k], of_effect[k], 0.5 * of_effect[k]
    return Trials(np.zeros((len(weight), 6)), np.array(weight), gram, 0.0, np.full(len(weight), SetUp.TURNED))


THREE = trials_of([0.5, 0.3, 0.2], [6.0, 3.0, 9.0], [2.0, -1.0, 0.5], [2.0, 0.5, 5.0])
NO_BESIDE = np.zeros((COUNT, 3, 0))


def mixed(log_density: list[np.ndarray], grid: np.ndarray, weight: np.ndarray) -> tuple[float, float]:
    """Mean and standard deviation of a mixture of densities over a grid, each as heavy as its weight."""
    each = np.array([np.exp(one - one.max()) for one in log_density])
    density = weight @ (each / each.sum(axis=1, keepdims=True))
    mean = float(density @ grid)
    return mean, float(np.sqrt(density @ (grid - mean) ** 2))


@pytest.mark.parametrize("degrees", [np.inf, 4.0])
def test_draws_have_the_mean_and_the_width_of_their_posterior(degrees: float) -> None:
    """The likelihood is normal in c and the prior in ln c; of heavy tails the rows tell (nu + 3) / (nu + 5) of what they would.
    Each of the components is as heavy as it is times what Laplace's normal distribution leaves out of it; a joint that no row
    tells has its prior."""
    at = rows_of()
    draws = posterior_draws(at, VarianceComponents(degrees=degrees), THREE, NO_BESIDE)
    told = 1.0 if np.isinf(degrees) else 7.0 / 9.0
    width = np.sqrt(np.log1p(1.5**2))
    ln_c, effect = np.linspace(-5, 5, 4001), np.linspace(-6, 8, 4001)
    of_joint, of_effect, weight = [], [], []
    for k in range(3):
        assert THREE.gram is not None
        information, pull = told * THREE.gram[k, 0, 0], told * THREE.gram[k, 0, 7]
        step = np.expm1(ln_c - 0.2)
        of_joint.append(pull * step - 0.5 * information * step**2 + norm.logpdf(ln_c, 0.0, width))
        # Laplace's: of the same slope and curvature at x, in ln c.
        slope, curvature = pull - 0.2 / width**2, information + 1 / width**2
        laplace = slope * (ln_c - 0.2) - 0.5 * curvature * (ln_c - 0.2) ** 2 + norm.logpdf(0.2, 0.0, width)
        weight.append(THREE.weight[k] * np.exp(of_joint[k]).sum() / np.exp(laplace).sum())
        size = told * THREE.gram[k, 6, 6]
        of_effect.append(-0.5 * size * (effect - 0.1 - 0.5) ** 2 + norm.logpdf(effect, 0.3, 0.8))
    share = np.array(weight) / np.sum(weight)
    assert draws.effective > 4000
    assert draws.weight.sum() == pytest.approx(1.0)
    assert draws.effective == pytest.approx(1.0 / np.sum(draws.weight**2))
    std = np.sqrt(np.diag(draws.covariance))
    for column, (mean, sigma) in ((0, mixed(of_joint, ln_c, share)), (6, mixed(of_effect, effect, share))):
        assert draws.mean[column] + (np.log(MEDIAN[0]) if column == 0 else 0.0) == pytest.approx(mean, abs=0.03 * sigma)
        assert std[column] == pytest.approx(sigma, rel=0.03)
    assert_allclose(draws.mean[1:6], -np.log(MEDIAN[1:]))
    assert_allclose(std[1:6], width)


def test_with_the_published_prior_draws_are_laplace_s() -> None:
    """Normal about the step that the rows and the prior ask for, whatever the components; the mean is exact."""
    at = rows_of("gaussian")
    draws = posterior_draws(at, VarianceComponents(), THREE, NO_BESIDE)
    assert draws.effective == 0.0
    assert_array_equal(draws.weight, np.full(DRAWS, 1 / DRAWS))
    assert THREE.gram is not None
    covariance = [np.linalg.inv(each[:7, :7] + at.prior.precision(at.x)) for each in THREE.gram]
    means = [at.x + own @ (each[:7, 7] - at.prior.gradient(at.x)) for own, each in zip(covariance, THREE.gram, strict=True)]
    mean = THREE.weight @ np.array(means)
    assert_allclose(draws.mean, mean, atol=1e-9)
    spread = sum(w * (own + np.outer(one - mean, one - mean))
                 for w, own, one in zip(THREE.weight, covariance, means, strict=True))
    std = np.sqrt(np.diag(spread))
    assert_allclose(draws.covariance / np.outer(std, std), spread / np.outer(std, std), atol=0.06)


@pytest.mark.parametrize(("share", "used"), [(0.06, True), (0.02, False), (1e-12, False)])
def test_draws_that_are_worth_too_few_are_laplace_s(share: float, used: bool) -> None:
    """Of an effect at its bound this share of its normal distribution lies within; under 400 of 12 000 it is not used."""
    precision = 2.0 + 1 / 0.8**2
    centre = (2.0 * 0.6 + 0.3 / 0.8**2) / precision
    low = centre + norm.isf(share) / np.sqrt(precision)
    # Joint 1 as good as known, so that nothing else makes a draw worth less.
    told = trials_of([1.0], [1e6], [0.0], [2.0])
    draws = posterior_draws(rows_of(low=low), VarianceComponents(), told, NO_BESIDE)
    assert (draws.effective > 0) == used
    assert np.all((draws.x[:, 6] >= low) | (draws.weight == 0)) == used
    if used:
        assert draws.mean[6] == pytest.approx(centre + norm.pdf(norm.isf(share)) / share / np.sqrt(precision), rel=0.03)
    else:
        assert draws.mean[6] == pytest.approx(centre)


def test_of_many_rows_seven_components_stand_for_all() -> None:
    """Those at the middles of seven equal shares of the weights, in the order of the sensor; each for as many draws. What is
    free beside the springs is so much more noise."""
    rng = np.random.default_rng(9)
    design, beside = np.zeros((COUNT, 3, 7)), rng.standard_normal((COUNT, 3, 2))
    design[:, :, [0, 6]] = rng.standard_normal((COUNT, 3, 2))
    at = rows_of("gaussian", design=design)
    # Of 20 by size, the first with half of the weight: it stands for three of the middles (1, 3, 5 of 14), the others, in
    # steps of a thirty-eighth, for four (at 7, 9, 11 and 13 of 14).
    size, order = np.linspace(0.5, 3.0, 20), rng.permutation(20)
    weight = np.where(np.arange(20) == 0, 0.49, 0.51 / 19)
    logs = np.full((20, 6), -4.6)
    logs[:, 0] = np.log(size)
    trials = Trials(logs[order], weight[order], None, 0.0, np.full(20, SetUp.TURNED))
    chosen = [0, 0, 0, *(1 + int((middle / 14 - 0.49) // (0.51 / 19)) for middle in (7, 9, 11, 13))]
    draws = posterior_draws(at, VarianceComponents(), trials, beside)
    flat, wide = design.reshape(-1, 7), beside.reshape(-1, 2)
    steps = []
    for k in chosen:
        sigma = np.linalg.inv(size[k] ** 2 * np.eye(3 * COUNT) + wide @ wide.T)
        steps.append(np.linalg.solve(flat.T @ sigma @ flat + at.prior.precision(at.x),
                                     flat.T @ sigma @ at.residual.ravel() - at.prior.gradient(at.x)))
    each = np.bincount(np.arange(DRAWS // 2) % 7) / (DRAWS // 2)
    assert_allclose(draws.mean, at.x + each @ np.array(steps), atol=1e-9)

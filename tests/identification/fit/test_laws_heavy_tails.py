"""Heavy tails: degrees of freedom, scale, weights and evidence against SciPy's distributions and integrals done by draws."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.optimize import minimize_scalar
from scipy.special import logsumexp
from scipy.stats import multivariate_normal, multivariate_t, t

from benchmarks import sixth_world
from identification.fit.heavy_tails import OwnErrors, _usual_scale, likeliest_tails, log_tails, student_weights
from identification.fit.load_test import LoadTest
from identification.fit.posterior import posterior
from identification.fit.student import DEGREES
from identification.measurements import read_measurements
from identification.model.cell import read_cell
from tests.identification.fit.test_laws_posterior import simulate
from tests.identification.fit.test_laws_student import THREE, drawn, log_likelihood

RESEATING = 1.5


def alone(readings: np.ndarray) -> OwnErrors:
    """Of rows of which nothing but their own noise is unknown."""
    return OwnErrors(readings**2, np.zeros_like(readings), np.full(len(readings), readings.shape[1]), np.zeros_like)


@pytest.mark.parametrize("seed", range(12))
def test_the_degrees_and_the_scale_are_the_likeliest(seed: int) -> None:
    """Every number of degrees with its own best scale, searched here; each doubling of heaviness from 100 on costs one unit."""
    rng = np.random.default_rng(7000 + seed)
    readings = drawn(rng, int(rng.integers(20, 120)), rng.choice([3.0, 5.0, 15.0, np.inf]), rng.uniform(0.3, 4.0))
    tried = {}
    for degrees in DEGREES:
        best = minimize_scalar(lambda log, nu=degrees: -log_likelihood(readings, nu, float(np.exp(log))), bounds=(-4, 4),
                               method="bounded", options={"xatol": 1e-6})
        tried[-best.fun - np.log2(100 / min(degrees, 100))] = degrees, float(np.exp(best.x))
    values = sorted(tried)
    assert values[-1] - values[-2] > 1e-4, "no clear answer: another seed"
    degrees, scale = likeliest_tails(alone(readings))
    assert degrees == tried[values[-1]][0]
    # To half of the last step of its ln.
    assert scale == pytest.approx(tried[values[-1]][1], rel=0.0127)


@pytest.mark.parametrize("degrees", DEGREES)
def test_many_rows_tell_the_truth(degrees: float) -> None:
    """Of the grid, the number of degrees that the rows were drawn with; 20 and 50 may be told apart from the normal only by
    more rows than these."""
    readings = drawn(np.random.default_rng(71), 6000, degrees, 2.5)
    found, scale = likeliest_tails(alone(readings))
    near = {20.0: (10.0, 20.0, 50.0), 50.0: (20.0, 50.0, np.inf)}.get(degrees, (degrees,))
    assert found in near
    assert scale == pytest.approx(2.5, rel=0.06)


def test_the_usual_scale_is_that_of_normal_rows_whatever_a_third_of_them_are() -> None:
    """Where half of the rows begin to lie; rows of which nothing was read have no part in it."""
    readings = 1.3 * np.random.default_rng(74).standard_normal((20_000, 3))
    assert _usual_scale(alone(readings)) == pytest.approx(1.69, rel=0.02)
    known = OwnErrors(readings**2 * 1.4, np.full_like(readings, 0.4), np.full(len(readings), 3), np.zeros_like)
    assert _usual_scale(known) == pytest.approx(1.69, rel=0.02)
    unread = OwnErrors(np.append(readings**2, np.zeros((30_000, 3)), axis=0), np.zeros((50_000, 3)),
                       np.repeat([3, 0], [20_000, 30_000]), np.zeros_like)
    assert _usual_scale(unread) == pytest.approx(1.69, rel=0.02)
    readings[::3] *= 1e3
    assert 1.69 < _usual_scale(alone(readings)) < 2 * 1.69


def test_a_reading_of_one_component_counts_as_one() -> None:
    """Rows of which one component was measured have the likelihood of one component."""
    rng = np.random.default_rng(72)
    readings = drawn(rng, 4000, 4.0, 1.7)[:, :1]
    found, scale = likeliest_tails(alone(readings))
    assert found == 4.0
    assert scale == pytest.approx(1.7, rel=0.08)



@pytest.mark.parametrize("degrees", DEGREES[:-1])
def test_heavy_tails_cost_the_evidence_what_they_cost(degrees: float) -> None:
    """Of a normal likelihood in which each row has the weight that it takes in the fit, what makes it the Student's, each
    doubling of heaviness from 100 on one unit less: two fits with unlike tails are weighed by their likelihoods."""
    readings = drawn(np.random.default_rng(73), 40, 6.0)
    readings[0] *= 20
    weight = (degrees + 3) / (degrees + np.sum(readings**2, axis=1))
    as_weighed = sum(multivariate_normal(np.zeros(3), THREE / w).logpdf(reading)
                     for w, reading in zip(weight, readings, strict=True))
    assert as_weighed + log_tails(alone(readings), weight, degrees) == pytest.approx(
        log_likelihood(readings, degrees, 1.0) - np.log2(100 / min(degrees, 100)), abs=0.2)


def test_a_row_of_which_all_else_is_known_weighs_what_its_distance_says() -> None:
    """(nu + 3) / (nu + d), also a thousand sigma off."""
    readings = drawn(np.random.default_rng(74), 60, 4.0)
    readings[:3] *= np.array([30.0, 3e3, 3e6])[:, None]
    weight, degrees = student_weights(alone(readings))
    assert degrees == 3.0
    assert_allclose(weight, 6 / (3 + np.sum(readings**2, axis=1)), rtol=0.02)


def test_own_errors_are_what_the_other_rows_tell(tmp_path) -> None:
    """A normal distribution of all rows together, each conditioned on all the others: of any weight of its own."""
    cell, rows = simulate(tmp_path, np.random.default_rng(83), poses=5, loads=3)
    rows.deflection[4] += 3e-5
    rows.deflection[7, 1] = np.nan
    found = posterior(LoadTest.of(cell, rows))
    assert found.components.degrees < 20
    at, n = found.at_map, len(rows)
    read = at.noise.measured.ravel()
    sigma = np.linalg.inv(found.weights.apply(np.eye(3 * n).reshape(n, 3, -1)).reshape(3 * n, -1)[np.ix_(read, read)])
    design = at.design.reshape(3 * n, -1)[read]
    sigma = sigma + design @ np.linalg.solve(at.prior.precision(at.x), design.T)
    residual = at.residual.ravel()[read] + design @ np.linalg.solve(at.prior.precision(at.x), at.prior.gradient(at.x))
    errors, own = OwnErrors.of(at, found.components, found.weights), at.noise.of_rows_alone(found.components)
    row = np.repeat(np.arange(n), 3)[read]
    for k in range(n):
        mine, others = row == k, row != k
        told = sigma[np.ix_(mine, others)] @ np.linalg.inv(sigma[np.ix_(others, others)])
        off = residual[mine] - told @ residual[others]
        kept = at.noise.measured[k]
        noise = np.linalg.inv(own[k][np.ix_(kept, kept)])
        left_open = sigma[np.ix_(mine, mine)] - told @ sigma[np.ix_(others, mine)] - noise / at.row_weight[k]
        constant = 0.5 * (np.linalg.slogdet(noise)[1] + kept.sum() * np.log(2 * np.pi))
        for w in (0.01, 1.0, 3.0):
            density = multivariate_normal(cov=noise / w + 0.5 * (left_open + left_open.T)).logpdf(off)
            assert errors.log_likelihood(np.array([[w]]))[k, 0] == pytest.approx(density + constant, abs=1e-3)


def test_a_gross_error_does_not_hide_behind_the_noise_that_it_makes(tmp_path: Path) -> None:
    """One gauge of the sixth judge (67000, 3) came to its end under one load, 215 um of 1550: a force error of 3.3 % explains
    that as well, once it has grown to it."""
    sixth_world.write(tmp_path, np.random.default_rng([67000, 3]), "end_of_travel")
    cell = read_cell(tmp_path / "cell.yaml")
    rows = read_measurements(tmp_path / "measurements.csv", cell)
    found = posterior(LoadTest.of(cell, rows))
    assert found.components.degrees < 5
    assert int(np.argmin(found.at_map.row_weight)) == int(np.flatnonzero(rows.deflection[:, 1] == 1336e-6)[0])
    assert found.at_map.row_weight.min() < 0.05
    assert found.components.force < 2


@pytest.mark.parametrize("degrees", [4.0, 10.0, np.inf])
def test_the_evidence_of_tails_is_the_integral_over_what_visits_share(degrees: float) -> None:
    """Four readings of each of 24 visits with a re-seating of their own, which is integrated out by draws: heavy tails are
    as likely against normal ones as that says, whichever the rows have; by their distances from the fitted offsets they were
    ten units less likely than they are."""
    rng = np.random.default_rng(91)
    visits = [drawn(rng, 4, degrees) + RESEATING * rng.standard_normal(3) for _ in range(24)]
    evidence = {nu: sum(by_draws(rows, nu, rng) for rows in visits) for nu in (4.0, 10.0, np.inf)}
    found = {nu: sum(by_tails(rows, nu) for rows in visits) for nu in (4.0, 10.0, np.inf)}
    for nu in (4.0, 10.0):
        assert found[nu] - found[np.inf] == pytest.approx(evidence[nu] - evidence[np.inf], abs=2.0)


def by_draws(rows: np.ndarray, degrees: float, rng: np.random.Generator) -> float:
    """ln p of the readings of a visit, its re-seating drawn about their mean."""
    about = np.median(rows, axis=0)
    draws = about + rng.standard_t(4, (20_000, 3))
    proposed = t(4).logpdf(draws - about).sum(axis=1)
    rest = rows[None] - draws[:, None]
    density: Callable[..., np.ndarray] = (multivariate_normal(np.zeros(3), THREE).logpdf if np.isinf(degrees)
                                          else multivariate_t(np.zeros(3), THREE, df=degrees).logpdf)
    value = density(rest.reshape(-1, 3)).reshape(len(draws), -1).sum(axis=1)
    value += multivariate_normal(np.zeros(3), RESEATING**2 * THREE).logpdf(draws) - proposed
    return float(logsumexp(value) - np.log(len(draws)))


def by_tails(rows: np.ndarray, degrees: float) -> float:
    """ln p of the readings by their weights and what the tails add, written for one offset with a normal prior."""
    weight = np.ones(len(rows))
    for _ in range(40):
        total = weight.sum() + RESEATING**-2
        centre, kept = weight @ rows / total, 1 - weight / total
        errors = OwnErrors(((rows - centre) / kept[:, None]) ** 2, np.repeat(1 / total / kept[:, None], 3, axis=1),
                           np.full(len(rows), 3), np.zeros_like)
        if np.isinf(degrees):
            break
        weight = expected_weight(errors, degrees)
    covariance = np.diag(1 / weight) + RESEATING**2
    normal = sum(multivariate_normal(np.zeros(len(rows)), covariance).logpdf(column) for column in rows.T)
    if np.isinf(degrees):
        return float(normal)
    return float(normal + log_tails(errors, weight, degrees) + np.log2(100 / degrees))


def expected_weight(errors: OwnErrors, degrees: float) -> np.ndarray:
    """Mean of each row's factor on its precision, by an integral of its own."""
    log_w = np.linspace(-12, 4, 400)
    half = 0.5 * degrees
    value = errors.log_likelihood(np.exp(log_w)[None]) + half * (log_w - np.exp(log_w))
    share = np.exp(value - value.max(axis=1, keepdims=True))
    return share @ np.exp(log_w) / share.sum(axis=1)

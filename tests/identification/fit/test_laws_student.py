"""Heavy tails: degrees of freedom and scale against SciPy's multivariate Student, and what each row weighs."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.optimize import minimize_scalar
from scipy.stats import multivariate_normal, multivariate_t

from identification.fit.noise_parts import VarianceComponents
from identification.fit.own_response import own_response
from identification.fit.student import DEGREES, log_tails, probability_beyond, tails

THREE = np.eye(3)


def drawn(rng: np.random.Generator, rows: int, degrees: float, scale: float = 1.0) -> np.ndarray:
    """Readings (n, 3) of a Student noise of unit shape."""
    heavier = 1.0 if np.isinf(degrees) else rng.chisquare(degrees, rows)[:, None] / degrees
    return np.asarray(np.sqrt(scale / heavier) * rng.standard_normal((rows, 3)))


def log_likelihood(readings: np.ndarray, degrees: float, scale: float) -> float:
    if np.isinf(degrees):
        return float(multivariate_normal(np.zeros(3), scale * THREE).logpdf(readings).sum())
    return float(multivariate_t(np.zeros(3), scale * THREE, df=degrees).logpdf(readings).sum())


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
    degrees, scale = tails(np.sum(readings**2, axis=1), np.full(len(readings), 3))
    assert degrees == tried[values[-1]][0]
    assert scale == pytest.approx(tried[values[-1]][1], rel=1e-3)


@pytest.mark.parametrize("degrees", DEGREES)
def test_many_rows_tell_the_truth(degrees: float) -> None:
    """Of the grid, the number of degrees that the rows were drawn with; 20 and 50 may be told apart from the normal only by
    more rows than these."""
    readings = drawn(np.random.default_rng(71), 6000, degrees, 2.5)
    found, scale = tails(np.sum(readings**2, axis=1), np.full(len(readings), 3))
    near = {20.0: (10.0, 20.0, 50.0), 50.0: (20.0, 50.0, np.inf)}.get(degrees, (degrees,))
    assert found in near
    assert scale == pytest.approx(2.5, rel=0.06)


def test_a_reading_of_one_component_counts_as_one() -> None:
    """Rows of which one component was measured have the likelihood of one component."""
    rng = np.random.default_rng(72)
    readings = drawn(rng, 4000, 4.0, 1.7)[:, :1]
    found, scale = tails(np.sum(readings**2, axis=1), np.ones(len(readings), dtype=int))
    assert found == 4.0
    assert scale == pytest.approx(1.7, rel=0.08)


def worst(readings: np.ndarray) -> float:
    """Family-wise probability of the row that is farthest off, by the others."""
    distance, count = np.sum(readings**2, axis=1), np.full(len(readings), readings.shape[1])
    at = int(np.argmax(distance))
    others = np.delete(distance, at), np.delete(count, at)
    return len(readings) * probability_beyond(float(distance[at]), int(count[at]), *others)


def test_how_far_off_a_row_is_by_hand() -> None:
    """All degrees of freedom with their likeliest scales, weighed by their likelihoods, each doubling of heaviness half a unit
    dearer; the tail of a multivariate Student by draws of it."""
    readings, squared = drawn(np.random.default_rng(73), 40, 6.0, 1.4), 18.0
    weight, beyond = [], []
    for degrees in DEGREES:
        best = minimize_scalar(lambda log, nu=degrees: -log_likelihood(readings, nu, float(np.exp(log))), bounds=(-4, 4),
                               method="bounded", options={"xatol": 1e-6})
        weight.append(-best.fun - 0.5 * np.log2(100 / min(degrees, 100)))
        far = drawn(np.random.default_rng(74), 400_000, degrees, float(np.exp(best.x)))
        beyond.append(np.mean(np.sum(far**2, axis=1) > squared))
    share = np.exp(np.array(weight) - max(weight))
    found = probability_beyond(squared, 3, np.sum(readings**2, axis=1), np.full(40, 3))
    assert found == pytest.approx(float(share @ beyond / share.sum()), rel=0.03)


@pytest.mark.parametrize(("degrees", "at_most"), [(np.inf, 1), (6.0, 1), (4.0, 2), (3.0, 4)])
def test_few_rows_without_a_mistake_have_hardly_ever_a_bad_one(degrees: float, at_most: int) -> None:
    """At 0.0005, in 150 data sets of 56 rows: sensors that now and then jump are no rarity."""
    rng = np.random.default_rng(75)
    assert sum(worst(drawn(rng, 56, degrees)) <= 0.0005 for _ in range(150)) <= at_most


@pytest.mark.parametrize("rows", [30, 240])
def test_a_wrong_digit_is_bad(rows: int) -> None:
    """A row 40 sigma off in normal noise; 12 sigma where many rows say how heavy the tails are."""
    readings = drawn(np.random.default_rng(76), rows, np.inf)
    readings[5, 1] += 40.0 if rows < 100 else 12.0
    assert worst(readings) < 1e-4


@pytest.mark.parametrize("degrees", DEGREES)
def test_heavy_tails_cost_the_evidence_what_they_cost(degrees: float) -> None:
    """Of a normal likelihood in which each row has the weight that it takes in the fit, what makes it the Student's, each
    doubling of heaviness from 100 on one unit less: two fits with unlike tails are weighed by their likelihoods."""
    readings = drawn(np.random.default_rng(73), 40, 6.0)
    readings[0] *= 20
    squared = np.sum(readings**2, axis=1)
    noise = SimpleNamespace(measured=np.ones((40, 3), dtype=bool), of_rows_alone=lambda _: np.tile(THREE, (40, 1, 1)))
    nothing_shared = SimpleNamespace(shared=np.zeros_like)
    weight = np.ones(40) if np.isinf(degrees) else (degrees + 3) / (degrees + squared)
    as_weighed = sum(multivariate_normal(np.zeros(3), THREE / w).logpdf(reading)
                     for w, reading in zip(weight, readings, strict=True))
    cost: Any = log_tails
    assert as_weighed + cost(noise, VarianceComponents(degrees=degrees), nothing_shared, readings) == pytest.approx(
        log_likelihood(readings, degrees, 1.0) - np.log2(100 / min(degrees, 100)))


def test_a_visit_s_own_response_weighs_its_rows_by_four_degrees() -> None:
    """By hand: a mean of six readings, one of them far off and one of two components, each weighed by how far off it is."""
    rng = np.random.default_rng(30)
    columns = np.broadcast_to(np.eye(3), (6, 3, 3)).copy()
    precision = np.broadcast_to(np.eye(3), (6, 3, 3)).copy()
    precision[4, 2, 2] = 0.0
    residual = rng.standard_normal((6, 3, 1))
    residual[2] += 20.0
    found = own_response(columns, precision, np.full(3, 0.01), residual)
    off = np.array([[(residual[n, i, 0] - found.coefficients[0, i]) ** 2 * precision[n, i, i] for i in range(3)]
                    for n in range(6)]).sum(axis=1)
    readings = np.array([3, 3, 3, 3, 2, 3])
    assert found.row_weight[0] == pytest.approx(np.minimum(1, (4 + readings) / (4 + off)))
    assert found.left[0] == pytest.approx(np.sum((4 + readings) * np.log(1 + off / 4)))
    assert found.row_weight[0, 2] < 0.02
    assert np.abs(found.coefficients).max() < 1.5

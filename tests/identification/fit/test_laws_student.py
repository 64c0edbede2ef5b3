"""Student distributions: how far off a row is, against SciPy's."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import minimize_scalar
from scipy.stats import multivariate_normal, multivariate_t

from identification.fit.own_response import own_response
from identification.fit.student import DEGREES, probability_beyond

THREE = np.eye(3)


def drawn(rng: np.random.Generator, rows: int, degrees: float, scale: float = 1.0) -> np.ndarray:
    """Readings (n, 3) of a Student noise of unit shape."""
    heavier = 1.0 if np.isinf(degrees) else rng.chisquare(degrees, rows)[:, None] / degrees
    return np.asarray(np.sqrt(scale / heavier) * rng.standard_normal((rows, 3)))


def log_likelihood(readings: np.ndarray, degrees: float, scale: float) -> float:
    if np.isinf(degrees):
        return float(multivariate_normal(np.zeros(3), scale * THREE).logpdf(readings).sum())
    return float(multivariate_t(np.zeros(3), scale * THREE, df=degrees).logpdf(readings).sum())


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

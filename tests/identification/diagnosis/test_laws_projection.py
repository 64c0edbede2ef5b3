"""Signatures beside a linear model: scores, information and evidence against normal densities of all readings together."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.stats import multivariate_normal, norm

from identification.diagnosis.dictionary import WIDEST, Dictionary
from identification.diagnosis.projection import Base, evidence, information_blocks, own_grams, scores

Array = NDArray[np.float64]
ROWS = 9


def spread(rng: np.random.Generator) -> Array:
    """The covariance (3n, 3n) of the noise."""
    root = rng.standard_normal((3 * ROWS, 3 * ROWS))
    return np.asarray(root @ root.T / (3 * ROWS) + 0.5 * np.eye(3 * ROWS))


def flat(columns: Array) -> Array:
    return columns.reshape(3 * ROWS, -1)


def dictionary_of(columns: list[Array], positive: list[bool]) -> Dictionary:
    """Signatures of these columns (n, 3, p), each an entry of its own."""
    entries: Any = tuple(SimpleNamespace(signatures=range(k, k + 1)) for k in range(len(columns)))
    signatures: Any = tuple(SimpleNamespace() for _ in columns)
    return Dictionary(entries, signatures, np.concatenate(columns, axis=2), np.array([each.shape[2] for each in columns]),
                      np.array(positive), {})


def model(rng: np.random.Generator, covariance: Array) -> Base:
    """Four free coefficients, their prior's middle a step away."""
    weights: Any = SimpleNamespace(apply=lambda columns: np.linalg.solve(covariance, flat(columns)).reshape(columns.shape))
    root = rng.standard_normal((4, 4))
    return Base(rng.standard_normal((ROWS, 3, 4)), 2 * rng.standard_normal((ROWS, 3)), weights, root @ root.T + np.eye(4),
                0.3 * rng.standard_normal(4))


def test_scores_are_those_of_the_readings_with_all_that_is_free_in_their_noise() -> None:
    """Its covariance is the noise's and what the prior of the free coefficients makes of the readings; their mean is where the
    prior has its middle. Of a positive cause one that would be negative has no ratio."""
    rng = np.random.default_rng(1)
    covariance = spread(rng)
    base = model(rng, covariance)
    columns = [rng.standard_normal((ROWS, 3, width)) for width in (1, 1, 2, 3, 1, 6)]
    design = flat(base.design)
    inverse = np.linalg.inv(covariance + design @ np.linalg.solve(base.precision, design.T))
    left = base.residual.ravel() - design @ base.shift
    # Two of one sign each way: one that fits, one that does not.
    sign = np.sign(flat(columns[0])[:, 0] @ inverse @ left)
    columns[0], columns[1] = sign * columns[0], -sign * columns[0]
    dictionary = dictionary_of(columns, [True, True, False, True, False, False])
    found = scores(base, dictionary)
    grams = information_blocks(base, dictionary)
    own = own_grams(base.weights, dictionary)
    for k, column in enumerate(columns):
        of, width = flat(column), column.shape[2]
        gram, score = of.T @ inverse @ of, of.T @ inverse @ left
        np.testing.assert_allclose(grams[k, :width, :width], gram, rtol=1e-9)
        np.testing.assert_allclose(base.gram(column), gram, rtol=1e-9)
        np.testing.assert_array_equal(grams[k, width:], np.eye(WIDEST)[width:])
        np.testing.assert_allclose(own[k, :width, :width], of.T @ np.linalg.solve(covariance, of), rtol=1e-9)
        best = np.linalg.solve(gram, score)
        wrong = dictionary.positive[k] and best[0] < 0
        assert found.ratio[k] == pytest.approx(0.0 if wrong else score @ best, rel=1e-6)
        assert found.size[k] == pytest.approx(abs(best[0]), rel=1e-6)
        assert found.evidence[k] == pytest.approx(
            evidence(gram[None], score[None], dictionary.positive[[k]])[0], rel=1e-6, abs=1e-9)
    assert found.ratio[0] > 0
    assert found.ratio[1] == 0
    again = scores(base, dictionary, own)
    np.testing.assert_allclose(again.evidence, found.evidence)
    # Of readings of no bearing on the prior's middle, several at once.
    drawn = rng.standard_normal((ROWS, 3, 4))
    np.testing.assert_allclose(base.score(columns[3], drawn), flat(columns[3]).T @ inverse @ flat(drawn), rtol=1e-8)
    step = base.step(base.residual)
    precise = design.T @ np.linalg.solve(covariance, design) + base.precision
    np.testing.assert_allclose(step, np.linalg.solve(precise, design.T @ np.linalg.solve(
        covariance, base.residual.ravel()) + base.precision @ base.shift))


def test_evidence_is_how_much_likelier_the_readings_are_with_such_effects() -> None:
    """Of either sign, normal densities with the effect's own spread in their covariance, in nine of ten 1.5 sigma wide, in
    eight of a hundred 6, in two 24."""
    rng = np.random.default_rng(2)
    covariance = spread(rng)
    base = model(rng, covariance)
    columns = [0.5 * rng.standard_normal((ROWS, 3, width)) for width in (1, 2, 5)]
    found = scores(base, dictionary_of(columns, [False] * 3))
    design = flat(base.design)
    plain = covariance + design @ np.linalg.solve(base.precision, design.T)
    left = base.residual.ravel() - design @ base.shift
    nothing = multivariate_normal(np.zeros(3 * ROWS), plain).logpdf(left)
    for k, column in enumerate(columns):
        of = flat(column)
        each = [share + multivariate_normal(np.zeros(3 * ROWS), plain + size**2 * of @ of.T).logpdf(left) - nothing
                for share, size in zip(np.log([0.9, 0.08, 0.02]), (1.5, 6.0, 24.0), strict=True)]
        assert found.evidence[k] == pytest.approx(np.logaddexp.reduce(each), abs=1e-6)


@pytest.mark.parametrize(("information", "visible"), [(0.24, False), (0.26, True)])
def test_an_effect_can_be_seen_from_half_a_sigma_on(information: float, visible: bool) -> None:
    """A typical one: of several coefficients that which shows most."""
    weights: Any = SimpleNamespace(apply=lambda columns: columns)
    base = Base(np.zeros((ROWS, 3, 1)), np.zeros((ROWS, 3)), weights, np.eye(1), np.zeros(1))
    column = np.zeros((ROWS, 3, 2))
    column[0, 0, 0], column[1, 0, 1] = 0.1, np.sqrt(information)
    assert scores(base, dictionary_of([column], [False])).visible.tolist() == [visible]


def test_further_columns_are_free_within_a_half_and_twice_their_typical_size() -> None:
    """1.5 sigma each: as the readings see them in their covariance; what was free before stays."""
    rng = np.random.default_rng(3)
    covariance = spread(rng)
    base = model(rng, covariance)
    more = rng.standard_normal((ROWS, 3, 2))
    larger = base.extended(more)
    design = flat(base.design)
    plain = covariance + design @ np.linalg.solve(base.precision, design.T) + 1.5**2 * flat(more) @ flat(more).T
    column = rng.standard_normal((ROWS, 3, 1))
    assert larger.gram(column)[0, 0] == pytest.approx(float(flat(column)[:, 0] @ np.linalg.solve(plain, flat(column)[:, 0])))
    np.testing.assert_array_equal(larger.shift, [*base.shift, 0.0, 0.0])
    assert (base.free, larger.free) == (4, 6)
    assert base.extended(more[:, :, :0]) is base


def test_a_positive_effect_is_twice_the_half_of_its_normals() -> None:
    information, score = np.array([[[4.0]]]), np.array([[-3.0]])
    both, half = (evidence(information, score, np.array([positive]))[0] for positive in (False, True))
    width = np.array([1.5, 6.0, 24.0])
    precision = 4.0 + 1 / width**2
    each = np.log([0.9, 0.08, 0.02]) + 0.5 * 9.0 / precision - 0.5 * np.log(precision) - np.log(width)
    assert both == pytest.approx(np.logaddexp.reduce(each))
    assert half == pytest.approx(np.logaddexp.reduce(each + np.log(2) + norm.logcdf(-3.0 / np.sqrt(precision))))

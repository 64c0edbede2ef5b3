"""One alignment of a log with a program: the regression gives back the force that a log was made of, says how much of it stands
on air moves, and knows its place as well as the curvature of its misfit says."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from compensator.forces.alignment_regression import Bins, Regression, binned, plateau_share
from compensator.forces.program_time import EDGE, ProgramTime

# Air, a cut along x, air, a cut along y of another kind, air: 100 mm and 2 s each.
AIR, CUT = np.array([True, True, False, True, False, True]), np.array([2, 4])
TIME, LENGTH = 2.0 * np.arange(6.0), 0.1 * np.arange(6.0)
KIND = np.array([0, 0, 0, 0, 1, 0])
ALONG = np.array([[0, 0, 0], [1, 0, 0], [1, 0, 0], [1, 0, 0], [0, 1, 0], [1, 0, 0]], dtype=float)
LEAD = 0.02


def program() -> ProgramTime:
    return ProgramTime(TIME, LENGTH, AIR, KIND, ALONG)


def logged(bias: np.ndarray, of_cut: np.ndarray, override: float = 1.0, shift: float = 0.0) -> Bins:
    """A log of 20 bins a second: in each cut its force (3,), behind 20 mm of lead-in and before as much lead-out, and the bias
    everywhere. Bins within the edge of a cut are left empty: nobody's law of an edge is asked for."""
    middle = (np.arange(200) + 0.5) * 0.05
    place = 0.05 * middle                           # 50 mm/s all along
    force = np.tile(bias, (200, 1))
    edge = np.zeros(200, dtype=bool)
    for k, move in enumerate(CUT):
        start, end = LENGTH[move - 1] + LEAD, LENGTH[move] - LEAD
        force[(place > start) & (place < end)] += of_cut[k]
        edge |= (np.abs(place - start) < EDGE) | (np.abs(place - end) < EDGE)
    return Bins(middle / override + shift, np.where(edge[:, None], 0.0, force), (~edge).astype(float), 0.05 / override)


BIAS, OF_CUT = np.array([3.0, -2.0, 10.0]), np.array([[100.0, 40, -20], [-30.0, 80, 60]])


def test_at_the_truth_nothing_is_left_and_beside_it_much() -> None:
    """At an override of 0.8 and a shift of 3 s, with 20 mm of lead-in and lead-out. The ridge leaves under a thousandth."""
    bins = logged(BIAS, OF_CUT, 0.8, 3.0)
    regression = Regression(program(), bins, 9.0)
    truth = np.array([0.8 * (9.0 - 3.0), np.log(0.8), LEAD, LEAD])
    size = np.sqrt(regression.energy)
    fit = regression.fit(truth)
    assert np.linalg.norm(fit.residual) < 1e-3 * size
    np.testing.assert_allclose(regression.left(regression.seen(truth), fit.coefficients), fit.residual, atol=1e-9)
    for k, step in enumerate((0.2, 0.1, 0.01, 0.01)):
        for sign in (1, -1):
            assert np.linalg.norm(regression.fit(truth + sign * step * np.eye(4)[k]).residual) > 0.1 * size
    # What is slower by the slip is made up for by the start.
    np.testing.assert_allclose(regression.fit(truth - [0.5, 0, 0, 0], 0.5).residual, fit.residual, atol=1e-9)


def test_the_coefficients_are_the_bias_and_the_force_of_each_cut() -> None:
    bins = logged(BIAS, OF_CUT)
    regression = Regression(program(), bins, 0.0)
    bias, *of_kinds = regression.fit(np.array([0.0, 0.0, LEAD, LEAD])).coefficients
    mean = bins.force[bins.weight > 0].mean(axis=0)
    np.testing.assert_allclose(bias + mean, BIAS, atol=0.02)
    for k, kind in enumerate(KIND[CUT]):
        own = np.array(of_kinds)[4 * kind:4 * kind + 4]
        np.testing.assert_allclose(own[0] + ALONG[CUT[k]] @ own[1:], OF_CUT[k], atol=0.05)


def test_the_likelihood_is_of_the_share_left_and_of_leads_that_are_alike() -> None:
    """ln of the share of the energy that is left, and a normal prior on the difference of lead-in and lead-out: a tenth of
    their sum and 1 mm more is one sigma; leads below nothing count by their millimetres."""
    regression = Regression(program(), logged(BIAS, OF_CUT), 0.0)

    def data(x: np.ndarray) -> float:
        return float(np.log(np.sum(regression.fit(x).residual**2) / np.sum(regression.force**2)))

    alike, longer, below = (np.array([0.1, 0.0, *leads]) for leads in ((0.03, 0.03), (0.03, 0.05), (-2e-3, -2e-3)))
    assert regression.value(alike) == pytest.approx(0.5 * data(alike))
    assert regression.value(longer, independent=7.0) == pytest.approx(0.5 * (data(longer) + (20 / 9) ** 2 / 7))
    assert regression.value(longer) == pytest.approx(0.5 * (data(longer) + (20 / 9) ** 2 / 100))
    assert regression.value(below) == pytest.approx(0.5 * (data(below) + 2 * 2.0**2 / 100))


def test_the_likeliest_alignment_near_by_is_the_truth() -> None:
    """From a fifth of a second off, at another override, with leads that are not there."""
    bins = logged(BIAS, OF_CUT, 0.8, 3.0)
    regression = Regression(program(), bins, 9.0)
    found = regression.refine(np.array([0.8 * 6.0 + 0.15, np.log(0.8) + 0.01, 0.0, 0.0]))
    assert abs(found[0] - 4.8) < 0.03
    assert abs(found[1] - np.log(0.8)) < 0.01
    np.testing.assert_allclose(found[2:], LEAD, atol=2e-3)


@pytest.mark.parametrize(("in_air", "moves", "told"), [(0.0, [1, 3, 5], 0.0), (0.3, [1, 3, 5], 0.3), (0.6, [1], 0.6 / 3**0.5),
                                                       (0.6, [5], 0.6 / 3**0.5)])
def test_force_on_air_moves_is_told_as_a_share_of_that_on_cuts(in_air: float, moves: list[int], told: float) -> None:
    """RMS over RMS, the bias taken off, all three moves in air alike; 400 N before the program are not asked."""
    force = np.array([[60.0, 0, 80.0], [60.0, 0, 80.0]])
    bins = logged(np.zeros(3), force)
    air = np.isin(np.searchsorted(TIME, bins.time), moves)
    turn = np.where(np.arange(len(air)) % 2, 1.0, -1.0)         # to and fro: no bias
    values = bins.force + (in_air * 100.0 * turn * air * (bins.weight > 0))[:, None] * np.array([0, 1.0, 0])
    outside = 25
    time = np.concatenate([bins.time[0] - 0.05 * np.arange(outside, 0, -1), bins.time])
    values = np.concatenate([np.tile([0, 400.0, 0], (outside, 1)) * np.where(np.arange(outside) % 2, 1, -1)[:, None], values])
    log = Bins(time, values, np.append(np.ones(outside), bins.weight), 0.05)
    regression = Regression(program(), log, 0.0)
    found = regression.force_in_air(np.array([0.0, 0.0, LEAD, LEAD]), np.zeros(int(log.weight.sum())))
    assert found == pytest.approx(told, abs=0.05)


@pytest.mark.parametrize("width", [1.0, 0.25])
def test_bins_are_means_of_their_samples_and_empty_ones_count_for_nothing(width: float) -> None:
    time, force = 5.0 + width * np.array([0.0, 0.2, 0.9, 3.1, 4.0]), np.arange(15.0).reshape(5, 3)
    bins = binned(time, force, width)
    np.testing.assert_allclose(bins.time, 5.0 + width * np.array([0.5, 1.5, 2.5, 3.5, 4.5]))
    np.testing.assert_array_equal(bins.weight, [1, 0, 0, 1, 1])
    np.testing.assert_allclose(bins.force[[0, 3, 4]], [force[:3].mean(axis=0), force[3], force[4]])
    np.testing.assert_allclose(bins.centred.sum(axis=0), 0, atol=1e-12)
    assert not bins.centred[1:3].any()


@pytest.mark.parametrize("at", [0, 4, 9])
def test_a_plateau_of_one_bin_explains_what_one_bin_does(at: int) -> None:
    force = np.zeros((10, 3))
    force[at] = [5.0, -3.0, 1.0]
    assert plateau_share(binned(np.arange(10.0), force, 1.0)) == pytest.approx(1.0)


def parabola(curvature: np.ndarray, slope: np.ndarray) -> Any:
    """A regression whose misfit is one."""
    found = SimpleNamespace(value=lambda x, slip, independent: 0.5 * x @ curvature @ x + slope @ x + 3.0,
                            time=np.linspace(0.0, 100.0, 11))
    found._hessian = lambda *arguments: Regression._hessian(found, *arguments)
    return found


def test_the_curvature_of_a_parabola_is_its_own() -> None:
    rng = np.random.default_rng(11)
    root, slope = rng.normal(size=(4, 4)), rng.normal(size=4)
    curvature = root + root.T
    found = Regression._hessian(parabola(curvature, slope), rng.normal(size=4), np.array([0.1, 0.3, 0.02, 1.0]), 0, 1.0)
    np.testing.assert_allclose(found, curvature, atol=1e-8)


def test_the_covariance_is_the_inverse_of_what_all_independent_values_say() -> None:
    """Of a parabola; about as wide as the steps at which it is looked at first."""
    rng = np.random.default_rng(12)
    size = np.array([0.05, 2e-3, 1e-3, 1e-3])
    root = np.eye(4) + 0.3 * rng.normal(size=(4, 4))
    curvature = root @ root.T / np.multiply.outer(size, size) / 40.0
    found = Regression.covariance(parabola(curvature, rng.normal(size=4)), rng.normal(size=4), np.zeros(3), 40.0)
    np.testing.assert_allclose(found / np.multiply.outer(size, size), np.linalg.inv(root @ root.T), rtol=1e-3, atol=1e-3)


@pytest.mark.parametrize("newton", [1e-2, 1.0, 300.0])
def test_the_share_of_one_plateau_is_the_best_of_all_pairs_of_ends(newton: float) -> None:
    """By squares about the two means, every plateau in turn; forces of any size, bins without a sample left out."""
    rng = np.random.default_rng(23)
    force = newton * (rng.standard_normal((24, 3)) + np.where((np.arange(24) > 6) & (np.arange(24) < 15), 1.5, 0.0)[:, None])
    weight = np.ones(24)
    weight[[3, 10]] = 0.0
    force[weight == 0] = 0.0
    seen = force[weight > 0]
    total = np.sum((seen - seen.mean(axis=0)) ** 2)

    def left(inside: np.ndarray) -> float:
        return float(sum(np.sum((part - part.mean(axis=0)) ** 2) for part in (seen[inside], seen[~inside])))

    number = np.arange(22)
    best = min(left((number >= first) & (number < last)) for first in range(22) for last in range(first + 1, 23)
               if last - first < 22)
    assert plateau_share(Bins(np.arange(24.0), force, weight, 1.0)) == pytest.approx(1 - best / total, rel=1e-9)

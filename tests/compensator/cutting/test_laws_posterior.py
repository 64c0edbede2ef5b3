"""What a log tells of the coefficients: right, as wide as it says, and as little as it knows."""

from __future__ import annotations

import numpy as np
import pytest

from compensator.coefficients.next_cut import next_cut
from compensator.cutting.materials import MATERIALS, coefficients_of
from compensator.cutting.posterior import ForcePosterior, ForceRows, _sizes, fit_coefficients
from identification.common.autocorrelation import autocorrelation_time
from tests.compensator.cutting.milled import FLAT, TRUE

# Mean force by the textbook's closed forms, an engaged angle from a to b, per mm of depth: written here, not the program's.
TEETH = 3


def textbook(low: float, high: float, chip: float, depth: float) -> np.ndarray:
    """A (3, 6) by numerical integration over the angle."""
    phi = np.linspace(low, high, 2001)
    phi = 0.5 * (phi[1:] + phi[:-1])
    step, zero, one = (high - low) / 2000, np.zeros_like(phi), np.ones_like(phi)
    t, r, a = (np.array(v) for v in ((-np.sin(phi), np.cos(phi), zero), (-np.cos(phi), -np.sin(phi), zero), (zero, zero, -one)))
    h = chip * np.cos(phi)
    return np.asarray(np.column_stack([*((v * h).sum(axis=1) for v in (t, r, a)), *(v.sum(axis=1) for v in (t, r, a))])
                      * TEETH * depth * step / (2 * np.pi))


def simulated(seed: int, *, slots_only: bool = False, noise: float = 2.0, memory: float = 0.0) -> ForceRows:
    rng = np.random.default_rng(seed)
    weights = []
    for k in range(240):
        part = k // 60
        low, high = (-np.pi / 2, np.pi / 2) if slots_only or part == 3 else (-np.pi / 2, -np.pi / 2 + (0.4, 0.7, 1.2)[part])
        weights.append(textbook(low, high, 1e-4 if slots_only else (0.6e-4, 1.2e-4)[part % 2], 4e-3))
    weight = np.array(weights)
    error = rng.normal(size=(240, 3)) * noise
    for i in range(1, 240):
        error[i] = memory * error[i - 1] + np.sqrt(1 - memory**2) * error[i]
    force = weight @ TRUE + rng.normal(size=3) * 1.0 + error
    return ForceRows(weight, force, np.full((240, 3), 0.1), np.zeros((240, 3, 0)), 1e-3 * np.arange(240))


def fitted(rows: ForceRows) -> ForcePosterior:
    return fit_coefficients(rows, *coefficients_of("aluminium", 1e-4))


@pytest.mark.parametrize("memory", [pytest.param(0.0, marks=pytest.mark.long), 0.8])
def test_the_stated_covariance_is_the_scatter(memory: float) -> None:
    """On 30 logs: the squares in units of the covariance are those of six normal numbers, with white noise and with noise that
    remembers; with remembered noise taken as white they would be five times that."""
    squares = []
    for seed in range(30):
        found = fitted(simulated(400 + seed, noise=20.0, memory=memory))
        off = found.mean - TRUE
        squares.append(off @ np.linalg.solve(found.covariance, off) / 6)
    assert 0.4 < np.mean(squares) < 1.6


def test_a_log_tells_more_than_the_table() -> None:
    mean, covariance = coefficients_of("aluminium", 1e-4)
    found = fitted(simulated(3))
    before, after = np.sqrt(np.diag(covariance)), np.sqrt(np.diag(found.covariance))
    assert (after < 0.5 * before).all()
    assert np.linalg.norm((found.mean - TRUE) / TRUE[[0, 0, 0, 3, 3, 3]]) < 0.3 * np.linalg.norm(
        (mean - TRUE) / TRUE[[0, 0, 0, 3, 3, 3]])


def test_one_kind_of_cut_does_not_tell_chip_from_edge() -> None:
    """Slots at one feed: the force is known, its parts are not; the next cut asks for another feed or width."""
    found = fitted(simulated(5, slots_only=True))
    same = textbook(-np.pi / 2, np.pi / 2, 1e-4, 4e-3)
    light = textbook(-np.pi / 2, -np.pi / 2 + 0.3, 2e-4, 4e-3)
    spread = [np.sqrt(np.trace(a @ found.covariance @ a.T)) / np.linalg.norm(a @ found.mean) for a in (same, light)]
    assert spread[0] < 0.02
    assert spread[1] > 3 * spread[0]
    further = next_cut(found.mean, found.covariance, FLAT, 4e-3, 1e-4, 1.0)
    assert further.after < 0.7 * further.before
    assert (further.width, further.chip) != (1.0, 1e-4)


def test_a_gross_row_counts_little() -> None:
    rows = simulated(7)
    spoilt = rows.force.copy()
    spoilt[100:104] += 400.0
    clean, robust = fitted(rows), fitted(ForceRows(rows.weight, spoilt, rows.error, rows.aside, rows.place))
    assert np.abs((robust.mean - clean.mean) / np.sqrt(np.diag(clean.covariance))).max() < 3


def test_a_stretch_that_the_model_does_not_know_counts_little() -> None:
    """A tenth of the rows, one behind the other, off by 12 % one way, as in the corners of a heavy cut: where a row counts no
    less the further it is off they move the coefficients by seven sigmas."""
    rows = simulated(8, noise=0.5)
    spoilt = rows.force.copy()
    spoilt[180:204] *= 1.12
    found = fitted(ForceRows(rows.weight, spoilt, rows.error, rows.aside, rows.place))
    clean = fitted(rows)
    assert np.abs((found.mean - clean.mean) / np.sqrt(np.diag(clean.covariance))).max() < 3


def test_where_the_stock_stands_is_found_with_them() -> None:
    rows = simulated(9)
    aside = np.zeros((240, 3, 1))
    aside[:60, :, 0] = 0.1 * (rows.weight[:60] @ TRUE)
    found = fitted(ForceRows(rows.weight, rows.force + 2.0 * aside[:, :, 0], rows.error, aside, rows.place))
    assert found.aside[0] == pytest.approx(2.0, abs=0.5)


@pytest.mark.parametrize("material", MATERIALS)
def test_the_table_is_kienzles_tangent(material: str) -> None:
    """At the chip it was linearised at the tangential force is the handbook's, and its slope too."""
    chip, thick = 1e-4, 0.05
    mean, covariance = coefficients_of(material, chip)
    known = MATERIALS[material]
    for h in (0.98 * thick, thick, 1.02 * thick):
        assert 1e-6 * mean[0] * h + 1e-3 * mean[3] == pytest.approx(known.specific * h ** (1 - known.exponent), rel=1e-3)
    assert np.linalg.eigvalsh(covariance / np.outer(mean, mean)).min() > 0
    assert 0.35 < np.sqrt(covariance[0, 0]) / mean[0] < 0.5


@pytest.mark.parametrize(("every", "well", "badly", "size_of_floor"), [(2, 1.0, 60.0, 6.0), (100, 0.1, 20.0, 20.0)])
def test_the_sizes_of_the_error_are_found_beside_rows_that_are_known_badly(
    every: int, well: float, badly: float, size_of_floor: float,
) -> None:
    """A floor and 10 % of the force, in residuals whose own known scatter [N] is small in some of the rows: where these are
    many the others tell next to nothing of the floor and do not spoil it; where they are few they do not decide alone. Over 40
    draws, whose scatter is at most two and a half times the least that any estimate may have (Cramer and Rao)."""
    floors, models, least = [], [], np.zeros(2)
    for seed in range(40):
        rng = np.random.default_rng(900 + seed)
        size = rng.uniform(20, 300, 600)
        known = np.where(np.arange(600)[:, None] % every == 0, well**2, badly**2) * np.ones(3)
        variance = size_of_floor**2 + (0.1 * size[:, None]) ** 2 / 3 + known
        residual = rng.normal(size=(600, 3)) * np.sqrt(variance)
        slopes = np.column_stack([np.full(600, 2 * size_of_floor), 0.2 * size**2 / 3]) / variance[:, :1]
        least += np.sqrt(np.diag(np.linalg.inv(1.5 * slopes.T @ slopes))) / 40
        floor, model = _sizes(residual, known, size)
        floors.append(floor)
        models.append(model)
    assert np.mean(floors) == pytest.approx(size_of_floor, rel=0.1)
    assert np.mean(models) == pytest.approx(0.1, rel=0.1)
    assert np.all(np.std([floors, models], axis=1) < 2.5 * least)


def stock_aside(seed: int) -> ForceRows:
    """Rows of uneven scatter along a path of uneven steps, a stock that may stand aside two ways, and some gross rows."""
    rng = np.random.default_rng(seed)
    rows = simulated(seed, noise=3.0, memory=0.6)
    aside = rng.normal(0, 4.0, (240, 3, 2))
    force = rows.force + aside @ [0.7, -1.2]
    force[50:53] += [60.0, -40.0, 20.0]
    return ForceRows(rows.weight, force, rng.uniform(0.2, 3.0, (240, 3)), aside, np.cumsum(rng.uniform(2e-4, 2e-3, 240)))


def test_the_posterior_is_that_of_the_errors_that_it_states() -> None:
    """By the covariance of the forces, zero and stock among them, in place of the normal equations: with weights by each row's
    residual in its stated error, as many rows as neighbours that remember each other tell."""
    rows = stock_aside(21)
    mean, covariance = coefficients_of("aluminium", 1e-4)
    found = fit_coefficients(rows, mean, covariance)
    force = rows.weight @ found.mean
    slopes = np.abs(np.diff(force, axis=0) / np.diff(rows.place)[:, None])
    steeper = np.array([slopes[max(k - 1, 0):k + 1].max(axis=0) for k in range(240)])
    size = np.linalg.norm(force, axis=1)[:, None]
    error = np.sqrt(rows.error**2 + (0.2e-3 * steeper) ** 2 + found.floor**2 + found.model_error**2 * size**2 / 3)
    np.testing.assert_allclose(found.error, error, rtol=1e-5)
    design = np.concatenate([rows.weight, np.tile(np.eye(3), (240, 1, 1)), rows.aside], axis=2).reshape(720, 11)
    np.testing.assert_allclose(found.residual.ravel(), rows.force.ravel() - design @ np.r_[
        found.mean, found.zero, found.aside], atol=1e-9)
    square = np.mean((found.residual / error) ** 2, axis=1)
    share = 1 / (1 + square / (2.5**2 * np.median(square) / 0.888**2))
    variance = found.memory * error**2 / share[:, None]
    before = np.zeros((11, 11))
    before[:6, :6], before[6:, 6:] = covariance, np.diag([4.0, 4, 4, 1, 1])
    gain = before @ design.T @ np.linalg.inv(design @ before @ design.T + np.diag(variance.ravel()))
    x = np.r_[mean, np.zeros(5)] + gain @ (rows.force.ravel() - design[:, :6] @ mean)
    behind = before - gain @ design @ before
    scale = np.sqrt(np.diag(behind))
    np.testing.assert_allclose((np.r_[found.mean, found.zero, found.aside] - x) / scale, 0, atol=1e-3)
    np.testing.assert_allclose(found.covariance / np.outer(scale[:6], scale[:6]), behind[:6, :6] / np.outer(
        scale[:6], scale[:6]), atol=1e-3)
    np.testing.assert_allclose(found.gain.reshape(6, 720) / scale[:6, None], gain[:6] / scale[:6, None], atol=1e-4)
    clipped = np.clip(found.residual / found.error, -2.5, 2.5)
    assert found.memory == pytest.approx(autocorrelation_time(clipped, floor=0.05).values, rel=1e-3)
    assert 2 < found.memory < 6, "of noise that remembers 0.6, which has (1 + 0.6) / (1 - 0.6)"
    assert share[50:53].max() < 0.3
    assert (found.floor, found.model_error) == pytest.approx(_sizes(
        found.residual, rows.error**2 + (0.2e-3 * steeper) ** 2, size[:, 0]), rel=1e-3)


def test_no_force_is_better_known_than_to_a_fifth_of_a_newton_and_no_model_than_to_three_hundredths() -> None:
    """Of rows that are off by just as much as floor, model and what is known of each make; a gross row among hundreds, which
    counts as three middling ones at most, says next to nothing."""
    size, known = np.linspace(20, 300, 600), np.linspace(0.5, 0.01, 600)[:, None] * [0.5, 1, 1.5]
    for floor, model in ((0.19, 0.029), (0.21, 0.029), (0.19, 0.031), (0.21, 0.031), (3.0, 0.1)):
        residual = np.tile(np.sqrt(floor**2 + (model * size) ** 2 / 3 + known.mean(axis=1)), (3, 1)).T
        told = max(floor, 0.2), max(model, 0.03)
        assert _sizes(residual, known, size) == pytest.approx(told, rel=1e-6)
        gross, as_three = residual.copy(), residual.copy()
        gross[300], as_three[300] = 1e4, 3 * np.median(residual[:, 0])
        assert _sizes(gross, known, size) == pytest.approx(_sizes(as_three, known, size), rel=5e-3)
        assert _sizes(gross, known, size)[1] == pytest.approx(told[1], rel=0.01)

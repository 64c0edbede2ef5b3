"""Poses that were not fitted: predicted by one step as by a fit that never saw them."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from identification.common.arrays import rms
from identification.common.findings import error
from identification.fit import held_out
from identification.fit.fitted_model import Term, response
from identification.fit.held_out import left_out, left_out_with_density, log_density, pose_names, poses
from identification.fit.load_test import LoadTest
from identification.fit.noise import noise_model
from identification.fit.noise_parts import OPTIONAL
from identification.fit.posterior import Posterior, posterior
from identification.measurements import read_measurements
from identification.model.cell import read_cell
from identification.model.compliance import equilibrium
from identification.model.law_of import known
from tests.identification.fit.test_laws_posterior import NOISY, simulate
from tests.virtual_cell.cell import Hidden
from tests.virtual_cell.cell import simulate as simulated

NARROW = NOISY + "prior: {relative_std: [0.2, 0.2, 0.2, 0.2, 0.2, 0.2]}\n"


@pytest.mark.parametrize("text", [NOISY, NARROW], ids=["wide", "narrow"])
def test_a_pose_left_out_is_predicted_as_by_a_fit_without_it(tmp_path, text: str) -> None:
    """Few poses, so that each pulls at the springs: the residual of the fit itself is far from that of a fit without it. The
    true springs are not the prior's, so that a narrow prior pulls at the fit."""
    cell, rows = simulate(tmp_path, np.random.default_rng(81), poses=4, loads=3, text=text)
    whole = LoadTest.of(cell, rows)
    model = posterior(whole)
    groups = poses(rows)
    assert len(pose_names(rows)) == groups.max() + 1 == 4
    held = left_out(model, groups)
    for number in range(4):
        out = groups == number
        rest = posterior(whole.with_rows(rows.select(~out)))
        refitted = rows.deflection[out] - predicted(whole, rest)[out]
        inside = rows.deflection[out] - predicted(whole, model)[out]
        moved = np.sqrt(np.mean((refitted - inside) ** 2))
        assert np.sqrt(np.mean((held[out] - refitted) ** 2)) < 0.3 * moved, number


def test_a_law_with_corners_is_predicted_in_full(tmp_path) -> None:
    """A tool that rattles: the slope by the axis of its play, at the corner on which a fit comes to rest, holds nowhere beside
    it, and a straight line along it was off by eight times what a fit without the pose is."""
    cell_file, table = simulated(4, "ladder12", (Hidden("tool_play", None, 1.5),)).write(tmp_path)
    cell = read_cell(cell_file)
    data = LoadTest.of(cell, read_measurements(table, cell.robot))
    law = known("tool_play.held")
    assert law is not None
    state = data.load_state(1 / cell.prior.stiffness)
    neutral, typical = law.neutral(state), law.typical(state, None)
    start = np.where(np.arange(len(neutral)) == 0, typical, np.pi / 4)
    model = posterior(data, [Term(law, None, start, typical, neutral)], posterior(data))
    groups = poses(data.rows)
    held = left_out(model, groups)
    # A pose of which nothing was read has nothing left, and nothing is said of it.
    unread = np.where((groups == 3)[:, None], np.nan, data.rows.deflection)
    nothing = left_out(replace(model, data=data.with_rows(replace(data.rows, deflection=unread))), groups)
    assert np.array_equal(np.isnan(nothing).all(axis=1), groups == 3)
    for number in (5, 10):      # the first is the one that the slope was most off for
        out = groups == number
        rest = posterior(data.with_rows(data.rows.select(~out)), model.terms, model)
        assert rms(held[out]) == pytest.approx(rms(rest.residual_of(data.with_rows(data.rows.select(out)))), rel=0.05), number


def test_how_likely_a_pose_is_is_a_normal_density_about_what_the_others_predict(tmp_path) -> None:
    """Of the rows that were fitted, each pose given the others, and of others that were not: written out in full, with the
    noise and what is left open of the springs."""
    cell, rows = simulate(tmp_path, np.random.default_rng(82), poses=5, loads=3, text=NARROW)
    whole, groups = LoadTest.of(cell, rows), poses(rows)
    fresh = groups == 4
    model = posterior(whole)
    each = [density(model, whole, left_out(model, groups), groups == group) for group in range(5)]
    assert left_out_with_density(model, groups)[1] == pytest.approx(sum(each) + model.log_tails, abs=1e-3)
    model = posterior(whole.with_rows(rows.select(~fresh)))
    data = whole.with_rows(rows.select(fresh))
    expected = density(model, data, model.residual_of(data), np.ones(len(data.rows), dtype=bool))
    assert log_density(model, data) == pytest.approx(expected, abs=1e-3)


def density(model: Posterior, data: LoadTest, left: np.ndarray, mine: np.ndarray) -> float:
    """ln normal density of the rows `mine`, but for its constant: of the fitted ones given the rest of them, or of others."""
    fitted = data.rows is model.data.rows
    noise = noise_model(data, model.compliance).with_parts(
        *(part for part in OPTIONAL if model.at_map.noise.active[part]), set_up=model.components.set_up)
    weights, size = noise.weights(model.components, model.row_weight if fitted else None), 3 * len(data.rows)
    sigma = np.linalg.inv(weights.apply(np.eye(size).reshape(-1, 3, size)).reshape(size, size))
    design = (noise.whitening @ response(data, model.map)[1]).reshape(size, -1)
    each = np.repeat(mine, 3)
    others = sigma[np.ix_(~each, ~each)]
    known = design[~each].T @ np.linalg.solve(others, design[~each]) if fitted else model.information
    spread = np.linalg.inv(known + model.prior.precision(model.map))
    covariance = sigma[np.ix_(each, each)] + design[each] @ spread @ design[each].T
    whitened = np.einsum("nij,nj->ni", noise.whitening, left).ravel()[each]
    told = multivariate_normal(np.zeros(each.sum()), 0.5 * (covariance + covariance.T)).logpdf(whitened)
    return float(told + 0.5 * each.sum() * np.log(2 * np.pi))


class Rows:
    """Readings of two poses, two of each, and the model's value and slope there; along the slope one micrometre is left."""

    def __init__(self, rows: np.ndarray, law_um: float) -> None:
        self.number, self.law = rows, law_um

    rows = property(lambda self: self)
    cell = SimpleNamespace(noise=SimpleNamespace(deflection=np.full(3, 1e-6)))

    @property
    def deflection(self) -> np.ndarray:
        return np.full((len(self.number), 3), 5e-6)

    def select(self, mask: np.ndarray) -> Rows:
        return Rows(self.number[mask], self.law)

    def with_rows(self, rows: Rows) -> Rows:
        return rows


@pytest.mark.parametrize(("law_um", "sensor", "again"), [
    (1.29, 0.1, False), (1.31, 0.1, True), (0.78, 0.1, False), (0.76, 0.1, True), (1.58, 2.0, False), (1.62, 2.0, True)])
@pytest.mark.parametrize("converges", [True, False])
def test_a_pose_is_fitted_without_where_the_slope_misses_the_law_by_a_third(
        monkeypatch: pytest.MonkeyPatch, law_um: float, sensor: float, again: bool, converges: bool) -> None:
    """0.3 of the lesser of what each leaves, or of the sensor's noise where that is more: along the slope 1 um is left, by the
    law after the step so much. Where no fit without the pose converges the law's own value counts."""
    fitted: list[list[int]] = []

    def posterior(data: Rows, terms: Any, near: Any) -> Any:
        fitted.append(data.number.tolist())
        if not converges:
            raise error("CS1011", "no")
        return SimpleNamespace(residual_of=lambda rows: np.full((len(rows.number), 3), 7e-6))

    monkeypatch.setattr(held_out, "response", lambda data, x, terms: (np.full((4, 3), 4e-6), np.zeros((4, 3, 1))))
    monkeypatch.setattr(held_out, "predicted_deflection", lambda data, x, terms: data.deflection - 1e-6 * data.law)
    monkeypatch.setattr(held_out, "posterior", posterior)
    prior = SimpleNamespace(precision=lambda x: np.eye(1), gradient=lambda x: np.zeros(1), inside=lambda x: x)
    model: Any = SimpleNamespace(
        at_map=SimpleNamespace(design=np.zeros((4, 3, 1)), residual=np.zeros((4, 3))), prior=prior, map=np.zeros(1),
        data=Rows(np.arange(4), law_um), terms=("a law",), components=SimpleNamespace(sensor=sensor),
        weights=SimpleNamespace(apply=lambda columns: columns))
    held = left_out(model, np.array([0, 0, 1, 1]))
    assert fitted == ([[2, 3], [0, 1]] if again else [])
    np.testing.assert_allclose(held, np.full((4, 3), (7e-6 if converges else 1e-6 * law_um) if again else 1e-6))


def predicted(data: LoadTest, model: Posterior) -> np.ndarray:
    """Readings (n, 3) [m] of the plain springs of a fit, by the finite equilibrium."""
    cell, rows = data.cell, data.rows
    return np.asarray(equilibrium(cell.robot, rows.theta, cell.flange_from_tcp, rows.wrench, np.exp(model.map[:6])).position)

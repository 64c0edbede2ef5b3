"""Patterns that no cause is needed for: row by row what each would show, and how surprising it is by plain projection."""

from __future__ import annotations

from collections import defaultdict
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import stats

from identification.diagnosis.patterns import Pattern, patterns_of
from identification.diagnosis.projection import Base
from identification.fit.load_test import LoadTest
from identification.fit.noise import NoiseModel, noise_model
from identification.model.load_state import LoadState
from tests.identification.fit.test_laws_posterior import simulate

Array = NDArray[np.float64]
BY_VISIT = ("single poses do not yield as the springs say", "the deflection does not turn round with the load",
            "what a load leaves depends on the load before", "zero readings wander within a pose")


@pytest.fixture(scope="module", params=[False, True])
def rows(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> tuple[LoadState, NoiseModel]:
    """Three poses of six rows with forces aslant and of either sign, two of them without load; with times, and without."""
    rng = np.random.default_rng(5)
    cell, table = simulate(tmp_path_factory.mktemp("patterns"), rng, poses=3, loads=6)
    wrench = np.zeros((18, 6))
    wrench[:, :3] = rng.normal(0, 60, (18, 3)) + table.wrench[:, :3]
    wrench[[0, 3, 7, 10, 12, 17]] = 0.0
    time = np.cumsum(rng.uniform(5, 50, 18)) + 1000.0 if request.param else np.full(18, np.nan)
    data = LoadTest.of(cell, replace(table, wrench=wrench, time=time))
    return data.load_state(1 / cell.prior.stiffness), noise_model(data, 1 / cell.prior.stiffness)


def expected(state: LoadState) -> dict[str, list[list[Array]]]:
    """Of each pattern its columns, row by row (3,), to a factor."""
    count = len(state)
    force, torque, axes = state.wrench[:, :3], state.torque, np.eye(3)
    columns: dict[str, list[list[Array]]] = defaultdict(list)
    if np.isnan(state.time[0]):
        order = [row / (count - 1) for row in range(count)]
    else:
        order = [(each - state.time[0]) / (state.time[-1] - state.time[0]) for each in state.time]

    def column(name: str, of_row: Any) -> None:
        columns[name].append([np.asarray(of_row(row)) for row in range(count)])

    def before(values: Array, row: int) -> float:
        return float(values[row - 1]) if row and state.visit[row - 1] == state.visit[row] else 0.0

    strongest = [int(np.argmax(np.abs(each))) for each in force]
    along = np.array([np.sqrt(each @ each) * np.sign(each[axis]) for each, axis in zip(force, strongest, strict=True)])
    for axis in range(3):
        for reading in axes:
            column(BY_VISIT[0], lambda r, a=axis, e=reading: e * along[r] * (strongest[r] == a))
            column(BY_VISIT[1], lambda r, a=axis, e=reading: e * abs(along[r]) * (strongest[r] == a))
            column(BY_VISIT[2], lambda r, a=axis, e=reading: e * np.sign(along[r] - before(along, r)) * (strongest[r] == a))
    for reading in axes:
        column(BY_VISIT[3], lambda r, e=reading: e * (order[r] - 0.5) if not force[r].any() else 0 * e)
        for wave in (1, 2, 3, 4):
            column("the readings wander with time", lambda r, e=reading, w=wave: e * np.cos(np.pi * w * order[r]))
    for k in range(6):
        move, t = state.jacobian[:, :3, k], torque[:, k]
        for power in (2, 3):
            column("a joint's deflection is not proportional to its torque",
                   lambda r, m=move, t=t, p=power: m[r] * np.sign(t[r]) * abs(t[r]) ** p)
        for power in (1, 2):
            column("a joint yields differently to torques of either sign",
                   lambda r, m=move, t=t, p=power: m[r] * abs(t[r]) ** p)
        column("a joint's deflection depends on the torque before",
               lambda r, m=move, t=t: m[r] * np.sign(t[r] - before(t, r)))
        column("a joint's deflection depends on the torque before", lambda r, m=move, t=t: m[r] * before(t, r))
        for turn in (1, 2, 3):
            for wave_of in (np.cos, np.sin):
                column("a joint is softer at some angles than at others",
                       lambda r, m=move, t=t, k=k, n=turn, f=wave_of: m[r] * t[r] * f(n * state.theta[r, k]))
        for wave in (1, 2, 3, 4):
            column("a joint softens or stiffens with time",
                   lambda r, m=move, t=t, w=wave: m[r] * t[r] * np.cos(np.pi * w * order[r]))
    for j in range(3):
        f = force[:, j]
        for reading in axes:
            column("a load along one axis moves the tool in a way no spring explains", lambda r, f=f, e=reading: e * f[r])
            column("a load along one axis moves the tool in a way no spring explains", lambda r, f=f, e=reading: e * abs(f[r]))
            column("a load along one axis leaves something behind",
                   lambda r, f=f, e=reading: e * np.sign(f[r] - before(f, r)))
            column("a load along one axis leaves something behind", lambda r, f=f, e=reading: e * before(f, r))
        own = np.array([state.tool[r, :, j] @ force[r] for r in range(count)])
        for shape in (lambda x: x, abs, np.sign):
            column("tool or spindle move in a way no spring explains",
                   lambda r, j=j, s=shape, own=own: state.tool[r, :, j] * s(own[r]))
        for turn_of in (lambda q: 1.0, np.cos, np.sin):
            # A force along an axis as large as the load, through the springs.
            column("a load brings another force along",
                   lambda r, j=j, f=turn_of: state.jacobian[r, :3] @ (state.compliance * state.jacobian[r, j]) * np.sqrt(
                       force[r] @ force[r]) * f(state.theta[r, 0]))
    return columns


def alike(found: Array, told: Array) -> bool:
    """The same columns (n, m) but for their order and a factor each."""
    cosines = np.abs((found / np.linalg.norm(found, axis=0)).T @ (told / np.linalg.norm(told, axis=0)))
    best = cosines.argmax(axis=1)
    return found.shape == told.shape and len(set(best)) == len(best) and bool(np.all(cosines.max(axis=1) > 1 - 1e-9))


def test_each_pattern_is_what_its_words_say_row_by_row(rows: tuple[LoadState, NoiseModel]) -> None:
    """A column that a single row shows, of a pose or of all, is none."""
    state, noise = rows
    told = expected(state)
    found = {pattern.name: pattern for pattern in patterns_of(state, noise)}
    assert set(found) == set(told)
    for name, pattern in found.items():
        columns = np.array(told[name]).transpose(1, 2, 0)
        assert pattern.by_visit == (name in BY_VISIT)
        shown = np.any(np.abs(columns) > 1e-12 * np.abs(columns).max(), axis=1)
        visits = [state.visit == number for number in range(3)] if pattern.by_visit else [np.ones(len(state), dtype=bool)]
        seen = np.array([shown[mine].sum(axis=0) > 1 for mine in visits])
        kept = seen.any(axis=0)
        assert pattern.seen.sum() == seen.sum(), name
        assert alike(pattern.columns.reshape(-1, pattern.columns.shape[2]),
                     noise.whitened(columns[:, :, kept]).reshape(-1, int(kept.sum()))), name


def test_rows_without_a_load_show_what_wanders_alone(rows: tuple[LoadState, NoiseModel]) -> None:
    state, noise = rows
    still = replace(state, wrench=np.zeros((len(state), 6)))
    assert {pattern.name for pattern in patterns_of(still, noise)} == {BY_VISIT[3], "the readings wander with time"}


@pytest.mark.parametrize("by_visit", [False, True])
@pytest.mark.parametrize(("apart", "kept"), [(0.009, False), (0.0115, True)])
def test_a_pattern_is_as_surprising_as_its_scores_beside_the_model(by_visit: bool, apart: float, kept: bool) -> None:
    """The sum of the squared scores, each of variance one, as a chi-squared with the mean and the variance that the replicates
    have. A column that the model explains but for a ten-thousandth of its square says nothing."""
    rng = np.random.default_rng(3)
    visit = np.repeat([0, 1], 6)
    count = len(visit)
    design, columns = rng.standard_normal((count, 3, 2)), rng.standard_normal((count, 3, 3))
    flat, precision = design.reshape(-1, 2), np.diag([0.5, 2.0]) if by_visit else 1e-12 * np.eye(2)
    of_model = np.linalg.inv(flat.T @ flat + precision)
    every = [visit == 0, visit == 1] if by_visit else [np.ones(count, dtype=bool)]
    # All of the last column is a spring's but for a share of what no spring does.
    outside = np.linalg.svd(flat, full_matrices=True)[0][:, 2].reshape(count, 3)
    columns[:, :, 2] = design[:, :, 0] + apart * np.linalg.norm(design[:, :, 0]) * outside / np.linalg.norm(outside)
    weights: Any = SimpleNamespace(apply=lambda each: each)
    base = Base(design, np.zeros((count, 3)), weights, precision, np.zeros(2))
    noise: Any = SimpleNamespace(
        by_visit=lambda values: np.array([values[mine].sum(axis=0) for mine in every]),
        products=lambda left, right: np.array([np.einsum("nap,naq->pq", left[mine], right[mine]) for mine in every]))
    left = rng.standard_normal((3 * count, 400))
    left[:, 0] += 1.5 * columns[:, :, 1].ravel()
    variance = rng.uniform(0.8, 1.2, 400)
    total = np.zeros(400)
    counted = 0
    for mine in every:
        rows = np.repeat(mine, 3)
        for k in range(3):
            column = np.where(rows, columns[:, :, k].ravel(), 0.0)
            free = column @ column - column @ flat @ of_model @ flat.T @ column
            if free / (column @ column) > 1e-4:
                counted += 1
                total += (column @ left) ** 2 / free
    total /= variance
    assert counted == (6 if by_visit else 3 if kept else 2)
    mean, spread = total[1:].mean(), total[1:].var()
    told = -stats.chi2.logsf(total * 2 * mean / spread, 2 * mean**2 / spread) / np.log(10)
    pattern = Pattern("", columns, noise, by_visit, np.ones((len(every), 3), dtype=bool))
    np.testing.assert_allclose(pattern.surprise(base, left, variance), told, rtol=1e-6, atol=1e-9)
    nothing = replace(pattern, columns=design[:, :, :1] if not by_visit else 0 * columns[:, :, :1],
                      seen=np.ones((len(every), 1), dtype=bool))
    assert not nothing.surprise(base, left, variance).any()

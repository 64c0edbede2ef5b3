"""Weights that swing: how likely their scatter is by normal densities of all readings of a pose, and what is allowed for it."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.linalg import null_space
from scipy.optimize import minimize
from scipy.stats import chi2, multivariate_normal

from identification.diagnosis.swing import Swing, _groups, _Sizes, _Visits, swing_of
from identification.fit.load_test import LoadTest
from identification.model.load_state import LoadState
from tests.identification.fit.exact_rows import by_compliance
from tests.identification.fit.test_laws_posterior import TRUE, simulate

Array = NDArray[np.float64]
BARE = "robot: irb6660-205-1.90\ntool: {position_mm: [120, 0, 250]}\nmeasurement: {deflection_std_um: [2, 3, 4]}\n"
# Poses with so many rows; the weights of each, in newtons, down.
POSES = (4, 4, 5, 2, 3)
LOADS = (0.0, 100.0, 200.0, 300.0, 0.0, 150.0, 150.0, 300.0, 0.0, 50.0, 100.0, 200.0, 300.0, 100.0, 200.0, 0.0, 0.0, 0.0)


@pytest.fixture(scope="module")
def hung(tmp_path_factory: pytest.TempPathFactory) -> tuple[LoadTest, LoadState, Array]:
    """The rows, and what a newton in each direction does in each of them (n, 3, 3) [m/N], by the independent arm."""
    cell, rows = simulate(tmp_path_factory.mktemp("swing"), np.random.default_rng(2), poses=len(LOADS), loads=1, text=BARE)
    visit = np.repeat(np.arange(len(POSES)), POSES)
    wrench = np.zeros((len(LOADS), 6))
    wrench[:, 2] = -np.array(LOADS)
    data = LoadTest.of(cell, replace(rows, theta=rows.theta[visit], wrench=wrench, visit=visit))
    does = np.stack([by_compliance(data.rows.theta, cell.flange_from_tcp.position, np.tile(axis, (len(LOADS), 1))) @ (1 / TRUE)
                     for axis in np.eye(3)], axis=2)
    return data, data.load_state(1 / TRUE), does


def test_how_likely_sizes_are_is_a_normal_density_of_what_a_pose_s_own_response_leaves(
        hung: tuple[LoadTest, LoadState, Array]) -> None:
    """Sensors, an error of the force in every direction, one along the load and one across, of each loaded row by itself; a
    constant and what goes with the load are the pose's own. A pose of two rows, or without a load, tells nothing; nor does a
    row of which a component was not read."""
    data, state, does = hung
    rng = np.random.default_rng(4)
    residual = 5e-6 * rng.standard_normal((len(LOADS), 3))
    residual[6, 1] = np.nan
    fitted: Any = SimpleNamespace(data=data, load_state=state, residual=residual, compliance=1 / TRUE)
    groups = _groups(fitted)
    told = {0: [0, 1, 2, 3], 1: [4, 5, 7], 2: [8, 9, 10, 11, 12]}
    sizes = _Sizes(groups, np.log([1.0, 0.5, 0.005, 0.01]))
    down, load = np.array([0.0, 0.0, -1.0]), np.array(LOADS)

    def by_hand(squared: Array) -> float:
        total = 0.0
        for rows in told.values():
            every = np.zeros((3 * len(rows), 3 * len(rows)))
            for place, row in enumerate(rows):
                across = np.eye(3) - np.outer(down, down)
                own = squared[0] * np.diag([2e-6, 3e-6, 4e-6]) ** 2 + does[row] @ (
                    squared[1] * (load[row] > 0) * np.eye(3) + squared[2] * load[row] ** 2 * np.outer(down, down)
                    + squared[3] * load[row] ** 2 * across) @ does[row].T
                every[3 * place: 3 * place + 3, 3 * place: 3 * place + 3] = own
            common = np.column_stack([np.ones(len(rows)), load[rows]])
            # Each component by itself: its own unit, and its own constant and slope.
            left = np.kron(null_space(common.T).T, np.eye(3))
            total += multivariate_normal(np.zeros(len(left)), left @ every @ left.T).logpdf(left @ residual[rows].ravel())
        return total

    logs = [np.log([1.0, 0.5, 0.005, 0.01]), np.log([1.3, 0.2, 0.01, 0.02]), np.log([0.8, 0.7, 0.004, 0.1])]
    found = np.array([sizes.by_visit(each).sum() for each in logs])
    wanted = np.array([by_hand(np.exp(2 * each)) for each in logs])
    np.testing.assert_allclose(found - found[0], wanted - wanted[0], rtol=1e-3, atol=1e-3)
    without = sizes.by_visit(logs[1][:3]).sum()
    assert without - found[0] == pytest.approx(by_hand(np.append(np.exp(2 * logs[1][:3]), 0.0)) - wanted[0], abs=1e-3, rel=1e-3)
    assert sum(len(group.values) for group in groups) == 3


def test_a_swing_is_in_the_sigmas_as_side_forces_in_both_directions(hung: tuple[LoadTest, LoadState, Array]) -> None:
    """Of so many radians of the load each; what hangs not at all scatters no more than the sensors."""
    data, state, does = hung
    fitted: Any = SimpleNamespace(compliance=1 / TRUE, load_state=state)
    allowed = Swing(0.02, 0.25, 1e-4, 3e-5).allowed_for(data, fitted)
    side = 0.02 * np.array(LOADS)[:, None]
    squared = np.array([2e-6, 3e-6, 4e-6]) ** 2 + (side * does[:, :, 0]) ** 2 + (side * does[:, :, 1]) ** 2
    np.testing.assert_allclose(allowed.rows.sigma, np.sqrt(squared), rtol=1e-4)
    np.testing.assert_array_equal(allowed.rows.deflection, data.rows.deflection)


@pytest.mark.parametrize("stated", [0.0, 2.0])
def test_a_swing_is_found_with_its_size_and_how_seldom_chance_has_it(
        hung: tuple[LoadTest, LoadState, Array], stated: float) -> None:
    """Side forces of 3 % of the load in ten visits of six rows: half a chi-squared of one degree by twice the difference of the
    two largest likelihoods; the largest displacement in the row that a newton aside moves most. A stated error of the force is
    what is believed of it."""
    base, _, does = hung
    visit, which = np.repeat(np.arange(10), 6), np.repeat(np.linspace(0, 17, 10).astype(int), 6)
    load = np.tile([0.0, 100.0, 200.0, 300.0, 150.0, 0.0], 10)
    wrench = np.zeros((60, 6))
    wrench[:, 2] = -load
    noise = replace(base.cell.noise, force=np.full(3, stated), force_relative=0.01 * stated)
    rows = replace(base.rows, theta=base.rows.theta[which], wrench=wrench, visit=visit,
                   sigma=np.full((60, 3), np.nan), deflection=np.zeros((60, 3)))
    data = replace(base, cell=replace(base.cell, noise=noise), rows=rows)
    rng = np.random.default_rng(8)
    aside = 0.03 * load[:, None] * rng.standard_normal((60, 2))
    swung = np.einsum("nij,nj->ni", does[which][:, :, :2], aside)
    residual = np.array([2e-6, 3e-6, 4e-6]) * rng.standard_normal((60, 3)) + swung
    fitted: Any = SimpleNamespace(data=data, load_state=data.load_state(1 / TRUE), residual=residual, compliance=1 / TRUE)
    found = swing_of(fitted)
    assert found is not None
    assert abs(np.log(found.size / 0.03)) < 3 * found.log_std < 0.6
    moved = np.sqrt(np.sum(does[which, :, 0] ** 2, axis=1) + np.sum(does[which, :, 1] ** 2, axis=1)) * load * found.size
    assert found.largest == pytest.approx(moved.max(), rel=1e-3)
    start = np.log([1.0, stated or 0.5, 0.01 * stated or 0.005, 0.01])
    sizes = _Sizes(_groups(fitted), start)

    def cost(logs: Array) -> float:
        return float(0.5 * np.sum(((logs[1:3] - start[1:3]) / 0.7) ** 2) - sizes.by_visit(logs).sum())

    without, best = (minimize(cost, start[:count], method="Powell", options={"ftol": 1e-10}) for count in (3, 4))
    assert found.size == pytest.approx(np.exp(best.x[3]), rel=0.02)
    assert found.p_value == pytest.approx(0.5 * chi2.sf(2 * (without.fun - best.fun), 1), rel=0.02)
    step = 0.05 * np.eye(4)[3]
    further = cost(best.x + step) + cost(best.x - step) - 2 * cost(best.x)
    assert found.log_std == pytest.approx(0.05 / np.sqrt(further), rel=0.03)
    quiet: Any = SimpleNamespace(**(vars(fitted) | {"residual": residual - swung}))
    assert swing_of(quiet) is None


@pytest.mark.parametrize("loudest", range(6))
def test_the_visit_that_speaks_most_for_a_swing_is_left_out(loudest: int) -> None:
    """Of one, two and three visits that each have one number in the noise of a sensor and of a swing: the largest, nine times
    as large as the others."""
    values = np.where(np.arange(6) == loudest, 9.0, [1.0, 1.01, 1.02, 1.03, 1.04, 1.05])
    groups = tuple(_Visits(each[:, None], np.tile(np.array([1.0, 0, 0, 1])[:, None, None], (len(each), 1, 1, 1)))
                   for each in np.split(values, [1, 3]))
    sizes = _Sizes(groups, np.log([1.0, 0.5, 0.005, 1.0]))
    vars(sizes).update(without=(np.zeros(3), 0.0), best=(np.zeros(4), 0.0))
    left = sizes.without_loudest()
    assert np.concatenate([group.values[:, 0] for group in left.groups]).tolist() == np.delete(values, loudest).tolist()
    assert [len(group.values) for group in left.groups] == [len(group.parts) for group in left.groups]
    assert len(left.groups) == (2 if loudest == 0 else 3)
    np.testing.assert_array_equal(left.start, sizes.start)

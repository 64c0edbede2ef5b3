"""Whether forces were set up anew at each visit, and whether the sensor remembers: how likely each way is, against sums over a
fine grid of sizes with dense covariance matrices."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.stats import halfcauchy, multivariate_normal, norm

from identification.fit.linearised import Linearised
from identification.fit.load_test import LoadTest
from identification.fit.noise import NoiseModel
from identification.fit.noise_parts import SETUP, SetUp, VarianceComponents
from identification.fit.optional_parts import Way, asked_for, averaged_trials
from identification.fit.posterior import posterior
from identification.measurements import read_measurements
from identification.model.cell import read_cell
from identification.model.compliance import equilibrium
from tests.support import random_poses

VISITS, ROWS = 4, 5
COUNT = VISITS * ROWS
VISIT = np.repeat(np.arange(VISITS), ROWS)
# Sizes in usual ones; what a set-up of the usual size does to a row, in sigmas of the sensor.
SENSOR, OPTIONAL = np.exp(np.linspace(-0.8, 1.0, 19)), np.exp(np.linspace(-4.6, 6.0, 41))
USUAL = 0.15


def noise() -> NoiseModel:
    """Nothing but the sensor, and what set-ups do to rows whose loads grow."""
    setups = np.zeros((COUNT, 3, 9))
    for k in range(9):
        setups[:, k % 3, k] = USUAL * np.tile(np.linspace(-1, 1, ROWS), VISITS) * (1 + k // 3)
    nothing = np.zeros((COUNT, 3, 3))
    return NoiseModel(np.tile(np.eye(3), (COUNT, 1, 1)), nothing, nothing, setups, np.ones((COUNT, 3), dtype=bool), VISIT,
                      np.zeros(3), (False,) * 6, (True, False, False, False, False, False))


def covariance(setups: np.ndarray, sensor: float, setup: float, rho: float) -> np.ndarray:
    """Dense (60, 60) of all readings, row by row, x y z."""
    same = VISIT[:, None] == VISIT
    apart = np.abs(np.subtract.outer(np.arange(COUNT), np.arange(COUNT)))
    own = sensor**2 * np.kron(np.where(same, rho**apart, 0.0), np.eye(3))
    shared = np.kron(same, np.ones((3, 3))) * (setups.reshape(3 * COUNT, -1) @ setups.reshape(3 * COUNT, -1).T)
    return own + setup**2 * shared


def evidence(residual: np.ndarray, design: np.ndarray, setups: np.ndarray | None, memory: bool) -> float:
    """Likelihood of the readings over all sizes, ln: sensor normal in ln with a scale of 0.7, heavier above as it is by
    contract, x normal of 1 sigma."""
    springs = design.reshape(3 * COUNT, -1)
    logs = np.log(SENSOR)
    heavier = (1 + (logs / 0.7) ** 2 / 4) ** -2.5
    sensor_prior = np.where(logs < 0, norm.pdf(logs / 0.7) / norm.pdf(0), heavier)
    optional = halfcauchy(scale=2.0).pdf(OPTIONAL) * OPTIONAL * np.log(OPTIONAL[1] / OPTIONAL[0])
    total = 0.0
    for size, weight in zip(OPTIONAL, optional, strict=True) if setups is not None or memory else [(0.0, 1.0)]:
        rho = 0.1 * size / (1 + 0.1 * size) if memory else 0.0
        base = covariance(np.zeros((COUNT, 3, 1)) if setups is None else setups, 1.0, 0.0, rho)
        for sensor, prior in zip(SENSOR, sensor_prior, strict=True):
            shared = covariance(setups, 0.0, size, 0.0) if setups is not None else 0.0
            dense = sensor**2 * base + shared + springs @ springs.T
            total += weight * prior * np.exp(multivariate_normal(np.zeros(3 * COUNT), dense).logpdf(residual.ravel()) + 60.0)
    return float(np.log(total))


# Long: the same where nothing was set up anew, or each component by itself.
@pytest.mark.parametrize(("setup", "sized"), [
    *(pytest.param(size, False, marks=pytest.mark.long) for size in (0.0, 2.0, 5.0)), (5.0, True)])
def test_each_way_weighs_what_it_is_worth(setup: float, sized: bool) -> None:
    rng, model = np.random.default_rng(12), noise()
    design = rng.normal(size=(COUNT, 3, 2))
    stretched = model.setups[:, :, ::4]
    in_size = stretched.sum(axis=2, keepdims=True)
    drawn = covariance(in_size if sized else stretched, 1.0, setup, 0.0)
    residual = rng.multivariate_normal(np.zeros(3 * COUNT), drawn).reshape(COUNT, 3)
    prior: Any = SimpleNamespace(precision=lambda x: np.eye(2), gradient=lambda x: np.zeros(2))
    at = Linearised(model, design, residual, np.ones(COUNT), prior, np.zeros(2))
    trials = averaged_trials(at, VarianceComponents(), np.zeros((COUNT, 3, 0)))
    of_kinds = [evidence(residual, design, each, False) - np.log(3.0) for each in (in_size, stretched, model.setups)]
    kinds = [trials.weight[(trials.set_up == kind) & (trials.logs[:, 4] > -4.59) & (trials.logs[:, 5] <= -4.59)].sum()
             for kind in SetUp]
    likely = np.array(of_kinds) > max(of_kinds) - 3
    assert_allclose(np.log(np.array(kinds)[likely] / max(kinds)), np.array(of_kinds)[likely] - max(of_kinds), atol=0.15)
    ways = {(True, False): np.logaddexp.reduce(of_kinds),
            (False, True): evidence(residual, design, None, True), (False, False): evidence(residual, design, None, False)}
    share = {way: float(trials.weight[np.all((trials.logs[:, 4:] > -4.59) == way, axis=1)].sum()) for way in ways}
    assert trials.weight.sum() == pytest.approx(1)
    best = max(ways, key=lambda way: ways[way])
    for way, value in ways.items():
        if value > ways[best] - 4:
            assert np.log(share[way] / share[best]) == pytest.approx(value - ways[best], abs=0.15), way
        else:
            assert share[way] < 0.02, way


@pytest.mark.parametrize("kind", SetUp)
def test_the_way_that_is_asked_for_is_the_one_that_set_ups_follow(kind: SetUp) -> None:
    """Forces off by one share, each component by its own, or turned as well: taken for another way they pass for a cause. Where
    visits are alike none is asked for."""
    rng, model = np.random.default_rng(18), noise()
    stretched = model.setups[:, :, ::4]
    loading = {SetUp.SIZED: stretched.sum(axis=2, keepdims=True), SetUp.STRETCHED: stretched, SetUp.TURNED: model.setups}[kind]
    prior: Any = SimpleNamespace(precision=lambda x: np.eye(2), gradient=lambda x: np.zeros(2))
    design, none = rng.normal(size=(COUNT, 3, 2)), rng.normal(size=(COUNT, 3))
    drawn = none + 10.0 * np.einsum("nik,nk->ni", loading, rng.normal(size=(VISITS, loading.shape[2]))[VISIT])
    for residual in (none, drawn):
        at = Linearised(model, design, residual, np.ones(COUNT), prior, np.zeros(2))
        asked = asked_for(at, VarianceComponents(), np.zeros((COUNT, 3, 0)))
        # Where they differ by so much the neighbours in a visit are alike, too.
        assert (asked == Way((), SetUp.TURNED)) == (residual is none)
        assert residual is none or (SETUP in asked.parts and asked.set_up == kind)


def test_what_the_arm_s_weight_does_asks_for_no_other_set_ups() -> None:
    """Set-ups that stretch or turn the force otherwise at each pose would explain it as well, with as many numbers as there are
    poses (stretched by 35 usual sizes: ln 1.0 better than turned by 20)."""
    rng, model = np.random.default_rng(21), noise()
    in_size = model.setups[:, :, ::4].sum(axis=2, keepdims=True)
    pattern = rng.normal(size=(VISITS, 9, 3))
    weight = 20.0 * np.einsum("nik,nkm->nim", model.setups, pattern[VISIT])
    sized = 5.0 * in_size[:, :, 0] * rng.normal(size=VISITS)[VISIT][:, None]
    residual = rng.normal(size=(COUNT, 3)) + sized + weight @ rng.normal(size=3)
    prior: Any = SimpleNamespace(precision=lambda x: np.eye(2), gradient=lambda x: np.zeros(2))
    at = Linearised(model, rng.normal(size=(COUNT, 3, 2)), residual, np.ones(COUNT), prior, np.zeros(2))
    assert asked_for(at, VarianceComponents(), weight).set_up == SetUp.SIZED
    assert asked_for(at, VarianceComponents(), weight[:, :, :0]).set_up == SetUp.STRETCHED


def test_a_weight_is_as_heavy_at_every_pose(tmp_path: Path) -> None:
    """Readings that are stretched from pose to pose by some per cent: loads set up anew may do that, known masses may not."""
    (tmp_path / "cell.yaml").write_text("robot: irb6660-205-1.90\ntool: {position_mm: [120, 0, 250]}\n"
                                        "measurement: {deflection_std_um: [2, 2, 2]}\n")
    cell, rng = read_cell(tmp_path / "cell.yaml"), np.random.default_rng(4)
    theta, mass = np.repeat(random_poses(cell.robot, 9, rng, 0.6), 5, axis=0), np.tile([20, 40, 60, 40, 20], 9)
    pull = np.outer(mass * 9.80665, [0, 0, -1, 0, 0, 0])
    read = equilibrium(cell.robot, theta, cell.flange_from_tcp, pull, 1 / cell.prior.stiffness).position
    read = read * np.repeat(rng.normal(1.0, 0.03, 9), 5)[:, None] + rng.normal(0, 2e-6, read.shape)

    def set_up_anew(columns: str, loads: np.ndarray) -> bool:
        table = np.column_stack([np.degrees(theta), loads, 1e6 * read])
        lines = ["q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg," + columns + ",dx_um,dy_um,dz_um",
                 *(",".join(f"{value:.9g}" for value in row) for row in table)]
        (tmp_path / "m.csv").write_text("\n".join(lines) + "\n")
        return posterior(LoadTest.of(cell, read_measurements(tmp_path / "m.csv", cell))).at_map.noise.active[SETUP]

    assert set_up_anew("fx_n,fy_n,fz_n", pull[:, :3])
    assert not set_up_anew("mass_kg", mass[:, None])

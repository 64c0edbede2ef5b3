"""Whether forces were set up anew at each visit, and whether the sensor remembers: how likely each way is, against sums over a
fine grid of sizes with dense covariance matrices."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.stats import halfcauchy, multivariate_normal, norm

from identification.fit.linearised import Linearised
from identification.fit.noise import NoiseModel, VarianceComponents
from identification.fit.optional_parts import averaged_trials

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


@pytest.mark.parametrize("setup", [0.0, 2.0, 5.0])
def test_each_way_weighs_what_it_is_worth(setup: float) -> None:
    rng, model = np.random.default_rng(12), noise()
    design = rng.normal(size=(COUNT, 3, 2))
    stretched = model.setups[:, :, ::4]
    residual = rng.multivariate_normal(np.zeros(3 * COUNT), covariance(stretched, 1.0, setup, 0.0)).reshape(COUNT, 3)
    prior: Any = SimpleNamespace(precision=lambda x: np.eye(2), gradient=lambda x: np.zeros(2))
    at = Linearised(model, design, residual, np.ones(COUNT), prior, np.zeros(2))
    trials = averaged_trials(at, VarianceComponents(), np.zeros((COUNT, 3, 0)))
    ways = {(True, False): np.logaddexp(*[evidence(residual, design, each, False) - np.log(2.0)
                                          for each in (model.setups, stretched)]),
            (False, True): evidence(residual, design, None, True), (False, False): evidence(residual, design, None, False)}
    share = {way: float(trials.weight[np.all((trials.logs[:, 4:] > -4.59) == way, axis=1)].sum()) for way in ways}
    assert trials.weight.sum() == pytest.approx(1)
    best = max(ways, key=lambda way: ways[way])
    for way, value in ways.items():
        if value > ways[best] - 4:
            assert np.log(share[way] / share[best]) == pytest.approx(value - ways[best], abs=0.15), way
        else:
            assert share[way] < 0.02, way

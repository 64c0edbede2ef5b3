"""Where the search for the likeliest springs begins: the linear model z = A c of the rows, and what it refuses."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from identification.common.findings import error
from identification.fit.load_test import LoadTest
from identification.fit.noise import noise_model
from identification.fit.noise_parts import VarianceComponents
from identification.fit.priors import PriorModel
from identification.model.compliance import regressor

Array = NDArray[np.float64]


def start_of(data: LoadTest, readings: Array) -> Array:
    """MAP (eq. 12) of the linear model z = A c with the stated noise: damped Gauss-Newton in ln c from the prior's median."""
    lognormal = PriorModel(data.prior.prior)
    x = -np.log(lognormal.prior.stiffness)
    noise, columns = noise_model(data, np.exp(x)), _regressor(data)
    weights = noise.weights(VarianceComponents())
    a = noise.whitening @ columns
    information = weights.inner(a, a)
    projected = weights.inner(a, np.einsum("nij,nj->ni", noise.whitening, readings)[:, :, None])[:, 0]

    def objective(x: Array) -> float:
        c = np.exp(x)
        return float(c @ information @ c - 2 * projected @ c + 2 * lognormal.value(x))

    damping, value = 1e-3, objective(x)
    for _ in range(200):
        c = np.exp(x)
        gradient = c * (projected - information @ c) - lognormal.gradient(x)
        curvature = c[:, None] * information * c + lognormal.precision(x)
        step = np.linalg.solve(curvature + damping * np.diag(np.diag(curvature)), gradient)
        step *= min(1.0, 2.0 / max(np.max(np.abs(step)), 1e-300))
        trial = objective(x + step)
        if trial <= value:
            finished = value - trial < 1e-9 * (1 + abs(value))
            x, value, damping = x + step, trial, 0.2 * damping
            if finished:
                break
        else:
            damping = 5 * damping + 1e-12
    return x


def check_sign(data: LoadTest, readings: Array) -> None:
    """Refuses (CS1010) data that the prior's deflections explain best with a negative factor, joint by joint and in all."""
    prior_compliance = 1 / data.cell.prior.stiffness
    noise = noise_model(data, prior_compliance)
    weights = noise.weights(VarianceComponents())
    shape = noise.whitening @ (_regressor(data) * prior_compliance)
    reading = np.einsum("nij,nj->ni", noise.whitening, readings)[:, :, None]
    along, strength = weights.inner(shape, reading)[:, 0], np.sqrt(np.diag(weights.inner(shape, shape)))
    whole = shape.sum(axis=2, keepdims=True)
    factor = float(weights.inner(whole, reading)[0, 0] / weights.inner(whole, whole)[0, 0])
    seen = strength > 3
    if seen.any() and factor < 0 and np.all(along[seen] < 0):
        raise error("CS1010", f"the data prefer all compliances negative: the tool moved against the force (best factor on "
                    f"the expected deflections {factor:.2f})", file=data.rows.source,
                    hint="forces are those that act ON the tool; deflection is loaded minus unloaded position")


def _regressor(data: LoadTest) -> Array:
    """A (n, 3, 6) of the linear model z = A c."""
    return regressor(data.cell.robot, data.rows.theta, data.cell.flange_from_tcp, data.rows.wrench)[:, :3]

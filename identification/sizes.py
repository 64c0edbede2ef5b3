"""The sizes of the noise's parts from the data: the likeliest, and how well they are known (noise.py)."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from identification.noise import NoiseModel, NoiseSize, log_prior, restricted_log_likelihood
from identification.priors import PriorModel

Array = NDArray[np.float64]

# The noise sizes are estimated from at most so many rows, taken as whole pose visits evenly over the file.
NOISE_ROWS = 6000


def _subset(noise: NoiseModel) -> NDArray[np.bool_]:
    """Rows from which the noise sizes are estimated: all, or whole visits evenly over a long file."""
    count = len(noise.visit)
    if count <= NOISE_ROWS:
        return np.ones(count, dtype=bool)
    every = int(np.ceil(count / NOISE_ROWS))
    number = noise.visit if noise.visits >= 2 * every else np.arange(count)
    return np.asarray(number % every == 0)


def size_objective(
    noise: NoiseModel, size: NoiseSize, row_weight: Array, design: Array, residual: Array, prior: PriorModel, x: Array
) -> Callable[[Array], float]:
    """Minus the ln posterior of the logarithms (3,) of the noise sizes. All are free: where the rows cannot tell two parts
    apart, their priors share the residual out, and the spread says how little is known."""
    rows = _subset(noise)
    _, visit = np.unique(noise.visit[rows], return_inverse=True)
    part = NoiseModel(noise.rotation[rows], noise.force[rows], noise.measured[rows], visit.astype(np.intp), noise.offset,
                      noise.stated)
    precision = prior.precision(x)
    shift = np.asarray(-np.linalg.solve(precision, prior.gradient(x)), dtype=float)
    # The prior on the step counts as often as the rows are thinned.
    share = rows.mean()

    def objective(logs: Array) -> float:
        trial = size.with_logs(np.clip(logs, -7.0, 7.0))
        return -restricted_log_likelihood(part, trial, row_weight[rows], design[rows], residual[rows], share * precision,
                                          shift) - log_prior(part, trial)

    return objective


def fit_sizes(
    noise: NoiseModel, size: NoiseSize, row_weight: Array, design: Array, residual: Array, prior: PriorModel, x: Array
) -> NoiseSize:
    """The likeliest noise sizes, the stiffnesses integrated out."""
    from scipy.optimize import minimize

    objective = size_objective(noise, size, row_weight, design, residual, prior, x)
    start = size.logs
    found = minimize(objective, start, method="Nelder-Mead", options={
        "initial_simplex": np.concatenate([start[None], start + 0.4 * np.eye(3)]), "xatol": 5e-3, "fatol": 5e-3, "maxfev": 200})
    return size.with_logs(np.clip(found.x, -7.0, 7.0))


def size_spread(
    noise: NoiseModel, size: NoiseSize, row_weight: Array, design: Array, residual: Array, prior: PriorModel, x: Array
) -> Array:
    """Covariance (3, 3) of the logarithms of the noise sizes, from the curvature of their posterior."""
    objective = size_objective(noise, size, row_weight, design, residual, prior, x)
    step, here, unit = 0.1, size.logs, np.eye(3)
    hessian, centre = np.empty((3, 3)), objective(here)
    for i in range(3):
        for j in range(i + 1):
            a, b = step * unit[i], step * unit[j]
            if i == j:
                hessian[i, i] = (objective(here + a) - 2 * centre + objective(here - a)) / step**2
            else:
                hessian[i, j] = hessian[j, i] = (objective(here + a + b) - objective(here + a - b) - objective(here - a + b)
                                                 + objective(here - a - b)) / (4 * step**2)
    eigenvalues, vectors = np.linalg.eigh(hessian)
    # A size that the data leave open is known to a factor e at best.
    return np.asarray((vectors / np.maximum(eigenvalues, 1.0)) @ vectors.T)

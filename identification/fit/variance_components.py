"""The noise's variance components from the data: the likeliest, and many that may be, each as likely as it is (noise.py).

They enter as logarithms of their square roots, as multiples of what is stated (`VarianceComponents.logs`).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from identification.fit.gram import NoiseGram
from identification.fit.linearised import Linearised
from identification.fit.noise import NoiseModel, VarianceComponents
from identification.fit.variance_prior import log_prior

Array = NDArray[np.float64]

# The components are estimated from at most so many rows, taken as whole pose visits evenly over the file.
NOISE_ROWS = 6000
LARGEST_LOG = 7.0
# Components that are tried for the posterior: so many, fewer where each costs many rows.
TRIALS, FEWEST_TRIALS, TRIAL_ROWS = 512, 64, 200_000
# Wider than the curvature says, and with heavier tails: trials must cover what is there.
TRIAL_STRETCH, TRIAL_DEGREES = 1.3, 4.0


@dataclass(frozen=True, eq=False)
class Trials:
    """Components as likely as their weight (S,) says: logs (S, 3); gram (S, q, q) of the rows with these components, None where
    they were told from a part of the rows."""

    logs: Array
    weight: Array
    gram: Array | None


class ComponentPosterior:
    """ln posterior of the logarithms of the components, the parameters x integrated out (Laplace). All three are free:
    where the rows cannot tell two parts apart, their priors share the residual out."""

    def __init__(self, at: Linearised) -> None:
        noise, rows = at.noise, _subset(at.noise)
        self.whole = bool(rows.all())
        _, visit = np.unique(noise.visit[rows], return_inverse=True)
        self._noise = noise if self.whole else NoiseModel(
            noise.rotation[rows], noise.force[rows], noise.measured[rows], visit.astype(np.intp), noise.offset, noise.stated)
        self._gram = NoiseGram(self._noise, at.row_weight[rows], at.design[rows], at.residual[rows])
        # The prior on the step counts as often as the rows are thinned.
        self._precision = rows.mean() * at.prior.precision(at.x)
        self._pull = rows.mean() * -at.prior.gradient(at.x)
        self.rows = int(rows.sum())

    def __call__(self, logs: Array) -> tuple[Array, Array]:
        """ln posterior (S,) of logs (S, 3), and the gram (S, q, q) of the rows."""
        logs = np.clip(logs, -LARGEST_LOG, LARGEST_LOG)
        gram, log_determinant = self._gram(logs)
        information = gram[:, :-1, :-1] + self._precision
        pull = gram[:, :-1, -1] + self._pull
        step = np.linalg.solve(information, pull[:, :, None])[:, :, 0]
        _, log_volume = np.linalg.slogdet(information)
        gained = np.einsum("sp,sp->s", pull, step) - gram[:, -1, -1]
        return 0.5 * (gained - log_determinant - log_volume) + log_prior(self._noise, logs), gram


def _subset(noise: NoiseModel) -> NDArray[np.bool_]:
    """Rows from which the components are estimated: all, or whole visits evenly over a long file."""
    count = len(noise.visit)
    if count <= NOISE_ROWS:
        return np.ones(count, dtype=bool)
    every = int(np.ceil(count / NOISE_ROWS))
    number = noise.visit if noise.visits >= 2 * every else np.arange(count)
    return np.asarray(number % every == 0)


def likeliest(posterior: ComponentPosterior, components: VarianceComponents) -> VarianceComponents:
    """The likeliest components, searched from those given."""
    from scipy.optimize import minimize

    def objective(logs: Array) -> float:
        return -float(posterior(logs[None])[0][0])

    start = components.logs
    minimum = minimize(objective, start, method="Nelder-Mead", options={
        "initial_simplex": np.concatenate([start[None], start + 0.4 * np.eye(3)]), "xatol": 5e-3, "fatol": 5e-3, "maxfev": 200})
    return components.with_logs(np.clip(minimum.x, -LARGEST_LOG, LARGEST_LOG))


def log_covariance(posterior: ComponentPosterior, components: VarianceComponents) -> Array:
    """Covariance (3, 3) of the logarithms of the components, from the curvature of their posterior."""
    step, unit = 0.1, np.eye(3)
    pairs = [(i, j) for i in range(3) for j in range(i)]
    moves = [np.zeros(3), *unit, *-unit, *(a * unit[i] + b * unit[j] for i, j in pairs for a, b in (
        (1, 1), (1, -1), (-1, 1), (-1, -1)))]
    value = -posterior(components.logs + step * np.array(moves))[0]
    hessian = np.diag(value[1:4] - 2 * value[0] + value[4:7]) / step**2
    for number, (i, j) in enumerate(pairs):
        both, first, second, neither = value[7 + 4 * number: 11 + 4 * number]
        hessian[i, j] = hessian[j, i] = (both - first - second + neither) / (4 * step**2)
    eigenvalues, vectors = np.linalg.eigh(hessian)
    # A component that the data leave open is known to a factor e at best.
    return np.asarray((vectors / np.maximum(eigenvalues, 1.0)) @ vectors.T)


def trial_components(posterior: ComponentPosterior, components: VarianceComponents, covariance: Array) -> Trials:
    """Components spread over their posterior about the likeliest, with importance weights; covariance (3, 3) of their ln."""
    from scipy.special import gammaincinv, ndtri

    count = int(np.clip(TRIAL_ROWS // posterior.rows, FEWEST_TRIALS, TRIALS))
    uniform = _even(count, 4)
    normal = ndtri(uniform[:, :3])
    stretch = np.sqrt(0.5 * TRIAL_DEGREES / gammaincinv(0.5 * TRIAL_DEGREES, uniform[:, 3]))
    moved = TRIAL_STRETCH * stretch[:, None] * normal
    logs = np.clip(components.logs + moved @ np.linalg.cholesky(covariance).T, -LARGEST_LOG, LARGEST_LOG)
    value, gram = posterior(logs)
    proposal = -0.5 * (TRIAL_DEGREES + 3) * np.log1p(np.sum((normal * stretch[:, None]) ** 2, axis=1) / TRIAL_DEGREES)
    weight = np.exp(value - proposal - np.max(value - proposal))
    return Trials(logs, weight / weight.sum(), gram if posterior.whole else None)


def _even(count: int, dimensions: int) -> Array:
    """Points (count, dimensions) evenly over the unit cube: the additive recurrence of the generalised golden ratio."""
    ratio = 1.5
    for _ in range(30):
        ratio = (1 + ratio) ** (1 / (dimensions + 1))
    return np.asarray((0.5 + np.outer(np.arange(1, count + 1), ratio ** -np.arange(1.0, dimensions + 1))) % 1.0)

"""The noise's variance components from the data: the likeliest, and many that may be, each as likely as it is (noise.py).

They enter as logarithms of their square roots, as multiples of what is stated (`VarianceComponents.logs`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from identification.fit.gram import NoiseGram
from identification.fit.linearised import Linearised
from identification.fit.noise import NoiseModel
from identification.fit.noise_parts import LARGEST_LOG, MEMORY, PARTS, SMALLEST_LOG, VarianceComponents
from identification.fit.variance_prior import log_prior

Array = NDArray[np.float64]

# The components are estimated from at most so many rows, taken as whole pose visits evenly over the file.
NOISE_ROWS = 6000
# Of few long visits, stretches of so many rows.
STRETCH = 32
# Newton steps of the search, and their ends.
MAX_STEPS, LONGEST, ENOUGH = 12, 1.5, 2e-3
# Of a step that is too long, and of one that is not long enough.
SHORTER = (2.0, 0.5, 0.2, 0.05)
# Of the differences by which slopes are taken, in ln of a component.
STEP = 0.1
# Components that are tried for the posterior: so many, fewer where each costs many rows.
TRIALS, FEWEST_TRIALS, TRIAL_ROWS = 512, 64, 200_000
# A row whose sensor remembers costs as much as so many others.
REMEMBERING_COSTS = 4
# Wider than the curvature says, and with heavier tails: trials must cover what is there.
TRIAL_STRETCH, TRIAL_DEGREES = 1.3, 4.0


@dataclass(frozen=True, eq=False)
class Trials:
    """Components as likely as their weight (S,) says: logs (S, 6); gram (S, q, q) of the rows with these components, None where
    they were told from a part of the rows; log_evidence: ln likelihood of the rows, the components integrated out; set_up (S,):
    how set-ups differ (`SetUp`)."""

    logs: Array
    weight: Array
    gram: Array | None
    log_evidence: float
    set_up: NDArray[np.intp]


class ComponentPosterior:
    """ln posterior of the logarithms of the components, the parameters x integrated out (Laplace). All active ones are free:
    where the rows cannot tell two parts apart, their priors share the residual out. beside (n, 3, m): columns of 1 sigma each
    that are integrated out, too (sag.py)."""

    def __init__(self, at: Linearised, beside: Array | None = None) -> None:
        noise, rows = at.noise, _subset(at.noise)
        self.whole = bool(rows.all())
        self.noise = noise if self.whole else noise.of_rows(rows)
        self._beside = 0 if beside is None else beside.shape[2]
        design = at.design if beside is None else np.concatenate([beside, at.design], axis=2)
        self._gram = NoiseGram(self.noise, at.row_weight[rows], design[rows], at.residual[rows])
        # The prior on the step counts as often as the rows are thinned.
        self._share = float(rows.mean())
        self._precision = rows.mean() * at.prior.precision(at.x)
        self._pull = rows.mean() * -at.prior.gradient(at.x)
        self.rows = int(rows.sum())

    def __call__(self, logs: Array) -> tuple[Array, Array]:
        """ln posterior (S,) of logs (S, 6), and the gram (S, q, q) of the rows."""
        value, gram = self._likelihood(logs)
        return value + log_prior(self.noise, np.clip(logs, SMALLEST_LOG, LARGEST_LOG)), gram

    def likelihood(self, logs: Array) -> Array:
        """ln likelihood (S,) of logs (S, 6)."""
        return self._likelihood(logs)[0]

    def _likelihood(self, logs: Array) -> tuple[Array, Array]:
        logs = np.clip(logs, SMALLEST_LOG, LARGEST_LOG)
        gram, log_determinant = self._gram(logs)
        gram, log_beside = integrated_out(gram, self._beside, self._share)
        information = gram[:, :-1, :-1] + self._precision
        pull = gram[:, :-1, -1] + self._pull
        step = np.linalg.solve(information, pull[:, :, None])[:, :, 0]
        _, log_volume = np.linalg.slogdet(information)
        gained = np.einsum("sp,sp->s", pull, step) - gram[:, -1, -1]
        return 0.5 * (gained - log_determinant - log_volume - log_beside), gram


def integrated_out(gram: Array, count: int, share: float = 1.0) -> tuple[Array, Array]:
    """Gram (S, q, q) of the other columns where the first `count` of gram (S, count + q, count + q) are integrated out, each
    with a normal prior of 1 sigma, which counts by this share; and ln determinant (S,) of their own information."""
    if not count:
        return gram, np.zeros(len(gram))
    own = gram[:, :count, :count] + share * np.eye(count)
    cross = gram[:, :count, count:]
    return (gram[:, count:, count:] - np.swapaxes(cross, 1, 2) @ np.linalg.solve(own, cross),
            np.asarray(np.linalg.slogdet(own)[1]))


def _subset(noise: NoiseModel) -> NDArray[np.bool_]:
    """Rows from which the components are estimated: all, or whole visits evenly over a long file, or stretches of long ones."""
    count = len(noise.visit)
    if count <= NOISE_ROWS:
        return np.ones(count, dtype=bool)
    every = int(np.ceil(count / NOISE_ROWS))
    number = noise.visit if noise.visits >= 2 * every else np.arange(count) // STRETCH
    return np.asarray(number % every == 0)


def likeliest(posterior: ComponentPosterior, components: VarianceComponents) -> VarianceComponents:
    """The likeliest components, by Newton steps from those given; parts that are not active stay as they are."""
    free = np.flatnonzero(posterior.noise.active)
    logs = components.logs
    logs[free] = np.maximum(logs[free], -3.0)
    value, gradient, hessian = _slopes(posterior, logs, free)
    for _ in range(MAX_STEPS):
        eigenvalues, vectors = np.linalg.eigh(hessian)
        curvature = np.maximum(np.abs(eigenvalues), 0.3)
        step = vectors @ ((vectors.T @ gradient) / curvature)
        step *= min(1.0, LONGEST / max(float(np.linalg.norm(step)), 1e-300))
        ahead = _moved(logs, free, step)
        moved = (ahead - logs)[free]
        expected = float(gradient @ moved - 0.5 * np.sum(curvature * (vectors.T @ moved) ** 2))
        if expected < ENOUGH:
            logs = ahead
            break
        # A step that goes well is the next place: its slopes come with its value.
        reached = _slopes(posterior, ahead, free)
        if reached[0] < value + 0.25 * expected:
            shorter = np.array([_moved(logs, free, share * step) for share in SHORTER])
            tried = posterior(shorter)[0]
            best = int(np.argmax(tried))
            if max(tried[best], reached[0]) < value + ENOUGH:
                break
            if tried[best] > reached[0]:
                ahead, reached = shorter[best], _slopes(posterior, shorter[best], free)
        logs, (value, gradient, hessian) = ahead, reached
    fitted = components.with_logs(logs)
    return replace(fitted, **{PARTS[part]: getattr(components, PARTS[part]) for part in np.flatnonzero(~np.array(
        posterior.noise.active))})


def _moved(logs: Array, free: NDArray[np.intp], step: Array) -> Array:
    """Logarithms (6,) of which the free ones are a step (f,) further, within their bounds."""
    ahead = logs.copy()
    ahead[free] += step
    return np.clip(ahead, SMALLEST_LOG, LARGEST_LOG)


def _slopes(posterior: ComponentPosterior, logs: Array, free: NDArray[np.intp]) -> tuple[float, Array, Array]:
    """ln posterior, its gradient (f,) by the free logarithms, and the negative Hessian (f, f), by differences."""
    step, unit = STEP, np.eye(len(logs))[free]
    pairs = [(i, j) for i in range(len(free)) for j in range(i)]
    moves = [np.zeros(len(logs)), *unit, *-unit, *(sign * (unit[i] + unit[j]) for i, j in pairs for sign in (1, -1))]
    value, count = posterior(logs + step * np.array(moves))[0], len(free)
    ahead, behind = value[1: 1 + count], value[1 + count: 1 + 2 * count]
    single = 2 * value[0] - ahead - behind
    hessian = np.diag(single) / step**2
    for (i, j), both in zip(pairs, value[1 + 2 * count:].reshape(-1, 2), strict=True):
        # Of i and j moved together, less what each alone does.
        hessian[i, j] = hessian[j, i] = (2 * value[0] - both.sum() - single[i] - single[j]) / (2 * step**2)
    return float(value[0]), (ahead - behind) / (2 * step), hessian


def log_covariance(posterior: ComponentPosterior, components: VarianceComponents) -> Array:
    """Covariance (6, 6) of the logarithms of the components, from the curvature of their posterior; nothing for those that are
    not active."""
    free = np.flatnonzero(posterior.noise.active)
    eigenvalues, vectors = np.linalg.eigh(_slopes(posterior, components.logs, free)[2])
    covariance = np.zeros((len(components.logs),) * 2)
    # A component that the data leave open is known to a factor e at best.
    covariance[np.ix_(free, free)] = (vectors / np.maximum(eigenvalues, 1.0)) @ vectors.T
    return covariance


def trial_components(posterior: ComponentPosterior, components: VarianceComponents, covariance: Array, of: int = 1) -> Trials:
    """Components spread over their posterior about the likeliest, with importance weights; covariance (6, 6) of their ln; of:
    how many such sets share the number of trials."""
    from scipy.special import gammaincinv, gammaln, logsumexp, ndtri

    cost = posterior.rows * (REMEMBERING_COSTS if posterior.noise.active[MEMORY] else 1)
    count = int(np.clip(TRIAL_ROWS // cost, FEWEST_TRIALS, max(TRIALS // of, FEWEST_TRIALS)))
    free = np.flatnonzero(posterior.noise.active)
    uniform = _even(count, len(free) + 1)
    normal = ndtri(uniform[:, :-1])
    stretch = np.sqrt(0.5 * TRIAL_DEGREES / gammaincinv(0.5 * TRIAL_DEGREES, uniform[:, -1]))
    logs = np.repeat(components.logs[None], count, axis=0)
    root = np.linalg.cholesky(TRIAL_STRETCH**2 * covariance[np.ix_(free, free)])
    logs[:, free] += (stretch[:, None] * normal) @ root.T
    logs = np.clip(logs, SMALLEST_LOG, LARGEST_LOG)
    value, gram = posterior(logs)
    # ln density of a multivariate Student.
    proposal = (-0.5 * (TRIAL_DEGREES + len(free)) * np.log1p(np.sum((normal * stretch[:, None]) ** 2, axis=1) / TRIAL_DEGREES)
                - 0.5 * len(free) * np.log(np.pi * TRIAL_DEGREES) - np.log(np.diag(root)).sum()
                + gammaln(0.5 * (TRIAL_DEGREES + len(free))) - gammaln(0.5 * TRIAL_DEGREES))
    total = float(logsumexp(value - proposal))
    return Trials(logs, np.exp(value - proposal - total), gram if posterior.whole else None, total - float(np.log(count)),
                  np.full(count, posterior.noise.set_up))


def _even(count: int, dimensions: int) -> Array:
    """Points (count, dimensions) evenly over the unit cube: the additive recurrence of the generalised golden ratio."""
    ratio = 1.5
    for _ in range(30):
        ratio = (1 + ratio) ** (1 / (dimensions + 1))
    return np.asarray((0.5 + np.outer(np.arange(1, count + 1), ratio ** -np.arange(1.0, dimensions + 1))) % 1.0)

"""Mean and covariance of the posterior beyond Laplace: averaged over noise sizes, importance weights (inference.py)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from identification.noise import NoiseModel, NoiseSize
from identification.priors import PriorModel

Array = NDArray[np.float64]

# Draws for the importance weights; the same ones every time, so that a result is the same for the same input.
DRAWS = 4000
FEWEST_EFFECTIVE_DRAWS = 200.0
# Information of the data on a joint in units of the prior's, under which they say nothing of it.
UNSEEN_INFORMATION = 1e-3


def shrunk(information: Array, size: NoiseSize) -> Array:
    """Expected information of a Student likelihood: (nu + p) / (nu + p + 2) of the one with its weights taken as known."""
    return information if np.isinf(size.degrees) else information * (size.degrees + 3) / (size.degrees + 5)


def averaged(
    noise: NoiseModel, design: Array, residual: Array, size: NoiseSize, spread: Array, row_weight: Array, prior: PriorModel,
    x: Array,
) -> tuple[Array, Array, float]:
    """Mean and covariance of x over the noise sizes, each with importance weights; and the fewest effective draws."""
    eigenvalues, vectors = np.linalg.eigh(spread)
    axes = (vectors * np.sqrt(3.0 * np.maximum(eigenvalues, 0.0))).T
    axes = axes[np.linalg.norm(axes, axis=1) > 1e-6]
    shifts = [np.zeros(3), *axes, *(-axes)]
    shares = np.array([1 - len(axes) / 3.0, *([1 / 6.0] * (2 * len(axes)))])
    means, covariances, effective = [], [], np.inf
    for shift in shifts:
        trial = size.with_logs(size.logs + shift)
        weights = noise.weights(trial, row_weight)
        information = shrunk(weights.inner(design, design), trial)
        pull = shrunk(weights.inner(design, residual[:, :, None])[:, 0], trial)
        mean, covariance, draws = _corrected(information, pull, prior, x)
        means.append(mean)
        covariances.append(covariance)
        effective = min(effective, draws)
    mean = np.asarray(shares @ np.array(means))
    between = np.array(means) - mean
    within = np.einsum("s,sij->ij", shares, np.array(covariances))
    # A mixture of normals has heavier tails than the normal of its moments that the file carries. Half the relative variance
    # of the covariance over the sizes on top makes intervals from 50 to 95 % hold what they say (Student, 5 to 50 degrees).
    varied = np.array(covariances) - within
    tails = 0.5 * np.einsum("s,sij->ij", shares, varied @ np.linalg.solve(within, varied))
    return mean, within + np.einsum("s,si,sj->ij", shares, between, between) + 0.5 * (tails + tails.T), effective


def _corrected(information: Array, pull: Array, prior: PriorModel, x: Array) -> tuple[Array, Array, float]:
    """Mean and covariance of x for one noise, the Gaussian in c of the likelihood times the prior.

    information (6, 6) and pull (6,): curvature and gradient of the ln likelihood by ln c at x. Laplace's Gaussian, widened
    into a Student with 8 degrees of freedom, is drawn from; each draw is weighted by posterior over proposal. The paper's
    Gaussian prior in k keeps Laplace, as published.
    """
    precision = information + prior.precision(x)
    covariance = np.asarray(np.linalg.inv(precision), dtype=float)
    centre = x + covariance @ (pull - prior.gradient(x))
    if prior.kind == "gaussian":
        return centre, covariance, 0.0
    rng = np.random.default_rng(0)
    root = np.linalg.cholesky(covariance)
    count = len(x)
    normal = rng.standard_normal((DRAWS // 2, count))
    normal = np.concatenate([normal, -normal])
    stretch = np.sqrt(8.0 / rng.chisquare(8.0, DRAWS // 2))
    stretch = np.concatenate([stretch, stretch])
    draws = centre + (normal * stretch[:, None]) @ root.T
    # Linear in c about the MAP: c / c0 - 1 in place of ln c - x.
    step = draws - x
    step[:, :6] = np.expm1(np.clip(step[:, :6], -50, 50))
    log_posterior = step @ pull - 0.5 * np.einsum("di,ij,dj->d", step, information, step, optimize=True)
    log_posterior -= 0.5 * np.sum(((draws[:, :6] + np.log(prior.prior.stiffness)) / prior.prior.log_std) ** 2, axis=1)
    log_posterior -= 0.5 * np.sum(((draws[:, 6:] - prior.term_mean) / prior.term_std) ** 2, axis=1)
    log_posterior[np.any(draws != prior.inside(draws), axis=1)] = -np.inf
    log_proposal = -0.5 * (8.0 + count) * np.log1p(np.sum((normal * stretch[:, None]) ** 2, axis=1) / 8.0)
    log_weight = log_posterior - log_proposal
    if not np.isfinite(log_weight.max()):
        # A parameter at its bound, with every draw beyond it.
        return centre, covariance, 0.0
    weight = np.exp(log_weight - log_weight.max())
    weight /= weight.sum()
    effective = float(1.0 / np.sum(weight**2))
    if effective < FEWEST_EFFECTIVE_DRAWS:
        return centre, covariance, effective
    mean = np.asarray(weight @ draws)
    moments = np.asarray(np.einsum("d,di,dj->ij", weight, draws - mean, draws - mean, optimize=True))
    # A joint the data say nothing of has its prior exactly, free of the draws' own scatter.
    unseen = np.zeros(count, dtype=bool)
    unseen[:6] = np.diag(information)[:6] * prior.prior.log_std**2 < UNSEEN_INFORMATION
    mean[unseen] = -np.log(prior.prior.stiffness[unseen[:6]])
    moments[unseen] = moments[:, unseen] = 0.0
    moments[unseen, unseen] = prior.prior.log_std**2
    return mean, moments, effective

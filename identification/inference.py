"""Posterior of the joint compliances in x = ln c (paper eq. 11-14, in logarithms of compliances).

    -2 ln posterior(x) = |z - eta(exp x)|^2 (Sigma^-1) + prior(x)

eta is the finite model at equilibrium, Sigma the noise of `noise.py` with its sizes estimated. The prior is log-normal by
default; the paper's Gaussian in k with the weight gamma (eq. 11) is the other choice. MAP by Gauss-Newton, then:

1. Laplace: the inverse curvature (paper eq. 13, in x).
2. The noise sizes are not known exactly: the posterior is averaged over them, at the points mean +- sqrt(3) sigma of each of
   their principal axes (the fifth-degree rule's nodes), which widens it where a few rows must tell both; a little more
   stands in for the heavier tails that this gives it.
3. Importance weights correct Laplace's shape: in c the likelihood is Gaussian and the prior is not, so that a joint that is
   barely seen has a skewed posterior. Mean and covariance of the weighted draws are what stiffness.json carries.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from identification.cell import Cell
from identification.findings import error
from identification.measurements import Measurements
from identification.model.compliance import equilibrium, sensitivity, signature
from identification.model.robot import Prior
from identification.noise import (
    NoiseModel,
    NoiseSize,
    Weights,
    log_prior,
    noise_model,
    restricted_log_likelihood,
    student_weights,
)

Array = NDArray[np.float64]
PriorKind = Literal["lognormal", "gaussian"]

MAX_STEPS = 200
MAX_ROUNDS = 8
# Draws for the importance weights; the same ones every time, so that a result is the same for the same input.
DRAWS = 4000
FEWEST_EFFECTIVE_DRAWS = 200.0
# Information of the data on a joint in units of the prior's, under which they say nothing of it.
UNSEEN_INFORMATION = 1e-3
# The noise sizes are estimated from at most so many rows, taken as whole pose visits evenly over the file.
NOISE_ROWS = 6000


@dataclass(frozen=True, eq=False)
class PriorModel:
    """The prior in x = ln c: median stiffness (6,), std / mean of k; kind "lognormal", or "gaussian" in k with gamma."""

    prior: Prior
    kind: PriorKind = "lognormal"
    gamma: float = 1.0

    def value(self, x: Array) -> float:
        """-ln prior, without its constant."""
        if self.kind == "lognormal":
            return float(0.5 * np.sum(((x + np.log(self.prior.stiffness)) / self.prior.log_std) ** 2))
        share = (np.exp(-x) / self.prior.stiffness - 1) / self.prior.relative_std
        return float(0.5 * self.gamma * np.sum(share**2))

    def gradient(self, x: Array) -> Array:
        """Derivative (6,) of -ln prior by x."""
        if self.kind == "lognormal":
            return np.asarray((x + np.log(self.prior.stiffness)) / self.prior.log_std**2)
        k = np.exp(-x)
        return np.asarray(-self.gamma * k * (k - self.prior.stiffness) / (self.prior.relative_std * self.prior.stiffness) ** 2)

    def precision(self, x: Array) -> Array:
        """Gauss-Newton curvature (6, 6) of -ln prior by x."""
        if self.kind == "lognormal":
            return np.eye(6) / self.prior.log_std**2
        return np.diag(self.gamma * (np.exp(-x) / (self.prior.relative_std * self.prior.stiffness)) ** 2)

    def search_curvature(self, x: Array) -> Array:
        """Curvature (6, 6) for the search: the full second derivative where it is positive, else `precision`."""
        if self.kind == "lognormal":
            return self.precision(x)
        k = np.exp(-x)
        full = self.gamma * k * (2 * k - self.prior.stiffness) / (self.prior.relative_std * self.prior.stiffness) ** 2
        return np.diag(np.maximum(full, 0.2 * np.diag(self.precision(x))))

    @property
    def log_std(self) -> float:
        """Standard deviation of ln k before the measurements."""
        if self.kind == "lognormal":
            return self.prior.log_std
        return float(self.prior.relative_std / np.sqrt(self.gamma))


@dataclass(frozen=True, eq=False)
class Linearised:
    """The n fitted rows at the MAP, in the coordinates of `noise`: design (n, 3, 6) by ln c and residual (n, 3), whitened by
    the sensor's sigma. weights: Sigma^-1 with the estimated sizes and row weights."""

    design: Array
    residual: Array
    noise: NoiseModel
    weights: Weights
    information: Array


@dataclass(frozen=True, eq=False)
class Posterior:
    """mean (6,) and covariance (6, 6) of ln c; map (6,): the MAP of ln c; laplace (6, 6): its inverse curvature.

    size: estimated noise sizes; size_log_std (3,): how well the data tell them, ln. row_weight (n,) of the fitted rows.
    effective_draws: of the importance weights, 0 where they were not used. chi2: against the stated noise.
    readings: measured components. at_map: the linearised model there.
    """

    mean: Array
    covariance: Array
    map: Array
    laplace: Array
    size: NoiseSize
    size_log_std: Array
    row_weight: Array
    effective_draws: float
    chi2: float
    readings: int
    at_map: Linearised


def posterior(cell: Cell, rows: Measurements, prior: PriorModel) -> Posterior:
    """The posterior from these rows.

    Raises CompstiffError: CS1009 no loaded row, CS1010 data that prefer all compliances negative, CS1011 no convergence.
    """
    if not np.any(rows.wrench != 0):
        raise error("CS1009", "no loaded row has the purpose identify: all are kept for validation", file=rows.source)
    z = np.nan_to_num(rows.deflection)
    _check_sign(cell, rows, z)
    x = _start(cell, rows, z, prior)
    size, row_weight = NoiseSize(), np.ones(len(rows))
    for _ in range(MAX_ROUNDS):
        before, last_weight = size, row_weight
        noise = noise_model(cell, rows, np.exp(x))
        design, residual = _linearised(cell, rows, z, noise, x)
        size = _fit_sizes(noise, size, row_weight, design, residual, prior, x)
        row_weight, degrees = student_weights(noise, size, noise.weights(size, row_weight), residual)
        size = NoiseSize(size.sensor, size.force, size.offset, degrees)
        weights = noise.weights(size, row_weight)
        x, design, residual = _maximise(cell, rows, z, noise, weights, prior, x)
        # Sizes within five percent and weights within a twentieth are far inside their own uncertainty.
        if np.max(np.abs(size.logs - before.logs)) < 0.05 and np.max(np.abs(row_weight - last_weight)) < 0.05:
            break
    information = weights.inner(design, design)
    column = residual[:, :, None]
    stated = noise.weights(NoiseSize(1.0, float(noise.stated[1]), float(noise.stated[2])))
    at_map = Linearised(design, residual, noise, weights, information)
    laplace = np.asarray(np.linalg.inv(_shrunk(information, size) + prior.precision(x)), dtype=float)
    spread = _size_spread(at_map, size, row_weight, prior, x)
    mean, covariance, effective = _averaged(at_map, size, spread, row_weight, prior, x)
    return Posterior(mean, covariance, x, laplace, size, np.sqrt(np.diag(spread)), row_weight, effective,
                     float(stated.inner(column, column)[0, 0]), int(noise.measured.sum()), at_map)


def _linearised(cell: Cell, rows: Measurements, z: Array, noise: NoiseModel, x: Array) -> tuple[Array, Array]:
    """Design (n, 3, 6) by ln c and residual (n, 3) at x, in the coordinates of `noise`."""
    position, slope = sensitivity(cell.robot, rows.theta, cell.flange_from_tcp, rows.wrench, np.exp(x))
    return noise.rotation @ (slope * np.exp(x)), np.einsum("nij,nj->ni", noise.rotation, z - position)


def _maximise(
    cell: Cell, rows: Measurements, z: Array, noise: NoiseModel, weights: Weights, prior: PriorModel, x: Array
) -> tuple[Array, Array, Array]:
    """MAP of ln c for one noise by damped Gauss-Newton, with design and residual there. Raises CS1011."""
    design, residual = _linearised(cell, rows, z, noise, x)

    def cost(x: Array, residual: Array) -> float:
        column = residual[:, :, None]
        return 0.5 * float(weights.inner(column, column)[0, 0]) + prior.value(x)

    value, damping = cost(x, residual), 0.0
    for _ in range(MAX_STEPS):
        curvature = weights.inner(design, design) + prior.search_curvature(x)
        gradient = weights.inner(design, residual[:, :, None])[:, 0] - prior.gradient(x)
        step = np.linalg.solve(curvature + damping * np.diag(np.diag(curvature)), gradient)
        change = float(np.sqrt(step @ curvature @ step))
        step = step * min(1.0, 1.0 / max(np.max(np.abs(step)), 1e-300))
        trial = np.einsum("nij,nj->ni", noise.rotation, z - predicted_deflection(cell, rows, np.exp(x + step)))
        trial_value = cost(x + step, trial)
        if trial_value > value + 1e-9 * (1 + abs(value)):
            damping = max(10 * damping, 1e-3)
            continue
        x, value, damping = x + step, trial_value, 0.1 * damping
        if change < 1e-3:
            # So small a step leaves the design as it is.
            return x, design, trial
        design, residual = _linearised(cell, rows, z, noise, x)
    raise error("CS1011", f"the fit did not converge in {MAX_STEPS} steps: the last moved by {change:.2g} posterior standard "
                "deviations", file=rows.source, hint="check the units and the prior")


def _shrunk(information: Array, size: NoiseSize) -> Array:
    """Expected information of a Student likelihood: (nu + p) / (nu + p + 2) of the one with its weights taken as known."""
    return information if np.isinf(size.degrees) else information * (size.degrees + 3) / (size.degrees + 5)


def _subset(noise: NoiseModel) -> NDArray[np.bool_]:
    """Rows from which the noise sizes are estimated: all, or whole visits evenly over a long file."""
    count = len(noise.visit)
    if count <= NOISE_ROWS:
        return np.ones(count, dtype=bool)
    every = int(np.ceil(count / NOISE_ROWS))
    number = noise.visit if noise.visits >= 2 * every else np.arange(count)
    return np.asarray(number % every == 0)


def _size_objective(
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


def _fit_sizes(
    noise: NoiseModel, size: NoiseSize, row_weight: Array, design: Array, residual: Array, prior: PriorModel, x: Array
) -> NoiseSize:
    """The likeliest noise sizes, the stiffnesses integrated out."""
    from scipy.optimize import minimize

    objective = _size_objective(noise, size, row_weight, design, residual, prior, x)
    start = size.logs
    found = minimize(objective, start, method="Nelder-Mead", options={
        "initial_simplex": np.concatenate([start[None], start + 0.4 * np.eye(3)]), "xatol": 5e-3, "fatol": 5e-3, "maxfev": 200})
    return size.with_logs(np.clip(found.x, -7.0, 7.0))


def _size_spread(at_map: Linearised, size: NoiseSize, row_weight: Array, prior: PriorModel, x: Array) -> Array:
    """Covariance (3, 3) of the logarithms of the noise sizes, from the curvature of their posterior."""
    objective = _size_objective(at_map.noise, size, row_weight, at_map.design, at_map.residual, prior, x)
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


def _averaged(
    at_map: Linearised, size: NoiseSize, spread: Array, row_weight: Array, prior: PriorModel, x: Array
) -> tuple[Array, Array, float]:
    """Mean and covariance of ln c over the noise sizes, each with importance weights; and the fewest effective draws."""
    eigenvalues, vectors = np.linalg.eigh(spread)
    axes = (vectors * np.sqrt(3.0 * np.maximum(eigenvalues, 0.0))).T
    axes = axes[np.linalg.norm(axes, axis=1) > 1e-6]
    shifts = [np.zeros(3), *axes, *(-axes)]
    shares = np.array([1 - len(axes) / 3.0, *([1 / 6.0] * (2 * len(axes)))])
    means, covariances, effective = [], [], np.inf
    for shift in shifts:
        trial = size.with_logs(size.logs + shift)
        weights = at_map.noise.weights(trial, row_weight)
        information = _shrunk(weights.inner(at_map.design, at_map.design), trial)
        pull = _shrunk(weights.inner(at_map.design, at_map.residual[:, :, None])[:, 0], trial)
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
    """Mean and covariance of ln c for one noise, the Gaussian in c of the likelihood times the prior.

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
    normal = rng.standard_normal((DRAWS // 2, 6))
    normal = np.concatenate([normal, -normal])
    stretch = np.sqrt(8.0 / rng.chisquare(8.0, DRAWS // 2))
    stretch = np.concatenate([stretch, stretch])
    draws = centre + (normal * stretch[:, None]) @ root.T
    # Linear in c about the MAP: c / c0 - 1 in place of ln c - x.
    step = np.expm1(np.clip(draws - x, -50, 50))
    log_posterior = step @ pull - 0.5 * np.einsum("di,ij,dj->d", step, information, step, optimize=True)
    log_posterior -= 0.5 * np.sum(((draws + np.log(prior.prior.stiffness)) / prior.prior.log_std) ** 2, axis=1)
    log_proposal = -0.5 * (8.0 + 6) * np.log1p(np.sum((normal * stretch[:, None]) ** 2, axis=1) / 8.0)
    log_weight = log_posterior - log_proposal
    weight = np.exp(log_weight - log_weight.max())
    weight /= weight.sum()
    effective = float(1.0 / np.sum(weight**2))
    if effective < FEWEST_EFFECTIVE_DRAWS:
        return centre, covariance, effective
    mean = np.asarray(weight @ draws)
    moments = np.asarray(np.einsum("d,di,dj->ij", weight, draws - mean, draws - mean, optimize=True))
    # A joint the data say nothing of has its prior exactly, free of the draws' own scatter.
    unseen = np.diag(information) * prior.prior.log_std**2 < UNSEEN_INFORMATION
    mean[unseen] = -np.log(prior.prior.stiffness[unseen])
    moments[unseen] = moments[:, unseen] = 0.0
    moments[unseen, unseen] = prior.prior.log_std**2
    return mean, moments, effective


def _start(cell: Cell, rows: Measurements, z: Array, prior: PriorModel) -> Array:
    """MAP of the linear model z = A c with the stated noise: damped Gauss-Newton in ln c from the prior's median."""
    x = -np.log(prior.prior.stiffness)
    noise = noise_model(cell, rows, np.exp(x))
    weights = noise.weights(NoiseSize())
    a = noise.rotation @ signature(cell.robot, rows.theta, cell.flange_from_tcp, rows.wrench)[:, :3]
    information = weights.inner(a, a)
    projected = weights.inner(a, np.einsum("nij,nj->ni", noise.rotation, z)[:, :, None])[:, 0]
    lognormal = PriorModel(prior.prior)

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


def _check_sign(cell: Cell, rows: Measurements, z: Array) -> None:
    """Refuses (CS1010) data that the prior's deflections explain best with a negative factor, joint by joint and in all."""
    prior_compliance = 1 / cell.prior.stiffness
    noise = noise_model(cell, rows, prior_compliance)
    weights = noise.weights(NoiseSize())
    columns = signature(cell.robot, rows.theta, cell.flange_from_tcp, rows.wrench)[:, :3] * prior_compliance
    shape, reading = noise.rotation @ columns, np.einsum("nij,nj->ni", noise.rotation, z)[:, :, None]
    along, size = weights.inner(shape, reading)[:, 0], np.sqrt(np.diag(weights.inner(shape, shape)))
    whole = shape.sum(axis=2, keepdims=True)
    factor = float(weights.inner(whole, reading)[0, 0] / weights.inner(whole, whole)[0, 0])
    seen = size > 3
    if seen.any() and factor < 0 and np.all(along[seen] < 0):
        raise error("CS1010", f"the data prefer all compliances negative: the tool moved against the force (best factor on "
                    f"the expected deflections {factor:.2f})", file=rows.source,
                    hint="forces are those that act ON the tool; deflection is loaded minus unloaded position")


def predicted_deflection(cell: Cell, rows: Measurements, compliance: Array) -> Array:
    """Deflections (N, 3) [m] the model gives for these rows."""
    return equilibrium(cell.robot, rows.theta, cell.flange_from_tcp, rows.wrench, compliance).position

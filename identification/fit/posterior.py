"""Posterior of the joint compliances in x = ln c (paper eq. 11-14, in logarithms of compliances), and of effects in force.

    -2 ln posterior(x) = |z - eta(x)|^2 (Sigma^-1) + prior(x)          (paper eq. 11)

eta is the finite model at equilibrium (with the effects of fitted_model.py where there are any, whose parameters follow in x),
Sigma the noise of `noise.py` with its sizes estimated. The prior is log-normal by default; the paper's Gaussian in k with the
weight gamma (eq. 11) is the other choice. MAP by Gauss-Newton, then:

1. Laplace: the inverse curvature (paper eq. 13, in x).
2. The noise sizes are not known exactly: several hundred are tried, each weighted by its posterior, and every draw
   of x has one of them. This widens the posterior where a few rows must tell both, and gives it heavier tails than normal.
3. Importance weights correct Laplace's shape: in c the likelihood is Gaussian and the prior is not, so that a joint that is
   barely seen has a skewed posterior. Mean and covariance of the weighted draws are what stiffness.json carries; its intervals
   and the ellipsoid are quantiles of the draws.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from identification.common.findings import error
from identification.fit.fitted_model import Term, predicted_deflection, response, with_terms
from identification.fit.marginal import Draws, posterior_draws, shrunk
from identification.fit.noise import NoiseModel, NoiseSize, Weights, noise_model, student_weights
from identification.fit.priors import PriorModel
from identification.fit.variance_components import SizePosterior, fit_sizes, size_spread, size_trials
from identification.measurements import Measurements
from identification.model.cell import Cell
from identification.model.compliance import signature

Array = NDArray[np.float64]

MAX_STEPS = 200
MAX_ROUNDS = 8
# Steps after which a fiftieth of a posterior standard deviation is near enough: differences in a term can rattle.
PATIENCE = 30


@dataclass(frozen=True, eq=False)
class Linearised:
    """The n fitted rows at the MAP, in the coordinates of `noise`: design (n, 3, 6 + P) by x and residual (n, 3), whitened by
    the sensor's sigma. weights: Sigma^-1 with the estimated sizes and row weights."""

    design: Array
    residual: Array
    noise: NoiseModel
    weights: Weights
    information: Array


@dataclass(frozen=True, eq=False)
class Posterior:
    """mean (6 + P,) and covariance of x = (ln c, parameters of terms), those of the draws; map: the MAP of x; laplace: its
    inverse curvature.

    size: estimated noise sizes; size_spread (3, 3): covariance of their ln. row_weight (n,) of the fitted rows.
    chi2: against the stated noise.
    readings: measured components. at_map: the linearised model there. prior: with the terms' parameters.
    """

    mean: Array
    covariance: Array
    draws: Draws
    map: Array
    laplace: Array
    size: NoiseSize
    size_spread: Array
    row_weight: Array
    chi2: float
    readings: int
    at_map: Linearised
    prior: PriorModel
    terms: tuple[Term, ...] = ()

    def of_joints(self) -> Posterior:
        """The posterior of the joints alone, the terms' parameters integrated out."""
        at = self.at_map
        seen = Linearised(at.design[:, :, :6], at.residual, at.noise, at.weights, at.information[:6, :6])
        none = np.empty(0)
        prior = replace(self.prior, term_mean=none, term_std=none, term_low=none, term_high=none)
        return replace(self, mean=self.mean[:6], covariance=self.covariance[:6, :6], draws=self.draws.first(6),
                       map=self.map[:6], laplace=self.laplace[:6, :6], at_map=seen, prior=prior, terms=())

    @property
    def size_log_std(self) -> Array:
        """How well the data tell the noise sizes: standard deviations (3,) of their ln."""
        return np.sqrt(np.diag(self.size_spread))


def posterior(
    cell: Cell, rows: Measurements, prior: PriorModel, terms: tuple[Term, ...] = (), start: Array | None = None
) -> Posterior:
    """The posterior from these rows, with the terms in force; start (6,): ln c to begin with, where it is known.

    Raises CompstiffError: CS1009 no loaded row, CS1010 data that prefer all compliances negative, CS1011 no convergence.
    """
    if not np.any(rows.wrench != 0):
        raise error("CS1009", "no loaded row has the purpose identify: all are kept for validation", file=rows.source)
    z = np.nan_to_num(rows.deflection)
    _check_sign(cell, rows, z)
    x = np.concatenate([_start(cell, rows, z, prior) if start is None else start, *(term.start for term in terms)])
    prior = with_terms(prior, terms)
    step_limit = np.concatenate([np.ones(6), *(3.0 * term.scale for term in terms)])
    size, row_weight = NoiseSize(), np.ones(len(rows))
    for _ in range(MAX_ROUNDS):
        before, last_weight = size, row_weight
        noise = noise_model(cell, rows, np.exp(x[:6]))
        design, residual = _linearised(cell, rows, z, noise, x, terms)
        size = fit_sizes(SizePosterior(noise, row_weight, design, residual, prior, x), size)
        row_weight, degrees = student_weights(noise, size, noise.weights(size, row_weight), residual)
        size = NoiseSize(size.sensor, size.force, size.offset, degrees)
        weights = noise.weights(size, row_weight)
        x, design, residual = _maximise(cell, rows, z, noise, weights, prior, x, terms, step_limit)
        # Sizes within five percent and weights within a twentieth are far inside their own uncertainty.
        if np.max(np.abs(size.logs - before.logs)) < 0.05 and np.max(np.abs(row_weight - last_weight)) < 0.05:
            break
    information = weights.inner(design, design)
    column = residual[:, :, None]
    stated = noise.weights(NoiseSize(1.0, float(noise.stated[1]), float(noise.stated[2])))
    at_map = Linearised(design, residual, noise, weights, information)
    laplace = np.asarray(np.linalg.inv(shrunk(information, size) + prior.precision(x)), dtype=float)
    sizes = SizePosterior(noise, row_weight, design, residual, prior, x)
    spread = size_spread(sizes, size)
    draws = posterior_draws(noise, design, residual, size, size_trials(sizes, size, spread), row_weight, prior, x)
    return Posterior(draws.mean, draws.covariance, draws, x, laplace, size, spread, row_weight,
                     float(stated.inner(column, column)[0, 0]), int(noise.measured.sum()), at_map, prior, terms)


def _linearised(
    cell: Cell, rows: Measurements, z: Array, noise: NoiseModel, x: Array, terms: tuple[Term, ...]
) -> tuple[Array, Array]:
    """Design (n, 3, 6 + P) by x and residual (n, 3) at x, in the coordinates of `noise`."""
    position, slope = response(cell, rows, x, terms)
    return noise.rotation @ slope, np.einsum("nij,nj->ni", noise.rotation, z - position)


def _maximise(
    cell: Cell, rows: Measurements, z: Array, noise: NoiseModel, weights: Weights, prior: PriorModel, x: Array,
    terms: tuple[Term, ...], step_limit: Array,
) -> tuple[Array, Array, Array]:
    """MAP of x for one noise (paper eq. 12) by damped Gauss-Newton, with design and residual there. Raises CS1011."""
    design, residual = _linearised(cell, rows, z, noise, x, terms)

    def cost(x: Array, residual: Array) -> float:
        column = residual[:, :, None]
        return 0.5 * float(weights.inner(column, column)[0, 0]) + prior.value(x)

    value, damping = cost(x, residual), 0.0
    for number in range(MAX_STEPS):
        curvature = weights.inner(design, design) + prior.search_curvature(x)
        pull = weights.inner(design, residual[:, :, None])[:, 0]
        gradient = pull - prior.gradient(x)
        # eta is linear in c, not in ln c: where the data want a smaller c, its curvature is larger than Gauss-Newton's, which
        # would step to and fro for ever.
        joints = np.arange(6)
        curvature[joints, joints] += np.maximum(-pull[:6], 0.0)
        step = np.linalg.solve(curvature + damping * np.diag(np.diag(curvature)), gradient)
        step = prior.inside(x + step * min(1.0, 1.0 / max(np.max(np.abs(step / step_limit)), 1e-300))) - x
        change = float(np.sqrt(step @ curvature @ step))
        trial = np.einsum("nij,nj->ni", noise.rotation, z - predicted_deflection(cell, rows, x + step, terms))
        trial_value = cost(x + step, trial)
        if trial_value > value + 1e-9 * (1 + abs(value)):
            damping = max(10 * damping, 1e-3)
            continue
        x, value, damping = x + step, trial_value, 0.1 * damping
        if change < (1e-3 if number < PATIENCE else 2e-2):
            # So small a step leaves the design as it is.
            return x, design, trial
        design, residual = _linearised(cell, rows, z, noise, x, terms)
    raise error("CS1011", f"the fit did not converge in {MAX_STEPS} steps: the last moved by {change:.2g} posterior standard "
                "deviations", file=rows.source, hint="check the units and the prior")


def _start(cell: Cell, rows: Measurements, z: Array, prior: PriorModel) -> Array:
    """MAP (eq. 12) of the linear model z = A c with the stated noise: damped Gauss-Newton in ln c from the prior's median."""
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

"""Posterior of the joint compliances in x = ln c (paper eq. 11-14, in logarithms of compliances), and of effects in force.

    -2 ln posterior(x) = |z - eta(x)|^2 (Sigma^-1) + prior(x)          (paper eq. 11)

eta is the finite model at equilibrium (with the effects of fitted_model.py where there are any, whose parameters follow in x),
Sigma the noise of `noise.py` with its variance components estimated. The prior is log-normal by default; the paper's Gaussian
in k with the weight gamma (eq. 11) is the other choice. MAP by Gauss-Newton, then:

1. Laplace: the inverse curvature (paper eq. 13, in x).
2. Where the robot file has no `links` what the arm's weight may do (sag.py) is integrated out: it would pass for springs.
3. The variance components are not known exactly, nor whether the optional ones are there: several hundred are tried, each
   weighted by its posterior (variance_components.py, optional_parts.py), and every draw of x has one of them. This widens the
   posterior where a few rows must tell both, and gives it heavier tails than normal.
4. Importance weights correct Laplace's shape: in c the likelihood is Gaussian and the prior is not, so that a joint that is
   barely seen has a skewed posterior. Mean and covariance of the weighted draws are what stiffness.json carries; its intervals
   and the ellipsoid are quantiles of the draws.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from identification.common.arrays import read_only
from identification.common.findings import error
from identification.fit.fitted_model import Term, predicted_deflection, response, with_terms
from identification.fit.heavy_tails import OwnErrors, log_tails, student_weights
from identification.fit.linear_start import check_sign, start_of
from identification.fit.linearised import Linearised
from identification.fit.load_test import LoadTest
from identification.fit.marginal import Draws, posterior_draws, shrunk
from identification.fit.noise import NoiseModel, Weights, noise_model
from identification.fit.noise_parts import SetUp, VarianceComponents
from identification.fit.optional_parts import Way, asked_for, averaged_trials
from identification.fit.priors import PriorModel
from identification.fit.sag import BesideWeight, sag_columns
from identification.fit.student import DEGREES
from identification.fit.variance_components import ComponentPosterior, Trials, integrated_out, likeliest, log_covariance
from identification.model.effects_in_force import EFFECTS, SPRINGS, split
from identification.model.load_state import LoadState

Array = NDArray[np.float64]

MAX_STEPS = 200
MAX_ROUNDS = 8
# Steps after which a fiftieth of a posterior standard deviation is near enough: differences in a term can rattle.
PATIENCE = 30
# A step under so many posterior standard deviations is the last; while the noise is not settled, too.
CLOSE, ON_THE_WAY = 1e-3, 0.1
# A search that has gained so little of ln posterior in that many steps is at the top: where a law has an edge (the torque at
# which a gear crosses its play moves with the springs) it creeps along that edge for ever.
SETTLED = 1e-3


@dataclass(frozen=True, eq=False)
class Posterior:
    """Posterior of x = (ln c, parameters of terms): its MAP, and about it what is asked for, worked out when it is.

    data: what it was fitted to. components: estimated variance components. weights: Sigma^-1 with them and the row weights.
    at_map: the model linearised at the MAP, its prior with the terms' parameters.
    """

    data: LoadTest
    components: VarianceComponents
    weights: Weights
    at_map: Linearised
    terms: tuple[Term, ...] = ()

    @cached_property
    def trials(self) -> Trials:
        """Variance components spread over what the rows leave open of them."""
        return averaged_trials(self.at_map, self.components, self.beside)

    @cached_property
    def draws(self) -> Draws:
        """Weighted draws of x, the variance components integrated out."""
        return posterior_draws(self.at_map, self.components, self.trials, self.beside)

    @cached_property
    def beside(self) -> Array:
        """Columns (n, 3, m) of the arm's unknown weight, in the noise's coordinates, which are free beside the model; none with
        the published prior."""
        return _FittedModel(self.data, self.terms, self.data.rows.deflection, self.prior).beside(self.at_map.noise, self.map)

    @cached_property
    def likeliest(self) -> Array:
        """x (6 + P,) at which the rows are likeliest with the arm's unknown weight free beside it."""
        if not self.beside.shape[2]:
            return self.map
        model = _FittedModel(self.data, self.terms, np.nan_to_num(self.data.rows.deflection), self.prior)
        return _read_only(_maximise(model, self.at_map, BesideWeight(self.weights, self.beside)).x)

    @cached_property
    def mean(self) -> Array:
        """Mean (6 + P,) of x, that of the draws."""
        return _read_only(self.draws.mean)

    @cached_property
    def covariance(self) -> Array:
        """Covariance (6 + P, 6 + P) of x, that of the draws."""
        return _read_only(self.draws.covariance)

    @cached_property
    def information(self) -> Array:
        """The data's information (6 + P, 6 + P) on x at the MAP."""
        return _read_only(self.weights.inner(self.at_map.design, self.at_map.design))

    @cached_property
    def laplace(self) -> Array:
        """Inverse curvature (6 + P, 6 + P) at the MAP (paper eq. 13, in x)."""
        curvature = shrunk(self.information, self.components.degrees) + self.prior.precision(self.map)
        return _read_only(np.asarray(np.linalg.inv(curvature), dtype=float))

    @cached_property
    def quick_covariance(self) -> Array:
        """Covariance (6 + P, 6 + P) of x by the curvature at the MAP, the arm's unknown weight free beside it: `covariance` but
        for what is open of the noise, and a hundredth of its work."""
        columns = np.concatenate([self.beside, self.at_map.design], axis=2)
        information = integrated_out(self.weights.inner(columns, columns)[None], self.beside.shape[2])[0][0]
        curvature = shrunk(information, self.components.degrees) + self.prior.precision(self.map)
        return _read_only(np.asarray(np.linalg.inv(curvature), dtype=float))

    @cached_property
    def components_covariance(self) -> Array:
        """Covariance (6, 6) of ln of the variance components."""
        return _read_only(log_covariance(ComponentPosterior(self.at_map), self.components))

    @cached_property
    def log_tails(self) -> float:
        """What the heavy tails of the noise add to ln p of the rows as they are weighed."""
        if np.isinf(self.components.degrees):
            return 0.0
        errors = OwnErrors.of(self.at_map, self.components, self.weights)
        return log_tails(errors, self.at_map.row_weight, self.components.degrees)

    @cached_property
    def chi2(self) -> float:
        """Of the residual against the stated noise."""
        noise, column = self.at_map.noise, self.at_map.residual[:, :, None]
        stated = noise.weights(VarianceComponents().with_values(np.array([1.0, *noise.stated[1:]])))
        return float(stated.inner(column, column)[0, 0])

    @cached_property
    def with_usual_noise(self) -> Posterior:
        """The posterior from the same rows without the parts of the noise that come in only where the rows ask for them."""
        return posterior(self.data, self.terms, self, usual_noise=True)

    @property
    def readings(self) -> int:
        """Measured components of deflections."""
        return int(self.at_map.noise.measured.sum())

    @property
    def map(self) -> Array:
        """The MAP of x (6 + P,)."""
        return self.at_map.x

    @property
    def log_compliance(self) -> Array:
        """ln c (6,) at the MAP."""
        return self.map[SPRINGS]

    @property
    def compliance(self) -> Array:
        """c (6,) [rad/(N m)] at the MAP."""
        return np.exp(self.log_compliance)

    @property
    def term_values(self) -> list[Array]:
        """The parameter values of each term at the MAP."""
        return split(self.map[EFFECTS], self.terms)

    @property
    def prior(self) -> PriorModel:
        """Of x, the terms' parameters included."""
        return self.at_map.prior

    @property
    def row_weight(self) -> Array:
        """Of the fitted rows (n,): 1 for ordinary rows, small for gross errors."""
        return self.at_map.row_weight

    @property
    def components_log_std(self) -> Array:
        """How well the data tell the variance components: standard deviations (6,) of their ln."""
        return np.sqrt(np.diag(self.components_covariance))

    @cached_property
    def load_state(self) -> LoadState:
        """The fitted rows at the MAP, as the effects see them."""
        return self.data.load_state(self.compliance)

    @cached_property
    def residual(self) -> Array:
        """Measured minus predicted by the MAP (n, 3) [m], the fitted rows."""
        return self.residual_of(self.data)

    def predicted(self, data: LoadTest) -> Array:
        """Readings (n, 3) [m] the MAP gives for any rows."""
        return predicted_deflection(data, self.map, self.terms)

    def residual_of(self, data: LoadTest) -> Array:
        """Measured minus predicted by the MAP (n, 3) [m] of any rows."""
        return np.asarray(data.rows.deflection - self.predicted(data))

    def of_joints(self) -> Posterior:
        """The posterior of the joints alone, the terms' parameters integrated out."""
        at, none = self.at_map, np.empty(0)
        prior = replace(at.prior, term_mean=none, term_std=none, term_low=none, term_high=none)
        joints = replace(self, at_map=replace(at, design=at.design[:, :, SPRINGS], prior=prior, x=at.x[SPRINGS]), terms=())
        vars(joints).update(draws=self.draws.first(6), laplace=self.laplace[SPRINGS, SPRINGS], chi2=self.chi2,
                            components_covariance=self.components_covariance)
        return joints


def posterior(
    data: LoadTest, terms: Sequence[Term] = (), near: Posterior | None = None, *, usual_noise: bool = False,
) -> Posterior:
    """The posterior from these rows, with the terms in force; near: that of about the same rows, whose springs and noise the
    search begins with. usual_noise: without the parts that come in only where the rows ask for them.

    Raises CompstiffError: CS1009 no loaded row, CS1010 data that prefer all compliances negative, CS1011 no convergence.
    """
    rows = data.rows
    if not np.any(rows.wrench != 0):
        raise error("CS1009", "no loaded row has the purpose identify: all are kept for validation", file=rows.source)
    model = _FittedModel(data, tuple(terms), np.nan_to_num(rows.deflection), with_terms(data.prior, terms))
    check_sign(data, model.readings)
    springs = start_of(data, model.readings) if near is None else near.log_compliance
    x = np.concatenate([springs, *(term.start for term in terms)])
    components = VarianceComponents() if near is None else near.components.of_the_usual_parts()
    row_weight = np.ones(len(rows))
    further = Way((), SetUp.TURNED)
    at = model.linearised(model.noise(x), row_weight, x)
    for number in range(MAX_ROUNDS):
        before, last_weight = components, row_weight
        noise = model.noise(x).with_parts(*further.parts, set_up=further.set_up)
        # On the way a last small step leaves the design as it is; at the end it is worked out where the MAP is.
        at = replace(at, noise=noise, row_weight=row_weight)
        components = likeliest(ComponentPosterior(at), components)
        if number == 1 and not usual_noise:
            # Near enough to the MAP to see whether the rows ask for more than they usually do.
            further = asked_for(at, components, model.beside(noise, x))
            components = replace(components, set_up=further.set_up)
            noise = noise.with_parts(*further.parts, set_up=further.set_up)
            at = replace(at, noise=noise)
            components = likeliest(ComponentPosterior(at), components) if further.parts else components
        # A gross error hides behind the noise that it makes until it weighs little: heavy tails are tried first.
        errors = OwnErrors.of(at, components, at.weights(components))
        row_weight, degrees = student_weights(errors, DEGREES if number else DEGREES[:1])
        components = replace(components, degrees=degrees)
        weights = noise.weights(components, row_weight)
        at = _maximise(model, replace(at, row_weight=row_weight), weights, ON_THE_WAY)
        x = at.x
        # Components within five percent and weights within a twentieth are far inside their own uncertainty.
        if number and np.max(np.abs(components.logs - before.logs)) < 0.05 and np.max(np.abs(row_weight - last_weight)) < 0.05:
            break
    at = _maximise(model, model.linearised(at.noise, row_weight, x), weights)
    return Posterior(data, components, weights, at, model.terms)


@dataclass(frozen=True, eq=False)
class _FittedModel:
    """What the search goes through: readings (n, 3) [m], zero where not measured; prior: with the terms' parameters."""

    data: LoadTest
    terms: tuple[Term, ...]
    readings: Array
    prior: PriorModel

    def noise(self, x: Array) -> NoiseModel:
        """The noise of the rows at x, with what the terms may do otherwise at each visit."""
        noise = noise_model(self.data, np.exp(x[SPRINGS]))
        if not any(term.effect.by_visit for term in self.terms):
            return noise
        state = self.data.load_state(np.exp(x[SPRINGS]))
        moved = [term.effect.of_each_visit(state, term.joint, values)[:, :3]
                 for term, values in zip(self.terms, split(x[EFFECTS], self.terms), strict=True) if term.effect.by_visit]
        known = [] if noise.further is None else [noise.further]
        return replace(noise, further=np.concatenate([*known, *map(noise.whitened, moved)], axis=2))

    def beside(self, noise: NoiseModel, x: Array) -> Array:
        """`Posterior.beside` at x."""
        sag = sag_columns(self.data.load_state(np.exp(x[SPRINGS])), noise)
        return sag[:, :, :0] if self.prior.kind == "gaussian" else sag

    def linearised(self, noise: NoiseModel, row_weight: Array, x: Array) -> Linearised:
        """The model at x in the coordinates of `noise`."""
        position, slope = response(self.data, x, self.terms)
        residual = np.einsum("nij,nj->ni", noise.whitening, self.readings - position)
        return Linearised(noise, noise.whitening @ slope, residual, row_weight, self.prior, x)

    def residual(self, noise: NoiseModel, x: Array) -> Array:
        """Residual (n, 3) at x in the coordinates of `noise`."""
        predicted = predicted_deflection(self.data, x, self.terms)
        return np.asarray(np.einsum("nij,nj->ni", noise.whitening, self.readings - predicted))

    @property
    def step_limit(self) -> Array:
        """Longest step (6 + P,) of x in one go."""
        return np.concatenate([np.ones(6), *(3.0 * term.scale for term in self.terms)])


def _maximise(model: _FittedModel, at: Linearised, weights: Weights | BesideWeight, close: float = CLOSE) -> Linearised:
    """The model at the MAP of x for one noise (paper eq. 12), by damped Gauss-Newton from `at`, until a step is as close
    [posterior standard deviations]. Raises CS1011."""
    prior, step_limit, joints = at.prior, model.step_limit, np.arange(6)

    def cost(x: Array, residual: Array) -> float:
        column = residual[:, :, None]
        return 0.5 * float(weights.inner(column, column)[0, 0]) + prior.value(x)

    value, damping = cost(at.x, at.residual), 0.0
    passed = [value]
    for number in range(MAX_STEPS):
        both = weights.inner(at.design, at.columns)
        curvature, pull = both[:, :-1] + prior.search_curvature(at.x), both[:, -1]
        gradient = pull - prior.gradient(at.x)
        # eta is linear in c, not in ln c: where the data want a smaller c, its curvature is larger than Gauss-Newton's, which
        # would step to and fro for ever.
        curvature[joints, joints] += np.maximum(-pull[SPRINGS], 0.0)
        free = ~prior.pressed(at.x, gradient)
        damped = (curvature + damping * np.diag(np.diag(curvature)))[np.ix_(free, free)]
        step = np.zeros_like(at.x)
        step[free] = np.linalg.solve(damped, gradient[free])
        step = prior.inside(at.x + step * min(1.0, 1.0 / max(np.max(np.abs(step / step_limit)), 1e-300))) - at.x
        change = float(np.sqrt(step @ curvature @ step))
        x = at.x + step
        trial = model.residual(at.noise, x)
        trial_value = cost(x, trial)
        better = trial_value <= value + 1e-9 * (1 + abs(value))
        passed.append(min(value, trial_value))
        settled = number >= PATIENCE and passed[-1 - PATIENCE] - passed[-1] < SETTLED
        if better and (settled or change < (close if number < PATIENCE else max(close, 2e-2))):
            # So small a step leaves the design as it is.
            return replace(at, x=x, residual=trial)
        if settled:
            return at
        if not better:
            damping = max(10 * damping, 1e-3)
            continue
        value, damping = trial_value, 0.1 * damping
        at = model.linearised(at.noise, at.row_weight, x)
    raise error("CS1011", f"the fit did not converge in {MAX_STEPS} steps: the last moved by {change:.2g} posterior standard "
                "deviations", file=model.data.rows.source, hint="check the units and the prior")


def _read_only(values: Array) -> Array:
    read_only(values)
    return values

"""The posterior beyond Laplace: weighted draws of x, the variance components integrated out (posterior.py)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from identification.fit.linearised import Linearised
from identification.fit.noise_parts import VarianceComponents
from identification.fit.priors import PriorModel
from identification.fit.variance_components import Trials, integrated_out
from identification.model.effects_in_force import EFFECTS, SPRINGS

Array = NDArray[np.float64]

# The same draws every time, so that a result is the same for the same input.
DRAWS = 12_000
FEWEST_EFFECTIVE_DRAWS = 400.0
PROPOSAL_DEGREES = 8.0
# Where the components were told from a part of the rows, so many of them are carried through all rows.
COMPONENTS_OF_MANY_ROWS = 7
# Information of the data on a joint in units of the prior's, under which they say nothing of it.
UNSEEN_INFORMATION = 1e-3


@dataclass(frozen=True, eq=False)
class Draws:
    """Draws x (D, 6 + P) of the posterior with weights (D,) that sum to 1. effective: how many equal ones they are worth, 0
    where the importance weights were not used and the draws are Laplace's, over the variance components."""

    x: Array
    weight: Array
    effective: float

    @property
    def mean(self) -> Array:
        """Mean of x (6 + P,)."""
        return np.asarray(self.weight @ self.x)

    @property
    def covariance(self) -> Array:
        """Covariance of x (6 + P, 6 + P)."""
        off = self.x - self.mean
        return np.asarray((off * self.weight[:, None]).T @ off)

    def interval(self, level: float) -> Array:
        """Central interval (6 + P, 2) that holds this share of each parameter's draws."""
        wanted = [0.5 - 0.5 * level, 0.5 + 0.5 * level]
        return np.array([weighted_quantile(column, self.weight, wanted) for column in self.x.T])

    def radius(self, level: float, count: int) -> float:
        """Squared Mahalanobis distance, in the draws' own covariance, within which this share of the draws of the first
        `count` parameters lies: the mixture over variance components has heavier tails than a normal distribution."""
        off = (self.x - self.mean)[:, :count]
        distance = np.einsum("di,di->d", off, np.linalg.solve(self.covariance[:count, :count], off.T).T)
        return float(weighted_quantile(distance, self.weight, [level])[0])

    def first(self, count: int) -> Draws:
        """The same draws of the first `count` parameters."""
        return Draws(self.x[:, :count], self.weight, self.effective)


def weighted_quantile(values: Array, weight: Array, shares: list[float]) -> Array:
    """Values under which these shares of the weights (D,) lie."""
    order = np.argsort(values)
    below = np.cumsum(weight[order]) - 0.5 * weight[order]
    return np.asarray(np.interp(shares, below, values[order]))


def shrunk(information: Array, degrees: float) -> Array:
    """Expected information of a Student likelihood: (nu + p) / (nu + p + 2) of the one with its weights taken as known."""
    return information if np.isinf(degrees) else information * (degrees + 3) / (degrees + 5)


def posterior_draws(at: Linearised, components: VarianceComponents, trials: Trials, beside: Array) -> Draws:
    """Draws of x: each with variance components of its own, from Laplace's Gaussian for them, widened into a Student, and
    weighted by posterior over proposal. beside (n, 3, m): columns of 1 sigma each that are integrated out. The paper's Gaussian
    prior in k keeps Laplace's Gaussian, as published."""
    rng, prior, x = np.random.default_rng(0), at.prior, at.x
    gram, number = _grams(at, components, trials, beside)
    information, pull = shrunk(gram[:, :-1, :-1], components.degrees), shrunk(gram[:, :-1, -1], components.degrees)
    covariance = np.asarray(np.linalg.inv(information + prior.precision(x)), dtype=float)
    shift = np.einsum("sij,sj->si", covariance, pull - prior.gradient(x))
    root = np.linalg.cholesky(covariance)
    # In pairs, mirrored: Laplace's mean comes out exactly.
    normal = rng.standard_normal((DRAWS // 2, len(x)))
    normal, number = np.concatenate([normal, -normal]), np.concatenate([number, number])
    gaussian = Draws(x + shift[number] + np.einsum("dij,dj->di", root[number], normal), np.full(DRAWS, 1 / DRAWS), 0.0)
    if prior.kind == "gaussian":
        return gaussian
    stretch = np.sqrt(PROPOSAL_DEGREES / rng.chisquare(PROPOSAL_DEGREES, DRAWS // 2))
    wide = normal * np.concatenate([stretch, stretch])[:, None]
    draws = x + shift[number] + np.einsum("dij,dj->di", root[number], wide)
    log_weight = (_log_posterior(draws, x, information[number], pull[number], prior)
                  - _laplace_log_evidence(information, pull, covariance, prior, x)[number]
                  + 0.5 * (PROPOSAL_DEGREES + len(x)) * np.log1p(np.sum(wide**2, axis=1) / PROPOSAL_DEGREES))
    if not np.isfinite(log_weight.max()):
        # A parameter at its bound, with every draw beyond it.
        return gaussian
    weight = np.exp(log_weight - log_weight.max())
    weight /= weight.sum()
    effective = float(1.0 / np.sum(weight**2))
    if effective < FEWEST_EFFECTIVE_DRAWS:
        return gaussian
    return _with_unseen(Draws(draws, weight, effective), np.diag(information.mean(axis=0))[SPRINGS], prior)


def _grams(at: Linearised, components: VarianceComponents, trials: Trials, beside: Array) -> tuple[Array, NDArray[np.intp]]:
    """Gram (S, q, q) of the rows for some variance components, and which of them each draw of a half (DRAWS / 2,) has."""
    share = np.cumsum(trials.weight)
    if trials.gram is not None:
        number = np.searchsorted(share, (np.arange(DRAWS // 2) + 0.5) / (DRAWS // 2) * share[-1])
        used, number = np.unique(number, return_inverse=True)
        return trials.gram[used], number
    # So many rows tell the components well: equal shares of the trials, in the order of the first part, stand for all.
    order = np.argsort(trials.logs[:, 0])
    shares = (np.arange(COMPONENTS_OF_MANY_ROWS) + 0.5) / COMPONENTS_OF_MANY_ROWS
    chosen = order[np.searchsorted(np.cumsum(trials.weight[order]), shares)]
    columns = np.concatenate([beside, at.columns], axis=2)
    grams = [at.weights(components.with_logs(logs)).inner(columns, columns) for logs in trials.logs[chosen]]
    return integrated_out(np.array(grams), beside.shape[2])[0], np.arange(DRAWS // 2) % COMPONENTS_OF_MANY_ROWS


def _log_posterior(draws: Array, x: Array, information: Array, pull: Array, prior: PriorModel) -> Array:
    """ln posterior (D,) of draws but for a constant; the likelihood is Gaussian in c about the MAP x: c / c0 - 1 in place of
    ln c - x. information (D, p, p) and pull (D, p): curvature and gradient of the ln likelihood by ln c at x."""
    step = draws - x
    step[:, SPRINGS] = np.expm1(np.clip(step[:, SPRINGS], -50, 50))
    value = np.einsum("di,di->d", step, pull - 0.5 * (information @ step[:, :, None])[:, :, 0])
    value -= 0.5 * np.sum(((draws[:, SPRINGS] + np.log(prior.prior.stiffness)) / prior.prior.log_std) ** 2, axis=1)
    value -= 0.5 * np.sum(((draws[:, EFFECTS] - prior.term_mean) / prior.term_std) ** 2, axis=1)
    value[np.any(draws != prior.inside(draws), axis=1)] = -np.inf
    return np.asarray(value)


def _laplace_log_evidence(information: Array, pull: Array, covariance: Array, prior: PriorModel, x: Array) -> Array:
    """ln of the largest value of Laplace's posterior (S,), less its value at x: the components' weights have it already."""
    gradient = pull - prior.gradient(x)
    return np.asarray(0.5 * np.einsum("si,sij,sj->s", gradient, covariance, gradient))


def _with_unseen(draws: Draws, information: Array, prior: PriorModel) -> Draws:
    """A joint of which the data say nothing has its prior exactly, free of the draws' own scatter."""
    unseen = np.flatnonzero(information * prior.prior.log_std**2 < UNSEEN_INFORMATION)
    if not len(unseen):
        return draws
    x, mean, covariance = draws.x.copy(), draws.mean, draws.covariance
    # Apart from the others, then with the prior's mean and width.
    seen = np.setdiff1d(np.arange(x.shape[1]), unseen)
    off = x[:, unseen] - mean[unseen]
    off -= (x[:, seen] - mean[seen]) @ np.linalg.solve(covariance[np.ix_(seen, seen)], covariance[np.ix_(seen, unseen)])
    spread = (off * draws.weight[:, None]).T @ off
    white = np.linalg.solve(np.linalg.cholesky(spread), off.T).T
    x[:, unseen] = -np.log(prior.prior.stiffness[unseen]) + prior.prior.log_std[unseen] * white
    return Draws(x, draws.weight, draws.effective)

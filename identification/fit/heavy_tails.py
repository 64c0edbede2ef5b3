"""The heavy tails of a fit: degrees of freedom of a Student likelihood, what each row weighs in it, and what that costs.

A Student distribution is a normal one whose precision has a factor w, Gamma distributed about 1 (K. L. Lange, R. J. A.
Little, J. M. G. Taylor, Robust statistical modeling using the t distribution, JASA 84, 1989). What the other rows tell of a
row, of what its visit shares and of x, is a normal distribution: its own error is e_k along three axes, in units of its own
noise, with a variance v_k left open beside that of the noise, 1 / w. So its likelihood, its expected weight and the evidence
are one integral over w for each row, the others at their weights; a distance from fitted values, which a row has drawn to
itself, would take normal noise for a heavy one and hold heavy tails for far less likely than they are.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from math import lgamma

import numpy as np
from numpy.typing import NDArray

from identification.fit.linearised import Linearised
from identification.fit.noise import Weights
from identification.fit.noise_parts import ABSOLUTE, FORCE, PARTS, SENSOR, VarianceComponents
from identification.fit.student import DEGREES, DOUBLINGS
from identification.fit.variance_prior import log_prior

Array = NDArray[np.float64]
# ln w over which is summed: fine about 1, coarse where gross errors lie.
LOG_W = np.concatenate([np.arange(-16.0, -5.0, 0.5), np.arange(-5.0, 3.6, 0.2)])
WIDTH = np.gradient(LOG_W)
# Squared errors are taken as no larger: that far off a row weighs as much less as it is farther.
FARTHEST = 1e6
# ln of the scale that goes with each of DEGREES is searched in so many steps to each side, ever shorter ones.
STEPS, SHORTER = 3, (0.4, 0.1, 0.025)
# Of a variance that the row itself has told all but so much.
LEAST_KEPT = 1e-9
# Median of chi-squared over its mean, of three readings.
MEDIAN = 0.79


@dataclass(frozen=True, eq=False)
class OwnErrors:
    """As the other rows tell them, along three axes of its own for each row, in units of its noise: squared (n, 3) and the
    variance (n, 3) that is left open of them; count (n,) of the readings. prior: ln prior (...) of ln (...) of how many times
    the noise's variance is as large."""

    squared: Array
    left_open: Array
    count: NDArray[np.int_]
    prior: Callable[[Array], Array]

    @classmethod
    def of(cls, at: Linearised, components: VarianceComponents, weights: Weights) -> OwnErrors:
        """weights: those of `at` with these components."""
        measured = at.noise.measured
        unread = ~measured[:, :, None] * np.eye(3)
        root = np.linalg.cholesky(at.noise.of_rows_alone(components) + unread)
        own = np.where(measured, at.residual - weights.shared(at.residual[:, :, None])[:, :, 0], 0.0)
        beyond = at.design - weights.shared(at.design)
        covariance = np.linalg.inv(weights.inner(at.design, at.design) + at.prior.precision(at.x))
        told = weights.shared_covariance + beyond @ covariance @ np.swapaxes(beyond, 1, 2)
        variance, axes = np.linalg.eigh(np.swapaxes(root, 1, 2) @ told @ root)
        along = np.einsum("nik,nji,nj->nk", axes, root, own)
        kept = np.maximum(1.0 - at.row_weight[:, None] * variance, LEAST_KEPT)
        own_parts = 0.5 * np.isin(np.arange(len(PARTS)), (SENSOR, FORCE, ABSOLUTE))

        def prior(log_scale: Array) -> Array:
            logs = components.logs + log_scale[..., None] * own_parts
            return log_prior(at.noise, logs.reshape(-1, len(PARTS))).reshape(log_scale.shape)

        return cls((along / kept) ** 2, np.maximum(variance, 0.0) / kept, measured.sum(axis=1), prior)

    def scaled(self, scale: float) -> OwnErrors:
        """In units of a noise with so many times the variance."""
        return OwnErrors(self.squared / scale, self.left_open / scale, self.count, lambda log: self.prior(log + np.log(scale)))

    def log_likelihood(self, w: Array) -> Array:
        """ln p (n, ...) of each row for factors w (n or 1, ...) on the precision of its noise."""
        total = 0.5 * self.count[:, None] * np.log(w)
        for squared, left_open in zip(self.squared.T, self.left_open.T, strict=True):
            spread = 1.0 + w * left_open[:, None]
            total = total - 0.5 * (np.log(spread) + (squared / self.farther)[:, None] * w / spread)
        return np.asarray(total)

    @cached_property
    def farther(self) -> Array:
        """How many times the squares (n,) are larger than is computed with, 1 for all but gross errors."""
        return np.asarray(np.maximum(1.0, np.sum(self.squared / (1.0 + self.left_open), axis=1) / FARTHEST))


def student_weights(errors: OwnErrors, among: tuple[float, ...] = DEGREES) -> tuple[Array, float]:
    """Row weights (n,) and degrees of freedom, `among` these, of a Student likelihood of the rows' own errors.

    The degrees of freedom are those of the largest likelihood, each doubling of heaviness costing one unit of ln
    likelihood: without evidence of gross errors the weights are all 1.
    """
    best = among[0] if len(among) == 1 else likeliest_tails(errors)[0]
    if np.isinf(best):
        return np.ones(len(errors.count)), best
    joint = errors.log_likelihood(np.exp(LOG_W)[None]) + _log_weights(best, LOG_W)
    share = np.exp(joint - joint.max(axis=1, keepdims=True)) * WIDTH
    return np.asarray(share @ np.exp(LOG_W) / share.sum(axis=1) / errors.farther), best


def log_tails(errors: OwnErrors, row_weight: Array, degrees: float) -> float:
    """ln of how much likelier the rows are under the Student distribution than under the normal one of their weights (n,),
    which each row has chosen for itself: what the heavy tails of a fit cost it, their doublings with it."""
    over_w = _log_sum(errors.log_likelihood(np.exp(LOG_W)[None]), _log_weights(degrees, LOG_W)[:, None])
    return float(np.sum(over_w - errors.log_likelihood(row_weight[:, None])) - DOUBLINGS[DEGREES.index(degrees)])


def likeliest_tails(errors: OwnErrors) -> tuple[float, float]:
    """Degrees of freedom and the scale of the noise's variance that go best with them."""
    usual = _usual_scale(errors)
    errors = errors.scaled(usual)
    given_w = errors.log_likelihood(np.exp(LOG_W)[None])
    scale, value = np.zeros(len(DEGREES)), np.full(len(DEGREES), -np.inf)
    for length in SHORTER:
        tried = scale[:, None] + length * np.arange(-STEPS, STEPS + 1)
        heavy = [_log_weights(degrees, LOG_W[:, None] + logs) for degrees, logs in zip(DEGREES[:-1], tried[:-1], strict=True)]
        each = [_log_sum(given_w, np.concatenate(heavy, axis=1)), errors.log_likelihood(np.exp(-tried[-1])[None])]
        likelihood = np.concatenate([of_rows.sum(axis=0) for of_rows in each]).reshape(tried.shape) + errors.prior(tried)
        best = likelihood.argmax(axis=1)
        scale, value = np.take_along_axis(tried, best[:, None], 1)[:, 0], likelihood.max(axis=1)
    likeliest = int(np.argmax(value - DOUBLINGS))
    return DEGREES[likeliest], usual * float(np.exp(scale[likeliest]))


def _usual_scale(errors: OwnErrors) -> float:
    """About the scale of the noise's variance that half of the rows have, whatever the others are."""
    read = errors.count > 0
    each = np.sum(errors.squared / (1.0 + errors.left_open), axis=1)[read] / errors.count[read]
    return max(float(np.median(each)) / MEDIAN, 1e-9)


def _log_weights(degrees: float, log_w: Array) -> Array:
    """ln density of ln w, of a factor w that is Gamma distributed about 1 with these degrees of freedom."""
    half = 0.5 * degrees
    return np.asarray(half * (np.log(half) + log_w - np.exp(log_w)) - lgamma(half))


def _log_sum(given_w: Array, log_weights: Array) -> Array:
    """ln of the integral (n, m) over ln w of likelihoods (n, W) and each of the densities (W, m)."""
    most = given_w.max(axis=1, keepdims=True)
    return np.asarray(most + np.log(np.exp(given_w - most) @ (np.exp(log_weights) * WIDTH[:, None])))

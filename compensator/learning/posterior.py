"""The posterior of all parameters at given sizes of noise and remainder: one linear-Gaussian step, and the rounds of it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from compensator.learned.learned import NO_REMAINDER
from compensator.learned.remainder import Remainder
from compensator.learning.sizes import Sizes, noise_covariance
from compensator.learning.terms import Terms
from identification.common.arrays import Array


@dataclass(frozen=True, eq=False)
class Posterior:
    """mean (Z,), covariance (Z, Z) of z less the prior's mean: parameters x, set-up and drift, weights of the remainder."""

    mean: Array
    covariance: Array
    remainder: Remainder


def posterior(terms: Terms, sizes: Sizes) -> Posterior:
    """By the covariance of the rows: z = B H^T K^-1 residual, K = H B H^T + noise."""
    prior, columns, remainder = terms.physical_prior, terms.physical, NO_REMAINDER
    if sizes.amplitude > 0:
        remainder, slopes = terms.remainder(sizes.length, sizes.amplitude)
        free = terms.free(slopes)
        size, more = len(prior), slopes.shape[1]
        whole = np.zeros((size + more, size + more))
        whole[:size, :size], whole[size:, size:] = prior, sizes.amplitude**2 * free @ free.T
        prior, columns = whole, np.concatenate([columns, slopes], axis=1)
    across = prior @ columns.T
    covariance = columns @ across + noise_covariance(terms, sizes)
    gain = np.linalg.solve(covariance, across.T).T
    left = prior - gain @ across.T
    return Posterior(gain @ terms.residual, 0.5 * (left + left.T), remainder)


def expected(terms: Terms, found: Posterior, *, of_x: bool = True, of_job: bool = True, of_remainder: bool = True) -> Array:
    """What the parameters of a posterior make of the residual (n,) [m] of rows, also of others than it was made from."""
    size, job = terms.by_x.shape[1], terms.of_job.shape[1]
    value = np.zeros(len(terms.rows))
    if of_x:
        value += terms.by_x @ found.mean[:size]
    if of_job:
        value += terms.of_job @ found.mean[size:size + job]
    if of_remainder and len(found.remainder.places):
        rows = terms.rows
        value += rows.spread(found.remainder.basis(rows.position, rows.posture)) @ found.mean[size + job:]
    return value

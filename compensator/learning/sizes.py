"""How large noise and remainder are, by evidence: the likelihood of the rows with all parameters integrated out.

Beside the readings' own noise there is what neighbours along the path share and no smooth remainder is: places of the force,
edges, the feed's own pattern. It has a size and a length of its own (exponential, at most 10 mm) and is never carried on.
Without it neighbours would count as independent, and chance would be taken for a remainder.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from compensator.learning.terms import Terms
from identification.common.arrays import Array

# Lengths of the remainder [m] that are tried; weak log-normal priors, median and spread: factor on the stated noise, size
# and length of what neighbours share, amplitude and length of the remainder.
LENGTHS = (25e-3, 50e-3, 100e-3, 200e-3, 400e-3, 800e-3)
NOISE, SHARED, SHARED_LENGTH = (1.0, 1.0), (4e-6, 1.2), (4e-3, 0.5)
AMPLITUDE, LENGTH = (30e-6, 1.5), (150e-3, 1.0)
BOUNDS = [np.log([0.2, 20.0]), np.log([1e-7, 5e-4]), np.log([1e-3, 10e-3])]
WITH_REMAINDER = [*BOUNDS, np.log([1e-6, 2e-3])]


@dataclass(frozen=True)
class Sizes:
    """noise: factor on the stated sigma; shared [m], shared_length [m] of what neighbours share; amplitude, length [m] of the
    remainder, amplitude 0: none. evidence: ln of the likelihood times the priors of these."""

    noise: float
    shared: float
    shared_length: float
    amplitude: float = 0.0
    length: float = 1.0
    evidence: float = -np.inf


def noise_covariance(terms: Terms, sizes: Sizes) -> Array:
    """(n, n) [m^2] of the rows, without any parameter."""
    rows = terms.rows
    along = rows.length[rows.place]
    with np.errstate(under="ignore"):
        alike = np.exp(-np.abs(along[:, None] - along) / sizes.shared_length)
    covariance = sizes.shared**2 * alike * (rows.direction @ rows.direction.T)
    covariance[np.diag_indices(len(rows))] += (sizes.noise * rows.sigma) ** 2
    return np.asarray(covariance)


def log_evidence(terms: Terms, known: Array, sizes: Sizes) -> float:
    """ln p(residual | sizes) with the parameters' own covariance (n, n) `known`; -inf where that is no covariance."""
    from scipy.linalg import solve_triangular

    try:
        factor = np.linalg.cholesky(known + noise_covariance(terms, sizes))
    except np.linalg.LinAlgError:
        return -np.inf
    white = solve_triangular(factor, terms.residual, lower=True, check_finite=False)
    return float(-0.5 * white @ white - np.log(np.diag(factor)).sum() - 0.5 * len(white) * np.log(2 * np.pi))


def without_remainder(terms: Terms, start: Sizes | None = None, tries: int = 25) -> Sizes:
    """The likeliest sizes of the noise alone."""
    known = terms.physical @ terms.physical_prior @ terms.physical.T
    first = start or Sizes(1.0, SHARED[0], SHARED_LENGTH[0])
    return _likeliest(terms, lambda _: known, [first.noise, first.shared, first.shared_length], BOUNDS, 1.0, tries)


def with_remainder(terms: Terms, start: Sizes, length: float, tries: int = 25) -> Sizes:
    """The likeliest sizes with a remainder of this length [m]."""
    known = terms.physical @ terms.physical_prior @ terms.physical.T
    _, slopes = terms.remainder(length)
    free = slopes @ terms.free(slopes)
    own = free @ free.T
    first = [start.noise, start.shared, start.shared_length, start.amplitude or AMPLITUDE[0]]
    return _likeliest(terms, lambda amplitude: np.asarray(known + amplitude**2 * own), first, WITH_REMAINDER, length, tries)


def _likeliest(terms: Terms, known: Callable[[float], Array], first: list[float], bounds: list[Array], length: float,
               tries: int) -> Sizes:
    """Maximum of the evidence over the logarithms of the sizes; known: what the parameters add to the covariance (n, n), by the
    remainder's amplitude."""
    from scipy.optimize import minimize

    priors = np.log([NOISE[0], SHARED[0], SHARED_LENGTH[0], AMPLITUDE[0]])[:len(first)]
    spread = np.array([NOISE[1], SHARED[1], SHARED_LENGTH[1], AMPLITUDE[1]])[:len(first)]
    of_length = 0.5 * (np.log(length / LENGTH[0]) / LENGTH[1]) ** 2 if len(first) == 4 else 0.0

    def sizes(logs: Array) -> Sizes:
        noise, shared, shared_length, *amplitude = np.exp(logs).tolist()
        return Sizes(noise, shared, shared_length, *((amplitude[0], length) if amplitude else ()))

    def cost(logs: Array) -> float:
        chosen = sizes(logs)
        value = -log_evidence(terms, known(chosen.amplitude), chosen) + 0.5 * float(np.sum(((logs - priors) / spread) ** 2))
        return min(value + of_length, 1e12)

    low, high = np.array(bounds).T
    found = minimize(cost, np.clip(np.log(first), low, high), method="L-BFGS-B", bounds=list(zip(low, high, strict=True)),
                     options={"maxiter": tries, "eps": 1e-3, "ftol": 1e-9})
    best = sizes(found.x)
    return Sizes(best.noise, best.shared, best.shared_length, best.amplitude, best.length, -float(found.fun))

"""How large noise and remainder are, by evidence: the likelihood of the rows with all parameters integrated out.

Beside the readings' own noise there is what neighbours along the path share and no smooth remainder is, such as edges and the
feed's own pattern: of a size of its own, over SHARED_LENGTH, never carried on. Without it neighbours would count as
independent, and chance would be taken for a remainder. And where the predicted deviation is steep, at entries and corners, it
is as wrong as the place of the force is (the mean over a target's stretch, the sensor's clock): by `smear` times its slope.
Without that the corners, where the prediction is blurred, would decide about the springs: by 3 to 7 % too soft, on simulated
parts.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from compensator.learning.terms import Terms
from identification.common.arrays import Array

# Lengths of the remainder [m] that are tried; weak log-normal priors, median and spread: factor on the stated noise, size
# of what neighbours share, smear, amplitude and length of the remainder.
LENGTHS = (25e-3, 50e-3, 100e-3, 200e-3, 400e-3, 800e-3)
NOISE, SHARED, SMEAR = (1.0, 1.0), (2e-6, 1.2), (0.3e-3, 1.0)
SHARED_LENGTH = 8e-3
AMPLITUDE, LENGTH = (30e-6, 1.5), (150e-3, 1.0)
BOUNDS = [np.log([0.2, 20.0]), np.log([1e-7, 5e-4]), np.log([1e-6, 10e-3])]
WITH_REMAINDER = [*BOUNDS, np.log([1e-6, 2e-3])]


@dataclass(frozen=True)
class Sizes:
    """noise: factor on the stated sigma; shared [m]: of what neighbours share; smear [m]; amplitude, length [m] of the
    remainder, amplitude 0: none. evidence: ln of the likelihood times the priors of these."""

    noise: float
    shared: float
    smear: float
    amplitude: float = 0.0
    length: float = 1.0
    evidence: float = -np.inf


def of_neighbours(terms: Terms) -> Array:
    """(n, n) of what neighbours share, of size 1."""
    rows = terms.rows
    along = rows.length[rows.place]
    with np.errstate(under="ignore"):
        alike = np.exp(-np.abs(along[:, None] - along) / SHARED_LENGTH)
    return np.asarray(alike * (rows.direction @ rows.direction.T))


def noise_covariance(terms: Terms, sizes: Sizes, neighbours: Array | None = None) -> Array:
    """(n, n) [m^2] of the rows, without any parameter; neighbours: `of_neighbours`, where it is at hand."""
    rows = terms.rows
    covariance = sizes.shared**2 * (of_neighbours(terms) if neighbours is None else neighbours)
    covariance[np.diag_indices(len(rows))] += (sizes.noise * rows.sigma) ** 2 + (sizes.smear * rows.steep) ** 2
    return np.asarray(covariance)


def log_evidence(terms: Terms, known: Array, sizes: Sizes, neighbours: Array | None = None) -> float:
    """ln p(residual | sizes) with the parameters' own covariance (n, n) `known`; -inf where that is no covariance."""
    from scipy.linalg import solve_triangular

    try:
        factor = np.linalg.cholesky(known + noise_covariance(terms, sizes, neighbours))
    except np.linalg.LinAlgError:
        return -np.inf
    white = solve_triangular(factor, terms.residual, lower=True, check_finite=False)
    return float(-0.5 * white @ white - np.log(np.diag(factor)).sum() - 0.5 * len(white) * np.log(2 * np.pi))


def without_remainder(terms: Terms, start: Sizes | None = None, tries: int = 25) -> Sizes:
    """The likeliest sizes of the noise alone."""
    known = terms.physical @ terms.physical_prior @ terms.physical.T
    first = start or Sizes(1.0, SHARED[0], SMEAR[0])
    return _likeliest(terms, lambda _: known, [first.noise, first.shared, first.smear], BOUNDS, 1.0, tries)


def with_remainder(terms: Terms, start: Sizes, length: float, tries: int = 25) -> Sizes:
    """The likeliest sizes with a remainder of this length [m]."""
    known = terms.physical @ terms.physical_prior @ terms.physical.T
    _, slopes = terms.remainder(length)
    free = slopes @ terms.free(slopes)
    own = free @ free.T
    first = [start.noise, start.shared, start.smear, start.amplitude or AMPLITUDE[0]]
    return _likeliest(terms, lambda amplitude: np.asarray(known + amplitude**2 * own), first, WITH_REMAINDER, length, tries)


def _likeliest(terms: Terms, known: Callable[[float], Array], first: list[float], bounds: list[Array], length: float,
               tries: int) -> Sizes:
    """Maximum of the evidence over the logarithms of the sizes; known: what the parameters add to the covariance (n, n), by the
    remainder's amplitude."""
    from scipy.optimize import minimize

    priors = np.log([NOISE[0], SHARED[0], SMEAR[0], AMPLITUDE[0]])[:len(first)]
    spread = np.array([NOISE[1], SHARED[1], SMEAR[1], AMPLITUDE[1]])[:len(first)]
    of_length = 0.5 * (np.log(length / LENGTH[0]) / LENGTH[1]) ** 2 if len(first) == 4 else 0.0

    def sizes(logs: Array) -> Sizes:
        noise, shared, smear, *amplitude = np.exp(logs).tolist()
        return Sizes(noise, shared, smear, *((amplitude[0], length) if amplitude else ()))

    neighbours = of_neighbours(terms)

    def cost(logs: Array) -> float:
        chosen = sizes(logs)
        value = of_length + 0.5 * float(np.sum(((logs - priors) / spread) ** 2))
        return min(value - log_evidence(terms, known(chosen.amplitude), chosen, neighbours), 1e12)

    low, high = np.array(bounds).T
    found = minimize(cost, np.clip(np.log(first), low, high), method="L-BFGS-B", bounds=list(zip(low, high, strict=True)),
                     options={"maxiter": tries, "eps": 1e-3, "ftol": 1e-9})
    best = sizes(found.x)
    return Sizes(best.noise, best.shared, best.smear, best.amplitude, best.length, -float(found.fun))

"""How large noise and remainder are, by evidence: the likelihood of the rows with all parameters integrated out.

Beside the readings' own noise there is what neighbours along the path share and no smooth remainder is, such as edges and the
feed's own pattern: of a size of its own, over SHARED_LENGTH, never carried on. Without it neighbours would count as
independent, and chance would be taken for a remainder. And where the predicted deviation is steep, at entries and corners, it
is as wrong as the place of the force is (the mean over a target's stretch, the sensor's clock): by `smear` times its slope.
Without that the corners, where the prediction is blurred, would decide about the springs: by 3 to 7 % too soft, on simulated
parts.
"""

from __future__ import annotations

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
    covariance += terms.cutter**2
    return np.asarray(covariance)


def log_evidence(
    terms: Terms, known: Array, sizes: Sizes, neighbours: Array, of_remainder: Array | None = None,
) -> tuple[float, Array]:
    """ln p(residual | sizes), and its slope by ln noise, ln shared, ln smear and, with a remainder, ln amplitude; -inf where K
    is no covariance.

    known (n, n): what the parameters' own covariance gives; neighbours (n, n): `of_neighbours`; of_remainder (n, n): that of a
    remainder of amplitude 1. The slope by a size is half of a^T dK a - tr(K^-1 dK), with a = K^-1 residual.
    """
    from scipy.linalg.lapack import dpotri

    covariance = known + noise_covariance(terms, sizes, neighbours)
    if of_remainder is not None:
        covariance += sizes.amplitude**2 * of_remainder
    try:
        factor = np.linalg.cholesky(covariance)
    except np.linalg.LinAlgError:
        return -np.inf, np.zeros(3 if of_remainder is None else 4)
    upper = dpotri(factor.T, lower=0)[0]        # of K^-1, nothing below it
    diagonal = np.diag(upper)
    pull = upper @ terms.residual + upper.T @ terms.residual - diagonal * terms.residual
    value = -0.5 * terms.residual @ pull - np.log(np.diag(factor)).sum() - 0.5 * len(pull) * np.log(2 * np.pi)

    def by(share: Array) -> float:
        """Slope by the ln of a size whose square times `share` (n, n) stands in K, over that square."""
        return float(pull @ share @ pull - 2 * np.vdot(upper, share) + diagonal @ np.diag(share))

    alone = pull**2 - diagonal
    slope = [sizes.noise**2 * float(alone @ terms.rows.sigma**2), sizes.shared**2 * by(neighbours),
             sizes.smear**2 * float(alone @ terms.rows.steep**2)]
    return float(value), np.array(slope if of_remainder is None else [*slope, sizes.amplitude**2 * by(of_remainder)])


def without_remainder(terms: Terms, start: Sizes | None = None, tries: int = 25) -> Sizes:
    """The likeliest sizes of the noise alone."""
    first = start or Sizes(1.0, SHARED[0], SMEAR[0])
    return _likeliest(terms, None, [first.noise, first.shared, first.smear], BOUNDS, 1.0, tries)


def with_remainder(terms: Terms, start: Sizes, length: float, tries: int = 25) -> Sizes:
    """The likeliest sizes with a remainder of this length [m]."""
    _, slopes = terms.remainder(length)
    free = slopes @ terms.free(slopes)
    first = [start.noise, start.shared, start.smear, start.amplitude or AMPLITUDE[0]]
    return _likeliest(terms, free @ free.T, first, WITH_REMAINDER, length, tries)


def _likeliest(terms: Terms, of_remainder: Array | None, first: list[float], bounds: list[Array], length: float,
               tries: int) -> Sizes:
    """Maximum of the evidence over the logarithms of the sizes; of_remainder (n, n) as in `log_evidence`."""
    from scipy.optimize import minimize

    priors = np.log([NOISE[0], SHARED[0], SMEAR[0], AMPLITUDE[0]])[:len(first)]
    spread = np.array([NOISE[1], SHARED[1], SMEAR[1], AMPLITUDE[1]])[:len(first)]
    of_length = 0.5 * (np.log(length / LENGTH[0]) / LENGTH[1]) ** 2 if len(first) == 4 else 0.0
    known, neighbours = terms.physical @ terms.physical_prior @ terms.physical.T, of_neighbours(terms)

    def sizes(logs: Array) -> Sizes:
        noise, shared, smear, *amplitude = np.exp(logs).tolist()
        return Sizes(noise, shared, smear, *((amplitude[0], length) if amplitude else ()))

    def cost(logs: Array) -> tuple[float, Array]:
        value, slope = log_evidence(terms, known, sizes(logs), neighbours, of_remainder)
        off = (logs - priors) / spread
        return min(of_length + 0.5 * float(off @ off) - value, 1e12), off / spread - slope

    low, high = np.array(bounds).T
    found = minimize(cost, np.clip(np.log(first), low, high), jac=True, method="L-BFGS-B",
                     bounds=list(zip(low, high, strict=True)), options={"maxiter": tries, "ftol": 1e-9})
    best = sizes(found.x)
    return Sizes(best.noise, best.shared, best.smear, best.amplitude, best.length, -float(found.fun))

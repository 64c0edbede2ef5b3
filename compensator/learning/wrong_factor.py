"""A measured deviation that is no sane multiple of the predicted one is refused: a mistake in the files, and no motion."""

from __future__ import annotations

import numpy as np

from compensator.learning.sizes import Sizes, noise_covariance
from compensator.learning.terms import Terms
from identification.common.arrays import Array, rms
from identification.common.findings import Finding, Refused
from identification.common.quantities import two_sigma

# A factor on the predicted deflection outside of this is a mistake, not motion; so many standard errors make it sure.
SANE, SURE = (0.5, 2.0), 3.0
# A deflection under this [m] RMS says nothing of a factor.
HARDLY = 3e-6


def refuse_wrong_factor(terms: Terms, noise: Sizes, predicted: Array, source: str) -> None:
    """Refused (CS5310) where the measured deviation is surely no sane multiple of the predicted (n,) [m] beside set-up and
    drift: another sign, frame, unit, log or part."""
    if rms(predicted) < HARDLY:
        return
    prior = terms.physical_prior
    size = terms.by_x.shape[1]
    job = terms.of_job @ prior[size:, size:] @ terms.of_job.T
    whitened = np.linalg.solve(job + noise_covariance(terms, noise), np.column_stack([predicted, terms.residual]))
    power = float(predicted @ whitened[:, 0])
    factor, error = 1.0 + float(predicted @ whitened[:, 1]) / power, 1.0 / np.sqrt(power)
    if SANE[0] <= factor + SURE * error and factor - SURE * error <= SANE[1]:
        return
    raise Refused(Finding(
        "CS5310", "error", f"the measured deviation is {factor:.3g} +- {two_sigma(error):.2g} times the predicted (2 sigma), "
        f"expected {SANE[0]:g} to {SANE[1]:g}: nothing is learned", file=source,
        hint="sign: measured minus planned? frame: the work object? micrometres? the log of this very pass? force_log.sign; "
        "--logged-with where the pass had offsets"))

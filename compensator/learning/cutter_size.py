"""What is the same along the normals all over a part is no deflection: a cutter that is thicker or thinner than it is said to
be, its run-out, a probe's ball. Walls that are all cut alike are pushed off alike, so that it would pass for a softer robot."""

from __future__ import annotations

import numpy as np

from compensator.correction.settings import Estimate
from compensator.learning.sizes import Sizes, noise_covariance
from compensator.learning.terms import Terms
from identification.common.findings import Finding
from identification.common.quantities import two_sigma

# 1 sigma [m] of that amount where the points show none, and before they were looked at; engineering judgement: a tool setter,
# run-out and a probe's calibration together, and a cutter that was ground again.
ASSUMED, ANY = 10e-6, 0.2e-3


def common_amount(terms: Terms, sizes: Sizes) -> Estimate:
    """How far [m] the part is off along all normals alike, by the rows, everything else free."""
    ones = np.ones(len(terms.rows))
    covariance = terms.physical @ terms.physical_prior @ terms.physical.T + noise_covariance(terms, sizes)
    covariance = covariance + (ANY**2 - terms.cutter**2) * np.outer(ones, ones)
    solved = np.linalg.solve(covariance, np.column_stack([ones, terms.residual]))
    told = ANY**2 * float(ones @ solved[:, 0])
    return Estimate(ANY**2 * float(ones @ solved[:, 1]), ANY * float(np.sqrt(max(1.0 - told, 0.0))))


def said_of_cutter(amount: Estimate | None, source: str) -> list[Finding]:
    """A warning (CS5334) where the points show such an amount."""
    if amount is None:
        return []
    side = "out of" if amount.value > 0 else "within"
    return [Finding("CS5334", "warning", f"all along their normals the points stand {1e6 * abs(amount.value):.0f} +- "
                    f"{1e6 * two_sigma(amount.std):.2g} um (2 sigma) {side} the planned surface, whatever the force: taken "
                    "off, and no part of what is learned", file=source,
                    hint="the cutter's radius (ground again, worn, running out of true), --tool-radius-mm, or the probe's "
                    "own: measure the cutter, and take it off the points")]

"""How far a part may be off in the ways that no point showed, by how far it is off in those that the points did show.

A set-up is a displacement like another: a part that is 0.1 mm aside is not 1 mm too high. Of set-up and drift, each in shares
of its sigma beforehand, the directions that the points show (fitted_part.py) have values v of one size about zero, so that a
further one is off by a Student t of as many degrees of freedom r as there are of them:

    variance = sum v^2 / max(r - 2, 1),    never more than the points leave of it by themselves.

A remainder that was learned is as wide along what no point shows as along the rest, rigid displacements among it, so that its
variance is stated of a set-up already, and taken off. Nothing is learned there and nothing corrected; it is what is expected to
be left on the part.
"""

from __future__ import annotations

import numpy as np

from compensator.learned.learned import DRIFT, SETUP
from compensator.learning.posterior import posterior
from compensator.learning.sizes import Sizes
from compensator.learning.terms import Terms
from identification.common.arrays import Array

# A displacement of the job that is not known to this share of what was assumed before is not shown by the points.
UNSHOWN = 0.05


def unshown(every: Terms, sizes: Sizes) -> Array:
    """Covariance (9, 9) [m^2] of the set-up and drift that the rows do not show; every: the terms with all of both."""
    found, size, result = posterior(every, sizes), every.by_x.shape[1], np.zeros((SETUP + DRIFT, SETUP + DRIFT))
    for part, stated in ((slice(0, SETUP), sizes.amplitude), (slice(SETUP, SETUP + DRIFT), 0.0)):
        where, std = size + np.arange(SETUP + DRIFT)[part], every.of_job_std[part]
        value, covariance = found.mean[where] / std, found.covariance[np.ix_(where, where)] / np.outer(std, std)
        known, directions = np.linalg.eigh(covariance)
        shown = known < UNSHOWN**2
        alike = np.sum((directions[:, shown].T @ value) ** 2) / max(int(shown.sum()) - 2, 1) if shown.any() else np.inf
        left = directions[:, ~shown] * std[:, None]
        already = stated**2 / np.maximum(np.sum(left**2, axis=0), 1e-300)
        result[part, part] = left * np.maximum(np.minimum(known[~shown], alike) - already, 0.0) @ left.T
    return result

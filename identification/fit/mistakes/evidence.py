"""How likely a fitted model makes its rows, all parameters and the noise's sizes integrated out."""

from __future__ import annotations

import numpy as np

from identification.fit.posterior import Posterior
from identification.fit.variance_components import ComponentPosterior


def log_evidence(fitted: Posterior) -> float:
    """ln p(rows) by Laplace, but for what models of the same rows have in common."""
    at = fitted.at_map
    given_noise = float(ComponentPosterior(at)(fitted.components.logs[None])[0][0])
    free = np.flatnonzero(at.noise.active)
    volume = 0.5 * float(np.linalg.slogdet(2 * np.pi * fitted.components_covariance[np.ix_(free, free)])[1])
    prior = 0.5 * float(np.linalg.slogdet(at.prior.precision(at.x))[1]) - at.prior.value(at.x)
    return given_noise + prior + volume

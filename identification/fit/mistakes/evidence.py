"""How likely a fitted model makes its rows, all parameters and the noise's sizes integrated out."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from identification.fit.noise import USUAL_SETUP, VarianceComponents
from identification.fit.posterior import Posterior
from identification.fit.student import log_tails
from identification.fit.variance_components import ComponentPosterior

# Components of the noise up to so many times the stated ones where noise may have taken up what a mistake does.
ORDINARY = 2.0


def log_evidence(fitted: Posterior) -> float:
    """ln p(rows) by Laplace, the arm's unknown weight integrated out too, but for what models of the same rows have in common;
    rows that count for little cost what their heavy tails cost."""
    at = fitted.at_map
    given_noise = float(ComponentPosterior(at, fitted.beside)(fitted.components.logs[None])[0][0])
    free = np.flatnonzero(at.noise.active)
    volume = 0.5 * float(np.linalg.slogdet(2 * np.pi * fitted.components_covariance[np.ix_(free, free)])[1])
    prior = 0.5 * float(np.linalg.slogdet(at.prior.precision(at.x))[1]) - at.prior.value(at.x)
    return given_noise + prior + volume + log_tails(at.noise, fitted.components, fitted.weights, at.residual)


def ordinary(fitted: Posterior) -> VarianceComponents:
    """The fit's noise, no part of it larger than ordinary; the sensor's only where it is stated. A set-up of the forces is
    ordinary up to the relative error that is stated of them: nobody states whether that is a row's or a visit's."""
    components, noise = fitted.components.at_most(ORDINARY), fitted.data.cell.noise
    if fitted.at_map.noise.stated[0]:
        components = replace(components, sensor=min(components.sensor, ORDINARY))
    if noise.force_relative_stated:
        of_visits = max(ORDINARY, noise.force_relative / USUAL_SETUP)
        components = replace(components, setup=min(fitted.components.setup, of_visits))
    return components


def under_ordinary_noise(fitted: Posterior) -> Posterior:
    """The fit as a place to look for causes from, as if no part of the noise, stated or not, were larger than ordinary and no
    row counted for less: what is larger may be there for want of a cause."""
    components = fitted.components.with_values(np.minimum(fitted.components.values, ORDINARY))
    ordinary = replace(fitted, weights=fitted.at_map.noise.weights(components))
    # At the same MAP the rows are in the same state, and every effect shows alike in them.
    vars(ordinary)["load_state"] = fitted.load_state
    return ordinary

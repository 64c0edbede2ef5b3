"""How likely a fitted model makes its rows, all parameters and the noise's sizes integrated out."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from identification.fit.noise_parts import USUAL_SETUP, VarianceComponents
from identification.fit.posterior import Posterior
from identification.fit.variance_components import ComponentPosterior

# Components of the noise up to so many times the stated ones where noise may have taken up what a mistake does.
ORDINARY = 2.0


def log_evidence(fitted: Posterior) -> float:
    """ln p(rows) by Laplace, the arm's unknown weight integrated out too, but for what models of the same rows have in common;
    rows that count for little cost what their heavy tails cost."""
    free = np.flatnonzero(fitted.at_map.noise.active)
    given_noise = float(ComponentPosterior(fitted.at_map, fitted.beside)(fitted.components.logs[None])[0][0])
    volume = 0.5 * float(np.linalg.slogdet(2 * np.pi * fitted.components_covariance[np.ix_(free, free)])[1])
    return given_noise + volume + _beside_noise(fitted)


def averaged_evidence(fitted: Posterior) -> float:
    """The same, averaged over the ways in which the parts of the noise may be there that need not be (optional_parts.py)."""
    return fitted.trials.log_evidence + _beside_noise(fitted)


def _beside_noise(fitted: Posterior) -> float:
    """What the prior and the heavy tails add to ln p(rows)."""
    at = fitted.at_map
    prior = 0.5 * float(np.linalg.slogdet(at.prior.precision(at.x))[1]) - at.prior.value(at.x)
    return prior + fitted.log_tails


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

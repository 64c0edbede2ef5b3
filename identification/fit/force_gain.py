"""A load cell whose scale is off: the same in all rows, so that no deflection tells it, and all springs are off with it.

    d x / d ln F = -(J^T Sigma^-1 J + prior)^-1 J^T Sigma^-1 d eta / d ln F

is how the parameters that fit the readings move where all forces were larger by a share: of springs alone all compliances
together, by that share less. What is fitted is given that the scale is right; what is delivered has the sigma of its
calibration (measurement.force_gain_std) along this direction too. Rows that the same cell loads are predicted without it.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from identification.common.arrays import Array
from identification.fit.fitted_model import predicted_deflection
from identification.fit.marginal import Draws
from identification.fit.posterior import Posterior

STEP = 1e-4


def by_force_gain(fitted: Posterior) -> Array:
    """By how much x (6 + P,) is off where the load cell reads a sigma of its scale too little; zeros where none is stated."""
    gain, data = fitted.data.cell.noise.force_gain, fitted.data
    if not gain:
        return np.zeros(len(fitted.map))
    larger = data.with_rows(replace(data.rows, wrench=np.exp(STEP) * data.rows.wrench))
    more = (predicted_deflection(larger, fitted.map, fitted.terms) - fitted.predicted(data)) / STEP
    column = fitted.at_map.noise.whitened(more[:, :, None])
    return np.asarray(-gain * fitted.laplace @ fitted.weights.inner(fitted.at_map.design, column)[:, 0])


def delivered(fitted: Posterior) -> Draws:
    """The draws of x, the scale of the load cell drawn with them."""
    moved, draws = by_force_gain(fitted), fitted.draws
    if not moved.any():
        return draws
    scale = np.random.default_rng(0).standard_normal(len(draws.x) // 2)
    # In pairs of one sign each: the mean stays that of the fit.
    scale = np.concatenate([scale, -scale, np.zeros(len(draws.x) % 2)])
    return replace(draws, x=fitted.prior.inside(draws.x + scale[:, None] * moved))

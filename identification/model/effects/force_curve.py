"""The force measurement is not linear: under large loads it is off by another share than under small ones."""

from __future__ import annotations

import numpy as np

from identification.common.arrays import Array
from identification.model.effects.base import Parameter
from identification.model.effects.kinds import ONE_SIZE, OfWrench
from identification.model.load_state import LoadState

# Loads under it that are so many times each other tell a curve from a scale (engineering judgement).
FEWEST_TIMES = 1.2


class ForceCurve(OfWrench):
    """True force = (1 + a |F| / 1 kN) reported force. What is off at small loads is `force_gain`, which no deflection shows."""

    name = "force_curve"
    family = "force measurement"
    leaves_open = "force_gain"
    formula_source = "engineering judgement: the first term by which a manometer's or an amplifier's curve is no straight line"
    parameters = (Parameter("per_kn", "1/kN", 0.03, -1.0, 1.0,
                            source="engineering judgement: a manometer of class 1.6 at a third of its range",
                            bounds_source="engineering judgement: either way, to twice or nothing at a kilonewton"),)
    sentence = "the force measurement is not linear: it is off by another share under large loads than under small ones"
    settles = "hang two known weights, one and both: do the readings add up?"

    def missing(self, rows: LoadState) -> str:
        size = np.linalg.norm(rows.wrench[:, :3], axis=1)
        loaded = size[size > 0]
        return ONE_SIZE if not len(loaded) or loaded.max() < FEWEST_TIMES * loaded.min() else ""

    def true_wrench(self, rows: LoadState, joint: int | None, values: Array) -> Array:
        size = np.linalg.norm(rows.wrench[:, :3], axis=1)
        return np.asarray(rows.wrench * (1.0 + values[0] * size / 1000.0)[:, None])

"""The force measurement is not linear: under large loads it is off by another share than under small ones."""

from __future__ import annotations

import numpy as np

from identification.common.arrays import Array
from identification.model.effects.base import Parameter
from identification.model.effects.kinds import ONE_SIZE, OfWrench
from identification.model.load_state import LoadState

# Loads under it that are so many times each other tell a curve from a scale (engineering judgement).
FEWEST_TIMES = 1.2
# A load is along an axis where this share of it is; the cosine of 10 degrees.
ALONG = 0.985


class PushAndPull(OfWrench):
    """True force = (1 + s m / 2) reported force, s the sign of its largest component in the base frame. What is off in common
    is `force_gain`, which no deflection shows."""

    name = "force_curve"
    law = "pull"
    family = "force measurement"
    leaves_open = "force_gain"
    formula_source = ("engineering judgement: a cylinder pulls with the area of its ring, a load cell has a gain for tension "
                      "and one for compression; set up along the base's axes, it pulls where the force is negative")
    parameters = (Parameter("share", "1", 0.03, -1.0, 1.0,
                            source="engineering judgement: load cells' tension and compression by one per cent, a cylinder's "
                                   "ring by its rod",
                            bounds_source="engineering judgement: either way, to a rod as thick as the piston"),)
    sentence = ("the force measurement is off by another share when the load pulls than when it pushes (the ring's area of a "
                "cylinder, tension and compression of a load cell)")
    settles = "hang a known weight on the sensor, and stand it on the sensor"

    def missing(self, rows: LoadState) -> str:
        force, side = np.abs(rows.wrench[:, :3]), _side(rows)
        along = force.max(axis=1) >= ALONG * np.linalg.norm(force, axis=1)
        if not along.all():
            return "the loads are not along the axes of the base"
        return "" if {-1.0, 1.0} <= set(side.tolist()) else "no axis is loaded both ways"

    def true_wrench(self, rows: LoadState, joint: int | None, values: Array) -> Array:
        return np.asarray(rows.wrench * (1.0 + 0.5 * values[0] * _side(rows))[:, None])


class ForceCurve(OfWrench):
    """True force = (1 + a |F| / 1 kN) reported force. What is off at small loads is `force_gain`, which no deflection shows."""

    name = "force_curve"
    other_laws = (PushAndPull(),)
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


def _side(rows: LoadState) -> Array:
    """Sign (n,) of the largest component of the force, 0 where there is none."""
    force = rows.wrench[:, :3]
    largest = np.argmax(np.abs(force), axis=1)
    return np.asarray(np.sign(force[np.arange(len(force)), largest]))

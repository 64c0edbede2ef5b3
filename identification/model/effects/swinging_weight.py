"""A weight still swings while the deflection is read."""

from __future__ import annotations

import numpy as np

from identification.common.arrays import Array
from identification.model.effects.base import Effect, Parameter
from identification.model.effects.kinds import ONLY_AS_SCATTER, nothing_hangs
from identification.model.load_state import LoadState


class SwingingWeight(Effect):
    """A side force m g alpha of random direction in each reading, alpha the angle of the rope there: scatter across the load
    and in proportion to it, no displacement of its own. Over whole swings the mean pull is m g exactly, and plumb; within one
    the upright part changes by alpha^2, which is nothing."""

    name = "swinging_weight"
    family = "load path"
    of_robot = False
    formula_source = ("engineering judgement: a pendulum pulls along its rope; its momentum repeats with the swing, so "
                      "the mean force is the weight")
    parameters = (Parameter("angle_rad", "rad", 0.01, 0.0, 0.2,
                            source="engineering judgement: 1 sigma across, half the amplitude of a swing of 20 mm on 1 m",
                            bounds_source="engineering judgement: none, to a swing of 23 degrees, which nobody reads at"),)
    sentence = "the weight swung while it was read, so that its pull was not plumb"
    settles = "let the weight hang still, damp it with a pad or in water, or read the mean over whole swings"

    def missing(self, rows: LoadState) -> str:
        return nothing_hangs(rows) or ONLY_AS_SCATTER

    def contribution(self, rows: LoadState, joint: int | None, values: Array) -> Array:
        return np.zeros((len(rows), 6))

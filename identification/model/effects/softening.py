"""The robot gives way more, or less, from row to row."""

from __future__ import annotations

import numpy as np

from identification.common.arrays import Array
from identification.model.effects.base import Effect, Parameter
from identification.model.effects.drift import clock
from identification.model.load_state import LoadState

HOUR_S = 3600.0


class Softening(Effect):
    """The springs' deflection grows by `s t`, t the time since the first row: gears soften while they warm up. A force
    measurement whose gain wanders looks the same. The springs told are those of the first row: not those to mill with."""

    name = "softening"
    family = "structure"
    of_robot = False
    unsettles = True
    formula_source = "engineering judgement: a warm-up is slow against a measurement, so its first order in time is enough"
    parameters = (
        Parameter("per_hour", "1/h", 0.1, -2.0, 2.0,
                  source="engineering judgement: some per cent from cold grease to warm, within half an hour",
                  bounds_source="engineering judgement: what is three times as soft after an hour would have been noticed"),
    )
    sentence = "the robot gives way more, or less, from row to row: it warms up, or the gain of the force measurement wanders"
    settles = "warm the robot up, measure again, and repeat the first pose at the end"

    def contribution(self, rows: LoadState, joint: int | None, values: Array) -> Array:
        time: Array = np.asarray(clock(rows))
        hours = np.nan_to_num(time - np.nanmin(time)) / HOUR_S
        return np.asarray(values[0] * hours[:, None] * rows.elastic)

"""What is read from rests elsewhere while no load is on: anew at each pose."""

from __future__ import annotations

import numpy as np

from identification.common.arrays import Array
from identification.model.effects.base import Effect, Parameter
from identification.model.effects.kinds import ONLY_AS_SCATTER
from identification.model.load_state import LoadState


class UnsettledZero(Effect):
    """The readings without load of a pose lie aside of where its loaded ones, of either sign, meet: by a random displacement of
    each pose, the same for its readings. Scatter of what is read, no displacement of the arm; of every pose alike it is
    `sensor_step.seating`."""

    name = "unsettled_zero"
    family = "deflection measurement"
    of_robot = False
    formula_source = "engineering judgement: what any load seats, whichever way it pulls (a target, a plate), rests loosely"
    parameters = (Parameter("rest_m", "m", 3e-6, 0.0, 1e-3,
                            source="engineering judgement: the usual re-seating of a target, a few micrometres (1 sigma)",
                            bounds_source="engineering judgement: the clearance of what hangs or clips on, under 1 mm"),)
    sentence = ("what the sensors look at, or their stand, rests elsewhere without load: at each pose its zero readings lie "
                "aside of the loaded ones")
    settles = "fasten the target and the stand, or hold them down by a spring; load and unload once before each zero reading"

    def missing(self, rows: LoadState) -> str:
        return ONLY_AS_SCATTER

    def contribution(self, rows: LoadState, joint: int | None, values: Array) -> Array:
        return np.zeros((len(rows), 6))

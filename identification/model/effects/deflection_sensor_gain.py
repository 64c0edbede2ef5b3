"""The scales of the lasers are off: reading = (1 + g) d."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from identification.model.effects.base import Effect, Parameter
from identification.model.load_state import LoadState

Array = NDArray[np.float64]


class DeflectionSensorGain(Effect):
    """g_i d_i."""

    name = "deflection_sensor_gain"
    family = "deflection measurement"
    of_robot = False
    parameters = (Parameter("x", "1", 0.014, -0.3, 0.3),
                  Parameter("y", "1", 0.014, -0.3, 0.3),
                  Parameter("z", "1", 0.014, -0.3, 0.3),)
    sentence = "a deflection sensor reads too much or too little"
    settles = "move the target by a gauge block in front of each sensor"

    def contribution(self, rows: LoadState, joint: int | None, values: Array) -> Array:
        read = np.zeros_like(rows.elastic)
        read[:, :3] = values * rows.elastic[:, :3]
        return read

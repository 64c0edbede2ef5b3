"""The scales of the lasers are off: reading = (1 + g) d."""

from __future__ import annotations

import numpy as np

from identification.common.arrays import Array
from identification.model.effects.kinds import OfReading, along_axes
from identification.model.load_state import LoadState


class DeflectionSensorGain(OfReading):
    """g_i d_i."""

    name = "deflection_sensor_gain"
    formula_source = ("J. A. Bosch, Coordinate Measuring Machines and Systems, 1995: cosine error, in proportion to the "
                      "travel")
    parameters = along_axes(
        "{}", "1", 0.014, 0.6,
        source="the same: the cosine of 9.6 degrees is 1.4 % under 1; that a sensor stands so far off is engineering "
               "judgement",
        bounds_source="the same: the cosine of 66 degrees is 59 % under 1")
    sentence = "a deflection sensor reads too much or too little"
    settles = "move the target by a gauge block in front of each sensor"

    def misread(self, rows: LoadState, values: Array) -> Array:
        return np.asarray(values * rows.elastic[:, :3])

"""The laser triad is turned against the base: reading = Rot(r) d."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from identification.model.effects.base import Effect, Parameter
from identification.model.load_state import LoadState
from identification.model.rotations import rotation_matrix

Array = NDArray[np.float64]


class DeflectionSensorRotation(Effect):
    """`(Rot(r) - 1) d`: 1 degree mixes 1.7 % of the sideways motion in."""

    name = "deflection_sensor_rotation"
    family = "deflection measurement"
    of_robot = False
    parameters = (Parameter("rx_rad", "rad", 0.025, -0.2, 0.2),
                  Parameter("ry_rad", "rad", 0.025, -0.2, 0.2),
                  Parameter("rz_rad", "rad", 0.025, -0.2, 0.2),)
    sentence = "the deflection sensors are turned against the robot's base axes"
    settles = "jog the robot along base x, y and z without force and read the sensors"

    def contribution(self, rows: LoadState, joint: int | None, values: Array) -> Array:
        read = np.zeros_like(rows.elastic)
        read[:, :3] = rows.elastic[:, :3] @ rotation_matrix(values).T - rows.elastic[:, :3]
        return read

"""The laser triad is turned against the base: reading = Rot(r) d."""

from __future__ import annotations

import numpy as np

from identification.common.arrays import Array
from identification.model.effects.kinds import OfReading, along_axes
from identification.model.load_state import LoadState
from identification.model.rotations import rotation_matrix


class DeflectionSensorRotation(OfReading):
    """`(Rot(r) - 1) d`: 1 degree mixes 1.7 % of the sideways motion in."""

    name = "deflection_sensor_rotation"
    formula_source = "engineering judgement: the three sensors sit on one bracket, which turns as a rigid body"
    parameters = along_axes(
        "r{}_rad", "rad", 0.025, 1.8,
        source="engineering judgement: 1 to 2 degrees, their geometric mean, what a bracket set up by eye is off",
        bounds_source="engineering judgement: 103 degrees, axes of a hall that stand a quarter of a turn off, and more")
    sentence = "the deflection sensors are turned against the robot's base axes"
    settles = "jog the robot along base x, y and z without force and read the sensors"

    def misread(self, rows: LoadState, values: Array) -> Array:
        return np.asarray(rows.elastic[:, :3] @ rotation_matrix(values).T - rows.elastic[:, :3])

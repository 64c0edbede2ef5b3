"""In a log taken in motion part of the logged torque accelerates the motor."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from identification.model.effects.base import ONLY_IN_MOTION, Effect, Parameter
from identification.model.joint_log import JointLog
from identification.model.load_state import LoadState

Array = NDArray[np.float64]


class MotorInertia(Effect):
    """`-c J acceleration`."""

    name = "motor_inertia"
    family = "gear"
    of_robot = True
    joints = (1, 2, 3, 4, 5, 6)
    parameters = (Parameter("inertia_kg_m2", "kg*m^2", 300.0, 0.0, 5000.0),)
    sentence = "part of the logged torque of joint {joint} accelerates its motor and never reaches the gear's spring"
    settles = "move at constant speed"

    def missing(self, rows: LoadState) -> str:
        return ONLY_IN_MOTION

    def contribution(self, rows: LoadState, joint: int | None, values: Array) -> Array:
        return np.zeros((len(rows), 6))

    def log_contribution(self, log: JointLog, values: Array) -> Array:
        return np.asarray(-log.compliance * values[0] * log.acceleration)

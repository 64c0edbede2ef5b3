"""In a log taken in motion part of the drive torque never reaches the spring."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from identification.model.effects.base import ONLY_IN_MOTION, Effect, Parameter, saturated
from identification.model.joint_log import JointLog
from identification.model.load_state import LoadState

Array = NDArray[np.float64]
# Below this speed [rad/s] the sign of the motion is noise.
STANDSTILL = 2e-3


class JointFriction(Effect):
    """`-c (F_c sign(speed) + F_v speed)`."""

    name = "joint_friction"
    family = "gear"
    of_robot = True
    joints = (1, 2, 3, 4, 5, 6)
    parameters = (Parameter("coulomb_nm", "N*m", 100.0, 0.0, 5000.0),
                  Parameter("viscous_nm_s_per_rad", "N*m*s/rad", 100.0, 0.0, 20000.0),)
    sentence = "friction of joint {joint} takes part of the logged torque before it reaches the gear's spring"
    settles = "move slowly and fast in both directions"

    def missing(self, rows: LoadState) -> str:
        return ONLY_IN_MOTION

    def contribution(self, rows: LoadState, joint: int | None, values: Array) -> Array:
        return np.zeros((len(rows), 6))

    def log_contribution(self, log: JointLog, values: Array) -> Array:
        lost = values[0] * saturated(log.speed / STANDSTILL) + values[1] * log.speed
        return np.asarray(-log.compliance * lost)

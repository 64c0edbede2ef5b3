"""In a log taken in motion part of the drive torque never reaches the spring."""

from __future__ import annotations

import numpy as np

from identification.common.arrays import Array
from identification.model.effects.base import Parameter, saturated
from identification.model.effects.kinds import InMotion
from identification.model.joint_log import JointLog

# Below this speed [rad/s] the sign of the motion is noise.
STANDSTILL = 2e-3


class JointFriction(InMotion):
    """`-c (F_c sign(speed) + F_v speed)`."""

    name = "joint_friction"
    family = "gear"
    of_robot = True
    joints = (1, 2, 3, 4, 5, 6)
    parameters = (Parameter("coulomb_nm", "N*m", 100.0, 0.0, 5000.0),
                  Parameter("viscous_nm_s_per_rad", "N*m*s/rad", 100.0, 0.0, 20000.0),)
    sentence = "friction of joint {joint} takes part of the logged torque before it reaches the gear's spring"
    settles = "move slowly and fast in both directions"

    def log_contribution(self, log: JointLog, values: Array) -> Array:
        lost = values[0] * saturated(log.speed / STANDSTILL) + values[1] * log.speed
        return np.asarray(-log.compliance * lost)

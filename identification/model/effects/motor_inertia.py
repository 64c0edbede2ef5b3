"""In a log taken in motion part of the logged torque accelerates the motor."""

from __future__ import annotations

import numpy as np

from identification.common.arrays import Array
from identification.model.effects.base import Parameter
from identification.model.effects.documents import KR300, WERNHOLT
from identification.model.effects.kinds import InMotion
from identification.model.joint_log import JointLog


class MotorInertia(InMotion):
    """`-c J acceleration`."""

    name = "motor_inertia"
    family = "gear"
    of_robot = True
    joints = (1, 2, 3, 4, 5, 6)
    formula_source = f"{WERNHOLT}: the motor's torque balance"
    parameters = (
        Parameter("inertia_kg_m2", "kg*m^2", 300.0, 0.0, 5000.0,
                  source=f"{KR300}: para.J_mr times para.u^2 is 238 to 844 kg m^2",
                  bounds_source="engineering judgement: 6 times the largest of the KR300's"),
    )
    sentence = "part of the logged torque of joint {joint} accelerates its motor and never reaches the gear's spring"
    settles = "move at constant speed"

    def log_contribution(self, log: JointLog, values: Array) -> Array:
        return np.asarray(-log.compliance * values[0] * log.acceleration)

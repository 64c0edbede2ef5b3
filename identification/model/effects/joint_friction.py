"""In a log taken in motion part of the drive torque never reaches the spring."""

from __future__ import annotations

import numpy as np

from identification.common.arrays import Array
from identification.model.effects.base import Parameter, saturated
from identification.model.effects.documents import KR300, WERNHOLT
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
    formula_source = ("A. Carvalho Bittencourt, E. Wernholt, S. Sander-Tavallaey, T. Brogardh, An Extended Friction Model "
                      "to Capture Load and Temperature Effects in Robot Joints, LiTH-ISY-R-2948, 2010, its terms in speed; "
                      f"before the spring: {WERNHOLT}")
    parameters = (
        Parameter("coulomb_nm", "N*m", 100.0, 0.0, 5000.0,
                  source=f"{KR300}: para.f_coul is 10 to 285 N m",
                  bounds_source="engineering judgement: 17 times the largest of the KR300's"),
        Parameter("viscous_nm_s_per_rad", "N*m*s/rad", 100.0, 0.0, 20000.0,
                  source=f"{KR300}: para.f_vis is 454 to 2307 N m s/rad; 100 for a smaller robot is engineering judgement",
                  bounds_source="engineering judgement: 9 times the largest of the KR300's"),
    )
    sentence = "friction of joint {joint} takes part of the logged torque before it reaches the gear's spring"
    settles = "move slowly and fast in both directions"

    def log_contribution(self, log: JointLog, values: Array) -> Array:
        lost = values[0] * saturated(log.speed / STANDSTILL) + values[1] * log.speed
        return np.asarray(-log.compliance * lost)

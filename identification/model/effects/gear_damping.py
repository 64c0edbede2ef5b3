"""In a log taken in motion the gear's twist lags behind its torque, the faster this changes the more."""

from __future__ import annotations

import numpy as np

from identification.common.arrays import Array
from identification.model.effects.base import Parameter
from identification.model.effects.kinds import InMotion
from identification.model.joint_log import JointLog


class GearDamping(InMotion):
    """`-c L dtau/dt`: a damper D beside the spring makes the twist late by L = D / k, to first order. A torque that was
    recorded so much too early looks the same."""

    name = "gear_damping"
    family = "gear"
    of_robot = True
    joints = (1, 2, 3, 4, 5, 6)
    formula_source = ("engineering judgement: the Kelvin-Voigt model, a spring and a damper side by side, to first order in "
                      "the damper")
    parameters = (
        Parameter("lag_s", "s", 3e-4, 0.0, 4e-3,
                  source="engineering judgement: twice the damping ratio over the resonance, 1 % at 10 Hz",
                  bounds_source="engineering judgement: none, to a damping ratio of 12 % at 10 Hz"),
    )
    sentence = "the gear of joint {joint} is damped: its twist is late behind the torque"
    settles = "compare the clocks of torque and encoders; move at several speeds in both directions"

    def log_contribution(self, log: JointLog, values: Array) -> Array:
        return np.asarray(-log.compliance * values[0] * np.gradient(log.torque, log.time))

"""A gear that is softer under small torques (two-slope torsion curve of harmonic and cycloidal gears)."""

from __future__ import annotations

import numpy as np

from identification.common.arrays import Array
from identification.model.effects.base import Parameter, saturated
from identification.model.effects.kinds import GearTwist
from identification.model.joint_log import JointLog
from identification.model.load_state import LoadState

# K3 / K1 - 1 of harmonic gears, 1.5 to 1.9 in data sheets.
SOFTER = 0.8


class SoftZone(GearTwist):
    """`J_i a (sat((g + tau) / T) - sat(g / T))`: below T the gear yields by a / T more for each newton metre. Its typical size
    follows from the joint: K3/K1 = 1.8 makes a = 0.8 T c_i."""

    name = "soft_zone"
    of_gravity = True
    parameters = (Parameter("extra_rad", "rad", 4e-5, 0.0, 3e-3),
                  Parameter("torque_nm", "N*m", 100.0, 5.0, 1500.0, grid=(50.0, 90.0, 160.0, 280.0), shape=True),)
    sentence = "the gear of joint {joint} is softer under small torques than under large ones"
    settles = "a torque ladder on this joint through zero with small steps"

    def twist(self, rows: LoadState, i: int, values: Array) -> Array:
        extra, torque = values
        gravity = rows.gravity[:, i]
        return np.asarray(extra * (saturated((gravity + rows.torque[:, i]) / torque) - saturated(gravity / torque)))

    def typical(self, rows: LoadState, joint: int | None) -> Array:
        torque = self.parameters[1].typical
        return np.array([SOFTER * torque * rows.compliance[self.index(joint)], torque])

    def log_contribution(self, log: JointLog, values: Array) -> Array:
        return np.asarray(values[0] * saturated(log.torque / values[1]))

"""A gear that is softer under small torques (two-slope torsion curve of harmonic and cycloidal gears)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from identification.model.effects.base import Effect, Parameter, saturated
from identification.model.joint_log import JointLog
from identification.model.load_state import LoadState

Array = NDArray[np.float64]
# K3 / K1 - 1 of harmonic gears, 1.5 to 1.9 in data sheets.
SOFTER = 0.8


class SoftZone(Effect):
    """`J_i a (sat((g + tau) / T) - sat(g / T))`: below T the gear yields by a / T more for each newton metre. Its typical size
    follows from the joint: K3/K1 = 1.8 makes a = 0.8 T c_i."""

    name = "soft_zone"
    family = "gear"
    of_robot = True
    of_gravity = True
    joints = (1, 2, 3, 4, 5, 6)
    gear_law = True
    parameters = (Parameter("extra_rad", "rad", 4e-5, 0.0, 3e-3),
                  Parameter("torque_nm", "N*m", 100.0, 5.0, 1500.0, grid=(50.0, 90.0, 160.0, 280.0), shape=True),)
    sentence = "the gear of joint {joint} is softer under small torques than under large ones"
    settles = "a torque ladder on this joint through zero with small steps"

    def contribution(self, rows: LoadState, joint: int | None, values: Array) -> Array:
        i = (joint or 1) - 1
        extra, torque = values
        gravity = rows.gravity[:, i]
        turned = extra * (saturated((gravity + rows.torque[:, i]) / torque) - saturated(gravity / torque))
        return np.asarray(rows.jacobian[:, :, i] * turned[:, None])

    def typical(self, rows: LoadState, joint: int | None) -> Array:
        torque = self.parameters[1].typical
        return np.array([SOFTER * torque * rows.compliance[(joint or 1) - 1], torque])

    def log_contribution(self, log: JointLog, values: Array) -> Array:
        return np.asarray(values[0] * saturated(log.torque / values[1]))

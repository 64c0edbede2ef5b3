"""Free play of a gear: crossed when the torque at the gear changes its sign against gravity's."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from identification.common.arrays import Array
from identification.model.effects.base import Parameter, saturated
from identification.model.effects.documents import NABTESCO
from identification.model.effects.kinds import SOFTER_NEAR_ZERO, GearTwist
from identification.model.joint_log import JointLog
from identification.model.load_state import LoadState

# Friction holds the gear in its gap below this torque [N m]: engineering judgement, small against any cutting load's.
FRICTION_NM = 2.0
# A force's direction is trusted to this angle [rad], engineering judgement: a smaller torque may have either sign.
MISALIGNED = 0.03


class Backlash(GearTwist):
    """`J_i b (s(g + tau) - s(g))`, s the sign, linear within a small friction threshold: a load whose sign the force error
    decides tells nothing. On joints that gravity loads it shows only where the load beats gravity."""

    name = "backlash"
    of_gravity = True
    formula_source = ("M. Nordin, J. Galic, P.-O. Gutman, New Models for Backlash and Gear Play, Int. J. Adapt. Control "
                      "Signal Process. 11, 1997: the classical dead zone, solved for the twist")
    parameters = (
        Parameter("half_gap_rad", "rad", 4.6e-5, 0.0, 1.5e-3,
                  source=f"{NABTESCO}: 0.1 to 0.3 arcmin; half of 0.32",
                  bounds_source="engineering judgement: none, to ten times the 1 arcmin that a new gear's hysteresis loss "
                                "stays under, a worn-out gear"),
    )
    near_laws = ("soft_zone",)
    law_family = SOFTER_NEAR_ZERO
    sentence = "the gear of joint {joint} has free play: it moves by its gap when the torque on it changes sign"
    turning = "crosses its gap"
    settles = "turn the joint to and fro by a lever at the flange with a dial gauge on it: free play shows without force"

    def twist(self, rows: LoadState, i: int, values: Array) -> Array:
        gravity = rows.gravity[:, i]
        return np.asarray(values[0] * (_sign(gravity + rows.torque[:, i]) - _sign(gravity)))

    def side(self, rows: LoadState, joint: int | None, values: Array) -> Array:
        i = self.index(joint)
        return np.trunc(_sign(rows.gravity[:, i] + rows.torque[:, i]))

    def undecided(self, rows: LoadState, joint: int | None) -> NDArray[np.bool_]:
        i = self.index(joint)
        lever = np.linalg.norm(rows.jacobian[:, :3, i], axis=1)
        doubt = np.maximum(FRICTION_NM, MISALIGNED * lever * np.linalg.norm(rows.wrench[:, :3], axis=1))
        return np.asarray((np.abs(rows.gravity[:, i] + rows.torque[:, i]) < doubt) & np.any(rows.wrench != 0, axis=1))

    def log_contribution(self, log: JointLog, values: Array) -> Array:
        return np.asarray(values[0] * _sign(log.torque))


def _sign(torque: Array) -> Array:
    return saturated(torque / FRICTION_NM)

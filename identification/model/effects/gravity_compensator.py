"""The spring or cylinder that carries the lower arm makes joint 2's stiffness change with its angle."""

from __future__ import annotations

import numpy as np

from identification.common.arrays import Array
from identification.model.effects.base import Parameter
from identification.model.effects.kinds import GearTwist, SizeAndAngle
from identification.model.load_state import LoadState


class GravityCompensator(SizeAndAngle, GearTwist):
    """`J_2 tau_2 c_2 alpha cos(2 q2 + phi)`; linear in alpha cos phi and alpha sin phi."""

    carries_weight = True
    name = "gravity_compensator"
    joints = (2,)
    gear_law = False
    formula_source = ("A. Klimchik et al., Identification of geometrical and elastostatic parameters of heavy industrial "
                      "robots, arXiv 1311.6810, 2013: compensators complicate the stiffness model; the second harmonic of "
                      "the angle: engineering judgement")
    parameters = (
        Parameter("amplitude", "1", 0.27, 0.0, 1.0,
                  source="engineering judgement: 0.15 to 0.5, their geometric mean",
                  bounds_source="engineering judgement: beyond 1 the joint's compliance would be negative at some angle"),
        Parameter("phase_rad", "rad", 1.0, -3.1416, 3.1416, shape=True,
                  source="engineering judgement: no angle is more likely than another",
                  bounds_source="engineering judgement: any direction, a full turn"),
    )
    sentence = "joint 2 is stiffer at some of its angles than at others, as a gravity compensator makes it"
    settles = ("look whether a spring or cylinder carries the lower arm: where the robot file has no links, a gear that grows "
               "stiffer under the arm's weight looks the same; measure at more angles of joint 2")

    def twist(self, rows: LoadState, i: int, values: Array) -> Array:
        share = values[0] * np.cos(2 * rows.theta[:, i] + values[1])
        return np.asarray(rows.torque[:, i] * rows.compliance[i] * share)

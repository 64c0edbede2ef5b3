"""In a log taken in motion a joint's deflection follows the torque of another joint."""

from __future__ import annotations

import numpy as np

from identification.common.arrays import Array
from identification.model.effects.base import Parameter
from identification.model.effects.kinds import InMotion
from identification.model.joint_log import JointLog


class TorqueCrosstalk(InMotion):
    """`x tau_j`, tau_j the torque of another joint."""

    name = "torque_crosstalk"
    family = "deflection measurement"
    of_robot = False
    joints = (1, 2, 3, 4, 5, 6)
    formula_source = ("engineering judgement: an encoder sits on a part that another gear's torque bends, or hears its drive, "
                      "in proportion to that torque")
    parameters = (
        Parameter("compliance_rad_per_nm", "rad/(N*m)", 1e-8, -1e-4, 1e-4,
                  source="engineering judgement: a tenth of what the gear of a large robot yields",
                  bounds_source="engineering judgement: either sign, to the compliance of a small robot's gear"),
    )
    sentence = "the encoders of joint {joint} follow the torque of another joint: it bends what they sit on"
    settles = "move the other joint alone, and this one alone"

    def __init__(self, source: int = 1) -> None:
        self.source = source

    @property
    def where(self) -> dict[str, int | str | float]:
        return {"torque_of": self.source}

    def told(self, joint: int | None) -> str:
        return f"the encoders of joint {joint} follow the torque of joint {self.source}: it bends what they sit on"

    def log_contribution(self, log: JointLog, values: Array) -> Array:
        other = log.others.get(self.source)
        return np.zeros(len(log.time)) if other is None else np.asarray(values[0] * other)

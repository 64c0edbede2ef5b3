"""In a log taken in motion an error of gear or encoder repeats with the angle."""

from __future__ import annotations

import numpy as np

from identification.common.arrays import Array
from identification.model.effects.base import Parameter
from identification.model.effects.kinds import InMotion
from identification.model.joint_log import JointLog


class TransmissionError(InMotion):
    """`s sqrt(2) cos(angle) + a cos(n angle + phi)`: a smooth part once a turn of the joint, s its RMS over a turn, and a line
    that repeats n times a turn. A log may show several lines and a smooth part of any low order; they are searched for, not
    taken from a grid, and what is told here is the strongest."""

    name = "transmission_error"
    family = "gear"
    of_robot = True
    joints = (1, 2, 3, 4, 5, 6)
    formula_source = ("engineering judgement: gears and encoders turn, so what they get wrong repeats with their angle; "
                      "gear trains and couplings give other numbers a turn than whole multiples of the motor's")
    parameters = (
        Parameter("smooth_rad", "rad", 1e-4, 0.0, 2e-3,
                  source="engineering judgement: a code ring of 100 mm radius that sits 15 um off its axis, as RMS",
                  bounds_source="engineering judgement: the same ring, 0.3 mm off its axis"),
        Parameter("line_rad", "rad", 1e-5, 0.0, 1e-3,
                  source="docs/real-data.md: lines of 1 to 92 urad on three axes of a KUKA KR300",
                  bounds_source="engineering judgement: 3 arcmin, several times the backlash of a gear for robots"),
        Parameter("cycles_per_turn", "1", 500.0, 2.0, 4000.0, shape=True,
                  source="docs/real-data.md: 413 to 1653 a turn on three axes of a KUKA KR300",
                  bounds_source="engineering judgement: from the ovality of a ring to sixteen times the motor's turns at a "
                                "ratio of 250"),
        Parameter("phase_rad", "rad", 1.0, -3.1416, 3.1416, shape=True,
                  source="engineering judgement: no angle is more likely than another",
                  bounds_source="engineering judgement: any direction, a full turn"),
    )
    sentence = "the gear or an encoder of joint {joint} has an error that repeats with its angle"
    settles = "move the joint slowly over the same angles in both directions, at two speeds"

    def log_contribution(self, log: JointLog, values: Array) -> Array:
        smooth, size, cycles, phase = values
        return np.asarray(smooth * np.sqrt(2.0) * np.cos(log.angle) + size * np.cos(cycles * log.angle + phase))

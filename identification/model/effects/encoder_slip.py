"""In a log taken in motion the zero between the two encoders of a joint leaps."""

from __future__ import annotations

import numpy as np

from identification.common.arrays import Array
from identification.model.effects.base import Parameter
from identification.model.effects.kinds import InMotion
from identification.model.joint_log import JointLog

AT = Parameter("at_s", "s", 10.0, 0.0, 1e6, shape=True, source="engineering judgement: any time of a record",
               bounds_source="engineering judgement: any time of a record")


class EncoderSlip(InMotion):
    """`s` from a time on."""

    name = "encoder_slip"
    family = "deflection measurement"
    of_robot = False
    joints = (1, 2, 3, 4, 5, 6)
    formula_source = "engineering judgement: a coupling that slips, or counts that are lost: another zero from then on"
    parameters = (
        Parameter("shift_rad", "rad", 5e-5, -0.1, 0.1,
                  source="engineering judgement: 10 arcsec, some steps of an encoder of 17 bits",
                  bounds_source="engineering judgement: none, to more than any coupling slips unseen"), AT)
    sentence = "an encoder of joint {joint} slipped or lost counts during the record: its zero is another from then on"
    settles = "tighten the coupling of the link encoder, and record the same motion again"

    def log_contribution(self, log: JointLog, values: Array) -> Array:
        return np.asarray(values[0] * (log.time >= values[1]))

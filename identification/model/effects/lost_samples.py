"""In a log taken in motion one encoder's channel loses samples: from then on it tells another time."""

from __future__ import annotations

import numpy as np

from identification.common.arrays import Array
from identification.model.effects.base import Parameter
from identification.model.effects.encoder_slip import AT
from identification.model.effects.kinds import InMotion
from identification.model.joint_log import JointLog


class LostSamples(InMotion):
    """The link's angle as it was `delay_s` before, from a time on; a negative delay: samples of the link's channel are
    missing."""

    name = "lost_samples"
    family = "deflection measurement"
    of_robot = False
    joints = (1, 2, 3, 4, 5, 6)
    formula_source = "engineering judgement: a recorder that drops samples of one channel writes the later ones too early"
    parameters = (
        Parameter("delay_s", "s", 0.008, -1.0, 1.0, source="engineering judgement: a frame or two at 250 Hz",
                  bounds_source="engineering judgement: none, to a whole second"), AT)
    sentence = ("samples of one encoder's channel of joint {joint} were lost, or written twice: from then on the two encoders "
                "do not belong to the same time")
    settles = "look for gaps in the recorder's own counter, and record the same motion again"

    def log_contribution(self, log: JointLog, values: Array) -> Array:
        """Whole samples. Where the link's angle was not recorded the deflection goes evenly from one neighbour to the other."""
        row, late = np.arange(len(log.time)), round(float(values[0]) / log.step)
        first = int(np.searchsorted(log.time, values[1]))
        # The row at which the link really stood where each row has it.
        really = np.where(row < first, row, row - late)
        known = (row < first) | ((really >= first) & (really < len(row)))
        link = log.angle - log.deflection
        true = np.interp(row, really[known], log.angle[really[known]] - link[known])
        return np.asarray(log.deflection - true)

"""In a log taken in motion the torque channel lags behind the encoders, or runs ahead of them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from identification.model.effects.base import ONLY_IN_MOTION, Effect, Parameter
from identification.model.joint_log import JointLog
from identification.model.situation import Situation

Array = NDArray[np.float64]


class ChannelDelay(Effect):
    """The spring's answer to the torque as it was `delay_s` later or before."""

    name = "channel_delay"
    family = "force measurement"
    of_robot = False
    parameters = (Parameter("delay_s", "s", 0.004, -0.05, 0.05),)
    sentence = "the torque and the angles were not recorded at the same time"
    settles = "move at several speeds in both directions"

    def missing(self, rows: Situation) -> str:
        return ONLY_IN_MOTION

    def contribution(self, rows: Situation, joint: int | None, values: Array) -> Array:
        return np.zeros((len(rows), 6))

    def log_contribution(self, log: JointLog, values: Array) -> Array:
        # A torque that was recorded late stands later in the log than the deflection it caused.
        return np.asarray(log.compliance * (log.delayed(-float(values[0])) - log.torque))

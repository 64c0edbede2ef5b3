"""In a log taken in motion one channel lags behind the others, or runs ahead of them."""

from __future__ import annotations

from typing import Literal

import numpy as np

from identification.common.arrays import Array
from identification.model.effects.base import Parameter
from identification.model.effects.kinds import InMotion
from identification.model.joint_log import JointLog


class ChannelDelay(InMotion):
    """Channel "torque": the spring's answer to the torque as it was `delay_s` later or before. Channel "link": the link
    encoder's angle is `delay_s` old, which adds what the link turned since: to second order in the delay, from the speed of the
    link as it was recorded."""

    name = "channel_delay"
    family = "force measurement"
    of_robot = False
    formula_source = "engineering judgement: recorders lag by a constant time; its Taylor series to second order"
    parameters = (
        Parameter("delay_s", "s", 0.004, -0.05, 0.05,
                  source="docs/real-data.md: the link encoders of a KUKA KR300 are 2.7 to 2.9 ms late; a log's step is 4 ms "
                         "there",
                  bounds_source="engineering judgement: a dozen such steps"),
    )
    sentence = "the channels of the log were not recorded at the same time"
    settles = "move at several speeds in both directions"

    def __init__(self, channel: Literal["torque", "link"] = "torque") -> None:
        self.channel = channel

    @property
    def where(self) -> dict[str, int | str | float]:
        return {"channel": self.channel}

    def log_contribution(self, log: JointLog, values: Array) -> Array:
        delay = float(values[0])
        if self.channel == "link":
            speed = log.speed - np.gradient(log.deflection, log.time)
            return np.asarray(delay * speed + 0.5 * delay**2 * np.gradient(speed, log.time))
        # A torque that was recorded late stands later in the log than the deflection it caused.
        return np.asarray(log.compliance * (log.delayed(-delay) - log.torque))

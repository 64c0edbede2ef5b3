"""The axes of the force measurement have gains unlike each other: one reads too much, another too little."""

from __future__ import annotations

import numpy as np

from identification.common.arrays import Array
from identification.model.effects.base import Parameter
from identification.model.effects.kinds import ForceAxes


class _AxisGain(ForceAxes):
    """`x` and `y` of the x and y axis against the mean of the three, `-x - y` of z: what all three have in common is a
    `force_gain`, which no deflection shows."""

    name = "force_axis_gain"
    leaves_open = "force_gain"
    formula_source = "engineering judgement: each axis has a calibration of its own, in proportion to its force"
    parameters = tuple(
        Parameter(axis, "1", 0.015, -0.6, 0.6,
                  source="engineering judgement: 1 to 2 % of the reading, what six-axis sensors and load cells with their "
                         "amplifiers are calibrated to",
                  bounds_source="engineering judgement: either way, to an axis off by more than half, which is seen at once")
        for axis in "xy")
    sentence = ("the axes of the force measurement are not alike: one reads too much, another too little (a log of the same "
                "sensor is off by as much)")
    settles = "hang a known weight along each axis of the force sensor in turn"

    def share(self, values: Array) -> Array:
        x, y = values
        return np.diag([x, y, -x - y])


class OnTheFlange(_AxisGain):
    """The sensor turns with the flange, and its axes are the flange's."""

    law, on_flange = "flange", True


class ForceAxisGain(_AxisGain):
    """The axes are the base's: cylinders or load cells set up along them."""

    other_laws = (OnTheFlange(),)

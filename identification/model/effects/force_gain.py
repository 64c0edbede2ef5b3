"""The force sensor's scale is off: every elastic deflection is scaled alike."""

from __future__ import annotations

import numpy as np

from identification.common.arrays import Array
from identification.model.effects.base import Parameter
from identification.model.effects.kinds import OfWrench
from identification.model.load_state import LoadState


class ForceGain(OfWrench):
    """g times the elastic deviation. It is the same as all stiffnesses changed together, so deflections alone never tell it;
    with the same sensor in milling it does no harm to the correction either."""

    name = "force_gain"
    family = "force measurement"
    formula_source = "the paper, eq. 3: the twist is in proportion to the torque, and so to the wrench"
    parameters = (
        Parameter("relative", "1", 0.05, -0.5, 0.5,
                  source="engineering judgement: 1 % of the full scale of a 1500 N sensor at the 300 N of the paper's sect. "
                         "4",
                  bounds_source="engineering judgement: beyond, it is a wrong unit and no scale error"),
    )
    sentence = "the force sensor's scale is off"
    settles = "hang a dead weight on the tool, or read the second force sensor"

    def contribution(self, rows: LoadState, joint: int | None, values: Array) -> Array:
        return np.asarray(values[0] * rows.elastic)

    def true_wrench(self, rows: LoadState, joint: int | None, values: Array) -> Array:
        return np.asarray((1 + values[0]) * rows.wrench)

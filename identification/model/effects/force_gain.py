"""The force sensor's scale is off: every elastic deflection is scaled alike."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from identification.common.arrays import Array
from identification.model.effects.base import Parameter
from identification.model.effects.kinds import OfWrench
from identification.model.load_state import LoadState


class ForceGain(OfWrench):
    """The elastic deviation under (1 + g) times the load, less that under the load. It is the same as all stiffnesses changed
    together, and at the loaded pose exactly so: g times the deviation would change how the arm turns on the way, by a hundredth
    of millimetres of deflection. So deflections alone never tell it; with the same sensor in milling it does no harm to the
    correction either."""

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
        if rows.at_load:
            return np.asarray(values[0] * rows.elastic)
        return np.asarray(replace(rows, wrench=self.true_wrench(rows, joint, values)).elastic - rows.elastic)

    def true_wrench(self, rows: LoadState, joint: int | None, values: Array) -> Array:
        return np.asarray((1 + values[0]) * rows.wrench)

"""A gear that yields more to torques of one sign than to those of the other: worn on one flank, or pre-loaded one way."""

from __future__ import annotations

import numpy as np

from identification.common.arrays import Array
from identification.model.effects.base import Parameter
from identification.model.effects.kinds import GearTwist
from identification.model.load_state import LoadState


class OneSided(GearTwist):
    """`J_i a c_i (|g + tau| - |g|)`: the compliance is c_i (1 + a) under positive torques and c_i (1 - a) under negative."""

    name = "one_sided"
    of_gravity = True
    formula_source = "engineering judgement: two straight lines that meet where the torque is nothing"
    parameters = (
        Parameter("share", "1", 0.15, -0.9, 0.9,
                  source="engineering judgement: a third of the contact gone on one flank",
                  bounds_source="engineering judgement: either way, to a gear that hardly yields to one of the signs"),
    )
    sentence = "the gear of joint {joint} yields more to torques of one sign than to those of the other"
    settles = "push the joint to and fro with the same force and compare"

    def twist(self, rows: LoadState, i: int, values: Array) -> Array:
        preload = self.preload(rows, i, values)
        return np.asarray(values[0] * rows.compliance[i] * (np.abs(preload + rows.torque[:, i]) - np.abs(preload)))

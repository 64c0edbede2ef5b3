"""One gear goes on yielding while its torque is on, and comes to an end."""

from __future__ import annotations

import numpy as np

from identification.common.arrays import Array
from identification.model.effects.base import Parameter
from identification.model.effects.creep import NO_DWELL, OneElement, crept
from identification.model.effects.kinds import AtJoint
from identification.model.load_state import LoadState


class GearCreep(AtJoint):
    """`J_i`, each change of the gear's twist `c_i tau_i` creeping on by `rho (1 - exp(-t / t0))`; all gears: `creep`."""

    name = "gear_creep"
    family = "gear"
    joints = (1, 2, 3, 4, 5, 6)
    formula_source = OneElement.formula_source
    parameters = (
        Parameter("ratio", "1", 0.1, 0.0, 3.0,
                  source="engineering judgement: plastic bushes, or grease that gives way between the teeth, in one gear alone",
                  bounds_source="engineering judgement: never backwards, to three times what the gear yields at once"),
        OneElement.parameters[1],
    )
    sentence = "the gear of joint {joint} goes on yielding while the load is on"
    settles = "hold one load on this joint and read the sensors after 5 and after 60 seconds"

    def missing(self, rows: LoadState) -> str:
        return NO_DWELL if np.isnan(rows.dwell).all() else ""

    def contribution(self, rows: LoadState, joint: int | None, values: Array) -> Array:
        i = self.index(joint)
        load = np.where(np.arange(6) == i, rows.compliance * rows.torque, 0.0)
        return np.asarray(rows.jacobian[:, :, i] * (values[0] * crept(rows, load, values[1])[:, i])[:, None])

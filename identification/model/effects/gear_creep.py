"""One gear goes on yielding while its torque is on, and comes to an end; or its servo takes back what it yielded."""

from __future__ import annotations

import numpy as np

from identification.common.arrays import Array
from identification.model.effects.base import Parameter
from identification.model.effects.creep import OneElement, crept
from identification.model.effects.kinds import AtJoint
from identification.model.load_state import LoadState

TIME = OneElement.parameters[1]


class _GearCreep(AtJoint):
    """What the laws have in common: `J_i`, each change of the joint's twist `c_i tau_i` going on, or back, by
    `rho (1 - exp(-t / t0))`."""

    name = "gear_creep"
    family = "gear"
    joints = (1, 2, 3, 4, 5, 6)
    settles = "hold one load on this joint and read the sensors after 5 and after 60 seconds"
    onward = 1.0

    def contribution(self, rows: LoadState, joint: int | None, values: Array) -> Array:
        i = self.index(joint)
        twist = rows.compliance[i] * crept(rows, rows.torque[:, [i]], values[1])
        return np.asarray(self.onward * values[0] * rows.jacobian[:, :, i] * twist)


class Recovering(_GearCreep):
    """A part of the twist is the servo's, whose controller adds up what is left and takes it back."""

    law = "recovering"
    formula_source = ("engineering judgement: integral action takes back what a constant load has left, exponentially where it "
                      "is slow")
    parameters = (
        Parameter("ratio", "1", 0.1, 0.0, 1.0,
                  source="engineering judgement: the drive's stiffness is some ten times the gear's",
                  bounds_source="engineering judgement: never onwards, to all that the joint yielded"),
        TIME,
    )
    sentence = "joint {joint} comes back slowly while the load is on, as a servo does that adds up what is left"
    onward = -1.0


class GearCreep(_GearCreep):
    """One gear yields on; all gears: `creep`."""

    other_laws = (Recovering(),)
    formula_source = OneElement.formula_source
    parameters = (
        Parameter("ratio", "1", 0.1, 0.0, 3.0,
                  source="engineering judgement: plastic bushes, or grease that gives way between the teeth, in one gear alone",
                  bounds_source="engineering judgement: never backwards, to three times what the gear yields at once"),
        TIME,
    )
    sentence = "the gear of joint {joint} goes on yielding while the load is on"

"""Axes 5 and 6 share gears: a torque at one turns the other."""

from __future__ import annotations

import numpy as np

from identification.common.arrays import Array
from identification.model.effects.base import Effect, Parameter
from identification.model.load_state import LoadState


class WristCoupling(Effect):
    """`(J_5 tau_6 + J_6 tau_5) c`."""

    name = "wrist_coupling"
    family = "gear"
    of_robot = True
    formula_source = "docs/architecture.md, Springs: an element off the diagonal of diag(c), symmetric by Maxwell-Betti"
    parameters = (
        Parameter("compliance_rad_per_nm", "rad/(N*m)", 1e-6, -8e-6, 8e-6,
                  source="engineering judgement: an eighth of the bound",
                  bounds_source="sqrt(c5 c6) of the paper's Table 1, 8.06e-6 rad/(N m): beyond it the compliance is not "
                                "positive definite"),
    )
    sentence = "the gears of the wrist are coupled: a torque at axis 5 turns axis 6 and the other way round"
    settles = "a pure moment on the flange about axis 6 with a dial gauge on axis 5"

    def contribution(self, rows: LoadState, joint: int | None, values: Array) -> Array:
        twisted = rows.jacobian[:, :, 4] * rows.torque[:, 5:] + rows.jacobian[:, :, 5] * rows.torque[:, 4:5]
        return np.asarray(values[0] * twisted)

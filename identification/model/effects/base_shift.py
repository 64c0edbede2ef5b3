"""The base gives way sideways."""

from __future__ import annotations

import numpy as np

from identification.common.arrays import Array
from identification.model.effects.base import Effect, Parameter
from identification.model.load_state import LoadState


class BaseShift(Effect):
    """c (F_x, F_y, 0)."""

    name = "base_shift"
    family = "base"
    of_robot = True
    stiffens = True
    formula_source = "engineering judgement: a linear spring along the floor, alike in all directions"
    parameters = (
        Parameter("compliance_m_per_n", "m/N", 5e-8, 0.0, 1e-6,
                  source="engineering judgement: 2e7 N/m, 15 um under the 300 N of the paper's sect. 4",
                  bounds_source="engineering judgement: rigid, to 1e6 N/m, 0.3 mm under 300 N: a foot that is loose"),
    )
    sentence = "the base of the robot slides or gives way sideways"
    settles = "a dial gauge at the foot of the base while the tool is loaded"

    def contribution(self, rows: LoadState, joint: int | None, values: Array) -> Array:
        moved = np.zeros((len(rows), 6))
        moved[:, :2] = values[0] * rows.wrench[:, :2]
        return moved

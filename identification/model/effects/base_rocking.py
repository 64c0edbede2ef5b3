"""The whole robot rocks on its base about base x and y."""

from __future__ import annotations

import numpy as np

from identification.common.arrays import Array
from identification.model.effects.base import Effect, Parameter
from identification.model.load_state import LoadState


class BaseRocking(Effect):
    """Rotation c (M_x, M_y) about the base origin, M the moment of the load there."""

    name = "base_rocking"
    family = "base"
    of_robot = True
    stiffens = True
    formula_source = "the paper, eq. 3 and 5, for two more torsion springs, about base x and y"
    parameters = (
        Parameter("compliance_rad_per_nm", "rad/(N*m)", 5e-8, 0.0, 2e-6,
                  source="engineering judgement: 2e7 N m/rad, ten times joint 1 (the paper, Table 1)",
                  bounds_source="engineering judgement: rigid, to 5e5 N m/rad, a quarter of joint 1: a pedestal that is "
                                "loose"),
    )
    sentence = "the robot rocks on its base: floor, anchors or pedestal give way"
    settles = "a dial gauge on the base while the tool is loaded"

    def contribution(self, rows: LoadState, joint: int | None, values: Array) -> Array:
        base = np.zeros((len(rows), 3))
        return rows.turned(base, values[0] * rows.moment_about(base) * [1.0, 1.0, 0.0])

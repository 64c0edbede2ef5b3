"""The base gives way along a line: sideways, or in each direction by itself."""

from __future__ import annotations

from dataclasses import replace
from typing import ClassVar

import numpy as np

from identification.common.arrays import Array
from identification.model.effects.base import Effect, Parameter
from identification.model.load_state import LoadState

COMPLIANCE = Parameter("compliance_m_per_n", "m/N", 5e-8, 0.0, 4e-6,
                       source="engineering judgement: 2e7 N/m, 15 um under the 300 N of the paper's sect. 4",
                       bounds_source="engineering judgement: rigid, to 2.5e5 N/m, 1.2 mm under 300 N: feet that are loose")


class _Shift(Effect):
    """What the laws have in common."""

    name = "base_shift"
    family = "base"
    of_robot = True
    stiffens = True
    sentence = "the base of the robot gives way without tilting: it slides, or floor, feet or pedestal are pressed together"
    settles = "a dial gauge at the foot of the base, sideways and upright, while the tool is loaded"
    directions: ClassVar[Array]

    def contribution(self, rows: LoadState, joint: int | None, values: Array) -> Array:
        moved = np.zeros((len(rows), 6))
        moved[:, :3] = rows.wrench[:, :3] * (values @ self.directions)
        return moved


class UprightToo(_Shift):
    """(c_h F_x, c_h F_y, c_v F_z): feet on a floor that is pressed in."""

    law = "upright"
    formula_source = "engineering judgement: the first law, and a linear spring across the floor"
    parameters = (COMPLIANCE, replace(COMPLIANCE, name="upright_m_per_n"))
    directions = np.array([[1.0, 1.0, 0.0], [0.0, 0.0, 1.0]])


class EachWay(_Shift):
    """(c_x F_x, c_y F_y, c_z F_z): a frame, a pedestal or a track that gives way otherwise along than across."""

    law = "each"
    formula_source = "engineering judgement: three linear springs, along base x, y and z"
    parameters = tuple(replace(COMPLIANCE, name=f"{axis}_m_per_n") for axis in "xyz")
    directions = np.eye(3)


class BaseShift(_Shift):
    """c (F_x, F_y, 0)."""

    other_laws = (UprightToo(), EachWay())
    formula_source = "engineering judgement: a linear spring along the floor, alike in all directions"
    parameters = (COMPLIANCE,)
    directions = np.array([[1.0, 1.0, 0.0]])

"""The force sensor between flange and spindle tilts about flange x and y."""

from __future__ import annotations

import numpy as np

from identification.common.arrays import Array
from identification.model.effects.base import Effect, Parameter
from identification.model.load_state import LoadState


class ForceSensorCompliance(Effect):
    """Rotation c (M_x, M_y) about the flange, in the flange frame."""

    name = "force_sensor_compliance"
    family = "tool"
    of_robot = True
    stiffens = True
    of_tool = True
    formula_source = "the paper, eq. 3 and 5, for two more torsion springs, about flange x and y"
    parameters = (
        Parameter("tilt_rad_per_nm", "rad/(N*m)", 3e-6, 0.0, 3e-5,
                  source="engineering judgement: 3.3e5 N m/rad, about joint 5 (the paper, Table 1): a sensor works by "
                         "yielding",
                  bounds_source="engineering judgement: rigid, to 3.3e4 N m/rad, half of joint 6 (the paper, Table 1)"),
    )
    sentence = "the force sensor between flange and spindle tilts under load"
    settles = "the sensor's data sheet, or a dial gauge between flange and spindle"

    def contribution(self, rows: LoadState, joint: int | None, values: Array) -> Array:
        pivot = rows.origins[:, 5]
        moment = np.einsum("nij,ni->nj", rows.flange, rows.moment_about(pivot)) * [1.0, 1.0, 0.0]
        return rows.turned(pivot, values[0] * np.einsum("nij,nj->ni", rows.flange, moment))

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
    of_tool = True
    parameters = (Parameter("tilt_rad_per_nm", "rad/(N*m)", 3e-6, 0.0, 3e-5),)
    sentence = "the force sensor between flange and spindle tilts under load"
    settles = "the sensor's data sheet, or a dial gauge between flange and spindle"

    def contribution(self, rows: LoadState, joint: int | None, values: Array) -> Array:
        pivot = rows.origins[:, 5]
        moment = np.einsum("nij,ni->nj", rows.flange, rows.moment_about(pivot)) * [1.0, 1.0, 0.0]
        return rows.turned(pivot, values[0] * np.einsum("nij,nj->ni", rows.flange, moment))

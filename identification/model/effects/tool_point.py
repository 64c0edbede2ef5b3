"""The load acts beside the modelled TCP."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from identification.model.effects.base import Effect, Parameter
from identification.model.load_state import LoadState

Array = NDArray[np.float64]


class ToolPoint(Effect):
    """The springs' answer to the moment `(R_tool p) x F`; the measured point stays."""

    name = "tool_point"
    family = "load path"
    of_robot = False
    parameters = (Parameter("x_m", "m", 0.008, -0.1, 0.1),
                  Parameter("y_m", "m", 0.008, -0.1, 0.1),
                  Parameter("z_m", "m", 0.008, -0.1, 0.1),)
    sentence = "the load did not act at the modelled tool point"
    settles = "measure where the cylinder touches the tool"

    def contribution(self, rows: LoadState, joint: int | None, values: Array) -> Array:
        return rows.compliant(self.true_wrench(rows, joint, values) - rows.wrench)

    def true_wrench(self, rows: LoadState, joint: int | None, values: Array) -> Array:
        lever = np.einsum("nij,j->ni", rows.tool, values)
        moment = rows.wrench[:, 3:] + np.cross(lever, rows.wrench[:, :3])
        return np.concatenate([rows.wrench[:, :3], moment], axis=1)

"""The load acts beside the modelled TCP."""

from __future__ import annotations

import numpy as np

from identification.common.arrays import Array
from identification.model.effects.kinds import OfWrench, along_axes
from identification.model.load_state import LoadState


class ToolPoint(OfWrench):
    """The springs' answer to the moment `(R_tool p) x F`; the measured point stays."""

    name = "tool_point"
    family = "load path"
    formula_source = "the paper, eq. 5, with another lever"
    parameters = along_axes(
        "{}_m", "m", 0.008, 0.1,
        source="engineering judgement: 3 to 20 mm, their geometric mean: a cylinder put to a tool by eye",
        bounds_source="engineering judgement: 100 mm, a tool's own length")
    sentence = "the load did not act at the modelled tool point"
    settles = "measure where the cylinder touches the tool"

    def true_wrench(self, rows: LoadState, joint: int | None, values: Array) -> Array:
        lever = np.einsum("nij,j->ni", rows.tool, values)
        moment = rows.wrench[:, 3:] + np.cross(lever, rows.wrench[:, :3])
        return np.concatenate([rows.wrench[:, :3], moment], axis=1)

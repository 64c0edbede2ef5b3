"""The load acts beside the modelled TCP."""

from __future__ import annotations

import numpy as np

from identification.common.arrays import Array
from identification.model.effects.kinds import OfWrench, along_axes, nothing_hangs
from identification.model.load_state import LoadState

ONLY_WEIGHTS = "where weights hang it is hook_offset"


class _ToolPoint(OfWrench):
    """The springs' answer to the moment `p x F`; the measured point stays."""

    name = "tool_point"
    family = "load path"
    formula_source = "the paper, eq. 5, with another lever"
    parameters = along_axes(
        "{}_m", "m", 0.008, 0.3,
        source="engineering judgement: 3 to 20 mm, their geometric mean: a cylinder put to a tool by eye",
        bounds_source="engineering judgement: 300 mm, a long tool's own length")
    sentence = "the load did not act at the modelled tool point"
    settles = "measure where the cylinder touches the tool"

    in_the_cell = False

    def true_wrench(self, rows: LoadState, joint: int | None, values: Array) -> Array:
        lever = values if self.in_the_cell else rows.tool @ values
        moment = rows.wrench[:, 3:] + np.cross(lever, rows.wrench[:, :3])
        return np.concatenate([rows.wrench[:, :3], moment], axis=1)


class InTheCell(_ToolPoint):
    """p along the base's axes: the load comes from the same side of the cell, wherever the tool is turned to."""

    law, in_the_cell = "base", True
    sentence = "the load acted beside the modelled tool point, on the same side of the cell at every pose"
    settles = "measure how far the line of the load passes the tool point"

    def missing(self, rows: LoadState) -> str:
        return "" if nothing_hangs(rows) else ONLY_WEIGHTS


class ToolPoint(_ToolPoint):
    """p along the tool's axes: a point of the tool."""

    other_laws = (InTheCell(),)

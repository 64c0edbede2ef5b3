"""The force that acted was another than the reported one by the same newtons under every load: a force sensor with a zero that
nobody took off, or something that pulls at the tool whenever it is loaded."""

from __future__ import annotations

import numpy as np

from identification.common.arrays import Array
from identification.model.effects.kinds import OfWrench, along_axes
from identification.model.load_state import LoadState


class _ForceOffset(OfWrench):
    """The springs' answer to a constant force in all rows that were loaded."""

    name = "force_offset"
    family = "force measurement"
    formula_source = "engineering judgement: a zero that was not taken off is the same in every reading"
    parameters = along_axes(
        "{}_n", "N", 3.0, 100.0,
        source="engineering judgement: 1 % of the 300 N of the paper's sect. 4",
        bounds_source="engineering judgement: either way, to the weight of a tool that nobody took off")
    sentence = "under every load some more (or less) force acted than was written down, always the same"
    settles = "read the force sensor without a load, before and after, in the pose of the test"
    on_flange = False

    def true_wrench(self, rows: LoadState, joint: int | None, values: Array) -> Array:
        force = rows.wrench[:, :3]
        more = rows.flange @ values if self.on_flange else values
        loaded = np.any(force != 0, axis=1, keepdims=True)
        return np.concatenate([force + loaded * more, rows.wrench[:, 3:]], axis=1)


class OnTheFlange(_ForceOffset):
    """The sensor turns with the flange."""

    law, on_flange = "flange", True


class ForceOffset(_ForceOffset):
    """The same in the cell, wherever the tool is turned to."""

    other_laws = (OnTheFlange(),)

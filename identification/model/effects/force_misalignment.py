"""The force frame is turned against the base: true force = Rot(r) reported force."""

from __future__ import annotations

import numpy as np

from identification.common.arrays import Array
from identification.model.effects.kinds import OfWrench, along_axes
from identification.model.load_state import LoadState
from identification.model.rotations import rotation_matrix


class ForceMisalignment(OfWrench):
    """The springs' answer to `(Rot(r) - 1) w`."""

    name = "force_misalignment"
    family = "force measurement"
    formula_source = "the paper, eq. 4 and 5, with the force turned"
    parameters = along_axes(
        "r{}_rad", "rad", 0.021, 1.0,
        source="engineering judgement: 1 to 1.5 degrees, what a level and a square leave",
        bounds_source="engineering judgement: 57 degrees; a file that states another frame is off by 90 or more")
    sentence = "the force was not applied (or not measured) in the direction that was written down"
    settles = "read a dead weight with the force sensor, or check the cylinder's direction with a level"

    def true_wrench(self, rows: LoadState, joint: int | None, values: Array) -> Array:
        turn = rotation_matrix(values)
        return np.concatenate([rows.wrench[:, :3] @ turn.T, rows.wrench[:, 3:] @ turn.T], axis=1)

"""The force frame is turned against the base: true force = Rot(r) reported force."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from identification.model.effects.base import Effect, Parameter
from identification.model.load_state import LoadState
from identification.model.rotations import rotation_matrix

Array = NDArray[np.float64]


class ForceMisalignment(Effect):
    """The springs' answer to `(Rot(r) - 1) w`."""

    name = "force_misalignment"
    family = "force measurement"
    of_robot = False
    parameters = (Parameter("rx_rad", "rad", 0.021, -0.2, 0.2),
                  Parameter("ry_rad", "rad", 0.021, -0.2, 0.2),
                  Parameter("rz_rad", "rad", 0.021, -0.2, 0.2),)
    sentence = "the force was not applied (or not measured) in the direction that was written down"
    settles = "read a dead weight with the force sensor, or check the cylinder's direction with a level"

    def contribution(self, rows: LoadState, joint: int | None, values: Array) -> Array:
        return rows.compliant(self.true_wrench(rows, joint, values) - rows.wrench)

    def true_wrench(self, rows: LoadState, joint: int | None, values: Array) -> Array:
        turn = rotation_matrix(values)
        return np.concatenate([rows.wrench[:, :3] @ turn.T, rows.wrench[:, 3:] @ turn.T], axis=1)

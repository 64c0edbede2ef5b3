"""The force frame is turned against the base, or the sensor in its seat on the flange: true force = Rot(r) reported force."""

from __future__ import annotations

import numpy as np

from identification.common.arrays import Array
from identification.model.effects.kinds import OfWrench, along_axes
from identification.model.load_state import LoadState
from identification.model.rotations import rotation_matrix


class _Misalignment(OfWrench):
    """The springs' answer to `(Rot(r) - 1) w`, r in the axes of the force."""

    name = "force_misalignment"
    family = "force measurement"
    formula_source = "the paper, eq. 4 and 5, with the force turned"
    parameters = along_axes(
        "r{}_rad", "rad", 0.021, 1.0,
        source="engineering judgement: 1 to 1.5 degrees, what a level and a square leave",
        bounds_source="engineering judgement: 57 degrees; a file that states another frame is off by 90 or more")
    sentence = "the force was not applied (or not measured) in the direction that was written down"
    settles = "read a dead weight with the force sensor, or check the cylinder's direction with a level"
    on_flange = False

    def true_wrench(self, rows: LoadState, joint: int | None, values: Array) -> Array:
        turn = rotation_matrix(values)
        if self.on_flange:
            turn = rows.flange @ turn @ rows.flange.transpose(0, 2, 1)
        return np.asarray((turn[..., None, :, :] @ rows.wrench.reshape(-1, 2, 3, 1)).reshape(-1, 6))


class OnTheFlange(_Misalignment):
    """The sensor turns with the flange, and is turned in its seat there."""

    law, on_flange = "flange", True
    sentence = "the force sensor is turned in its seat on the flange against the axes that were written down"
    settles = "read a dead weight with the force sensor in two postures of the flange"


class ForceMisalignment(_Misalignment):
    """The same in the cell, wherever the tool is turned to."""

    other_laws = (OnTheFlange(),)

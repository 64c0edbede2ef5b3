"""A laser meets a curved target: sideways motion shows as distance."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from identification.model.effects.base import Effect, Parameter
from identification.model.load_state import LoadState

Array = NDArray[np.float64]


class TargetCurvature(Effect):
    """`t^2 / 2R` on each laser, t^2 the sum of squares of both sideways motions; the value is 1/R."""

    name = "target_curvature"
    family = "deflection measurement"
    of_robot = False
    parameters = (Parameter("x_per_m", "1/m", 100.0, -1000.0, 1000.0),
                  Parameter("y_per_m", "1/m", 100.0, -1000.0, 1000.0),
                  Parameter("z_per_m", "1/m", 100.0, -1000.0, 1000.0),)
    sentence = "the deflection sensor looks at a curved target: sideways motion shows as distance"
    settles = "repeat with the load's sign turned round: curvature reads the same, a spring the opposite"

    def contribution(self, rows: LoadState, joint: int | None, values: Array) -> Array:
        square = rows.elastic[:, :3] ** 2
        sideways = square.sum(axis=1, keepdims=True) - square
        read = np.zeros_like(rows.elastic)
        read[:, :3] = 0.5 * values * sideways
        return read

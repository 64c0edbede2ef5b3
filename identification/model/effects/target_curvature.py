"""A laser meets a curved target: sideways motion shows as distance."""

from __future__ import annotations

import numpy as np

from identification.common.arrays import Array
from identification.model.effects.kinds import OfReading, along_axes
from identification.model.load_state import LoadState

# How far beside the pole of its target a sensor's line meets it [m]: engineering judgement, set by eye on a shank or a ball.
BESIDE_POLE = 2e-4


class TargetCurvature(OfReading):
    """`t^2 / 2R` on each laser, t^2 the sum of squares of both sideways motions; the value is 1/R."""

    name = "target_curvature"
    formula_source = "Edmund Optics, Sag tech tool: R - sqrt(R^2 - t^2), to second order in t"
    parameters = along_axes(
        "{}_per_m", "1/m", 100.0, 1000.0,
        source="engineering judgement: R = 10 mm, the shank of a tool of 20 mm",
        bounds_source="engineering judgement: R = 1 mm, an edge, hollow or round")
    sentence = "the deflection sensor looks at a curved target: sideways motion shows as distance"
    settles = "repeat with the load's sign turned round: curvature reads the same, a spring the opposite"

    def brings(self, values: Array) -> dict[str, float]:
        # Beside its pole a target leans: sideways motion shows in proportion too, as it does to a sensor that is turned.
        leans = BESIDE_POLE * float(np.abs(values).max())
        return {"deflection_sensor_rotation": leans, "deflection_sensor_crosstalk": leans}

    def misread(self, rows: LoadState, values: Array) -> Array:
        square = rows.elastic[:, :3] ** 2
        sideways = square.sum(axis=1, keepdims=True) - square
        return np.asarray(0.5 * values * sideways)

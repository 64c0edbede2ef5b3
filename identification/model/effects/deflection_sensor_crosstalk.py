"""The deflection sensors do not stand square to each other: each reads a share of what moves across its line."""

from __future__ import annotations

import numpy as np

from identification.common.arrays import Array
from identification.model.effects.base import Parameter
from identification.model.effects.kinds import OfReading, crossed, crossed_one_way, one_way
from identification.model.load_state import LoadState


class _Crosstalk(OfReading):
    """`xy` of a motion along y is read along x too, and as much the other way round: what sensors that are turned one by one do
    beyond a turn of all of them (`deflection_sensor_rotation`)."""

    name = "deflection_sensor_crosstalk"
    formula_source = ("engineering judgement: a sensor reads along its own line; three lines that are off by themselves are a "
                      "turn and this")
    parameters = tuple(
        Parameter(pair, "1", 0.014, -0.2, 0.2,
                  source="engineering judgement: two sensors, each set up by eye to a degree",
                  bounds_source="engineering judgement: either way, to 11 degrees, which are seen by eye")
        for pair in ("xy", "xz", "yz"))
    sentence = "the deflection sensors do not stand square to each other: each reads some of what moves across its line"
    settles = "check each sensor's line with a square, or move the target along one axis and read all three"

    def misread(self, rows: LoadState, values: Array) -> Array:
        return np.asarray(rows.elastic[:, :3] @ crossed(values))


class OneWay(_Crosstalk):
    """`xy` of a motion along y is read along x, and another share the other way round: one sensor that leans."""

    law = "one_way"
    plainer = "deflection_sensor_rotation"
    formula_source = "engineering judgement: a sensor reads along its own line"
    parameters = one_way(0.014, source="engineering judgement: a sensor that was set up by eye to a degree",
                         bounds_source="engineering judgement: either way, to 27 degrees, which are seen by eye")

    def misread(self, rows: LoadState, values: Array) -> Array:
        return np.asarray(rows.elastic[:, :3] @ crossed_one_way(values).T)


class DeflectionSensorCrosstalk(_Crosstalk):
    """Alike in both directions."""

    other_laws = (OneWay(),)

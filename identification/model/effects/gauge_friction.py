"""A gauge sticks: it reads less on the way out than on the way back."""

from __future__ import annotations

import numpy as np

from identification.common.arrays import Array
from identification.model.effects.base import Parameter
from identification.model.effects.hysteresis import slip_state
from identification.model.effects.kinds import OfReading
from identification.model.load_state import LoadState

# Play under this is none [m].
LEAST_M = 1e-9


class GaugeFriction(OfReading):
    """The reading follows the motion through a play of half width w, axis by axis, from zero at the start of each pose: it lags
    behind by w once it moves, and stays where it is when the motion turns; with a negative w it runs ahead."""

    name = "gauge_friction"
    formula_source = "engineering judgement: a plunger that sticks, or a stand that slips, is a play operator on the reading"
    parameters = tuple(
        Parameter(f"{axis}_m", "m", 5e-6, -5e-4, 5e-4,
                  source="engineering judgement: a dial gauge's reversal error is some micrometres",
                  bounds_source="engineering judgement: either way, to a stand that slips by half a millimetre")
        for axis in "xyz")
    sentence = "the deflection gauges stick: their readings lag behind on the way out and on the way back"
    settles = "push the tool by hand to and fro and see whether each gauge comes back; tap the gauges before reading"

    def misread(self, rows: LoadState, values: Array) -> Array:
        moved = rows.elastic[:, :3]
        return np.stack([-play * slip_state(moved[:, axis], rows.starts, max(abs(play), LEAST_M))
                         for axis, play in enumerate(values)], axis=1)

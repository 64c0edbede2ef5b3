"""The deflection goes on growing while the load is on."""

from __future__ import annotations

import numpy as np

from identification.common.arrays import Array
from identification.model.effects.base import Effect, Parameter
from identification.model.load_state import LoadState


class Creep(Effect):
    """`el rho log(1 + t / t0)`, t the time the load has been on."""

    name = "creep"
    family = "structure"
    of_robot = True
    parameters = (Parameter("ratio", "1", 0.017, 0.0, 0.3),
                  Parameter("time_s", "s", 3.0, 0.05, 300.0, grid=(1.0, 3.0, 10.0), shape=True),)
    sentence = "the robot goes on yielding while the load is on"
    settles = "hold one load and read the sensors after 5 and after 60 seconds"

    def missing(self, rows: LoadState) -> str:
        return "dwell_s is not given" if np.isnan(rows.dwell).all() else ""

    def contribution(self, rows: LoadState, joint: int | None, values: Array) -> Array:
        grown = values[0] * np.log1p(np.nan_to_num(rows.dwell) / values[1])
        return np.asarray(rows.elastic * grown[:, None])

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
    formula_source = ("M. E. Kassner, K. K. Smith, C. S. Campbell, Low-temperature creep in pure metals and alloys, J. "
                      "Mater. Sci. 50, 2015: logarithmic in time; in proportion to the deflection: engineering judgement")
    parameters = (
        Parameter("ratio", "1", 0.017, 0.0, 0.3,
                  source="engineering judgement: 1 to 3 % for each factor e of time, their geometric mean",
                  bounds_source="engineering judgement: never backwards, under a third of the deflection"),
        Parameter("time_s", "s", 3.0, 0.05, 300.0, grid=(1.0, 3.0, 10.0), shape=True,
                  source="engineering judgement: 1 to 10 s, when the first reading after loading is taken",
                  bounds_source="engineering judgement: from one reading to the time one pose takes"),
    )
    sentence = "the robot goes on yielding while the load is on"
    settles = "hold one load and read the sensors after 5 and after 60 seconds"

    def missing(self, rows: LoadState) -> str:
        return "dwell_s is not given" if np.isnan(rows.dwell).all() else ""

    def contribution(self, rows: LoadState, joint: int | None, values: Array) -> Array:
        grown = values[0] * np.log1p(np.nan_to_num(rows.dwell) / values[1])
        return np.asarray(rows.elastic * grown[:, None])

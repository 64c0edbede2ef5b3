"""The load falls while it is held: it was read when it was put on, and the deflection at the end."""

from __future__ import annotations

import numpy as np

from identification.common.arrays import Array
from identification.model.effects.base import Parameter
from identification.model.effects.kinds import ONE_TIME, OfWrench
from identification.model.load_state import LoadState

# Loads that were held for times so different (largest to smallest) tell what falls from what is off by a share.
UNLIKE_TIMES = 1.3


class LoadLeak(OfWrench):
    """True force = exp(-r t) reported force, t the time for which the load was on (`dwell_s`)."""

    name = "load_leak"
    family = "load path"
    formula_source = "engineering judgement: a cylinder leaks in proportion to its pressure, a strap creeps as it is pulled"
    parameters = (Parameter("per_s", "1/s", 5e-4, -0.02, 0.02,
                            source="engineering judgement: one per cent in twenty seconds",
                            bounds_source="engineering judgement: a load that is gone within a minute, a pump that goes on"),)
    sentence = ("the load fell while it was held (a cylinder that leaks, a strap that gives): it was read when it was put on, "
                "and the deflection later")
    settles = "read the load once more when the deflection is read"

    def missing(self, rows: LoadState) -> str:
        dwell = rows.dwell[np.any(rows.wrench[:, :3] != 0, axis=1)]
        dwell = dwell[dwell > 0]
        return "" if len(dwell) and dwell.max() > UNLIKE_TIMES * dwell.min() else ONE_TIME

    def true_wrench(self, rows: LoadState, joint: int | None, values: Array) -> Array:
        return np.asarray(rows.wrench * np.exp(-values[0] * np.nan_to_num(rows.dwell))[:, None])

"""The reading grows with time, not with force."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from identification.model.effects.base import Effect, Parameter
from identification.model.load_state import LoadState

Array = NDArray[np.float64]


class Drift(Effect):
    """Rate times the time since the unloaded reference was taken."""

    name = "drift"
    family = "deflection measurement"
    of_robot = False
    parameters = (Parameter("x_m_per_s", "m/s", 8.3e-9, -1e-6, 1e-6),
                  Parameter("y_m_per_s", "m/s", 8.3e-9, -1e-6, 1e-6),
                  Parameter("z_m_per_s", "m/s", 8.3e-9, -1e-6, 1e-6),)
    sentence = "the reading drifts with time, loaded or not (temperature, mounting)"
    settles = "leave the robot unloaded and read the sensors every ten minutes"

    def missing(self, rows: LoadState) -> str:
        return "time_s is not given" if np.isnan(rows.time).all() else ""

    def contribution(self, rows: LoadState, joint: int | None, values: Array) -> Array:
        read = np.zeros((len(rows), 6))
        read[:, :3] = np.nan_to_num(since_reference(rows))[:, None] * values
        return read


def since_reference(rows: LoadState) -> Array:
    """Time (n,) [s] since the unloaded reference was taken: the file's own for the first, from the first row for later ones."""
    since = rows.time.copy()
    for reference in np.unique(rows.reference)[1:]:
        members = rows.reference == reference
        since[members] -= np.nanmin(rows.time[members])
    return since

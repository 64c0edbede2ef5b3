"""The reading grows with time, not with force."""

from __future__ import annotations

import numpy as np

from identification.common.arrays import Array
from identification.model.effects.kinds import OfReading, along_axes
from identification.model.load_state import LoadState


class Drift(OfReading):
    """Rate times the time since the unloaded reference was taken."""

    name = "drift"
    formula_source = "engineering judgement: a warm-up is slow against a measurement, so its first order in time is enough"
    parameters = along_axes(
        "{}_m_per_s", "m/s", 8.3e-9, 1e-6,
        source="Pollack Periodica 15(3), p. 60, 2020: a laser tracker warms up for two hours and is off by up to tenths of "
               "a millimetre, 1.4e-8 m/s for one; 30 um an hour for a bracket is engineering judgement",
        bounds_source="engineering judgement: nothing in a hall warms up by 3.6 mm an hour")
    sentence = "the reading drifts with time, loaded or not (temperature, mounting)"
    settles = "leave the robot unloaded and read the sensors every ten minutes"

    def missing(self, rows: LoadState) -> str:
        return "time_s is not given" if np.isnan(rows.time).all() else ""

    def misread(self, rows: LoadState, values: Array) -> Array:
        return np.asarray(np.nan_to_num(since_reference(rows))[:, None] * values)


def since_reference(rows: LoadState) -> Array:
    """Time (n,) [s] since the unloaded reference was taken: the file's own for the first, from the first row for later ones."""
    since = rows.time.copy()
    for reference in np.unique(rows.reference)[1:]:
        members = rows.reference == reference
        since[members] -= np.nanmin(rows.time[members])
    return since

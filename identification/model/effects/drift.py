"""The reading grows with time, not with force."""

from __future__ import annotations

import numpy as np

from identification.common.arrays import Array
from identification.model.effects.kinds import OfReading, along_axes
from identification.model.load_state import LoadState

# Time [s] that one row is taken to last where no row has a time: half a minute until nothing creeps, and a reading.
PACE_S = 60.0


class Drift(OfReading):
    """Rate times the time since the unloaded reference was taken; without any times, times the rows' order at an even pace."""

    name = "drift"
    formula_source = "engineering judgement: a warm-up is slow against a measurement, so its first order in time is enough"
    parameters = along_axes(
        "{}_m_per_s", "m/s", 8.3e-9, 1e-6,
        source="Pollack Periodica 15(3), p. 60, 2020: a laser tracker warms up for two hours and is off by up to tenths of "
               "a millimetre, 1.4e-8 m/s for one; 30 um an hour for a bracket is engineering judgement",
        bounds_source="engineering judgement: nothing in a hall warms up by 3.6 mm an hour")
    sentence = "the reading drifts with time, loaded or not (temperature, mounting)"
    settles = "leave the robot unloaded and read the sensors every ten minutes"

    def misread(self, rows: LoadState, values: Array) -> Array:
        return np.asarray(np.nan_to_num(since_reference(rows))[:, None] * values)


def clock(rows: LoadState) -> Array:
    """The file's own time (n,) [s], NaN where it has none; where no row has one, PACE_S a row."""
    return np.asarray(PACE_S * (rows.row - 1.0) if np.isnan(rows.time).all() else rows.time)


def since_reference(rows: LoadState) -> Array:
    """Time (n,) [s] since the unloaded reference was taken: the file's own for the first, from the first row for later ones."""
    time = clock(rows)
    since = time.copy()
    for reference in np.unique(rows.reference)[1:]:
        members = rows.reference == reference
        since[members] -= np.nanmin(time[members])
    return since

"""Is the noise that the data need still the noise that was stated? What no cause explains ends up in it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from identification.cell import Cell
from identification.inference import Posterior
from identification.measurements import Measurements

Array = NDArray[np.float64]
PARTS = ("sensor noise", "force error", "re-seating")
# Data sheets are nominal: a named cause may leave this many times the stated noise, a plain model that much more.
GRANTED_AFTER_NAMING = 2.0
GRANTED = 4.0
ONE_SIDED_95 = 1.645


def beyond_stated(cell: Cell, rows: Measurements, fitted: Posterior, granted: float) -> dict[str, float]:
    """The parts of the noise that cell.yaml (or the rows) state and that the data put above `granted` times that, with 95 %
    confidence: how many times the stated size each is."""
    stated = (cell.noise.deflection_stated or not np.isnan(rows.sigma).all(), *fitted.at_map.noise.stated[1:])
    sizes = (fitted.size.sensor, fitted.size.force, fitted.size.offset)
    return {name: size for name, size, std, known in zip(PARTS, sizes, fitted.size_log_std, stated, strict=True)
            if known and np.log(size / granted) > ONE_SIDED_95 * std}

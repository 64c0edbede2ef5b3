"""Intervals by redrawing blocks of a second: neighbours in a log are not independent, blocks nearly are."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
BLOCK = 1.0
REDRAWN = 999


def ratio_interval(before: Array, after: Array, seconds: float) -> tuple[float, float]:
    """95 % interval of the ratio of the RMS of two series (n,) that last so long."""
    rng = np.random.default_rng(0)
    count = max(2, int(seconds / BLOCK))
    first = np.array([np.sum(part**2) for part in np.array_split(before, count)])
    second = np.array([np.sum(part**2) for part in np.array_split(after, count)])
    drawn = rng.integers(0, count, (REDRAWN, count))
    low, high = np.quantile(np.sqrt(first[drawn].sum(axis=1) / second[drawn].sum(axis=1)), [0.025, 0.975])
    return float(low), float(high)

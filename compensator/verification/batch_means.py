"""Means of values along a path, with intervals that know that neighbours are alike: batch means.

The values are cut into blocks longer than their autocorrelation time; the means of the blocks are nearly independent, and
Student's t with their number gives the interval. No resampling, so the same input gives the same interval.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from identification.common.arrays import Array
from identification.common.autocorrelation import FEWEST_BLOCKS, AutocorrelationTime, autocorrelation_time

MOST_BLOCKS = 16


@dataclass(frozen=True)
class Mean:
    """A mean and how far it is known. half_width: of the 95 % interval, None where there are too few values, rather too narrow
    where the series is short against its correlation."""

    value: float
    half_width: float | None
    blocks: int
    correlation: AutocorrelationTime


def mean_along(values: Array) -> Mean:
    """The mean of values (n,) in the order of the path, with its 95 % interval by batch means."""
    from scipy.special import stdtrit

    count, mean = len(values), float(values.mean())
    residual = values - mean
    # What rounding leaves of equal values has no correlation.
    equal = float(residual @ residual) <= 1e-30 * max(float(values @ values), 1e-300)
    correlation = autocorrelation_time(np.zeros(count) if equal else residual)
    if count < FEWEST_BLOCKS:
        return Mean(mean, None, count, correlation)
    blocks = int(np.clip(count // correlation.block, FEWEST_BLOCKS, MOST_BLOCKS))
    means = np.array([part.mean() for part in np.array_split(values, blocks)])
    error = float(means.std(ddof=1) / np.sqrt(blocks))
    return Mean(mean, float(stdtrit(blocks - 1, 0.975)) * error, blocks, correlation)

"""Means of values along a path, with intervals that know that neighbours are alike: batch means.

The values are cut into blocks longer than their memory; the means of the blocks are nearly independent, and Student's t with
their number gives the interval. No resampling, so the same input gives the same interval.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
# A block is so many autocorrelation times long: neighbouring means then share under a tenth of their variance.
MEMORIES = 5.0
MOST_BLOCKS, FEWEST_BLOCKS = 16, 8


@dataclass(frozen=True)
class Mean:
    """A mean and how far it is known. half_width: of the 95 % interval, None where there are too few values. memory: the
    autocorrelation time in values. short: blocks are shorter than MEMORIES of it, so the interval is rather too narrow."""

    value: float
    half_width: float | None
    blocks: int
    memory: float
    short: bool


def mean_along(values: Array) -> Mean:
    """The mean of values (n,) in the order of the path, with its 95 % interval by batch means."""
    from scipy.special import stdtrit

    count, mean = len(values), float(values.mean())
    if count < FEWEST_BLOCKS:
        return Mean(mean, None, count, 1.0, True)
    memory = autocorrelation_time(values)
    # Under 1.2 the estimate cannot be told from independent values.
    wanted = int(np.ceil(MEMORIES * memory)) if memory > 1.2 else 1
    blocks = int(np.clip(count // wanted, FEWEST_BLOCKS, MOST_BLOCKS))
    means = np.array([part.mean() for part in np.array_split(values, blocks)])
    error = float(means.std(ddof=1) / np.sqrt(blocks))
    return Mean(mean, float(stdtrit(blocks - 1, 0.975)) * error, blocks, memory, count < FEWEST_BLOCKS * wanted)


def autocorrelation_time(values: Array) -> float:
    """Integrated autocorrelation time of values (n,), in values, 1 where they are independent; summed over Sokal's window,
    the first lag beyond five times the sum so far."""
    centred = values - values.mean()
    power = float(centred @ centred)
    if power <= 1e-30 * max(float(values @ values), 1e-300):
        return 1.0
    size = 1 << (2 * len(values) - 1).bit_length()
    spectrum = np.fft.rfft(centred, size)
    correlation = np.fft.irfft(spectrum * spectrum.conj(), size)[: len(values)] / power
    sums = 2 * np.cumsum(correlation) - 1
    window = np.flatnonzero(np.arange(len(values)) >= 5 * sums)
    return float(max(1.0, sums[window[0] if len(window) else -1]))

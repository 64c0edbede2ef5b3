"""How far the neighbours in a series are alike: the integrated autocorrelation time tau = 1 + 2 sum_k rho_k, in values.

The mean of n values is as uncertain as that of n / tau independent ones. Far out the estimated rho_k are noise, so the sum must
end somewhere: at Sokal's window, the first lag beyond five times the sum so far (A. D. Sokal, Monte Carlo Methods in
Statistical Mechanics, 1996, section 3), which also counts what swings below zero; or where rho falls under a floor, for
residuals in which a slow misfit of the model lies under the noise.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from identification.common.arrays import Array

SOKAL = 5.0
# A block is so many autocorrelation times long: neighbouring means then share under a tenth of their variance.
TIMES_A_BLOCK = 5.0
# Below this the estimate cannot be told from independent values.
INDEPENDENT = 1.2
# So many blocks a series must have for its autocorrelation time to be more than a lower bound.
FEWEST_BLOCKS = 8


@dataclass(frozen=True)
class AutocorrelationTime:
    """values: the time, 1 where neighbours are independent; count: of the series it was estimated from."""

    values: float
    count: int

    @property
    def block(self) -> int:
        """How many values make a block whose mean is nearly independent of its neighbour's."""
        return int(np.ceil(TIMES_A_BLOCK * self.values)) if self.values > INDEPENDENT else 1

    @property
    def short(self) -> bool:
        """Whether the series is too short for its own memory: the time is then rather too small."""
        return self.count < FEWEST_BLOCKS * self.block


def autocorrelation_time(residual: Array, floor: float | None = None, most: int | None = None) -> AutocorrelationTime:
    """Of a series (n,), or of (n, C) columns that share it, whose mean is zero. Summed over Sokal's window, or up to the first
    rho below `floor`, at most `most` lags. Under FEWEST_BLOCKS values tell nothing: their time is 1, and `short`."""
    count = len(residual)
    if count < FEWEST_BLOCKS:
        return AutocorrelationTime(1.0, count)
    size = 1 << (2 * count - 1).bit_length()
    spectrum = np.fft.rfft(residual.reshape(count, -1), size, axis=0)
    covariance = np.fft.irfft(np.sum(spectrum * spectrum.conj(), axis=1), size)[:count]
    rho = covariance / max(float(np.vdot(residual, residual)), 1e-300)
    if floor is None:
        times = 2 * np.cumsum(rho) - 1
        window = np.flatnonzero(np.arange(count) >= SOKAL * times)
        return AutocorrelationTime(float(max(1.0, times[window[0] if len(window) else -1])), count)
    rho = rho[: None if most is None else most + 1]
    below = np.flatnonzero(rho < floor)
    return AutocorrelationTime(float(1.0 + 2.0 * np.sum(rho[1: below[0] if len(below) else None])), count)

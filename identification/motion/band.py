"""The band in which a gear is a spring: everything is low-passed alike and thinned.

`deflection = c torque` holds quasi-statically. Above the drive's lowest resonance the motor's inertia takes the torque, and
the controller answers encoder noise with torque; there the same regression gives no stiffness at all (on the public KUKA
records a fit over the full band finds c = 0). Filtering both sides of a linear model leaves its coefficients as they are.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from identification.common.arrays import read_only

Array = NDArray[np.float64]
# Hz. A choice, made after looking at the public KUKA records (docs/real-data.md says how much hangs on it); no document.
BAND = 6.0
# Samples kept a period of the band's upper edge.
KEPT = 2.4
# So far a clock may be off: a log of 250 Hz is one of 249.9999 Hz, whose time was counted from another zero.
CLOCK = 1e-4


def low_pass(columns: Array, rate: float, band: float = BAND) -> Array:
    """Columns (n, p) under `band` [Hz], symmetric (no lag), thinned; the filter's half-length is lost at either end.

    A log that is slower than the band needs comes back as it is.
    """
    step = _kept_every(rate, band)
    if not step:
        return columns
    kernel = _kernel(rate, band)
    # Only what is kept is filtered; the kernel is the same from both ends.
    return np.asarray(np.lib.stride_tricks.sliding_window_view(columns, len(kernel), axis=0)[::step] @ kernel)


def thinned(values: Array, rate: float, band: float = BAND) -> Array:
    """The values (n,) at the samples that `low_pass` keeps."""
    step = _kept_every(rate, band)
    if not step:
        return values
    half = len(_kernel(rate, band)) // 2
    return values[half: len(values) - half: step]


def passed_step(since: Array, rate: float, band: float = BAND) -> Array:
    """What `low_pass` makes of a step from 0 to 1, so many seconds (...) after it."""
    if not _kept_every(rate, band):
        return np.asarray(since >= 0, dtype=float)
    kernel = _kernel(rate, band)
    place = np.arange(-1, len(kernel)) - len(kernel) // 2
    return np.asarray(np.interp(since * rate, place, np.concatenate([[0.0], np.cumsum(kernel)])))


def _kept_every(rate: float, band: float) -> int:
    """Every how many samples one is kept; 0 where the log is slower than the band needs."""
    rate *= 1 + CLOCK
    return 0 if rate < 2.5 * band else int(rate / (band * KEPT))


@lru_cache(maxsize=32)
def _kernel(rate: float, band: float) -> Array:
    """The filter, symmetric, of sum one; kept, since every column asks for it."""
    half = int(np.ceil(2.0 * rate / band * (1 - CLOCK)))
    place = np.arange(-half, half + 1)
    kernel: Array = np.sinc(2 * band / rate * place) * np.blackman(2 * half + 3)[1:-1]
    kernel /= kernel.sum()
    read_only(kernel)
    return kernel

"""How much a mean force scatters: what the stretches around it show, since a single one cannot tell scatter from a force that
changes along it.

A stretch that holds two or three revolutions of the spindle has as many batches, and where the force rises, jumps or ends they
differ by that: no error of the mean, which is what the force was there. Scatter is the cutter's and the sensor's, alike over
many targets; a change of the force is at few. So the variance of a sample is the median over a block of targets, of those with
force and of those without it apart.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from identification.common.arrays import Array

Indices = NDArray[np.intp]
# Targets of a block: more than a corner or an entry has, few enough to stay in one kind of cut. Under half as many tell
# nothing.
BLOCK = 32


def of_blocks(standard_error: Array, samples: Array, degrees: Indices, forced: NDArray[np.bool_]) -> Array:
    """Standard errors (N, 3) of mean forces by the median scatter around them: standard_error (N, 3) by each target's own
    batches, NaN where there are too few, of `degrees` (N,) of freedom; samples (N,)."""
    # The median of chi^2 over its degrees of freedom (Wilson and Hilferty).
    median = (1 - 2 / (9 * np.maximum(degrees, 1))) ** 3
    of_one = standard_error**2 * (samples / median)[:, None]
    result = standard_error.copy()
    for chosen in (forced, ~forced):
        places = np.flatnonzero(chosen & np.isfinite(of_one).all(axis=1))
        if len(places) < BLOCK // 2:
            continue
        count = max(len(places) // BLOCK, 1)
        size, longer = divmod(len(places), count)
        split = longer * (size + 1)
        blocks = [places[:split].reshape(longer, size + 1), places[split:].reshape(count - longer, size)]
        middle = np.concatenate([block.mean(axis=1) for block in blocks])
        typical = np.concatenate([np.median(of_one[block], axis=1) for block in blocks])
        around = np.column_stack([np.interp(places, middle, axis) for axis in typical.T])
        result[places] = np.sqrt(around / samples[places, None])
    return result

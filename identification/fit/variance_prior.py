"""What is believed of the noise's variance components before the data (noise.py).

A stated size is what a data sheet says of it: within a third, hardly ever much too large, now and then far too small. Of a part
that the cell file leaves out only the usual size is known: it may well be nothing, and is hardly several times as large. Of
set-ups and memory, which no cell file states, not even that: where they are there they may be ten times the usual.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from identification.fit.noise import NoiseModel
from identification.fit.noise_parts import OPTIONAL

Array = NDArray[np.float64]

# Scale of ln s about ln 1 where the part is stated, and for a sensor of which only the default is known.
STATED_LOG_SCALE = 0.3
UNSTATED_LOG_SCALE = 0.7
# Mean size of force error and re-seating that are not stated, and scale of set-ups and memory, in units of the usual ones.
UNSTATED_MEAN = 2.0
OPTIONAL_SCALE = 2.0
# Above 1 the logarithm has a Student distribution, below a normal one.
LOG_DEGREES = 4.0


def log_prior(model: NoiseModel, logs: Array) -> Array:
    """ln prior (S,) of the logarithms (S, 6) of the components (noise_parts.PARTS), each without its constant but for
    the optional ones, whose presence is weighed too.

    Stated, or the sensor: about 1 in the logarithm, normal below and Student above. Force error and re-seating that are not
    stated: exponential in the size, with a mean of twice the usual one. Set-ups and memory: half-Cauchy in the size.
    """
    total = np.zeros(len(logs))
    for part, stated in enumerate(model.stated):
        if not model.active[part]:
            continue
        log = logs[:, part]
        if stated or part == 0:
            squared = (log / (STATED_LOG_SCALE if stated else UNSTATED_LOG_SCALE)) ** 2
            total -= 0.5 * np.where(log < 0, squared, (LOG_DEGREES + 1) * np.log1p(squared / LOG_DEGREES))
        elif part in OPTIONAL:
            size = np.exp(log) / OPTIONAL_SCALE
            total += np.log(2.0 / np.pi * size / (1.0 + size**2))
        else:
            total += log - np.exp(log) / UNSTATED_MEAN
    return total

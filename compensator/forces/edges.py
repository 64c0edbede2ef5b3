"""Where a cut begins or ends within the stretch of a target: the mean over it is the force of neither side, and a log that
names targets does not tell on which of them the target stands."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from compensator.forces.target_rows import TargetRows
from identification.common.arrays import Array


def at_edges(rows: TargetRows, force: Array, forced: NDArray[np.bool_]) -> Array:
    """1 sigma (N, 3) [N] of how far the force at a target is from the mean over its stretch, where a cut begins or ends in
    that: what the samples force (m, 3) [N] scatter by in it beyond what they do inside the cut, 0 elsewhere. forced (N,).

    Of a force F over the share w of the stretch the mean is w F; at the target it is F or nothing, which is off that by
    F sqrt(w (1 - w)) in the mean of both, as its samples are.
    """
    found = np.zeros((rows.count, 3))
    air = ~forced & (rows.samples > 0)
    before, behind = np.insert(air[:-1], 0, False), np.append(air[1:], False)
    edges, inside = forced & (before | behind), forced & ~before & ~behind & (rows.rows > 1)
    if edges.any():
        variance = np.maximum(rows.mean(force**2) - rows.mean(force) ** 2, 0.0)
        ordinary = np.median(variance[inside], axis=0) if inside.any() else np.zeros(3)
        found[edges] = np.sqrt(np.maximum(variance[edges] - ordinary, 0.0))
    return found

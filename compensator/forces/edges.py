"""Where a cut begins or ends within the stretch of a target: the mean over it is the force of neither side, and a log that
names targets does not tell on which of them the target stands."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from compensator.forces.target_rows import TargetRows
from identification.common.arrays import Array

# A target whose neighbour has under this share of its force is at an edge.
HALF = 0.5


def at_edges(rows: TargetRows, force: Array, mean: Array, forced: NDArray[np.bool_]) -> Array:
    """1 sigma (N, 3) [N] of how far the force at a target is from the mean over its stretch, where a cut begins or ends in
    that: what the samples force (m, 3) [N] scatter by in it beyond what they do inside the cut, 0 elsewhere. mean (N, 3)
    [N]: the force on the tool, forced (N,).

    Of a force F over the share w of the stretch the mean is w F; at the target it is F or nothing, which is off that by
    F sqrt(w (1 - w)) in the mean of both, as its samples are.
    """
    found = np.zeros((rows.count, 3))
    # What drifts, or is not quite told apart from zero, is air beside a cut.
    size = np.where(rows.samples > 0, np.linalg.norm(mean, axis=1), np.inf)
    least = np.minimum(np.insert(size[:-1], 0, np.inf), np.append(size[1:], np.inf))
    edges, inside = forced & (least < HALF * size), forced & (least >= HALF * size) & (rows.rows > 1)
    if edges.any():
        variance = np.maximum(rows.mean(force**2) - rows.mean(force) ** 2, 0.0)
        ordinary = np.median(variance[inside], axis=0) if inside.any() else np.zeros(3)
        found[edges] = np.sqrt(np.maximum(variance[edges] - ordinary, 0.0))
    return found

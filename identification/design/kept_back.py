"""Poses that are measured and not fitted: what the gain of a diagnosis, and the fit itself, are judged by.

They stand where nothing else does: each the farthest, in shares of the joints' ranges, from all that are fitted and from those
chosen before it, so that a model that is right only near its data is found out. Slots are taken in turn.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from identification.design.domain import Domain, Pool

Array = NDArray[np.float64]


def kept_back(domain: Domain, pool: Pool, fitted: Pool, count: int) -> Pool:
    """`count` runs of the pool."""
    scale = np.ptp(domain.rig.cell.robot.limits, axis=1)
    taken, chosen = fitted.theta, []
    for i in range(count):
        mine = np.flatnonzero(pool.slot == i % len(domain.slots))
        distance = distances(pool.theta[mine], taken, scale).min(axis=1)
        chosen.append(int(mine[np.argmax(distance)]))
        taken = np.vstack([taken, pool.theta[chosen[-1]]])
    return pool.take(np.array(chosen, dtype=np.intp))


def distances(theta: Array, others: Array, scale: Array) -> Array:
    """How far poses (n, 6) are from others (m, 6), in shares of `scale` (6,) [rad]; a whole turn of an axis is no distance."""
    apart = np.abs(theta[:, None] - others[None])
    return np.asarray(np.linalg.norm(np.minimum(apart, np.abs(2 * np.pi - apart)) / scale, axis=2))

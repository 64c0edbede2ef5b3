"""What each spring does to a row, by the independent arm to first order, and errors beside it that no spring explains."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tests.virtual_cell.arm import IRB6660

Array = NDArray[np.float64]


def by_compliance(theta: Array, tcp: Array, force: Array) -> Array:
    """The motion (n, 3, 6) [m] that a joint makes by a compliance of 1 rad/(N m), under forces (n, 3) [N] at poses (n, 6)."""
    step = 1e-5 * np.eye(6)
    jacobian = np.stack([(IRB6660.pose(theta + by, tcp)[0] - IRB6660.pose(theta - by, tcp)[0]) / 2e-5 for by in step], axis=2)
    return np.asarray(jacobian * np.einsum("nij,ni->nj", jacobian, force)[:, None])


def beside(each: Array, seed: int = 6) -> Array:
    """Readings (n, 3), 1 RMS, of which no springs explain any: each (n, 3, m) is what they do."""
    columns = each.reshape(-1, each.shape[2])
    columns = columns / np.linalg.norm(columns, axis=0)
    found = np.random.default_rng(seed).standard_normal(len(columns))
    found -= columns @ np.linalg.lstsq(columns, found, rcond=None)[0]
    return np.asarray(found.reshape(-1, 3) / np.sqrt(np.mean(found**2)))

"""Smooth: the slow part of an error that repeats with the joint's angle, as harmonics of the joint's turn.

Harmonic h of the turn has a cosine and a sine of standard deviation size / h^2 before the data: what an eccentric ring makes is
large, what wiggles is small. A log visits a part of the turn only, so a few combinations of the harmonics say all; outside the
angles visited they go on as harmonics do, not as polynomials.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
HARMONICS = 24
# A combination counts from this root mean square over the angles visited on, per unit of `size`.
LEAST = 1e-3


@dataclass(frozen=True, eq=False)
class Smooth:
    """mix (2 HARMONICS, k): the combinations; size [rad]: standard deviation of the coefficients before the data."""

    mix: Array
    size: float

    def columns(self, angle: Array) -> Array:
        """The combinations (n, k) at joint angles (n,) [rad]."""
        return np.asarray(_harmonics(angle) @ self.mix)


def smooth_over(angle: Array, size: float) -> Smooth:
    """The combinations that angles (n,) [rad] can tell apart; a constant belongs to the zero, not to them."""
    visited = _harmonics(angle)
    _, spread, mix = np.linalg.svd((visited - visited.mean(axis=0)) / np.sqrt(len(angle)), full_matrices=False)
    return Smooth(mix[spread > LEAST].T, size)


def _harmonics(angle: Array) -> Array:
    order = np.arange(1.0, HARMONICS + 1)
    turns = np.column_stack([np.cos(angle[:, None] * order), np.sin(angle[:, None] * order)])
    return np.asarray(turns / np.tile(order, 2) ** 2)


def log_evidence(white: Array, base: Array, deflection: Array, variance: float, sizes: Array) -> Array:
    """Logarithm (S,) of how much likelier the deflection (m,) is with the combinations (m, k), of each standard deviation in
    `sizes`, than without them, a base (m, p) beside both left free; all whitened, noise variance [rad^2]."""
    known = np.linalg.qr(base)[0]
    left, columns = deflection - known @ (known.T @ deflection), white - known @ (known.T @ white)
    strength, turned = np.linalg.eigh(columns.T @ columns)
    along = turned.T @ (columns.T @ left)
    ratio = sizes[:, None] ** 2 / variance
    told = 1 + ratio * np.maximum(strength, 0.0)
    return np.asarray(np.sum(-0.5 * np.log(told) + 0.5 * along**2 * ratio / variance / told, axis=1))

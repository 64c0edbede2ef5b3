"""Smooth: the slow part of an error that repeats with the joint's angle, as waves over it.

A wave that comes n times a turn has a cosine and a sine of the same standard deviation before the data. Waves of the whole turn
(n = 1, 2, 3 ...) fall as 1 / n^2: what an eccentric ring makes is large, what wiggles is small. Where a log stays within a few
degrees an error may go up and down there more than once: then waves of four times the angles visited are as large as one
another up to `bend` cycles a turn, and fall from there on. A log visits a part of the turn only, so a few combinations of the
waves say all; outside the angles visited they go on as waves do, not as polynomials.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
WAVES = 24
# A combination counts from this root mean square over the angles visited on, per unit of `size`.
LEAST = 1e-3


@dataclass(frozen=True, eq=False)
class Smooth:
    """cycles (w,): of the waves, a turn; mix (2 w, k): the combinations; size [rad]: standard deviation of the coefficients
    before the data; bend: cycles a turn from which on they fall."""

    cycles: Array
    mix: Array
    size: float
    bend: float

    def columns(self, angle: Array) -> Array:
        """The combinations (n, k) at joint angles (n,) [rad]."""
        return np.asarray(_waves(angle, self.cycles, self.bend) @ self.mix)


def smooth_over(angle: Array, size: float, bend: float = 1.0) -> Smooth:
    """The combinations that angles (n,) [rad] can tell apart; a constant belongs to the zero, not to them."""
    cycles = np.arange(1.0, WAVES + 1) * (1.0 if bend <= 1 else 2 * np.pi / (4 * max(float(np.ptp(angle)), 1e-6)))
    visited = _waves(angle, cycles, bend)
    _, spread, mix = np.linalg.svd((visited - visited.mean(axis=0)) / np.sqrt(len(angle)), full_matrices=False)
    return Smooth(cycles, mix[spread > LEAST].T, size, bend)


def _waves(angle: Array, cycles: Array, bend: float) -> Array:
    turns = np.column_stack([np.cos(angle[:, None] * cycles), np.sin(angle[:, None] * cycles)])
    return np.asarray(turns / np.tile(np.maximum(cycles / bend, 1.0), 2) ** 2)


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

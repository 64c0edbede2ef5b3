"""The smooth remainder over the work space: a Gaussian process that a few places carry, and that ends where nothing was
measured.

Each component of the displacement f (base frame) has the kernel a^2 k(r), Matern 5/2 in the scaled distance r between TCP
positions, length l, and between joint angles as points on their circles, length POSTURE: another orientation, tool or branch of
the arm is another place. With places U of the measured part, C C^T = k(U, U) and phi(x) = C^-1 k(U, x),

    f(x) = sum_j phi_j(x) w_j + rest,      w_j ~ N(0, a^2 I) (3,),      var rest = a^2 (1 - |phi(x)|^2) a component:

the prior is that of the process itself; the measured part tells of w alone, and of the rest nothing is known. Far away phi is
zero, and so is what is learned (Quinonero-Candela and Rasmussen, J. Mach. Learn. Res. 6 (2005) 1939, deterministic training
conditional).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from identification.common.arrays import Array

# Joint angles that differ by this [rad] are as far from each other as positions that differ by the length. Engineering
# judgement: kinematic errors are smooth over tens of degrees.
POSTURE = 0.5
# Keeps k(U, U) positive definite; in shares of the variance.
NUGGET = 1e-6
# A place of which the measured part tells less than this share of the variance is outside of what was measured.
INSIDE = 0.5


@dataclass(frozen=True, eq=False)
class Remainder:
    """places (m, 3) [m] TCP positions in the base frame, posture (m, 6) [rad]; length, amplitude [m]: 1 sigma a component
    before anything was measured."""

    places: Array
    posture: Array
    length: float
    amplitude: float

    def basis(self, position: Array, theta: Array) -> Array:
        """phi (n, m) at TCP positions (n, 3) [m] and joint angles (n, 6) [rad]; where these are not known (NaN) zeros."""
        k = kernel(features(position, theta, self.length), self._features)
        return np.asarray(np.linalg.solve(self._factor, np.nan_to_num(k).T).T)

    def unseen(self, basis: Array) -> Array:
        """Variance (n,) [m^2] a component of what the measured part says nothing of, at places with this basis (n, m)."""
        return np.asarray(self.amplitude**2 * np.clip(1.0 - np.sum(basis**2, axis=1), 0.0, 1.0))

    @cached_property
    def _features(self) -> Array:
        return features(self.places, self.posture, self.length)

    @cached_property
    def _factor(self) -> Array:
        return np.asarray(np.linalg.cholesky(kernel(self._features, self._features) + NUGGET * np.eye(len(self.places))))


def features(position: Array, theta: Array, length: float) -> Array:
    """Coordinates (n, 15) whose distance is the scaled distance of places: position (n, 3) [m] by length, and angles (n, 6)
    [rad] as points on circles by POSTURE."""
    return np.concatenate([position / length, np.cos(theta) / POSTURE, np.sin(theta) / POSTURE], axis=1)


def kernel(first: Array, second: Array) -> Array:
    """Matern 5/2 (n, m) of unit variance between features (n, d) and (m, d)."""
    square = np.sum(first**2, axis=1)[:, None] + np.sum(second**2, axis=1) - 2.0 * first @ second.T
    r = np.sqrt(5.0 * np.maximum(square, 0.0))
    return np.asarray((1.0 + r + r**2 / 3.0) * np.exp(-r))


def spread_out(position: Array, theta: Array, length: float, most: int) -> Array:
    """Indices (m,) of at most so many places, each the farthest from those before it, the first the one nearest to the
    middle."""
    where = features(position, theta, length)
    chosen = [int(np.argmin(np.sum((where - where.mean(axis=0)) ** 2, axis=1)))]
    distance = np.sum((where - where[chosen[0]]) ** 2, axis=1)
    while len(chosen) < min(most, len(where)) and distance.max() > 1e-9:
        chosen.append(int(np.argmax(distance)))
        distance = np.minimum(distance, np.sum((where - where[chosen[-1]]) ** 2, axis=1))
    return np.array(chosen, dtype=np.intp)

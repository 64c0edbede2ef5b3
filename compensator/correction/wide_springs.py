"""Springs that are known to a factor: their compliances are log-normal, and so is what the deviation may be.

To first order in x = ln c the deviation d = sum of c_i v_i is normal about that of the median springs. Known to a third or
worse it is not: no compliance is less than nothing, so d is half of what it is taken for far more seldom than a normal error
says, and twice as much more often. With x ~ N(mean, S), a_i = c_i exp(S_ii / 2) and c at the mean of x, exactly

    E d = sum a_i v_i,      cov d = sum a_i a_j (exp(S_ij) - 1) v_i v_j^T .

Along a direction in which all springs push it one way such a sum is nearly log-normal itself (Fenton, IRE Trans. Commun. Syst.
8 (1960) 57), and less often far below its mean than that one (worse.py).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from identification.common.arrays import Array
from identification.model.compliance import symmetric
from identification.model.effects_in_force import SPRINGS
from identification.model.stiffness import IdentifiedModel

# Where no ln c has a larger standard deviation than this a normal error is as good: half a deviation is seven sigma away.
NARROW = 0.1


@dataclass(frozen=True, eq=False)
class WideSprings:
    """Of the deviation at M targets, by the springs alone: shift (M, 3) [m], by how much its mean is more than that of the
    median springs; first (M, 3, 3) [m^2] its covariance to first order, and covariance (M, 3, 3) [m^2] as it is."""

    shift: Array
    first: Array
    covariance: Array

    @property
    def more(self) -> Array:
        """What a covariance to first order lacks (M, 3, 3) [m^2]."""
        return np.asarray(self.covariance - self.first)

    @property
    def missing(self) -> Array:
        """What the mean square (M,) [m^2] of the distance from the deviation of the median springs has beyond first order."""
        return np.asarray(np.trace(self.more, axis1=1, axis2=2) + np.sum(self.shift**2, axis=1))

    @classmethod
    def of(cls, model: IdentifiedModel, count: int) -> WideSprings | None:
        """Room for so many targets; None where the springs are known well."""
        if not np.diagonal(model.covariance[SPRINGS, SPRINGS]).max() > NARROW**2:
            return None
        return cls(np.empty((count, 3)), np.empty((count, 3, 3)), np.empty((count, 3, 3)))

    def put(self, places: np.ndarray, model: IdentifiedModel, columns: Array, wrench: Array) -> None:
        """At some places (n,) among the M, by the Jacobian's columns (6, 6, n) and the wrench (n, 6) there."""
        pushed = columns[:, :3] * (model.compliance[:, None] * np.einsum("irn,nr->in", columns, wrench))[:, None]
        of_log = model.covariance[SPRINGS, SPRINGS]
        mean = np.exp(0.5 * np.diagonal(of_log))
        exact = np.outer(mean, mean) * np.expm1(of_log)
        self.shift[places] = np.einsum("i,irn->nr", mean - 1, pushed)
        for of, covariance in ((self.first, of_log), (self.covariance, exact)):
            of[places] = symmetric(pushed, np.einsum("ij,jrn->irn", covariance, pushed)).T

"""Design criteria as information functions: concave, homogeneous of degree one, larger is better.

With M the posterior precision (6, 6) of ln c (paper eq. 17, C_post = M^-1), and ln c = -ln k, so that a joint's standard
deviation is the relative one of its stiffness:

    D    det(M)^(1/6)            volume of the confidence ellipsoid (paper eq. 16, Psi_D = det C_post)
    L    1 / trace(W M^-1)       A in ln k, W = 1; A in raw k, W = diag(k^2): eq. 16's Psi_A; I with the W of `milling.py`
    E    lambda_min(M)           longest axis of the ellipsoid (paper eq. 16, Psi_E = lambda_max C_post)

For such a function Phi (Pukelsheim, Optimal Design of Experiments, 2006, ch. 5) and any M and M*, concave and homogeneous,

    Phi(M*) <= trace(H M*) ,   H = grad Phi(M) ,

which is all the certificate needs. Where the loads at hand cannot show all of ln c (dead weights an upright joint 1), the
criterion is about what they can: with V (6, r) spanning it, Phi is that of the precision of V^T ln c,

    N(M) = (V^T M^-1 V)^-1 ,        N(M*) <= A^T M* A  for  A = M^-1 V N(M)

(in the Loewner order; Pukelsheim, ch. 3), so that `A H A^T` is a tangent where H is one of Phi at N. E is not smooth; it is
searched with the matrix means (trace(M^-p) / 6)^(-1/p), which tend to it from above, and bounded with
`lambda_min(M*) <= trace(V M*)`, true for every V >= 0 of trace one.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
KINDS = ("D", "A", "E", "I")
# Powers of the matrix means that stand in for E: smooth first, then close (6^(1/p) above at most: 20 % and 2.3 %).
POWERS = (10.0, 80.0)
EXCHANGE_POWER = 40.0
# A joint is seen where more than this share of its direction is.
MOSTLY = 0.5


@dataclass(frozen=True, eq=False)
class Criterion:
    """kind: D, L or E. weight (6, 6): W of L. name: what the user asked for. power: of the matrix mean that stands in for E.
    seen (6, r): an orthonormal basis of what the loads can show, None for all."""

    kind: str
    name: str
    weight: Array
    power: float = EXCHANGE_POWER
    seen: Array | None = None

    def smooth_with(self, power: float) -> Criterion:
        """The same criterion with another matrix mean."""
        return replace(self, power=power)

    def of_seen(self, seen: Array) -> Criterion:
        """The same criterion about what the columns of `seen` (6, r), orthonormal, span."""
        return replace(self, seen=seen)

    @property
    def powers(self) -> tuple[float, ...]:
        """The matrix means to go through; a smooth criterion needs none."""
        return POWERS if self.kind == "E" else (self.power,)

    @property
    def left_out(self) -> tuple[int, ...]:
        """The joints (1-based) that lie mostly outside what is seen: their stiffness stays what it was before."""
        if self.seen is None:
            return ()
        return tuple(int(i) + 1 for i in np.flatnonzero(np.sum(self.seen**2, axis=1) < MOSTLY))

    def value(self, information: Array) -> Array:
        """Phi (...) of information matrices (..., 6, 6), exactly; 0 where one is singular."""
        return self._value(self._of_seen(information))

    def smooth(self, information: Array) -> Array:
        """The smooth function (...) that is searched: Phi itself, or the matrix mean in place of E."""
        return self._smooth(self._of_seen(information))

    def slope(self, information: Array) -> Array:
        """Gradient (6, 6) of ln `smooth`, with trace(slope M) = 1."""
        return self._carried_back(information, self._slope(self._of_seen(information)))

    def tangent(self, information: Array) -> Array:
        """H (6, 6), positive semidefinite, with Phi(M*) <= trace(H M*) for every M*."""
        seen = self._of_seen(information)
        slope = self._slope(seen)
        tangent = slope / np.trace(slope) if self.kind == "E" else float(self._value(seen)) * slope
        return self._carried_back(information, tangent)

    @cached_property
    def _hidden(self) -> Array:
        """Orthonormal basis (6, 6 - r) of what is not seen."""
        assert self.seen is not None
        return np.asarray(np.linalg.qr(self.seen, mode="complete")[0][:, self.seen.shape[1]:])

    def _of_seen(self, information: Array) -> Array:
        """N (..., r, r), as the Schur complement that it is."""
        if self.seen is None:
            return information
        return np.asarray(self.seen.T @ information @ self._across(information))

    def _across(self, information: Array) -> Array:
        """A (..., 6, r)."""
        assert self.seen is not None
        crossed = self._hidden.T @ information
        return np.asarray(self.seen - self._hidden @ np.linalg.solve(crossed @ self._hidden, crossed @ self.seen))

    def _carried_back(self, information: Array, slope: Array) -> Array:
        """A slope A^T (6, 6) of a slope (r, r) at N."""
        if self.seen is None:
            return slope
        across = self._across(information)
        return np.asarray(across @ slope @ across.T)

    @property
    def _weight(self) -> Array:
        return self.weight if self.seen is None else np.asarray(self.seen.T @ self.weight @ self.seen)

    def _value(self, information: Array) -> Array:
        if self.kind == "D":
            sign, logarithm = np.linalg.slogdet(information)
            return np.asarray(np.where(sign > 0, np.exp(logarithm / information.shape[-1]), 0.0))
        if self.kind == "E":
            return np.asarray(np.maximum(np.linalg.eigvalsh(information)[..., 0], 0.0))
        inverse = np.linalg.inv(information)
        return np.asarray(1.0 / np.einsum("ij,...ji->...", self._weight, inverse))

    def _smooth(self, information: Array) -> Array:
        if self.kind != "E":
            return self._value(information)
        eigenvalues = np.maximum(np.linalg.eigvalsh(information), 1e-300)
        lowest = eigenvalues[..., :1]
        return np.asarray(lowest[..., 0] * np.mean((lowest / eigenvalues) ** self.power, axis=-1) ** (-1 / self.power))

    def _slope(self, information: Array) -> Array:
        if self.kind == "D":
            return np.asarray(np.linalg.inv(information) / len(information))
        if self.kind == "E":
            eigenvalues, vectors = np.linalg.eigh(information)
            share = (eigenvalues[0] / eigenvalues) ** self.power
            return np.asarray((vectors * (share / share.sum() / eigenvalues)) @ vectors.T)
        inverse = np.linalg.inv(information)
        middle = inverse @ self._weight @ inverse
        return np.asarray(middle / np.trace(self._weight @ inverse))


def d_criterion() -> Criterion:
    """D: the volume of the confidence ellipsoid."""
    return Criterion("D", "D", np.eye(6))


def a_criterion(stiffness: Array | None = None) -> Criterion:
    """A: the mean variance of ln k, or, with stiffness (6,) [N m/rad], of raw k (eq. 16, 18; almost only the largest two)."""
    if stiffness is None:
        return Criterion("L", "A", np.eye(6))
    return Criterion("L", "A in raw k", np.diag((stiffness / stiffness.max()) ** 2))


def e_criterion() -> Criterion:
    """E: the longest axis of the confidence ellipsoid."""
    return Criterion("E", "E", np.eye(6))


def i_criterion(weight: Array) -> Criterion:
    """I: the mean variance of the predicted deflection; weight (6, 6) of `milling.prediction_weight`."""
    return Criterion("L", "I", weight / np.trace(weight))

"""Design criteria as information functions: concave, homogeneous of degree one, larger is better.

With M the posterior precision (6, 6) of ln c (paper eq. 17, C_post = M^-1), and ln c = -ln k, so that a joint's standard
deviation is the relative one of its stiffness:

    D    det(M)^(1/6)            volume of the confidence ellipsoid (paper eq. 16, Psi_D = det C_post)
    L    1 / trace(W M^-1)       A in ln k, W = 1; A in raw k, W = diag(k^2): eq. 16's Psi_A; I with the W of `milling.py`
    E    lambda_min(M)           longest axis of the ellipsoid (paper eq. 16, Psi_E = lambda_max C_post)

For such a function Phi (Pukelsheim, Optimal Design of Experiments, 2006, ch. 5) and any M and M*, concave and homogeneous,

    Phi(M*) <= trace(H M*) ,   H = grad Phi(M) ,

which is all the certificate needs. E is not smooth; it is searched with the matrix means (trace(M^-p) / 6)^(-1/p), which
tend to it from above, and bounded with `lambda_min(M*) <= trace(V M*)`, true for every V >= 0 of trace one.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
KINDS = ("D", "A", "E", "I")
# Powers of the matrix means that stand in for E: smooth first, then close (6^(1/p) above at most: 20 % and 2.3 %).
POWERS = (10.0, 80.0)
EXCHANGE_POWER = 40.0


@dataclass(frozen=True, eq=False)
class Criterion:
    """kind: D, L or E. weight (6, 6): W of L. name: what the user asked for. power: of the matrix mean that stands in for E."""

    kind: str
    name: str
    weight: Array
    power: float = EXCHANGE_POWER

    def smooth_with(self, power: float) -> Criterion:
        """The same criterion with another matrix mean."""
        return Criterion(self.kind, self.name, self.weight, power)

    @property
    def powers(self) -> tuple[float, ...]:
        """The matrix means to go through; a smooth criterion needs none."""
        return POWERS if self.kind == "E" else (self.power,)

    def value(self, information: Array) -> Array:
        """Phi (...) of information matrices (..., 6, 6), exactly; 0 where one is singular."""
        if self.kind == "D":
            sign, logarithm = np.linalg.slogdet(information)
            return np.asarray(np.where(sign > 0, np.exp(logarithm / 6), 0.0))
        if self.kind == "E":
            return np.asarray(np.maximum(np.linalg.eigvalsh(information)[..., 0], 0.0))
        inverse = np.linalg.inv(information)
        return np.asarray(1.0 / np.einsum("ij,...ji->...", self.weight, inverse))

    def smooth(self, information: Array) -> Array:
        """The smooth function (...) that is searched: Phi itself, or the matrix mean in place of E."""
        if self.kind != "E":
            return self.value(information)
        eigenvalues = np.maximum(np.linalg.eigvalsh(information), 1e-300)
        lowest = eigenvalues[..., :1]
        return np.asarray(lowest[..., 0] * np.mean((lowest / eigenvalues) ** self.power, axis=-1) ** (-1 / self.power))

    def slope(self, information: Array) -> Array:
        """Gradient (6, 6) of ln `smooth`, with trace(slope M) = 1."""
        if self.kind == "D":
            return np.asarray(np.linalg.inv(information) / 6)
        if self.kind == "E":
            eigenvalues, vectors = np.linalg.eigh(information)
            share = (eigenvalues[0] / eigenvalues) ** self.power
            return np.asarray((vectors * (share / share.sum() / eigenvalues)) @ vectors.T)
        inverse = np.linalg.inv(information)
        middle = inverse @ self.weight @ inverse
        return np.asarray(middle / np.trace(self.weight @ inverse))

    def tangent(self, information: Array) -> Array:
        """H (6, 6), positive semidefinite, with Phi(M*) <= trace(H M*) for every M*."""
        slope = self.slope(information)
        if self.kind == "E":
            return np.asarray(slope / np.trace(slope))
        return np.asarray(float(self.value(information)) * slope)


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

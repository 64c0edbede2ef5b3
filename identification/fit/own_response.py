"""The own response of a pose visit: the compliance that its readings show by themselves, whatever springs the robot has.

At one pose the plain robot answers a force with `G F`, G = J diag(c) J^T (3, 3). The readings of one visit, less the model, are
fitted with `dG F + a`: a compliance of their own and the re-seating offset, robustly, so that single bad rows do not speak for
the visit. Whatever is wrong at a whole pose (its angles, its loads, something that drags or sticks) is in dG.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
# Degrees of freedom of the Student weights within a visit, and how often they are worked out: fixed, so that replicates get
# the same.
DEGREES, ROUNDS = 4.0, 4
# A direction of load under this share of the largest is none.
NO_LOAD = 1e-3
# Directions in which a visit has a response to tell, as eigenvalues against the largest.
SEEN = 1e-9


@dataclass(frozen=True, eq=False)
class LoadColumns:
    """What n rows (n, 3) of force [N] can tell of a response: columns (n, 3, 3 r) [-], one block of three a direction of load,
    for coefficients in m: the response to `scale` (r,) newton along `directions` (r, 3)."""

    columns: Array
    directions: Array
    scale: Array

    @classmethod
    def of(cls, force: Array) -> LoadColumns:
        """The columns for these forces (n, 3)."""
        _, strength, directions = np.linalg.svd(force, full_matrices=False)
        kept = strength > NO_LOAD * strength.max(initial=0.0)
        scale = np.sqrt(np.mean((force @ directions[kept].T) ** 2, axis=0))
        shares = force @ directions[kept].T / scale
        columns = shares[:, None, :, None] * np.eye(3)[None, :, None, :]
        return cls(columns.reshape(len(force), 3, -1), directions[kept], scale)

    @property
    def has_offset(self) -> bool:
        """Whether an offset can be told from the response: the loads differ by more than their sign allows."""
        shares = self.columns.reshape(len(self.columns), 3, -1, 3)[:, 0, :, 0]
        rank = np.linalg.matrix_rank(np.column_stack([np.ones(len(shares)), shares]), tol=0.1)
        return bool(rank > shares.shape[1])

    def coefficients(self, compliance: Array) -> Array:
        """Of compliance matrices (..., 3, 3) [m/N]: (..., 3 r) [m]."""
        along = np.einsum("...ij,rj,r->...ri", compliance, self.directions, self.scale)
        return np.asarray(along.reshape(*along.shape[:-2], -1))


@dataclass(frozen=True, eq=False)
class OwnResponse:
    """Of B residuals: coefficients (B, K), their covariance (B, K, K) and the rows' weights (B, n). left (B,): what stays in
    the rows, in their own noise, -2 ln of a Student density."""

    coefficients: Array
    covariance: Array
    row_weight: Array
    left: Array


def own_response(columns: Array, precision: Array, prior: Array, residual: Array) -> OwnResponse:
    """The robust fit of columns (n, 3, K) with prior precision (K,) to residuals (n, 3, B), all whitened; precision (n, 3, 3),
    nothing where a component was not measured."""
    n, _, count = columns.shape
    weighted = precision @ columns
    square = (np.swapaxes(columns, 1, 2) @ weighted).reshape(n, -1)
    pull = np.einsum("nip,nib->bnp", weighted, residual)
    readings = (np.diagonal(precision, axis1=1, axis2=2) > 0).sum(axis=1)
    # As little as keeps the matrix of a direction without readings from being singular.
    ridge = prior + SEEN * np.diag(square.sum(axis=0).reshape(count, count)).max(initial=0.0)
    weight = np.ones((residual.shape[2], n))
    for _ in range(ROUNDS):
        covariance = np.asarray(np.linalg.inv((weight @ square).reshape(-1, count, count) + np.diag(ridge)), dtype=float)
        coefficients = np.einsum("bpq,bq->bp", covariance, np.einsum("bn,bnp->bp", weight, pull))
        left = residual - np.einsum("nip,bp->nib", columns, coefficients)
        distance = np.einsum("nib,nib->bn", left, precision @ left)
        weight = np.minimum(1.0, (DEGREES + readings) / (DEGREES + distance))
    return OwnResponse(coefficients, covariance, weight,
                       np.sum((DEGREES + readings) * np.log1p(distance / DEGREES), axis=1))

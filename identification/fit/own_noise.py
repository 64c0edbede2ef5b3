"""The noise of rows without what their visit shares: each row's own errors, and a sensor that remembers the reading before.

Where nothing is remembered every row stands alone. Else row t of a visit, times the root of its weight, has the noise
s u_t + d_t with u_t = rho u_(t-1) + sqrt(1 - rho^2) x white and d_t the row's own: the innovations of its Kalman filter are
white, and run backwards they give Sigma^-1 (P. de Jong, Smoothing and interpolation with the state-space model, JASA 84, 1989).
Linear in the rows, and for many noises at once.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Indices = NDArray[np.intp]
EYE = np.eye(3)


@dataclass(frozen=True, eq=False)
class RowsAlone:
    """precision (S, n, 3, 3) of rows that remember nothing, for S noises; log_determinant (S,) of their covariance."""

    precision: Array
    log_determinant: Array

    @classmethod
    def of(cls, own: Array, sensor: Array, measured: NDArray[np.bool_], row_weight: Array) -> RowsAlone:
        """own (S, n, 3, 3): covariance of each row's own errors but the sensor's, which has standard deviation sensor (S,);
        measured (n, 3); row_weight (n,). A component that was not measured counts in the precision, where columns are zero,
        and not in the determinant."""
        precision, determinant = inverse_of_three(own + sensor[:, None, None, None] ** 2 * EYE)
        missing = 3 - measured.sum(axis=1)
        log_determinant = np.log(determinant) - 2 * missing * np.log(sensor[:, None]) - (3 - missing) * np.log(row_weight)
        return cls(precision * row_weight[:, None, None], log_determinant.sum(axis=1))

    def grams(self, columns: Array, q: int, visit: Indices) -> tuple[Array, Array]:
        """columns^T Sigma^-1 columns of the first q of columns (n, 3, q + r): (S, q, q); and, by visit, of the other r with
        all: (S, visits, r, q + r). visit (n,): from 0, in order."""
        size, (n, _, width) = len(self.precision), columns.shape
        # All noises side by side, so that what is multiplied is a few large matrices, not many small ones.
        weighted = (self.precision.transpose(1, 2, 0, 3).reshape(n, -1, 3) @ columns).reshape(3 * n, -1)
        left = columns.reshape(3 * n, width)
        gram = (left[:, :q].T @ weighted).reshape(q, size, width)[..., :q]
        length = np.bincount(visit)
        if np.all(length == length[0]):
            shared = left[:, q:].reshape(len(length), 3 * length[0], width - q).swapaxes(1, 2)
            products = shared @ weighted.reshape(len(length), 3 * length[0], size * width)
        else:
            ends = 3 * np.append(0, np.cumsum(length))
            products = np.array([left[start: end, q:].T @ weighted[start: end] for start, end in pairwise(ends)])
        return gram.swapaxes(0, 1), products.reshape(len(length), width - q, size, width).transpose(2, 0, 1, 3)

    def solve(self, columns: Array) -> Array:
        """Sigma^-1 columns (n, 3, q), of the first noise."""
        return np.asarray(self.precision[0] @ columns)


@dataclass(frozen=True, eq=False)
class RememberingRows:
    """Rows whose sensor remembers, for S noises. steps: the rows at each place of their stretch, (m_t,), the longest stretches
    first; inverse (S, m_t, 3, 3) of the innovations' covariance at each, gain (S, m_t, 3, 3) of the filter; seen (n, 3): what
    was measured; root (n,) of the row weights."""

    steps: tuple[Indices, ...]
    seen: Array
    root: Array
    rho: Array
    log_determinant: Array
    inverse: list[Array] = field(repr=False)
    gain: list[Array] = field(repr=False)

    @classmethod
    def of(cls, own: Array, sensor: Array, rho: Array, measured: NDArray[np.bool_], row_weight: Array,
           steps: tuple[Indices, ...]) -> RememberingRows:
        """As `RowsAlone.of`, with a memory rho (S,)."""
        size, kept = sensor[:, None, None, None] ** 2 * EYE, rho[:, None, None, None]
        seen, inverses, gains = measured.astype(float), [], []
        log_determinant = np.zeros(len(sensor)) - float(np.sum(measured * np.log(row_weight)[:, None]))
        covariance = np.repeat(size, len(steps[0]), axis=1)
        for rows in steps:
            here = seen[rows]
            mask = here[:, :, None] * here[:, None, :]
            covariance = covariance[:, : len(rows)]
            inverse, determinant = inverse_of_three(covariance * mask + own[:, rows] * mask + (1.0 - here)[:, :, None] * EYE)
            log_determinant += np.log(determinant).sum(axis=1)
            gain = (covariance * here[:, None, :]) @ inverse
            covariance = kept**2 * (covariance - gain @ (here[:, :, None] * covariance)) + (1.0 - kept**2) * size
            inverses.append(inverse)
            gains.append(kept * gain * here[:, None, :])
        return cls(steps, seen, np.sqrt(row_weight), rho, log_determinant, inverses, gains)

    def _innovations(self, columns: Array) -> Iterator[Array]:
        """Innovations (S, m_t, 3, q) of columns (n, 3, q), place by place."""
        columns = columns * (self.root[:, None] * self.seen)[:, :, None]
        kept = self.rho[:, None, None, None]
        state = np.zeros((len(self.rho), len(self.steps[0]), *columns.shape[1:]))
        for rows, gain in zip(self.steps, self.gain, strict=True):
            state = state[:, : len(rows)]
            innovation = columns[rows] - self.seen[rows][:, :, None] * state
            yield innovation
            state = kept * state + gain @ innovation

    def grams(self, columns: Array, q: int, visit: Indices) -> tuple[Array, Array]:
        """As `RowsAlone.grams`."""
        size, width = len(self.rho), columns.shape[2]
        gram, products = np.zeros((size, q, q)), np.zeros((size, len(self.steps[0]), width - q, width))
        for inverse, innovation in zip(self.inverse, self._innovations(columns), strict=True):
            weighted = inverse @ innovation
            gram += _flat(innovation[..., :q]) @ _flat(weighted[..., :q]).swapaxes(1, 2)
            products[:, : innovation.shape[1]] += innovation[..., q:].swapaxes(2, 3) @ weighted
        by_visit = np.zeros((int(visit.max()) + 1, size, width - q, width))
        np.add.at(by_visit, visit[self.steps[0]], products.swapaxes(0, 1))
        return gram, by_visit.swapaxes(0, 1)

    def solve(self, columns: Array) -> Array:
        """Sigma^-1 columns (n, 3, q), of the first noise."""
        solved = np.empty(columns.shape)
        back = np.zeros((0, *columns.shape[1:]))
        weighted = [inverse[0] @ innovation[0] for inverse, innovation in zip(
            self.inverse, self._innovations(columns), strict=True)]
        for rows, gain, value in zip(reversed(self.steps), reversed(self.gain), reversed(weighted), strict=True):
            here = self.seen[rows][:, :, None]
            back = np.concatenate([back, np.zeros((len(rows) - len(back), *columns.shape[1:]))])
            value = value - np.swapaxes(gain[0], 1, 2) @ back
            solved[rows] = value * here * self.root[rows][:, None, None]
            back = here * value + self.rho[0] * back
        return solved


def _flat(columns: Array) -> Array:
    """Columns (S, m, 3, q) as (S, q, 3 m)."""
    return columns.reshape(len(columns), -1, columns.shape[3]).swapaxes(1, 2)


def stretches(visit: Indices, longest: int) -> tuple[Indices, ...]:
    """The rows at each place of their stretch: of visit (n,), in the rows' order, or of each `longest` rows of a long one."""
    order = np.argsort(visit, kind="stable")
    place = np.arange(len(order)) - np.searchsorted(visit[order], visit[order])
    first = np.flatnonzero(place % longest == 0)
    size = np.diff(np.append(first, len(order)))
    by_size = np.argsort(-size, kind="stable")
    first, size = first[by_size], size[by_size]
    return tuple(order[first[size > step] + step] for step in range(int(size.max())))


def inverse_of_three(matrix: Array) -> tuple[Array, Array]:
    """Inverse (..., 3, 3) and determinant (...) of symmetric positive definite matrices, all at once: each is small work.

    By their factors L D L^T. Cofactors would lose the determinant where the force error is 1e4 times the sensor's; this holds
    to 1e7 times.
    """
    first, low, lower = matrix[..., 0, 0], matrix[..., 0, 1], matrix[..., 0, 2]
    a, b = low / first, lower / first                       # L: 1; a 1; b c 1
    second = matrix[..., 1, 1] - a * low
    left = matrix[..., 1, 2] - a * lower
    c = left / second
    third = matrix[..., 2, 2] - b * lower - c * left
    # The inverse of L: 1; -a 1; corner -c 1.
    corner = a * c - b
    last, beside = 1 / third, -c / third
    middle = 1 / second - c * beside
    edge, top = corner * last, -a / second + corner * beside
    whole = 1 / first + a * a / second + corner * edge
    inverse = np.stack([whole, top, edge, top, middle, beside, edge, beside, last], axis=-1)
    return np.asarray(inverse.reshape(matrix.shape)), first * second * third

"""The noise of rows without what their visit shares: each row's own errors, and a sensor that remembers the reading before.

Where nothing is remembered every row stands alone. Else row t of a visit, times the root of its weight, has the noise
s u_t + d_t with u_t = rho u_(t-1) + sqrt(1 - rho^2) x white and d_t the row's own: the innovations of its Kalman filter are
white, and run backwards they give Sigma^-1 (P. de Jong, Smoothing and interpolation with the state-space model, JASA 84, 1989).
Linear in the rows, and for many noises at once.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Indices = NDArray[np.intp]
EYE, DIAGONAL = np.eye(3), np.arange(3)


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
    first; filters (S, m_t, 6, 3): whitening of the innovations at each, and below it the filter's gain; seen (n, 3): what was
    measured; root (n,) of the row weights."""

    steps: tuple[Indices, ...]
    seen: Array
    root: Array
    rho: Array
    log_determinant: Array
    filters: list[Array] = field(repr=False)

    @classmethod
    def of(cls, own: Array, sensor: Array, rho: Array, measured: NDArray[np.bool_], row_weight: Array,
           steps: tuple[Indices, ...]) -> RememberingRows:
        """As `RowsAlone.of`, with a memory rho (S,)."""
        seen, whole, order = measured.astype(float), bool(measured.all()), np.concatenate(steps)
        if not whole:
            # A component that was not measured is one of variance 1 that nothing goes with.
            own = own * (seen[:, :, None] * seen[:, None, :]) + (1.0 - seen)[:, :, None] * EYE
        there = seen[order].T[:, None, :, None]
        size, kept_twice = EYE[:, :, None, None] * sensor**2, rho**2
        covariance, fresh, end = np.repeat(size, len(steps[0]), axis=2), (1.0 - kept_twice) * size, 0
        # Components first, each step is a few operations on whole rows of numbers: the innovations' covariance L D L^T and what
        # goes with it of the state, side by side (3, 6, n, S); L^-1 of them is D L^T and L^-1 of the state.
        sides = np.empty((3, 6, len(order), len(sensor)))
        sides[:, :3] = own[:, order].transpose(2, 3, 1, 0)
        for rows in steps:
            place = slice(end, end + len(rows))
            end, covariance, beside = place.stop, covariance[:, :, : len(rows)], sides[:, :, place]
            met = covariance if whole else there[:, :, place] * covariance
            beside[:, :3] += met if whole else met * there[:, 0, place]
            beside[:, 3:] = met
            for row in (0, 1):
                share = beside[row + 1:, row] / beside[row, row]
                beside[row + 1:, row + 1:] -= share[:, None] * beside[row, row + 1:]
            state = beside[:, 3:]
            scaled = state / beside[DIAGONAL, DIAGONAL][:, None]
            covariance = kept_twice * (covariance - np.einsum("kimS,kjmS->ijmS", state, scaled)) + fresh
        variance, (a, b, c) = sides[DIAGONAL, DIAGONAL], sides[[0, 0, 1], [1, 2, 2]] / sides[[0, 0, 1], [0, 0, 1]]
        filters = np.zeros((6, 3, *variance.shape[1:]))
        filters[DIAGONAL, DIAGONAL] = 1.0
        filters[1, 0], filters[2, 0], filters[2, 1] = -a, a * c - b, -c
        filters[:3] /= np.sqrt(variance)[:, None]
        np.einsum("kimS,kjmS->ijmS", rho * sides[:, 3:] / np.sqrt(variance)[:, None], filters[:3], out=filters[3:])
        filters = np.ascontiguousarray(filters.transpose(3, 2, 0, 1))
        log_determinant = np.log(variance).sum(axis=(0, 1)) - float(np.sum(measured * np.log(row_weight)[:, None]))
        return cls(steps, seen, np.sqrt(row_weight), rho, log_determinant,
                   np.split(filters, np.cumsum([len(rows) for rows in steps])[:-1], axis=1))

    @cached_property
    def _order(self) -> Indices:
        """The rows place by place, (n,)."""
        return np.concatenate(self.steps)

    @cached_property
    def _places(self) -> list[tuple[slice, Array | None]]:
        """Where each place stands in that order, and what was measured there (m_t, 3, 1); None: all."""
        ends, seen = np.cumsum([len(rows) for rows in self.steps]).tolist(), self.seen[self._order][:, :, None]
        whole = bool(self.seen.all())
        return [(slice(end - len(rows), end), None if whole else seen[end - len(rows): end])
                for rows, end in zip(self.steps, ends, strict=True)]

    @cached_property
    def _scale(self) -> Array:
        """By what columns (n, 3, q) are multiplied, place by place."""
        return np.asarray((self.root[:, None] * self.seen)[self._order][:, :, None])

    @cached_property
    def _first(self) -> list[tuple[Array, Array]]:
        """Filters (m_t, 6, 3) of the first noise, and what they do backwards (m_t, 3, 6)."""
        sign = np.repeat([1.0, -1.0], 3)
        return [(each[0], each[0].swapaxes(1, 2) * sign) for each in self.filters]

    def _white(self, columns: Array) -> Array:
        """The innovations (S, n, 3, q) of columns (n, 3, q), whitened."""
        columns, kept = columns[self._order] * self._scale, self.rho[:, None, None, None]
        white = np.empty((len(self.rho), *columns.shape))
        state = np.zeros((len(self.rho), len(self.steps[0]), *columns.shape[1:]))
        for rows, (place, seen), filters in zip(self.steps, self._places, self.filters, strict=True):
            state = state[:, : len(rows)]
            both = filters @ (columns[place] - (state if seen is None else seen * state))
            white[:, rows] = both[:, :, :3]
            state *= kept
            state += both[:, :, 3:]
        return white

    def grams(self, columns: Array, q: int, visit: Indices) -> tuple[Array, Array]:
        """As `RowsAlone.grams`."""
        white = self._white(columns).reshape(len(self.rho), 3 * len(columns), -1)
        left = white[:, :, :q]
        ends = 3 * np.append(0, np.cumsum(np.bincount(visit)))
        products = [white[:, start: end, q:].swapaxes(1, 2) @ white[:, start: end] for start, end in pairwise(ends)]
        return left.swapaxes(1, 2) @ left, np.stack(products, axis=1)

    def solve(self, columns: Array) -> Array:
        """Sigma^-1 columns (n, 3, q), of the first noise."""
        columns, rho = columns[self._order] * self._scale, self.rho[0]
        state, innovations = np.zeros((len(self.steps[0]), *columns.shape[1:])), []
        for (place, seen), (ahead, _) in zip(self._places, self._first, strict=True):
            state = state[: place.stop - place.start]
            both = ahead @ (columns[place] - (state if seen is None else seen * state))
            # What is met on the way back stands below what was met on the way there.
            innovations.append(both)
            state = rho * state + both[:, 3:]
        back = np.zeros((len(self.steps[0]), *columns.shape[1:]))
        for (place, seen), (_, behind), both in zip(
                reversed(self._places), reversed(self._first), reversed(innovations), strict=True):
            here = back[: place.stop - place.start]
            both[:, 3:] = here
            value = behind @ both
            columns[place] = value
            here *= rho
            here += value if seen is None else seen * value
        solved = np.empty_like(columns)
        solved[self._order] = columns * self._scale
        return solved


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
    (first, second, third), (low, corner, lowest) = _factors(matrix)
    last, beside = 1 / third, lowest / third
    middle = 1 / second + lowest * beside
    edge, top = corner * last, low / second + corner * beside
    whole = 1 / first + low * low / second + corner * edge
    inverse = np.stack([whole, top, edge, top, middle, beside, edge, beside, last], axis=-1)
    return np.asarray(inverse.reshape(matrix.shape)), first * second * third


def _factors(matrix: Array) -> tuple[tuple[Array, Array, Array], tuple[Array, Array, Array]]:
    """D (3) of symmetric matrices L D L^T, and of the inverse of L what stands below its diagonal of ones: at 10, 20, 21."""
    first, low, lower = matrix[..., 0, 0], matrix[..., 0, 1], matrix[..., 0, 2]
    a, b = low / first, lower / first                       # L: 1; a 1; b c 1
    second = matrix[..., 1, 1] - a * low
    left = matrix[..., 1, 2] - a * lower
    c = left / second
    return (first, second, matrix[..., 2, 2] - b * lower - c * left), (-a, a * c - b, -c)

"""D^T Sigma^-1 D for many variance components at once: what the likelihood of a linear model needs of the rows (noise.py)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from identification.fit.noise import NoiseModel

Array = NDArray[np.float64]

# Numbers held at once; more components go in turns.
CHUNK = 2_000_000


class NoiseGram:
    """The rows' columns D = (design, residual) (n, 3, q), q = p + 1, with row weights (n,), ready for any variance
    components."""

    def __init__(self, model: NoiseModel, row_weight: Array, design: Array, residual: Array) -> None:
        columns = np.concatenate([design, residual[:, :, None]], axis=2)
        self._count = columns.shape[2]
        # Rows in the order of their visits, so that sums over visits are sums over runs.
        order = np.argsort(model.visit, kind="stable")
        self._starts = np.searchsorted(model.visit[order], np.arange(model.visits))
        columns, rotation = columns[order], model.rotation[order]
        self._force, self._measured = model.force[order].ravel(), model.measured[order].ravel()
        self._row_weight = np.repeat(row_weight[order], 3)
        self._offset = model.offset
        flat = columns.reshape(-1, self._count)
        self._pairs = (flat[:, :, None] * flat[:, None, :]).reshape(len(flat), -1)
        self._by_visit = np.concatenate([
            (rotation[:, :, :, None] * rotation[:, :, None, :]).reshape(len(rotation), 3, 9),
            (rotation[:, :, :, None] * columns[:, :, None, :]).reshape(len(rotation), 3, -1)], axis=2)

    def __call__(self, logs: Array) -> tuple[Array, Array]:
        """Gram (S, q, q) and ln determinant of Sigma (S,) for the logarithms (S, 3) of the components."""
        at_once = max(1, CHUNK // (self._by_visit.shape[2] * len(self._by_visit)))
        parts = [self._some(np.exp(logs[start: start + at_once])) for start in range(0, len(logs), at_once)]
        return np.concatenate([gram for gram, _ in parts]), np.concatenate([determinant for _, determinant in parts])

    def _some(self, components: Array) -> tuple[Array, Array]:
        count, q = len(components), self._count
        variance = components[:, :1] ** 2 + components[:, 1:2] ** 2 * self._force
        precision = np.where(self._measured, self._row_weight / variance, 0.0)
        gram = (precision @ self._pairs).reshape(count, q, q)
        log_determinant = -np.log(precision[:, self._measured]).sum(axis=1)
        if not self._offset.any():
            return gram, log_determinant
        rows = np.swapaxes(precision.reshape(count, -1, 3), 0, 1) @ self._by_visit                    # (n, S, 9 + 3 q)
        summed = np.add.reduceat(rows, self._starts, axis=0)
        total, gathered = summed[:, :, :9].reshape(-1, count, 3, 3), summed[:, :, 9:].reshape(-1, count, 3, q)
        root = components[:, 2:] * self._offset                                                             # (S, 3)
        # Woodbury, so written that an axis without offset stays finite, as in NoiseModel.weights.
        inner = np.eye(3) + root[:, :, None] * total * root[:, None, :]
        inverse, determinant = _inverse(inner)
        scaled = root[:, :, None] * gathered
        gram -= (np.swapaxes(scaled, 2, 3) @ (inverse @ scaled)).sum(axis=0)
        return gram, log_determinant + np.log(determinant).sum(axis=0)


def _inverse(matrix: Array) -> tuple[Array, Array]:
    """Inverse (..., 3, 3) and determinant (...) of symmetric positive definite matrices, by cofactors: many are small work."""
    a, b, c = matrix[..., 0, 0], matrix[..., 0, 1], matrix[..., 0, 2]
    d, e, f = matrix[..., 1, 1], matrix[..., 1, 2], matrix[..., 2, 2]
    first, second, third = d * f - e * e, c * e - b * f, b * e - c * d
    determinant = a * first + b * second + c * third
    middle, crossed, last = a * f - c * c, b * c - a * e, a * d - b * b
    cofactors = np.stack([first, second, third, second, middle, crossed, third, crossed, last], axis=-1)
    return np.asarray((cofactors / determinant[..., None]).reshape(matrix.shape)), determinant

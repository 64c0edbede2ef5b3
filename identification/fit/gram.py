"""D^T Sigma^-1 D for many variance components at once: what the likelihood of a linear model needs of the rows (noise.py)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from identification.fit.noise import NoiseModel, inverse_of_three

Array = NDArray[np.float64]

# Numbers held at once; more components go in turns.
CHUNK = 2_000_000


class NoiseGram:
    """The rows' columns D = (design, residual) (n, 3, q), q = p + 1, with row weights (n,), ready for any variance
    components."""

    def __init__(self, model: NoiseModel, row_weight: Array, design: Array, residual: Array) -> None:
        self._model, self._row_weight = model, row_weight
        self._count = design.shape[2] + 1
        columns = np.concatenate([design, residual[:, :, None], model.loading], axis=2)
        self._columns = model.in_blocks(columns)                                                      # (b, 3 B, q + r)

    def __call__(self, logs: Array) -> tuple[Array, Array]:
        """Gram (S, q, q) and ln determinant of Sigma (S,) for the logarithms (S, 6) of the components."""
        at_once = max(1, CHUNK // (self._columns.size + self._columns.shape[0] * self._columns.shape[1] ** 2))
        parts = [self._some(np.exp(logs[start: start + at_once])) for start in range(0, len(logs), at_once)]
        return np.concatenate([gram for gram, _ in parts]), np.concatenate([determinant for _, determinant in parts])

    def _some(self, values: Array) -> tuple[Array, Array]:
        model, columns, q = self._model, self._columns, self._count
        precision, log_determinant = model.own(values, self._row_weight)                                # (S, b, 3 B, 3 B)
        # Many small matrices are quicker at once than one by one.
        small = columns.shape[1] == 3
        weighted = np.einsum("sbij,bjk->sbik", precision, columns) if small else precision @ columns
        flat = weighted.reshape(len(values), -1, columns.shape[2])
        gram = columns.reshape(-1, columns.shape[2])[:, :q].T @ flat[:, :, :q]
        if columns.shape[2] == q or not model.loading.any():
            return gram, log_determinant
        summed = np.add.reduceat(np.swapaxes(columns[:, :, q:], 1, 2) @ weighted, model.block_starts, axis=1)
        scale = model.loading_scale(values)[:, None, :, None]                                                  # (S, 1, r, 1)
        # Woodbury, so written that a part of no size stays finite, as in NoiseModel.weights.
        inner = np.eye(columns.shape[2] - q) + scale * summed[..., q:] * np.swapaxes(scale, 2, 3)
        inverse, log_inner = _inverse(inner)
        scaled = scale * summed[..., :q]
        gram = gram - (np.swapaxes(scaled, 2, 3) @ (inverse @ scaled)).sum(axis=1)
        return gram, log_determinant + log_inner.sum(axis=1)


def _inverse(matrix: Array) -> tuple[Array, Array]:
    """Inverse and ln determinant of symmetric positive definite matrices."""
    if matrix.shape[-1] == 3:
        inverse, determinant = inverse_of_three(matrix)
        return inverse, np.log(determinant)
    return np.asarray(np.linalg.inv(matrix), dtype=float), np.asarray(np.linalg.slogdet(matrix)[1], dtype=float)

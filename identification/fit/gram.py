"""D^T Sigma^-1 D for many variance components at once: what the likelihood of a linear model needs of the rows (noise.py)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from identification.fit.noise import NoiseModel
from identification.fit.noise_parts import OF_ROWS
from identification.fit.own_noise import inverse_of_three

Array = NDArray[np.float64]

# Numbers held at once; more components go in turns.
CHUNK = 2_000_000


class NoiseGram:
    """The rows' columns D = (design, residual) (n, 3, q), q = p + 1, with row weights (n,), ready for any variance
    components."""

    def __init__(self, model: NoiseModel, row_weight: Array, design: Array, residual: Array) -> None:
        order = np.argsort(model.visit, kind="stable")
        self._model, self._row_weight = model.of_rows(order), row_weight[order]
        self._count = design.shape[2] + 1
        self._columns = np.concatenate([design, residual[:, :, None], model.loading], axis=2)[order]      # (n, 3, q + r)

    def __call__(self, logs: Array) -> tuple[Array, Array]:
        """Gram (S, q, q) and ln determinant of Sigma (S,) for the logarithms (S, 6) of the components."""
        at_once = max(1, CHUNK // (2 * self._columns.size))
        parts = [self._some(np.exp(logs[start: start + at_once])) for start in range(0, len(logs), at_once)]
        return np.concatenate([gram for gram, _ in parts]), np.concatenate([determinant for _, determinant in parts])

    def _some(self, values: Array) -> tuple[Array, Array]:
        model, columns, q = self._model, self._columns, self._count
        shares = columns.shape[2] > q and bool(model.loading.any())
        columns = columns if shares else columns[:, :, :q]
        # What visits share (their offsets, their set-ups) is no part of the rows' own noise, which is the same for many.
        number: dict[bytes, int] = {}
        which = np.array([number.setdefault(of_rows.tobytes(), len(number)) for of_rows in values[:, OF_ROWS]])
        own = model.own(values[np.unique(which, return_index=True)[1]], self._row_weight)
        gram, summed = (part[which] for part in own.grams(columns, q, model.visit))
        log_determinant = own.log_determinant[which]
        if not shares:
            return gram, log_determinant
        scale = model.loading_scale(values)[:, None, :, None]                                                  # (S, 1, r, 1)
        # Woodbury, so written that a part of no size stays finite, as in NoiseModel.weights.
        inner = np.eye(columns.shape[2] - q) + scale * summed[..., q:] * np.swapaxes(scale, 2, 3)
        inverse, log_inner = _inverse(inner)
        scaled = scale * summed[..., :q]
        # All visits in one product: one by one they would hold (q, q) numbers each.
        stacked = scaled.reshape(len(gram), scaled.shape[1] * scaled.shape[2], q)
        gram = gram - stacked.swapaxes(1, 2) @ (inverse @ scaled).reshape(stacked.shape)
        return gram, log_determinant + log_inner.sum(axis=1)


def _inverse(matrix: Array) -> tuple[Array, Array]:
    """Inverse and ln determinant of symmetric positive definite matrices."""
    if matrix.shape[-1] == 3:
        inverse, determinant = inverse_of_three(matrix)
        return inverse, np.log(determinant)
    return np.asarray(np.linalg.inv(matrix), dtype=float), np.asarray(np.linalg.slogdet(matrix)[1], dtype=float)

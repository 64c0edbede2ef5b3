"""Rotations and frames. Quaternions are w x y z, as in RAPID; a frame is named by its direction (`base_from_tcp`)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


def quaternion_to_matrix(quaternion: ArrayLike) -> Array:
    """Rotation matrices (..., 3, 3) of quaternions (..., 4) w x y z; they are normalised first."""
    q = np.asarray(quaternion, dtype=float)
    w, x, y, z = np.moveaxis(q / np.linalg.norm(q, axis=-1, keepdims=True), -1, 0)
    matrix = np.empty((*q.shape[:-1], 3, 3))
    matrix[..., 0, 0] = 1 - 2 * (y * y + z * z)
    matrix[..., 0, 1] = 2 * (x * y - w * z)
    matrix[..., 0, 2] = 2 * (x * z + w * y)
    matrix[..., 1, 0] = 2 * (x * y + w * z)
    matrix[..., 1, 1] = 1 - 2 * (x * x + z * z)
    matrix[..., 1, 2] = 2 * (y * z - w * x)
    matrix[..., 2, 0] = 2 * (x * z - w * y)
    matrix[..., 2, 1] = 2 * (y * z + w * x)
    matrix[..., 2, 2] = 1 - 2 * (x * x + y * y)
    return matrix


def matrix_to_quaternion(matrix: ArrayLike) -> Array:
    """Unit quaternions (..., 4) w x y z, w >= 0, of rotation matrices (..., 3, 3).

    Each takes the largest of its four components as the pivot (Shepperd), so none is found by cancellation.
    """
    m = np.asarray(matrix, dtype=float)
    flat = m.reshape(-1, 3, 3)
    xx, yy, zz = flat[:, 0, 0], flat[:, 1, 1], flat[:, 2, 2]
    # K / 4 of the quaternion: the outer product q q^T, of which the row with the largest diagonal is q up to scale.
    diagonal = np.stack([1 + xx + yy + zz, 1 + xx - yy - zz, 1 - xx + yy - zz, 1 - xx - yy + zz])
    pivot = np.argmax(diagonal, axis=0)
    q = np.empty((len(flat), 4))
    for row in np.unique(pivot).tolist():
        which = np.flatnonzero(pivot == row) if row or pivot.any() else slice(None)     # small rotations: all have row 0
        of_row = flat[which]
        for column in range(4):
            q[which, column] = diagonal[row, which] if column == row else _of_outer(of_row, *sorted((row, column)))
    q /= np.linalg.norm(q, axis=-1, keepdims=True)
    return np.asarray(np.where(q[:, :1] < 0, -q, q)).reshape(*m.shape[:-2], 4)


def _of_outer(m: Array, row: int, column: int) -> Array:
    """4 q_row q_column (n,) of rotation matrices (n, 3, 3), row < column."""
    if row == 0:
        first, second = (column + 1) % 3, column % 3
        return np.asarray(m[:, first, second] - m[:, second, first])
    return np.asarray(m[:, row - 1, column - 1] + m[:, column - 1, row - 1])


def rotation_vector(matrix: ArrayLike) -> Array:
    """Rotation vectors (..., 3) [rad] of rotation matrices (..., 3, 3), exact near zero too."""
    q = matrix_to_quaternion(matrix)
    sine = np.linalg.norm(q[..., 1:], axis=-1, keepdims=True)
    angle = 2 * np.arctan2(sine, q[..., :1])
    # angle / sin(angle / 2) tends to 2; below 1e-8 the quotient is 2 to the last digit.
    scale = np.divide(angle, sine, out=np.full_like(sine, 2.0), where=sine > 1e-8)
    return np.asarray(q[..., 1:] * scale)


def rotation_matrix(vector: ArrayLike) -> Array:
    """Rotation matrices (..., 3, 3) of rotation vectors (..., 3) [rad]."""
    v = np.asarray(vector, dtype=float)
    angle = np.linalg.norm(v, axis=-1, keepdims=True)
    half_sinc = 0.5 * np.sinc(angle / (2 * np.pi))
    return quaternion_to_matrix(np.concatenate([np.cos(angle / 2), half_sinc * v], axis=-1))


@dataclass(frozen=True, eq=False)
class Frame:
    """One rigid transform, or N of them: rotation (..., 3, 3) and position (..., 3) [m].

    `a_from_b` maps coordinates in b to coordinates in a; `a_from_b @ b_from_c` is `a_from_c`.
    """

    rotation: Array
    position: Array

    @classmethod
    def identity(cls) -> Frame:
        """The frame that changes nothing."""
        return cls(np.eye(3), np.zeros(3))

    @classmethod
    def from_quaternion(cls, position: ArrayLike, quaternion: ArrayLike) -> Frame:
        """From position (..., 3) [m] and quaternion (..., 4) w x y z."""
        return cls(quaternion_to_matrix(quaternion), np.asarray(position, dtype=float))

    @classmethod
    def shared(cls, frame: Frame, count: int) -> Frame:
        """One transform as `count` of them: held once, read-only, also where some of them are picked, inverted or passed."""
        return cls(np.broadcast_to(frame.rotation, (count, 3, 3)), np.broadcast_to(frame.position, (count, 3)))

    @property
    def is_shared(self) -> bool:
        """Whether N transforms are one that is held once."""
        return self.rotation.ndim == 3 and self.rotation.strides[0] == self.position.strides[0] == 0 < len(self.position)

    @property
    def quaternion(self) -> Array:
        """Unit quaternion (..., 4) w x y z, w >= 0."""
        return matrix_to_quaternion(self.rotation)

    def __getitem__(self, rows: int | slice | NDArray[np.intp] | NDArray[np.bool_]) -> Frame:
        """Those of N transforms at these rows."""
        if isinstance(rows, np.ndarray) and self.is_shared:
            return Frame.shared(self[0], int(np.count_nonzero(rows)) if rows.dtype == bool else len(rows))
        return Frame(self.rotation[rows], self.position[rows])

    def __matmul__(self, other: Frame) -> Frame:
        return Frame(self.rotation @ other.rotation, self.apply(other.position))

    def apply(self, point: ArrayLike) -> Array:
        """Points (..., 3) [m] of the inner frame, in the outer frame."""
        return self.turn(point) + self.position

    def turn(self, vector: ArrayLike) -> Array:
        """Vectors (..., 3) (forces, deviations) of the inner frame, in the outer frame."""
        return np.asarray(np.einsum("...ij,...j->...i", self.rotation, np.asarray(vector, dtype=float)))

    def inverse(self) -> Frame:
        """`b_from_a` of `a_from_b`."""
        if self.is_shared:
            return Frame.shared(self[0].inverse(), len(self.position))
        transposed = np.swapaxes(self.rotation, -1, -2)
        return Frame(transposed, -np.einsum("...ij,...j->...i", transposed, self.position))

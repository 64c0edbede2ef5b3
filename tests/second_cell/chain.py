"""Finite motions of a chain as products of exponentials of screws, written down at the arm's home pose.

A screw is `(omega, v)`: a hinge about the unit vector omega through the point c has `v = c x omega`, a slide along the unit
vector v has `omega = 0`. The motion of element k carries everything behind it, `T_k = exp(xi_1 s_1) ... exp(xi_k s_k)`; the
twist in which element k moves a placed chain is `Ad(T_{k-1}) xi_k`. A point p behind it then moves by `omega x p + v` for a
unit of s_k, and the second derivative by s_k and a later s_l is `omega_k x dp/ds_l`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


def hinge(axis: np.ndarray, through: np.ndarray) -> np.ndarray:
    """Screw (6,) of a rotation about a unit vector (3,) through a point (3,) [m]."""
    return np.concatenate([axis, np.cross(through, axis)])


def slide(along: np.ndarray) -> np.ndarray:
    """Screw (6,) of a translation along a unit vector (3,)."""
    return np.concatenate([np.zeros(3), along])


def rotation(axis: np.ndarray, angle: np.ndarray) -> np.ndarray:
    """Rodrigues: matrices (n, 3, 3) of turns by angle (n,) [rad] about one unit vector (3,)."""
    x, y, z = axis
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.asarray(np.eye(3) + np.sin(angle)[:, None, None] * cross + (1 - np.cos(angle))[:, None, None] * (cross @ cross))


@dataclass(frozen=True)
class Placed:
    """A chain of m elements in n poses: base-frame motion of what stands behind each, rotation (m, n, 3, 3) and translation
    (m, n, 3) [m], and each element's twist, omega (n, m, 3) and v (n, m, 3)."""

    rotation: np.ndarray
    translation: np.ndarray
    omega: np.ndarray
    v: np.ndarray

    def point(self, behind: int, home: np.ndarray) -> np.ndarray:
        """Where a point that is at `home` (3,) or (n, 3) [m] in the home pose, behind element `behind`, is now (n, 3)."""
        return np.einsum("nij,nj->ni", self.rotation[behind], np.broadcast_to(home, self.translation[behind].shape)
                         ) + self.translation[behind]

    def motion(self, behind: int, point: np.ndarray) -> np.ndarray:
        """Velocity (n, m, 3) of a point (n, 3) behind element `behind` for a unit of each s; zero for later elements."""
        moved = np.cross(self.omega, point[:, None]) + self.v
        moved[:, behind + 1:] = 0.0
        return np.asarray(moved)

    def bending(self, moved: np.ndarray, force: np.ndarray) -> np.ndarray:
        """Second derivative (n, m, m) by s of `force . p`, force (n, 3) and the point's motion (n, m, 3)."""
        upper = np.triu(np.einsum("nki,nli->nkl", np.cross(force[:, None], self.omega), moved))
        return np.asarray(upper + np.triu(upper, 1).swapaxes(1, 2))


def placed(screws: np.ndarray, s: np.ndarray) -> Placed:
    """The chain of screws (m, 6) at s (n, m) [rad or m]."""
    n, m = s.shape
    turn, shift = np.broadcast_to(np.eye(3), (n, 3, 3)), np.zeros((n, 3))
    rotations, shifts = np.empty((m, n, 3, 3)), np.empty((m, n, 3))
    omega, v = np.empty((n, m, 3)), np.empty((n, m, 3))
    for k, screw in enumerate(screws):
        axis, along = screw[:3], screw[3:]
        omega[:, k] = turn @ axis
        v[:, k] = turn @ along + np.cross(shift, omega[:, k])
        if axis.any():
            own = rotation(axis, s[:, k])
            pivot = np.cross(axis, along)
            shift = shift + np.einsum("nij,nj->ni", turn, pivot - own @ pivot)
            turn = turn @ own
        else:
            shift = shift + turn @ along * s[:, k, None]
        rotations[k], shifts[k] = turn, shift
    return Placed(rotations, shifts, omega, v)

"""Unit quaternions w x y z, one at a time: frames of tools and work objects, and RelTool."""

from __future__ import annotations

import math

Vector = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]

SLIGHT, UNUSABLE = 1e-5, 0.1
"""Sum of squares off 1: up to the first it is rounding, above the second the controller refuses it too."""


def misfit(q: Quaternion) -> float:
    """How far the sum of squares is off 1."""
    return abs(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3] - 1.0)


def unit(q: Quaternion) -> Quaternion:
    length = math.sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
    return q[0] / length, q[1] / length, q[2] / length, q[3] / length


def multiply(a: Quaternion, b: Quaternion) -> Quaternion:
    """The rotation b, then a."""
    return (
        a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
        a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
        a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1],
        a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0],
    )


def rotate(q: Quaternion, v: Vector) -> Vector:
    """v in the frame that q turns, seen from outside: v + 2 u x (u x v + w v) with q = (w, u)."""
    w, x, y, z = q
    a = y * v[2] - z * v[1] + w * v[0]
    b = z * v[0] - x * v[2] + w * v[1]
    c = x * v[1] - y * v[0] + w * v[2]
    return v[0] + 2 * (y * c - z * b), v[1] + 2 * (z * a - x * c), v[2] + 2 * (x * b - y * a)


def about(axis: int, degrees: float) -> Quaternion:
    """The rotation about axis 0, 1 or 2."""
    half = math.radians(degrees) / 2
    q = [math.cos(half), 0.0, 0.0, 0.0]
    q[axis + 1] = math.sin(half)
    return q[0], q[1], q[2], q[3]

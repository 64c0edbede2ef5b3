"""Batched forward kinematics and geometric Jacobians of a six-axis robot.

Frames follow the paper's eq. 1, `T_i = RotX(alpha_i) TransX(a_i) RotZ(theta~_i) TransZ(d_i)`; joint angles come in as
(N, 6), and inside the arithmetic runs on components, one contiguous array of n poses each, in chunks that stay in cache.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from identification.model.robot import RobotModel
from identification.model.rotations import Frame

Array = NDArray[np.float64]
CHUNK = 4096


def chunks(count: int, size: int = CHUNK) -> Iterator[slice]:
    """Slices that cover range(count) in pieces of at most `size`."""
    for start in range(0, count, size):
        yield slice(start, min(start + size, count))


def sine_cosine(angle: Array) -> tuple[Array, Array]:
    """Sine and cosine of angles [rad] by `t = tan(angle / 2)`, exact to 2e-16.

    NumPy runs `tan` in vector registers, but `sin` and `cos` of float64 one number at a time.
    """
    t = np.tan(0.5 * angle)
    square = t * t
    inverse = 1.0 / (1.0 + square)
    return 2.0 * t * inverse, (1.0 - square) * inverse


@cache
def quarter_turns(alpha: float) -> tuple[float, float]:
    """Sine and cosine of a link twist [rad], exactly 0 and +-1 at multiples of 90 degrees."""
    sine, cosine = np.sin(alpha), np.cos(alpha)
    return float(np.round(sine) if abs(sine - np.round(sine)) < 1e-12 else sine), float(
        np.round(cosine) if abs(cosine - np.round(cosine)) < 1e-12 else cosine)


@dataclass(frozen=True, eq=False)
class Chain:
    """The frames of n poses in the base frame, components first.

    axes (6, 3, n): the joint axes z_i. origins (6, 3, n) [m]: the frame origins, after `d_i`.
    rotation (3, 3, n): base_from_flange, [component, column].
    """

    axes: Array
    origins: Array
    rotation: Array


def turned_back(angles: Array, turns: NDArray[np.complex128] | None = None) -> NDArray[np.complex128]:
    """`exp(-i angle)` of angles (...) [rad], into `turns` where it is given: times x + i y it turns a vector by -angle about z.

    One product of complex numbers takes a fifth of the time of the four products and two sums that it is.
    """
    turns = np.empty(angles.shape, dtype=np.complex128) if turns is None else turns
    t = np.multiply(angles, 0.5)
    np.tan(t, out=t)
    inverse = np.multiply(t, t)
    inverse += 1.0
    np.divide(-2.0, inverse, out=inverse)
    np.multiply(t, inverse, out=turns.imag)         # sine = 2 t / (1 + t^2)
    np.subtract(-1.0, inverse, out=turns.real)      # cosine = 2 / (1 + t^2) - 1
    return turns


def chain(robot: RobotModel, serial: Array, planes: NDArray[np.complex128] | None = None) -> Chain:
    """Frames at serial angles `serial` (6, n) [rad] (paper eq. 1); into planes (6, 3, n), where given, x + i y of each."""
    axes, origins = np.empty((2, 6, 3, serial.shape[1]))
    for i, (plane, z, origin) in enumerate(_frames(robot, serial)):
        axes[i], origins[i] = z, origin
        if planes is not None:
            planes[i] = plane
    return Chain(axes, origins, np.stack([plane.real, plane.imag, z], axis=1))


def _frames(robot: RobotModel, serial: Array) -> Iterator[tuple[NDArray[np.complex128], Array, Array]]:
    """The frames one after the other, components first (3, n): x + i y, z, and the origin [m]; each until the next one."""
    n = serial.shape[1]
    turns = turned_back(serial)
    plane = np.repeat(np.array([[1.0], [1j], [0.0]]), n, axis=1)       # the x axis, and i times the y axis, by components
    z, spare = np.repeat(np.array([[0.0], [0.0], [1.0]]), n, axis=1), np.empty((3, n))
    origin = np.zeros((3, n))
    for i in range(6):
        if robot.a[i]:
            origin += np.multiply(robot.a[i], plane.real, out=spare)
        sine, cosine = quarter_turns(robot.alpha[i])
        if sine == 0.0:
            if cosine < 0:
                np.negative(plane.imag, out=plane.imag)
                np.negative(z, out=z)
        elif cosine == 0.0:                         # y becomes z, z becomes -y, or the other way round
            np.multiply(plane.imag, -sine, out=spare)
            np.multiply(z, sine, out=plane.imag)
            z, spare = spare, z
        else:
            y = plane.imag.copy()
            plane.imag[:], z = cosine * y + sine * z, cosine * z - sine * y
        np.multiply(plane, turns[i], out=plane)
        if robot.d[i]:
            origin += np.multiply(robot.d[i], z, out=spare)
        yield plane, z, origin


def spring_columns(robot: RobotModel, theta: Array, flange_from_tcp: Frame, matrix: Array | None = None) -> Array:
    """The Jacobian of the TCP in the base frame, components first (6, 6, n): [axis, row, pose], rows m/rad and rad/rad; about
    the axes the robot's springs sit at, or those that `matrix` (6, 6) combines from the serial ones. theta (n, 6) controller
    angles [rad], not more than a few thousand."""
    frames = chain(robot, np.ascontiguousarray(robot.serial_angles(theta).T))
    tcp = frames.origins[5] + np.einsum("ijn,j->in", frames.rotation, flange_from_tcp.position)
    columns, product = np.empty((6, 6, tcp.shape[1])), np.empty((6, tcp.shape[1]))
    arm, axes = tcp - frames.origins, frames.axes
    for row in range(3):
        first, second = (row + 1) % 3, (row + 2) % 3
        np.multiply(axes[:, first], arm[:, second], out=columns[:, row])
        columns[:, row] -= np.multiply(axes[:, second], arm[:, first], out=product)
    columns[:, 3:] = axes
    return _combined(columns, robot.load_matrix if matrix is None else matrix)


def _combined(columns: Array, matrix: Array) -> Array:
    """Columns (6, ...) of serial axes as those (6, ...) of other axes, matrix (6, 6) [serial, other]; each is mostly itself."""
    if np.array_equal(matrix, np.eye(6)):
        return columns
    combined = np.empty_like(columns)
    for j in range(6):
        first, *more = np.flatnonzero(matrix[:, j]).tolist() or [0]
        np.multiply(columns[first], matrix[first, j], out=combined[j])
        for i in more:
            combined[j] += columns[i] * matrix[i, j]
    return combined


def forward(robot: RobotModel, theta: Array, flange_from_tcp: Frame) -> Frame:
    """base_from_tcp (N) at controller angles `theta` (N, 6) [rad] (paper eq. 1 and 7)."""
    count = len(theta)
    rotation, position = np.empty((count, 3, 3)), np.empty((count, 3))
    for part in chunks(count):
        *_, (plane, z, origin) = _frames(robot, np.ascontiguousarray(robot.serial_angles(theta[part]).T))
        flange = np.stack([plane.real, plane.imag, z])                                      # [column, component, pose]
        rotation[part] = np.tensordot(flange_from_tcp.rotation, flange, axes=(0, 0)).transpose(2, 1, 0)
        position[part] = (origin + np.tensordot(flange_from_tcp.position, flange, axes=(0, 0))).T
    return Frame(rotation, position)


def jacobian(
    robot: RobotModel, theta: Array, flange_from_tcp: Frame, axes: Literal["springs", "drive", "serial"] = "springs"
) -> Array:
    """Geometric Jacobian of the TCP in the base frame (N, 6, 6): rows m/rad and rad/rad, one column an axis.

    theta (N, 6) controller angles [rad]. axes: "serial" for J~; "drive" for J = J~ C; "springs" for J~ L, the axes the
    robot's springs sit at (docs/architecture.md, Springs).
    """
    matrix = {"springs": robot.load_matrix, "drive": robot.coupling, "serial": np.eye(6)}[axes]
    result = np.empty((len(theta), 6, 6))
    for part in chunks(len(theta)):
        result[part] = np.moveaxis(spring_columns(robot, theta[part], flange_from_tcp, matrix), 2, 0).swapaxes(1, 2)
    return result

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
CHUNK = 2048


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


def chain(robot: RobotModel, serial: Array) -> Chain:
    """Frames at serial angles `serial` (6, n) [rad] (paper eq. 1)."""
    n = serial.shape[1]
    sines, cosines = sine_cosine(serial)
    axes, origins = np.empty((6, 3, n)), np.empty((6, 3, n))
    x, y, z = (np.repeat(column[:, None], n, axis=1) for column in np.eye(3))
    origin = np.zeros((3, n))
    for i in range(6):
        if robot.a[i]:
            origin = origin + robot.a[i] * x
        sine, cosine = quarter_turns(robot.alpha[i])
        y, z = cosine * y + sine * z, cosine * z - sine * y
        x, y = cosines[i] * x + sines[i] * y, cosines[i] * y - sines[i] * x
        if robot.d[i]:
            origin = origin + robot.d[i] * z
        axes[i], origins[i] = z, origin
    return Chain(axes, origins, np.stack([x, y, z], axis=1))


def forward(robot: RobotModel, theta: Array, flange_from_tcp: Frame) -> Frame:
    """base_from_tcp (N) at controller angles `theta` (N, 6) [rad] (paper eq. 1 and 7)."""
    count = len(theta)
    rotation, position = np.empty((count, 3, 3)), np.empty((count, 3))
    for part in chunks(count):
        frames = chain(robot, np.ascontiguousarray(robot.serial_angles(theta[part]).T))
        flange = Frame(np.moveaxis(frames.rotation, -1, 0), frames.origins[5].T)
        tcp = flange @ flange_from_tcp
        rotation[part], position[part] = tcp.rotation, tcp.position
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
        frames = chain(robot, np.ascontiguousarray(robot.serial_angles(theta[part]).T))
        tcp = frames.origins[5] + np.einsum("ijn,j->in", frames.rotation, flange_from_tcp.position)
        columns = np.empty((6, 6, tcp.shape[1]))            # [axis, row, pose]
        columns[:, :3] = np.cross(frames.axes, tcp - frames.origins, axis=1)
        columns[:, 3:] = frames.axes
        result[part] = np.einsum("irn,ij->nrj", columns, matrix)
    return result

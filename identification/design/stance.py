"""The arm at a pose as the design needs it, with its derivatives by the controller's angles.

With the serial axes z_i, their frames' origins o_i and the TCP p, column i of the serial Jacobian is J_i = z_i x (p - o_i), and
turning axis j by a small angle changes it by `z_min(i,j) x J_max(i,j)`: an axis nearer the base turns the column as it is, one
nearer the tool moves the TCP on.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from identification.model.kinematics import chain, chunks
from identification.model.robot import RobotModel
from identification.model.rotations import Frame

Array = NDArray[np.float64]
NEARER_BASE = np.minimum.outer(np.arange(6), np.arange(6))
NEARER_TOOL = np.maximum.outer(np.arange(6), np.arange(6))


@dataclass(frozen=True, eq=False)
class Stance:
    """The arm at n poses, base frame: columns (n, 3, 6) [m/rad], position rows of the springs' Jacobian; serial (n, 6, 3)
    [m/rad], those of the serial axes, axis first; axes (n, 6, 3); tcp (n, 3) [m]; lever (n, 3) [m] from the origin of joint
    6's frame (the flange) to the TCP; wrist (n, 3) [m], the wrist's centre; before_wrist (n, 6, 3) [m], from each frame."""

    columns: Array
    serial: Array
    axes: Array
    tcp: Array
    lever: Array
    wrist: Array
    before_wrist: Array

    def take(self, rows: NDArray[np.intp] | NDArray[np.bool_]) -> Stance:
        """Some of the poses."""
        return Stance(self.columns[rows], self.serial[rows], self.axes[rows], self.tcp[rows], self.lever[rows],
                      self.wrist[rows], self.before_wrist[rows])


def cross(left: Array, right: Array) -> Array:
    """Cross products (..., 3); for a few hundred vectors three times as fast as NumPy's."""
    x, y, z = left[..., 0], left[..., 1], left[..., 2]
    u, v, w = right[..., 0], right[..., 1], right[..., 2]
    result = np.empty(np.broadcast_shapes(left.shape, right.shape))
    result[..., 0], result[..., 1], result[..., 2] = y * w - z * v, z * u - x * w, x * v - y * u
    return result


def stance(robot: RobotModel, flange_from_tcp: Frame, theta: Array) -> Stance:
    """The arm at controller angles (n, 6) [rad]."""
    count = len(theta)
    result = Stance(np.empty((count, 3, 6)), np.empty((count, 6, 3)), np.empty((count, 6, 3)), np.empty((count, 3)),
                   np.empty((count, 3)), np.empty((count, 3)), np.empty((count, 6, 3)))
    for part in chunks(count):
        frames = chain(robot, np.ascontiguousarray(robot.serial_angles(theta[part]).T))
        axes, origins = np.moveaxis(frames.axes, 2, 0), np.moveaxis(frames.origins, 2, 0)
        lever = np.moveaxis(frames.rotation, 2, 0) @ flange_from_tcp.position
        tcp = origins[:, 5] + lever
        serial = cross(axes, tcp[:, None] - origins)
        result.serial[part], result.axes[part], result.tcp[part], result.lever[part] = serial, axes, tcp, lever
        result.columns[part] = np.swapaxes(serial, 1, 2) @ robot.load_matrix
        result.wrist[part] = origins[:, 3]
        result.before_wrist[part] = origins[:, 3:4] - origins
    return result


def by_angles(robot: RobotModel, by_serial: Array) -> Array:
    """Derivatives (n, 6, ...) by the controller's angles from those by the serial ones (n, 6, ...)."""
    turned = robot.coupling.T @ by_serial.reshape(len(by_serial), 6, -1)
    return np.asarray(turned.reshape(by_serial.shape))


def columns_slope(robot: RobotModel, arm: Stance) -> Array:
    """Derivative (n, 6, 3, 6) of the springs' columns by the controller's angles, second index the angle."""
    moved = cross(arm.axes[:, NEARER_BASE], arm.serial[:, NEARER_TOOL])
    # [pose, component, spring, angle]: two products of matrices, since einsum takes longer to find them than to do them.
    return np.asarray((robot.load_matrix.T @ moved.transpose(0, 3, 1, 2) @ robot.coupling).transpose(0, 3, 1, 2))


def lever_slope(arm: Stance) -> Array:
    """Derivative (n, 6, 3) of the lever by the serial angles."""
    return np.asarray(cross(arm.axes, arm.lever[:, None]))


def wrist_slope(arm: Stance) -> Array:
    """Derivative (n, 6, 3) of the wrist's centre by the serial angles; it lies on axes 4 to 6."""
    slope = cross(arm.axes, arm.before_wrist)
    slope[:, 3:] = 0.0
    return np.asarray(slope)


def elbow_angle(robot: RobotModel, serial: Array) -> Array:
    """Angle (n,) [rad] between the upper arm and the forearm, 0 or pi where the arm is stretched or folded; it is serial angle
    3 and a constant. serial (n, 6) [rad]."""
    return np.asarray(serial[:, 2] + np.arctan2(-np.sin(robot.alpha[3]) * robot.d[3], robot.a[3]))

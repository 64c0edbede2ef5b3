"""Gravity torques at the springs: what preloads gears, so that backlash and soft zones show only beyond it.

The torque that gravity exerts about serial axis i is `sum over bodies l >= i of m_l g . (z_i x (p_l - o_i))`, g the
acceleration of free fall in the base frame; at the springs it is multiplied by L^T like any other torque (compliance.py).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from identification.model.compliance import loaded_angles
from identification.model.kinematics import chain
from identification.model.robot import RobotModel
from identification.model.rotations import Frame

Array = NDArray[np.float64]
# Standard acceleration of free fall [m/s^2] (3rd CGPM, 1901).
FREE_FALL = 9.80665
DOWN = np.array([0.0, 0.0, -FREE_FALL])
# Each round shrinks the error by the ratio of geometric to joint stiffness, under 0.01.
SAG_ROUNDS = 3


def gravity_torque(
    robot: RobotModel, theta: Array, fall: Array = DOWN, tool_mass: float | None = None, tool_centre: Array | None = None,
) -> Array:
    """Gravity torques (N, 6) [N m] at the springs; zero for a robot file without `links`.

    theta (N, 6) controller angles [rad]; fall (3,) acceleration of free fall in the base frame [m/s^2]; tool_mass [kg] with
    its centre (3,) [m] in the flange frame (at the flange where it is not given).
    """
    if robot.link_mass is None or robot.link_centre is None:
        return np.zeros((len(theta), 6))
    planes = np.empty((6, 3, len(theta)), dtype=np.complex128)
    frames = chain(robot, np.ascontiguousarray(robot.serial_angles(theta).T), planes)
    mass = robot.link_mass.copy()
    x, y, z = robot.link_centre.T[:, :, None, None]
    # First moments of mass (6, 3, n): each body's, then of all that an axis carries.
    moment = mass[:, None, None] * (frames.origins + x * planes.real + y * planes.imag + z * frames.axes)
    if tool_mass:
        centre = np.zeros(3) if tool_centre is None else tool_centre
        moment[5] += tool_mass * (frames.origins[5] + np.einsum("cjn,j->cn", frames.rotation, centre))
        mass[5] += tool_mass
    carried = np.cumsum(moment[::-1], axis=0)[::-1] - np.cumsum(mass[::-1])[::-1, None, None] * frames.origins
    # m g . (z x r) = z . (m r x g)
    x, y, z = carried[:, 0], carried[:, 1], carried[:, 2]
    turning = np.stack([y * fall[2] - z * fall[1], z * fall[0] - x * fall[2], x * fall[1] - y * fall[0]], axis=1)
    return np.asarray(np.sum(frames.axes * turning, axis=1).T @ robot.load_matrix)


def sagged_angles(
    robot: RobotModel, theta: Array, compliance: Array, fall: Array = DOWN, tool_mass: float | None = None,
    tool_centre: Array | None = None, torque: Array | None = None,
) -> Array:
    """Controller angles (N, 6) [rad] at which a rigid robot stands where one with springs of compliance (6,) [rad/(N m)] does
    under its own weight: the unloaded pose of a robot that is commanded to theta (N, 6). theta for a robot file without
    `links`; torque: `gravity_torque` at theta, where it is at hand; other arguments as there."""
    if robot.link_mass is None:
        return theta
    torque = gravity_torque(robot, theta, fall, tool_mass, tool_centre) if torque is None else torque
    sagged = loaded_angles(robot, theta, compliance * torque)
    for _ in range(1, SAG_ROUNDS):
        torque = gravity_torque(robot, sagged, fall, tool_mass, tool_centre)
        sagged = loaded_angles(robot, theta, compliance * torque)
    return sagged


def fall_in_base(world_from_base: Frame) -> Array:
    """Acceleration of free fall (3,) [m/s^2] in the base frame: world -z (docs/formats.md#cellyaml)."""
    return np.asarray(world_from_base.rotation.T @ DOWN)

"""Poses as the pendant shows them: they prove that robot file and tool are those of the controller, which nothing else does."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from identification.common.findings import error
from identification.common.yaml_source import Positive, Strict, Triple
from identification.model.kinematics import forward
from identification.model.robot import RobotModel, built_in_robots, read_robot
from identification.model.robot_file import Six
from identification.model.rotations import Frame

Array = NDArray[np.float64]


class PendantPoseFile(Strict):
    """A pose as the pendant shows it: six joint angles, and the TCP in the robot's base."""

    joints_deg: Six
    tcp_mm: Triple
    tolerance_mm: Positive = 2.0


def check_pendant(poses: Sequence[PendantPoseFile], robot: RobotModel, flange_from_tcp: Frame, file: str) -> float | None:
    """The largest distance [m] of robot and tool from the poses; None without any. Raises CompstiffError (CS0116) beyond a
    pose's tolerance."""
    if not poses:
        return None
    theta, tcp = np.radians([pose.joints_deg for pose in poses]), 1e-3 * np.array([pose.tcp_mm for pose in poses])
    tolerance = 1e-3 * np.array([pose.tolerance_mm for pose in poses])
    off = _off(robot, theta, flange_from_tcp, tcp)
    if (off <= tolerance).all():
        return float(off.max())
    fitting = [name for name, source in built_in_robots().items()
               if (_off(read_robot(source), theta, flange_from_tcp, tcp) <= tolerance).all()]
    other = f"the robot {' or '.join(fitting)} fits these poses; " if fitting else ""
    worst = int(np.argmax(off / tolerance))
    raise error("CS0116", f"pendant_poses[{worst}]: at these angles the TCP of {robot.name} with this tool is "
                f"{1e3 * off[worst]:.1f} mm away from where the pendant shows it, tolerance {1e3 * tolerance[worst]:g} mm",
                file=file, hint=f"{other}{_tool(robot, theta, tcp, tolerance)}are these the angles and tcp_mm of one pose, in "
                "base coordinates, with this tool active?")


def _off(robot: RobotModel, theta: Array, flange_from_tcp: Frame, tcp: Array) -> Array:
    return np.asarray(np.linalg.norm(forward(robot, theta, flange_from_tcp).position - tcp, axis=1))


def _tool(robot: RobotModel, theta: Array, tcp: Array, tolerance: Array) -> str:
    """The TCP in the flange frame that fits the poses, if one does."""
    flange = forward(robot, theta, Frame.identity())
    place = np.mean(np.einsum("nji,nj->ni", flange.rotation, tcp - flange.position), axis=0)
    if (np.linalg.norm(flange.position + flange.rotation @ place - tcp, axis=1) > tolerance).any():
        return ""
    return f"with this robot a TCP at [{', '.join(f'{1e3 * x:.1f}' for x in place)}] mm in the flange frame fits; "

"""Poses as the pendant shows them: they prove that robot file and tool are those of the controller, which nothing else does."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from identification.common.findings import error
from identification.common.yaml_source import Positive, Quaternion, Strict, Triple
from identification.model.kinematics import forward
from identification.model.quaternion_order import as_written, other_order
from identification.model.robot import RobotModel, built_in_robots, read_robot
from identification.model.robot_file import Six
from identification.model.rotations import Frame, quaternion_to_matrix

Array = NDArray[np.float64]


class PendantPoseFile(Strict):
    """A pose as the pendant shows it: six joint angles, the TCP in the robot's base, and how the tool is turned there."""

    joints_deg: Six
    tcp_mm: Triple
    quaternion: Quaternion | None = None
    tolerance_mm: Positive = 2.0
    tolerance_deg: Positive = 0.5


@dataclass(frozen=True)
class PendantProof:
    """How far robot and tool are from the poses of the pendant: off [m], turn [rad], None where no pose has a quaternion."""

    off: float
    turn: float | None

    def words(self) -> str:
        """For a line."""
        turned = "its turn is unproved: they have no quaternion" if self.turn is None else f"{np.degrees(self.turn):.2g} deg"
        return f"the pendant's poses agree to {1e3 * self.off:.2g} mm{'; ' if self.turn is None else ' and '}{turned}"


def check_pendant(
    poses: Sequence[PendantPoseFile], robot: RobotModel, flange_from_tcp: Frame, file: str
) -> PendantProof | None:
    """How far robot and tool are from the poses; None without any. Raises CompstiffError (CS0116) beyond a pose's tolerance."""
    if not poses:
        return None
    theta, tcp = np.radians([pose.joints_deg for pose in poses]), 1e-3 * np.array([pose.tcp_mm for pose in poses])
    tolerance = 1e-3 * np.array([pose.tolerance_mm for pose in poses])
    off = _off(robot, theta, flange_from_tcp, tcp)
    if (off <= tolerance).all():
        return PendantProof(float(off.max()), _check_turn(poses, robot, flange_from_tcp, file))
    fitting = [name for name, source in built_in_robots().items()
               if (_off(read_robot(source), theta, flange_from_tcp, tcp) <= tolerance).all()]
    other = f"the robot {' or '.join(fitting)} fits these poses; " if fitting else ""
    worst = int(np.argmax(off / tolerance))
    raise error("CS0116", f"pendant_poses[{worst}]: at these angles the TCP of {robot.name} with this tool is "
                f"{1e3 * off[worst]:.1f} mm away from where the pendant shows it, tolerance {1e3 * tolerance[worst]:g} mm",
                file=file, hint=f"{other}{_tool(robot, theta, tcp, tolerance)}are these the angles and tcp_mm of one pose, in "
                "base coordinates, with this tool active?")


def _check_turn(poses: Sequence[PendantPoseFile], robot: RobotModel, flange_from_tcp: Frame, file: str) -> float | None:
    """By how much [rad] the tool is turned from what the poses show, at most; None where none of them shows it."""
    with_turn = {number: pose.quaternion for number, pose in enumerate(poses) if pose.quaternion is not None}
    numbers = list(with_turn)
    if not numbers:
        return None
    theta = np.radians([poses[number].joints_deg for number in numbers])
    shown = quaternion_to_matrix(list(with_turn.values()))
    tolerance = np.radians([poses[number].tolerance_deg for number in numbers])
    flange = forward(robot, theta, Frame.identity()).rotation
    turn = _angle(flange @ flange_from_tcp.rotation, shown)
    if (turn <= tolerance).all():
        return float(turn.max())
    needed, swapped = flange.swapaxes(1, 2) @ shown, flange.swapaxes(1, 2) @ other_order(shown)
    left, _, right = np.linalg.svd(needed.mean(axis=0))
    mean = left @ right
    hint = "is this the quaternion q1 q2 q3 q4 (q1 = w first) of this pose, in base coordinates, with this tool active?"
    if (_angle(swapped, flange_from_tcp.rotation) <= tolerance).all():
        hint = "these quaternions are in the order x y z w: write w first, as the pendant's q1 is"
    elif (_angle(needed, other_order(flange_from_tcp.rotation)) <= tolerance).all():
        mended = as_written(other_order(flange_from_tcp.rotation))
        hint = f"tool.quaternion is in the order x y z w: write {mended}, w first, as q1 in RAPID tooldata"
    elif (_angle(needed, mean) <= tolerance).all():
        hint = f"with this robot tool.quaternion {as_written(mean, 4)} (w first) fits; {hint}"
    worst = int(np.argmax(turn / tolerance))
    raise error("CS0116", f"pendant_poses[{numbers[worst]}]: at these angles the tool of {robot.name} is turned "
                f"{np.degrees(turn[worst]):.1f} deg away from what the pendant shows, tolerance "
                f"{np.degrees(tolerance[worst]):g} deg", file=file, hint=hint)


def _angle(first: Array, second: Array) -> Array:
    """Angles (n,) [rad] between rotations (n, 3, 3)."""
    cosine = (np.einsum("...ij,...ij->...", first, second) - 1) / 2
    return np.asarray(np.arccos(np.clip(cosine, -1, 1)))


def _off(robot: RobotModel, theta: Array, flange_from_tcp: Frame, tcp: Array) -> Array:
    return np.asarray(np.linalg.norm(forward(robot, theta, flange_from_tcp).position - tcp, axis=1))


def _tool(robot: RobotModel, theta: Array, tcp: Array, tolerance: Array) -> str:
    """The TCP in the flange frame that fits the poses, if one does."""
    flange = forward(robot, theta, Frame.identity())
    place = np.mean(np.einsum("nji,nj->ni", flange.rotation, tcp - flange.position), axis=0)
    if (np.linalg.norm(flange.position + flange.rotation @ place - tcp, axis=1) > tolerance).any():
        return ""
    return f"with this robot a TCP at [{', '.join(f'{1e3 * x:.1f}' for x in place)}] mm in the flange frame fits; "

"""Posture advice: the turn about the tool's axis that lowers the predicted deviation.

A milling tool turns anyway: the robot may hold the spindle at any angle about its axis, and is not equally soft in all of
them. The same turn for the whole program is tried in steps to either side, the joints followed from the planned posture, the
forces in the base frame kept; a turn counts where every target is reached inside the joint limits and away from the wrist's
singularity.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from compensator.correction.forward import each_tool
from compensator.forces.placement import TargetForces
from compensator.path.robot_path import LARGEST_STEP, RobotPath
from identification.model.inverse import inverse, nearest_solution, wrist_distance
from identification.model.rotations import Frame, rotation_matrix
from identification.model.stiffness import IdentifiedModel

Array = NDArray[np.float64]
Indices = NDArray[np.intp]
STEP = np.radians(5.0)
FARTHEST_TURN = 36          # steps to either side
MOST_TARGETS = 400
SINGULAR = np.radians(5.0)


@dataclass(frozen=True, eq=False)
class Advice:
    """turn (T,) [rad] about the tool's axis, ascending, those that can be driven; rms, largest (T,) [m] predicted deviation.

    stopped: why the turns end, below and above. targets: how many targets were looked at.
    """

    turn: Array
    rms: Array
    largest: Array
    stopped: tuple[str, str]
    targets: int

    @property
    def best(self) -> int:
        return int(np.argmin(self.rms))

    @property
    def planned(self) -> int:
        return int(np.argmin(np.abs(self.turn)))

    def as_dict(self) -> dict[str, Any]:
        """JSON values: the best turn, what it gains, the turns that can be driven."""
        gain = 1 - self.rms[self.best] / self.rms[self.planned] if self.rms[self.planned] > 0 else 0.0
        return {
            "turn_deg": round(float(np.degrees(self.turn[self.best])), 3), "gain": round(float(gain), 4),
            "rms_um": [round(1e6 * float(self.rms[i]), 2) for i in (self.planned, self.best)],
            "largest_um": [round(1e6 * float(self.largest[i]), 2) for i in (self.planned, self.best)],
            "possible_deg": [round(float(np.degrees(self.turn[i])), 3) for i in (0, -1)],
            "ends_by": list(self.stopped), "targets": self.targets,
        }

    def words(self) -> list[str]:
        """For the terminal."""
        told = self.as_dict()
        low, high = told["possible_deg"]
        span = (f"turns from {low:g} deg ({self.stopped[0]}) to {high:g} deg ({self.stopped[1]}) can be driven; {self.targets} "
                "targets looked at")
        if told["turn_deg"] == 0:
            return [f"Posture: no turn about the tool's axis lowers the deviation; {span}"]
        return [f"Posture: turned by {told['turn_deg']:g} deg about the tool's axis the deviation would be "
                f"{told['rms_um'][1]:.1f} in place of {told['rms_um'][0]:.1f} um RMS ({100 * told['gain']:.0f} % less), "
                f"{told['largest_um'][1]:.1f} in place of {told['largest_um'][0]:.1f} um at most; {span}; "
                "collisions are not checked"]


def advise(path: RobotPath, forces: TargetForces, model: IdentifiedModel, targets: Indices) -> Advice | None:
    """What the turns about the tool's axis would do to the targets with force (M,); None where there is none.

    Effects with memory are evaluated over the targets looked at alone.
    """
    looked = targets[:: max(-(-len(targets) // MOST_TARGETS), 1)]
    if not len(looked):
        return None
    rows: list[tuple[float, float, float]] = [(0.0, *_deviation(path, forces, model, looked, path.theta[looked]))]
    stopped = []
    for sense in (-1, 1):
        theta, why = path.theta[looked], "half a turn"
        for number in range(1, FARTHEST_TURN + 1):
            turn = sense * number * STEP
            theta, problem = _followed(path, looked, turn, theta)
            if problem:
                why = problem
                break
            rows.append((turn, *_deviation(path, forces, model, looked, theta)))
        stopped.append(why)
    turn, rms, largest = np.array(sorted(rows)).T
    return Advice(turn, rms, largest, (stopped[0], stopped[1]), len(looked))


def _pose(path: RobotPath, targets: Indices, turn: float) -> Frame:
    """base_from_flange (M) with the tool turned about its own axis."""
    about = rotation_matrix(np.array([0.0, 0.0, turn]))
    tcp = Frame(path.base_from_tcp.rotation[targets] @ about, path.base_from_tcp.position[targets])
    return tcp @ Frame(path.flange_from_tcp.rotation[targets], path.flange_from_tcp.position[targets]).inverse()


def _followed(path: RobotPath, targets: Indices, turn: float, before: Array) -> tuple[Array, str]:
    """The joint angles (M, 6) next to those of the turn before, and what forbids them ("" if nothing does)."""
    robot = path.cell.robot
    solutions = inverse(robot, _pose(path, targets, turn), before)
    if not solutions.reachable.any(axis=1).all():
        return before, "out of reach"
    theta, _ = nearest_solution(robot, solutions, before)
    if np.abs(theta - before).max() > LARGEST_STEP:
        return before, "the configuration would change"
    excess = robot.limit_excess(theta)
    if (excess > 1e-9).any():
        joint = int(np.argmax(excess.max(axis=0)))
        return theta, f"limit of joint {joint + 1}" if joint < 6 else "the parallel rod's window"
    return theta, "near the wrist's singularity" if wrist_distance(robot, theta).min() < SINGULAR else ""


def _deviation(
    path: RobotPath, forces: TargetForces, model: IdentifiedModel, targets: Indices, theta: Array
) -> tuple[float, float]:
    """RMS and largest predicted deviation [m] of the targets at these joint angles (M, 6)."""
    size = np.empty(len(targets))
    for tool, places in each_tool(path, targets):
        position, _, _ = model.predict(theta[places], forces.wrench[targets[places]], tool)
        size[places] = np.linalg.norm(position, axis=1)
    return float(np.sqrt(np.mean(size**2))), float(size.max())

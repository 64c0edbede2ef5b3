"""Posture advice: the turn about the tool's axis that lowers the predicted deviation.

A milling tool turns anyway: the robot may hold the spindle at any angle about its axis, and is not equally soft in all of
them. The same turn for the whole program is tried in steps to either side, the joints followed from the planned posture, the
forces in the base frame kept; a turn counts where every target is reached inside the joint limits and away from the wrist's
singularity.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from compensator.correction.loaded_path import LoadedPath
from compensator.path.robot_path import LARGEST_STEP
from identification.common.arrays import rms
from identification.model.inverse import inverse, nearest_solution, wrist_distance
from identification.model.rotations import Frame, rotation_matrix

Array = NDArray[np.float64]
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

    def lines(self) -> list[str]:
        """For the terminal."""
        figures = self.as_dict()
        low, high = figures["possible_deg"]
        span = (f"turns from {low:g} deg ({self.stopped[0]}) to {high:g} deg ({self.stopped[1]}) can be driven; {self.targets} "
                "targets looked at")
        if figures["turn_deg"] == 0:
            return [f"Posture: no turn about the tool's axis lowers the deviation; {span}"]
        planned, best = zip(figures["rms_um"], figures["largest_um"], strict=True)
        return [f"Posture: turned by {figures['turn_deg']:g} deg about the tool's axis the deviation would be {best[0]:.1f} in "
                f"place of {planned[0]:.1f} um RMS ({100 * figures['gain']:.0f} % less), {best[1]:.1f} in place of "
                f"{planned[1]:.1f} um at most; {span}; "
                "collisions are not checked"]


def advise(loaded: LoadedPath) -> Advice | None:
    """What the turns about the tool's axis would do to the targets with force; None where there is none.

    Effects with memory are evaluated over the targets looked at alone.
    """
    looked = replace(loaded, targets=loaded.targets[:: max(-(-len(loaded.targets) // MOST_TARGETS), 1)])
    if not len(looked.targets):
        return None
    rows: list[tuple[float, float, float]] = [(0.0, *_deviation(looked, looked.theta))]
    stopped = []
    for sense in (-1, 1):
        theta, why = looked.theta, "half a turn"
        for number in range(1, FARTHEST_TURN + 1):
            turn = sense * number * STEP
            theta, problem = _followed(looked, turn, theta)
            if problem:
                why = problem
                break
            rows.append((turn, *_deviation(looked, theta)))
        stopped.append(why)
    turns, rms_of, largest = np.array(sorted(rows)).T
    return Advice(turns, rms_of, largest, (stopped[0], stopped[1]), len(looked.targets))


def _pose(loaded: LoadedPath, turn: float) -> Frame:
    """base_from_flange (M) with the tool turned about its own axis."""
    about = rotation_matrix(np.array([0.0, 0.0, turn]))
    tcp = Frame(loaded.plan.rotation @ about, loaded.plan.position)
    return tcp @ loaded.path.flange_from_tcp[loaded.targets].inverse()


def _followed(loaded: LoadedPath, turn: float, before: Array) -> tuple[Array, str]:
    """The joint angles (M, 6) next to those of the turn before, and what forbids them ("" if nothing does)."""
    robot = loaded.model.robot
    solutions = inverse(robot, _pose(loaded, turn), before)
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


def _deviation(loaded: LoadedPath, theta: Array) -> tuple[float, float]:
    """RMS and largest predicted deviation [m] of the targets at these joint angles (M, 6)."""
    size, wrench = np.empty(len(loaded.targets)), loaded.wrench
    for tool, places in loaded.each_tool():
        position, _, _ = loaded.model.predict(theta[places], wrench[places], tool)
        size[places] = np.linalg.norm(position, axis=1)
    return rms(size), float(size.max())

"""An arm of this cell that mills: joint angles for a path in front of it, and where a cut pushes the tool along it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from tests.second_cell.arm import Arm
from tests.second_cell.chain import placed
from tests.second_cell.plans import Plan
from tests.second_cell.robots import ELBOW, HOME_FLANGE, WINDOWS

# Drive angles [deg] near those in which a tool that hangs from a level forearm points down.
DOWN = np.radians([0.0, 10.0, 10.0, 0.0, 75.0, 0.0])
NEAR = 1e-12            # of the inverse: TCP [m] and turn [rad]
FORCE_TOLERANCE = 1e-4  # of the balance of cut and arm [N]
ForceOf = Callable[[int, np.ndarray], np.ndarray]


@dataclass(frozen=True)
class Machine:
    """An arm without memory, and where the part lies (3,) [m] in its base frame."""

    arm: Arm
    object_m: tuple[float, float, float]

    def angles(self, tcp: np.ndarray, rotation: np.ndarray) -> np.ndarray:
        """Drive angles (n, 6) [rad] for TCPs (n, 3) [m] and rotations (n, 3, 3) base_from_flange, all near to each other, by
        Newton's method; raises ValueError where they leave the windows of the load tests' poses."""
        robot = self.arm.robot
        home = robot.tcp_home(self.arm.tool)
        q = np.repeat(DOWN[None], len(tcp), axis=0)
        for _ in range(60):
            now = placed(robot.screws, q @ robot.drive.T)
            at = now.point(5, home)
            miss = rotation @ np.swapaxes(now.rotation[5] @ HOME_FLANGE, 1, 2)
            skew = miss - np.swapaxes(miss, 1, 2)
            turn = 0.5 * np.stack([skew[:, 2, 1], skew[:, 0, 2], skew[:, 1, 0]], axis=1)
            step = np.concatenate([tcp - at, turn], axis=1)
            if np.abs(step).max() < NEAR:
                break
            twist = np.concatenate([now.motion(5, at), now.omega], axis=2)      # (n, hinges, 6)
            q = q + np.clip(np.linalg.solve(np.swapaxes(twist, 1, 2) @ robot.drive, step[:, :, None])[:, :, 0], -0.3, 0.3)
        else:
            raise ValueError("no joint angles for this path")
        degrees = np.degrees(q)
        elbow = degrees[:, 2] - degrees[:, 1] * robot.rod
        inside = (degrees >= WINDOWS[:, 0]) & (degrees <= WINDOWS[:, 1])
        if not inside.all() or elbow.min() < ELBOW[0] or elbow.max() > ELBOW[1]:
            raise ValueError(f"the path leaves the robot's windows: {degrees[0].round(1)}, {degrees[-1].round(1)}")
        return np.asarray(q)

    def pushed(self, theta: np.ndarray, time_s: np.ndarray, force_of: ForceOf) -> tuple[np.ndarray, np.ndarray]:
        """How far the tool is off the same way in air (s, 3) [m] at theta (s, 6) [rad], and the force (s, 3) [N], base frame:
        force_of(step, displacement) is the force where the tool is pushed to. All steps at once: the arm forgets."""
        if any(law.memory for law in self.arm.laws):
            raise ValueError("this arm remembers its way")
        count = len(theta)
        plan = Plan(theta, np.zeros((count, 3)), time_s, np.zeros(count), np.arange(count))
        moved = np.zeros((count, 3))
        force = np.array([force_of(i, moved[i]) for i in range(count)])
        share, last = np.ones(count), np.full(count, np.inf)
        open_, missing = np.arange(count), force
        for _ in range(200):
            part = Plan(theta[open_], plan.load[open_], time_s[open_], plan.dwell[open_], np.arange(len(open_)))
            moved[open_] = self.arm.displacement(part, force[open_])
            missing = np.array([force_of(i, moved[i]) for i in open_]) - force[open_]
            open_, missing = open_[left := np.abs(missing).max(axis=1) > FORCE_TOLERANCE], missing[left]
            if not len(open_):
                return moved, force
            # Where the cut is stiffer than the arm, whole steps would go back and forth.
            size = np.linalg.norm(missing, axis=1)
            share[open_] *= np.where(size > 0.9 * last[open_], 0.5, 1.0)
            last[open_] = size
            force[open_] += share[open_, None] * missing
        raise RuntimeError(f"cut and arm find no balance at step {open_[0]}")

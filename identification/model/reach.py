"""How far a robot's wrist centre gets inside its limits: the reach of data sheets."""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import NDArray

from identification.model.kinematics import chain
from identification.model.robot import RobotModel

Array = NDArray[np.float64]
# Places of joint 2 and of joint 3 on the grid, how often the surroundings of the best are looked at anew, and how many steps of
# the grid to either side of it.
PLACES, CLOSER, AROUND = 73, 7, 4


def reach(robot: RobotModel, axis: Literal[1, 2] = 1) -> float:
    """The wrist centre's largest distance [m] from axis 1 or from axis 2, joints 2 and 3 inside their limits and window.

    The wrist centre is the origin of axis 5, the distance is at right angles to the axis. NaN where nothing lies inside.
    A search on a grid that is refined around its best: to less than 1e-6 of the arm's length.
    """
    low, high = robot.limits[1:3, 0], robot.limits[1:3, 1]
    best = np.nan
    for _ in range(CLOSER + 1):
        angles = [np.linspace(low[k], high[k], PLACES) for k in (0, 1)]
        theta = np.zeros((PLACES * PLACES, 6))
        theta[:, 1:3] = np.stack(np.meshgrid(*angles, indexing="ij"), axis=-1).reshape(-1, 2)
        away = np.where(_inside(robot, theta), _distance(robot, theta, axis), -1.0)
        at = int(np.argmax(away))
        if away[at] < 0:
            return best
        best, step = float(away[at]), (high - low) / (PLACES - 1)
        low = np.maximum(robot.limits[1:3, 0], theta[at, 1:3] - AROUND * step)
        high = np.minimum(robot.limits[1:3, 1], theta[at, 1:3] + AROUND * step)
    return best


def _inside(robot: RobotModel, theta: Array) -> NDArray[np.bool_]:
    """Whether joints 2 and 3 and the window allow it; a rounding error beyond their ends at most."""
    return np.asarray((robot.limit_excess(theta)[:, [1, 2, 6]] < 1e-12).all(axis=1))


def _distance(robot: RobotModel, theta: Array, axis: Literal[1, 2]) -> Array:
    frames = chain(robot, np.ascontiguousarray(robot.serial_angles(theta).T))
    along, arm = frames.axes[axis - 1], frames.origins[4] - frames.origins[axis - 1]
    return np.asarray(np.linalg.norm(arm - along * np.sum(along * arm, axis=0), axis=0))

"""The same program in another stance of the arm: turned about the tool's axis, or with the work object at another place.

The forces in the base frame are kept. A stance counts where every target with force is reached on the branch it has, inside the
joint limits and away from the wrist's singularity; what stands in the cell is not known.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from compensator.correction.loaded_path import LoadedPath
from compensator.correction.posture import SINGULAR, STEP
from compensator.path.robot_path import LARGEST_STEP
from identification.common.arrays import rms
from identification.model.inverse import nearest_angles, wrist_distance
from identification.model.rotations import Frame, rotation_matrix

Array = NDArray[np.float64]
# The work object is moved along one base axis, by steps so long, so many either way [m].
SHIFT, SHIFTS = 0.1, 3
# Places are compared by so many targets at most.
MOST_TARGETS = 400


def turned(loaded: LoadedPath, turn: float) -> LoadedPath | None:
    """With the tool turned about its own axis by `turn` [rad], followed in steps; None where that cannot be driven."""
    steps = max(round(abs(turn) / STEP), 1)
    about = rotation_matrix(np.array([0.0, 0.0, turn / steps]))
    stance: LoadedPath | None = loaded
    for _ in range(steps):
        if stance is not None:
            goal = stance.path.base_from_tcp
            stance = _stands(stance, Frame(goal.rotation @ about, goal.position))
    return stance


def shifted(loaded: LoadedPath, shift: Array) -> LoadedPath | None:
    """With the work object moved by shift (3,) [m], base frame, along one axis, followed in steps; None where that cannot be
    driven."""
    steps = max(round(float(np.abs(shift).max()) / SHIFT), 1)
    stance: LoadedPath | None = loaded
    for _ in range(steps):
        if stance is not None:
            goal = stance.path.base_from_tcp
            stance = _stands(stance, Frame(goal.rotation, goal.position + shift / steps))
    return stance


def best_shift(loaded: LoadedPath) -> Array | None:
    """The shift (3,) [m] along one base axis that lowers the predicted deviation most; None where none does."""
    looked = replace(loaded, targets=loaded.targets[:: max(-(-len(loaded.targets) // MOST_TARGETS), 1)])
    if not len(looked.targets):
        return None
    best, least = None, _deviation(looked)
    for axis in range(3):
        for sense in (-1, 1):
            for number in range(1, SHIFTS + 1):
                shift = np.zeros(3)
                shift[axis] = sense * number * SHIFT
                stance = shifted(looked, shift)
                if stance is None:
                    break
                here = _deviation(stance)
                if here < least:
                    best, least = shift, here
    return best


def _stands(loaded: LoadedPath, goal: Frame) -> LoadedPath | None:
    """The robot with its tool at goal (N), on the branches it has; targets that are not looked at keep their joint angles."""
    path, targets, robot = loaded.path, loaded.targets, loaded.model.robot
    flange = goal @ path.flange_from_tcp.inverse()
    theta = nearest_angles(robot, flange[targets], loaded.theta)
    if (np.isnan(theta).any() or np.abs(theta - loaded.theta).max(initial=0.0) > LARGEST_STEP
            or (robot.limit_excess(theta) > 1e-9).any() or wrist_distance(robot, theta).min(initial=np.inf) < SINGULAR):
        return None
    angles = path.theta.copy()
    angles[targets] = theta
    return replace(loaded, path=replace(path, theta=angles, base_from_tcp=goal))


def _deviation(loaded: LoadedPath) -> float:
    """RMS of the predicted deviation [m]."""
    size, wrench = np.empty(len(loaded.targets)), loaded.wrench
    for tool, places in loaded.each_tool():
        position, _, _ = loaded.model.predict(loaded.theta[places], wrench[places], tool)
        size[places] = np.linalg.norm(position, axis=1)
    return rms(size)

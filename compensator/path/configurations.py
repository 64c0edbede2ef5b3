"""How the robot holds the tool along a whole path: the free turn about the tool axis, and one configuration throughout."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from compensator.path.robot_path import LARGEST_STEP
from identification.model.cell import Cell
from identification.model.inverse import BRANCHES, Solutions, inverse, wrist_distance
from identification.model.robot import RobotModel
from identification.model.rotations import Frame, matrix_to_quaternion

Array = NDArray[np.float64]

# Directions tried for the tool's x axis, every 15 degrees in the work object's x-y plane, on so many targets of the path.
DIRECTIONS, MOST_TRIED = 24, 400
# The tool axis may not come nearer than this to the direction its x axis is turned towards [rad].
LEAST_ANGLE = np.radians(10.0)


@dataclass(frozen=True, eq=False)
class Held:
    """theta (N, 6) [rad] along the path; reserve [rad]: the smallest distance of any axis from a limit, or of axis 5 from
    the wrist singularity, reached at target `at`; where: which of the two it is. failed_at: -1, or the target where it broke
    down (then theta is not usable)."""

    theta: Array
    reserve: float
    at: int
    where: str
    failed_at: int = -1


def tool_frames(axis: Array, towards: Array) -> Array:
    """Quaternions (N, 4) w x y z, work object from tool: z against the tool axis (N, 3), which points from the tip to the
    spindle, x as near as possible to the direction `towards` (3,)."""
    z = -axis
    x = towards - (z @ towards)[:, None] * z
    x /= np.linalg.norm(x, axis=1, keepdims=True)
    quaternion = matrix_to_quaternion(np.stack([x, np.cross(z, x), z], axis=2))
    # The sign is free; neighbours have the same one, so that a reader who differences the file sees no jump.
    flips = np.cumprod(np.where(np.einsum("ni,ni->n", quaternion[1:], quaternion[:-1]) < 0, -1.0, 1.0))
    quaternion[1:] *= flips[:, None]
    return quaternion


def angle_to(axis: Array, towards: Array) -> Array:
    """Angle (N,) [rad] between the line of the tool axis (N, 3) and the line of a unit direction (3,)."""
    return np.asarray(np.arccos(np.clip(np.abs(axis @ towards), 0, 1)))


def base_from_flange(cell: Cell, position: Array, quaternion: Array) -> Frame:
    """Flange poses (N) in the base frame of TCP poses in cell.yaml's work object."""
    base_from_object = cell.world_from_base.inverse() @ cell.world_from_object
    return base_from_object @ Frame.from_quaternion(position, quaternion) @ cell.flange_from_tcp.inverse()


def best_direction(cell: Cell, position: Array, axis: Array) -> tuple[Array, float] | None:
    """The direction (3,) for the tool's x axis that leaves most reserve along the path, and its angle in the work object's x-y
    plane [rad]; None where the tool axis comes too near to every one of them."""
    tried = np.unique(np.linspace(0, len(position) - 1, MOST_TRIED).astype(int))
    best: tuple[float, float, float] | None = None
    for angle in 2 * np.pi * np.arange(DIRECTIONS) / DIRECTIONS:
        towards = np.array([np.cos(angle), np.sin(angle), 0.0])
        if angle_to(axis, towards).min() < LEAST_ANGLE:
            continue
        held = hold(cell.robot, base_from_flange(cell, position[tried], tool_frames(axis[tried], towards)), thinned=len(tried)
                    < len(position))
        # Among directions that break down the one that gets farthest; rounding keeps ties at the first.
        score = (float(held.failed_at < 0), round(held.reserve, 6) if held.failed_at < 0 else held.failed_at)
        if best is None or score > best[:2]:
            best = (*score, angle)
    if best is None:
        return None
    return np.array([np.cos(best[2]), np.sin(best[2]), 0.0]), best[2]


def hold(robot: RobotModel, flange: Frame, *, branches: NDArray[np.bool_] | None = None, thinned: bool = False) -> Held:
    """One configuration along all of N flange poses: of the eight the one with most reserve. branches (8,): those allowed.
    thinned: neighbours are farther apart than on the path, so large steps do not count."""
    solutions = inverse(robot, flange)
    held = [_along(robot, solutions, branch, thinned) for branch in range(BRANCHES) if branches is None or branches[branch]]
    whole = [run for run in held if run.failed_at < 0]
    return max(whole, key=lambda run: run.reserve) if whole else max(held, key=lambda run: run.failed_at)


def _along(robot: RobotModel, solutions: Solutions, branch: int, thinned: bool) -> Held:
    """One branch followed along the path, each axis in the turn that keeps it farthest from its limits."""
    run = np.unwrap(solutions.theta[:, branch], axis=0)
    low, high = run.min(axis=0), run.max(axis=0)
    # The middle of the run is brought next to the middle of the range.
    run = run - 2 * np.pi * np.round(((low + high) / 2 - robot.limits.mean(axis=1)) / (2 * np.pi))
    good = solutions.reachable[:, branch] & (robot.limit_excess(run) <= 1e-9).all(axis=1)
    if not thinned:
        good[1:] &= (np.abs(np.diff(run, axis=0)) < LARGEST_STEP).all(axis=1)
    if not good.all():
        return Held(run, 0.0, int(np.argmin(good)), "", int(np.argmin(good)))
    rooms = [np.minimum(run - robot.limits[:, 0], robot.limits[:, 1] - run)]
    names = [f"a limit of joint {joint + 1}" for joint in range(run.shape[1])]
    if robot.window is not None:
        joint, least, most = robot.window
        difference = run @ robot.coupling[joint]
        rooms.append(np.minimum(difference - least, most - difference)[:, None])
        names.append("an end of the parallel rod's window")
    room = np.column_stack([*rooms, wrist_distance(robot, run)])
    at, nearest = np.unravel_index(np.argmin(room), room.shape)
    return Held(run, float(room[at, nearest]), int(at), [*names, "the wrist singularity"][nearest])

"""Batched analytic inverse kinematics of spherical-wrist arms, every branch; ABB configuration data.

Covers arms whose joints 2 and 3 are parallel, lie in one plane with the wrist centre, and whose last three axes meet in
it: all usual milling robots, with or without a parallel rod. Other arms are refused, never approximated.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from identification.common.findings import error
from identification.model.kinematics import chunks, quarter_turns, sine_cosine
from identification.model.robot import RobotModel
from identification.model.rotations import Frame

Array = NDArray[np.float64]

# Branch numbers are ABB's cfx for serial arms: 4 wrist centre behind axis 1, 2 wrist centre behind the lower arm,
# 1 axis 5 negative.
BRANCHES = 8
# Axis 5 closer than this to the wrist singularity [rad]: axes 4 and 6 turn fast there (engineering judgement).
NEARLY_SINGULAR = np.radians(2.0)
# Within this of sin(theta5) = 0 [rad] only the sum of axes 4 and 6 is determined; axis 4 is then taken from a reference.
WRIST_SINGULAR_RAD = 1e-9


@dataclass(frozen=True, eq=False)
class Solutions:
    """All branches for N poses.

    theta (N, 8, 6) [rad] controller angles, each axis in the turn nearest to zero that its limits allow; branch by cfx.
    reachable (N, 8): False where the arm is too short or folds too far; theta is then the nearest pose, not a solution.
    """

    theta: Array
    reachable: NDArray[np.bool_]


def check_spherical_wrist(robot: RobotModel) -> None:
    """Raises CompstiffError (CS1102) for an arm this module has no closed form for."""
    sines, cosines = np.array([quarter_turns(alpha) for alpha in robot.alpha]).T
    wanted = {
        "alpha of joints 2, 4, 5 and 6 must be +-90 degrees": np.all(np.abs(sines[[1, 3, 4, 5]]) == 1),
        "alpha of joints 1 and 3 must be 0 or 180 degrees": np.all(np.abs(cosines[[0, 2]]) == 1),
        "a of joints 1, 5 and 6 must be zero": np.all(robot.a[[0, 4, 5]] == 0),
        "d of joints 2, 3 and 5 must be zero": np.all(robot.d[[1, 2, 4]] == 0),
        "the lower arm (a of joint 3) and the forearm must have a length": robot.a[2] > 0
        and np.hypot(robot.a[3], robot.d[3]) > 0,
    }
    for condition, holds in wanted.items():
        if not holds:
            raise error("CS1102", f"no inverse kinematics for robot {robot.name}: {condition}", file=str(robot.source),
                        hint="arms with a spherical wrist and two parallel main axes are supported")


def inverse(robot: RobotModel, base_from_flange: Frame, reference: Array | None = None) -> Solutions:
    """Every branch of the inverse kinematics of N flange poses in the base frame.

    reference (N, 6) [rad], optional: where the wrist is singular axis 4 stands as in the reference (else at zero).
    Raises CompstiffError (CS1102) for other arm structures.
    """
    count = len(base_from_flange.position)
    theta, reachable = np.empty((count, BRANCHES, 6)), np.empty((count, BRANCHES), dtype=bool)
    for branch in range(BRANCHES):
        theta[:, branch], reachable[:, branch] = one_branch(robot, base_from_flange, branch, reference)
    return Solutions(theta, reachable)


def one_branch(
    robot: RobotModel, base_from_flange: Frame, branch: int, reference: Array | None = None
) -> tuple[Array, NDArray[np.bool_]]:
    """One branch of `inverse`, by its cfx: angles (N, 6) [rad], and which poses it reaches (N,)."""
    check_spherical_wrist(robot)
    count = len(base_from_flange.position)
    theta, reachable = np.empty((count, 6)), np.empty(count, dtype=bool)
    for part in chunks(count):
        pose = base_from_flange[part]
        theta[part], reachable[part] = _branch(robot, pose, branch, None if reference is None else reference[part])
    return theta, reachable


def _branch(
    robot: RobotModel, base_from_flange: Frame, branch: int, reference: Array | None
) -> tuple[Array, NDArray[np.bool_]]:
    """`one_branch` of one chunk."""
    behind, elbow, flip = branch >> 2, branch >> 1 & 1, branch & 1
    sines, cosines = np.array([quarter_turns(alpha) for alpha in robot.alpha]).T
    columns = np.ascontiguousarray(np.moveaxis(base_from_flange.rotation, 0, -1))    # [component, column, pose]
    centre = base_from_flange.position.T - robot.d[5] * columns[:, 2]
    # The wrist centre about axis 1, whose z axis points up (alpha 0) or down (180 degrees).
    x, y, z = centre[0], cosines[0] * centre[1], cosines[0] * centre[2]
    radius, height = np.sqrt(x * x + y * y), z - robot.d[0]
    upper = robot.a[2]
    # The forearm as a vector of the frame of joint 3, from axis 3 to the wrist centre.
    fore_x, fore_y = robot.a[3], -sines[3] * robot.d[3]
    forearm, fore_angle = np.hypot(fore_x, fore_y), np.arctan2(fore_y, fore_x)
    theta = np.empty((6, len(radius)))
    theta[0] = np.arctan2(y, x) + np.pi * behind
    # The arm's plane, seen along axis 2: u outwards from axis 2, v along frame 2's y axis.
    u = (radius if not behind else -radius) - robot.a[1]
    v = sines[1] * height
    fold = (u * u + v * v - upper**2 - forearm**2) / (2 * upper * forearm)
    # Sign of the angle from lower arm to forearm that puts the wrist centre in front of the lower arm, in the sense of
    # rotation in which axis 2 leans the arm outwards.
    sense = sines[1] * (1 if not elbow else -1) * -1.0
    cosine = np.clip(fold, -1, 1)
    angle = sense * np.arccos(cosine)
    sine = sense * np.sqrt((1 - cosine) * (1 + cosine))
    theta[1] = np.arctan2(v, u) - np.arctan2(forearm * sine, upper + forearm * cosine)
    theta[2] = cosines[2] * angle - fore_angle
    _wrist(theta, columns, sines, cosines, flip, None if reference is None else robot.serial_angles(reference)[:, 3])
    return _nearest_turns(robot, robot.controller_angles(theta.T), None), np.abs(fold) <= 1 + 1e-12


def _wrist(theta: Array, columns: Array, sines: Array, cosines: Array, flip: int, reference4: Array | None) -> None:
    """Fills in the serial angles 4, 5, 6 of theta (6, n) that turn the forearm's frame into the flange's, whose axes are
    columns [component, column, pose].

    With B = RotX(-alpha4) R_03^T R = RotZ(theta4) RotX(alpha5) RotZ(theta5) RotX(alpha6) RotZ(theta6), the third
    column is (s6 sin5 cos4, s6 sin5 sin4, -s5 s6 cos5), and the second row of RotZ(-theta4) B is
    (-s5 s6 sin6, -s5 s6 cos6, 0), which gives axis 6 sharply even where axis 5 is near zero. Joints 2 and 3 are parallel, so
    that they turn as one, alpha3 between them no more than a change of sign.
    """
    x, y, z = columns[0], cosines[0] * columns[1], cosines[0] * columns[2]
    x, y = _turned_back(x, y, theta[0])
    y, z = sines[1] * z, -sines[1] * y
    x, y = _turned_back(x, y, theta[1] + cosines[2] * theta[2])
    y, z = cosines[2] * y, cosines[2] * z
    y, z = sines[3] * z, -sines[3] * y
    s5, s6 = sines[4], sines[5]
    sign = -1.0 if flip else 1.0
    sine5 = np.sqrt(x[2] * x[2] + y[2] * y[2])
    singular = sine5 < WRIST_SINGULAR_RAD
    theta[4] = np.arctan2(sign * sine5, -s5 * s6 * z[2])
    theta[3] = np.arctan2(sign * s6 * y[2], sign * s6 * x[2])
    theta[3] = np.where(singular, 0.0 if reference4 is None else reference4, theta[3])
    _, second = _turned_back(x[:2], y[:2], theta[3])
    theta[5] = np.arctan2(-s5 * s6 * second[0], -s5 * s6 * second[1])


def _turned_back(x: Array, y: Array, angle: Array) -> tuple[Array, Array]:
    """RotZ(-angle) of vectors (k, n) whose components are x and y."""
    s, c = sine_cosine(angle)
    return c * x + s * y, c * y - s * x


def _nearest_turns(robot: RobotModel, theta: Array, reference: Array | None) -> Array:
    """Whole turns added to each joint angle (..., 6) [rad]: inside the limits where that is possible, and among those
    the nearest to the reference (or to zero)."""
    turn = 2 * np.pi
    target = 0.0 if reference is None else reference
    wanted = theta + turn * np.round((target - theta) / turn)
    if ((wanted >= robot.limits[:, 0]) & (wanted <= robot.limits[:, 1])).all():
        return np.asarray(wanted)
    slack = 1e-9
    highest = theta + turn * np.floor((robot.limits[:, 1] + slack - theta) / turn)
    lowest = theta + turn * np.ceil((robot.limits[:, 0] - slack - theta) / turn)
    return np.asarray(np.where(lowest > highest, wanted, np.clip(wanted, lowest, highest)))


def nearest_solution(robot: RobotModel, solutions: Solutions, reference: Array) -> tuple[Array, NDArray[np.intp]]:
    """For each pose the angles (N, 6) [rad] nearest to `reference` (N, 6), turns included, and their branch (N,).

    Nearest by the largest joint difference, among the reachable branches; NaN and branch -1 where there is none.
    """
    turned = _nearest_turns(robot, solutions.theta, reference[:, None, :])
    distance = np.max(np.abs(turned - reference[:, None, :]), axis=2)
    distance[~solutions.reachable] = np.inf
    branch = np.argmin(distance, axis=1)
    best = np.take_along_axis(turned, branch[:, None, None], axis=1)[:, 0]
    lost = np.isinf(distance).all(axis=1)
    best[lost] = np.nan
    branch[lost] = -1
    return best, branch


def nearest_angles(robot: RobotModel, base_from_flange: Frame, reference: Array) -> Array:
    """The joint angles (N, 6) [rad] of flange poses nearest to `reference` (N, 6), NaN where no branch reaches, as by
    `nearest_solution` of all branches. Raises as `inverse`.

    Mostly that is the branch the reference stands in: the others are worked out only where they might be as near.
    """
    theta = np.empty_like(reference)
    for part in chunks(len(reference)):
        pose, near = base_from_flange[part], reference[part]
        branch = configuration(robot, np.nan_to_num(near, posinf=0.0, neginf=0.0))[:, 3]
        unsure = np.ones(len(near), dtype=bool)
        for number in np.unique(branch).tolist():
            rows = np.flatnonzero(branch == number)
            angles, reachable = one_branch(robot, pose[rows], number, near[rows])
            turned = _nearest_turns(robot, angles, near[rows])
            theta[part][rows] = turned
            unsure[rows] = ~(reachable & _nearer_than_others(robot, turned, near[rows]))
        if unsure.any():
            solutions = inverse(robot, pose[unsure], near[unsure])
            theta[part][unsure], _ = nearest_solution(robot, solutions, near[unsure])
    return theta


def _nearer_than_others(robot: RobotModel, theta: Array, reference: Array) -> NDArray[np.bool_]:
    """Whether no other branch can be as near to the reference (N, 6) as these angles (N, 6) of one branch.

    In serial angles another one has axis 1 or axis 4 half a turn away, or axis 3 by twice the bend of the arm. One as near
    would be within twice the distance of these, times what the coupling makes of it.
    """
    distance = np.max(np.abs(theta - reference), axis=1)
    reach = 2 * distance * np.abs(robot.coupling).sum(axis=1).max() + 1e-9
    serial = robot.serial_angles(theta)
    sine, _ = quarter_turns(robot.alpha[3])
    bent, of_wrist = sine_cosine(np.stack([serial[:, 2] + np.arctan2(-sine * robot.d[3], robot.a[3]), serial[:, 4]]))[0]
    return np.asarray((reach < np.minimum(2 * np.abs(bent), np.pi)) & (np.abs(of_wrist) > 1e3 * WRIST_SINGULAR_RAD))


def configuration(robot: RobotModel, theta: Array) -> NDArray[np.int64]:
    """ABB confdata cf1 cf4 cf6 cfx (N, 4) of joint angles (N, 6) [rad].

    cf1, cf4, cf6 are quadrants, 0 for 0..90 degrees, 1 for 90..180, -1 for 0..-90 (RAPID manual, confdata). cfx counts
    4 wrist centre behind axis 1, 2 wrist centre behind the lower arm, 1 axis 5 negative.
    """
    sines, cosines = np.array([quarter_turns(alpha) for alpha in robot.alpha]).T
    serial = robot.serial_angles(theta)
    fore_x, fore_y = robot.a[3], -sines[3] * robot.d[3]
    bend = cosines[2] * (serial[:, 2] + np.arctan2(fore_y, fore_x))
    forearm = np.hypot(fore_x, fore_y)
    (_, of_bend, of_wrist, _), (upper, _, _, fore) = sine_cosine(
        np.stack([serial[:, 1], bend, serial[:, 4], serial[:, 1] + bend]))
    outwards = robot.a[1] + robot.a[2] * upper + forearm * fore
    confdata = np.empty((len(theta), 4), dtype=np.int64)
    confdata[:, :3] = np.floor(theta[:, [0, 3, 5]] / (np.pi / 2))
    confdata[:, 3] = 4 * (outwards < 0) + 2 * (-sines[1] * of_bend < 0) + (of_wrist < 0)
    return confdata


def configured_solution(
    robot: RobotModel, solutions: Solutions, confdata: NDArray[np.int64]
) -> tuple[Array, NDArray[np.bool_]]:
    """The solution each target's confdata (N, 4) names: angles (N, 6) [rad], and whether there is exactly that (N,).

    Axes 1, 4 and 6 stand in the quadrants asked for, a rounding error beyond their ends at most; among the branches
    that do, inside the joint limits, the one with the right cfx wins, else the first.
    """
    angles, found = np.empty((len(confdata), 6)), np.empty(len(confdata), dtype=bool)
    for part in chunks(len(confdata)):
        few = Solutions(solutions.theta[part], solutions.reachable[part])
        angles[part], found[part] = _configured(robot, few, confdata[part])
    return angles, found


def _configured(robot: RobotModel, solutions: Solutions, confdata: NDArray[np.int64]) -> tuple[Array, NDArray[np.bool_]]:
    """`configured_solution` of one chunk."""
    count = len(confdata)
    wanted = confdata[:, None, :3] * (np.pi / 2) + np.pi / 4
    theta = solutions.theta.copy()
    for column, axis in enumerate((0, 3, 5)):
        turn = np.round((wanted[..., column] - theta[..., axis]) / (2 * np.pi))
        theta[..., axis] += 2 * np.pi * turn
    off = np.abs(theta[..., [0, 3, 5]] - wanted) - np.pi / 4
    fits = (off < 1e-6).all(axis=2) & solutions.reachable & (robot.limit_excess(theta) < 1e-9).all(axis=2)
    score = fits * (1 + (np.arange(BRANCHES) == confdata[:, 3:4]))
    branch = np.argmax(score, axis=1)
    return theta[np.arange(count), branch], fits[np.arange(count), branch]


def wrist_distance(robot: RobotModel, theta: Array) -> Array:
    """Distance of axis 5 from the wrist singularity (N,) [rad]: 0 where axes 4 and 6 are in line."""
    serial = robot.serial_angles(theta)[:, 4]
    return np.asarray(np.abs(serial - np.pi * np.round(serial / np.pi)))

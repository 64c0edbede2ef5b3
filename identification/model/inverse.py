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

CHUNK = 8192        # poses at a time: what they take stays in the cache
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
    for part in chunks(count, CHUNK):
        pose = base_from_flange[part]
        angles, reachable[part] = _branch(robot, pose, branch, None if reference is None else reference[part])
        theta[part] = angles.T
    return theta, reachable


def _branch(
    robot: RobotModel, base_from_flange: Frame, branch: int, reference: Array | None
) -> tuple[Array, NDArray[np.bool_]]:
    """`one_branch` of one chunk, components first (6, n).

    Across a joint's axis a vector is a complex number; the angle that such a number stands at is found by its direction, and
    turned back by it, without a sine or cosine.
    """
    behind, elbow, flip = branch >> 2, branch >> 1 & 1, branch & 1
    sines, cosines = zip(*(quarter_turns(alpha) for alpha in robot.alpha), strict=True)
    count = len(base_from_flange.position)
    theta = np.empty((6, count))
    # The flange's axes [column, pose] and the wrist centre about axis 1, whose z axis points up (alpha 0) or down (180).
    rotation, position = base_from_flange.rotation, base_from_flange.position
    across, along = np.empty((3, count), dtype=np.complex128), np.multiply(cosines[0], rotation[:, 2].T)
    across.real = rotation[:, 0].T
    np.multiply(cosines[0], rotation[:, 1].T, out=across.imag)
    centre = -robot.d[5] * across[2]
    centre.real += position[:, 0]
    centre.imag += cosines[0] * position[:, 1]
    height = cosines[0] * position[:, 2] - robot.d[5] * along[2] - robot.d[0]
    radius, direction = np.abs(centre), _direction(centre)
    theta[0] = _angle(centre + 0.0)         # of nothing, whatever its sign, the angle of its direction
    if behind:
        theta[0] += np.pi
        direction, radius = -direction, -radius
    across *= np.conjugate(direction)
    # The arm's plane, seen along axis 2: outwards from axis 2, and along frame 2's y axis.
    reach = np.empty(count, dtype=np.complex128)
    reach.real, reach.imag = radius - robot.a[1], sines[1] * height
    # The forearm as a vector of the frame of joint 3, from axis 3 to the wrist centre.
    upper, fore = robot.a[2], complex(robot.a[3], -sines[3] * robot.d[3])
    forearm = abs(fore)
    fold = (reach.real**2 + reach.imag**2 - (upper**2 + forearm**2)) / (2 * upper * forearm)
    # Sign of the angle from lower arm to forearm that puts the wrist centre in front of the lower arm, in the sense of
    # rotation in which axis 2 leans the arm outwards.
    sense = sines[1] * (1 if not elbow else -1) * -1.0
    bend = np.empty(count, dtype=np.complex128)
    bend.real = np.clip(fold, -1, 1)
    bend.imag = sense * np.sqrt((1 - bend.real) * (1 + bend.real))
    theta[2] = cosines[2] * (sense * np.arccos(bend.real)) - np.angle(fore)
    straight = upper + forearm * bend
    theta[1] = _angle(reach) - _angle(straight)
    turned = _direction(reach) * np.conjugate(_direction(straight)) * bend      # by axes 2 and 3 together, which are parallel
    turned *= (fore if cosines[2] < 0 else fore.conjugate()) / forearm
    # Axis 3's frame turns by alpha4 into that of the wrist: what stood across axes 2 and 3, and what stood along them.
    plane = np.empty_like(across)
    plane.real = across.real
    np.multiply(sines[1], along, out=plane.imag)
    plane *= np.conjugate(turned)
    np.multiply(-sines[1] * cosines[2] * sines[3], across.imag, out=across.imag)
    across.real = plane.real
    _wrist(theta, across, -sines[3] * cosines[2] * plane[2].imag, (sines[4], sines[5]), flip,
           None if reference is None else robot.serial_angles(reference)[:, 3])
    theta -= robot.offset[:, None]
    return _nearest_turns(robot, robot.uncoupling @ theta, None), np.abs(fold) <= 1 + 1e-12


def _wrist(
    theta: Array, across: NDArray[np.complex128], along: Array, sines: tuple[float, float], flip: int, reference4: Array | None
) -> None:
    """Fills in the serial angles 4, 5, 6 of theta (6, n) that turn the forearm's frame into the flange's, whose axes are
    `across` (3, n) axis 4, the third of them `along` (n,) it. sines: of alpha5 and alpha6.

    With B = RotX(-alpha4) R_03^T R = RotZ(theta4) RotX(alpha5) RotZ(theta5) RotX(alpha6) RotZ(theta6), the third
    column is (s6 sin5 cos4, s6 sin5 sin4, -s5 s6 cos5), and the second row of RotZ(-theta4) B is
    (-s5 s6 sin6, -s5 s6 cos6, 0), which gives axis 6 sharply even where axis 5 is near zero.
    """
    s5, s6 = sines
    sign = -1.0 if flip else 1.0
    sine5 = np.abs(across[2])
    theta[4] = np.arctan2(sign * sine5, -s5 * s6 * along)
    fourth = sign * s6 * across[2]
    singular = np.flatnonzero(sine5 < WRIST_SINGULAR_RAD)
    if len(singular):
        fourth[singular] = 1.0 if reference4 is None else np.exp(1j * reference4[singular])
    theta[3] = _angle(fourth)
    if len(singular) and reference4 is not None:
        theta[3, singular] = reference4[singular]
    second = -s5 * s6 * (across[:2] * np.conjugate(fourth)).imag
    theta[5] = np.arctan2(second[0], second[1])


def _angle(vector: NDArray[np.complex128]) -> Array:
    return np.asarray(np.arctan2(vector.imag, vector.real))


def _direction(vector: NDArray[np.complex128]) -> NDArray[np.complex128]:
    """The vectors (n,) at unit length; 1 for nothing."""
    length = np.abs(vector)
    nothing = length == 0
    if nothing.any():
        vector, length = np.where(nothing, 1.0, vector), np.where(nothing, 1.0, length)
    direction = np.empty_like(vector)
    np.divide(vector.real, length, out=direction.real)
    np.divide(vector.imag, length, out=direction.imag)
    return direction


def _nearest_turns(robot: RobotModel, theta: Array, reference: Array | None) -> Array:
    """Whole turns added to each joint angle, components first (6, ...) [rad]: inside the limits where that is possible, and
    among those the nearest to the reference (or to zero)."""
    turn = 2 * np.pi
    off = -theta if reference is None else reference - theta
    off /= turn
    np.rint(off, out=off)
    wanted = theta
    if off.any():
        off *= turn
        wanted = theta + off
    if all(low <= angle.min(initial=np.inf) and angle.max(initial=-np.inf) <= high
           for angle, (low, high) in zip(wanted, robot.limits.tolist(), strict=True)):
        return wanted
    slack = 1e-9
    low, high = (ends.reshape(6, *(1,) * (theta.ndim - 1)) for ends in robot.limits.T)
    highest = theta + turn * np.floor((high + slack - theta) / turn)
    lowest = theta + turn * np.ceil((low - slack - theta) / turn)
    return np.asarray(np.where(lowest > highest, wanted, np.clip(wanted, lowest, highest)))


def nearest_solution(robot: RobotModel, solutions: Solutions, reference: Array) -> tuple[Array, NDArray[np.intp]]:
    """For each pose the angles (N, 6) [rad] nearest to `reference` (N, 6), turns included, and their branch (N,).

    Nearest by the largest joint difference, among the reachable branches; NaN and branch -1 where there is none.
    """
    turned = np.moveaxis(_nearest_turns(robot, np.moveaxis(solutions.theta, -1, 0), reference.T[:, :, None]), 0, -1)
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
    for part in chunks(len(reference), CHUNK):
        pose, near = base_from_flange[part], reference[part]
        branch = configuration(robot, np.nan_to_num(near, posinf=0.0, neginf=0.0))[:, 3]
        unsure = np.ones(len(near), dtype=bool)
        for number in np.unique(branch).tolist():
            rows = np.flatnonzero(branch == number)
            angles, reachable = one_branch(robot, pose[rows], number, near[rows])
            turned = _nearest_turns(robot, angles.T, near[rows].T).T
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
    robot: RobotModel, solutions: Solutions, confdata: NDArray[np.int32]
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


def _configured(robot: RobotModel, solutions: Solutions, confdata: NDArray[np.int32]) -> tuple[Array, NDArray[np.bool_]]:
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

"""The fastest run along a route under the joints' speed and acceleration limits and the programmed feed (TOPPRA).

The path parameter is the TCP's path length [m], so that its rate is the TCP's speed and the feed a bound on it, as a joint's
speed is. Where the feed is simply held nothing is solved, and long programs are solved in windows. A window ends at a stop, or
runs on beyond its end by more than the robot needs to brake: what is kept is the same as in one solve of the whole. Legs by
joint angles are trapezoids of the slowest joint.
"""

from __future__ import annotations

import logging
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from compensator.path.legs import Poses
from compensator.path.robot_path import Limits, RobotPath
from compensator.path.route import Route, build_route
from identification.common.findings import CompstiffError, error
from identification.model.kinematics import chunks

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

# Grid points solved at once; the squared speed that stands for no bound [m^2/s^2].
WINDOW = 20_000
FASTEST = 1e2
# Where the robot stands its squared speed is at most this [m^2/s^2]: with 0 the solver's rounding leaves no speed at all.
REST = 1e-12
# A window runs on by so many braking distances, and by so many points at least.
OVERRUN, FEWEST = 2.0, 50


@dataclass(frozen=True, eq=False)
class Drive:
    """A program as the robot can drive it.

    speed (K,) [m/s] at the route's grid points. duration (N,) [s] of each target's leg; NaN where it is not known.
    programmed (N,) [s]: its length over its feed, NaN for unknown feed, 0 for legs not judged by feed.
    """

    route: Route
    speed: Array
    duration: Array
    programmed: Array

    @property
    def time(self) -> Array:
        """When each target is reached (N,) [s], from the start of the program; legs of unknown duration count nothing."""
        return np.asarray(np.cumsum(np.nan_to_num(self.duration)))


def drive(path: RobotPath, poses: Poses | None = None, window: int = WINDOW) -> Drive:
    """The fastest run through the planned poses, or through these. Raises CompstiffError (CS4409) where TOPPRA fails."""
    poses = poses or Poses(path.base_from_tcp, path.theta)
    route = build_route(path, poses)
    legs, toolpath = route.legs, path.toolpath
    speed = fastest(route, path.limits, path, window)
    count = len(toolpath)
    duration = np.full(count, np.nan)
    if len(speed):
        both = speed[1:] + speed[:-1]
        step = np.where(route.stop[1:] & route.stop[:-1], 0.0, np.diff(route.s))
        interval = 2 * step / np.where(step > 0, both, 1.0)
        duration[legs.linear] = np.bincount(route.leg[1:], interval, minlength=count)[legs.linear]
    duration[legs.same] = 0.0
    moved = np.flatnonzero(legs.joint)
    standing = np.concatenate([poses.theta, path.axes.driven_values()], axis=1)
    duration[moved] = joint_move_time(path.limits, standing[moved] - standing[legs.before[moved]], legs.length[moved],
                                      toolpath.feed[moved])
    if count:
        duration[0] = 0.0
    with np.errstate(divide="ignore", invalid="ignore"):
        ideal = np.where(legs.linear, legs.length / np.where(toolpath.feed > 0, toolpath.feed, np.nan), 0.0)
    return Drive(route, speed, duration, ideal)


def joint_move_time(robot: Limits, step: Array, length: Array, feed: Array) -> Array:
    """Time (n,) [s] of joint moves by step (n, 6 + D) [rad, m] from rest to rest, all joints and external axes in step; the
    TCP, which goes a chord of length (n,) [m], is on average no faster than feed (n,) [m/s] where that is known."""
    size = np.maximum(np.abs(step), 1e-12)
    rate = np.min(robot.speed / size, axis=1)
    acceleration = np.min(robot.acceleration / size, axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        rate = np.fmin(rate, np.where((feed > 0) & (length > 1e-6), feed / length, np.nan))
    triangle = rate**2 >= acceleration
    time = np.where(triangle, 2 / np.sqrt(acceleration), 1 / rate + rate / acceleration)
    return np.asarray(np.where(np.abs(step).max(axis=1, initial=0.0) < 1e-9, 0.0, time))


def speed_bound(route: Route, robot: Limits) -> Array:
    """Largest squared speed (K,) [m^2/s^2] by the feed and the joints' speeds; 0 at stops."""
    with np.errstate(divide="ignore"):
        joints = np.min(robot.speed / np.abs(route.dtheta_ds), axis=1)
    bound = np.minimum(np.minimum(route.feed, joints) ** 2, FASTEST)
    return np.where(route.stop, 0.0, bound)


def fastest(route: Route, robot: Limits, path: RobotPath, window: int = WINDOW) -> Array:
    """TCP speed (K,) [m/s] of the fastest run, window by window; where the feed is simply held nothing is solved."""
    count = len(route.s)
    if not count:
        return np.zeros(0)
    bound = speed_bound(route, robot)
    kept = np.flatnonzero(_unsettled(route, robot, bound))
    speed = np.zeros(len(kept))
    s, limit = route.s[kept], bound[kept]
    start, last = 0, len(kept) - 1
    while start < last:
        keep = end = min(start + window, last)
        if end < last:
            stops = np.flatnonzero(route.stop[kept[start + window // 2:end + 1]])
            if len(stops):
                keep = end = start + window // 2 + int(stops[-1])
            else:
                ahead = slice(keep, min(keep + window, last))
                braking = OVERRUN * float(np.max(_braking(route, robot, kept[ahead], limit[ahead])))
                end = min(max(int(np.searchsorted(s, s[keep] + braking)), keep + FEWEST), last)
        part = kept[start:end + 1]
        solved = _solve(s[start:end + 1] - s[start], route.dtheta_ds[part], route.d2theta_ds2[part], limit[start:end + 1],
                        robot, float(speed[start]))
        if solved is None:
            raise _failure(route, path, part)
        speed[start:keep + 1] = solved[:keep + 1 - start]
        start = keep
    return np.asarray(np.sqrt(np.interp(route.s, s, speed**2)))


def _braking(route: Route, robot: Limits, where: Indices, bound: Array) -> Array:
    """Path length (n,) [m] to stop from the squared speed `bound` (n,) with the joints' accelerations there."""
    return np.asarray(bound / (2 * np.min(robot.acceleration / np.maximum(np.abs(route.dtheta_ds[where]), 1e-12), axis=1)))


def _unsettled(route: Route, robot: Limits, bound: Array) -> NDArray[np.bool_]:
    """Grid points (K,) whose speed must be worked out. Elsewhere the robot drives at the feed: the bound does not change, the
    joints can hold it at constant speed, and the next place where that is not so is farther than two braking distances."""
    count = len(bound)
    restless = np.zeros(count, dtype=bool)
    for part in chunks(count):
        restless[part] = (np.abs(route.d2theta_ds2[part]) * bound[part, None] > 0.95 * robot.acceleration).any(axis=1)
    steps = np.flatnonzero(np.abs(np.diff(bound)) > 1e-9 * bound[1:])
    restless[steps] = restless[steps + 1] = True
    restless[[0, -1]] = True
    places = np.flatnonzero(restless)
    reach = OVERRUN * np.maximum.reduce([_braking(route, robot, near, bound[near]) for near in (
        places, np.maximum(places - 1, 0), np.minimum(places + 1, count - 1))])
    change = np.zeros(count + 1, dtype=np.intp)
    np.add.at(change, np.maximum(np.searchsorted(route.s, route.s[places] - reach) - 2, 0), 1)
    np.add.at(change, np.minimum(np.searchsorted(route.s, route.s[places] + reach) + 2, count), -1)
    return np.asarray(np.cumsum(change[:-1]) > 0)


def _solve(s: Array, dtheta_ds: Array, d2theta_ds2: Array, bound: Array, robot: Limits, first: float) -> Array | None:
    """Speed (k,) [m/s] along s (k,) [m] from 0 on, from speed `first` to rest; None where TOPPRA finds none. Raises
    CompstiffError (CS0051) where it is not installed."""
    try:
        import toppra
    except ImportError as reason:
        raise error("CS0051", "how fast the robot can drive is worked out by the package toppra, which is not installed",
                    hint="pip install toppra; on Windows that needs a C++ compiler. Without --check-feed, and with a log that "
                    "is placed by more than time, it is not needed") from reason
    from toppra.algorithm import TOPPRA, ParameterizationReturnCode
    from toppra.constraint import DiscretizationType, JointAccelerationConstraint, LinearConstraint

    # toppra has no types: its classes are Any to the type checker.
    class Sampled(toppra.interpolator.AbstractGeometricPath):  # type: ignore[misc]
        """The route's own derivatives, which TOPPRA asks for at the grid points alone."""

        dof = len(robot.acceleration)
        waypoints = None
        path_interval = np.array([0.0, s[-1]])

        def __call__(self, grid: Array, order: int = 0) -> Array:
            return (dtheta_ds, dtheta_ds, d2theta_ds2)[order]

    class SpeedBound(LinearConstraint):  # type: ignore[misc]
        """0 <= speed^2 <= bound."""

        def compute_constraint_params(self, *_: Any, **__: Any) -> tuple[Any, ...]:
            return None, None, None, None, None, None, np.column_stack([np.zeros(len(bound)), np.maximum(bound, REST)])

    logging.getLogger("toppra").setLevel(logging.CRITICAL)      # a failure is told by its place, `_failure`
    limits = np.column_stack([-robot.acceleration, robot.acceleration])
    solver = TOPPRA([SpeedBound(), JointAccelerationConstraint(limits, DiscretizationType.Interpolation)], Sampled(),
                    gridpoints=s, solver_wrapper="seidel", parametrizer="ParametrizeConstAccel")
    with np.errstate(invalid="ignore"):
        _, speed, _ = solver.compute_parameterization(first, 0.0)
    if solver.problem_data.return_code != ParameterizationReturnCode.Ok or speed is None or not np.isfinite(speed).all():
        return None
    return np.asarray(speed)


def _failure(route: Route, path: RobotPath, part: Indices) -> CompstiffError:
    """CS4409 at the place of a window where the joints move fastest by the path's length."""
    relative = np.abs(route.dtheta_ds[part]) / path.limits.speed
    place, joint = np.unravel_index(int(np.nanargmax(relative)), relative.shape)
    target = int(route.leg[part[place]])
    toolpath = path.toolpath
    rate = abs(float(route.dtheta_ds[part[place], joint]))
    how = (f"joint {int(joint) + 1} turns {1e-3 * np.degrees(rate):.3g} deg" if joint < 6 else
           f"{path.axes.driven[joint - 6].name} goes {1e-3 * rate / path.axes.driven[joint - 6].factor:.3g} "
           f"{path.axes.driven[joint - 6].unit}")
    return error("CS4409", f"no speed could be worked out; the hardest place is where {how} a millimetre of path",
                 file=toolpath.source, line=int(toolpath.line[target]), column=int(toolpath.column[target]),
                 target=int(toolpath.number[target]),
                 hint="is the tool near the wrist singularity there? Without --check-feed the correction does not need this")

"""The path between the targets as the robot drives it, on a fine grid: blended corners, and the joints along it.

A fly-by zone is a parabola from the zone's radius before the target to the zone's radius behind it (at most half a leg),
position and orientation alike. A slight corner that needs little acceleration at the programmed feed is one grid point whose
curvature is that of its parabola; other corners are resolved.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from compensator.path.external_axes import si_values
from compensator.path.legs import Legs, Poses, build_legs
from compensator.path.robot_path import RobotPath
from compensator.toolpath import Move
from identification.common.arrays import read_only
from identification.model.inverse import BRANCHES, Solutions, configuration, inverse, nearest_solution
from identification.model.kinematics import chunks, forward, jacobian
from identification.model.rotations import Frame, rotation_matrix, rotation_vector

Array = NDArray[np.float64]
Indices = NDArray[np.intp]
Flags = NDArray[np.bool_]

# Grid points are at most so far apart [m], [rad of orientation or of an arc].
SPACING, TURNING = 10e-3, np.radians(3.0)
# A corner of at most this turn [rad] that takes less than this share of a joint's acceleration at full feed needs no grid of
# its own: the parabola is hardly shorter than the corner.
NEARLY_STRAIGHT, GENTLE = np.radians(10.0), 0.25
BLEND = np.linspace(0.0, 1.0, 13)
# Where a ramp from or to a slower speed is resolved, as shares of its length.
RAMP = np.array([0.25, 0.5, 0.75, 0.9, 1.0, 1.1, 1.3])
CLOSEST = 1e-6
# Between two grid points no joint turns farther than this [rad], as near the wrist singularity it would, unless they are this
# near to each other [m].
FARTHEST_TURN, FINEST = np.radians(5.0), 20e-6
# Between the end of one run and the start of the next [m]: takes no time.
GAP = 1e-6
BATCH = 16_384
# Differences by the path length [m].
STEP = 1e-5


@dataclass(frozen=True, eq=False)
class Route:
    """Grid points (K) of the linear legs, one behind the other, and what the joints do there.

    leg (K,): target the point is on the way to. s (K,) [m]: path length; at a stop inside the program the point stands twice,
    as the end of one run and the start of the next, `GAP` apart. feed (K,) [m/s], inf where unknown, the slower one within a
    blend. theta (K, 6 + D) [rad, m]: the joints, then the external axes that the program drives (external_axes.py: driven);
    dtheta_ds [rad/m, 1] and d2theta_ds2 [rad/m^2, 1/m] (K, 6 + D): its derivatives by s. stop (K,): the robot stands still.
    lost (N,): legs along which no joint angles were found.
    """

    legs: Legs
    leg: Indices
    s: Array
    feed: Array
    theta: Array
    dtheta_ds: Array
    d2theta_ds2: Array
    stop: Flags
    lost: Flags


def joint_rates(path: RobotPath, theta: Array, targets: Indices, legs: Legs, leg: Indices, tangent: Array) -> Array:
    """Derivatives (n, 6 + D) [rad/m, 1] of the joint angles and driven axes by the path length at `targets` (n,), along the
    legs `leg` (n,) whose unit tangents there are the rows `leg` of tangent (N, 3), resting frame."""
    axes, each = path.axes, 1 / legs.length[leg, None]
    by_length = (axes.values[leg] - axes.values[legs.before[leg]]) * each
    rates = np.empty((len(targets), 6 + len(axes.driven)))
    rates[:, 6:] = si_values(axes.driven, by_length)
    ways = np.concatenate([tangent[leg], legs.turn[leg] * each], axis=1)
    if axes.moves:
        ways = _ways_of_base(path, theta, targets, leg, ways, by_length)
    for tool, places in path.each_tool(targets):
        for part in chunks(len(places), BATCH):
            here = places[part]
            matrix = jacobian(path.cell.robot, theta[targets[here]], tool, "drive") + 1e-12 * np.eye(6)
            rates[here, :6] = np.linalg.solve(matrix, ways[here, :, None])[:, :, 0]
    return rates


def _ways_of_base(path: RobotPath, theta: Array, targets: Indices, leg: Indices, ways: Array, by_length: Array) -> Array:
    """How the TCP moves and turns in the base frame (n, 6) [1, rad/m], where in the resting frame it does so by `ways` (n, 6),
    and the external axes by `by_length` (n, 6) [mm/m or deg/m]; differences in STEP on either side."""
    axes, carrier = path.axes, path.axes.carrier[leg]
    base_from_rest = axes.frames(axes.values[targets], carrier)
    flange = forward(path.cell.robot, theta[targets], Frame.identity())
    resting = base_from_rest.inverse() @ (flange @ path.flange_from_tcp[targets])
    ahead, behind = (axes.frames(axes.values[targets] + step * by_length, carrier) @ resting for step in (STEP, -STEP))
    carried = np.concatenate([ahead.position - behind.position,
                              rotation_vector(ahead.rotation @ np.swapaxes(behind.rotation, 1, 2))], axis=1) / (2 * STEP)
    return np.asarray(carried + np.concatenate([base_from_rest.turn(ways[:, :3]), base_from_rest.turn(ways[:, 3:])], axis=1))


def build_route(path: RobotPath, poses: Poses) -> Route:
    """The grid along all linear legs. Legs along which the robot finds no joint angles are left out and named."""
    lost = np.zeros(len(path.toolpath), dtype=bool)
    while True:
        route = _route(path, poses, build_legs(path, poses, lost), lost)
        broken = np.unique(route.leg[np.isnan(route.theta).any(axis=1)])
        if not len(broken):
            return route
        lost[broken] = True


def _route(path: RobotPath, poses: Poses, legs: Legs, lost: Flags) -> Route:
    count = len(legs.linear)
    feed = np.where(path.toolpath.feed > 0, path.toolpath.feed, np.inf)
    driven = np.flatnonzero(legs.linear)
    after = np.full(count, -1)
    after[legs.before[driven]] = driven
    both = np.minimum(feed, np.where(after >= 0, feed[after], np.inf))
    acceleration, jump, sharp = _demands(path, poses, legs, driven, after, np.minimum(both, 10.0))
    leg, d = _grid(legs, driven, after, np.minimum(feed, 10.0), acceleration, sharp)

    theta, position, blend = _joints(path, poses, legs, after, sharp, leg, d)
    while True:
        low = np.where(leg[1:] == leg[:-1], d[:-1], 0.0)
        turn = np.abs(np.diff(theta[:, :6], axis=0)).max(axis=1, initial=0.0)
        wide = np.flatnonzero((turn > FARTHEST_TURN) & (d[1:] - low > FINEST))
        if not len(wide):
            break
        more_leg, more_d = leg[wide + 1], 0.5 * (low + d[1:])[wide]
        more = _joints(path, poses, legs, after, sharp, more_leg, more_d)
        leg, d = np.insert(leg, wide + 1, more_leg), np.insert(d, wide + 1, more_d)
        theta, position, blend = (np.insert(old, wide + 1, new, axis=0)
                                  for old, new in zip((theta, position, blend), more, strict=True))
    stop = ((d == 0) | (d == legs.length[leg])) & np.where(d == 0, True, legs.stop[leg])
    ends = stop & (d > 0)
    # Path length: along the legs, in blends along the parabola.
    step = np.where(leg[1:] == leg[:-1], np.diff(d), d[1:])
    inside = (blend[1:] == blend[:-1]) & (blend[1:] >= 0)
    step[inside] = np.linalg.norm(np.diff(position, axis=0)[inside], axis=1)
    step[ends[:-1]] = GAP
    s = np.concatenate([[0.0], np.cumsum(step)]) if len(leg) else np.empty(0)
    corner = (d == legs.length[leg]) & ~stop
    # Within a blend the slower feed counts.
    shared = np.where(blend >= 0, blend, np.where(corner, leg, -1))
    bound = np.where(shared >= 0, both[shared], feed[leg])
    dtheta_ds, d2theta_ds2 = _derivatives(theta, s, ends)
    single = np.flatnonzero(corner & ~sharp[leg] & (legs.radius[leg] > 0))
    width = 0.5 * (s[single + 1] - s[single - 1])[:, None]
    d2theta_ds2[single] += jump[leg[single]] * (0.5 / legs.radius[leg[single]][:, None] - 1 / width)
    read_only(leg, s, bound, theta, dtheta_ds, d2theta_ds2, stop)
    return Route(legs, leg, s, bound, theta, dtheta_ds, d2theta_ds2, stop, lost)


def _joints(
    path: RobotPath, poses: Poses, legs: Legs, after: Indices, sharp: Flags, leg: Indices, d: Array
) -> tuple[Array, Array, Indices]:
    """Joint angles and driven axes (K, 6 + D) [rad, m] at grid points, NaN where the arm does not get to in the configuration
    it has at the ends of the leg; positions (K, 3) [m], resting frame; and the target (K,) in whose blend a point lies, -1
    outside."""
    robot, axes = path.cell.robot, path.axes
    resting = axes.to_rest(poses.base_from_tcp)
    theta, position = np.empty((len(leg), 6 + len(axes.driven))), np.empty((len(leg), 3))
    blend = np.zeros(len(leg), dtype=np.intp)
    # Which way the arm stands, front or back, folded up or down; the wrist may turn over, as that takes all its turn.
    arm = np.full(len(legs.linear), -1)
    known = np.flatnonzero(~np.isnan(poses.theta).any(axis=1))
    arm[known] = configuration(robot, poses.theta[known])[:, 3] // 2
    for part in chunks(len(leg), BATCH):
        pose, blend[part] = _pose(resting, legs, after, sharp, leg[part], d[part])
        here, start = leg[part], legs.before[leg[part]]
        position[part] = pose.position
        share = (d[part] / legs.length[here])[:, None]
        if axes.moves or axes.driven:
            values = _standing(axes.values, legs, after, here, d[part], blend[part])
            theta[part, 6:] = si_values(axes.driven, values)
            if axes.moves:
                pose = axes.frames(values, axes.carrier[here]) @ pose
        reference = (1 - share) * poses.theta[start] + share * poses.theta[here]
        tool = path.flange_from_tcp[here]
        solutions = inverse(robot, pose @ tool.inverse(), reference)
        branch = np.arange(BRANCHES) // 2
        same = (branch == arm[start][:, None]) | (branch == arm[here][:, None])
        theta[part, :6], _ = nearest_solution(robot, Solutions(solutions.theta, solutions.reachable & same), reference)
    return theta, position, blend


def _demands(
    path: RobotPath, poses: Poses, legs: Legs, driven: Indices, after: Indices, feed: Array
) -> tuple[Array, Array, Flags]:
    """How the joints move at the ends of the legs: TCP acceleration (N,) [m/s^2] that they allow on each leg, step (N, 6 + D)
    [rad/m, 1] of their rates in the corner at its end, and whether that corner must be resolved (N,) at this feed (N,)
    [m/s]."""
    limits, count = path.limits.acceleration, len(legs.linear)
    acceleration, jump, sharp = np.full(count, np.inf), np.zeros((count, len(limits))), np.zeros(count, dtype=bool)
    rate = joint_rates(path, poses.theta, driven, legs, driven, legs.last)
    with np.errstate(divide="ignore"):
        acceleration[driven] = np.min(limits / np.abs(rate), axis=1)
    jump[driven] = -rate
    rate = joint_rates(path, poses.theta, legs.before[driven], legs, driven, legs.first)
    with np.errstate(divide="ignore"):
        acceleration[driven] = np.minimum(acceleration[driven], np.min(limits / np.abs(rate), axis=1))
    jump[legs.before[driven]] += rate
    jump[~((legs.radius > 0) & (after >= 0)) | (path.toolpath.move == Move.ARC_VIA)] = 0.0
    flying = np.flatnonzero((legs.radius > 0) & (after >= 0))
    sharp[flying] = legs.corner[flying] > NEARLY_STRAIGHT
    sharp[flying] |= (np.abs(jump[flying]) * feed[flying, None] ** 2 > 2 * GENTLE * limits
                      * legs.radius[flying, None]).any(axis=1)
    return acceleration, jump, sharp


def _grid(legs: Legs, driven: Indices, after: Indices, feed: Array, acceleration: Array, sharp: Flags) -> tuple[Indices, Array]:
    """Grid points as leg (K,) and distance (K,) [m] from the leg's start, in order."""
    length = legs.length
    starts = driven[legs.stop[legs.before[driven]] | ~legs.linear[legs.before[driven]]]
    fixed = [(starts, np.zeros(len(starts))), (driven, length[driven])]
    turning = np.maximum(np.linalg.norm(legs.turn[driven], axis=1), legs.angle[driven])
    pieces = np.ceil(np.maximum(length[driven] / SPACING, turning / TURNING) - 1e-9).astype(np.intp)
    inner = np.repeat(driven, np.maximum(pieces - 1, 0))
    number = np.arange(len(inner)) - np.repeat(np.cumsum(np.maximum(pieces - 1, 0)) - np.maximum(pieces - 1, 0),
                                               np.maximum(pieces - 1, 0))
    loose = [(inner, (number + 1) / np.repeat(pieces, np.maximum(pieces - 1, 0)) * length[inner])]
    corners = np.flatnonzero(sharp)
    for share in BLEND:
        near = corners if share <= 0.5 else after[corners]
        d = legs.radius[corners] * (2 * share - 1)
        if share != 0.5:
            loose.append((near, length[corners] + d if share < 0.5 else d))
    # Ramps beside stops, corners and changes of feed.
    before, next_feed = legs.before[driven], feed[np.maximum(after, 0)]
    standing = legs.stop[before] | ~legs.linear[before] | sharp[before]
    at_start = np.where(standing, feed[driven] ** 2, np.abs(feed[driven] ** 2 - feed[before] ** 2)) / (2 * acceleration[driven])
    still = legs.stop[driven] | sharp[driven]
    at_end = np.where(still, feed[driven] ** 2, np.abs(feed[driven] ** 2 - next_feed[driven] ** 2)) / (2 * acceleration[driven])
    clear_start, clear_end = np.where(sharp[before], legs.radius[before], 0), np.where(sharp[driven], legs.radius[driven], 0)
    for share in RAMP:
        for ramp, clear, from_start in ((at_start, clear_start, True), (at_end, clear_end, False)):
            # Of a ramp of less than CLOSEST at least the end has to be there, or the whole interval counts as the ramp.
            d = clear + share * np.maximum(ramp, 10 * CLOSEST)
            wanted = (ramp > 0) & (d < length[driven])
            loose.append((driven[wanted], d[wanted] if from_start else (length[driven] - d)[wanted]))
    # A leg between two stops has at least its middle.
    short = driven[(legs.stop[driven]) & standing]
    loose.append((short, 0.5 * length[short]))
    leg = np.concatenate([item[0] for item in (*fixed, *loose)]).astype(np.intp)
    d = np.concatenate([item[1] for item in (*fixed, *loose)])
    is_fixed = np.arange(len(leg)) < len(starts) + len(driven)
    order = np.lexsort((d, leg))
    leg, d, is_fixed = leg[order], d[order], is_fixed[order]
    crowded = np.zeros(len(leg), dtype=bool)
    close = (np.diff(d) < CLOSEST) & (leg[1:] == leg[:-1])
    crowded[1:] |= close & ~is_fixed[1:]
    # Just behind a corner the point before is the corner itself, on the leg before; at the end of a leg stands the target.
    crowded |= ((d < CLOSEST) | (length[leg] - d < CLOSEST)) & ~is_fixed
    return leg[~crowded], d[~crowded]


def _on_leg(frame: Frame, legs: Legs, leg: Indices, d: Array) -> tuple[Frame, Array]:
    """Pose (n) and unit tangent (n, 3) on a leg, d (n,) [m] behind its start, corners not blended."""
    start = legs.before[leg]
    position = frame.position[start] + d[:, None] * legs.first[leg]
    tangent = legs.first[leg]
    arc = np.flatnonzero(legs.angle[leg] > 0)
    if len(arc):
        tangent = tangent.copy()
        on = leg[arc]
        radius = frame.position[start[arc]] - legs.centre[on]
        size = np.linalg.norm(radius, axis=1)
        angle = (d[arc] / size)[:, None]
        across = np.cross(legs.axis[on], radius)
        position[arc] = legs.centre[on] + np.cos(angle) * radius + np.sin(angle) * across
        tangent[arc] = (np.cos(angle) * across - np.sin(angle) * radius) / size[:, None]
    turned = rotation_matrix(legs.turn[leg] * (d / legs.length[leg])[:, None])
    return Frame(turned @ frame.rotation[start], position), tangent


def _pose(frame: Frame, legs: Legs, after: Indices, sharp: Flags, leg: Indices, d: Array) -> tuple[Frame, Indices]:
    """rest_from_tcp (n) at grid points, frame (N) being that of the targets, and the target (n,) in whose blend a point lies,
    -1 outside."""
    pose, _ = _on_leg(frame, legs, leg, d)
    start = legs.before[leg]
    behind = sharp[start] & (d <= legs.radius[start] + 1e-12)
    ahead = sharp[leg] & (d >= legs.length[leg] - legs.radius[leg] - 1e-12) & ~behind
    blend = np.where(behind, start, np.where(ahead, leg, -1))
    where = np.flatnonzero(blend >= 0)
    if not len(where):
        return pose, blend
    corner = blend[where]
    into, out, radius = corner, after[corner], legs.radius[corner]
    u = np.where(behind[where], d[where] + radius, d[where] - legs.length[into] + radius) / (2 * radius)
    first, first_tangent = _on_leg(frame, legs, into, legs.length[into] - radius)
    last, last_tangent = _on_leg(frame, legs, out, radius)
    reach = (2 / 3 * radius)[:, None]
    rate_in = legs.turn[into] / legs.length[into][:, None] * radius[:, None]
    rate_out = legs.turn[out] / legs.length[out][:, None] * radius[:, None]
    weights = np.stack([(1 - u) ** 3, 3 * u * (1 - u) ** 2, 3 * u**2 * (1 - u), u**3])[:, :, None]
    pose.position[where] = (weights[0] * first.position + weights[1] * (first.position + reach * first_tangent)
                            + weights[2] * (last.position - reach * last_tangent) + weights[3] * last.position)
    vector = -weights[0] * rate_in - weights[1] * rate_in / 3 + weights[2] * rate_out / 3 + weights[3] * rate_out
    pose.rotation[where] = rotation_matrix(vector) @ frame.rotation[corner]
    return pose, blend


def _standing(values: Array, legs: Legs, after: Indices, leg: Indices, d: Array, blend: Indices) -> Array:
    """Where the external axes stand (n, 6) [mm or deg] at grid points: in proportion to the way, in a blend rounded as the way
    is; values (N, 6) at the targets."""
    each = (values - values[legs.before]) / np.maximum(legs.length, 1e-12)[:, None]
    result = values[legs.before[leg]] + d[:, None] * each[leg]
    where = np.flatnonzero(blend >= 0)
    if len(where):
        corner = blend[where]
        radius = legs.radius[corner][:, None]
        behind = (leg[where] != corner)[:, None]
        u = np.where(behind, d[where, None] + radius, d[where, None] - legs.length[corner][:, None] + radius) / (2 * radius)
        result[where] = values[corner] - radius * ((1 - u) ** 2 * each[corner] - u**2 * each[after[corner]])
    return result


def _derivatives(theta: Array, s: Array, ends: Flags) -> tuple[Array, Array]:
    """First and second derivative (K, 6 + D) of theta by s through each three neighbours; at the ends of runs one-sided."""
    first_by_s, second_by_s = np.zeros_like(theta), np.zeros_like(theta)
    count = len(s)
    starts = np.append(True, ends[:-1]) if count else np.empty(0, dtype=bool)
    for part in chunks(count, BATCH):
        low, high = max(part.start - 1, 0), min(part.stop + 1, count)
        h = np.diff(s[low:high])[:, None]
        m = np.diff(theta[low:high], axis=0) / h
        here = np.arange(part.start, part.stop)
        left, right = np.maximum(here - 1, low) - low, np.minimum(here, high - 2) - low
        first, last = starts[here], ends[here]
        h_left, h_right, m_left, m_right = h[left], h[right], m[left], m[right]
        first_by_s[part] = (m_left * h_right + m_right * h_left) / (h_left + h_right)
        second_by_s[part] = 2 * (m_right - m_left) / (h_left + h_right)
        first_by_s[here[first]], first_by_s[here[last]] = m_right[first], m_left[last]
        second_by_s[here[first | last]] = 0.0
    return first_by_s, second_by_s

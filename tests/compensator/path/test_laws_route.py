"""The grid along a path, by forward kinematics of its own angles: lines, parabolas in corners, the turn of the tool with the
way, and the derivatives of the joints."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from compensator.path.legs import Poses
from compensator.path.robot_path import RobotPath
from compensator.path.route import Route, build_route
from compensator.path.timing import joint_move_time
from identification.model.kinematics import forward
from identification.model.rotations import Frame, rotation_matrix
from tests.compensator.path.test_laws_timing import DOWN, program, target, trapezoid
from tests.support import robot


def turning(tmp_path: Path, points: list[list[float]], turns: list[float], zone: str, speed: str = "v200") -> RobotPath:
    """Straight moves to points [mm], the tool turned about the vertical by so many degrees there."""
    at = [target(np.array(point), rotation_matrix(np.radians([0, 0, turn])) @ DOWN)
          for point, turn in zip(points, turns, strict=True)]
    return program(tmp_path, [f"Move{'L' if k else 'J'} {one},{speed},{zone},tSpindle;" for k, one in enumerate(at)])


def driven(path: RobotPath) -> tuple[Route, np.ndarray, np.ndarray]:
    """The grid, and by forward kinematics where the tool is there (K, 3) [mm] and how it is turned (K,) [degrees]."""
    route = build_route(path, Poses(path.base_from_tcp, path.theta))
    pose = forward(robot(), route.theta, Frame.identity()) @ path.flange_from_tcp[0]
    turn = pose.rotation @ DOWN.T
    np.testing.assert_allclose(turn[:, 2, 2], 1, atol=1e-9)
    return route, 1e3 * pose.position, np.degrees(np.arctan2(turn[:, 1, 0], turn[:, 0, 0]))


POINTS = [[1100, 0, 700], [1150, 0, 700], [1150, 50, 700], [1120, 50, 740], [1120, 20, 740]]
TURNS = [0, 10, -5, -5, 12]


@pytest.mark.parametrize(("zone", "radius"), [("z5", 5.0), ("z20", 15.0), ("z0", 0.3)])
def test_corners_are_parabolas_and_the_tool_turns_with_the_way(tmp_path: Path, zone: str, radius: float) -> None:
    """From the zone before the corner, x along the leg, to the zone behind it, y: sqrt(x) + sqrt(y) = sqrt(radius), of 20 mm as
    much as half of the shorter leg of 30. At a point that lies x before and y behind its corner the tool is turned by so much
    of both legs' turns, on the legs themselves as well."""
    route, position, turn = driven(turning(tmp_path, POINTS, TURNS, zone))
    corner = np.array(POINTS, dtype=float)
    length = np.linalg.norm(np.diff(corner, axis=0), axis=1)
    way = np.diff(corner, axis=0) / length[:, None]
    rate = np.diff(TURNS) / length
    zones = [min(20.0 if zone == "z20" else radius, length[k] / 2, length[k + 1] / 2) for k in range(3)]
    inside = np.zeros(3, dtype=int)
    for point, angle in zip(position, turn, strict=True):
        near = []
        for k, size in enumerate(zones):
            (x, y), left, *_ = np.linalg.lstsq(np.column_stack([-way[k], way[k + 1]]), point - corner[k + 1], rcond=None)
            if min(x, y) >= -1e-6 and max(x, y) <= size + 1e-6 and left < 1e-12:
                near.append(k)
                assert np.sqrt(max(x, 0)) + np.sqrt(max(y, 0)) == pytest.approx(np.sqrt(size), abs=2e-3)
                assert angle == pytest.approx(TURNS[k + 1] - rate[k] * x + rate[k + 1] * y, abs=1e-6)
        inside[near] += 1
        if near:
            continue
        along = np.einsum("ni,ni->n", way, point - corner[:-1])
        off = np.linalg.norm(point - corner[:-1] - along[:, None] * way, axis=1)
        [leg] = np.flatnonzero((off < 1e-6) & (along > -1e-6) & (along < length + 1e-6))
        assert angle == pytest.approx(TURNS[leg] + rate[leg] * along[leg], abs=1e-6)
    assert (inside >= 13).all()
    # Lengths are those of the way from point to point; it stands still at its ends alone.
    np.testing.assert_allclose(1e3 * np.diff(route.s), np.linalg.norm(np.diff(position, axis=0), axis=1), atol=1e-6)
    assert np.flatnonzero(route.stop).tolist() == [0, len(route.s) - 1]


def test_a_slight_corner_is_one_point_with_the_curvature_of_its_parabola(tmp_path: Path) -> None:
    """By 4 degrees at 10 mm/s: the joints' rates change over twice the zone, whatever stands next to it on the grid, and as
    they do along both lines."""
    bend = np.radians(4)
    points = [[1100, 0, 700], [1150, 0, 700], [1150 + 50 * np.cos(bend), 50 * np.sin(bend), 700]]
    path = turning(tmp_path, points, [0, 0, 0], "z5", "v10")
    route, position, _ = driven(path)
    [at] = np.flatnonzero(np.linalg.norm(position - points[1], axis=1) < 1e-6)
    rates, curvatures = [], []
    for way in (np.subtract(points[0], points[1]) / 50, np.subtract(points[2], points[1]) / 50):
        near = [list(np.array(points[1]) + 2.0 * step * way) for step in range(3)]
        here, one, two = turning(tmp_path, near, [0, 0, 0], "fine").theta
        rates.append((-3 * here + 4 * one - two) / 4e-3)
        curvatures.append((here - 2 * one + two) / 2e-3**2)
    # rates[0] is against the way.
    expected = (rates[1] + rates[0]) / (2 * 5e-3) + (curvatures[0] + curvatures[1]) / 2
    np.testing.assert_allclose(route.d2theta_ds2[at], expected, rtol=0.02, atol=0.02)


@pytest.mark.parametrize(("degrees", "share", "resolved"), [
    (4.0, 0.22, False), (4.0, 0.28, True), (9.5, 0.05, False), (10.5, 0.05, True)])
def test_a_corner_is_looked_at_closely_beyond_ten_degrees_or_a_quarter_of_an_acceleration(
    tmp_path: Path, degrees: float, share: float, resolved: bool
) -> None:
    """What a joint needs of its acceleration to change its rate by the corner's step over twice the zone, at the feed."""
    bend, corner = np.radians(degrees), np.array([1150.0, 0, 700])
    ways = [np.array([1.0, 0, 0]), np.array([np.cos(bend), np.sin(bend), 0])]
    steps = []
    for way in ways:
        behind, ahead = turning(tmp_path, [list(corner - 0.5 * way), list(corner + 0.5 * way)], [0, 0], "fine").theta
        steps.append((ahead - behind) / 1e-3)
    jump = np.abs(steps[1] - steps[0])
    feed = np.sqrt(share * 2 * 5e-3 * np.min(robot().acceleration / jump))
    points = [list(corner - 50 * ways[0]), list(corner), list(corner + 50 * ways[1])]
    _, position, _ = driven(turning(tmp_path, points, [0, 0, 0], "z5", f"[{1e3 * feed:.6f},500,5000,1000]"))
    near = np.linalg.norm(position - corner, axis=1) < 4.9
    assert (near.sum() >= 9) if resolved else (near.sum() == 1)


@pytest.mark.parametrize("zone", ["z5", "fine"])
def test_the_derivatives_add_up_to_the_joints_angles(tmp_path: Path, zone: str) -> None:
    """By the trapezoidal rule from stop to stop: the first to the angles, the second to the first."""
    path = turning(tmp_path, POINTS, TURNS, zone)
    route, _, _ = driven(path)
    ends = np.flatnonzero(route.stop)
    runs = ends.reshape(-1, 2)
    assert len(runs) == (1 if zone == "z5" else 4)
    for first, last in runs:
        part = slice(first, last + 1)
        s, theta, rate, change = route.s[part], route.theta[part], route.dtheta_ds[part], route.d2theta_ds2[part]
        step = np.diff(s)[:, None]
        summed = np.cumsum(0.5 * (rate[1:] + rate[:-1]) * step, axis=0)
        scale = np.abs(rate).max() * (s[-1] - s[0])
        np.testing.assert_allclose(summed, theta[1:] - theta[0], atol=2e-3 * scale)
        inner = slice(1, -1)
        summed = np.cumsum(0.5 * (change[inner][1:] + change[inner][:-1]) * step[1:-1], axis=0)
        np.testing.assert_allclose(summed, rate[inner][1:] - rate[1], atol=0.03 * np.abs(rate).max())
        np.testing.assert_array_equal(change[[0, -1]], 0)


def test_an_arc_is_looked_at_every_three_degrees_and_the_tool_turns_with_the_way(tmp_path: Path) -> None:
    """Behind a line, by 60 and by 40 degrees about a centre, with 12 and 4 degrees of the tool; in one plane that leans."""
    plane = rotation_matrix(np.radians([20.0, -15.0, 0]))
    at = [np.array([1150.0, 0, 700]) + plane @ point for point in (
        [30.0, -20, 0], *([30 * np.cos(angle), 30 * np.sin(angle), 0] for angle in np.radians([0, 60, 100])))]
    turns = [0, 5, 17, 21]
    poses = [target(point, rotation_matrix(np.radians([0, 0, turn])) @ DOWN) for point, turn in zip(at, turns, strict=True)]
    path = program(tmp_path, [f"MoveJ {poses[0]},v200,z5,tSpindle;", f"MoveL {poses[1]},v200,fine,tSpindle;",
                              f"MoveC {poses[2]},{poses[3]},v200,fine,tSpindle;"])
    route, position, turn = driven(path)
    local = (position - [1150, 0, 700]) @ plane
    np.testing.assert_allclose(local[:, 2], 0, atol=1e-6)
    angle = np.degrees(np.arctan2(local[:, 1], local[:, 0]))
    line = route.leg == 1
    np.testing.assert_allclose(local[line, 0], 30, atol=1e-6)
    np.testing.assert_allclose(turn[line], 5 + local[line, 1] / 4, atol=1e-6)
    arc = ~line
    np.testing.assert_allclose(np.hypot(local[arc, 0], local[arc, 1]), 30, atol=1e-6)
    np.testing.assert_allclose(turn[arc], np.where(angle[arc] <= 60, 5 + 12 * angle[arc] / 60, 17 + 4 * (angle[arc] - 60) / 40),
                               atol=1e-6)
    assert angle[arc][0] == pytest.approx(0, abs=1e-6)
    assert (np.diff(angle[arc]) > 0).all()
    assert np.diff(angle[arc]).max() < 3 + 1e-6
    assert np.diff(angle[arc]).max() > 2.5
    assert set(route.leg[arc][angle[arc] < 59.9]) == {2}
    assert set(route.leg[arc][angle[arc] > 60.1]) == {3}
    for leg, first, last in ((2, 0, 60), (3, 60, 100)):
        for tangent, at_angle in ((route.legs.first, first), (route.legs.last, last)):
            way = np.array([-np.sin(np.radians(at_angle)), np.cos(np.radians(at_angle)), 0])
            np.testing.assert_allclose(tangent[leg] @ plane, way, atol=1e-6)
        assert 1e3 * route.legs.length[leg] == pytest.approx(30 * np.radians(last - first), abs=1e-6)
    np.testing.assert_allclose(1e3 * (route.s[arc] - route.s[arc][0]), 30 * np.radians(angle[arc]), atol=1e-6)


@pytest.mark.parametrize("zone", ["fine", "z5"])
def test_where_the_wrist_turns_fast_it_is_looked_at_more_closely(tmp_path: Path, zone: str) -> None:
    """Towards the singularity and away from it again on another leg: no joint by over five degrees from point to point, all of
    them on the lines and in their order."""
    across, aside = np.array([-4.0, 0.0, 4.0]), 0.3
    turn = np.degrees(np.arctan2(across, aside))
    angles = np.column_stack([np.zeros(3), np.full(3, 10), np.full(3, 20), turn, np.hypot(across, aside), -turn])
    tip = forward(robot(), np.radians(angles), Frame.identity()) @ Frame(np.eye(3), np.array([0.12, 0, 0.25]))
    path = program(tmp_path, [f"Move{'L' if k else 'J'} {target(1e3 * tip.position[k], tip.rotation[k])},v5,{zone},tSpindle;"
                              for k in range(3)])
    route = build_route(path, Poses(path.base_from_tcp, path.theta))
    assert set(route.leg) == {1, 2}
    position = (forward(robot(), route.theta, Frame.identity()) @ path.flange_from_tcp[0]).position
    turned = np.abs(np.diff(route.theta, axis=0)).max(axis=1)
    step = np.linalg.norm(np.diff(position, axis=0), axis=1)
    assert np.degrees(np.abs(np.diff(path.theta, axis=0)).max(axis=1)).min() > 80
    assert (np.degrees(turned[step > 20e-6]) <= 5).all()
    assert (np.diff(route.leg) >= 0).all()
    for leg in (1, 2):
        here, ends = position[route.leg == leg], path.base_from_tcp.position[leg - 1:leg + 1]
        length = np.linalg.norm(ends[1] - ends[0])
        along = (here - ends[0]) @ (ends[1] - ends[0]) / length
        assert (np.diff(along) > 0).all()
        assert along[-1] == pytest.approx(length, abs=1e-8)
        assert (along[0] == pytest.approx(0, abs=1e-8)) == (zone == "fine" or leg == 1)
        np.testing.assert_allclose(np.linalg.norm(here - ends[0], axis=1), along, atol=1e-8)
        np.testing.assert_allclose(np.diff(route.s[route.leg == leg]), np.diff(along), atol=1e-8)


def test_ramps_are_looked_at_from_a_quarter_of_them_to_beyond_their_end(tmp_path: Path) -> None:
    """From rest to 20 mm/s, on to 80, down to 50, to rest: each as long as the joint of the least acceleration along the path
    needs, which is one that turns the tool; beside them every centimetre alone. The feed of a corner is the slower one."""
    corner, turns, feeds = np.array([[1100.0 + 45 * k, 0, 700] for k in range(4)]), np.array([0.0, 6, 0, 7]), [20.0, 80.0, 50.0]
    path = turning(tmp_path, corner.tolist(), turns.tolist(), "z20", "v5")
    feed = np.array([5.0, *feeds])
    path = replace(path, toolpath=replace(path.toolpath, feed=1e-3 * feed))
    route, position, _ = driven(path)
    expected = [0.0]
    for k, (slower, own, faster) in enumerate(((0, 20, 80), (20, 80, 50), (80, 50, 0))):
        push = np.inf
        for share in (0.5 / 45, 1 - 0.5 / 45):
            near = [share - 0.5 / 45, share + 0.5 / 45]
            behind, ahead = turning(tmp_path, [(corner[k] + one * (corner[k + 1] - corner[k])).tolist() for one in near],
                                    [turns[k] + one * (turns[k + 1] - turns[k]) for one in near], "fine").theta
            push = min(push, np.min(robot().acceleration / (np.abs(ahead - behind) / 1e-3)))
        shares = np.array([0.25, 0.5, 0.75, 0.9, 1.0, 1.1, 1.3])
        ramps = [1e-3 * abs(own**2 - other**2) / (2 * push) for other in (slower, faster)]
        expected += [*(45 * k + ramps[0] * shares), *(45 * (k + 1) - ramps[1] * shares)]
        expected += [45 * k + 9 * step for step in range(1, 6)]
    along = position[:, 0] - 1100
    np.testing.assert_allclose(along, np.sort(expected), atol=5e-3)
    np.testing.assert_allclose(1e3 * route.feed, np.where(along < 45 + 1e-6, 20, np.where(along < 90 - 1e-6, 80, 50)))


@pytest.mark.parametrize(("length", "feed"), [(0.4, 0.2), (0.4, np.nan), (0.4, 0.0), (0.0, 0.2), (0.05, 5.0), (0.4, 3.0)])
def test_a_joint_move_goes_no_faster_on_average_than_its_feed(length: float, feed: float) -> None:
    """As a share of the move: the slowest joint's trapezoid, its highest rate no more than feed over length where both are
    known. All axes in step."""
    model, step = robot(), np.radians([[30.0, -20, 10, 0, 5, 90]])
    rate, push = (float(np.min(limit[np.abs(step[0]) > 0] / np.abs(step[0][np.abs(step[0]) > 0])))
                  for limit in (model.speed, model.acceleration))
    if length > 0 and feed > 0:
        rate = min(rate, feed / length)
    found = joint_move_time(model, step, np.array([length]), np.array([feed]))
    np.testing.assert_allclose(found, trapezoid(1.0, rate, push), rtol=1e-9)

"""Which runs are admissible: held against an arm that shares no code, just within each limit and just beyond."""

from __future__ import annotations

from dataclasses import replace
from itertools import product
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose

from identification.common.findings import CompstiffError
from identification.design.constraints import Margins
from identification.design.domain import NO_SIGNAL, Domain, Pool, random_pool
from identification.design.information import instrument
from identification.design.loads import slot
from identification.design.posture import least_turned, reaching_back
from identification.model.cell import read_cell
from tests.support import random_poses, write_cell
from tests.virtual_cell.arm import ARMS, Arm

RODDED, SERIAL = "irb6660-205-1.90", "irb6700-200-2.60"
TCP = np.array([0.11, -0.02, 0.26])
FORCE = 300.0
# As wide as can be.
OPEN = Margins(phi=None, joint=-10.0, wrist=0.0, elbow=0.0, shoulder=1e-9, range=np.inf, signal=NO_SIGNAL)
EVERYWHERE = np.array([[-9.0] * 3, [9.0] * 3])
JUST = 1e-6


@pytest.fixture(scope="module", params=[RODDED, SERIAL])
def case(request, tmp_path_factory) -> tuple[Domain, Arm, np.ndarray]:
    """The domain without any limit, its arm, and poses of all kinds."""
    cell = read_cell(write_cell(tmp_path_factory.mktemp("domain"), f"""\
robot: {request.param}
tool: {{position_mm: [110, -20, 260]}}
measurement: {{deflection_std_um: [2, 3, 7]}}
"""))
    slots = (slot("xyz", "cycle", FORCE), slot("free", "cycle", FORCE))
    theta = random_poses(cell.robot, 14, np.random.default_rng(5), 0.9)
    return Domain(instrument(cell), slots, None, EVERYWHERE, OPEN), ARMS[request.param], theta


def run_of(domain: Domain, theta: np.ndarray, number: int = 0, line: tuple[float, ...] = (1.0, 0.0, 0.0)) -> Pool:
    return domain.runs(theta[None], np.array([number]), np.zeros(1, dtype=int), np.array([line]))


def fits(domain: Domain, theta: np.ndarray, *which: Any, **named: Any) -> bool:
    """With these margins, a box or a cell's window, and no other limit."""
    if reach := named.pop("reach", None):
        domain = replace(domain, rig=replace(domain.rig, cell=replace(domain.rig.cell, reach=reach)))
    here = replace(domain, box=named.pop("box", domain.box), margins=replace(OPEN, **named))
    return bool(here.excess(run_of(here, theta, *which))[0] <= 0)


def angle(one: np.ndarray, other: np.ndarray) -> float:
    return float(np.arccos(one @ other / np.linalg.norm(one) / np.linalg.norm(other)))


def points(arm: Arm, q: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """TCP, middle of the flange, and wrist's centre [m]."""
    tcp, flange, wrist = (arm.pose(q, at)[0] for at in (TCP, np.zeros(3), np.array([0, 0, -arm.flange])))
    return tcp, flange, wrist


def deflections(domain: Domain, arm: Arm, q: np.ndarray, forces: np.ndarray) -> np.ndarray:
    """(A, 3) [m] under forces (A, 3) [N], to first order."""
    step = 1e-6 * np.eye(6)
    columns = np.array([arm.pose(q + one, TCP)[0] - arm.pose(q - one, TCP)[0] for one in step]).T / 2e-6
    return np.array([columns @ (domain.rig.compliance * (columns.T @ force)) for force in forces])


def test_without_limits_every_pose_fits(case) -> None:
    domain, _, theta = case
    assert all(fits(domain, q) for q in theta)


def test_a_pose_keeps_away_from_every_singularity_by_its_margin(case) -> None:
    """The wrist by axis 5 from where 4 and 6 are in line, either way; the elbow by the angle between the arm's links; the
    shoulder by the wrist's centre's distance from axis 1."""
    domain, arm, theta = case
    for q in theta:
        away = {"wrist": abs(np.arcsin(np.sin(q[4]))), "shoulder": np.hypot(*points(arm, q)[2][:2])}
        lift = q[2] if arm.parallel_rod else q[1] + q[2]
        upper = np.array([np.sin(q[1]), np.cos(q[1])])
        forearm = np.array([arm.forearm * np.cos(lift) + arm.elbow * np.sin(lift),
                            arm.elbow * np.cos(lift) - arm.forearm * np.sin(lift)])
        away["elbow"] = np.arcsin(np.sin(angle(upper, forearm)))
        for name, margin in away.items():
            assert fits(domain, q, **{name: margin * (1 - JUST)}), name
            assert not fits(domain, q, **{name: margin * (1 + JUST)}), name


def test_a_pose_keeps_away_from_every_joint_s_end_and_the_rod_s(case) -> None:
    domain, arm, theta = case
    low, high = domain.rig.cell.robot.limits.T
    ends = []
    for q in theta:
        away = np.r_[q - low, high - q]
        if arm.parallel_rod:
            _, least, most = domain.rig.cell.robot.window
            away = np.r_[away, q[2] - q[1] - least, most - q[2] + q[1]]
        ends.append(int(away.argmin()))
        assert fits(domain, q, joint=away.min() - JUST)
        assert not fits(domain, q, joint=away.min() + JUST)
    assert len(set(ends)) > 4
    assert {12, 13} <= set(ends) or not arm.parallel_rod


def test_the_cell_s_windows_of_the_joints_are_without_margin(case) -> None:
    domain, _, theta = case
    q = theta[0]
    for joint, (side, sign) in product(range(6), enumerate((1.0, -1.0))):
        for beyond in (-JUST, JUST):
            window = np.tile([-np.inf, np.inf], (6, 1))
            window[joint, side] = q[joint] + sign * beyond
            here = replace(domain, rig=replace(domain.rig, cell=replace(domain.rig.cell, joint_window=window)))
            assert fits(here, q, joint=np.radians(0.1)) == (beyond < 0), (joint, side)


def test_the_tool_points_outwards_by_its_window_and_stays_in_reach(case) -> None:
    """phi as seen from above; reach from axis 1, both ends."""
    domain, arm, theta = case
    for q in theta:
        tcp, flange, _ = points(arm, q)
        phi = angle(tcp[:2], tcp[:2] - flange[:2])
        assert fits(domain, q, phi=phi + 1e-5)
        assert not fits(domain, q, phi=phi - 1e-5)
        away = np.hypot(*tcp[:2])
        for reach, inside in (((away * (1 - JUST), 9.0), True), ((away * (1 + JUST), 9.0), False),
                              ((1e-3, away * (1 + JUST)), True), ((1e-3, away * (1 - JUST)), False)):
            assert fits(domain, q, reach=reach) == inside


def test_the_box_holds_the_tcp_on_every_side(case) -> None:
    domain, arm, theta = case
    tcp = points(arm, theta[1])[0]
    for axis, (side, sign) in product(range(3), enumerate((-1.0, 1.0))):
        for beyond in (-JUST, JUST):
            box = EVERYWHERE.copy()
            box[side, axis] = tcp[axis] - sign * beyond
            assert fits(domain, theta[1], box=box) == (beyond < 0)


@pytest.mark.parametrize("line", [None, (0.6, 0.0, -0.8), (0.0, 1.0, 0.0)])
def test_what_a_load_deflects_is_in_range_and_above_the_noise(case, line) -> None:
    """Of each loaded axis: the largest part within the sensors' range, the smallest many sigmas of the sensors along it."""
    domain, arm, theta = case
    which = () if line is None else (1, line)
    for q in theta:
        moved = deflections(domain, arm, q, FORCE * (np.eye(3) if line is None else np.array([line])))
        most, least = np.abs(moved).max(), np.linalg.norm(moved / [2e-6, 3e-6, 7e-6], axis=1).min()
        assert fits(domain, q, *which, range=most * (1 + JUST))
        assert not fits(domain, q, *which, range=most * (1 - JUST))
        assert fits(domain, q, *which, signal=least * (1 - JUST))
        assert not fits(domain, q, *which, signal=least * (1 + JUST))


def test_a_run_belongs_at_its_own_place(case) -> None:
    """By the largest of its three distances."""
    domain, arm, theta = case
    first, second = (points(arm, q)[0] for q in theta[:2])
    off = np.array([[1e-3, -2e-3, 5e-4], [0, 0, 0], [0, 0, -3e-3]])
    here = replace(domain, box=None, positions=np.array([first, second, second]) + off)
    assert (here.places, domain.places) == (3, 1)
    runs = here.runs(theta[[0, 1, 1]], np.zeros(3, dtype=int), np.arange(3), np.tile([1.0, 0, 0], (3, 1)))
    assert_allclose(here.excess(runs), [2e-3, 0, 3e-3], atol=1e-12)


def test_a_pose_is_put_in_place_by_the_least_motion_of_the_joints(case) -> None:
    domain, arm, theta = case
    position = np.array([points(arm, q)[0] for q in theta])
    here = replace(domain, box=None, positions=np.add(position, (2e-5, -1e-5, 3e-5)))
    moved = here.centred(theta, np.arange(len(theta)))
    for q, after, wanted in zip(theta, moved, here.positions, strict=True):
        assert_allclose(arm.pose(after, TCP)[0], wanted, atol=1e-10)
        columns = np.array([arm.pose(q + one, TCP)[0] - arm.pose(q - one, TCP)[0] for one in 1e-6 * np.eye(6)]).T / 2e-6
        least = np.linalg.pinv(columns) @ [2e-5, -1e-5, 3e-5]
        assert_allclose(after - q, least, atol=0.02 * np.abs(least).max())
    assert domain.centred(theta, np.zeros(len(theta), dtype=int)) is theta


def test_a_wrist_s_pose_is_behind_axis_1_as_it_is_turned(case) -> None:
    domain, arm, _ = case
    theta = random_poses(domain.rig.cell.robot, 80, np.random.default_rng(6))
    behind = [points(arm, q)[2][:2] @ [np.cos(q[0]), np.sin(q[0])] < 0 for q in theta]
    assert any(behind) != arm.parallel_rod
    assert reaching_back(domain, theta).tolist() == behind


def test_no_way_to_hold_the_tool_turns_the_wrist_less(case) -> None:
    """Of all that are whole and half turns of axes 4 and 6 away, axis 5 as it is or to the other side, within limits."""
    domain, arm, theta = case
    here = replace(domain, margins=Margins())
    low, high = here.limits.T
    found = least_turned(here, theta)
    ways = [(np.pi * np.array([0, 0, 0, fourth, 0, sixth]), side)
            for fourth, sixth, side in product(range(-4, 5), range(-4, 5), (1, -1))]
    for q, chosen in zip(theta, found, strict=True):
        others = np.array([q * [1, 1, 1, 1, side, 1] + turned for turned, side in ways])
        position, flange = arm.pose(others, TCP)
        there, held = arm.pose(q, TCP)
        same = (np.abs(position - there).max(axis=1) < 1e-9) & ((flange * held.inv()).magnitude() < 1e-6)
        inside = ((others >= low) & (others <= high)).all(axis=1)
        least = np.abs(others[same & inside][:, [3, 5]]).sum(axis=1).min(initial=np.abs(q[[3, 5]]).sum())
        assert np.abs(chosen[[3, 5]]).sum() == pytest.approx(least)


@pytest.fixture(scope="module")
def narrow(tmp_path_factory) -> Domain:
    """Two places, two loads, one of them along a line of its own."""
    text = f"robot: {SERIAL}\ntool: {{position_mm: [110, -20, 260]}}\n"
    cell = read_cell(write_cell(tmp_path_factory.mktemp("narrow"), text))
    return Domain(instrument(cell), (slot("z", "cycle", FORCE), slot("free", "cycle", FORCE)),
                  np.array([[1.6, 0.0, 0.9], [1.5, 0.4, 1.2]]))


def test_a_pool_holds_every_admissible_pose_with_every_load(narrow) -> None:
    """So many poses as are asked for before what does not fit is left out, at all places; lines of length one all round."""
    pool = random_pool(replace(narrow, margins=replace(OPEN, joint=0.0)), 300, np.random.default_rng(1))
    robot = narrow.rig.cell.robot
    assert np.bincount(pool.slot).tolist() == [300, 300]
    assert_allclose(pool.theta[:300], pool.theta[300:])
    assert_allclose(pool.line[:300], np.tile([1.0, 0, 0], (300, 1)))
    assert_allclose(np.linalg.norm(pool.line[300:], axis=1), 1.0)
    assert np.abs(pool.line[300:].mean(axis=0)).max() < 0.15
    assert np.bincount(pool.place).min() > 200
    assert (robot.limit_excess(pool.theta) == 0).all()
    tcp = ARMS[SERIAL].pose(pool.theta, TCP)[0]
    assert_allclose(tcp, narrow.positions[pool.place], atol=1e-9)
    fitting = random_pool(narrow, 300, np.random.default_rng(1))
    assert (narrow.excess(fitting) <= 1e-9).all()
    good = (narrow.excess(pool) <= 1e-9)[:300]
    assert 20 < good.sum() < 280
    assert_allclose(fitting.theta[: good.sum()], pool.theta[:300][good])


@pytest.mark.parametrize(("change", "words", "hint"), [
    ({"place": 9.0}, "at none of 16000 random tool orientations is the wanted place in reach and inside the joint limits",
     "move"),
    ({"reach": (0.1, 0.2)}, "of 150 random poses at the wanted place, in reach and inside the joint limits, none is inside the "
     "windows (of the orientation, reach_mm, the parallel rod's) and away from singularities", "move"),
    ({"signal": 1e6}, "at {n} random poses at the wanted place it deflects the robot by less than 1e+06 sigmas of the sensors "
     "({n}) or by more than 5 mm (0)", "larger"),
    ({"range": 1e-9}, "at {n} random poses at the wanted place it deflects the robot by less than 10 sigmas of the sensors "
     "(0) or by more than 1e-06 mm ({n})", "smaller"),
    ({"range": 1e-9, "signal": 1e6}, "at {n} random poses at the wanted place it deflects the robot by less than 1e+06 sigmas "
     "of the sensors ({n}) or by more than 1e-06 mm ({n})", "larger")])
def test_what_is_in_the_way_of_every_run_is_said(narrow, change, words, hint) -> None:
    """What was looked at, in numbers; and whether to push harder, or less, or to move the place."""
    standing = len(random_pool(replace(narrow, margins=replace(narrow.margins, range=np.inf, signal=NO_SIGNAL)), 150,
                               np.random.default_rng(2))) // 2
    assert 0 < standing < 150
    place, reach = change.pop("place", 0.0), change.pop("reach", None)
    here = replace(narrow, positions=narrow.positions + place, margins=replace(narrow.margins, **change),
                   rig=replace(narrow.rig, cell=replace(narrow.rig.cell, reach=reach)))
    # Forty draws of as many as are asked for are given up.
    with pytest.raises(CompstiffError) as told:
        random_pool(here, 400 if place else 150, np.random.default_rng(2))
    (finding,) = told.value.findings
    assert (finding.code, finding.file) == ("CS1601", str(here.rig.cell.source))
    assert finding.message == f"no run with a load along z is admissible: {words.format(n=standing)}"
    assert (finding.hint or "").startswith({
        "move": "move the place with --position, widen --phi, or check tool and design",
        "larger": "plan with a larger load", "smaller": "plan with a smaller load"}[hint])

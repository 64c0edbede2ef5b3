"""The fastest run: closed forms, limits that are kept, windows that change nothing, what is said where the feed is not held."""

from __future__ import annotations

import dataclasses
import json
import re
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose

from compensator.correction.correct import Corrected
from compensator.correction.files import Inputs
from compensator.path import timing
from compensator.path.feasibility import check_feed, judge
from compensator.path.legs import Poses, build_legs
from compensator.path.robot_path import RobotPath, robot_path
from compensator.path.route import build_route
from compensator.path.timing import _braking, drive, joint_move_time
from compensator.rapid import read_rapid
from identification.common.findings import Refused
from identification.model.cell import read_cell
from identification.model.robot import RobotModel
from identification.model.rotations import matrix_to_quaternion, quaternion_to_matrix, rotation_matrix
from tests.support import compstiff, robot

DOWN = quaternion_to_matrix([0.02522428, -0.00054983, -0.99944426, 0.02178562])
RADIUS = 1.2


def program(folder: Path, moves: list[str], model: RobotModel | None = None) -> RobotPath:
    (folder / "cell.yaml").write_text("robot: irb6660-205-1.90\ntool: {position_mm: [120, 0, 250]}\n")
    cell = read_cell(folder / "cell.yaml")
    if model is not None:
        cell = dataclasses.replace(cell, robot=model)
    text = "MODULE M\nPROC main()\n" + "\n".join(moves) + "\nENDPROC\nENDMODULE\n"
    return robot_path(read_rapid(text.encode(), "m.mod").toolpath, cell)


def target(position_mm: np.ndarray, rotation: np.ndarray = DOWN) -> str:
    numbers = ",".join(f"{x:.9f}" for x in position_mm)
    quaternion = ",".join(f"{x:.12f}" for x in matrix_to_quaternion(rotation))
    return f"[[{numbers}],[{quaternion}],[-1,-1,-1,0],[9E9,9E9,9E9,9E9,9E9,9E9]]"


def lines(points_mm: list[list[float]], speed: str, zone: str) -> list[str]:
    return [f"Move{'L' if i else 'J'} {target(np.array(p))},{speed},{zone},tSpindle;" for i, p in enumerate(points_mm)]


def swing(feed_mm_s: float, degrees: float = 60.0) -> list[str]:
    """The tool carried about axis 1 on a circle, its orientation with it: joint 1 alone moves."""
    def at(angle: float) -> str:
        turn = rotation_matrix(np.radians([0, 0, angle]))
        return target(1e3 * turn @ [RADIUS, 0, 0.7], turn @ DOWN)
    return [f"MoveJ {at(0)},v100,fine,tSpindle;",
            f"MoveC {at(degrees / 3)},{at(degrees)},[{feed_mm_s},500,5000,1000],fine,tSpindle;"]


def trapezoid(distance: float, speed: float, push: float) -> float:
    return distance / speed + speed / push if speed**2 < distance * push else 2 * np.sqrt(distance / push)


@pytest.mark.parametrize("feed", [0.05, 0.5, 1.5, 5.0])
def test_one_joint_alone_takes_its_trapezoid(tmp_path: Path, feed: float) -> None:
    plan = program(tmp_path, swing(1e3 * feed))
    limits = plan.cell.robot
    distance, speed = np.radians(60.0), min(feed / RADIUS, limits.speed[0])
    assert_allclose(drive(plan).time[-1], trapezoid(distance, speed, limits.acceleration[0]), rtol=2e-3)


def test_the_joint_that_holds_back_is_named_and_its_limit_followed(tmp_path: Path) -> None:
    model = robot()
    for share in (1.0, 0.5):
        slower = dataclasses.replace(model, speed=model.speed * [share, 1, 1, 1, 1, 1])
        plan = program(tmp_path, swing(5000.0), slower)
        judged = judge(plan)
        assert_allclose(judged.ratio[1:], slower.speed[0] * RADIUS / 5.0, rtol=1e-3)
        assert judged.joint[1:].tolist() == [0, 0]
        assert judged.by_speed[1:].all()
        assert_allclose(judged.drive.time[-1], trapezoid(np.radians(60), slower.speed[0], slower.acceleration[0]), rtol=2e-3)
    free = judge(program(tmp_path, swing(1000.0)))
    assert (free.ratio[1:] == 1).all()


def test_a_reachable_feed_takes_length_over_feed_and_two_ramps(tmp_path: Path) -> None:
    """Rates of the joints along the line by differences of the planned angles, not by the route."""
    plan = program(tmp_path, lines([[1100 + 5 * i, 0, 700] for i in range(41)], "v50", "z1"))
    limits = plan.cell.robot
    rate = np.abs(np.diff(plan.theta, axis=0)) / 5e-3
    ramps = [0.5 * 0.05 / np.min(limits.acceleration / rate[end]) for end in (0, -1)]
    assert_allclose(drive(plan).time[-1], 0.2 / 0.05 + sum(ramps), rtol=1e-4)
    assert judge(plan).slow.sum() == 0


def corners(tmp_path: Path, zone: str, speed: str = "v200") -> RobotPath:
    points = [[1100, 0, 700], [1150, 0, 700], [1150, 50, 700], [1100, 50, 720], [1110, 0, 740]]
    return program(tmp_path, lines(points, speed, zone))


@pytest.mark.parametrize("zone", ["z0", "z1", "z5", "z20", "fine"])
def test_joints_stay_within_their_limits(tmp_path: Path, zone: str) -> None:
    """Speeds and accelerations by differences over time of the angles along the run."""
    plan = corners(tmp_path, zone, "v500")
    run = drive(plan)
    route, speed = run.route, run.speed
    moving = ~(route.stop[1:] & route.stop[:-1])
    dt = np.where(moving, 2 * np.diff(route.s) / np.maximum(speed[1:] + speed[:-1], 1e-12), np.nan)
    rate = np.diff(route.theta, axis=0) / dt[:, None]
    push = np.diff(rate, axis=0) / (0.5 * (dt[1:] + dt[:-1]))[:, None]
    assert (np.nanmax(np.abs(rate), axis=0) <= 1.001 * plan.cell.robot.speed).all()
    # Differences over grid points of unequal spacing scatter about the true value.
    assert (np.nanquantile(np.abs(push), 0.98, axis=0) <= 1.1 * plan.cell.robot.acceleration).all()
    assert np.nanmax(np.abs(push) / plan.cell.robot.acceleration) > 0.8       # and somewhere the limit is used


def test_a_larger_zone_is_faster_and_a_stop_slowest(tmp_path: Path) -> None:
    times = [drive(corners(tmp_path, zone)).time[-1] for zone in ("fine", "z0", "z1", "z5", "z20")]
    assert (np.diff(times) < 0).all()
    assert judge(corners(tmp_path, "fine")).slow.sum() == 0       # stops are programmed: not held against the robot
    slow = judge(corners(tmp_path, "z1"))
    assert slow.slow.any()
    assert not slow.by_speed[slow.slow].any()


def test_joint_moves_take_the_trapezoid_of_the_slowest_joint() -> None:
    model = robot()
    step = np.radians([[30.0, 0, 0, 0, 0, 0], [0, 0, 2, 0, 0, 0], [30, 20, 10, 0, 0, 180], [0, 0, 0, 0, 0, 0]])
    expected = [max(trapezoid(abs(x), v, a) if x else 0.0 for x, v, a in zip(row, model.speed, model.acceleration, strict=True))
                for row in step]
    assert_allclose(joint_move_time(model, step, np.zeros(4), np.full(4, np.nan)), expected, rtol=1e-12)


def test_windows_and_left_out_stretches_change_nothing(sample: Corrected, monkeypatch: pytest.MonkeyPatch) -> None:
    plan = sample.predicted.path
    whole = drive(plan)
    assert_allclose(drive(plan, window=400).speed, whole.speed, atol=1e-9)
    monkeypatch.setattr(timing, "_unsettled", lambda route, *_: np.ones(len(route.s), dtype=bool))
    assert_allclose(drive(plan).speed, whole.speed, atol=1e-9)


@pytest.mark.parametrize("zone", ["fine", "z5"])
def test_windows_end_at_stops_or_behind_the_way_to_brake(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, zone: str) -> None:
    """However short, the speeds are those of the program taken as a whole."""
    monkeypatch.setattr(timing, "_unsettled", lambda route, *_: np.ones(len(route.s), dtype=bool))
    zigzag = [[1100 + 60 * (k % 2), 30 * k, 700] for k in range(8)]
    plan = program(tmp_path, lines(zigzag, "v400", zone))
    whole = drive(plan)
    assert len(whole.speed) > 60
    for window in (12, 31):
        assert_allclose(drive(plan, window=window).speed, whole.speed, atol=1e-6)


def test_a_window_runs_on_by_the_way_to_brake_however_many_targets_that_is(tmp_path: Path) -> None:
    """Steps of half a millimetre at 1 m/s: from there the robot stops within some ten centimetres, two hundred targets."""
    close = [[1000 + 0.5 * k, 0, 700] for k in range(561)]
    plan = program(tmp_path, lines(close, "v1000", "z0"))
    whole = drive(plan)
    assert whole.speed.max() > 0.9
    for window in (40, 150):
        assert_allclose(drive(plan, window=window).speed, whole.speed, atol=1e-6)


@pytest.mark.parametrize(("corners", "words"), [(5, ""), (6, "1 further cut cannot"), (8, "3 further cuts cannot")])
def test_of_many_cuts_that_cannot_hold_their_feed_the_worst_are_told(tmp_path: Path, corners: int, words: str) -> None:
    """A stair towards the robot, whose corners are the worse the nearer: the last are told first, each on its line, of the
    others how many, at one of them."""
    points = [np.array([1000.0, 0, 700])]
    for k in range(3 * corners + 3):
        points.append(points[-1] + [[20, 0, 0], [0, 20, 0]][k // 3 % 2])
    stair = [point.tolist() for point in points[::-1]]
    plan = program(tmp_path, lines(stair, "v200", "z1"))
    check = check_feed(judge(plan, forced(len(stair), list(range(len(stair))))), strict=False)
    told = [finding for finding in check.findings if finding.code == "CS4401"]
    at = [int(re.findall(r"in the corner of 90 deg at target (\d+)", finding.message)[0]) for finding in told[:5]]
    assert at == [3 * (corners - k) for k in range(5)]
    assert len(told) == 5 + bool(words)
    if words:
        assert words in told[-1].message
        assert told[-1].target is not None
        assert told[-1].target <= 3 * (corners - 5) + 1


def test_the_robot_is_looked_at_every_centimetre(tmp_path: Path) -> None:
    """Along lines that are no multiple of it, and nowhere twice."""
    points = [[1100, 0, 700], [1123, 0, 700], [1123, 137, 700], [1000, 137, 760]]
    plan = program(tmp_path, lines(points, "v100", "z1"))
    route = build_route(plan, Poses(plan.base_from_tcp, plan.theta))
    steps = np.diff(route.s)
    assert steps.max() < 10e-3 + 1e-9
    assert steps.min() > 0
    assert route.s[-1] - route.s[0] == pytest.approx(23e-3 + 137e-3 + np.hypot(123e-3, 60e-3), abs=1e-3)


def test_what_is_a_stop(tmp_path: Path) -> None:
    points = [[1100, 0, 700], [1150, 0, 700], [1150, 0, 700], [1150, 50, 700], [1150, 0, 701], [1100, 0, 701]]
    moves = lines(points, "v100", "z1")
    moves[5] = moves[5].replace("z1", "zUnknown")
    moves.append(f"MoveL {target(np.array([1100, 0, 701]), rotation_matrix(np.array([0, 0.1, 0])) @ DOWN)},v100,z1,tSpindle;")
    moves.append(f"MoveL {target(np.array([1100, 0, 750]), rotation_matrix(np.array([0, 0.1, 0])) @ DOWN)},v100,z1,tSpindle;")
    plan = program(tmp_path, moves)
    legs = build_legs(plan, Poses(plan.base_from_tcp, plan.theta))
    assert legs.same.tolist() == [False, False, True, False, False, False, False, False]
    # The cusp at target 3; the last linear move before the turn on the spot, and that itself.
    assert np.flatnonzero(legs.stop).tolist() == [0, 3, 5, 6, 7]
    assert legs.joint.tolist() == [False, False, False, False, False, False, True, False]
    assert np.isfinite(drive(plan).duration).all()


def forced(count: int, targets: list[int]) -> np.ndarray:
    """Which of so many targets have force."""
    return np.isin(np.arange(count), targets)


def test_strict_refuses_a_cut_and_only_a_cut(tmp_path: Path) -> None:
    plan = corners(tmp_path, "z1")
    check = check_feed(judge(plan, forced(5, [])), strict=True)
    assert check.as_dict()["planned"]["held_back_with_force"] == 0
    assert {finding.code for finding in check.findings} == {"CS4403", "CS4411"}
    with pytest.raises(Refused, match=r"CS4402.*cannot hold 200 mm/s: \d+ %, joint \d at its acceleration limit .* "
                                      r"in the corner of 90 deg at target \d"):
        check_feed(judge(plan, forced(5, [0, 1, 2, 3])), strict=True)


@pytest.mark.parametrize(("share", "cut", "code"), [
    (1.02, [], ""), (0.98, [], "CS4411"), (0.5, [], "CS4411"), (0.5, [1], "CS4411"), (0.5, [0, 1, 2], "CS4401"),
    (1.02, [0, 1, 2], "")])
def test_moves_in_the_air_that_cannot_hold_their_feed_are_told_by_how_much(
    tmp_path: Path, share: float, cut: list[int], code: str
) -> None:
    """A swing by 60 degrees of the first axis alone, which turns at its highest speed but for where it speeds up and brakes. A
    target with force alone, between two without, is no cut."""
    speed, acceleration = np.degrees(robot().speed[0]), np.degrees(robot().acceleration[0])
    plan = program(tmp_path, swing(1e3 * RADIUS * np.radians(speed) / share))
    check = check_feed(judge(plan, forced(3, cut)), strict=False)
    found = [one for one in check.findings if one.code in ("CS4401", "CS4411")]
    assert [one.code for one in found] == ([code] if code else [])
    if code == "CS4411":
        [said] = re.findall(r"^2 moves without force cannot hold their feed, ([\d.]+) s lost; the lowest share (\d+) % of "
                            r"([\d.]+) mm/s: joint 1 at its speed limit \((\d+) deg/s\)$", found[0].message)
        lost = 60 / speed + speed / acceleration - 60 * share / speed
        assert [float(value) for value in said] == pytest.approx(
            [lost, 100 * share, 1e3 * RADIUS * np.radians(speed) / share, speed], abs=0.02)
        assert (found[0].level, found[0].line) == ("note", 4)


def test_unknown_feed_and_a_program_of_joint_moves_alone(tmp_path: Path) -> None:
    moves = lines([[1100, 0, 700], [1150, 0, 700], [1200, 0, 700]], "vUnknown", "z1")
    unknown = check_feed(judge(program(tmp_path, moves), forced(3, [0, 1, 2])), strict=True)
    [said] = [finding for finding in unknown.findings if finding.code == "CS4405"]
    assert said.message.startswith("the feed of 2 moves is not known: not judged")
    assert (said.level, said.target) == ("warning", 1)
    assert unknown.as_dict()["planned"]["judged"] == 0
    # The speed of the move to the first target counts for nothing.
    first = [moves[0], *(move.replace("vUnknown", "v100") for move in moves[1:])]
    assert "CS4405" not in {finding.code for finding in check_feed(judge(program(tmp_path, first)), strict=True).findings}
    one = check_feed(judge(program(tmp_path, [*first[:2], moves[2]])), strict=True)
    [said] = [finding for finding in one.findings if finding.code == "CS4405"]
    assert (said.message.partition(" is")[0], said.target) == ("the feed of 1 move", 2)
    joint_moves = program(tmp_path, [move.replace("MoveL", "MoveJ") for move in moves])
    alone = check_feed(judge(joint_moves, forced(3, [])), strict=True)
    assert alone.as_dict()["planned"]["joint_moves_s"] > 0


def slow(sample_inputs: Inputs, tmp_path: Path) -> list[object]:
    """The words of `correct` for a robot that can hardly accelerate."""
    source = robot().source.read_text().replace("acceleration_deg_s2: 400", "acceleration_deg_s2: 2")
    (tmp_path / "slow.yaml").write_text(source)
    (tmp_path / "cell.yaml").write_text(sample_inputs.cell.read_text().replace("irb6660-205-1.90", "slow.yaml"))
    return [tmp_path / "cell.yaml", sample_inputs.toolpath, "--stiffness", sample_inputs.stiffness, "--forces",
            sample_inputs.forces, "--tare", "0:2", "-o", tmp_path / "out.mod", "--json"]


# Long: what is refused of such a robot is held above, and that nothing is written where anything is, in
# tests/runs/command_line/test_refusals.py.
@pytest.mark.long
def test_what_a_robot_cannot_hold_is_refused_on_the_command_line(sample_inputs: Inputs, tmp_path: Path) -> None:
    refused = compstiff("correct", *slow(sample_inputs, tmp_path), "--strict-feed")
    assert refused.returncode == 3, refused.stdout
    assert {finding["code"] for finding in json.loads(refused.stdout)["findings"] if finding["level"] == "error"} == {"CS4402"}
    assert not (tmp_path / "out.mod").exists()


def test_on_the_command_line(sample_inputs: Inputs, tmp_path: Path) -> None:
    """Reported, and the report draws it."""
    done = compstiff("correct", *slow(sample_inputs, tmp_path), "--check-feed", "--report", tmp_path / "report.html")
    assert done.returncode == 0, done.stderr
    told = json.loads(done.stdout)["result"]["feed_check"]
    assert told["corrected"]["held_back_with_force"] > 0
    assert told["corrected"]["lowest_feed_ratio_with_force"] < 0.9
    assert told["corrected"]["time_s"] > told["corrected"]["programmed_time_s"]
    assert "The feed the joints can hold" in (tmp_path / "report.html").read_text()


def test_the_way_to_stop_is_that_of_the_joint_that_brakes_the_least() -> None:
    """v^2 / 2 a, with the acceleration along the path that each joint allows: 0.5 / 0.1, 3 / 2 and 8 / 4 m/s^2."""
    route: Any = SimpleNamespace(dtheta_ds=np.array([[9.0, 9, 9], [0.1, -2.0, 4.0], [0.5, 0.0, 0.0]]))
    robot: Any = SimpleNamespace(acceleration=np.array([0.5, 3.0, 8.0]))
    assert _braking(route, robot, np.array([1, 2]), np.array([0.36, 4.0])) == pytest.approx([0.36 / (2 * 1.5), 4.0 / (2 * 1.0)])

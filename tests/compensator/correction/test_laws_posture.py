"""Posture advice: what it promises of another turn about the tool's axis is what the independent arm does there."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

import compstiff
from compensator.correction import other_stance, posture
from compensator.correction.loaded_path import LoadedPath
from compensator.correction.posture import Advice
from identification.model.kinematics import forward
from identification.model.rotations import Frame as Goal
from tests.runs.command_line import user_files as kit
from tests.runs.command_line.test_placement import line
from tests.runs.command_line.test_refusals import at
from tests.runs.command_line.user_files import IRB6660, TOOL, Frame, Job, K, Rotation
from tests.support import robot

FORCE = np.array([250.0, 60.0, -40.0])


def test_another_stance_is_followed_in_steps(monkeypatch: pytest.MonkeyPatch) -> None:
    """None turns by more than 5 degrees, or moves by more than 100 mm, and together they are what was asked."""
    goals: list[Goal] = []

    def stands(loaded: SimpleNamespace, goal: Goal) -> SimpleNamespace:
        goals.append(goal)
        return SimpleNamespace(path=SimpleNamespace(base_from_tcp=goal))

    monkeypatch.setattr(other_stance, "_stands", stands)
    at = Goal(Rotation.from_euler("xyz", [[20, -30, 40]], degrees=True).as_matrix(), np.array([[1.2, 0.1, 0.8]]))
    start = SimpleNamespace(path=SimpleNamespace(base_from_tcp=at))
    for degrees, steps in ((-60, 12), (35, 7), (0, 1)):
        goals.clear()
        other_stance.turned(start, np.radians(degrees))
        assert len(goals) == steps
        assert np.allclose(goals[-1].rotation, at.rotation @ Rotation.from_euler("z", degrees, degrees=True).as_matrix())
        assert np.allclose(goals[-1].position, at.position)
    goals.clear()
    other_stance.shifted(start, np.array([0.0, -0.3, 0.0]))
    assert [goal.position[0].tolist() for goal in goals] == [pytest.approx([1.2, y, 0.8]) for y in (0.0, -0.1, -0.2)]


def test_what_a_turn_gains_is_a_share_of_what_is_planned() -> None:
    turns, rms, largest = np.radians([-10, 0, 5]), np.array([90e-6, 100e-6, 75e-6]), np.array([2e-4, 3e-4, 1e-4])
    told = Advice(turns, rms, largest, ("", ""), 8).as_dict()
    assert told["gain"] == 0.25
    assert (told["turn_deg"], told["possible_deg"]) == (5.0, [-10.0, 5.0])
    assert (told["rms_um"], told["largest_um"]) == ([100.0, 75.0], [300.0, 100.0])


def test_where_no_turn_gains_that_is_said() -> None:
    turns, worse = np.radians([-10, 0, 5]), np.array([110e-6, 100e-6, 120e-6])
    why = ("limit of joint 6", "out of reach")
    [said] = Advice(turns, worse, 2 * worse, why, 8).lines()
    assert said == ("Posture: no turn about the tool's axis lowers the deviation; turns from -10 deg (limit of joint 6) to "
                    "5 deg (out of reach) can be driven; 8 targets looked at")
    [other] = Advice(turns, worse[::-1] * [1, 1, 0.5], 2 * worse, why, 8).lines()
    assert "turned by 5 deg about the tool's axis the deviation would be 55.0 in place of 100.0 um RMS (45 % less)" in other


def test_the_gain_is_what_the_turned_tool_gets(tmp_path: Path) -> None:
    path = line(8, 10)
    forces = "target,fx_n,fy_n,fz_n\n" + "".join(f"{i},{FORCE[0]},{FORCE[1]},{FORCE[2]}\n" for i in range(8))
    job = Job(tmp_path, program=path.program(), forces=forces)
    plain = job.correct("--json")
    result = job.correct("--json", "--force", "--advise")
    assert result.code == 0
    assert "posture" not in plain.json["result"]
    told = result.json["result"]["posture"]
    low, high = told["possible_deg"]
    assert low <= told["turn_deg"] <= high
    assert told["targets"] == 8

    def rms(degrees: float) -> float:
        about, q, squares = Rotation.from_euler("z", degrees, degrees=True), kit.START, []
        for frame in path.frames:
            for share in (0.25, 0.5, 0.75, 1.0) if q is kit.START else (1.0,):
                part = Rotation.from_rotvec(share * about.as_rotvec())
                q = kit.solve(IRB6660, kit.work_object() @ Frame(frame.p, frame.r * part) @ TOOL.inv(), q)
            squares.append(np.sum(kit.deviation(IRB6660, q, TOOL.p, np.r_[FORCE, 0, 0, 0], K) ** 2))
        return float(1e6 * np.sqrt(np.mean(squares)))

    assert told["rms_um"][0] == pytest.approx(rms(0.0), rel=1e-3)
    assert told["rms_um"][1] == pytest.approx(rms(told["turn_deg"]), rel=1e-3)
    assert told["gain"] == pytest.approx(1 - told["rms_um"][1] / told["rms_um"][0], abs=1e-3)
    for other in np.linspace(max(low, told["turn_deg"] - 10), min(high, told["turn_deg"] + 10), 3):
        assert rms(other) >= told["rms_um"][1] - 0.1
    assert "Posture:" in job.correct("--force", "--advise").out


# As the robot's file has them [deg].
LOW, HIGH = np.array([-180, -42, -20, -300, -120, -360]), np.array([180, 85, 120.5, 300, 120, 360])


def followed(start: list[float], turn: int) -> list[np.ndarray]:
    """Joint angles [deg] of the independent arm at each whole degree on the way to a turn about the tool's axis; no more of
    them where it does not come that far."""
    q, found = np.radians(start), []
    goal = kit.tcp_pose(IRB6660, q, TOOL)
    for degrees in range(1, abs(turn) + 1):
        about = Rotation.from_euler("z", degrees * np.sign(turn), degrees=True)
        try:
            q = kit.solve(IRB6660, Frame(goal.p, goal.r * about) @ TOOL.inv(), q)
        except (AssertionError, np.linalg.LinAlgError):
            return found
        found.append(np.degrees(q))
    return found


@pytest.mark.parametrize(("start", "ends"), [
    ([12.0, 18, 22, 25, 48, -30], ("limit of joint 5", "limit of joint 5")),
    ([10.0, 10, 10, 20, 30, 250], ("out of reach", "near the wrist's singularity")),
    ([0.0, 30, -10, -60, 100, 0], ("limit of joint 3", "limit of joint 5")),
    ([-20.0, 40, 30, 120, 70, 10], ("limit of joint 5", "out of reach"))])
def test_turns_end_where_a_joint_does(tmp_path: Path, start: list[float], ends: tuple[str, str]) -> None:
    """Every fifth degree up to the end the independent arm is within its limits and five degrees off the singularity, and at
    the next it is not, by the reason that is told."""
    job = Job(tmp_path, kit.cell_text(), at(start), forces="target,fx_n,fy_n,fz_n\n0,0,100,0\n")
    told = job.correct("--json", "--advise").json["result"]["posture"]
    assert tuple(told["ends_by"]) == ends
    for end, why in zip(told["possible_deg"], ends, strict=True):
        turn = int(end) + (5 if end > 0 else -5)
        way = followed(start, turn)
        for q in way[4:abs(int(end)):5]:
            assert (q > LOW).all()
            assert (q < HIGH).all()
            assert abs(q[4]) > 5
        if why == "out of reach":
            assert abs(int(end)) <= len(way) < abs(turn)
            continue
        beyond = np.maximum(LOW - way[-1], way[-1] - HIGH)
        assert len(way) == abs(turn)
        assert why == (f"limit of joint {np.argmax(beyond) + 1}" if beyond.max() > 0 else "near the wrist's singularity")
        assert beyond.max() > 0 or abs(way[-1][4]) < 5


def shifted_to(start: np.ndarray, shift: np.ndarray) -> np.ndarray | None:
    """Joint angles [rad] of the independent arm with its tool moved so far [m], in steps of a centimetre; None where it does
    not come there within its limits and five degrees off the singularity, asked every 100 mm."""
    q, goal = start, kit.tcp_pose(IRB6660, start, TOOL)
    steps = round(100 * float(np.abs(shift).max()))
    for number in range(1, steps + 1):
        try:
            q = kit.solve(IRB6660, Frame(goal.p + shift * number / steps, goal.r) @ TOOL.inv(), q)
        except (AssertionError, np.linalg.LinAlgError):
            return None
        degrees = np.degrees(q)
        if number % 10 == 0 and ((degrees < LOW).any() or (degrees > HIGH).any() or abs(degrees[4]) < 5
                                 or abs(degrees[2] - degrees[1]) > 70):
            return None
    return q


@pytest.mark.parametrize(("start", "force"), [
    ([12.0, 18, 22, 25, 48, -30], (60, 90, -120)), ([0.0, 30, -10, -60, 100, 0], (0, 0, 300)),
    ([30.0, 50, 60, 90, 110, 0], (0, 90, 0)), ([10.0, -40, 30, 20, 30, 250], (90, 0, 0))])
def test_the_best_place_is_the_one_where_the_independent_arm_gives_way_least(
        tmp_path: Path, start: list[float], force: tuple[float, float, float]) -> None:
    """Of those up to 300 mm along a base axis to which it comes step by step, under the same force."""
    job = Job(tmp_path, kit.cell_text(), at(start), forces=f"target,fx_n,fy_n,fz_n\n0,{','.join(map(str, force))}\n").write()
    cell = compstiff.read_cell(job.folder / "cell.yaml")
    program = compstiff.read_toolpath(job.folder / "part.mod", cell)
    model = compstiff.read_stiffness(job.folder / "stiffness.json", cell)
    loaded = compstiff.predict(cell, program, model, job.folder / "forces.csv").loaded

    def gives(q: np.ndarray) -> float:
        return float(np.linalg.norm(kit.deviation(IRB6660, q, TOOL.p, np.r_[force, 0, 0, 0], K)))

    best, least = np.zeros(3), gives(np.radians(start))
    for axis in np.vstack([np.eye(3), -np.eye(3)]):
        for number in (1, 2, 3):
            q = shifted_to(np.radians(start), 0.1 * number * axis)
            stance = other_stance.shifted(loaded, 0.1 * number * axis)
            assert (stance is None) == (q is None)
            if q is None or stance is None:
                break
            np.testing.assert_allclose(stance.theta, [q], atol=1e-6)
            if gives(q) < least:
                best, least = 0.1 * number * axis, gives(q)
    found = other_stance.best_shift(loaded)
    np.testing.assert_allclose(best if found is None else found, best, atol=1e-9)
    assert (found is None) == (not best.any())


@pytest.mark.parametrize(("count", "looked_at"), [(1, 1), (400, 400), (401, 201), (800, 400), (801, 267)])
def test_turns_are_tried_in_steps_of_five_degrees_until_one_cannot_be_driven(
    count: int, looked_at: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """To half a turn at most, each from the one before; of so many targets as are looked at, evenly."""
    seen: list[tuple[float, float]] = []

    def followed(loaded: Any, turn: float, before: float) -> tuple[float, str]:
        seen.append((before, turn))
        return turn, "limit of joint 6" if turn > np.radians(22) else ""

    monkeypatch.setattr(posture, "_followed", followed)
    monkeypatch.setattr(posture, "_deviation", lambda loaded, theta: ((theta + 1.0) ** 2, 7.0 + theta))
    found = posture.advise(cast(Any, Looked(np.arange(count))))
    assert found is not None
    turns = np.radians(np.arange(-180, 21, 5))
    np.testing.assert_allclose(found.turn, turns)
    np.testing.assert_allclose(found.rms, (turns + 1) ** 2)
    np.testing.assert_allclose(found.largest, 7 + turns)
    assert (found.stopped, found.targets) == (("half a turn", "limit of joint 6"), looked_at)
    assert np.degrees(found.turn[[found.best, found.planned]]) == pytest.approx([-55, 0])
    assert all(abs(before) == pytest.approx(abs(turn) - np.radians(5)) and before * turn >= 0 for before, turn in seen)
    assert posture.advise(cast(Any, Looked(np.arange(0)))) is None


@dataclass(frozen=True)
class Looked:
    """Targets whose joints stand at nothing."""

    targets: np.ndarray
    theta: float = 0.0


@pytest.mark.parametrize("learned", [False, True])
def test_what_was_learned_of_the_rest_is_taken_off_the_goal(learned: bool) -> None:
    """The model shall bring the tool beside the plan by that, in the same orientation; the joints stand there."""
    model = robot()
    theta = np.array([0.1, 0.2, -0.3, 0.2, 0.8, 0.1]) + 0.05 * np.arange(4)[:, None]
    tool = Goal(np.eye(3), np.array([0.1, 0.0, 0.25]))
    plan = forward(model, theta, tool)
    tools = Goal(np.tile(np.eye(3), (4, 1, 1)), np.tile(tool.position, (4, 1)))
    path: Any = SimpleNamespace(base_from_tcp=plan, theta=theta, flange_from_tcp=tools)
    targets, mean = np.array([1, 3]), 1e-3 * np.array([[1.0, -2, 0.5], [0, 3, -1]])
    rest: Any = SimpleNamespace(rest=lambda path, which: SimpleNamespace(mean=mean)) if learned else None
    wrench = np.arange(24.0).reshape(4, 6)
    loaded = LoadedPath(path, cast(Any, SimpleNamespace(wrench=wrench)), cast(Any, SimpleNamespace(robot=model)), targets, rest)
    expected = plan.position[targets] - learned * mean
    for goal in (loaded.goal, loaded.goal_of(np.array([0, 1])), loaded.goal_of(slice(0, 2))):
        np.testing.assert_allclose(goal.position, expected)
        np.testing.assert_allclose(goal.rotation, plan.rotation[targets])
    np.testing.assert_allclose(loaded.goal_of(np.array([1])).position, expected[1:])
    np.testing.assert_allclose(loaded.goal_position, expected)
    np.testing.assert_allclose(forward(model, loaded.theta, tool).position, expected, atol=1e-9)
    np.testing.assert_array_equal(loaded.planned_theta, theta[targets])
    np.testing.assert_array_equal(loaded.wrench, wrench[targets])
    np.testing.assert_array_equal(loaded.plan.position, plan.position[targets])
    whole = LoadedPath(path, cast(Any, SimpleNamespace(wrench=wrench)), cast(Any, SimpleNamespace(robot=model)), np.arange(4))
    assert whole.wrench is wrench

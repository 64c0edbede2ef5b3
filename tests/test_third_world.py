"""The third judge's load tests (benchmarks/third_world.py): its own mechanics, what it hides, and how it judges an answer."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import compstiff
from benchmarks.third_arm import DEGREE, ROBOTS, Arm, Loaded
from benchmarks.third_gears import Loop
from benchmarks.third_sight import by_springs, visible
from benchmarks.third_trial import KINDS, Diverged, Trial
from benchmarks.third_world import ALL, MISTAKES, NOTHING, PHYSICS, deck, judged, made, matches

POSE = np.array([20.0, 15.0, 10.0, 40.0, 50.0, -60.0])


@pytest.mark.parametrize("name", ROBOTS)
def test_its_chain_is_that_of_the_built_in_robot(name: str, tmp_path: Path) -> None:
    """By the pendant's poses, as a user checks a cell."""
    trial = Trial("tracker", 5, robot=name)
    lines = [f"robot: {name}", f"tool: {{position_mm: {trial.tool_mm.tolist()}, quaternion: [1, 0, 0, 0]}}", "pendant_poses:"]
    for q in trial.poses(3):
        tcp = 1e3 * trial.arm.chain(trial.arm.serial(q))[1][:3, 3]
        lines.append(f"  - {{joints_deg: {q.tolist()}, tcp_mm: {tcp.round(3).tolist()}}}")
    (tmp_path / "cell.yaml").write_text("\n".join([*lines, ""]))
    proof = compstiff.read_cell(tmp_path / "cell.yaml").pendant
    assert proof is not None
    assert proof.off < 2e-6


@pytest.mark.parametrize("name", ["irb6660-205-1.90", "kr60-ha"])
def test_springs_do_the_work_that_a_load_puts_in(name: str) -> None:
    """Of a small force half of force times way is stored in the springs: the levers of load and way are the same."""
    arm, compliance = Arm(name, np.array([120.0, 60.0, 250.0]), heavy=0.0), 1e-6 * np.arange(1.0, 7.0)
    robot, force = Loaded(arm, compliance), np.array([1.0, -2.0, 3.0])
    robot.begin(POSE, 0, np.random.default_rng(1))
    start = robot.solve(np.zeros(3), np.zeros(3), 0.0)
    way = robot.solve(force, np.zeros(3), 10.0)[:3, 3] - start[:3, 3]
    assert force @ way == pytest.approx(robot.turned @ (robot.turned / compliance), rel=1e-4)
    # And the angles are those by which the pendant's would have to change, at the gears of a rod too.
    turned = robot.turned / DEGREE
    pendant = arm.sense * turned if not arm.rod else turned
    moved = arm.chain(arm.serial(POSE + pendant))[1][:3, 3] - start[:3, 3]
    np.testing.assert_allclose(moved, way, rtol=1e-6, atol=1e-15)


def test_a_loop_takes_the_work_of_its_play() -> None:
    """A play of half width r in a cycle of amplitude A takes 4 r (A - r) times the compliance; four of them, weighed alike."""
    law = Loop(0.5, 100.0)
    law.begin(0.0, 1e-6, 0, np.random.default_rng(3))
    torque, angle = 100 * np.sin(np.linspace(0, 6 * np.pi, 3001)), []
    for load in torque:
        angle.append(law.value(load, 0.0, 0.0, 0.0))
        law.keep(load, 0.0, 0.0, 0.0)
    work = np.cumsum(0.5 * (torque[1:] + torque[:-1]) * np.diff(angle))
    widths = np.array([25.0, 50.0, 75.0, 100.0])
    assert work[2999] - work[1999] == pytest.approx(0.5e-6 * np.mean(4 * widths * (100 - widths)), rel=1e-3)


def shortened(trial: Trial, visits: int = 2) -> Trial:
    """Its first visits alone."""
    trial.rows = [row for row in trial.rows if row.visit < visits]
    return trial


def test_nothing_hidden_is_not_visible_and_what_is_hidden_is() -> None:
    for causes, seen in ((["nothing"], False), (["tool_frame"], True)):
        trial, plain, *_ = made(3400001, causes)
        sigmas, _ = visible(shortened(trial), shortened(plain))
        assert (sigmas > 9) == seen, (causes, sigmas)


def test_what_holds_the_tool_more_than_the_arm_does_is_no_load_test() -> None:
    """It would be written with readings of decimetres."""
    def held(size: float) -> Trial:
        trial = shortened(Trial("hydraulic", 7, robot="kr60-ha"), 1)
        ALL["hose"](trial, size)
        return trial

    assert np.abs(held(0.01).readings(quiet=True)).max() < 5e3
    with pytest.raises(Diverged):
        held(50.0).readings(quiet=True)


def test_a_cause_is_in_the_readings_and_a_mistake_in_the_table() -> None:
    """Twice the size is about twice as much of a linear cause; a slip moves no tool."""
    def hidden(name: str, size: float) -> tuple[Trial, np.ndarray]:
        trial, plain = (shortened(Trial("gauges1", 7), 1) for _ in range(2))
        ALL[name](trial, size)
        return trial, trial.readings(quiet=True) - plain.readings(quiet=True)

    (_, one), (_, two) = hidden("stand_gives", 0.1), hidden("stand_gives", 0.2)
    assert np.abs(one).max() > 0.5
    np.testing.assert_allclose(two, 2 * one, atol=1e-6)
    trial, off = hidden("inch_gauge", 1.0)
    assert not off.any()
    readings = trial.readings(quiet=True)
    factor = np.array([row.reading for row in trial.written(readings)]) / np.where(readings == 0, np.nan, readings)
    assert sorted(np.nanmean(factor, axis=0).round(6)) == [pytest.approx(1 / 2.54, abs=1e-6), 1, 1]


@pytest.mark.parametrize("kind", KINDS)
def test_the_program_reads_its_files(kind: str, tmp_path: Path) -> None:
    trial = shortened(Trial(kind, 11))
    trial.write(tmp_path, 12)
    cell = compstiff.read_cell(tmp_path / "cell.yaml")
    rows = compstiff.read_measurements(tmp_path / "measurements.csv", cell)
    assert len(rows) == len(trial.rows)
    # Where the springs are the truth the first order of what is read is theirs.
    told = by_springs(trial.arm, trial.rows) @ (1 / trial.stiffness)
    assert np.abs(1e6 * rows.deflection - told).max() < 0.05 * np.abs(told).max() + 60


def test_a_deck_has_every_kind_and_none_twice_before_all() -> None:
    cases = deck(np.random.default_rng(31), 200)
    first = [causes[0] for causes in cases]
    assert {len(causes) for causes in cases} == {1, 2}
    for kind, share in ((PHYSICS, 100), (MISTAKES, 50), (NOTHING, 50)):
        drawn = [name for name in first if name in kind]
        assert len(drawn) == share
        assert len(set(drawn[:len(kind)])) == min(len(kind), share)


def answer(verdict: str, *causes: str, alternatives: tuple[str, ...] = (), mistakes: tuple[str, ...] = ()) -> dict[str, Any]:
    def cause(label: str) -> dict[str, Any]:
        name, _, joint = label.partition("[")
        return {"effect": name, "joint": int(joint[:-1]) if joint else None}

    return {"verdict": verdict, "causes": [cause(label) for label in causes], "visits": None,
            "alternatives": [cause(label) for label in alternatives], "mistakes": [{"mistake": name} for name in mistakes],
            "misfit": {"p_value": 0.5, "rms_um": 1.0, "expected_rms_um": 1.0}}


def test_an_answer_is_worth_what_the_truth_says() -> None:
    gear = (["lost_motion"], [{"backlash[3]", "soft_zone[3]"}])
    for given, sigmas, mark in (
            (answer("named", "backlash[3]"), 30, "right"), (answer("named", "backlash[4]"), 30, "wrong"),
            (answer("named", "backlash[3]", "drift"), 30, "half wrong"), (answer("adequate"), 30, "missed"),
            (answer("adequate"), 5, "not visible"), (answer("unknown"), 30, "unknown"),
            (answer("ambiguous", alternatives=("drift", "soft_zone[3]")), 30, "set with the truth"),
            (answer("ambiguous", alternatives=("drift",)), 30, "set without the truth"),
            (answer("mistake", mistakes=("force_unit",)), 30, "wrong mistake")):
        assert judged(*gear, sigmas, given)[0] == mark
    quiet = (["heavy"], [{"adequate"}])
    assert judged(*quiet, 0.0, answer("adequate"))[0] == "right, quiet"
    assert judged(*quiet, 0.0, answer("unknown"))[0] == "false alarm"
    assert judged(["q46"], [{"*"}], 99.0, answer("mistake", mistakes=("angle_columns",)))[0] == "right"


def test_an_effect_without_a_joint_is_right_at_any() -> None:
    assert matches("soft_zone[3]", {"soft_zone"})
    assert not matches("soft_zone[3]", {"soft_zone[4]"})
    assert not matches("soft_zone[3]", {"soft_zone", "soft_zone[4]"})

"""The fifth judge's load tests (benchmarks/fifth_world.py): laws that its mechanics must obey, and how it judges an answer."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from benchmarks.fifth_arm import Array, Loads, Structure, arm_of, equilibrium, posture, springs, turning
from benchmarks.fifth_causes import CAUSES, beam, play, side
from benchmarks.fifth_judge import RIGHT, judged
from benchmarks.fifth_trial import ARMS, INSTRUMENTS, table_of, trial, visible
from benchmarks.fifth_world import NOTHING, made

TOOL = np.array([0.12, 0.02, 0.25])
POSES = {"ABB": [20, 15, 10, 40, 50, -60], "KUKA": [20, -80, 95, 30, 40, -50], "FANUC": [20, 10, -15, 30, 40, -50]}


def held(name: str) -> tuple[Array, Structure, Array]:
    """Angles, six springs without the arm's weight and their stiffnesses."""
    arm = arm_of(name, TOOL)
    return np.radians([POSES[arm.maker]]), Structure(lambda torque: torque / arm.prior, with_weight=False), arm.prior


def moved(name: str, force: list[float]) -> Array:
    shown, structure, _ = held(name)
    arm = arm_of(name, TOOL)
    rows = np.repeat(shown, 2, axis=0)
    tcp = equilibrium(arm, structure, rows, Loads.at_tcp(np.array([[0, 0, 0], force], dtype=float))).tcp
    moves: Array = tcp[1] - tcp[0]
    return moves


@pytest.mark.parametrize(("name", "flange"), [("kr210-r2700-extra", [1692.53, -689.57, 1299.11]),
                                              ("r2000ic-210f", [1840.11, 743.28, 1017.69])])
def test_the_flange_is_where_the_makers_description_has_it(name: str, flange: list[float]) -> None:
    arm = arm_of(name, np.zeros(3))
    assert posture(arm, arm.serial(np.radians([POSES[arm.maker]]))).tcp[0] * 1e3 == pytest.approx(flange, abs=0.01)


@pytest.mark.parametrize("name", ARMS)
def test_energy_half_the_loads_work_is_in_the_springs(name: str) -> None:
    shown, _, stiffness = held(name)
    arm, force, seen = arm_of(name, TOOL), np.array([120.0, -80.0, 60.0]), []

    def gear(torque: Array) -> Array:
        seen.append(torque / stiffness)
        return seen[-1]
    after = equilibrium(arm, Structure(gear, with_weight=False), shown, Loads.at_tcp(force[None])).tcp[0]
    work = force @ (after - posture(arm, arm.serial(shown)).tcp[0]) / 2
    assert (stiffness * seen[-1][0] ** 2).sum() / 2 == pytest.approx(work, rel=2e-3)


@pytest.mark.parametrize("name", ARMS)
def test_small_loads_add_up_and_are_reciprocal(name: str) -> None:
    along = [moved(name, list(30.0 * axis)) for axis in np.eye(3)]
    assert moved(name, [30, 30, 30]) == pytest.approx(sum(along), rel=2e-3, abs=1e-8)
    compliance = np.array(along)
    assert compliance == pytest.approx(compliance.T, rel=3e-3, abs=1e-8)
    assert (np.linalg.eigvalsh((compliance + compliance.T) / 2) > 0).all()


def test_a_rods_drive_3_leaves_the_lower_arm_alone() -> None:
    arm = arm_of("irb6660-205-1.90", TOOL)
    shown = np.radians([POSES["ABB"]])
    straight = Structure(lambda torque: torque * [0, 0, 1e-6, 0, 0, 0], with_weight=False)
    before, after = (equilibrium(arm, straight, shown, Loads.at_tcp(np.array([[0, 0, load]]))) for load in (0.0, -500.0))
    assert after.places[:, 3] == pytest.approx(before.places[:, 3], abs=1e-12)
    driven = Structure(lambda torque: torque * [0, 1e-6, 0, 0, 0, 0], with_weight=False)
    after = equilibrium(arm, driven, shown, Loads.at_tcp(np.array([[0, 0, -500.0]])))
    assert after.tool == pytest.approx(before.tool, abs=1e-12)          # drive 2 shifts the forearm and does not turn it


def test_a_beam_is_that_of_the_books_and_a_turn_is_one() -> None:
    shift, turn = beam(np.array([1.0, 0, 0]), 2.0, 3e-6, 1e-6)(np.array([[0, 100.0, 0]]), np.zeros((1, 3)))
    assert shift[0] == pytest.approx([0, 3e-6 * 4 / 3 * 100, 0])        # F L^3 / 3 EI
    assert turn[0] == pytest.approx([0, 0, 3e-6 * 100])                 # F L^2 / 2 EI
    assert turning(np.array([[0, 0, np.pi / 2]]))[0] @ [1, 0, 0] == pytest.approx([0, 1, 0])


def test_what_lags_lags_and_what_lies_on_a_side_stays() -> None:
    visit = np.zeros(5)
    assert play(np.array([0, 1, 3, 2.5, 0.0]), 1.0, visit).tolist() == [0, 0, 2, 2, 1]
    assert side(np.array([0, 5, 0, -5, 0.0]), 1.0, visit, -np.ones(5)).tolist() == [-1, 1, 1, -1, -1]


def test_springs_alone_leave_nothing_and_every_cause_something() -> None:
    rng = np.random.default_rng(3)
    one = {design: trial("irb6700-235-2.65", design, INSTRUMENTS[1], rng) for design in ("cycles", "cable", "dead weights")}
    assert visible(one["cycles"], table_of(one["cycles"], NOTHING.make(rng, one["cycles"], 0), rng, noise=False)) < 0.01
    for cause in CAUSES:
        test = one[next(design for design in one if design in cause.designs)]
        seen = [table_of(test, cause.make(np.random.default_rng(1), test, size), np.random.default_rng(2), noise=False)
                for size in (0.0, cause.size)]
        unlike = [key for key in seen[0] if not np.allclose(seen[0][key], seen[1][key], rtol=1e-5, atol=1e-8)]
        assert unlike or cause.fixed, cause.name


def test_every_cause_has_its_name_and_a_case_is_written_the_same_again(tmp_path: Path) -> None:
    assert {cause.name for cause in CAUSES} == set(RIGHT)
    for place in ("a", "b"):
        list(made(1, 5, tmp_path / place))
    for file in ("cell.yaml", "measurements.csv", "truth.json"):
        assert (tmp_path / "a/000" / file).read_text() == (tmp_path / "b/000" / file).read_text()
    truth = json.loads((tmp_path / "a/000/truth.json").read_text())
    assert 3.5 < truth["sigmas"] < 33 or truth["cause"] == "angle_sign"


def test_answers_are_judged() -> None:
    def answer(verdict: str, *names: tuple[str, int | None]) -> dict[str, object]:
        told = [{"effect": effect, "joint": joint} for effect, joint in names]
        return {"verdict": verdict, "causes": told if verdict == "named" else [], "mistakes": [],
                "alternatives": [] if verdict == "named" else told}
    truth = {"cause": "backlash", "joint": 4}
    assert judged(truth, answer("named", ("backlash", 4)))[0] == "right"
    assert judged(truth, answer("named", ("backlash", 5)))[0] == "half"
    assert judged(truth, answer("named", ("drift", None)))[0] == "wrong"
    assert judged(truth, answer("ambiguous", ("hysteresis", 4), ("backlash", 4)))[0] == "set with the truth"
    assert judged(truth, answer("unknown"))[0] == "unknown"
    assert judged(truth, answer("adequate"))[0] == "missed"
    assert judged({"cause": "nothing"}, answer("unknown"))[0] == "alarm"
    assert springs(np.ones(6)).with_weight

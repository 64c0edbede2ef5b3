"""The fifth judge's load tests (benchmarks/fifth_world.py): laws that its mechanics must obey, and how it judges an answer."""

from __future__ import annotations

from itertools import islice
from pathlib import Path

import numpy as np
import pytest

import compstiff
from benchmarks.fifth_arm import Array, Structure, arm_of, equilibrium, posture, turning
from benchmarks.fifth_causes import CAUSES, beam, play, side, times
from benchmarks.fifth_judge import RIGHT, judged
from benchmarks.fifth_trial import ARMS, INSTRUMENTS, deflections, sheet_of, table_of, trial, visible
from benchmarks.fifth_world import NOTHING, case, deck, written
from identification.diagnosis.detect import goodness_of_fit
from identification.fit.load_test import LoadTest
from identification.fit.posterior import posterior
from identification.model.effects import effects

TOOL = np.array([0.12, 0.02, 0.25])
POSES = {"ABB": [20, 15, 10, 40, 50, -60], "KUKA": [20, -80, 95, 30, 40, -50], "FANUC": [20, 10, -15, 30, 40, -50]}


@pytest.mark.parametrize(("name", "flange"), [("kr210-r2700-extra", [1692.53, -689.57, 1299.11]),
                                              ("r2000ic-210f", [1840.11, 743.28, 1017.69])])
def test_the_flange_is_where_the_makers_description_has_it(name: str, flange: list[float]) -> None:
    arm = arm_of(name, np.zeros(3))
    assert posture(arm, arm.serial(np.radians([POSES[arm.maker]]))).tcp[0] * 1e3 == pytest.approx(flange, abs=0.01)


@pytest.mark.parametrize("name", ARMS)
def test_small_loads_add_up_are_reciprocal_and_half_their_work_is_in_the_springs(name: str) -> None:
    arm, turns = arm_of(name, TOOL), []

    def gear(torque: Array) -> Array:
        turns.append(torque / arm.prior)
        return turns[-1]
    force = 30.0 * np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 1]])
    tcp = equilibrium(arm, Structure(gear, weight=0), np.radians([POSES[arm.maker]] * 5), force).tcp
    moved = tcp[1:] - tcp[0]
    assert moved[3] == pytest.approx(moved[:3].sum(0), rel=2e-3, abs=1e-8)
    assert moved[:3] == pytest.approx(moved[:3].T, rel=3e-3, abs=1e-8)
    assert (arm.prior * turns[-1][1:] ** 2).sum(1) == pytest.approx((force[1:] * moved).sum(1), rel=2e-3)


def test_a_rods_drive_2_carries_the_forearm_and_does_not_turn_it() -> None:
    arm, force = arm_of("irb6660-205-1.90", TOOL), np.array([[0, 0, 0], [0, 0, -500.0]])
    for drive, turned, lifted in ((1, False, True), (2, True, False)):
        soft = Structure(times(1e-6 * np.eye(6)[drive]), weight=0)
        stance = equilibrium(arm, soft, np.radians([POSES["ABB"]] * 2), force)
        assert (np.abs(np.diff(stance.tool, axis=0)).max() > 1e-5) == turned
        assert (np.abs(np.diff(stance.places[:, 3], axis=0)).max() > 1e-5) == lifted


def test_a_beam_is_that_of_the_books_and_a_turn_is_one() -> None:
    shift, turn = beam(np.array([1.0, 0, 0]), 2.0, 3e-6, 1e-6)(np.array([[0, 100.0, 0]]), np.zeros((1, 3)))
    assert shift[0] == pytest.approx([0, 3e-6 * 4 / 3 * 100, 0])        # F L^3 / 3 EI
    assert turn[0] == pytest.approx([0, 0, 3e-6 * 100])                 # F L^2 / 2 EI
    assert turning(np.array([[0, 0, np.pi / 2]]))[0] @ [1, 0, 0] == pytest.approx([0, 1, 0])


def test_what_lags_lags_and_what_lies_on_a_side_stays() -> None:
    assert play(np.array([0, 1, 3, 2.5, 0.0]), 1.0, np.zeros(5)).tolist() == [0, 0, 2, 2, 1]
    assert side(np.array([0, 5, 0, -5, 0.0]), 1.0, np.zeros(5), -np.ones(5)).tolist() == [-1, 1, 1, -1, -1]


def test_springs_alone_leave_nothing_and_every_cause_something(tmp_path: Path) -> None:
    rng = np.random.default_rng(3)
    one = {design: trial("irb6700-235-2.65", design, INSTRUMENTS[1], rng) for design in ("cable", "dead weights")}
    plain = {design: table_of(test, NOTHING.make(rng, test, 0), rng, noise=False) for design, test in one.items()}
    assert visible(one["cable"], plain["cable"]) < 0.01
    written(one["cable"], plain["cable"], sheet_of(one["cable"], rng), {}, tmp_path / "case")
    assert len((tmp_path / "case/measurements.csv").read_text().splitlines()) == len(one["cable"].visit) + 1
    for cause in CAUSES:
        design = next(design for design in one if design in cause.designs)
        hidden = cause.make(np.random.default_rng(1), one[design], cause.size)
        other = table_of(one[design], hidden, np.random.default_rng(2), noise=False)
        assert any(not np.allclose(other[key], plain[design][key], rtol=1e-6, atol=1e-8) for key in other), cause.name
        assert deflections(one[design], hidden, rng)[one[design].begins] == pytest.approx(0, abs=1e-12)


def test_answers_are_judged() -> None:
    assert {cause.name for cause in CAUSES} == set(RIGHT)
    for hidden, verdict, effect, joint, grade in (
            ("backlash", "named", "backlash", 4, "right"), ("backlash", "named", "backlash", 5, "half"),
            ("backlash", "named", "drift", None, "wrong"), ("backlash", "ambiguous", "backlash", 4, "set with the truth"),
            ("backlash", "unknown", "backlash", 4, "unknown"), ("backlash", "adequate", "backlash", 4, "missed"),
            ("nothing", "unknown", "drift", None, "alarm")):
        told = [{"effect": effect, "joint": joint}]
        answer = {"verdict": verdict, "mistakes": [], "causes": told if verdict == "named" else [],
                  "alternatives": [] if verdict == "named" else told}
        assert judged({"cause": hidden, "joint": 4}, answer)[0] == grade


@pytest.mark.parametrize(("seed", "number", "count", "verdict", "name"), [
    (8300, 36, 60, "named", "tool_play"),
    # Long: a forearm that bends is named in tests/runs/hidden_effects/test_structure.py, such a zero in
    # tests/second_cell/test_answers.py, play of that gear in the desk's load tests.
    pytest.param(8100, 15, 48, "named", "link_bending[3]", marks=pytest.mark.long),
    pytest.param(8100, 25, 48, "mistake", "joint_zero[4]", marks=pytest.mark.long),
    pytest.param(8100, 1, 48, "named", "backlash[6]", marks=pytest.mark.long)])
def test_what_had_been_noise_or_another_gear_is_named(
    seed: int, number: int, count: int, verdict: str, name: str, tmp_path: Path,
) -> None:
    """A forearm and a zero that forces set up anew had taken up, play of gear 6 under a spindle beside its axis, and a loose
    clamp that most visits begin at the same end."""
    cause = next(islice(deck(count, np.random.default_rng(seed)), number, None))
    rng = np.random.default_rng([seed, number])
    one, hidden, _, _, _ = case(cause, rng)
    written(one, table_of(one, hidden, rng), sheet_of(one, rng), {"cause": cause.name}, tmp_path / "case")
    cell = compstiff.read_cell(tmp_path / "case" / "cell.yaml")
    found = compstiff.diagnose(cell, compstiff.read_measurements(tmp_path / "case" / "measurements.csv", cell), replicates=39)
    assert found.verdict == verdict
    named = [cause.label for cause in found.judgement.causes] or [mistake.key for mistake in found.judgement.mistakes]
    assert named == [name]


def test_a_heavy_arm_that_gives_way_by_millimetres_is_no_cause(tmp_path: Path) -> None:
    """Nothing is hidden (10500, 34): a forearm that bends had been named, for want of the weight of forearm and wrist."""
    rng = np.random.default_rng([10500, 34])
    one, hidden, *_ = case(NOTHING, rng)
    written(one, table_of(one, hidden, rng), sheet_of(one, rng), {}, tmp_path / "case")
    cell = compstiff.read_cell(tmp_path / "case" / "cell.yaml")
    fitted = posterior(LoadTest.of(cell, compstiff.read_measurements(tmp_path / "case" / "measurements.csv", cell)))
    assert goodness_of_fit(fitted, effects(), np.random.default_rng(0), 99).p_value > 0.1


# Long: a pose with a wrong angle is named in tests/identification/fit/test_laws_visits.py, and by its odds in
# test_laws_wrong_angle.py there.
@pytest.mark.long
def test_a_wrong_angle_is_not_a_gear_that_explains_some_of_it(tmp_path: Path) -> None:
    """Axis 2 is 2.9 degrees off at one pose (11 sigma): gear 5 as one that softens had been named, by far less evidence."""
    mistyped, rng = next(cause for cause in CAUSES if cause.name == "angle_mistyped"), np.random.default_rng([53000, 18])
    one, hidden, _, _, _ = case(mistyped, rng)
    written(one, table_of(one, hidden, rng), sheet_of(one, rng), {"cause": mistyped.name}, tmp_path / "case")
    cell = compstiff.read_cell(tmp_path / "case" / "cell.yaml")
    found = compstiff.diagnose(cell, compstiff.read_measurements(tmp_path / "case" / "measurements.csv", cell), replicates=39)
    bad, = found.judgement.bad_visits
    assert found.verdict == "named"
    assert found.judgement.causes == ()
    assert bad.score.name == hidden.told["pose"]
    assert bad.score.wrong_angle is not None
    assert bad.score.wrong_angle.joint == hidden.told["joint"]

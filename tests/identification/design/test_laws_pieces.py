"""The pieces of a plan worked out by hand: its rows and their times, its order, what is kept back, its forecast."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise, permutations
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose

from identification.common.findings import CompstiffError
from identification.design import forecast as forecasts
from identification.design import unseen
from identification.design.certificate import Certificate, _Bounds, bound_over, splits_of
from identification.design.criteria import d_criterion
from identification.design.dead_weights import DeadWeights, check_payload
from identification.design.domain import Pool, random_pool
from identification.design.forecast import Forecast, joint_forecasts, spread
from identification.design.kept_back import distances, kept_back
from identification.design.loads import CYCLE, FREE, slot, weight_slot
from identification.design.milling import assumed_force
from identification.design.order import imbalance, load_axes, run_order, travel
from identification.design.program import _load, _weights, approaches, rapid_program
from identification.design.sheet import as_measurements, sheet_of, sheet_text
from identification.design.task import Demand, Task, free_demand
from identification.design.unseen import across
from identification.model.cell import read_cell
from identification.model.inverse import inverse, nearest_solution
from identification.model.kinematics import forward
from identification.model.rotations import Frame
from tests.identification.design.conftest import CELL
from tests.support import write_cell

FALL = np.array([0.0, 0.0, -9.80665])
THETA = np.radians([[1.0, 2, 3, 4, 5, 6], [10, 20, 30, 40, 50, 60], [-1, -2, -3, -4, -5.1234567, -6]])


def pool_of(slots: list[int], theta: np.ndarray = THETA, line: np.ndarray | None = None) -> Pool:
    count = len(slots)
    line = np.tile([1.0, 0, 0], (count, 1)) if line is None else line
    return Pool(theta, np.array(slots), np.zeros(count, dtype=int), line, np.zeros((count, 6, 6)))


def test_a_sheet_s_rows_are_those_of_its_schedule():
    """Runs 0 and 2 along x, 1 along y and kept back, twice: the second time backwards, x the other way from run to run."""
    slots = slot("x", "single", 300.0), slot("y", "single", 200.0)
    sheet = sheet_of(pool_of([0, 1, 0]), slots, np.array([2, 0, 1]), 2, np.array([False, True, False]), "P")
    assert sheet.label == ("P01", "P02", "V01", "P02/2", "P01/2")
    assert sheet.axes == ("x", "x", "y", "x", "x")
    assert sheet.run.tolist() == [2, 0, 1, 0, 2]
    assert sheet.validate.tolist() == [False, False, True, False, False]
    assert sheet.visit.tolist() == [0, 0, 1, 1, 2, 2, 3, 3, 4, 4]
    assert_allclose(np.degrees(sheet.theta[0]), [-1, -2, -3, -4, -5.123457, -6], atol=1e-12)
    assert_allclose(sheet.force[1::2], [[300, 0, 0], [-300, 0, 0], [0, 200, 0], [300, 0, 0], [-300, 0, 0]])
    assert not sheet.force[::2].any()
    # Two minutes to the next pose, ten seconds to change a load, held for 5 s and 20 s.
    assert sheet.dwell.tolist() == [5, 20] * 5
    assert sheet.time.tolist() == [v * 165 + t for v in range(5) for t in (15, 45)]
    rows = as_measurements(sheet)
    assert_allclose(rows.wrench, np.column_stack([sheet.force, np.zeros((10, 3))]))
    assert np.isnan(rows.deflection).all()
    assert rows.validate.tolist() == [k in (4, 5) for k in range(10)]
    assert (rows.row.tolist(), rows.line.tolist()) == (list(range(1, 11)), list(range(2, 12)))
    assert rows.pose.tolist() == [label for label in sheet.label for _ in range(2)]
    kept, fitted = sheet.of_purpose(True), sheet.of_purpose(False)
    assert (kept.label, kept.visit.tolist(), kept.time.tolist()) == (("V01",), [0, 0], [345, 375])
    assert (fitted.label, fitted.visit.tolist()) == (("P01", "P02", "P02/2", "P01/2"), [0, 0, 1, 1, 2, 2, 3, 3])
    assert_allclose(fitted.force, np.delete(sheet.force, [4, 5], axis=0))
    (told,) = kept.visits_as_dicts()
    assert told == {"pose": "V01", "loads_along": "y", "q_deg": pytest.approx([10, 20, 30, 40, 50, 60]), "purpose": "validate"}
    text = sheet_text(sheet, ["a plan", "two\nlines"]).splitlines()
    assert text[:2] == ["# a plan", "# two lines"]
    assert text[2] == ("q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg,fx_n,fy_n,fz_n,dx_um,dy_um,dz_um,time_s,dwell_s,reference,"
                       "pose,purpose")
    assert text[4].startswith("-1.000000,-2.000000,-3.000000,-4.000000,-5.123457,-6.000000,300,0,0,")
    assert sheet.lines()[1] == "P01    x                        -1.00    -2.00    -3.00    -4.00    -5.12    -6.00"


def test_a_sheet_of_lines_of_their_own_says_where_they_point():
    line = np.array([[0.6, 0.0, -0.8], [0, 1, 0], [0, 0, 1.0]])
    free, none_kept = slot(FREE, "cycle", 300.0), np.zeros(3, dtype=bool)
    sheet = sheet_of(pool_of([0, 0, 0], line=line), (free,), np.arange(3), 1, none_kept, "A")
    assert sheet.label == ("A01", "A02", "A03")
    assert_allclose(sheet.force[:7], np.round(300 * np.outer(CYCLE, line[0]), 2))
    assert_allclose(sheet.force[7:14], -np.round(300 * np.outer(CYCLE, line[1]), 2))
    assert [sheet.along(visit) for visit in range(3)] == ["(+0.60 +0.00 -0.80)", "(+0.00 -1.00 +0.00)", "(+0.00 +0.00 +1.00)"]
    assert sheet.dwell[:7].tolist() == [5, 20, 5, 20, 5, 20, 5]


def test_a_sheet_of_weights_says_what_to_hang_and_is_never_turned_round():
    hung = weight_slot(DeadWeights.of("20,40,20+40"), "cycle", FALL)
    sheet = sheet_of(pool_of([0, 0, 0]), (hung,), np.arange(3), 1, np.zeros(3, dtype=bool), "P")
    assert_allclose(sheet.force, np.round(np.outer([0, 20, 40, 60, 40, 0] * 3, FALL), 2))
    assert sheet.masses(1) == [0, 20, 40, 60, 40, 0]
    assert sheet.along(0) == "hung 20 40 60 40 kg"
    assert [sheet.handling(row) for row in range(7)] == [
        "no weights", "hang on 20 kg", "take off 20 kg, then hang on 40 kg", "hang on 20 kg", "take off 20 kg",
        "take off 40 kg", "no weights"]
    assert sheet.lifted_kg == 3 * (20 + 60 + 20 + 20 + 40)
    # Carried for 40 s, still after 20 s and a minute.
    assert sheet.time[:7].tolist() == [60, 160, 220, 320, 380, 480, 660]
    assert sheet.visits_as_dicts()[0]["mass_kg"] == [0, 20, 40, 60, 40, 0]
    assert ",mass_kg,dx_um" in sheet_text(sheet, []).splitlines()[0]
    assert sheet_text(sheet, []).splitlines()[4].split(",")[6] == "60"


def test_an_order_is_the_shortest_of_all_where_the_axes_are_balanced():
    """Of five poses every order is looked at: the slowest joint's time between them, and half a minute for each half plan that
    an axis' mean place is off the middle."""
    rng = np.random.default_rng(7)
    theta, speed, axis = rng.uniform(-2, 2, (5, 6)), np.array([1.0, 2, 1.5, 3, 2.5, 4]), np.array([0, 1, 0, 1, 0])
    times = travel(theta, speed)
    assert times[1, 3] == pytest.approx(max(abs(theta[1] - theta[3]) / speed))

    def cost(order: tuple[int, ...]) -> float:
        moves = sum(max(abs(theta[a] - theta[b]) / speed) for a, b in pairwise(order))
        places = [np.mean([order.index(run) for run in range(5) if axis[run] == which]) - 2 for which in (0, 1)]
        return float(moves + 30 * max(map(abs, places)) / 2.5)

    best = min(permutations(range(5)), key=cost)
    found = tuple(run_order(theta, axis, speed, np.random.default_rng(0)).tolist())
    assert cost(found) == pytest.approx(cost(best))
    assert imbalance(np.array([0, 1, 2, 3]), np.array([0, 0, 1, 1])) == pytest.approx(0.5)
    assert imbalance(np.array([0, 2, 3, 1]), np.array([0, 0, 1, 1])) == 0
    assert imbalance(np.array([3, 0, 1, 2]), np.array([0, 0, 0, 1])) == pytest.approx(1.5 / 2)
    assert imbalance(np.arange(3), np.zeros(3, dtype=int)) == 0


def test_what_an_order_balances_is_the_slot_or_the_axis_nearest_to_a_line_of_its_own():
    line = np.array([[0.6, 0.0, -0.8], [0, -1, 0], [0.8, 0.6, 0]])
    assert load_axes(pool_of([0, 0, 0], line=line)).tolist() == [2, 1, 0]
    assert load_axes(pool_of([0, 1, 0], line=line)).tolist() == [0, 1, 0]


def test_poses_are_kept_back_that_are_farthest_from_all_others(domain):
    """In shares of the joints' ranges; a whole turn is no distance. Each slot in turn."""
    scale = np.array([1.0, 2, 1, 1, 1, 1])
    far = distances(np.zeros((1, 6)), np.array([[0.3, 0.8, 0, 0, 0, 0], [0, 0, 0, 0, 0, 2 * np.pi - 0.1]]), scale)
    assert_allclose(far, [[0.5, 0.1]])
    ranges = np.ptp(domain.rig.cell.robot.limits, axis=1)
    steps = np.array([0.1, 0.25, 0.4, 0.3, 0.05, 0.39])
    theta = np.zeros((6, 6))
    theta[:, 1] = steps * ranges[1]
    theta[5, 1], theta[5, 2] = 0.0, 0.39 * ranges[2]
    runs = pool_of([0, 1, 0, 1, 2, 0], theta)
    fitted = pool_of([0], np.zeros((1, 6)))
    chosen = kept_back(domain, runs, fitted, 4)
    assert chosen.slot.tolist() == [0, 1, 2, 0]
    # 0.4 from what is fitted; then, of the second slot, 0.25 is 0.15 from it and 0.3 only 0.1; then the one of the third.
    assert_allclose(chosen.theta, theta[[2, 1, 4, 5]])


@pytest.mark.parametrize(("mass", "refused"), [(125.0, False), (125.1, True)])
def test_weights_and_tool_are_no_more_than_the_robot_carries(tmp_path, mass, refused):
    """205 kg, 80 of which are the tool."""
    cell = read_cell(write_cell(tmp_path, CELL))
    weights = DeadWeights.of(f"20,{mass}")
    if not refused:
        check_payload(weights, cell)
        return
    with pytest.raises(CompstiffError) as told:
        check_payload(weights, cell)
    (finding,) = told.value.findings
    assert (finding.code, finding.file) == ("CS1512", str(cell.source))
    assert finding.message == "125.1 kg hung on the tool of 80 kg are over the 205 kg that irb6660-205-1.90 carries"
    bare = read_cell(write_cell(tmp_path, "robot: irb6660-205-1.90\ntool: {position_mm: [120, 0, 250]}\n"))
    with pytest.raises(CompstiffError, match=r"205\.1 kg hung on the tool are over the 205 kg"):
        check_payload(DeadWeights.of("205.1"), bare)


@pytest.mark.parametrize(("fall", "first"), [
    ((0, 0, -9.81), (1, 0, 0)), ((-9.81, 0, 0), (0, 1, 0)), ((-5.886, 0, -7.848), (0, 1, 0))])
def test_sideways_is_all_round_across_gravity(fall, first):
    found = across(np.array(fall), 16)
    down = np.array(fall) / np.linalg.norm(fall)
    assert_allclose(found @ down, 0, atol=1e-12)
    assert_allclose(np.linalg.norm(found, axis=1), 1)
    assert_allclose(found[0], first, atol=1e-12)
    turns = np.arctan2(np.cross(found[0], found) @ -down, found @ found[0])
    assert_allclose(np.mod(turns[1:], 2 * np.pi), 2 * np.pi * np.arange(1, 16) / 16, atol=1e-12)


@pytest.mark.parametrize(("log_std", "words"), [
    (0.05, "to 10 %"), (0.149, "to 30 %"), (0.151, "within a factor 1.4"), (1.0, "within a factor 7.4")])
def test_two_sigma_are_a_share_while_that_is_one(log_std, words):
    assert spread(log_std) == words


def test_a_joint_s_grade_and_its_partner_are_those_of_the_covariance(cell, monkeypatch):
    """A fifth is reliable; two thirds of the prior's spread are not identifiable; 0.7 is a trade-off."""
    prior = cell.prior.log_std
    after = np.array([0.2, 0.201, 0.666 * prior[2], 0.668 * prior[3], 0.1, 0.05])
    alike = np.eye(6)
    alike[0, 1] = alike[1, 0] = -0.7
    alike[4, 5] = alike[5, 4] = 0.69
    covariance = alike * np.outer(after, after)
    monkeypatch.setattr(forecasts, "stated_covariance", lambda task, runs: covariance)
    design: Any = SimpleNamespace(task=SimpleNamespace(prior=np.diag(prior**-2.0), domain=SimpleNamespace(
        rig=SimpleNamespace(cell=cell))), runs=None)
    found = joint_forecasts(design)
    assert [one.joint for one in found] == [1, 2, 3, 4, 5, 6]
    assert_allclose([one.before for one in found], prior)
    assert_allclose([one.after for one in found], after)
    assert [one.grade for one in found] == ["reliable", "tentative", "tentative", "not identifiable", "reliable", "reliable"]
    assert [one.partner for one in found] == [2, 1, 0, 0, 0, 0]
    assert [one.correlation for one in found] == pytest.approx([-0.7, -0.7, 0, 0, 0, 0])
    told = Forecast(found, (), {}, (1, 4), (1.0, 2.0), (0.5, 0.05))
    assert told.joint_lines()[0] == (f"k1  known within a factor 1.5 (2 sigma; before {spread(prior[0])}), reliable, trades "
                                     "off with k2 (-0.70)")
    assert told.length_lines()[0].endswith("each planned for the criterion: 1: a factor 2.7, 4: 10 %")
    assert found[0].as_dict()["trades_off_with"] == "k2"
    assert found[4].as_dict()["trades_off_with"] is None


def test_a_retreat_is_up_or_back_with_the_tool_as_it_stands(domain):
    """The first of five that the arm reaches in the same configuration, no joint more than 45 degrees away; high up all of them
    are met."""
    high = random_pool(replace(domain, positions=np.array([[1.0, 0.0, 1.6]])), 400, np.random.default_rng(4))
    theta = np.unique(high.theta, axis=0)
    behind = approaches(domain, theta)
    found = np.isfinite(behind).all(axis=1)
    assert found.mean() > 0.8
    count = len(theta)
    arm, tool = domain.rig.cell.robot, domain.rig.cell.flange_from_tcp
    here, there = forward(arm, theta, tool), forward(arm, behind[found], tool)
    assert_allclose(there.rotation, here.rotation[found], atol=1e-9)
    assert (arm.limit_excess(behind[found]) <= 0).all()
    assert np.abs(behind - theta)[found].max() < np.radians(45)
    level = here.position[:, :2] / np.linalg.norm(here.position[:, :2], axis=1, keepdims=True)
    ways = [np.column_stack([out * level, np.full(count, up)]) for out, up in (
        (0, 0.15), (-0.1, 0.1), (-0.15, 0), (0, 0.05), (-0.05, 0))]
    off = np.array([np.linalg.norm(there.position - here.position[found] - way[found], axis=1) for way in ways])
    assert off.min(axis=0).max() < 1e-9
    taken = off.argmin(axis=0)
    assert np.mean(taken == 0) > 0.5
    assert {*taken.tolist()} == {0, 1, 2, 3, 4}
    # None before it fits: not reached, beyond a limit, or turned too far.
    for number, (one, way) in enumerate(zip(np.flatnonzero(found), taken, strict=True)):
        for earlier in ways[:way]:
            base = forward(arm, theta[one: one + 1], Frame.identity())
            moved = Frame(base.rotation, base.position + earlier[one])
            angles, branch = nearest_solution(arm, inverse(arm, moved), theta[one: one + 1])
            assert (branch[0] < 0 or np.abs(angles - theta[one]).max() >= np.radians(45)
                    or (arm.limit_excess(angles) > 0).any()), number


def test_a_program_drives_to_each_pose_and_asks_for_each_of_its_loads(domain):
    """Two poses, the second one in front of a wall that no retreat gets by: word for word."""
    slots = slot("x", "single", 300.0), slot("y", "single", 200.0)
    near = np.radians([[10.0, 20, 10, 30, 40, 50], [70, 0, 5, 105, -119.9, -122]])
    sheet = sheet_of(pool_of([0, 1], near), slots, np.arange(2), 1, np.zeros(2, dtype=bool), "P")
    assert sheet.force.tolist() == [[0, 0, 0], [300, 0, 0], [0, 0, 0], [0, 200, 0]]
    behind = np.degrees(approaches(domain, near))
    assert np.isfinite(behind).all(axis=1).tolist() == [True, False]

    def joints(degrees):
        return "[[" + ",".join(f"{angle:.6f}" for angle in degrees) + "],[9E9,9E9,9E9,9E9,9E9,9E9]]"

    def ask(words, key):
        return f'TPReadFK nAnswer,"{words}",stEmpty,stEmpty,stEmpty,stEmpty,"{key}";'

    lines = ["%%%", "VERSION:1", "LANGUAGE:ENGLISH", "%%%", "MODULE two_poses", "! one line", "! and another",
             "PERS tooldata tMeasure:=[TRUE,[[120.0000,0.0000,250.0000],[1.00000000,0.00000000,0.00000000,0.00000000]],"
             "[80,[0,0,120],[1,0,0,0],0,0,0]];", "PROC main()", "VAR num nAnswer;", "TPErase;",
             ask("Measure 2 poses. Sensors and cylinder out of the way?", "Go")]
    for number, (label, load, rows) in enumerate((("P01", "Fx = +300 N", (1, 2)), ("P02", "Fy = +200 N", (3, 4)))):
        there = f"MoveAbsJ {joints(np.degrees(near[number]))}\\NoEOffs,v20,fine,tMeasure;"
        lines += [f"! {number + 1} of 2: {label}", ask(f"{label} ({number + 1} of 2): way to the pose clear?", "Go"),
                  *([f"MoveAbsJ {joints(behind[0])}\\NoEOffs,v200,fine,tMeasure;"] if number == 0 else []), there,
                  ask(f"{label}: place the sensors, set them to zero without load", "Done"),
                  ask(f"{label}: no load. Then hold 5 s", "Done"), "WaitTime 5;",
                  ask(f"{label}, row {rows[0]}, no load: write down dx dy dz and the time", "Written"),
                  ask(f"{label}: {load}. Then hold 20 s", "Done"), "WaitTime 20;",
                  ask(f"{label}, row {rows[1]}, {load}: write down dx dy dz and the time", "Written"),
                  ask(f"{label}: load off, sensors and cylinder out of the way?", "Go"),
                  *([f"MoveAbsJ {joints(behind[0])}\\NoEOffs,v20,fine,tMeasure;"] if number == 0 else [])]
    lines += ['TPWrite "All poses measured.";', "ENDPROC", "ENDMODULE"]
    program = rapid_program(domain, sheet, "two poses", ["one line", "and\nanother"])
    text = program.content.decode("ascii")
    assert [line.strip() for line in text.splitlines() if line.strip()] == lines
    assert text.startswith("%%%\n  VERSION:1\n")
    assert text.endswith("ENDMODULE\n")
    assert "\n\n\n" not in text
    assert [(one.code, one.message.split(":")[0]) for one in program.findings] == [
        ("CS1604", "no retreat within the joint limits for P02")]


@pytest.mark.parametrize(("force", "digits", "words"), [
    ((0, 0, 0), 1, "no load"), ((0, -150, 0), 1, "Fy = -150 N"), ((0, 0, 66.67), 0, "Fz = +66.67 N"),
    ((100.04, -0.01, 20), 1, "F = (100.0 -0.0 20.0) N"), ((100.6, -33, 20), 0, "F = (101 -33 20) N")])
def test_a_load_as_the_operator_sets_it(force, digits, words):
    assert _load(np.array(force, float), digits) == words


def test_a_prompt_of_many_weights_is_cut_to_what_hangs():
    hung = weight_slot(DeadWeights.of("2.5+5,10+12.25+15.125+17.75+20.125"), "cycle", FALL)
    sheet = sheet_of(pool_of([0]), (hung,), np.arange(1), 1, np.zeros(1, dtype=bool), "P")
    assert _weights(sheet, "P01", 1) == "P01: hang on 2.5 + 5 kg. Still for 60 s"
    assert _weights(sheet, "P01", 2) == "P01: change to 75.25 kg in all. Still for 20 s"


def certificate_of(value: float, splits: int, starts: int) -> Certificate:
    """Bound 10, with fractions of runs 12; a pool alone would claim 93 %."""
    none = pool_of([], np.zeros((0, 6)))
    return Certificate(value / 10, 10.0, value, 9.5, 12.0, 0.93, starts, 3, splits, none, np.empty(0), 0.2, none)


def test_a_certificate_says_what_it_holds_and_on_what_condition():
    """Shares are rounded down: no plan is said to be better than it is."""
    whole, fractions = certificate_of(8.9999, 2, 48), certificate_of(9.0, 1, 1)
    before = "efficient against every plan with as many runs and the same loads and place, over continuous poses"
    assert whole.sentence == (
        f"at least 89.9 % {before} (equivalence theorem, poses as fractions, runs an axis as whole numbers; 74.9 % with "
        "fractions of these too; its maxima were searched from 48 starts, not proved)")
    assert fractions.sentence == (
        f"at least 90.0 % {before} (equivalence theorem, poses as fractions; its maxima were searched from 1 start, not "
        "proved)")
    assert fractions.as_dict() == {
        "efficiency": 0.9, "words": fractions.sentence, "value": 9.0, "bound": 10.0, "gap": 0.2, "starts": 1, "rounds": 3,
        "relaxed_bound": 12.0, "splits": 1, "pool_only_claim": 0.93}


@pytest.mark.parametrize(("value", "efficiency", "bound", "relaxed", "claim"), [
    (8.0, 0.8, 10, 12, 0.93 * 8 / 9), (9.5, 0.95, 10, 12, 0.93 * 9.5 / 9), (9.9, 0.99, 10, 12, 1.0), (11.0, 1.0, 11, 12, 1.0),
    (13.0, 1.0, 13, 13, 1.0)])
def test_of_another_plan_the_same_bound_holds_or_that_plan_itself(value, efficiency, bound, relaxed, claim):
    other = certificate_of(9.0, 2, 48).of_plan(value)
    assert (other.value, other.bound, other.relaxed) == (value, bound, relaxed)
    assert (other.efficiency, other.pool_efficiency) == pytest.approx((efficiency, claim))
    assert (other.optimum, other.starts, other.splits) == (9.5, 48, 2)


@pytest.mark.parametrize(("slots", "runs", "count"), [
    ([2], [1999], 2000), ([2], [2000], None), ([3], [61], 1953), ([3], [62], None), ([3, 3], [8, 7], 45 * 36),
    ([3, 3], [8, 8], None), ([1, 1], [5, 4], 1)])
def test_up_to_two_thousand_numbers_of_runs_a_slot_are_told_apart(slots, runs, count):
    found = splits_of(Demand(np.repeat(np.arange(len(slots)), slots), np.repeat(np.arange(len(runs)), runs)))
    if count is None:
        assert found is None
        return
    assert found is not None
    assert found.shape == (count, sum(slots)) == np.unique(found, axis=0).shape
    for group, wanted in enumerate(runs):
        assert (found[:, np.repeat(np.arange(len(slots)), slots) == group].sum(axis=1) == wanted).all()


def test_a_bound_is_the_best_run_of_each_slot_as_often_as_it_is_taken():
    """By loops over runs, slots and tangents, each run visited twice; a split's bound is its smallest, and with fractions the
    best slot of a group stands for all its runs."""
    rng = np.random.default_rng(3)
    roots = rng.normal(size=(14, 6, 6))
    told = roots @ np.swapaxes(roots, 1, 2)
    slots = np.array([0, 1, 0, 1, 1, 0, 0, 1])
    runs = replace(pool_of(slots.tolist(), np.zeros((8, 6))), information=told[:8])
    tangents, prior = told[8:11], told[11]
    nowhere: Any = None
    task = Task(nowhere, d_criterion(), prior, free_demand(2, 3), 2)
    splits = splits_of(task.demand)
    assert splits is not None
    bounds = _Bounds(task, splits)
    bounds.add(tangents[0], runs.take(np.arange(4)))
    bounds.add(tangents[1], runs.take(np.arange(4)))
    bounds.see(runs.take(np.arange(4, 8)))
    bounds.add(tangents[2], runs)
    best = np.array([[max(np.sum(one * told[k]) for k in range(8) if slots[k] == s) for s in (0, 1)] for one in tangents])
    wanted = np.array([[np.sum(one * prior) + 2 * (n[0] * b[0] + n[1] * b[1]) for n in splits]
                       for one, b in zip(tangents, best, strict=True)])
    assert_allclose(bounds.table, wanted)
    assert_allclose(bounds.of_splits, wanted.min(axis=0))
    for one, b in zip(tangents, best, strict=True):
        assert bound_over(task, one, runs) == pytest.approx(np.sum(one * prior) + 2 * 3 * b.max())
    paper = replace(task, demand=Demand(np.array([0, 1]), np.array([0, 0, 1])))
    assert bound_over(paper, tangents[0], runs) == pytest.approx(
        np.sum(tangents[0] * prior) + 2 * (2 * best[0, 0] + best[0, 1]))


def test_a_load_goes_up_in_thirds_and_through_zero_to_the_other_side():
    """Half of it there, and all; or on and off. Without a log a cutting force is 100 N along each axis."""
    assert slot("y", "cycle", 300.0).forces[:, 1] == pytest.approx([0, 100, 200, 300, 0, -150, -300])
    assert slot("y", "single", 300.0).forces[:, 1] == pytest.approx([0, 300])
    assert not slot("y", "cycle", 300.0).forces[:, [0, 2]].any()
    assert_allclose(assumed_force(), np.diag([1e4, 1e4, 1e4]))


@pytest.mark.parametrize(("told", "seen"), [
    ([1, 1, 1, 1, 1.9e-3, 2.1e-3], [0, 1, 2, 3, 5]), ([1, 1, 2.1e-3, 1, 1, 2.1e-3], None), ([1.9e-3] * 6, None),
    ([0, 1, 1, 1, 1, 1], [1, 2, 3, 4, 5])])
def test_what_no_plan_narrows_by_a_twentieth_of_a_per_cent_is_unseen(monkeypatch, told, seen):
    """Two runs that tell a thousandth of the prior's precision between them, here of 4, narrow it so far; where everything is
    seen, or nothing, there is no part of it to speak of."""
    runs = replace(pool_of([0, 0], np.zeros((2, 6))), information=np.stack([np.diag(told), np.diag(told) / 2]))
    monkeypatch.setattr(unseen, "random_pool", lambda *_: runs)
    nowhere: Any = None
    found = unseen.seen_by(nowhere, 4.0 * np.eye(6), 2, np.random.default_rng(0))
    assert (found is None) == (seen is None)
    if found is not None:
        assert_allclose(found @ found.T, np.diag(np.isin(np.arange(6), seen).astype(float)), atol=1e-12)

"""From what is asked for to the task: where the tool stands, which loads, by which criterion, and what excludes each other."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from identification.common.findings import CompstiffError
from identification.design.loads import FREE
from identification.design.milling import MillingPoses, assumed_force, prediction_weight
from identification.design.request import Request, default_position, measured_place, prepare
from identification.model.cell import Cell, read_cell
from identification.model.kinematics import forward
from identification.model.rotations import Frame
from tests.identification.design.conftest import CELL
from tests.support import random_poses, robot, write_cell


@pytest.fixture(scope="module")
def program(cell: Cell) -> MillingPoses:
    theta = random_poses(cell.robot, 3, np.random.default_rng(5), 0.6)
    tools = Frame.from_quaternion(np.tile([0.12, 0, 0.25], (3, 1)), np.tile([1.0, 0, 0, 0], (3, 1)))
    tcp = np.array([[1.0, 0.1, 0.8], [1.2, 0.0, 0.9], [1.1, 0.2, 0.7004]])
    return MillingPoses(theta, tools, tcp, "part.mod", 3, assumed_force())


@pytest.mark.parametrize(("asked", "with_program", "positions", "box", "words"), [
    # Axis 2 is 300 mm out and 814.5 mm up; 65 % of 700 + hypot(280, 893) mm further out.
    ({}, False, [[1.36, 0, 0.81]], None,
     "TCP at (1360, 0, 810) mm in the base frame, in front of the robot (--position names another)"),
    ({}, True, [[1.1, 0.1, 0.8]], None, "TCP at (1100, 100, 800) mm in the base frame, the middle of the program"),
    ({"positions_mm": ((1000.0, 10.0, 800.0), (1200.5, -5.0, 900.0))}, True, [[1, 0.01, 0.8], [1.2005, -0.005, 0.9]], None,
     "TCP at (1000, 10, 800), (1200.5, -5, 900) mm in the base frame"),
    ({"box_mm": (1100.06, -100.0, 900.0, 900.0, 100.0, 700.04)}, False, None, [[0.9, -0.1, 0.70004], [1.10006, 0.1, 0.9]],
     "TCP anywhere in the box (900, -100, 700) to (1100.1, 100, 900) mm")])
def test_the_tool_stands_where_it_is_asked_to_or_in_front_of_the_robot_or_where_it_mills(
    cell: Cell, program: MillingPoses, asked: dict[str, Any], with_program: bool, positions: list[list[float]] | None,
    box: list[list[float]] | None, words: str,
) -> None:
    prepared = prepare(cell, Request(**asked), program if with_program else None)
    assert prepared.place == words
    for found, wanted in ((prepared.task.domain.positions, positions), (prepared.task.domain.box, box)):
        assert (found is None) == (wanted is None)
        assert found is None or found == pytest.approx(np.array(wanted), abs=1e-12)


def test_two_thirds_of_the_stretched_arm_are_in_front_of_the_robot() -> None:
    for name in ("irb6660-205-1.90", "irb6700-200-2.60", "kr210-r2700-extra"):
        arm = robot(name)
        out, side, height = default_position(arm)
        assert (side, height) == (0, arm.d[0])
        stretched = arm.a[2] + np.hypot(arm.a[3], arm.d[3])
        assert out == pytest.approx(0.35 * arm.a[1] + 0.65 * (arm.a[1] + stretched))


def test_rows_within_two_centimetres_are_one_place_and_others_a_box() -> None:
    tcp = np.array([[1.0, 0.2, 0.8], [1.0, 0.21, 0.8], [1.0, 0.2, 0.8000449]])
    for size, one in ((1.99, True), (2.01, False)):
        spread = tcp[0] + (tcp - tcp[0]) * [1, size, 1]
        positions, box = measured_place(spread)
        assert (positions is None, box is None) == (not one, one)
        if positions is not None:
            assert positions == pytest.approx(np.array([[1.0, 0.2066, 0.8]]), abs=1e-12)       # to a tenth of a millimetre
        if box is not None:
            assert box == pytest.approx(np.array([[1.0, 0.2, 0.8], [1.0, 0.2201, 0.8000449]]))


@pytest.mark.parametrize(("asked", "slots", "counts", "rows"), [
    ({}, ["x", "y", "z"], [8], 7), ({"measurements": 3, "axes": "xz"}, ["x", "z"], [3], 7),
    ({"protocol": "single"}, ["x", "y", "z"], [8], 2), ({"every_axis": True, "axes": "zx"}, ["zx"], [8], None),
    ({"free": True, "measurements": 5}, [FREE], [5], 7), ({"preset": "paper"}, ["yx", "y", "x"], [1, 2, 1], None),
    ({"preset": "outlook"}, ["xyz"], [4], None), ({"preset": "outlook", "measurements": 6}, ["xyz"], [6], None)])
def test_runs_and_their_loads_are_those_asked_for(
    cell: Cell, asked: dict[str, Any], slots: list[str], counts: list[int], rows: int | None,
) -> None:
    """A cycle has seven rows, a single load two; the paper's plan four orientations, one of them loaded along both axes."""
    task = prepare(cell, Request(force_n=250.0, **asked), None).task
    assert [one.name for one in task.domain.slots] == slots
    assert task.demand.counts.tolist() == counts
    assert len(task.demand) == sum(counts)
    if slots != [FREE]:
        assert [np.abs(one.forces).max() for one in task.domain.slots] == pytest.approx([250.0] * len(slots))
    if rows:
        assert [len(one.forces) for one in task.domain.slots] == [rows] * len(slots)


@pytest.mark.parametrize(("asked", "with_program", "name"), [
    ({}, False, "D"), ({}, True, "I"), ({"criterion": "A"}, True, "A"), ({"criterion": "E"}, False, "E"),
    ({"criterion": "C"}, False, "D"), ({"preset": "paper"}, False, "A in raw k"), ({"preset": "outlook"}, True, "I"),
    ({"criterion": "D"}, True, "D")])
def test_a_plan_is_judged_by_what_was_asked_for_or_by_the_program(
    cell: Cell, program: MillingPoses, asked: dict[str, Any], with_program: bool, name: str,
) -> None:
    prepared = prepare(cell, Request(**asked), program if with_program else None)
    criterion = prepared.task.criterion
    assert criterion.name == name
    if name == "A in raw k":
        share = 1 / prepared.rig.compliance
        assert criterion.weight == pytest.approx(np.diag((share / share.max()) ** 2))
    if with_program:
        weight = prediction_weight(prepared.rig, program)
        assert prepared.weight == pytest.approx(weight, rel=1e-12)
        assert name != "I" or criterion.weight == pytest.approx(weight / np.trace(weight))


def test_a_deflection_s_criterion_needs_a_program(cell: Cell) -> None:
    with pytest.raises(CompstiffError) as stopped:
        prepare(cell, Request(criterion="I"), None)
    assert stopped.value.findings[0].code == "CS1602"


@pytest.mark.parametrize(("degrees", "window"), [
    (80.0, np.radians(80)), (179.9, np.radians(179.9)), (180.0, None), (200.0, None)])
def test_a_window_of_half_a_turn_is_none(cell: Cell, degrees: float, window: float | None) -> None:
    assert prepare(cell, Request(phi_deg=degrees), None).task.domain.margins.phi == (
        window if window is None else pytest.approx(window))


@pytest.mark.parametrize(("stated", "words"), [
    ("prior: {relative_std: 0.4}\n", "the prior (relative std 0.4)"),
    ("prior: {relative_std: [0.4, 0.4, 0.5, 0.4, 0.4, 0.4]}\n", "the prior (relative std 0.4, 0.4, 0.5, 0.4, 0.4, 0.4)")])
def test_what_is_known_before_is_the_prior_with_its_spread(tmp_path: Path, stated: str, words: str) -> None:
    """The paper's plan takes it for normal, any other for log-normal, about the same medians."""
    one = read_cell(write_cell(tmp_path, CELL + stated))
    prepared = prepare(one, Request(), None)
    assert prepared.before == words
    assert prepared.task.prior == pytest.approx(np.diag(1 / one.prior.log_std**2))
    paper = prepare(one, Request(preset="paper"), None).task.prior
    assert paper == pytest.approx(np.diag(1 / one.prior.relative_std**2))


@pytest.mark.parametrize(("asked", "slots", "words"), [
    ({"free": True, "measurements": 5}, ["x", "y", "z"], "as many runs with loads along base axes"),
    ({"preset": "outlook"}, ["yx", "y", "x"], "the paper's plan"), ({}, None, ""), ({"preset": "paper"}, None, "")])
def test_a_rich_plan_has_a_plainer_one_to_be_held_against(
    cell: Cell, asked: dict[str, Any], slots: list[str] | None, words: str,
) -> None:
    plainer = prepare(cell, Request(**asked), None).plainer
    assert (plainer is None) == (slots is None)
    if plainer is not None:
        assert ([one.name for one in plainer[0].domain.slots], plainer[1]) == (slots, words)
        assert len(plainer[0].demand) == (5 if "free" in asked else 4)


@pytest.mark.parametrize(("asked", "reason"), [
    ({"positions_mm": ((1.0, 2.0, 3.0),), "box_mm": (1.0,) * 6}, "positions_mm and box_mm exclude each other"),
    ({"measured": "rows", "preset": "paper"}, "preset is a whole plan"),
    ({"preset": "paper", "measurements": 6}, "preset paper has five"),
    *(({"free": True, **other}, "free loads each pose") for other in (
        {"preset": "outlook"}, {"every_axis": True}, {"axes": "xy"})),
    *(({"dead_weight": "20", **other}, "dead_weight only pulls down") for other in (
        {"preset": "outlook"}, {"every_axis": True}, {"free": True}, {"axes": "xy"})),
    ({"criterion": "C", "diagnosis": "read", "measured": "rows"}, "criterion C is for causes of any kind"),
    ({"diagnosis": "read"}, "diagnosis belongs to measured")])
def test_what_excludes_each_other_is_said(asked: dict[str, Any], reason: str) -> None:
    with pytest.raises(ValueError, match=reason):
        Request(**asked)


def test_the_measured_place_is_that_of_the_tool(cell: Cell, program: MillingPoses) -> None:
    at = forward(cell.robot, program.theta, cell.flange_from_tcp).position
    positions, box = measured_place(at)
    assert positions is None
    assert box is not None
    assert box == pytest.approx(np.array([at.min(axis=0), at.max(axis=0)]))

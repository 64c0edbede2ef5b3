"""The joint angles a program is driven with: configuration by confdata, by MoveAbsJ, and along linear moves."""

from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from compensator.path import configurations
from compensator.path.arc_length import arc_length, polyline
from compensator.path.configurations import Held
from compensator.path.legs import Poses
from compensator.path.robot_path import RobotPath, robot_path
from compensator.path.route import build_route
from compensator.rapid import read_rapid
from compensator.toolpath import Move
from identification.model.cell import read_cell
from identification.model.inverse import configuration
from identification.model.kinematics import forward
from identification.model.rotations import Frame
from tests.support import robot, write_cell

TOOL = Frame.from_quaternion([0.12, 0, 0.25], [1, 0, 0, 0])


def target(theta_deg: list[float], confdata: list[int] | None = None) -> str:
    """A robtarget in wobj0 that these joint angles reach, with their confdata or another."""
    theta = np.radians([theta_deg])
    tcp = forward(robot(), theta, TOOL)
    numbers = ",".join(f"{1e3 * x:.9f}" for x in tcp.position[0]), ",".join(f"{x:.12f}" for x in tcp.quaternion[0])
    cf = configuration(robot(), theta)[0].tolist() if confdata is None else confdata
    return f"[[{numbers[0]}],[{numbers[1]}],{cf},[9E9,9E9,9E9,9E9,9E9,9E9]]"


def planned(folder: Path, *moves: str) -> RobotPath:
    text = "MODULE M\nPROC main()\n" + "\n".join(moves) + "\nENDPROC\nENDMODULE\n"
    return robot_path(read_rapid(text.encode(), "m.mod").toolpath, read_cell(write_cell(folder)))


def linear(theta_deg: list[float], confdata: list[int] | None = None) -> str:
    return f"MoveL {target(theta_deg, confdata)},v100,fine,tSpindle;"


def joint(theta_deg: list[float], confdata: list[int] | None = None) -> str:
    return f"MoveJ {target(theta_deg, confdata)},v100,fine,tSpindle;"


def test_confdata_names_the_configuration_of_a_joint_move(tmp_path) -> None:
    wanted = [[10.0, 20, 30, 40, 50, 60], [-20.0, 10, 20, 200, -60, -300], [30.0, 0, 10, -250, 40, 340]]
    plan = planned(tmp_path, *(joint(theta) for theta in wanted))
    assert_allclose(np.degrees(plan.theta), wanted, atol=1e-6)
    assert not plan.findings


def test_linear_moves_keep_the_configuration_whatever_their_confdata_say(tmp_path) -> None:
    steps = [[10.0, 20, 30, 178 + 2 * i, -50, 60] for i in range(5)]
    plan = planned(tmp_path, joint(steps[0]), *(linear(theta, [0, 0, 0, 0]) for theta in steps[1:]))
    assert_allclose(np.degrees(plan.theta), steps, atol=1e-6)
    assert [finding.code for finding in plan.findings] == ["CS4002"]


def test_a_joint_move_inside_a_path_takes_its_own_configuration(tmp_path) -> None:
    theta = [10.0, 20, 30, 40, 50, 60]
    flipped = [10.0, 20, 30, -140, -50, -120]
    plan = planned(tmp_path, joint(theta), linear(theta), joint(flipped), linear(flipped, [0, 0, 0, 0]))
    assert_allclose(np.degrees(plan.theta), [theta, theta, flipped, flipped], atol=1e-6)


def test_move_abs_j_says_where_a_linear_move_starts(tmp_path) -> None:
    angles = [12.0, 22, 31, 220, -50, -300]
    near = [13.0, 22, 31, 221, -50, -300]
    plan = planned(tmp_path, f"MoveAbsJ [{angles},[9E9,9E9,9E9,9E9,9E9,9E9]],v100,fine,tSpindle;", linear(near, [0, 0, 0, 0]))
    assert_allclose(np.degrees(plan.theta), [angles, near], atol=1e-6)
    assert_allclose(plan.world_position[0], forward(robot(), np.radians([angles]), TOOL).position[0], atol=1e-12)


@pytest.mark.parametrize(("confdata", "why"), [
    ([3, 3, 3, 0], "no reachable configuration has this target's confdata [3, 3, 3, 0]"), (None, ""),
    ("cfThere", "the confdata of this target are not known")])
@pytest.mark.parametrize("before", [None, [10.0, 20, 30, -140, -50, -120], "MoveAbsJ", "far"])
def test_confdata_that_fit_nothing_or_are_unknown_are_said(
    tmp_path: Path, confdata: list[int] | str | None, why: str, before: list[float] | str | None
) -> None:
    """The wrist the other way round is as the joints before it stand, which a MoveAbsJ says too; of a program's first target,
    and behind one that is out of reach, the configuration nearest to zero is taken."""
    theta, flipped = [10.0, 20, 30, 40, 50, 60], [10.0, 20, 30, -140, -50, -120]
    move = joint(theta, confdata if isinstance(confdata, list) else None)
    if isinstance(confdata, str):
        move = move.replace(str(configuration(robot(), np.radians([theta]))[0].tolist()), confdata)
    first = {"MoveAbsJ": f"MoveAbsJ [{flipped},[9E9,9E9,9E9,9E9,9E9,9E9]],v100,fine,tSpindle;",
             "far": "MoveJ [[9000,0,700],[0,0,1,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v100,fine,tSpindle;",
             }.get(before) if isinstance(before, str) else None if before is None else joint(before)
    plan = planned(tmp_path, *([first] if first else []), move)
    turned = before not in (None, "far") and why
    assert_allclose(np.degrees(plan.theta[-1]), flipped if turned else theta, atol=1e-6)
    nearest = "the joints before it" if turned else "the joints' zero"
    expected = f"{why}: the configuration nearest to {nearest} was taken"
    number = len(plan.theta) - 1
    assert [(one.code, one.level, one.message, one.file, one.line, one.target) for one in plan.findings] == (
        [("CS4001", "warning", expected, "m.mod", 3 + number, number)] if why else [])


def test_confdata_are_not_asked_on_a_linear_move_from_known_joints(tmp_path: Path) -> None:
    """That the program's first move is none, is told."""
    theta = [10.0, 20, 30, 40, 50, 60]
    codes = [[one.code for one in planned(tmp_path, *moves).findings] for moves in (
        [joint(theta), linear(theta, [3, 3, 3, 0])], [linear(theta, [3, 3, 3, 0]), linear(theta, [3, 3, 3, 0])])]
    assert codes == [["CS4002"], ["CS4001", "CS4002"]]


def test_out_of_reach_is_marked(tmp_path) -> None:
    far = "MoveL [[9000,0,700],[0,0,1,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v100,fine,tSpindle;"
    plan = planned(tmp_path, joint([10.0, 20, 30, 40, 50, 60]), far, linear([10.0, 20, 30, 40, 50, 60]))
    assert plan.reached.tolist() == [True, False, True]


def test_the_many_joint_moves_of_a_long_program_are_quick(tmp_path) -> None:
    import time

    moves = [joint([10.0, 20, 30, 40, 50, 60 + 0.01 * i]) for i in range(50)] * 80
    start = time.process_time()
    plan = planned(tmp_path, *moves)
    assert time.process_time() - start < 10
    assert plan.reached.all()


@pytest.mark.parametrize(("before", "own", "level"), [
    ("", 1, "warning"),                         # the controller checks, and nearly all are elsewhere
    ("ConfL\\Off;", 1, "note"),                 # it does not
    ("ConfL\\On;", 1, "warning"),
    ("", 4, "note"),                            # most are as they are named
])
def test_a_controller_that_checks_configurations_stops(tmp_path, before: str, own: int, level: str) -> None:
    """`own` of seven targets are named as they are."""
    steps = [[10.0, 20, 30, 178 + 2 * i, -50, 60] for i in range(7)]
    plan = planned(tmp_path, joint(steps[0]), before, *(linear(theta, None if k < own else [0, 0, 0, 0])
                                                        for k, theta in enumerate(steps[1:], 1)))
    [found] = [finding for finding in plan.findings if finding.code == "CS4002"]
    assert (found.level, found.target, found.line) == (level, own, 4 + own)
    assert found.message.startswith(f"{7 - own} targets with another configuration")


def test_a_polyline_has_a_point_every_three_degrees_of_an_arc() -> None:
    """A quarter of a circle, to its middle and on to its end, and the line before it as it is."""
    angle = np.radians([0.0, 45, 90])
    points, length = polyline(np.concatenate([[[1, -1, 0]], np.column_stack([np.cos(angle), np.sin(angle), np.zeros(3)])]),
                              np.array([Move.LINEAR, Move.LINEAR, Move.ARC_VIA, Move.ARC_END], dtype=np.uint8))
    assert_allclose(length, np.append(0, 1 + np.radians(np.arange(0, 91, 3))), atol=1e-12)
    assert_allclose(points[1:, :2], np.column_stack([np.cos(length[1:] - 1), np.sin(length[1:] - 1)]), atol=1e-12)


def test_a_target_a_thousand_kilometres_away_is_on_no_path() -> None:
    far = np.array([[0, 0, 0], [0.99e6, 0, 0], [0, -1.01e6, 0], [0, 0, 0.0]])
    assert_allclose(arc_length(far, np.full(4, Move.LINEAR, dtype=np.uint8)), [0, 0.99e6, np.nan, 1.98e6])


@pytest.mark.parametrize(("away_mm", "said"), [(4.9, True), (5.1, False), (0.0, False)])
@pytest.mark.parametrize("stated", ["base_frame", "workobject", "program"])
def test_a_frame_within_five_millimetres_of_the_world_is_in_metres(
    tmp_path: Path, stated: str, away_mm: float, said: bool
) -> None:
    """The robot's base, the program's work object, and that of cell.yaml where a program names one that it does not declare;
    the latter counts for nothing where none is taken from there."""
    place, cell = f"[0, {away_mm}, 0]", write_cell(tmp_path)
    if stated != "program":
        cell.write_text(cell.read_text() + f"\n{stated}: {{position_mm: {place}}}\n")
    declared = f'PERS wobjdata wPart:=[FALSE,TRUE,"",[{place},[1,0,0,0]],[[0,0,0],[1,0,0,0]]];\n' * (stated == "program")

    def told(of_object: str) -> list[tuple[str, str | None, int | None]]:
        move = linear([10.0, 20, 30, 40, 50, 60]).replace("tSpindle;", f"tSpindle{of_object};")
        text = f"MODULE M\n{declared}PROC main()\n{move}\nENDPROC\nENDMODULE\n"
        found = robot_path(read_rapid(text.encode(), "m.mod").toolpath, read_cell(cell)).findings
        return [(one.message, one.file, one.line) for one in found if one.code == "CS0118"]

    name, file, line = {"base_frame": ("base_frame.position_mm", str(cell), None),
                        "workobject": ("workobject.position_mm", str(cell), None),
                        "program": ("the work object wPart", "m.mod", 2)}[stated]
    expected = [(f"{name} is {away_mm:g} mm from the world's origin: is it in metres?", file, line)] if said else []
    assert told("\\WObj:=wPart") == expected
    assert told("") == (expected if stated == "base_frame" else [])


DATA = """PERS tooldata tA:=[TRUE,[[120,0,250],[1,0,0,0]],[1,[0,0,1],[1,0,0,0],0,0,0]];
PERS tooldata tB:=[TRUE,[[0,30,200],[1,0,0,0]],[1,[0,0,1],[1,0,0,0],0,0,0]];
PERS tooldata tC:=[TRUE,[[50,0,220],[1,0,0,0]],[1,[0,0,1],[1,0,0,0],0,0,0]];
PERS wobjdata wA:=[FALSE,TRUE,"",[[0,0,0],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];
PERS wobjdata wB:=[FALSE,TRUE,"",[[-50,40,-30],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];
"""
ABSOLUTE = "MoveAbsJ [[10,20,30,40,50,60],[9E9,9E9,9E9,9E9,9E9,9E9]],v100,fine,tB\\WObj:=wB;"


def with_frames(folder: Path, *moves: tuple[str, str, str]) -> RobotPath:
    """Moves of a kind, each by a tool and in a work object; each to 1100 mm, 0 mm, 700 mm and its number along y."""
    rest = "[0,0,1,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]"
    rows = [f"{kind} [[1100,{k},700],{rest}],v100,fine,{tool}\\WObj:={part};" if kind != "MoveAbsJ" else ABSOLUTE
            for k, (kind, tool, part) in enumerate(moves)]
    text = f"MODULE M\n{DATA}PROC main()\n" + "\n".join(rows) + "\nENDPROC\nENDMODULE\n"
    return robot_path(read_rapid(text.encode(), "m.mod").toolpath, read_cell(write_cell(folder)))


PLACES = {"tA": [0.12, 0, 0.25], "tB": [0, 0.03, 0.2], "tC": [0.05, 0, 0.22], "wA": [0, 0, 0], "wB": [-0.05, 0.04, -0.03]}


def test_each_target_has_its_tool_and_its_work_object(tmp_path: Path) -> None:
    moves = [("MoveL", "tA", "wA"), ("MoveL", "tB", "wB"), ("MoveL", "tA", "wB"), ("MoveL", "tB", "wB"), ("MoveL", "tC", "wA")]
    path = with_frames(tmp_path, *moves)
    assert_allclose(path.flange_from_tcp.position, [PLACES[tool] for _, tool, _ in moves])
    origins = np.array([PLACES[part] for *_, part in moves])
    assert_allclose(path.world_position - origins, [[1.1, 1e-3 * k, 0.7] for k in range(5)])
    groups = path.each_tool(np.array([3, 0, 2, 1, 4]))
    assert sorted((tuple(tool.position), places.tolist()) for tool, places in groups) == [
        (tuple(PLACES["tB"]), [0, 3]), (tuple(PLACES["tC"]), [4]), (tuple(PLACES["tA"]), [1, 2])]
    [(tool, places)] = path.each_tool(np.array([2, 0]))
    assert (tool.position.tolist(), places.tolist()) == (PLACES["tA"], [0, 1])
    assert path.each_tool(np.array([], dtype=int)) == []


@pytest.mark.parametrize(("moves", "tools", "parts"), [
    ([("MoveJ", "tA", "wA"), ("MoveL", "tB", "wB"), ("MoveL", "tB", "wB")], ["tB"], ["wB"]),
    ([("MoveJ", "tA", "wA"), ("MoveJ", "tB", "wA")], ["tA", "tB"], ["wA"]),
    ([("MoveAbsJ", "", ""), ("MoveL", "tA", "wA")], ["tA"], ["wA"]),
    ([("MoveAbsJ", "", ""), ("MoveJ", "tA", "wA")], ["tA", "tB"], ["wA"])])
def test_the_frames_that_count_are_those_of_linear_moves_where_there_are_any(
    tmp_path: Path, moves: list[tuple[str, str, str]], tools: list[str], parts: list[str]
) -> None:
    """Else those of all: of moves by joint angles the tool alone, since no work object says where they lead."""
    used = with_frames(tmp_path, *moves).used_frames
    assert sorted(tuple(one.position) for one in used.tools) == sorted(tuple(PLACES[name]) for name in tools)
    assert sorted(tuple(one.position) for one in used.workobjects) == sorted(tuple(PLACES[name]) for name in parts)


def test_a_target_without_an_orientation_is_not_known(tmp_path: Path) -> None:
    theta = [10.0, 20, 30, 40, 50, 60]
    whole = joint(theta)
    nowhere = whole.replace(whole.split("],[")[1], "0,0,0,0")
    path = planned(tmp_path, whole, nowhere, whole)
    assert path.known.tolist() == path.reached.tolist() == [True, False, True]
    assert np.isnan(path.world_position[1]).all()


def test_move_abs_j_counts_for_the_next_target_alone(tmp_path: Path) -> None:
    """Behind it one by its own configuration, a turn of axis 6 on; the linear moves behind that go on from there."""
    away, here = [12.0, 22, 31, 40, 50, -300], [12.0, 22, 31, 40, 50, 60]
    near = [13.0, 22, 31, 41, 50, 61]
    by_joints = f"MoveAbsJ [{away},[9E9,9E9,9E9,9E9,9E9,9E9]],v100,fine,tSpindle;"
    plan = planned(tmp_path, by_joints, joint(here), linear(near), linear(here))
    assert_allclose(np.degrees(plan.theta), [away, here, near, here], atol=1e-6)


@pytest.mark.parametrize("theta", [[148.7, 4.4, 51.9, 50.7, 75.2, 130.3], [-132.0, 28.4, 6.9, -13.6, 2.4, 136.7]])
def test_a_configuration_is_guessed_among_those_inside_the_limits(tmp_path: Path, theta: list[float]) -> None:
    """The arm turned round, or folded the other way, would be nearer to zero, and axes 2 and 3 do not reach so far."""
    move = joint(theta).replace(str(configuration(robot(), np.radians([theta]))[0].tolist()), "cfThere")
    assert_allclose(np.degrees(planned(tmp_path, move).theta), [theta], atol=1e-6)


@pytest.mark.parametrize(("theta", "cfx"), [
    ([5, 10, 20, 10, 50, 0], 0), ([5, 10, 20, -170, -50, 180], 1), ([5, 10, 20, -170, -50, -180], 1)])
def test_a_line_is_driven_with_the_wrist_either_way_over(tmp_path: Path, theta: list[float], cfx: int) -> None:
    """The same line from the same place: as the arm stands at its start it stands all along, at the joint angles planned."""
    there = [angle + by for angle, by in zip(theta, [4, 3, -2, 1, 2, -1], strict=True)]
    path = planned(tmp_path, joint(theta), linear(there))
    assert configuration(robot(), path.theta)[:, 3].tolist() == [cfx, cfx]
    route = build_route(path, Poses(path.base_from_tcp, path.theta))
    assert not route.lost.any()
    assert_allclose(np.degrees(route.theta[[0, -1]]), [theta, there], atol=1e-6)
    assert np.degrees(np.abs(np.diff(route.theta, axis=0))).max() < 2


@pytest.mark.parametrize(("failed", "reserve", "chosen"), [
    ({}, {7: 0.3}, 7),                                  # most reserve
    ({}, {}, 0),                                        # the first of equal ones
    ({0: 0, 1: 3}, {7: 0.3}, 7),
    (dict.fromkeys(range(24), 0) | {5: 2, 9: 4}, {}, 9),        # none is whole: the one that gets farthest
    (dict.fromkeys(range(24), 0) | {5: 2, 9: 4, 11: -1}, {}, 11),
    (dict.fromkeys(range(1, 24), 4) | {0: 0}, {}, 1)])
def test_the_tool_is_turned_where_most_reserve_is_left_or_where_it_gets_farthest(
        tmp_path: Path, monkeypatch: pytest.MonkeyPatch, failed: dict[int, int], reserve: dict[int, float], chosen: int
) -> None:
    """Of the directions every 15 degrees, from x towards y, of which each breaks down at a target or goes all along."""
    runs = iter(range(24))

    def held(*_: object, **__: object) -> Held:
        number = next(runs)
        at = failed.get(number, -1)
        return Held(np.zeros((9, 6)), reserve.get(number, 0.1) if at < 0 else 0.0, 0, "", at)

    monkeypatch.setattr(configurations, "hold", held)
    best = configurations.best_direction(read_cell(write_cell(tmp_path)), np.zeros((9, 3)), np.tile([0.0, 0, 1], (9, 1)))
    assert best is not None
    angle = np.radians(15 * chosen)
    assert best[1] == pytest.approx(angle)
    assert_allclose(best[0], [np.cos(angle), np.sin(angle), 0], atol=1e-12)

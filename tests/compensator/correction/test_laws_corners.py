"""What zones cut off corners: against a parabola drawn point by point, and what --tighten-zones writes."""

from __future__ import annotations

import re
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from compensator.correction.corners import _cut_off, corner_misses, sharp_corners
from compensator.rapid import read_rapid
from compensator.toolpath import Toolpath
from identification.common.findings import Finding
from tests.runs.command_line import user_files as kit
from tests.runs.command_line.test_placement import Path3
from tests.runs.command_line.user_files import Job


def distance_of_the_parabola(before: np.ndarray, corner: np.ndarray, after: np.ndarray, radius: float) -> float:
    """A quadratic curve tangent to both legs at the zone's edge, and its least distance from the corner."""
    legs = [(end - corner) / np.linalg.norm(end - corner) for end in (before, after)]
    start, stop = corner + radius * legs[0], corner + radius * legs[1]
    t = np.linspace(0, 1, 4001)[:, None]
    curve = (1 - t) ** 2 * start + 2 * t * (1 - t) * corner + t**2 * stop
    return float(np.linalg.norm(curve - corner, axis=1).min())


@pytest.mark.parametrize("turn", [5.0, 45.0, 90.0, 135.0])
@pytest.mark.parametrize("zone", ["z1", "z10", "z50"])
def test_the_miss_is_that_of_a_parabola_in_a_zone_of_at_most_half_the_way(turn: float, zone: str) -> None:
    angle = np.radians(turn)
    points = np.array([[0, 0, 0], [30, 0, 0], [30 + 12 * np.cos(angle), 12 * np.sin(angle), 0]])
    moves = [f"MoveL [[{x},{y},{z}],[1,0,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v50,{zone},tool0;" for x, y, z in points]
    path = read_rapid(kit.module(moves, []).encode()).toolpath
    miss, _ = corner_misses(path, path.position)
    radius = min(float(zone[1:]), 6.0)
    expected = distance_of_the_parabola(*points, radius)
    assert 1e3 * miss[1] == pytest.approx(expected, rel=1e-3)
    assert miss[0] == miss[2] == 0


def test_a_tangent_arc_is_no_corner_and_a_fine_point_misses_nothing() -> None:
    data = ["[0,0,0]", "[10,0,0]", "[15,5,0]", "[10,10,0]", "[0,10,0]", "[0,0,0]"]
    target = [f"[{p},[1,0,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]]" for p in data]
    moves = [f"MoveL {target[0]},v50,z1,tool0;", f"MoveL {target[1]},v50,z1,tool0;",
             f"MoveC {target[2]},{target[3]},v50,z1,tool0;", f"MoveL {target[4]},v50,fine,tool0;",
             f"MoveL {target[5]},v50,z1,tool0;"]
    path = read_rapid(kit.module(moves, []).encode()).toolpath
    miss, _ = corner_misses(path, path.position)
    np.testing.assert_allclose(miss, 0, atol=1e-9)


SQUARE = np.array([[0, 0, 0], [20, 0, 0], [20, 20, 0], [0, 20, 0], [0, 0, 0]], dtype=float)
FORCES = "target,fx_n,fy_n,fz_n\n" + "".join(f"{i},50,100,-40\n" for i in range(5))


def test_corners_are_said_and_tightened(tmp_path: Path) -> None:
    path = Path3(SQUARE)
    moves = [kit.move(path.text[0]), kit.move(path.text[1]), kit.move(path.text[2], zone="z5\\Z:=3"),
             kit.move(path.text[3], zone="fine"), kit.move(path.text[4])]
    job = Job(tmp_path, program=kit.module(moves), forces=FORCES)
    said = job.correct("--json")
    assert said.code == 0
    message = next(f["message"] for f in said.json["findings"] if f["code"] == "CS4320")
    assert "at 2 targets" in message
    assert "1061 um" in message, "half of 3 mm times the sine of 45 degrees"
    before = job.out.read_text()
    done = job.correct("--json", "--force", "--tighten-zones")
    assert done.code == 0
    assert {"CS4321"} == kit.codes(done) & {"CS4320", "CS4321", "CS4322"}
    after = job.out.read_text()
    assert re.sub(r"\\Z:=[\d.]+", "", after) == re.sub(r"\\Z:=[\d.]+", "", before), "nothing but zones changed"
    assert re.findall(r",(\w+(?:\\Z:=[\d.]+)?),tMill", after) == ["z1", "z1\\Z:=0.014", "z5\\Z:=0.014", "fine", "z1"]
    assert job.correct("--json", "--force", "--tighten-zones", "--tolerance", "2000").code == 0
    assert job.out.read_text() == before


def test_the_corner_at_which_the_cut_ends_keeps_its_zone(tmp_path: Path) -> None:
    path = Path3(SQUARE)
    moves = [kit.move(path.text[0]), kit.move(path.text[1]), kit.move(path.text[2], zone="z5\\Z:=3"),
             kit.move(path.text[3]), kit.move(path.text[4])]
    forces = "target,fx_n,fy_n,fz_n\n" + "".join(f"{i},{50 * (i < 3)},{100 * (i < 3)},0\n" for i in range(5))
    job = Job(tmp_path, program=kit.module(moves), forces=forces)
    message = next(f["message"] for f in job.correct("--json").json["findings"] if f["code"] == "CS4320")
    assert "at 1 target in the cut" in message
    assert job.correct("--force", "--tighten-zones").code == 0
    assert re.findall(r",(\w+(?:\\Z:=[\d.]+)?),tMill", job.out.read_text()) == ["z1", "z1\\Z:=0.014", "z5\\Z:=3", "z1", "z1"]


@pytest.mark.parametrize(("tolerance", "written", "left_um"), [(7.0, 0.019, 6.7), (5.0, 0.014, 4.9), (2.0, 0.010, 3.5)])
def test_the_zones_are_told_as_they_are_written(tmp_path: Path, tolerance: float, written: float, left_um: float) -> None:
    """At a right angle a zone cuts 0.354 of its radius off; none is smaller than 0.01 mm, and what that leaves is told."""
    job = Job(tmp_path, program=Path3(SQUARE).program(), forces=FORCES)
    done = job.correct("--json", "--tighten-zones", "--tolerance", f"{tolerance}", "--keep-targets")
    assert done.code == 0, done
    assert set(re.findall(r"Z:=([\d.]+)", job.out.read_text())) == {f"{written:.3f}".rstrip("0")}
    said = {one["code"]: one["message"] for one in done.json["findings"]}
    assert said["CS4321"] == (f"3 zones were made smaller, to {written:.3f} ... {written:.3f} mm, so that they cut at most "
                              f"{left_um:g} um off the corner")
    assert ("CS4320" in said) == (left_um > tolerance)


@pytest.mark.parametrize("change", [("v50", "v50\\T:=2"), ("MoveL ", "MoveLDO ")])
def test_a_zone_of_a_move_that_is_not_touched_is_said(tmp_path: Path, change: tuple[str, str]) -> None:
    """The move whose zone stays is named, with what it goes on to cut off: 0.354 of 1 mm at most."""
    path = Path3(SQUARE)
    moves = [kit.move(text) for text in path.text]
    moves[2] = moves[2].replace(*change)
    if change[1] == "MoveLDO ":
        moves[2] = moves[2].replace(";", ", doCut, 1;")
    result = Job(tmp_path, program=kit.module(moves), forces=FORCES).correct("--json", "--tighten-zones", "--keep-targets")
    assert result.code == 0
    said = {one["code"]: one for one in result.json["findings"]}
    assert (said["CS4322"]["message"], said["CS4322"]["target"]) == ("1 zone that cuts corners cannot be made smaller here", 2)
    assert said["CS4321"]["message"].startswith("2 zones were made smaller")
    assert (said["CS4320"]["target"], "at 1 target in the cut" in said["CS4320"]["message"]) == (2, True)


def of_moves(*moves: tuple[str, float, float, str]) -> Toolpath:
    """MoveL, MoveJ, MoveC (via and end, one after the other) in a plane, mm, with their zones."""
    text, waiting = [], ""
    for kind, x, y, zone in moves:
        target = f"[[{x},{y},0],[1,0,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]]"
        if kind == "via":
            waiting = target + ","
            continue
        text.append(f"Move{kind} {waiting}{target},v50,{zone},tool0;")
        waiting = ""
    return read_rapid(kit.module(text, []).encode()).toolpath


@pytest.mark.parametrize(("moves", "expected"), [
    ([("L", 0, 0, "z1"), ("L", 10, 0, "z1"), ("L", 10, 10, "z1")], [0, 1, 0]),
    ([("L", 0, 0, "z1"), ("J", 10, 0, "z1"), ("L", 10, 10, "z1")], [0, 0, 0]),
    ([("L", 0, 0, "z1"), ("L", 10, 0, "z1"), ("J", 10, 10, "z1")], [0, 0, 0]),
    ([("J", 0, 0, "z1"), ("L", 10, 0, "z1"), ("L", 10, 10, "z1")], [0, 1, 0]),
    ([("L", 0, 0, "z1"), ("L", 10, 0, "z1"), ("L", 10, 0, "z1"), ("L", 10, 10, "z1")], [0, 0, 0, 0]),
    # A half circle that begins square to the line, and ends so, about a centre to the right.
    ([("L", 0, 0, "z1"), ("L", 10, 0, "z1"), ("via", 15, 5, ""), ("C", 20, 0, "z1"), ("L", 30, 0, "z1")], [0, 1, 0, 1, 0]),
    # One that begins along the line.
    ([("L", 0, 0, "z1"), ("L", 10, 0, "z1"), ("via", 15, 5, ""), ("C", 10, 10, "z1"), ("L", 10, 0, "z1")], [0, 0, 0, 1, 0]),
    # In line: a straight one has the direction of its chords.
    ([("L", 0, 0, "z1"), ("L", 0, 10, "z1"), ("via", 5, 10, ""), ("C", 10, 10, "z1"), ("L", 10, 0, "z1")], [0, 1, 0, 1, 0])])
def test_zones_cut_corners_between_moves_on_lines_and_arcs(
    moves: list[tuple[str, float, float, str]], expected: list[int]
) -> None:
    """Of 90 degrees in a zone of 1 mm: half of that times sin 45; not beside a joint move, or one of no length."""
    toolpath = of_moves(*moves)
    miss, half = corner_misses(toolpath, toolpath.position)
    np.testing.assert_allclose(1e3 * miss, np.array(expected) * 0.5 * np.sin(np.pi / 4), atol=1e-9)
    assert (half[np.array(expected) > 0] == pytest.approx(np.sin(np.pi / 4)))


def test_of_an_unknown_target_its_neighbours_are_those_of_each_other() -> None:
    toolpath = of_moves(("L", 0, 0, "z1"), ("L", 10, 0, "z1"), ("L", 5, 5, "z1"), ("L", 10, 10, "z1"))
    position = toolpath.position.copy()
    position[2] = np.nan
    np.testing.assert_allclose(1e3 * corner_misses(toolpath, position)[0], [0, 0.5 * np.sin(np.pi / 4), 0, 0], atol=1e-9)
    assert not corner_misses(toolpath, np.where(np.arange(4)[:, None] < 2, np.nan, position))[1].any()


def turning(*degrees: float) -> Any:
    """Moves of 10 mm that turn by so much at each target between them."""
    heading = np.radians(np.concatenate([[0.0], np.cumsum(degrees)]))
    points = np.vstack([[0, 0], 10 * np.cumsum(np.column_stack([np.cos(heading), np.sin(heading)]), axis=0)])
    toolpath = of_moves(*(("L", round(x, 9), round(y, 9), "z1") for x, y in points))
    return SimpleNamespace(
        toolpath=toolpath, world_position=toolpath.position, finding=lambda target, code, level, message, hint: Finding(
            code, level, message, "p.mod", target=target, hint=hint))


@pytest.mark.parametrize(("targets", "sharp"), [
    ([0, 1, 2, 3, 4, 5], [2, 4]), ([1, 2, 3, 4], [1]), ([2, 3, 4, 5], [2]), ([0, 1, 2, 4, 5], []), ([2], []), ([], [])])
def test_a_sharp_corner_turns_by_45_degrees_between_two_with_force(targets: list[int], sharp: list[int]) -> None:
    """The second target turns by 46 degrees, the third by 44, the fourth by 50 to the other side: places among those with
    force."""
    found = sharp_corners(turning(0, 46, 44, -50), np.array(targets, dtype=np.intp))
    assert found.tolist() == sharp


@pytest.mark.parametrize(("tolerance_um", "count"), [(353.0, 2), (354.0, 0), (353.54, 0), (100.0, 2)])
@pytest.mark.parametrize("tightened", [True, False])
def test_zones_that_cut_more_than_the_tolerance_are_told_at_the_worst(tolerance_um: float, count: int, tightened: bool) -> None:
    """A right angle in a zone of 1 mm misses 353.55 um, two of them are in the cut; what is less than a thousandth more is
    none."""
    job: Any = SimpleNamespace(path=turning(90, 90, 90, 90), targets=np.arange(2, 6))
    found = _cut_off(job, 1e-6 * tolerance_um, tightened=tightened)
    assert [(one.code, one.level, one.target) for one in found] == [("CS4320", "warning", 3)] * bool(count)
    for one in found:
        assert one.message == (f"the zone cuts the corner at 2 targets in the cut by more than {tolerance_um:g} um, by 354 um "
                               "at most; no correction reaches a fly-by point")
        assert one.hint == ("smaller zones there cannot be written" if tightened else
                            "--tighten-zones makes the zones smaller there")
    job.path = turning(90, 90, 30, 90)
    assert [one.target for one in _cut_off(job, 1e-4, tightened=False)] == [4]

"""Slips in the moves of a toolpath are said, and nothing is said of right ones: rows, contours, holes, spring passes, domes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from compensator.posting.apt import read_apt
from compensator.posting.campath import CamPath
from compensator.posting.odd_moves import said_of_moves
from compensator.posting.post import _odd_spindle, post
from compensator.posting.settings import PostingSettings
from compensator.toolpath import Move
from identification.model.cell import read_cell
from tests.support import CELL, write_cell

UPWARDS = np.array([0.0, 0.0, 1.0])


def path(points_mm: np.ndarray, rapid: np.ndarray, feed_mm_s: float = 20.0) -> CamPath:
    count = len(points_mm)
    return CamPath("part.csv", "CSV", np.full(count, Move.LINEAR, dtype=np.uint8), np.arange(count, dtype=np.int64) + 2,
                   1e-3 * points_mm, np.tile(UPWARDS, (count, 1)), None, rapid, np.where(rapid, np.nan, 1e-3 * feed_mm_s),
                   np.zeros(count, dtype=bool), None, None, {}, ())


def said(cam_path: CamPath, **chosen: float) -> list[str]:
    up = np.tile(UPWARDS, (len(cam_path), 1))
    return [finding.code for finding in said_of_moves(cam_path, up, PostingSettings(**chosen))]


def with_air(cuts_mm: np.ndarray) -> CamPath:
    """Approach and retract 50 mm above the first and the last cut."""
    above = np.array([0, 0, 50.0])
    points = np.concatenate([[cuts_mm[0] + above], cuts_mm, [cuts_mm[-1] + above]])
    rapid = np.zeros(len(points), dtype=bool)
    rapid[[0, -1]] = True
    return path(points, rapid)


def rows(rng: np.random.Generator) -> np.ndarray:
    x = np.arange(0, rng.uniform(40, 200), rng.uniform(0.5, 8))
    return np.concatenate([np.column_stack([x[::1 - 2 * (k % 2)], np.full(len(x), 2.0 * k), np.zeros(len(x))])
                           for k in range(int(rng.integers(3, 12)))])


def contour(rng: np.random.Generator) -> np.ndarray:
    angle = np.linspace(0, 2 * np.pi, int(rng.integers(30, 300)))
    ring = np.column_stack([40 * np.cos(angle), 25 * np.sin(angle), np.zeros(len(angle))])
    levels = [ring - [0, 0, depth] for depth in np.arange(1, int(rng.integers(2, 6)))]
    return np.concatenate([*levels, levels[-1]])         # a spring pass at the last level


def dome(rng: np.random.Generator) -> np.ndarray:
    flat = rows(rng)
    return flat - [0, 0, 1] * (np.linalg.norm(flat - flat.mean(axis=0), axis=1) ** 2 / 400)[:, None]


def corners_only(rng: np.random.Generator) -> np.ndarray:
    y = np.arange(0, 80, rng.uniform(2, 8))
    return np.array([(x, v, 0.0) for k, v in enumerate(y) for x in ((0, 100) if k % 2 == 0 else (100, 0))])


RIGHT = (rows, contour, dome, corners_only)


@pytest.mark.parametrize("kind", RIGHT)
def test_nothing_is_said_of_right_programs(kind) -> None:
    for seed in range(30):
        assert said(with_air(kind(np.random.default_rng([401, seed])))) == []


@pytest.mark.parametrize(("lost", "line"), [(slice(1, None), 3), (slice(None, -1), 0)])
def test_lost_approach_or_retract_is_said(lost: slice, line: int) -> None:
    whole = with_air(rows(np.random.default_rng(5)))
    part = path(1e3 * whole.position[lost], whole.rapid[lost])
    [found] = said_of_moves(part, np.tile(UPWARDS, (len(part), 1)), PostingSettings())
    assert (found.code, found.line) == ("CS4317", 2 if line else len(part) + 1)


@pytest.mark.parametrize(("deep", "first", "count", "said"), [
    (0.9, False, 30, False), (1.1, False, 30, True), (1.1, True, 30, True), (0.9, True, 30, False), (1.1, True, 19, False),
    (1.1, True, 20, True), (-5.0, True, 30, False)])
def test_a_program_that_begins_or_ends_in_the_cut_is_said_from_a_millimetre_below_the_air_on(
    deep: float, first: bool, count: int, said: bool
) -> None:
    """Below the lowest of its moves in the air, which stand at 4 and at 50 mm, of twenty targets at least."""
    points = np.column_stack([np.arange(count), np.zeros(count), np.full(count, 3.9)])
    points[[0, 1, -2], 2], points[-1, 2] = [50.0, 4.0, 4.0], 4.0 - deep
    rapid = np.isin(np.arange(count), [0, 1, count - 2])
    order = slice(None, None, -1 if first else 1)
    part = path(points[order], rapid[order])
    found = [one for one in said_of_moves(part, np.tile(UPWARDS, (count, 1)), PostingSettings()) if one.code == "CS4317"]
    where = "begins: the first move, MoveJ, goes there from wherever the robot stands" if first else (
        "ends, and the tool is left there")
    assert [(one.level, one.line, one.message) for one in found] == [("warning", 2 if first else count + 1, (
        f"a cut {deep:g} mm below all moves in the air is where the program {where}"))] * said


@pytest.mark.parametrize("other", ["", "one place", "one row more"])
def test_a_program_that_comes_again_but_for_one_place_is_not_one_twice(other: str) -> None:
    whole = with_air(rows(np.random.default_rng(6)))
    points, rapid = 1e3 * np.tile(whole.position, (2, 1)), np.tile(whole.rapid, 2)
    if other == "one place":
        points[len(whole) + 3, 2] -= 0.001
    if other == "one row more":
        points, rapid = np.concatenate([points, points[-1:] + 1]), np.append(rapid, True)
    found = [one for one in said_of_moves(path(points, rapid), np.tile(UPWARDS, (len(points), 1)), PostingSettings())
             if one.code == "CS4318"]
    assert [(one.level, one.line, f"the {len(whole)} targets of the first half" in one.message) for one in found] == [
        ("warning", len(whole) + 2, True)] * (not other)


def test_rows_that_were_pasted_twice_are_said() -> None:
    whole = with_air(rows(np.random.default_rng(6)))
    assert said(path(1e3 * np.tile(whole.position, (2, 1)), np.tile(whole.rapid, 2))) == ["CS4318"]


@pytest.mark.parametrize("slip", [np.array([0, 0, -18.0]), np.array([450.0, 0, 0]), np.array([0, 60.0, 0])])
def test_a_mistyped_number_is_said_with_its_line(slip: np.ndarray) -> None:
    x = np.arange(0, 100, 4.0)
    cuts = np.concatenate([np.column_stack([x[::1 - 2 * (k % 2)], np.full(len(x), 5.0 * k), np.zeros(len(x))])
                           for k in range(4)])
    cuts[37] += slip
    whole = with_air(cuts)
    [found] = said_of_moves(whole, np.tile(UPWARDS, (len(whole), 1)), PostingSettings())
    assert (found.code, found.line) == ("CS4319", 37 + 1 + 2)


@pytest.mark.parametrize(("off", "slips", "count", "said"), [
    (11.0, 1, 40, False), (13.0, 1, 40, True), (13.0, 2, 40, True), (13.0, 3, 40, False), (40.0, 1, 22, True),
    (40.0, 1, 21, False)])
def test_a_target_is_out_of_line_by_over_three_steps_where_that_is_rare(off: float, slips: int, count: int, said: bool) -> None:
    """Steps of 4 mm; out and back by so much, to one side. Of 22 cuts twenty have a cut on either side."""
    points = np.column_stack([4.0 * np.arange(count), np.zeros(count), np.zeros(count)])
    at = [9 + 5 * k for k in range(slips)]
    points[at, 1] += off
    part = path(points, np.zeros(count, dtype=bool))
    found = [one for one in said_of_moves(part, np.tile(UPWARDS, (count, 1)), PostingSettings()) if one.code == "CS4319"]
    assert [(one.level, one.line, one.message) for one in found] == [("warning", 9 + 2, (
        f"target 9 stands {np.hypot(4, off):.3g} mm off both its neighbours, which are 8 mm apart; steps are 4 mm, in the "
        "middle"))] * said


@pytest.mark.parametrize(("degrees", "said"), [(44, True), (47, False)])
def test_a_wide_tip_is_no_target_out_of_line(degrees: float, said: bool) -> None:
    """One of 20 mm; from 45.6 degrees on, whose cosine is 0.7, it is a corner."""
    half = np.radians(degrees / 2)
    points = np.column_stack([4.0 * np.arange(40), np.zeros(40), np.zeros(40)])
    points[20:, 0] += 2 * 20 * np.sin(half) - 8
    points[19] = points[18] + 20 * np.array([np.sin(half), np.cos(half), 0])
    found = said_of_moves(path(points, np.zeros(40, dtype=bool)), np.tile(UPWARDS, (40, 1)), PostingSettings(zone_mm=0.0))
    assert [(one.code, one.line) for one in found] == [("CS4319", 19 + 2)] * said


@pytest.mark.parametrize(("zone", "turn", "end", "said"), [
    (0.70, 90, 8, 0), (0.72, 90, 8, 2), (0.72, 80, 8, 0), (5.0, 90, 1.38, 0), (5.0, 90, 1.46, 2)])
def test_a_zone_that_misses_a_corner_by_over_a_quarter_of_a_millimetre_is_said(
    zone: float, turn: float, end: float, said: int
) -> None:
    """The parabola of a zone misses its corner by half its radius times the sine of half the turn; it takes half of a shorter
    neighbour at most. Corners before a move in the air, of the ends and of stops do not count."""
    angle = np.radians(turn)
    corner = np.array([[-8.0, 0, 0], [0, 0, 0], [end * np.cos(angle), end * np.sin(angle), 0]])
    other = corner @ np.diag([1, -1, 1]) + [0, 40, 0]
    points = np.concatenate([corner, other, other[-1:] + np.array([0, 0, 30]), corner + np.array([60, 0, 30])])
    rapid = np.isin(np.arange(len(points)), [3, 6, 7, 8, 9])
    part = path(points, rapid)
    found = [one for one in said_of_moves(part, np.tile(UPWARDS, (len(points), 1)), PostingSettings(zone_mm=zone))
             if one.code == "CS4324"]
    worst = min(zone, end / 2) * np.sin(angle / 2) / 2
    assert [(one.level, one.message) for one in found] == [("warning", (
        f"zones of {zone:g} mm cut off {said} corners of the cut, the worst by {worst:.2g} mm"))] * bool(said)
    assert not said_of_moves(replace(part, stop=np.ones(len(points), dtype=bool)), np.tile(UPWARDS, (len(points), 1)),
                             PostingSettings(zone_mm=zone))


@pytest.mark.parametrize(("chosen", "expected"), [
    ({"rapid_mm_s": 5.0}, ["CS4323"]), ({"rapid_mm_s": 40.0}, []), ({"zone_mm": 0.5}, []), ({"zone_mm": 5.0}, ["CS4324"]),
    ({"zone_mm": 0.0}, [])])
def test_speeds_and_zones_that_no_milling_has(chosen: dict[str, float], expected: list[str]) -> None:
    assert said(with_air(corners_only(np.random.default_rng(7))), **chosen) == expected


def test_a_slow_rapid_is_said_where_there_is_one_beside_cuts_alone() -> None:
    """Of a path that never leaves the cut, or that has no cut of known feed, nothing can be slower."""
    whole = with_air(rows(np.random.default_rng(9)))
    assert "CS4323" in said(whole, rapid_mm_s=5.0)
    assert "CS4323" not in said(replace(whole, rapid=np.zeros(len(whole), dtype=bool), feed=np.full(len(whole), 0.02)),
                                rapid_mm_s=5.0)
    assert "CS4323" not in said(replace(whole, feed=np.full(len(whole), np.nan)), rapid_mm_s=5.0)


@pytest.mark.parametrize(("text", "rpm"), [
    ("SPINDL/9000,RPM,CLW\nGOTO/0,0,0", (9000,)), ("GOTO/0,0,0", ()), ("SPINDL/120,SFM,CLW\nGOTO/0,0,0", ()),
    ("SPINDL/9000\nGOTO/0,0,0\nSPINDL/SMM,120\nGOTO/1,0,0\nSPINDL/CLW\nGOTO/2,0,0", (9000,)),
    ("SPINDL/RPM,7000\nRAPID\nGOTO/0,0,9\nSPINDL/8000\nGOTO/0,0,0\nSPINDL/100\nGOTO/1,0,0\nSPINDL/8000\nGOTO/2,0,0",
     (8000, 100))])
def test_the_speeds_of_the_cuts_are_read(tmp_path, text: str, rpm: tuple[float, ...]) -> None:
    (tmp_path / "part.apt").write_text(f"UNITS/MM\nFEDRAT/600,MMPM\n{text}\n")
    assert read_apt(tmp_path / "part.apt").spindle_rpm == rpm


def test_another_spindle_speed_than_the_cells_is_said(tmp_path) -> None:
    cell = read_cell(write_cell(tmp_path, CELL + "force_log: {spindle_rpm: 9000}\n"))
    there = with_air(rows(np.random.default_rng(8)))
    told = {rpm: [(one.code, one.message) for one in _odd_spindle(replace(there, spindle_rpm=rpm), cell)]
            for rpm in ((), (8110.0,), (9000.0,), (9890.0, 8110.0), (8090.0,), (9910.0,), (9000.0, 9910.0), (24000.0,))}
    assert told == {rpm: [] if all(8100 < one < 9900 for one in rpm) else [(
        "CS4325", f"the spindle turns at {' and '.join(f'{one:g}' for one in rpm)} rpm in the file; force_log.spindle_rpm in "
        "cell.yaml is 9000")] for rpm in told}
    unstated = read_cell(write_cell(tmp_path))
    assert _odd_spindle(replace(there, spindle_rpm=(24000.0,)), unstated) == []


@pytest.mark.parametrize(("second", "said"), [("SPINDL/4000,RPM,CLW\n", True), ("SPINDL/9400,RPM,CLW\n", False)])
def test_a_later_operation_at_another_speed_is_said(tmp_path, second: str, said: bool) -> None:
    (tmp_path / "part.apt").write_text("UNITS/MM\nFEDRAT/1200,MMPM\nSPINDL/9000,RPM,CLW\nGOTO/0,0,0\nGOTO/20,0,0\n"
                                       f"{second}GOTO/20,20,0\nGOTO/0,20,0\n")
    cell = read_cell(write_cell(tmp_path, CELL + "force_log: {spindle_rpm: 9000}\n"))
    found = _odd_spindle(read_apt(tmp_path / "part.apt"), cell)
    assert [(one.code, one.message.partition(";")[0]) for one in found] == [
        ("CS4325", "the spindle turns at 9000 and 4000 rpm in the file")] * said


def straight(count: int, spacing: float = 4.0) -> np.ndarray:
    return np.column_stack([spacing * np.arange(count), np.zeros((count, 2))])


@pytest.mark.parametrize(("targets", "below", "told"), [(20, 1.1, True), (19, 1.1, False), (20, 0.9, False)])
def test_a_cut_at_an_end_is_told_from_a_millimetre_below_the_air_and_twenty_targets_on(targets, below, told) -> None:
    """All cuts but the first lie as high as the moves in the air."""
    points = straight(targets)
    points[0, 2] = -below
    rapid = np.zeros(targets, dtype=bool)
    rapid[[5, -1]] = True
    found = said_of_moves(path(points, rapid), np.tile(UPWARDS, (targets, 1)), PostingSettings())
    assert [one.code for one in found] == ["CS4317"] * told
    if told:
        assert "a cut 1.1 mm below all moves in the air is where the program begins" in found[0].message


def gone_out(cuts: int, out: float, gap: float = 8.0, places: tuple[int, ...] = (10,), spacing: float = 4.0) -> CamPath:
    """A straight cut whose targets `places` stand `out` mm to the side, half way between neighbours `gap` mm apart."""
    step = np.full(cuts - 1, spacing)
    for at in places:
        step[at - 1:at + 1] = gap / 2
    points = np.column_stack([np.append(0, np.cumsum(step)), np.zeros((cuts, 2))])
    points[list(places), 1] = out
    return with_air(points)


@pytest.mark.parametrize(("cam_path", "told"), [
    (gone_out(22, 15.0), True), (gone_out(21, 15.0), False),                            # with 20 cuts between two others
    (gone_out(40, np.sqrt(13.2**2 - 16)), True), (gone_out(40, np.sqrt(10.8**2 - 16)), False),      # 3.3 and 2.7 steps of 4 mm
    # Out and back at 140 and 129 degrees, cosines -0.77 and -0.63, over 5 steps long each.
    (gone_out(40, 10 * np.tan(np.radians(70)), 20.0), True), (gone_out(40, 18 * np.tan(np.radians(64.5)), 36.0), False),
    (gone_out(60, 15.0, places=(10, 30)), True), (gone_out(60, 15.0, places=(10, 30, 50)), False)])
def test_a_target_is_out_of_line_where_the_cut_goes_three_steps_out_and_back_once_or_twice(cam_path: CamPath, told) -> None:
    assert said(cam_path) == ["CS4319"] * told


def test_the_step_in_the_middle_is_that_of_the_steps_between_two_cuts() -> None:
    """Ten of 2 mm, eight of 6, and the way out and back; the last one, of 20, leads to a cut that none follows."""
    step = [2.0] * 10 + [6.0] * 8 + [0.0, 0.0, 20.0]
    points = np.column_stack([np.append(0, np.cumsum(step)), np.zeros((22, 2))])
    points[19, 1] = 30.0
    [found] = said_of_moves(path(points, np.zeros(22, dtype=bool)), np.tile(UPWARDS, (22, 1)), PostingSettings())
    assert (found.code, found.line) == ("CS4319", 19 + 2)
    assert found.message.endswith("30 mm off both its neighbours, which are 0 mm apart; steps are 4 mm, in the middle")


@pytest.mark.parametrize(("zone", "worst"), [(0.75, "0.27"), (0.65, "")])
def test_a_zone_is_told_that_takes_over_a_quarter_of_a_millimetre_off_a_corner(zone: float, worst: str) -> None:
    """A parabola from `zone` before to `zone` behind a right angle: its middle misses the corner by zone / sqrt(8). So too
    where the tool comes down and goes off sideways."""
    found = said_of_moves(with_air(np.array([(0, 0, 0), (30, 0, 0), (30, 30, 0)], dtype=float)), np.tile(UPWARDS, (5, 1)),
                          PostingSettings(zone_mm=zone))
    assert [one.message for one in found] == (
        [f"zones of {zone:g} mm cut off 2 corners of the cut, the worst by {worst} mm"] if worst else [])


PLACED = CELL + "workobject: {position_mm: [1010, 990, 700], quaternion: [1, 0, 0, 0]}\n"
CUTTING = PLACED + "force_log: {spindle_rpm: 9000}\ncutting: {material: aluminium, tool_diameter_mm: 10}\n"


@pytest.mark.parametrize(("apt", "code", "words"), [
    ("SPINDL/9880,RPM,CLW", "CS4325", ""), ("SPINDL/9920,RPM,CLW", "CS4325", "the spindle turns at 9920 rpm in the file"),
    ("SPINDL/8120,RPM,CLW", "CS4325", ""), ("SPINDL/8080,RPM,CLW", "CS4325", "the spindle turns at 8080 rpm in the file"),
    ("CUTTER/10.18", "CS4316", ""), ("CUTTER/10.22", "CS4316", "is cut with a cutter of 10.22 mm;"),
    ("CUTTER/9.82", "CS4316", ""), ("CUTTER/9.78", "CS4316", "is cut with a cutter of 9.78 mm;"),
    # 10 mm of cutter at 150 turns a second: 0.02 mm a turn are 3 mm/s, 2.5 mm a turn 375 mm/s.
    ("FEDRAT/192,MMPM", "CS4307", ""), ("FEDRAT/168,MMPM", "CS4307", "at 2.8 mm/s and 9000 rpm the feed is 0.019 mm a turn"),
    ("FEDRAT/21600,MMPM", "CS4307", ""), ("FEDRAT/23400,MMPM", "CS4307", "at 390 mm/s and 9000 rpm the feed is 2.6 mm a turn"),
])
def test_spindle_cutter_and_feed_a_turn_are_held_against_the_cells(tmp_path, apt: str, code: str, words: str) -> None:
    assert [message[:len(words)] for message in posted(tmp_path, apt, CUTTING, code)] == [words] * bool(words)


@pytest.mark.parametrize(("apt", "words"), [
    ("FEDRAT/33,MMPM", ""), ("FEDRAT/27,MMPM", "cutting feeds from 0.45 to 0.45 mm/s: robots mill at 0.5 to 500"),
    ("FEDRAT/29400,MMPM", ""), ("FEDRAT/30600,MMPM", "cutting feeds from 510 to 510 mm/s: robots mill at 0.5 to 500")])
def test_feeds_that_no_robot_mills_at_are_told_of_any_cutter(tmp_path, apt: str, words: str) -> None:
    assert posted(tmp_path, apt, PLACED, "CS4307") == [words] * bool(words)


def posted(folder, apt: str, cell: str, code: str) -> list[str]:
    """What this code says of a cut that is posted behind these words."""
    (folder / "part.apt").write_text(f"UNITS/MM\nFEDRAT/1200,MMPM\n{apt}\nGOTO/0,0,0\nGOTO/50,0,0\n")
    read = read_cell(write_cell(folder, cell))
    said = post(read_apt(folder / "part.apt"), read, PostingSettings(), "part.mod")
    return [one.message for one in said.findings if one.code == code]

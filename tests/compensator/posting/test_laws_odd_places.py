"""Places of a toolpath: right ones are left in peace, metres, a column rapid that is the wrong way round, a tool that points
away from the part and rows that were sorted are told."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.passes import SAFE_MM, drawn
from compensator.posting.campath import CamPath
from compensator.posting.odd_places import said_of_places
from identification.model.rotations import Frame

TOOL = Frame(np.eye(3), np.array([0.12, 0, 0.25]))


def path(points_mm: np.ndarray, rapid: np.ndarray, unit: float = 1e-3) -> CamPath:
    """The tool upright, its z down into the part."""
    count = len(points_mm)
    return CamPath("path.csv", "CSV", np.ones(count, dtype=np.uint8), np.arange(count) + 2, unit * points_mm, None,
                   np.tile([0.0, 1, 0, 0], (count, 1)), rapid, np.where(rapid, np.nan, 0.04), np.zeros(count, dtype=bool),
                   None, None, {}, ())


def codes(cam_path: CamPath) -> list[str]:
    return [finding.code for finding in said_of_places(cam_path, TOOL)]


@pytest.mark.parametrize("seed", range(40))
def test_right_paths_are_left_in_peace_and_slips_are_told(seed: int) -> None:
    """Rasters and spirals over a surface that rises and falls, with their clearance above its highest place."""
    rng = np.random.default_rng((4308, seed))
    points = drawn(rng).points.copy()
    rapid = points[:, 2] == SAFE_MM
    x, y = points[:, 0] / rng.uniform(5, 60), points[:, 1] / rng.uniform(5, 60)
    points[~rapid, 2] += rng.uniform(0, 5) * (np.sin(x) * np.cos(y))[~rapid]
    assert codes(path(points, rapid)) == []
    assert len(points) >= 10
    assert codes(path(points, rapid, unit=1e-6)) == ["CS4308"]
    # An engraving of 5 mm, whose moves in the air are as much nearer.
    assert codes(path(points * 5 / np.ptp(points, axis=0).max(), rapid)) == []
    if rapid.sum() >= 5:
        assert codes(path(points, ~rapid)) == ["CS4309"]


@pytest.mark.parametrize("seed", range(20))
def test_a_tool_that_points_away_from_the_part_is_told(seed: int) -> None:
    """The quaternion of no turn in place of half a turn about x: the spindle under the part."""
    points = drawn(np.random.default_rng((4309, seed))).points
    rapid = points[:, 2] == SAFE_MM
    upside = path(points, rapid)
    assert upside.quaternion is not None
    upside.quaternion.setflags(write=True)
    upside.quaternion[:] = [1, 0, 0, 0]
    assert codes(upside) == ["CS4309"]
    turned = path(points, rapid)
    assert codes(turned) == []


@pytest.mark.parametrize("name", ["shuffled", "by height"])
def test_rows_in_another_order_are_told(name: str) -> None:
    """Of jobs with over 60 targets: as drawn by no order, or by the height of a surface that rises and falls, most are told."""
    told, count = 0, 0
    for seed in range(40):
        rng = np.random.default_rng((4315, seed))
        points = drawn(rng).points.copy()
        rapid = points[:, 2] == SAFE_MM
        if (~rapid).sum() < 60:
            continue
        points[:, 2] += 3 * np.sin(points[:, 0] / 9) * np.cos(points[:, 1] / 7) * ~rapid
        order = rng.permutation(len(points)) if name == "shuffled" else np.argsort(points[:, 2], kind="stable")
        said = codes(path(points[order], rapid[order]))
        assert set(said) <= {"CS4315"}
        told, count = told + len(said), count + 1
    assert count >= 20
    assert told >= 0.8 * count


@pytest.mark.parametrize(("count", "reach_mm", "said"), [(10, 1.99, True), (10, 2.01, False), (9, 1.99, False)])
def test_ten_targets_within_two_millimetres_are_told(count: int, reach_mm: float, said: bool) -> None:
    points = np.outer(np.linspace(0, 1, count), [0.3, reach_mm, -0.2]) + np.array([50, -20, 7])
    found = said_of_places(path(points, np.zeros(count, dtype=bool)), TOOL)
    assert [(one.code, one.level, one.file, one.message) for one in found] == [
        ("CS4308", "warning", "path.csv", f"all {count} targets lie within 2 mm: in metres?")] * said


def drawn_at(points: np.ndarray) -> list[tuple[str, int | None, str]]:
    found = said_of_places(path(points, np.zeros(len(points), dtype=bool)), TOOL)
    return [(one.code, one.line, one.message) for one in found if one.code == "CS4315"]


@pytest.mark.parametrize(("spread", "count", "said"), [(1.0, 31, True), (1.0, 30, False), (0.02, 31, False)])
def test_leaps_in_any_direction_from_thirty_on_are_told_with_the_longest(spread: float, count: int, said: bool) -> None:
    """Across a star of a few places, from one to the next but one; near each place lie others. As often there and back along
    one line it is a row that is milled to and fro."""
    turn = np.arange(count) * np.radians(144) + 0.01 * np.arange(count)
    points = 30 * np.column_stack([np.cos(turn), spread * np.sin(turn), 0 * turn])
    told = drawn_at(points)
    assert len(told) == said
    if said:
        step = np.linalg.norm(np.diff(points, axis=0), axis=1)
        assert told[0][1] == int(np.argmax(step)) + 3           # behind it, in the file's lines
        way = np.diff(points, axis=0)[:, :2] @ [1, 1j]
        turns = np.abs(np.degrees(np.angle(way[1:] / way[:-1])))
        near = np.sort(np.linalg.norm(points[:, None] - points, axis=2), axis=1)[:, 1]
        assert told[0][2] == (f"from cut to cut the path leaps {np.median(step):.3g} mm, in the middle, in any direction, and "
                              f"turns by {np.median(turns):.0f} degrees; the nearest cuts lie {np.median(near):.2g} mm apart")


def messages(points_mm: object, rapid: np.ndarray | None = None, tilt_deg: float = 0.0) -> list[str]:
    """Of targets whose tool leans by so much to either side of upright in turn."""
    points = np.array(points_mm, dtype=float)
    cam_path = path(points, np.zeros(len(points), dtype=bool) if rapid is None else rapid)
    axis = np.array([[np.sin(turn), 0, np.cos(turn)] for turn in np.radians(tilt_deg) * (-1.0) ** np.arange(len(points))])
    return [finding.message for finding in said_of_places(replace(cam_path, axis=axis, quaternion=None), TOOL)]


@pytest.mark.parametrize(("air", "depth", "tilt", "told"), [
    (5, 0.55, 0, True), (4, 0.55, 0, False), (5, 0.45, 0, False),
    (5, 0.6, 17, True), (5, 0.6, 20, False)])           # the mean of unit vectors is the cosine: 0.956 and 0.94
def test_air_under_the_cuts_is_told_of_five_moves_of_a_tool_of_one_direction(air, depth, tilt, told: bool) -> None:
    """The cuts first, then the moves in the air, deeper: the way between them is one way alone."""
    points = np.column_stack([4.0 * np.arange(12), np.zeros(12), np.zeros(12)])
    rapid = np.arange(12) >= 12 - air
    points[rapid, 2] = -depth
    shown = f"{depth * np.cos(np.radians(tilt)):.3g}"
    assert messages(points, rapid, tilt) == (
        [f"the moves in the air lie {shown} mm deeper than the cuts, in the middle: are they the cuts?"] if told else [])


@pytest.mark.parametrize(("depth", "told"), [(0.55, True), (0.45, False)])
def test_two_moves_in_the_air_that_leave_towards_the_tip_are_told_from_half_a_millimetre_on(depth: float, told: bool) -> None:
    points = np.column_stack([4.0 * np.arange(14), np.zeros(14), np.zeros(14)])
    rapid = np.isin(np.arange(14), [4, 9])
    points[rapid, 2] = -depth
    assert messages(points, rapid) == (
        [f"the moves in the air leave the cuts towards the tool's tip, by {depth:g} mm in the middle"] if told else [])


def star(count: int, turn_deg: float, rise: float = 0.0) -> np.ndarray:
    """From place to place round a circle of 100 mm, each so many degrees on, and so much higher [mm]."""
    angle = np.radians(turn_deg) * np.arange(count)
    return np.column_stack([100 * np.cos(angle), 100 * np.sin(angle), rise * np.arange(count)])


# 31 places round a circle, of which the sixth is next: steps of 200 sin(34.8 deg) = 114.3 mm, and the place five steps on is
# the neighbour, 200 sin(5.81 deg) = 20.2 mm away, or, with 3 mm a step upwards, 25.2 mm: 5.6 and 4.5 times nearer.
SIXTH = 6 * 360 / 31


@pytest.mark.parametrize(("points", "told"), [
    (star(31, SIXTH), True), (star(31, SIXTH, 3.0), False), (star(30, SIXTH), False),
    (star(40, 63.0), True), (star(40, 57.0), False)])
def test_thirty_steps_that_turn_and_leap_over_nearer_places_are_disorder(points: np.ndarray, told: bool) -> None:
    """Each condition beside its limit: turns of 63 and 57 degrees, leaps of 5.6 and 4.5 times the way to the neighbour, 30 and
    29 steps."""
    found = messages(points)
    assert len(found) == told
    if told and len(points) == 31:
        assert found[0] == ("from cut to cut the path leaps 114 mm, in the middle, in any direction, and turns by 70 degrees; "
                            "the nearest cuts lie 20 mm apart")


@pytest.mark.parametrize(("diagonal", "told"), [(11, True), (9, False)])
def test_rows_and_columns_with_few_diagonals_are_an_order(diagonal: int, told: bool) -> None:
    """Out and back in four directions; of 40 ways 9 or 11 along the diagonals: cosines of the fourfold angle of 1 and -1, whose
    mean is 0.55 or 0.45."""
    points = []
    for number in range(40):
        angle = np.radians(90 * (number % 4) + 45 * (number < diagonal))
        start = np.array([0.5 * number, 0, 0])
        points += [start, start + 100 * np.array([np.cos(angle), np.sin(angle), 0])]
    assert len(messages(points)) == told


@pytest.mark.parametrize("air", [True, False])
def test_what_lies_between_two_moves_in_the_air_is_no_disorder(air: bool) -> None:
    """Sixty places, from one to the next but five: holes that are drilled in any order, where each other move is in the air."""
    points = star(62, SIXTH)
    assert len(messages(points, np.arange(62) % 2 == 0 if air else None)) == (not air)

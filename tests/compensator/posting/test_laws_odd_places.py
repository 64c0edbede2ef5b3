"""Places of a toolpath: right ones are left in peace, metres, a column rapid that is the wrong way round, a tool that points
away from the part and rows that were sorted are told."""

from __future__ import annotations

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


def test_leaps_are_those_of_five_times_the_way_to_the_next_place() -> None:
    """A hundred places of a square, driven by no order: half of the steps are longer than about five of its meshes."""
    square = 3.0 * np.stack(np.meshgrid(np.arange(10), np.arange(10), [0]), axis=-1).reshape(-1, 3)
    told = set()
    for seed in range(12):
        points = np.random.default_rng((4315, seed)).permutation(square)
        leaps = bool(np.median(np.linalg.norm(np.diff(points, axis=0), axis=1)) >= 5 * 3.0)
        assert bool(drawn_at(points)) == leaps, seed
        told.add(leaps)
    assert told == {True, False}


@pytest.mark.parametrize(("deep_mm", "air", "words"), [
    (0.52, 5, "the moves in the air lie 0.52 mm deeper than the cuts, in the middle: are they the cuts?"), (0.48, 5, ""),
    (30.0, 5, "the moves in the air lie 30 mm deeper than the cuts, in the middle: are they the cuts?"), (30.0, 4, "")])
def test_moves_in_the_air_below_the_cuts_are_told_from_half_a_millimetre_on(deep_mm: float, air: int, words: str) -> None:
    """Of five of them, all behind the cuts, beside which they begin."""
    rapid = np.arange(12) >= 12 - air
    points = np.column_stack([4.0 * np.arange(12), np.zeros(12), np.where(rapid, -deep_mm, 0.0)])
    found = said_of_places(path(points, rapid), TOOL)
    assert [(one.code, one.level, one.file, one.message) for one in found] == [
        ("CS4309", "warning", "path.csv", words)] * bool(words)


@pytest.mark.parametrize(("down_mm", "ways", "said"), [(0.52, 2, True), (0.48, 2, False), (0.52, 1, False)])
def test_moves_out_of_the_cuts_towards_the_tip_are_told_from_half_a_millimetre_on(
    down_mm: float, ways: int, said: bool
) -> None:
    """Few moves in the air, between cuts that lie deeper still; of one way out or in nothing is said."""
    x = 4.0 * np.arange(14)
    rapid = np.isin(np.arange(14), (6, 7) if ways == 2 else (12, 13))
    z = np.where(np.arange(14) < 6, 0.0, -8.0)
    z[6 if ways == 2 else 12] = z[5 if ways == 2 else 11] - down_mm
    z[7 if ways == 2 else 13] = z[8] - down_mm
    found = said_of_places(path(np.column_stack([x, 0 * x, z]), rapid), TOOL)
    assert [(one.code, one.message) for one in found] == [
        ("CS4309", "the moves in the air leave the cuts towards the tool's tip, by 0.52 mm in the middle")] * said

"""Moves in short pieces, against places, turns and distances counted by hand: lines with zones at their ends, an arc."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation, Slerp

from compensator.correction.fine_grid import Grid, fine_grid, spacing_of
from compensator.rapid import RapidProgram, read_rapid
from compensator.toolpath import Move
from tests.runs.command_line import user_files as kit

# To 40 mm along x, a corner with z10, 100 mm along y, a corner with z20, 50 mm along x; from there half a circle of 20 mm that
# begins and ends along x, its circle point at 60 degrees; 50 mm back, and 30 mm farther.
PLACES = np.array([[0, 0], [40, 0], [40, 100], [90, 100], [90 + 20 * np.sin(np.pi / 3), 110], [90, 140], [40, 140], [10, 140]])
LONG, VIA = 2, 4
TURNS = Rotation.from_rotvec(np.random.default_rng(4).normal(0, 0.3, (8, 3)))
ZONES = ("fine", "z10", "z20", "z5", "z5", "z5", "z1", "fine")


def targets(external: tuple[str, ...] = ("9E9",) * 8) -> list[str]:
    return [f"[[{x:.9f},{y:.9f},0],[{w:.12f},{a:.12f},{b:.12f},{c:.12f}],[0,0,0,0],[{axis},9E9,9E9,9E9,9E9,9E9]]"
            for (x, y), (a, b, c, w), axis in zip(PLACES, TURNS.as_quat(), external, strict=True)]


def program(external: tuple[str, ...] = ("9E9",) * 8, *, between: str = "") -> RapidProgram:
    """between: an instruction before the long line."""
    text = targets(external)
    moves = [kit.move(one, zone=zone) for one, zone in zip(text, ZONES, strict=True)]
    moves[VIA:VIA + 2] = [f"    MoveC {text[VIA]},{text[VIA + 1]},v50,z5,tMill\\WObj:=wPart;"]
    moves.insert(LONG, between)
    return read_rapid(kit.module(moves).encode())


def path_of(text: RapidProgram, standing: np.ndarray | None = None) -> Any:
    """As the robot drives it, where all is reached. standing (8, 6): the external axes."""
    toolpath, count = text.toolpath, len(text.toolpath)
    values = np.nan_to_num(toolpath.external) if standing is None else standing
    return SimpleNamespace(toolpath=toolpath, world_position=toolpath.position, reached=np.ones(count, dtype=bool),
                           axes=SimpleNamespace(problem=np.full(count, "", dtype=object), values=values))


def pieces(**of_moves: float) -> np.ndarray:
    """Millimetres, for the long line and the arc."""
    found = np.full(8, np.inf)
    found[LONG], found[[VIA, VIA + 1]] = 1e-3 * of_moves.get("line", np.inf), 1e-3 * of_moves.get("arc", np.inf)
    return found


def gridded(path: Any, text: RapidProgram, size: np.ndarray, spacing: float = 1.0, tolerance: float = 0.0,
            **more: bool) -> Grid:
    """spacing, tolerance [mm]"""
    grid = fine_grid(text, path, np.full(8, 1e-3 * spacing), size, 1e-3 * tolerance, **{"keep": False, "whole": True} | more)
    assert grid is not None
    return grid


@pytest.mark.parametrize(("tolerance", "spacing", "free", "crowded"), [
    (0.0, 1.0, (20, 60), []), (0.03, 1.0, (20, 60), []), (1.0, 1.0, (15, 65), []), (1.0, 10.0, (15, 65), [5, 95]),
    (1.0, 18.0, (20, 65), [5, 10, 15, 85, 90, 95]), (9.0, 10.0, (10, 90), [5, 95])])
@pytest.mark.parametrize("keep", [False, True])
def test_a_line_in_pieces_keeps_away_from_its_ends_and_their_zones(
    tolerance: float, spacing: float, free: tuple[int, int], crowded: list[int], keep: bool
) -> None:
    """Zones of 10 and 20 mm take as much of the line again were a target in it, 20 and 40 mm; corners of 90 degrees that may be
    missed by t mm, by 4 t / sin 45 degrees less."""
    text = program()
    grid = gridded(path_of(text), text, pieces(line=5.0), spacing, tolerance, keep=keep)
    at = np.flatnonzero(grid.further)
    assert at.tolist() == list(range(2, 21))
    assert grid.owner.tolist() == [0, 1, *[LONG] * 20, 3, 4, 5, 6, 7]
    assert (grid.targets.tolist(), len(grid.arcs)) == (list(range(8)), 0)
    along = 5 * np.arange(1, 20)
    assert 1e3 * grid.toolpath.position[at] == pytest.approx(np.column_stack([40 + 0 * along, along, 0 * along]))
    turned = Rotation.from_quat(grid.toolpath.quaternion[at], scalar_first=True)
    assert (turned * Slerp([0, 100], TURNS[[1, 2]])(along).inv()).magnitude() == pytest.approx(0, abs=1e-9)
    assert (grid.toolpath.move[at] == Move.LINEAR).all()
    may = (along >= free[0]) & (along <= free[1])
    if keep:
        assert not (grid.may | grid.beside_zone | grid.crowded).any()
        return
    assert along[grid.may[at]].tolist() == along[may].tolist()
    assert along[grid.crowded[at]].tolist() == crowded
    assert along[grid.beside_zone[at]].tolist() == along[~may & ~np.isin(along, crowded)].tolist()
    assert not (grid.may | grid.beside_zone | grid.crowded)[~grid.further].any()
    assert not grid.divisible.any()


@pytest.mark.parametrize(("line", "count"), [(33.0, 3), (100 / 3, 3), (34.0, 2), (50.0, 2), (51.0, None)])
def test_pieces_are_as_long_as_asked_for_or_longer(line: float, count: int | None) -> None:
    text = program()
    if count is None:
        assert fine_grid(text, path_of(text), np.full(8, 1e-3), pieces(line=line), 0.0, keep=False, whole=True) is None
        return
    grid = gridded(path_of(text), text, pieces(line=line))
    assert 1e3 * grid.toolpath.position[grid.further, 1] == pytest.approx(100 / count * np.arange(1, count))


@pytest.mark.parametrize(("spacing", "looked_at"), [(49.0, True), (51.0, False)])
def test_a_line_that_has_no_room_for_a_target_is_not_looked_at(spacing: float, looked_at: bool) -> None:
    text = program()
    grid = fine_grid(text, path_of(text), np.full(8, 1e-3 * spacing), pieces(line=5.0), 0.0, keep=False, whole=True)
    assert (grid is not None) == looked_at


@pytest.mark.parametrize(("lines", "length", "most"), [(1, 2.5, 2000), (160, 2.5, 1250), (160, 0.5, 500)])
def test_of_many_long_moves_no_more_pieces_are_made_than_are_looked_at_at_once(lines: int, length: float, most: int) -> None:
    """Of a millimetre: 2000 of a move, and 200 000 in all."""
    at = [f"[[{1e3 * length * (k % 2):g},0,0],[1,0,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]]" for k in range(lines + 1)]
    text = read_rapid(kit.module([kit.move(one) for one in at]).encode())
    grid = fine_grid(text, path_of(text), np.full(lines + 1, 1e-3), np.full(lines + 1, 1e-3), 0.0, keep=True, whole=True)
    assert grid is not None
    assert np.bincount(grid.owner[grid.further]).tolist() == [0, *[most - 1] * lines]


@pytest.mark.parametrize(("spacing", "halves", "divisible"), [
    (0.01, 16, True), (1.30, 16, True), (1.32, 8, True), (10.4, 2, True), (10.6, 4, False)])
@pytest.mark.parametrize("keep", [False, True])
def test_an_arc_is_halved_as_often_as_its_shorter_half_lets_it(
    spacing: float, halves: int, divisible: bool, keep: bool
) -> None:
    """Of 20 mm and 60 degrees, 20.94 mm: pieces not shorter than targets may be apart, nor than 2.2 degrees, 0.77 mm; a quarter
    of each half at least is looked at."""
    text = program()
    grid = gridded(path_of(text), text, pieces(arc=1.0), spacing, keep=keep)
    count = max(halves, 4) if keep else halves
    assert grid.arcs.tolist() == [[3, count]]
    assert grid.owner.tolist() == [0, 1, 2, 3, *[VIA] * count, *[VIA + 1] * count, 6, 7]
    at = np.flatnonzero(grid.further)
    share = np.arange(1, count) / count
    angle = np.concatenate([60 * share, 60 + 120 * share])
    turned = np.radians(angle)
    assert 1e3 * grid.toolpath.position[at] == pytest.approx(np.column_stack(
        [90 + 20 * np.sin(turned), 120 - 20 * np.cos(turned), 0 * turned]))
    turn = Slerp([0, 180], TURNS[[3, 5]])(angle)
    found = Rotation.from_quat(grid.toolpath.quaternion[at], scalar_first=True)
    assert (found * turn.inv()).magnitude() == pytest.approx(0, abs=1e-9)
    assert (grid.toolpath.move == Move.LINEAR).all()
    own = np.insert(np.full(2 * (count - 1), divisible and not keep), count - 1, divisible and not keep)
    assert grid.divisible.tolist() == [False] * 4 + own.tolist() + [False] * 3
    assert not (grid.may | grid.beside_zone | grid.crowded).any()


def test_an_arc_is_as_fine_as_either_of_its_halves_may_be() -> None:
    text = program()
    for near, far in ((VIA, VIA + 1), (VIA + 1, VIA)):
        spacing = np.full(8, 1e-3)
        spacing[near], spacing[far] = 1.3e-3, 10.4e-3
        grid = fine_grid(text, path_of(text), spacing, pieces(arc=1.0), 0.0, keep=False, whole=True)
        assert grid is not None
        assert grid.arcs.tolist() == [[3, 16]]


def test_an_arc_beside_a_corner_keeps_its_zone() -> None:
    """The next move turns by 90 degrees behind it: in a zone of 5 mm no piece is shorter than 10 mm."""
    text = program()
    place = text.toolpath.position.copy()
    place[6] = [90e-3, 190e-3, 0]
    text = replace(text, toolpath=replace(text.toolpath, position=place))
    assert gridded(path_of(text), text, pieces(arc=1.0)).arcs.tolist() == [[3, 2]]
    assert gridded(path_of(text), text, pieces(arc=1.0), tolerance=5.0).arcs.tolist() == [[3, 16]]


def test_lines_and_arcs_stand_on_one_grid_in_their_order() -> None:
    text = program()
    grid = gridded(path_of(text), text, pieces(arc=1.0, line=20.0), 5.0)
    assert grid.owner.tolist() == [0, 1, *[LONG] * 5, 3, *[VIA] * 4, *[VIA + 1] * 4, 6, 7]
    assert grid.arcs.tolist() == [[7, 4]]
    few = gridded(path_of(text), text, pieces(line=20.0), 5.0, whole=False)
    assert few.targets.tolist() == list(range(6))


@pytest.mark.parametrize("at", [LONG - 1, LONG, VIA - 1, VIA, VIA + 1, 6])
@pytest.mark.parametrize("what", ["tool", "workobject", "reached", "block", "external", "problem", "position"])
def test_a_move_between_targets_that_are_not_alike_is_left_whole(at: int, what: str) -> None:
    """Another tool or work object, a unit that is driven or not, and no pose at either end; what holds a move at its end
    alone."""
    text = program(("0",) * 8)
    path = path_of(text)
    if what in ("reached", "problem"):
        path.reached[at] = what != "reached"
        path.axes.problem[at] = "it has none" if what == "problem" else ""
    else:
        values = getattr(path.toolpath, what).copy()
        values[at] = {"tool": 7, "workobject": 7, "block": "computed at run time"}.get(what, np.nan)
        path.toolpath = replace(path.toolpath, **{what: values})
    grid = fine_grid(text, path, np.full(8, 1e-3), pieces(line=5.0, arc=1.0), 0.0, keep=False, whole=True)
    left = {at} if what in ("block", "problem") else {at, at + 1}
    left |= {VIA, VIA + 1} if left & {VIA, VIA + 1} else set()
    made = {LONG, VIA, VIA + 1} - left
    assert made
    assert grid is not None
    assert set(grid.owner[grid.further]) == made


@pytest.mark.parametrize("without", [VIA, VIA + 1])
def test_an_arc_is_looked_at_as_a_whole_where_either_half_is_to_be(without: int) -> None:
    text, size = program(), pieces(arc=1.0)
    size[without] = np.inf
    assert gridded(path_of(text), text, size).arcs.tolist() == [[3, 16]]


def test_a_line_behind_another_instruction_is_looked_at_and_gets_no_target() -> None:
    text = program(between="    SetDO doSpindle,1;")
    grid = gridded(path_of(text), text, pieces(line=5.0))
    assert grid.further.sum() == 19
    assert not (grid.may | grid.beside_zone | grid.crowded).any()


@pytest.mark.parametrize(("off", "divisible"), [(0.9e-4, True), (1.1e-4, False)])
def test_external_axes_are_in_proportion_to_the_way(off: float, divisible: bool) -> None:
    """Of lines, and of each half of an arc from where they stand; a circle point at which they stand otherwise than is written
    cannot become a target: its axes are not driven to what is written."""
    text = program(("0", "10", "60", "70", "90", "100", "110", "120"))
    standing = np.nan_to_num(text.toolpath.external)
    standing[VIA, 0] += off
    grid = gridded(path_of(text, standing), text, pieces(line=20.0, arc=1.0), 5.0)
    further = grid.toolpath.external[grid.further]
    assert np.isnan(further[:, 1:]).all()
    assert further[:4, 0] == pytest.approx([20, 30, 40, 50], abs=1e-6)
    share = np.arange(1, 4) / 4
    assert further[4:, 0] == pytest.approx(np.concatenate([70 + (20 + off) * share, (90 + off) + (10 - off) * share]), abs=1e-6)
    assert np.array_equal(further, np.round(further, 6), equal_nan=True)
    assert grid.toolpath.external[grid.kept, 0] == pytest.approx([0, 10, 60, 70, 90 + off, 100, 110, 120], abs=1e-9)
    assert grid.divisible.any() == divisible


def test_units_are_switched_right_behind_the_target_before() -> None:
    """Before the first, before the long line and before the arc; what a target is synchronised with stays with it."""
    text = program()
    switched = ((0, "a", True), (LONG, "b", True), (VIA, "c", False))
    path = path_of(replace(text, toolpath=replace(text.toolpath, switched=switched, together=np.arange(8) == 3)))
    grid = gridded(path, text, pieces(line=20.0, arc=1.0), 5.0)
    assert grid.toolpath.switched == ((0, "a", True), (2, "b", True), (8, "c", False))
    assert np.flatnonzero(grid.toolpath.together).tolist() == [7]
    assert grid.toolpath.number.tolist() == grid.owner.tolist()


def test_targets_of_a_move_stand_as_near_as_its_feed_lets_them() -> None:
    toolpath: Any = SimpleNamespace(feed=np.array([np.nan, 0.01, 0.05, 0.1]))
    assert spacing_of(toolpath, 0.25e-3, 6e-3) == pytest.approx([0.25e-3, 0.25e-3, 0.3e-3, 0.6e-3])

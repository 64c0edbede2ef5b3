"""A log along the moves as they are driven: which of several ways it is of, where its samples lie by the text, and what is left
out since nobody knows."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from compensator.forces import driven_moves
from compensator.forces.driven_moves import _agreed, _each_way, _fewest_turns, _fitting, _of_text, _open, _promising, as_driven
from compensator.forces.log import ForceLog, read_force_log
from compensator.path.robot_path import RobotPath
from compensator.toolpath import Way
from identification.common.findings import CompstiffError, Finding
from identification.model.cell_file import ForceLogFile
from tests.compensator.forces.test_contract_placement import log_text
from tests.compensator.path.test_laws_timing import lines, program

# Along x, round by four targets beside it, or straight on over 30 mm: 210 mm or 130 mm.
POINTS = [*([1000.0 + 10 * k, 0, 700] for k in range(6)), [1050, 20, 700], [1050, 40, 700], [1080, 40, 700], [1080, 20, 700],
          *([1080.0 + 10 * k, 0, 700] for k in range(6))]
ROUND, STRAIGHT = np.arange(16), np.array([*range(6), *range(10, 16)])
WITH, WITHOUT = ("IF diSide=1 (line 9)",), ("not IF diSide=1 (line 9)",)


@pytest.fixture(scope="module")
def text(tmp_path_factory: pytest.TempPathFactory) -> RobotPath:
    moves = lines(POINTS, "v100", "fine")
    return program(tmp_path_factory.mktemp("program"), [moves[0].replace("MoveJ", "MoveL"), *moves[1:]])


def along_ways(path: RobotPath, *ways: Way) -> RobotPath:
    return replace(path, toolpath=replace(path.toolpath, ways=ways))


def logged(folder: Path, place: np.ndarray, header: str = "path_mm") -> ForceLog:
    file = folder / "log.csv"
    file.write_text(log_text(f"{header},fx_n,fy_n,fz_n", np.column_stack([place, np.tile([1.0, 2, 3], (len(place), 1))])))
    return read_force_log(file)


def by_text(place: np.ndarray) -> np.ndarray:
    """Where samples of the straight way lie by the text [mm]: on the move that the text does not have at its nearer end."""
    return np.where(place <= 50, place, np.where(place >= 80, place + 80, np.where(place > 65, 160.0, 50.0)))


def said(log: ForceLog, code: str) -> list[tuple[str, str]]:
    return [(one.level, one.message) for one in log.findings if one.code == code]


@pytest.mark.parametrize(("end", "taken"), [
    (210.0, WITH), (206.0, WITH), (130.0, WITHOUT), (127.5, WITHOUT), (132.5, WITHOUT)])
def test_a_log_is_of_the_way_whose_end_it_reaches_to(text: RobotPath, tmp_path: Path, end: float, taken: tuple[str]) -> None:
    """To a fiftieth of the way."""
    path = along_ways(text, Way(ROUND, WITH, False, (None,)), Way(STRAIGHT, WITHOUT, False, (None,)))
    place = np.linspace(0, end, 400)
    found = as_driven(logged(tmp_path, place), path)
    assert said(found.log, "CS3123") == [("note", f"the log is of the program with {taken[0]}")]
    if taken == WITH:
        np.testing.assert_allclose(1e3 * found.log.place, place, atol=1e-6)
        assert not said(found.log, "CS3122")
        return
    np.testing.assert_allclose(1e3 * found.log.place, by_text(np.minimum(place, 130)), atol=1e-6)
    np.testing.assert_allclose(1e3 * found.along.place, place, atol=1e-6)
    np.testing.assert_array_equal(found.order, STRAIGHT)
    assert said(found.log, "CS3122") == [(
        "note", "followed along the moves as the calls drive them, which is not the order of the text; 4 targets that no call "
        "or branch leads to, of an error handler, a trap or an idle routine, have no sample; 1 move at the feed of the cut "
        "that a call leads to (line 13) is looked at at both ends alone")]


@pytest.mark.parametrize("stated", [False, True])
def test_of_a_log_that_fits_neither_end_the_rows_count_that_are_on_one_place(
    text: RobotPath, tmp_path: Path, stated: bool
) -> None:
    """To 5 mm: behind the first branch each way has its own. Where the file's values lead along one it is that."""
    path = along_ways(text, Way(STRAIGHT, WITHOUT, stated, (None,)), Way(ROUND, WITH, False, (None,)))
    place = np.arange(0, 150.0)
    found = as_driven(logged(tmp_path, place), path).log
    straight, along = by_text(np.minimum(place, 130)), place
    if stated:
        np.testing.assert_allclose(1e3 * found.place, straight, atol=1e-6)
        assert said(found, "CS3123") == [("warning", "taken as driven by the values in the file, which the log does not show: "
                                                     f"{WITHOUT[0]}")]
        return
    keep = np.abs(straight - along) <= 5
    np.testing.assert_allclose(1e3 * found.place, straight[keep], atol=1e-6)
    assert said(found, "CS3123") == [(
        "warning", f"neither the text nor the log says which was driven: {WITH[0]}, {WITHOUT[0]}; {int((~keep).sum())} samples "
        "that lie elsewhere by each are left out")]


@pytest.mark.parametrize(("begins", "refused"), [(45, False), (46, True)])
def test_a_log_of_which_a_tenth_or_less_is_on_one_place_is_refused(
    text: RobotPath, tmp_path: Path, begins: int, refused: bool
) -> None:
    """Up to 55 mm both ways are on one place: of 105 rows 11, of 104 rows 10."""
    path = along_ways(text, Way(STRAIGHT, WITHOUT, False, (None,)), Way(ROUND, WITH, False, (None,)))
    log = logged(tmp_path, np.arange(begins, 150.0))
    if not refused:
        assert len(as_driven(log, path).log.place) == 56 - begins
        return
    with pytest.raises(CompstiffError) as stopped:
        as_driven(log, path)
    [found] = stopped.value.findings
    assert (found.code, found.message) == (
        "CS3123", f"where this log lies depends on {WITH[0]}, {WITHOUT[0]}, which the text does not say, nor the log")


@pytest.mark.parametrize("order", [ROUND, STRAIGHT])
def test_positions_tell_which_way_was_driven(text: RobotPath, tmp_path: Path, order: np.ndarray) -> None:
    """By the samples that lie on it: those beside the straight way, over 5 mm off, or none."""
    path = along_ways(text, Way(STRAIGHT, WITHOUT, False, (None,)), Way(ROUND, WITH, False, (None,)))
    points = np.array(POINTS)[order]
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    place = np.linspace(0, length[-1], 600)
    log = logged(tmp_path, np.column_stack([np.interp(place, length, axis) for axis in points.T]), "x_mm,y_mm,z_mm")
    found = as_driven(log, path)
    expected = by_text(place) if order is STRAIGHT else place
    np.testing.assert_allclose(1e3 * found.log.place, expected, atol=1e-3)


def turned(*turns: int | None, stated: bool = False) -> Way:
    return Way(STRAIGHT, WITHOUT, stated, turns)


@pytest.mark.parametrize("key", ["time", "path_mm"])
@pytest.mark.parametrize("count", [8, 9])
def test_by_time_alone_loops_of_more_than_two_turns_are_not_tried(
    text: RobotPath, monkeypatch: pytest.MonkeyPatch, key: str, count: int
) -> None:
    """But where the file states them; of more than eight ways those that a quick look leaves."""
    few = [turned(2, None), turned(3, 1, stated=True), turned(None), *[turned(1, 2)] * (count - 3)]
    path, tried = along_ways(text, turned(3), *few, turned(None, 4)), []
    monkeypatch.setattr(driven_moves, "_along", lambda log, path, way: tried.append(way))
    monkeypatch.setattr(driven_moves, "_promising", lambda log, path, ways: ways[:2])
    assert list(_each_way(cast("Any", SimpleNamespace(key=key)), path)) == []
    expected = list(path.toolpath.ways) if key != "time" else few[:2] if count > 8 else few
    assert [id(way) for way in tried] == [id(way) for way in expected]


@pytest.mark.parametrize(("promised", "stated", "kept"), [
    ((0.9, 0.61, 0.59, 0.2), (), (0, 1)), ((0.2, 0.9, 0.59, 0.61), (2,), (1, 2, 3)), ((0.2, None, 0.51, 0.0), (), (2,)),
    ((0.31, None, 0.5, 0.19), (), (0, 2)), ((0.29, None, 0.2, 0.1), (), (0, 1, 2, 3)),
    ((0.8, 0.81, 0.82, 0.83, 0.84, 0.85, 0.86, 0.87, 0.88, 0.89), (0,), (0, 2, 3, 4, 5, 6, 7, 8, 9)),
    ((0.7,) * 10, (), range(8))])
def test_a_quick_look_leaves_the_eight_best_that_are_near_the_best(
    text: RobotPath, monkeypatch: pytest.MonkeyPatch, promised: tuple[float | None, ...], stated: tuple[int, ...],
    kept: tuple[int, ...]
) -> None:
    """By 0.3 of what the force varies by; what has no time promises nothing, and what the file states is kept."""
    ways = [turned(None, stated=k in stated) for k in range(len(promised))]
    look = iter(promised)

    def promise(log: ForceLog, path: RobotPath) -> float:
        found = next(look)
        if found is None:
            raise CompstiffError(Finding("CS3060", "error", "a move without known time"))
        return found

    monkeypatch.setattr(driven_moves, "promise_by_time", promise)
    found = _promising(cast("Any", SimpleNamespace(key="time")), text, ways)
    assert [id(way) for way in found] == [id(ways[k]) for k in kept]


@pytest.mark.parametrize(("means", "beside", "by_order"), [("ahead", (), True), ("ahead", (6,), False), ("nearest", (), False)])
def test_a_log_that_names_a_target_which_no_call_leads_to_is_of_the_text(
    text: RobotPath, tmp_path: Path, means: Any, beside: tuple[int, ...], by_order: bool
) -> None:
    """Else the way to the target ahead begins at the one that is driven before it."""
    order = np.array([*range(8, 16), *range(6)])
    form = replace(text.cell.force_log, form=text.cell.force_log.form.model_copy(update={"target": means}))
    path = replace(text, toolpath=replace(text.toolpath, driven=order), cell=replace(text.cell, force_log=form))
    number = np.repeat([8, 9, 10, 0, 1, *beside], 3)
    found = as_driven(logged(tmp_path, number, "target"), path)
    assert np.array_equal(found.order, order if by_order else np.arange(16))


def test_ways_that_cannot_be_followed_leave_the_order_of_the_text(text: RobotPath, tmp_path: Path) -> None:
    found = as_driven(logged(tmp_path, np.arange(0, 210.0)), along_ways(text, Way(ROUND, (), False)))
    np.testing.assert_allclose(1e3 * found.log.place, np.arange(210.0), atol=1e-6)
    [(level, message)] = said(found.log, "CS3123")
    assert (level, message.partition(",")[0]) == ("warning", "the branches of this program cannot be followed")


@pytest.mark.parametrize(("end", "by_the_text"), [(110, False), (116.9, False), (117, True), (120.3, True), (120.5, False)])
def test_a_log_is_of_the_text_whose_end_is_five_times_nearer(end: float, by_the_text: bool) -> None:
    """118.33 mm, and 110 as driven."""
    assert _of_text(end, 110.0, 118.33) == by_the_text


def test_a_log_of_a_program_without_branches_may_be_of_all_its_moves(text: RobotPath, tmp_path: Path) -> None:
    path = replace(text, toolpath=replace(text.toolpath, driven=STRAIGHT))
    for end, order in ((130.0, STRAIGHT), (210.0, ROUND)):
        place = np.linspace(0, end, 200)
        found = as_driven(logged(tmp_path, place), path)
        assert found.order.tolist() == order.tolist()
        np.testing.assert_allclose(1e3 * found.log.place, by_text(place) if order is STRAIGHT else place, atol=1e-6)
    points = np.array(POINTS)
    for order in (STRAIGHT, ROUND):
        found = as_driven(logged(tmp_path, np.repeat(points[order], 3, axis=0), "x_mm,y_mm,z_mm"), path)
        assert found.order.tolist() == order.tolist()


def test_ways_that_lead_to_the_same_places_need_no_telling(text: RobotPath, tmp_path: Path) -> None:
    path = along_ways(text, Way(ROUND, WITH, False, (None,)), Way(ROUND, WITHOUT, False, (None,)))
    found = as_driven(logged(tmp_path, np.arange(190.0)), path).log
    np.testing.assert_allclose(1e3 * found.place, np.arange(190.0), atol=1e-6)
    assert not said(found, "CS3123")


def test_of_targets_that_are_driven_twice_the_first_time_counts(text: RobotPath, tmp_path: Path) -> None:
    """To the end, back to the target 50 mm before it, and there again: samples nearer to what was driven before are left out,
    and the others stand along the path."""
    order = np.array([*ROUND, *range(10, 16)])
    path = replace(text, toolpath=replace(text.toolpath, driven=order))
    place = np.arange(0.5, 310.0)
    found = as_driven(logged(tmp_path, place), path)
    np.testing.assert_allclose(1e3 * found.log.place, [*place[place < 210], *[210.0] * 25], atol=1e-6)
    assert found.log.time is None
    np.testing.assert_allclose(1e3 * found.along.place, place, atol=1e-6)
    assert said(found.log, "CS3122") == [(
        "note", "followed along the moves as the calls drive them, which is not the order of the text; of targets that are "
        "driven more than once the first time counts; 1 move at the feed of the cut that a call leads to (line 13) is looked "
        "at at both ends alone")]


@pytest.mark.parametrize(("key", "level"), [("path_mm", "warning"), ("x_mm,y_mm,z_mm", "note")])
def test_moves_at_the_feed_of_a_cut_that_nothing_leads_to_are_warned_of(
    text: RobotPath, tmp_path: Path, key: str, level: str
) -> None:
    """Unless positions show that the log is of none of them, or a branch may lead there."""
    path = replace(text, toolpath=replace(text.toolpath, driven=STRAIGHT))
    place = np.linspace(0, 130, 300) if key == "path_mm" else np.repeat(np.array(POINTS)[STRAIGHT], 3, axis=0)
    found = as_driven(logged(tmp_path, place, key), path).log
    [(told, message)] = said(found, "CS3122")
    assert (told, "4 targets that no call or branch leads to" in message) == (level, True)


def test_a_target_ahead_is_reached_from_the_one_that_is_driven_before_it(text: RobotPath, tmp_path: Path) -> None:
    """The second half of the text is driven first: the samples of a target lie evenly on the way there."""
    order = np.array([*range(10, 16), *range(10)])
    ahead = replace(text.cell, force_log=replace(text.cell.force_log, form=ForceLogFile(target="ahead")))
    path = replace(text, cell=ahead, toolpath=replace(text.toolpath, driven=order))
    log = logged(tmp_path, np.repeat([11.0, 12, 3, 4], 4), "target")
    found = as_driven(log, path)
    shares = (np.arange(4) + 0.5) / 4
    expected = np.concatenate([20 + 10 * shares, 30 + 10 * shares, 160 + 10 * shares, 170 + 10 * shares])
    np.testing.assert_allclose(1e3 * np.sort(found.log.place), expected, atol=1e-6)
    nearest = replace(path, cell=text.cell)
    assert as_driven(log, nearest).order.tolist() == ROUND.tolist()


@pytest.mark.parametrize(("text_m", "told"), [(1.0203, False), (1.0205, True), (0.9805, False), (0.9803, True)])
def test_lengths_within_a_fiftieth_of_each_other_are_not_told_by_the_end(text_m: float, told: bool) -> None:
    assert _of_text(text_m, 1.0, text_m) == told


def one(length: float = 1.0, place: list[float] | None = None, taken: tuple[str, ...] = (), stated: bool = False,
        turns: tuple[int | None, ...] = (), targets: int = 3) -> Any:
    return SimpleNamespace(driven=SimpleNamespace(ends=(length, 1.0)), place=np.array(place or [0.0]),
                           way=Way(np.arange(targets), taken, stated, turns))


def log_of(key: str, end: float = 1.0) -> ForceLog:
    return cast(ForceLog, SimpleNamespace(key=key, place=np.array([0.0, end])))


@pytest.mark.parametrize(("end", "kept"), [
    (1.0, [0]), (1.0079, [0]), (1.0081, [0, 1]), (1.025, [0, 1]), (1.045, [1]), (1.08, [0, 1])])
def test_a_way_is_ruled_out_whose_end_is_five_times_farther_than_the_nearest(end: float, kept: list[int]) -> None:
    """Of 1 m and 1.048 m; beyond a fiftieth of the nearest none is."""
    ways = [one(1.0), one(1.048)]
    assert _fitting(log_of("path_mm", end), ways) == [ways[k] for k in kept]
    assert _fitting(log_of("path_mm", end), []) == []
    assert _fitting(log_of("time", end), ways) == ways


def test_of_positions_ways_are_left_that_all_but_a_hundredth_lie_on() -> None:
    """The best first; one that the file's values lead to before them; of ways that differ in turns that of the fewest."""
    def on(number: int, **named: Any) -> Any:
        return one(place=[0.5] * number + [np.nan] * (1000 - number), **named)

    best, near, far = (on(number, taken=(str(number),), turns=(None,)) for number in (990, 981, 980))
    assert _fitting(log_of("position"), [far, near, best]) == [best, near]
    stated = on(985, taken=("d",), turns=(None,), stated=True)
    assert _fitting(log_of("joints"), [near, best, stated]) == [stated, best, near]
    twice, once = on(990, taken=("two turns",), turns=(2,), targets=9), on(990, taken=("one turn",), turns=(1,), targets=6)
    assert _fewest_turns([twice, once]) == [once]
    assert _fewest_turns([best, near]) == [best, near]


def test_rows_agree_that_are_within_five_millimetres_or_on_no_way() -> None:
    nan = np.nan
    ways = [one(place=place) for place in (
        [0.1, 0.1, 0.1, nan, nan], [0.1, 0.1049, 0.1051, nan, 0.1], [0.1, 0.101, 0.1, nan, 0.1])]
    assert _agreed(ways).tolist() == [True, True, False, True, False]


def test_branches_are_named_on_which_ways_differ() -> None:
    ways = [one(taken=("always", "b", "x")), one(taken=("always", "a", "x")), one(taken=("always", "c", "d"))]
    assert _open(ways[:2]) == "a, b"
    assert _open(ways) == "a, b, c ..."

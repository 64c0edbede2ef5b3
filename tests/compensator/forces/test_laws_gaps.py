"""Targets of a cut without a sample: which are taken to lie between, what is taken there, how sure it is, and what is told."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from compensator.forces.gaps import (
    filled,
    left_out,
    said_of_gaps,
    said_of_held,
    said_of_left_out,
    short_gaps,
    without_sample_in_cut,
)

CUT, AIR = 0.02, 0.2


def program(length_mm: list[float] | np.ndarray, air: tuple[int, ...] = ()) -> Any:
    """Targets at these path lengths, reached at the cutting feed but for some, in lines 10, 11 ..."""
    count = len(length_mm)
    feed = np.where(np.isin(np.arange(count), air), AIR, CUT)
    toolpath = SimpleNamespace(feed=feed, by_joints=np.zeros(count, dtype=bool), source="m.mod", line=np.arange(10, 10 + count))
    return SimpleNamespace(length=1e-3 * np.asarray(length_mm, dtype=float), toolpath=toolpath)


def flags(text: str) -> np.ndarray:
    return np.array([one == "x" for one in text])


@pytest.mark.parametrize(("sampled", "forced", "air", "gaps"), [
    # A cut of 20 mm from target 0 to 20; of its quarter, 5 mm, gaps of up to three targets are 4 mm.
    ("xxxxx.xxxxxxxxxxxxxxx", "xxxxx.xxxxxxxxxxxxxxx", (), [(4, 6)]),
    ("xxxxx...xxxxxxxxxxxxx", "xxxxx...xxxxxxxxxxxxx", (), [(4, 8)]),
    ("xxxxx....xxxxxxxxxxxx", "xxxxx....xxxxxxxxxxxx", (), []),
    ("xxxxx.x.xxxxxxxxxxxxx", "xxxxx.x.xxxxxxxxxxxxx", (), [(4, 6), (6, 8)]),
    # A target with samples and no force in it, one at either end of the cut, moves in the air into and out of it.
    ("xxxxx.x.xxxxxxxxxxxxx", "xxxxx...xxxxxxxxxxxxx", (), []),
    (".xxxxxxxxxxxxxxxxxxx.", ".xxxxxxxxxxxxxxxxxxx.", (), []),
    ("xxxxx.xxxxxxxxxxxxxxx", "xxxxx.xxxxxxxxxxxxxxx", (5,), []),
    ("xxxxx.xxxxxxxxxxxxxxx", "xxxxx.xxxxxxxxxxxxxxx", (6,), []),
    ("xxxxx.xxxxxxxxxxxxxxx", "xxxxx.xxxxxxxxxxxxxxx", (4, 7), [(4, 6)])])
def test_up_to_three_targets_at_the_cutting_feed_are_a_short_gap(
    sampled: str, forced: str, air: tuple[int, ...], gaps: list[tuple[int, int]]
) -> None:
    path, none = program(np.arange(21), air), np.empty(0, dtype=np.intp)
    samples = flags(sampled).astype(np.intp)
    assert short_gaps(path, samples, flags(forced), none) == gaps
    # What stood still is no gap.
    assert short_gaps(path, samples, flags(forced), np.array([5, 7])) == []


@pytest.mark.parametrize(("behind", "gap"), [(2.05, True), (1.95, False)])
def test_a_gap_is_no_longer_than_a_quarter_of_the_cut_it_lies_in(behind: float, gap: bool) -> None:
    """4 mm before it, 2 mm of it, and so much behind; a cut beside it, behind a target without force, is another one."""
    length = np.cumsum([0.0, 2, 2, 1, 1, behind, 5, 50, 50])
    forced = flags("xxx.xx.xx")
    samples = flags("xxx.xxxxx").astype(np.intp)
    found = short_gaps(program(length), samples, forced, np.empty(0, dtype=np.intp))
    assert found == ([(2, 4)] if gap else [])
    unknown = program(np.where(np.arange(9) == 3, np.nan, length))
    assert short_gaps(unknown, samples, forced, np.empty(0, dtype=np.intp)) == []


def test_what_lies_between_is_by_path_length_and_as_unsure_as_both_sides_and_a_step() -> None:
    """A gap of 1 and 3 mm from 100 to 180 N and from 4 to -4 Nm; errors of 2 and 6 N on its sides. At a quarter of it 120 N
    stands for 100 or 180: sqrt(20 x 60). Three of the targets lie off the line of their neighbours' neighbours."""
    length = np.array([0, 2, 4, 6, 7, 10, 12, 14, 16], dtype=float)
    wrench, error = np.zeros((9, 6)), np.zeros((9, 3))
    wrench[:, 0] = [100, 100, 100, 100, 0, 180, 180, 180, 180]
    wrench[3, 4], wrench[5, 4] = 4.0, -4.0
    error[3], error[5] = 2.0, 6.0
    known = np.arange(9) != 4
    between = filled(program(length), wrench, error, known, [(3, 5)])
    assert between.tolist() == [4]
    assert wrench[4] == pytest.approx([120, 0, 0, 0, 2, 0])
    assert error[4] == pytest.approx([np.sqrt(3.0**2 + 20 * 60), 3, 3])
    # Everything else is as it was.
    assert wrench[:, 0].tolist() == [100, 100, 100, 100, 120, 180, 180, 180, 180]
    assert error[[0, 3, 5], 0].tolist() == [0, 2, 6]


def test_what_other_targets_are_off_the_middle_of_those_beside_them_is_in_it() -> None:
    """To and fro by 3 N from target to target: each is 6 N off the middle of its neighbours; a gap of one. Of a gap of three
    those two before and behind count, which are alike. A mean without samples on one side is no less sure by it."""
    wrench, error = np.zeros((30, 6)), np.full((30, 3), np.nan)
    wrench[:, 1] = 50 + 3 * (-1.0) ** np.arange(30)
    wrench[10] = 0
    known = np.arange(30) != 10
    filled(program(np.arange(30)), wrench, error, known, [(9, 11)])
    assert wrench[10, 1] == pytest.approx(47)
    assert error[10] == pytest.approx([0, 6 / 0.6745, 0], abs=1e-9)
    wrench[[10, 11, 12]] = 0
    known = ~np.isin(np.arange(30), (10, 11, 12))
    assert filled(program(np.arange(30)), wrench, error, known, [(9, 13)]).tolist() == [10, 11, 12]
    assert error[11] == pytest.approx([0, 0, 0], abs=1e-9)
    assert not len(filled(program(np.arange(30)), wrench, error, known, []))


@pytest.mark.parametrize(("empty", "forced", "air", "found"), [
    # Up to a force, on from one, between two; reached through the air, or beside nothing, not.
    ("x..xxx", "x..xxx", (), [1, 2]), ("..xxxx", "..xxxx", (), [0, 1]), ("xxxx..", "xxxx..", (), [4, 5]),
    ("x..xxx", "......", (), []), ("x..xxx", "x..xxx", (1,), [2]), ("x..x..", "...x..", (), [1, 2, 4, 5]),
    ("xx.x.x", "x....x", (), [4])])
def test_targets_without_a_sample_beside_a_force_are_missed_in_the_cut(
    empty: str, forced: str, air: tuple[int, ...], found: list[int]
) -> None:
    missed = without_sample_in_cut(program(np.arange(6), air), flags(empty).astype(np.intp), flags(forced))
    assert np.flatnonzero(missed).tolist() == found


@pytest.mark.parametrize(("hole", "step", "lost"), [
    ((14.0, 18.9), 0.1, []), ((14.0, 19.1), 0.1, [(2, 5.1)]), ((16.0, 24.5), 0.1, []), ((16.0, 25.2), 0.1, [(3, 5.2)]),
    ((14.0, 25.5), 0.1, [(2, 6.0), (3, 5.5)]),
    # 20 times the usual way between two; the way into the air of target 4 does not count.
    ((11.0, 19.0), 0.39, [(2, 8.0)]), ((11.0, 19.0), 0.42, []), ((31.0, 39.0), 0.1, []), ((41.0, 49.0), 0.1, [(5, 8.0)])])
def test_a_log_leaves_out_what_no_sample_lies_on(hole: tuple[float, float], step: float, lost: list[tuple[int, float]]) -> None:
    """Of moves of 10 mm over 5 mm, in one of them, between two samples that stand anywhere in the file."""
    way = np.concatenate([np.arange(hole[0], -1e-9, -step), np.arange(hole[1], 50.001, step)])
    place = np.concatenate([np.random.default_rng(1).permutation(way), [np.nan]])
    to, much = left_out(program(10 * np.arange(6), air=(4,)), 1e-3 * place)
    assert to.tolist() == [target for target, _ in lost]
    assert 1e3 * much == pytest.approx([each for _, each in lost])
    assert not len(left_out(program(10 * np.arange(6), air=(4,)), np.array([0.01]))[0])


def test_what_is_left_out_is_not_asked_where_the_way_is_not_known() -> None:
    path = program([0, 10, np.nan, 30, 40])
    to, _ = left_out(path, 1e-3 * np.array([0, 0.1, 0.2, 0.3, 9.8, 9.9, 10.0, 31, 39.0]))
    assert to.tolist() == [1, 4]


def test_a_log_that_hardly_is_one_leaves_nothing_out_that_it_could_tell() -> None:
    for place in ([], [0.0], [0.0, 0.04], [np.nan, np.nan]):
        assert [len(one) for one in left_out(program(10 * np.arange(6)), np.array(place))] == [0, 0]
    to, lost = left_out(program([0.0]), 1e-3 * np.array([0, 0.1, 0.2, 0.3, 39, 39.1, 39.2]))
    assert (len(to), len(lost)) == (0, 0)


@pytest.mark.parametrize(("sampled", "forced", "change", "words"), [
    # Of six moves of 10 mm the log leaves out 8 mm of those to targets 2 and 4, 6 mm of that to target 5.
    ("xxxxxx", "xxxxxx", {}, "8 mm of the move to this target, in the cut, and less of 2 more"),
    ("xxxxxx", "x.x.x.", {}, "8 mm of the move to this target, in the cut, and less of 2 more"),
    ("xxxxxx", ".x....", {}, "8 mm of the move to this target, in the cut"), ("xxxxxx", "......", {}, ""),
    ("x.xxxx", "xxxxxx", {}, "8 mm of the move to this target, in the cut, and less of 1 more"),
    ("xxxxx.", "......", {}, ""), ("xxxxx.", ".....x", {}, ""), ("xxxx.x", "....xx", {}, ""),
    ("xxxxxx", "xxxxxx", {"key": "target"}, ""), ("xxxxxx", "xxxxxx", {"spread": np.ones(1)}, ""),
    ("xxxxxx", "xxxxxx", {"predicted": object()}, ""), ("xxxxxx", "xxxxxx", {"driven": object()}, "")])
def test_a_stretch_of_a_cut_that_a_log_leaves_out_is_told_between_targets_that_it_has(
    sampled: str, forced: str, change: dict[str, Any], words: str
) -> None:
    """Of the worst; where its samples stand is by the log's own path lengths, and the program was driven as it stands."""
    path = program(10 * np.arange(6))
    path.toolpath.driven = change.get("driven")
    place = np.concatenate([np.arange(0, 11.05, 0.1), np.arange(19, 31.05, 0.1), np.arange(39, 41.05, 0.1), [47.0, 48, 49, 50]])
    log: Any = SimpleNamespace(**{"key": "path_mm", "spread": None, "predicted": None, "place": 1e-3 * np.append(place, 15.0)}
                               | {name: value for name, value in change.items() if name != "driven"})
    forces: Any = SimpleNamespace(samples=flags(sampled).astype(np.intp), forced=flags(forced))
    found = said_of_left_out(log, path, forces, np.arange(len(place) + 1) < len(place))
    assert found == [] or [(one.code, one.level, one.file, one.message.split(": there")[0]) for one in found] == [
        ("CS3134", "warning", "m.mod", f"the log leaves out {words}")]
    assert bool(found) == bool(words)
    assert [one.target for one in found] == ([2] if words and sampled[1] == "x" else [4] if words else [])


def told(path: Any, samples: np.ndarray, forced: np.ndarray, between: list[int], predicted: bool = False) -> list[Any]:
    log: Any = SimpleNamespace(source="log.csv", predicted=object() if predicted else None)
    forces: Any = SimpleNamespace(samples=samples, forced=forced)
    return said_of_gaps(log, path, forces, np.array(between, dtype=np.intp))


@pytest.mark.parametrize(("sampled", "level"), [(".....xxxxx", "note"), ("......xxxx", "warning")])
def test_a_log_of_less_than_half_of_the_targets_is_doubted(sampled: str, level: str) -> None:
    """Air moves, so that no cut is missed."""
    [found] = told(program(np.arange(10), tuple(range(5))), flags(sampled).astype(np.intp), np.zeros(10, dtype=bool), [])
    empty = sampled.count(".")
    assert (found.code, found.level, found.file, found.message) == (
        "CS3011", level, "log.csv", f"{empty} of 10 targets got no sample: left where planned")
    assert found.hint == ("is it the log of this program?" if level == "warning" else "")


@pytest.mark.parametrize(("sampled", "level", "listed"), [
    ("xx.x.x.xxx", "note", "3 targets*: 2, 4, 6"), ("x.x.x.x..x", "note", "5 targets*: 1, 3, 5, 7 to 8"),
    ("x.x.x..x..", "warning", "6 targets*: 1, 3, 5 to 6, 8 to 9")])
def test_what_is_taken_between_is_listed_and_is_a_warning_where_it_is_most_of_the_log(
    sampled: str, level: str, listed: str
) -> None:
    samples = flags(sampled).astype(np.intp)
    between = np.flatnonzero(samples == 0)
    [found] = told(program(np.arange(10)), samples, np.ones(10, dtype=bool), between.tolist())
    assert (found.code, found.level, found.file, found.line, found.target) == (
        "CS3014", level, "m.mod", 10 + between[0], between[0])
    assert found.message == listed.replace("*", " of the cut without a sample take what lies between the forces on either side")


def test_one_that_takes_what_lies_between_takes_it() -> None:
    samples = flags("xx.xx").astype(np.intp)
    [found] = told(program(np.arange(5)), samples, np.ones(5, dtype=bool), [2])
    assert found.message == "1 target of the cut without a sample takes what lies between the forces on either side: 2"


@pytest.mark.parametrize(("forced", "predicted", "said"), [
    ("xx.....", False, True), ("x......", False, False), ("xx.....", True, False)])
def test_a_cut_that_is_missed_is_told_where_half_of_what_is_logged_at_its_feed_has_a_force(
    forced: str, predicted: bool, said: bool
) -> None:
    """Four targets at the cutting feed that the log has; two it has not, behind an air move, in lines 15 and 16."""
    found = told(program(np.arange(7), air=(4,)), flags("xxxxx..").astype(np.intp), flags(forced), [], predicted)
    assert [(one.code, one.level, one.message) for one in found] == [("CS3011", "warning" if said else "note", (
        "2 of 7 targets got no sample: left where planned" + (
            ", 2 of them reached at the cutting feed, from line 15 on" if said else "")))]


def test_targets_that_stood_still_are_listed() -> None:
    path = program(np.arange(30))
    [one] = said_of_held(np.array([7]), path)
    assert (one.code, one.level, one.file, one.line, one.target) == ("CS3070", "warning", "m.mod", 17, 7)
    assert one.message == "1 target left where planned, since the log stood still there: 7"
    [many] = said_of_held(np.array([1, 3, 4, 5, 7, 9, 11, 13, 15, 16]), path)
    assert many.message.endswith(": 1, 3 to 5, 7, 9, 11, 13 and 1 more")
    assert said_of_held(np.empty(0, dtype=np.intp), path) == []

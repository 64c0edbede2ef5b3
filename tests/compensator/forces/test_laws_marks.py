"""A log placed by its marks: when the level changes, where that is on the path, and which ways switch so."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from compensator.forces.log import ForceLog, read_force_log
from compensator.forces.marks import _changes, has_marks, placed_by_marks
from compensator.path.robot_path import RobotPath
from identification.common.findings import CompstiffError
from identification.model.cell_file import ForceLogFile
from tests.compensator.forces.test_contract_placement import log_text, plan

FORM = ForceLogFile()


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> RobotPath:
    """21 targets 10 mm apart, to be driven at 100 mm/s."""
    return plan(tmp_path_factory.mktemp("plan"), count=21)


def logged(folder: Path, level: np.ndarray, header: str = "time_s", step: float = 0.01, begins: float = 5.0) -> ForceLog:
    """A log of so many samples from 5 s on."""
    rows = np.column_stack([begins + step * np.arange(len(level)), np.tile([1.0, 2, 3], (len(level), 1)), level])
    (folder / "log.csv").write_text(log_text(f"{header},fx_n,fy_n,fz_n,mark", rows))
    return read_force_log(folder / "log.csv")


def levels(*counts: int, low: float = 0.0, high: float = 1.0) -> np.ndarray:
    """Low for so many samples, then high, then low ..."""
    return np.concatenate([np.full(count, (low, high)[k % 2]) for k, count in enumerate(counts)])


@pytest.mark.parametrize(("header", "step", "form"), [
    ("time_s", 0.01, FORM), ("time_ms", 10.0, FORM), ("number", 1.0, ForceLogFile(rate_hz=100))])
def test_a_level_changes_half_way_between_two_samples(tmp_path: Path, header: str, step: float, form: ForceLogFile) -> None:
    """By the log's own clock in seconds or milliseconds, or by its rate from its first sample on."""
    begins = {"time_s": 5.0, "time_ms": 5000.0, "number": 0.0}[header]
    file = tmp_path / "log.csv"
    level = levels(30, 20, 40, 10, low=-24.0, high=24.0)
    file.write_text(log_text(f"{header},mark", np.column_stack([begins + step * np.arange(100), level])))
    time, up = _changes(file, form)
    np.testing.assert_allclose(time, (0.0 if header == "number" else 5.0) + np.array([0.295, 0.495, 0.895]))
    assert up.tolist() == [True, False, True]


@pytest.mark.parametrize("time", ["time_ms", ""])
def test_of_a_log_in_batches_the_marks_are_those_of_all_of_it(tmp_path: Path, time: str) -> None:
    """Of some 130 000 samples each: some are high throughout, the last is low. Without a clock it begins at zero."""
    file, level = tmp_path / "log.parquet", levels(30, 300_000, 240_000, low=3.0, high=5.0)
    columns = {"fx_n": level, "mark": level} | ({time: 100.0 + 4 * np.arange(len(level))} if time else {})
    pq.write_table(pa.table(columns), file)
    changed, up = _changes(file, ForceLogFile(rate_hz=250))
    np.testing.assert_allclose(changed, (0.1 if time else 0.0) + 0.004 * np.array([29.5, 300_029.5]))
    assert up.tolist() == [True, False]
    log = cast(ForceLog, SimpleNamespace(source=str(file)))
    assert has_marks(log, FORM)
    pq.write_table(pa.table({"fx_n": np.ones(9)}), file)
    assert not has_marks(log, FORM)


@pytest.mark.parametrize(("between", "seen"), [(0.29, "low"), (0.31, "no"), (0.5, "no"), (0.69, "no"), (0.71, "high")])
def test_what_lies_between_three_and_seven_tenths_is_no_level(tmp_path: Path, between: float, seen: str) -> None:
    """Ten samples there between low and high ones: the change is behind them, before them, or in the middle of them."""
    level = np.concatenate([levels(30, 0), np.full(10, 2 + 4 * between), levels(0, 30)])
    level[:30], level[40:] = 2.0, 6.0
    logged(tmp_path, level)
    time, up = _changes(tmp_path / "log.csv", FORM)
    assert time == pytest.approx([5.0 + 0.01 * {"low": 39.5, "no": 34.5, "high": 29.5}[seen]])
    assert up.tolist() == [True]


def test_a_level_that_never_changes_has_no_edge(tmp_path: Path) -> None:
    logged(tmp_path, np.full(20, 7.0))
    time, up = _changes(tmp_path / "log.csv", FORM)
    assert (len(time), len(up)) == (0, 0)


def test_samples_lie_at_steady_feed_between_two_marks(path: RobotPath, tmp_path: Path) -> None:
    """40 mm in 1 s, then 60 mm in 2 s; what is before the first and behind the last has no place. A fall before the first rise
    is the end of what an earlier run left high."""
    level = levels(0, 20, 30, 100, 200, 25)
    log = placed_by_marks(logged(tmp_path, level), FORM, path, [(None, np.array([3, 7, 13]))])
    time = 5.0 + 0.01 * np.arange(375)
    expected = np.where(time < 6.495, 30 + 40 * (time - 5.495), 70 + 30 * (time - 6.495))
    expected[(time < 5.495) | (time > 8.495)] = np.nan
    np.testing.assert_allclose(1e3 * log.place, expected, atol=1e-9)
    assert (log.key, log.on_path) == ("path_mm", True)
    [note] = [one for one in log.findings if one.code == "CS3090"]
    assert (note.level, note.message) == ("note", "placed by the 3 edges of mark, at targets 3 to 13, at steady feed between "
                                                  "them; 75 rows before the first and behind the last left out")


def test_marks_and_places_go_by_one_clock_behind_packets_that_were_lost(path: RobotPath, tmp_path: Path) -> None:
    """Half a second of a log is lost in its second stretch: by its counter and its rate as by its times."""
    level, kept = levels(20, 100, 200, 55), np.concatenate([np.arange(180), np.arange(230, 375)])
    rows = np.column_stack([np.tile([1.0, 2, 3], (len(kept), 1)), level[kept]])
    placed = []
    for header, column, form in (("time_s", 0.01 * kept, FORM), ("sequence", 7 + kept, ForceLogFile(rate_hz=100))):
        (tmp_path / "log.csv").write_text(log_text(f"{header},fx_n,fy_n,fz_n,mark", np.column_stack([column, rows])))
        log = read_force_log(tmp_path / "log.csv", form)
        placed.append(placed_by_marks(log, form, path, [(None, np.array([3, 7, 13]))]).place)
    np.testing.assert_allclose(placed[1], placed[0], rtol=0, atol=1e-9)


@pytest.mark.parametrize(("share", "told"), [(1.48, False), (1.52, True)])
def test_what_is_driven_faster_than_one_and_a_half_times_its_feed_is_refused(
    path: RobotPath, tmp_path: Path, share: float, told: bool
) -> None:
    """The second of three stretches, 80 mm at 100 mm/s. The fastest is told."""
    slow, fast = 100, round(80 / share)
    log = logged(tmp_path, levels(20, slow, fast, slow, 20))
    ways: list[Any] = [(None, np.array([1, 4, 12, 17]))]
    if not told:
        assert np.nanmax(placed_by_marks(log, FORM, path, ways).place) == pytest.approx(0.17, abs=1e-3)
        return
    with pytest.raises(CompstiffError) as stopped:
        placed_by_marks(log, FORM, path, ways)
    [found] = stopped.value.findings
    assert (found.code, found.target) == ("CS3089", 4)
    assert found.message == (f"between the marks at targets 4 and 12 the log drives {80 / fast:.1f} times as fast as "
                             "programmed (100 mm/s)")


@pytest.mark.parametrize(("moves", "feed", "told"), [
    ([], 0.0, True), ([2], 0.3, False), ([5], 0.3, False), ([1, 6], 0.3, True), ([2, 3, 4, 5], 0.0, False),
    ([3], np.nan, False)])
def test_the_fastest_move_between_two_marks_counts(
    path: RobotPath, tmp_path: Path, moves: list[int], feed: float, told: bool
) -> None:
    """40 mm at 100 mm/s, of moves at 60: those behind the first mark to that to the second. Where nobody knows a feed it is
    open how fast it was."""
    feeds = np.full(21, 0.06)
    feeds[moves] = feed
    here = cast(RobotPath, SimpleNamespace(length=path.length, toolpath=SimpleNamespace(feed=feeds)))
    log, ways = logged(tmp_path, levels(20, 40, 20)), [(None, np.array([1, 5]))]
    if told:
        with pytest.raises(CompstiffError, match="1.7 times as fast as programmed"):
            placed_by_marks(log, FORM, here, ways)
    else:
        assert np.isfinite(placed_by_marks(log, FORM, here, ways).place).sum() == 40


def test_marks_are_those_of_the_targets_in_the_order_in_which_they_are_driven(path: RobotPath, tmp_path: Path) -> None:
    """The second half of the text first: its second target and its fifth switch, 30 mm apart."""
    log, order = logged(tmp_path, levels(20, 60, 20)), np.roll(np.arange(21), -10)
    placed = placed_by_marks(log, FORM, path, [(order, np.array([1, 4]))])
    expected = np.sort(110 + 30 * (np.arange(60) + 0.5) / 60)
    np.testing.assert_allclose(1e3 * placed.place[np.isfinite(placed.place)], expected, atol=1e-9)
    assert "at targets 11 to 14" in next(one.message for one in placed.findings if one.code == "CS3090")
    assert "CS3122" in {one.code for one in placed.findings}
    with pytest.raises(CompstiffError) as stopped:
        placed_by_marks(log, FORM, path, [(order[:1], np.array([0, 0]))])
    assert stopped.value.findings[0].message.startswith("the routines run in another order than they stand in the text")


def test_ways_that_switch_at_other_targets_are_refused_and_at_the_same_told(path: RobotPath, tmp_path: Path) -> None:
    log = logged(tmp_path, levels(20, 100, 20))
    at = np.array([2, 6])
    with pytest.raises(CompstiffError) as stopped:
        placed_by_marks(log, FORM, path, [(None, at), (None, np.array([2, 7]))])
    [found] = stopped.value.findings
    assert (found.code, found.message) == (
        "CS3123", "the column mark has 2 edges, and so many has the program by several of its branches")
    other: list[Any] = [(None, np.array([2, 6, 7])), (None, at), (np.arange(21), at)]
    placed = placed_by_marks(log, FORM, path, other)
    assert [one.level for one in placed.findings if one.code == "CS3123"] == ["warning"]
    assert not [one for one in placed_by_marks(log, FORM, path, other[:2]).findings if one.code == "CS3123"]


TURNED = ("; it begins high, and counted from its first fall it has as many: is the wire active low, high while the output is "
          "off?")


@pytest.mark.parametrize(("level", "switches", "said"), [
    (levels(20, 100, 20), [[2], [2, 6, 7], [1, 3, 4]], "has 2 edges, the program switches its output at 1 or 3 targets"),
    (levels(0, 20, 100, 20, 30), [[2, 4, 6]], "has 2 edges, the program switches its output at 3 targets" + TURNED),
    (levels(0, 20, 100, 20, 30), [[2, 4, 6], [2]], "has 2 edges, the program switches its output at 1 or 3 targets" + TURNED),
    (levels(0, 20, 100, 20, 30), [[2, 4, 6, 7]], "has 2 edges, the program switches its output at 4 targets"),
    (levels(0, 20, 100), [[3]], "has 0 edges, the program switches its output at 1 target" + TURNED),
    (levels(140), [[3, 4]], "has one value from its first row to its last, the program switches its output at 2 targets")])
def test_another_number_of_edges_is_refused(
    path: RobotPath, tmp_path: Path, level: np.ndarray, switches: list[list[int]], said: str
) -> None:
    with pytest.raises(CompstiffError) as stopped:
        placed_by_marks(logged(tmp_path, level), FORM, path, [(None, np.array(at)) for at in switches])
    [found] = stopped.value.findings
    assert (found.code, found.message) == ("CS3088", f"the column mark {said}")
    assert ("turn the column mark over" in found.hint) == ("active low" in said)
    assert ("wired" in found.hint) == ("one value" in said)

"""A log that names the nearest target stands where the tool was when its samples were taken."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from compensator.forces.half_ways import _taken_evenly
from compensator.forces.log import ForceLog, read_force_log
from compensator.forces.log_path import on_path
from compensator.path.robot_path import RobotPath, robot_path
from compensator.rapid import read_rapid
from identification.model.cell import read_cell
from tests.compensator.forces.test_contract_placement import CELL, QUATERNION

# Places of the targets [mm] along x, and the feed of the move to each [mm/s].
PLACES = np.array([0.0, 30.0, 34.0, 42.0, 46.0, 50.0, 58.0, 60.0, 90.0])
EAX = "[9E9,9E9,9E9,9E9,9E9,9E9]"
FEEDS = np.array([100.0, 100.0, 20.0, 20.0, 10.0, 20.0, 20.0, 20.0, 100.0])


def program(folder: Path, places: np.ndarray = PLACES, feeds: np.ndarray = FEEDS) -> RobotPath:
    moves = "\n".join(
        f"Move{'L' if i else 'J'} [[{1000 + x},0,700],[{','.join(map(str, QUATERNION))}],[-1,-1,-1,0],{EAX}],"
        f"[{v},500,5000,1000],z0,tSpindle;" for i, (x, v) in enumerate(zip(places, feeds, strict=True)))
    (folder / "cell.yaml").write_text(CELL)
    return robot_path(read_rapid(f"MODULE M\nPROC main()\n{moves}\nENDPROC\nENDMODULE\n".encode(), "m.mod").toolpath,
                      read_cell(folder / "cell.yaml"))


def driven(
    rate: float, waits: dict[int, float], override: float = 1.0, places: np.ndarray = PLACES, feeds: np.ndarray = FEEDS,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Times, places [mm] and nearest targets of the samples of a tool that goes as programmed, times an override, and waits [s]
    at targets."""
    when, where, now = [0.0], [0.0], 0.0
    for number, (step, feed) in enumerate(zip(np.diff(places), feeds[1:], strict=True), start=1):
        now += step / (feed * override)
        when.append(now)
        where.append(places[number])
        if number in waits:
            now += waits[number]
            when.append(now)
            where.append(places[number])
    time = np.arange(0.0, now, 1 / rate)
    place = np.interp(time, when, where)
    return time, place, np.argmin(np.abs(place[:, None] - places), axis=1)


def placed(
    folder: Path, time: np.ndarray, number: np.ndarray, *, with_time: bool = True, places: np.ndarray = PLACES,
    feeds: np.ndarray = FEEDS,
) -> ForceLog:
    rows = [f"{t:.4f},{k},1,0,0" if with_time else f"{k},1,0,0" for t, k in zip(time, number, strict=True)]
    (folder / "forces.csv").write_text("\n".join([f"{'time_s,' * with_time}target,fx_n,fy_n,fz_n", *rows]) + "\n")
    return on_path(read_force_log(folder / "forces.csv"), program(folder, places, feeds))


@pytest.mark.parametrize("waits", [{}, {3: 0.6, 6: 2.0}])
@pytest.mark.parametrize("override", [1.0, 0.7])
def test_the_samples_stand_where_the_tool_was(tmp_path: Path, waits: dict[int, float], override: float) -> None:
    """Within the way of two samples, where feeds differ from move to move, and where the robot waits at targets."""
    time, place, number = driven(100.0, waits, override)
    log = placed(tmp_path, time, number)
    assert log.key == "path_mm"
    assert "CS3040" in {finding.code for finding in log.findings}
    cuts = (place > 32) & (place < 59)
    off = np.abs(1e3 * log.place - place)[cuts]
    assert off.max() < 2 * 20 * override / 100
    # The middle of what the targets alone would have said is a millimetre off.
    assert np.median(np.abs(PLACES[number] - place)[cuts]) > 0.5 or waits


def test_a_program_that_begins_and_ends_in_the_cut_is_placed_from_end_to_end(tmp_path: Path) -> None:
    """Half a way at either end, as far as its targets."""
    places, feeds = np.array([0.0, 10.0, 16.0, 30.0, 40.0]), np.array([100.0, 20.0, 20.0, 20.0, 20.0])
    time, place, number = driven(100.0, {}, 1.0, places, feeds)
    log = placed(tmp_path, time, number, places=places, feeds=feeds)
    assert log.key == "path_mm"
    assert np.abs(1e3 * log.place - place).max() < 2 * 20 / 100
    assert 1e3 * log.place[[0, -1]] == pytest.approx([0, 40], abs=0.2)


@pytest.mark.parametrize(("rows", "key"), [(8, "path_mm"), (7, "target")])
def test_eight_rows_of_the_middling_target_tell_what_lies_between(tmp_path: Path, rows: int, key: str) -> None:
    """Targets 10 mm apart at 20 mm/s: half a second each, a quarter at the ends."""
    places, feeds = np.arange(0.0, 60, 10), np.array([100.0, *[20.0] * 5])
    time, _, number = driven(2.0 * rows, {}, 1.0, places, feeds)
    assert np.median(np.bincount(number)) == rows
    assert placed(tmp_path, time, number, places=places, feeds=feeds).key == key


def test_a_log_that_tells_nothing_between_names_its_targets(tmp_path: Path) -> None:
    """One without time whose targets have nearly as many samples each, one of few samples, and one that goes back."""
    time, _, number = driven(100.0, {})
    assert placed(tmp_path, time, number, with_time=False).key == "target"
    few, _, of_few = driven(12.0, {})
    assert placed(tmp_path, few, of_few).key == "target"
    assert placed(tmp_path, np.arange(2 * len(time)) / 100, np.append(number, number)).key == "target"


# Slots of other lengths, and at other feeds.
FAR = np.array([0.0, 30.0, 34.0, 94.0, 98.0, 128.0, 132.0, 252.0, 256.0, 271.0, 301.0])
SLOW = np.array([100.0, 100.0, 20.0, 10.0, 20.0, 20.0, 20.0, 20.0, 20.0, 20.0, 100.0])


@pytest.mark.parametrize(("waits", "override"), [({}, 1.0), ({}, 0.6), ({2: 3.0}, 1.0)])
def test_rows_without_time_stand_where_the_tool_was_if_their_numbers_show_that_they_are_even(
    tmp_path: Path, waits: dict[int, float], override: float
) -> None:
    """There are as many of a target as its half ways take, but where the robot waits. It is said."""
    time, place, number = driven(100.0, waits, override, FAR, SLOW)
    log = placed(tmp_path, time, number, with_time=False, places=FAR, feeds=SLOW)
    assert log.time is None
    [said] = [finding.message for finding in log.findings if finding.code == "CS3040"]
    assert "no time is needed" in said
    cuts = (place > 32) & (place < 262)
    assert np.abs(1e3 * log.place - place)[cuts].max() < 2 * 20 * override / 100


def test_rows_that_may_not_be_even_name_their_targets(tmp_path: Path) -> None:
    """As many of each target, whatever it takes; twice as many of half of the targets."""
    _, _, number = driven(100.0, {}, places=FAR, feeds=SLOW)
    every = np.repeat(np.arange(len(FAR)), 60)
    some = np.repeat(number, np.where(number % 4 < 2, 2, 1))
    for rows in (every, some):
        assert placed(tmp_path, rows, rows, with_time=False, places=FAR, feeds=SLOW).key == "target"


@pytest.mark.parametrize(("samples", "takes", "even"), [
    ([100, 200, 400], [1, 2, 4], True), ([80, 200, 480], [1, 2, 4], True), ([9, 21, 39], [1, 2, 4], True),
    ([100, 200], [1, 2], False),                    # two may be so by chance
    ([100, 200, 400], [1, 2, 5.5], False), ([100, 200, 400, 800], [1, 2, 4, 11], True),
    ([100, 115, 85, 300], [1, 1.15, 0.85, 3], False), ([100, 100, 100], [1, 1, 1], False)])
def test_how_many_samples_show_that_they_are_even(samples: list[float], takes: list[float], even: bool) -> None:
    """Three quarters of the targets have as many as their half ways take, to a fifth; where most have the same
    number nothing shows whether a logger takes so many a target."""
    assert _taken_evenly(np.array(samples, dtype=float), np.array(takes)) is even

"""Moves in the air: how far the zero has drifted by what they show, and when their forces are told."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from compensator.forces.in_air import drifted, said_of_air
from compensator.forces.target_rows import TargetRows

COUNT = 12
IN_AIR = (0, 1, 2, 9, 10, 11)       # 2 has a cut behind it: its stretch reaches into that


def program(air: tuple[int, ...] = IN_AIR) -> Any:
    feed = np.where(np.isin(np.arange(COUNT), air), 0.2, 0.02)
    toolpath = type("Toolpath", (SimpleNamespace,), {"__len__": lambda self: COUNT})
    return SimpleNamespace(toolpath=toolpath(feed=feed, by_joints=np.zeros(COUNT, dtype=bool)))


def drift(air: list[float], *, largest: float = 200.0, noise: float = 0.0, samples: list[int] | None = None, tare: bool = True,
          other: float = 0.0) -> float:
    """Forces along x at the targets 0, 1, 9, 10, 11, along z at 2; a cut at 4 to 7."""
    mean = np.zeros((COUNT, 6))
    mean[[0, 1, 9, 10, 11], 0], mean[2, 2], mean[4:8, 1] = air, other, largest
    forced = (np.arange(COUNT) >= 4) & (np.arange(COUNT) < 8)
    each = samples or [10] * COUNT
    rows = TargetRows(COUNT, np.repeat(np.arange(COUNT), each), np.ones(sum(each)))
    zero: Any = SimpleNamespace(bias=np.zeros(6) if tare else None, noise=np.full(6, noise))
    return drifted(mean, program(), rows, zero, forced)


def test_the_zero_drifts_evenly_between_the_moves_that_show_it() -> None:
    """From 1 to 3 N over the cut and what lies beside it: per axis the root of a third of the mean square."""
    between = 1 + 2 * np.arange(8) / 8
    expected = np.sqrt(np.mean(np.square([1, *between, 3, 3, 3])) / 3)
    assert drift([1, 1, 3, 3, 3]) == pytest.approx(expected, rel=1e-12)
    # What the last air move before the cut shows may be of the cut.
    assert drift([1, 1, 3, 3, 3], other=50.0) == pytest.approx(expected, rel=1e-12)
    assert drift([1, 1, 3, 3, 3], tare=False) == 0.0
    zero: Any = SimpleNamespace(bias=np.zeros(6), noise=None)
    rows = TargetRows(COUNT, np.arange(COUNT), np.ones(COUNT))
    assert drifted(np.ones((COUNT, 6)), program(), rows, zero, np.ones(COUNT, dtype=bool)) == 0.0
    zero = SimpleNamespace(bias=np.zeros(6), noise=np.zeros(6))
    assert drifted(np.ones((COUNT, 6)), program((0,)), rows, zero, np.ones(COUNT, dtype=bool)) == 0.0


def test_samples_are_the_time_in_which_it_drifts() -> None:
    """Of so many each: the time at the end of each target, and its weight. A target without a sample shows nothing."""
    samples = [10, 30, 20, 20, 40, 40, 10, 10, 20, 0, 20, 10]
    time = np.cumsum(samples)
    at = [1.0, 2.0, *(2 + 2 * (time[2:9] - 40) / (time[10] - 40)), 0.0, 4.0, 1.0]
    expected = np.sqrt(np.dot(samples, np.square(at)) / sum(samples) / 3)
    assert drift([1, 2, 3, 4, 1], samples=samples) == pytest.approx(expected, rel=1e-9)


def test_the_noise_of_a_mean_is_no_drift() -> None:
    """2 N of each axis of a sample, in ten: 1.2 N^2 of the mean's square; of less nothing is left."""
    assert drift([2, 2, 2, 2, 2], noise=2.0) == pytest.approx(np.sqrt((4 - 1.2) / 3))
    assert drift([1, 1, 1, 1, 1], noise=2.0) == 0.0


@pytest.mark.parametrize(("middle", "largest", "is_drift"), [
    (4.9, 200.0, True), (5.1, 200.0, False), (2.9, 60.0, True), (3.1, 60.0, False)])
def test_a_drift_is_under_five_newtons_and_a_twentieth_of_the_largest_force_in_the_middle(
    middle: float, largest: float, is_drift: bool
) -> None:
    found = drift([1, 1, middle, middle, middle], largest=largest)
    assert (found > 0) == is_drift


@pytest.mark.parametrize(("touch", "counts"), [(9.9, True), (10.1, False), (80.0, False)])
def test_twice_as_much_is_a_touch(touch: float, counts: bool) -> None:
    """The others show 2 N; it is then asked no more."""
    found = drift([2, 2, 2, touch, 2])
    at = np.interp(np.arange(COUNT), [0, 1, 9, 10, 11], [2, 2, 2, touch if counts else 2, 2])
    assert found == pytest.approx(np.sqrt(np.mean(at**2) / 3), rel=1e-9)


def said(forced: tuple[int, ...], size: float, *, largest: float = 200.0, tare: bool = False, air: tuple[int, ...] = IN_AIR,
         empty: tuple[int, ...] = ()) -> list[Any]:
    """Such a force at these targets, and the largest one at target 5."""
    wrench = np.zeros((COUNT, 6))
    wrench[list(forced), 0], wrench[5, 1] = size, largest
    log: Any = SimpleNamespace(source="log.csv")
    forces: Any = SimpleNamespace(wrench=wrench, forced=np.isin(np.arange(COUNT), (*forced, 5)),
                                  tare=np.zeros(6) if tare else None,
                                  samples=np.where(np.isin(np.arange(COUNT), empty), 0, 9))
    return said_of_air(log, program(air), forces)


@pytest.mark.parametrize(("forced", "empty", "words"), [
    ((0, 1, 9), (), "3 of 5 moves at the air feed show a force, 30.0 N in the middle, and are moved"), ((0, 1), (), ""),
    # Target 2 reaches into the cut; one without a sample is not asked.
    ((0, 1, 2), (), ""), ((0, 1, 9), (11,), "3 of 4 moves"), ((0, 9), (10, 11), "2 of 3 moves"), ((0, 9), (11,), ""),
    ((1,), (0, 10, 11, 9), "1 of 1 move at the air feed shows a force, 30.0 N in the middle, and is moved")])
def test_forces_at_over_half_of_the_moves_in_the_air_are_told(
    forced: tuple[int, ...], empty: tuple[int, ...], words: str
) -> None:
    found = said(forced, 30.0, empty=empty)
    assert [(one.code, one.level, one.file, one.target) for one in found] == (
        [("CS3041", "warning", "log.csv", forced[0])] if words else [])
    assert all(one.message.startswith(words) for one in found)
    assert all(one.message.endswith("with the others: no bias was taken off") for one in found)
    assert all("--tare FIRST:LAST" in one.hint for one in found)


@pytest.mark.parametrize(("size", "largest", "level"), [
    (4.9, 200.0, "note"), (5.1, 200.0, "warning"), (2.9, 60.0, "note"), (3.1, 60.0, "warning")])
@pytest.mark.parametrize("tare", [False, True])
def test_a_force_in_the_air_that_drift_is_no_more_than_is_a_note(size: float, largest: float, level: str, tare: bool) -> None:
    [found] = said(IN_AIR, size, largest=largest, tare=tare)
    assert (found.code, found.level) == ("CS3041", level)
    assert found.message.endswith("the bias that was taken off is not theirs" if tare else "no bias was taken off")
    assert ("drift" in found.hint) == tare


@pytest.mark.parametrize(("all_forced", "tare", "told"), [(True, False, True), (False, False, False), (True, True, False)])
def test_at_one_feed_a_program_with_force_everywhere_shows_it_at_its_ends(all_forced: bool, tare: bool, told: bool) -> None:
    found = said(tuple(range(COUNT - (not all_forced))), 30.0, air=(), tare=tare)
    assert [(one.code, one.target) for one in found] == ([("CS3041", 0)] if told else [])
    assert all(one.message.startswith("2 of 2 moves to the first and the last target show a force, 30.0 N in") for one in found)

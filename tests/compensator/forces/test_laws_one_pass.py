"""Samples off the path, and the noise of a tare."""

from __future__ import annotations

from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

from compensator.forces.log import ForceLog
from compensator.forces.one_pass import check_once, said_of_lost, targets_of
from compensator.forces.target_rows import TargetRows
from compensator.forces.zero import _air
from compensator.path.robot_path import RobotPath
from compensator.toolpath import OtherFiles
from identification.common.findings import CompstiffError


def log_of(place: list[float], key: str = "length") -> ForceLog:
    count = len(place)
    return cast(ForceLog, SimpleNamespace(key=key, place=np.array(place), weight=np.ones(count),
                                          line=np.arange(2, count + 2), source="log.csv", sent=False, spread=None))


def test_rows_before_and_behind_the_path_belong_to_no_target() -> None:
    """The others to the nearest by its length."""
    path = cast(RobotPath, SimpleNamespace(length=np.array([0.0, 0.1, 0.3])))
    target = targets_of(log_of([-0.2, 0.0, 0.04, 0.06, 0.19, 0.21, 0.3, 0.5]), path)
    np.testing.assert_array_equal(target, [-1, 0, 0, 1, 1, 2, 2, -1])


def test_what_is_off_the_path_is_said_and_what_is_not_is_not() -> None:
    log = log_of([0.0] * 200)
    on = np.ones(200, dtype=bool)
    assert said_of_lost(log, on) == []
    on[7] = False
    (finding,) = said_of_lost(log, on)
    assert (finding.code, finding.level, finding.line) == ("CS3007", "note", 9)
    assert finding.message.startswith("1 of 200 samples")
    on[8:10] = False
    assert said_of_lost(log, on)[0].level == "warning"
    on[:190] = False
    with pytest.raises(CompstiffError, match="only 10 of the 200"):
        said_of_lost(log, on)


@pytest.mark.parametrize(("called", "more", "said"), [
    (("rTool (line 7)",), 0.012, True), (("rTool (line 7)",), 0.0009, False), ((), 0.012, False)])
def test_a_log_that_is_a_little_longer_is_asked_about_the_routines_that_no_file_holds(
    called: tuple[str, ...], more: float, said: bool
) -> None:
    """By 12 mm of 2 m: what drove that stands somewhere in the program, and all forces behind it are off by as much."""
    log = log_of([*np.linspace(0.0, 2.0, 400), 2.0 + more], "path_mm")
    (finding,) = said_of_lost(log, log.place <= 2.0, OtherFiles(called=called))
    assert (finding.level == "warning") == said
    assert ("rTool (line 7)" in finding.hint) == said


@pytest.mark.parametrize("offset", [0.0, 500.0])
@pytest.mark.parametrize("count", [6, 3000])
def test_the_noise_of_a_tare_is_that_of_its_samples(count: int, offset: float) -> None:
    """White noise of 2 N, in a few samples (one batch: their scatter) and many (batches), whatever the sensor's zero."""
    noise = []
    for seed in range(40 if count < 100 else 8):
        rng = np.random.default_rng(seed)
        loads = offset + 2.0 * rng.standard_normal((count, 6))
        rows = SimpleNamespace(between=lambda first, last: np.arange(count), weight=np.ones(count),
                               target=np.zeros(count, dtype=int))
        air = _air(log_of([0.0]), loads, cast(TargetRows, rows), np.zeros((1, 3)), [(0, 0)],
                   np.zeros(1, dtype=bool))
        noise.append(air.noise)
        assert air.samples == count
    # 240 x 5 and 48 x 31 degrees of freedom: within 2 % and 2 %, one sigma.
    assert np.sqrt(np.mean(np.square(noise))) == pytest.approx(2.0, rel=0.08)


@pytest.mark.parametrize(("again", "refused"), [(0, False), (1, False), (10, False), (11, True), (60, True)])
def test_a_log_that_comes_back_to_a_tenth_is_of_one_pass(again: int, refused: bool) -> None:
    """Of 100 targets in turn, and then some of the first of them again."""
    place = np.append(np.arange(100), np.arange(again))
    log = log_of(place.tolist(), "target")
    if not refused:
        check_once(log, place, None)
        return
    with pytest.raises(CompstiffError, match=f"comes back to {again} targets that it had left, from target 99 to 0") as stopped:
        check_once(log, place, None)
    assert (stopped.value.findings[0].code, stopped.value.findings[0].line) == ("CS3119", 102)


@pytest.mark.parametrize(("moved", "level"), [(0, ""), (2, "warning"), (40, "error")])
def test_numbers_that_rise_where_the_program_drives_otherwise_are_those_of_no_text(moved: int, level: str) -> None:
    """The last targets of the text are driven first: a logger that counts as the tool goes numbers them 0, 1, ..."""
    driven = np.roll(np.arange(100), moved)
    numbers = np.repeat(np.arange(100), 3)
    assert check_once(log_of(np.repeat(driven, 3).tolist(), "target"), np.repeat(driven, 3), driven) == []
    try:
        said = check_once(log_of(numbers.tolist(), "target"), numbers, driven)
    except CompstiffError as stopped:
        said = list(stopped.findings)
    assert [(one.code, one.level) for one in said] == ([("CS3119", level)] if level else [])
    assert all(f"drives target {100 - moved} before {99 - moved}" in one.message for one in said)


@pytest.mark.parametrize(("length", "said"), [(1.0, False), (1.01, False), (3.0, True)])
def test_a_log_by_path_length_that_goes_on_is_told_what_to_do(length: float, said: bool) -> None:
    place = np.linspace(0.0, length, 200)
    log = log_of(place.tolist(), "path_mm")
    hints = [finding.hint for finding in said_of_lost(log, place <= 1.0)]
    assert any("one pass" in hint for hint in hints) == said

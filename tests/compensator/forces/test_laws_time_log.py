"""A log with time alone: what is refused, and what is said of where it was placed; each limit from both sides."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from compensator.forces.alignment_regression import binned
from compensator.forces.alignment_search import promise
from compensator.forces.program_time import ProgramTime, program_time
from compensator.forces.time_alignment import TimeAlignment
from compensator.forces.time_log import _check_times, _not_believed, _odd_stretch, place_by_time, promise_by_time
from identification.common.findings import CompstiffError
from tests.compensator.path.test_laws_timing import lines, program

GOOD: dict[str, Any] = {
    "length": np.zeros(1), "start": 0.0, "override": 1.0, "slip": 0.0, "score": 40.0, "share": 0.9, "rival": 5.0, "odd": (),
    "plateau": 0.1, "in_air": 0.05, "std": np.zeros(1), "spread": np.zeros(1), "spread_on_cuts": 3e-3}


@pytest.mark.parametrize(("within", "beyond", "words"), [
    ({"share": 0.501, "plateau": 0.0}, {"share": 0.499}, "50 % of the force follows the program, at least 50 % must"),
    ({"plateau": 0.799}, {"plateau": 0.801}, "the force follows the program hardly better (90 %) than a single stretch of "
     "steady force does (80 %), as in the log of any job"),
    ({"score": 15.01}, {"score": 14.99}, "its score is 15.0 against the best other place 5.0 s away, at least 15 is needed"),
    ({"score": 1e9}, {"score": np.inf}, "there is no other place to compare with, so nothing shows that this one is right"),
    ({"override": 0.401}, {"override": 0.399}, "the override would be 40 %, looked for are 40 to 150 %"),
    ({"override": 1.499}, {"override": 1.501}, "the override would be 150 %, looked for are 40 to 150 %"),
    ({"in_air": 0.249}, {"in_air": 0.251}, "the force on air moves would be 25 % of that on cuts, at most 25 % may be"),
    ({"spread_on_cuts": 9.9e-3}, {"spread_on_cuts": 10.1e-3}, "1 sigma of the place would be 10 mm, at most 10 mm may be"),
    ({"covered": 0.551}, {"covered": 0.549}, "it would be 55 % of the program alone, at least 55 % are needed"),
    ({"odd": ((1.0, 2.0),)}, {"odd": ((1.0, 2.0), (3.0, 4.0))}, "in 2 stretches the force does not follow the program, at "
     "most 1 may be so"),
    ({}, {"leaps": ((7.4, -2.0), (20.0, 3.14), (31.0, -0.5), (40.0, 9.0))}, "the log does not keep pace with the program, as "
     "where it stood still: 2.0 s lost at 7 s of the program, 3.1 s gained at 20 s of the program, 0.5 s lost at 31 s of the "
     "program"),
])
def test_an_alignment_is_believed_against_which_nothing_speaks(within: dict, beyond: dict, words: str) -> None:
    good, bad = TimeAlignment(**{**GOOD, **within}), TimeAlignment(**{**GOOD, **beyond})
    assert (good.believed, good.against) == (True, ())
    assert (bad.believed, bad.against) == (False, (words,))


def test_a_share_is_told_beyond_what_a_plateau_explains() -> None:
    """Of the half that a plateau leaves the program explains four fifths; where it leaves nothing, nothing."""
    assert TimeAlignment(**{**GOOD, "share": 0.9, "plateau": 0.5}).beyond_plateau == pytest.approx(0.8)
    assert TimeAlignment(**{**GOOD, "share": 1.0, "plateau": 1.0}).beyond_plateau == 1.0


def log_of(time: np.ndarray, force: np.ndarray | None = None) -> Any:
    force = np.arange(3.0 * len(time)).reshape(-1, 3) if force is None else force
    return SimpleNamespace(place=time, force=force, line=np.arange(2, len(time) + 2), source="log.csv")


def refused(log: Any) -> tuple[str, str, int | None]:
    try:
        _check_times(log)
    except CompstiffError as stopped:
        [found] = stopped.findings
        return found.code, found.message, found.line
    return "", "", None


def test_times_that_say_nothing_are_refused() -> None:
    time = np.arange(100.0)
    assert refused(log_of(time)) == ("", "", None)
    assert refused(log_of(time[:99]))[:2] == (
        "CS3063", "99 samples are too few to place a log by time alone, at least 100 are needed")
    assert refused(log_of(time[:1]))[1].startswith("1 sample is too few")
    back = time.copy()
    back[40] = 38.5
    assert refused(log_of(back)) == ("CS3062", "time_s 38.5 stands before the one above it, 39", 42)
    back[40] = 39.0
    assert refused(log_of(back)) == ("", "", None)
    still = "the force never changes, or time does not: nothing says where the cut begins"
    assert refused(log_of(0 * time)) == ("CS3063", still, None)
    assert refused(log_of(time, np.tile([5.0, -3, 0], (100, 1)))) == ("CS3063", still, None)
    assert refused(log_of(np.maximum(time, 1.0))) == ("", "", None)
    one_axis = np.tile([5.0, -3, 0], (100, 1))
    one_axis[70, 1] = 2.0
    assert refused(log_of(time, one_axis)) == ("", "", None)


PROGRAM = ProgramTime(np.arange(10.0), np.arange(10.0), np.zeros(10, bool), np.zeros(10, int), np.zeros((10, 3)))


@pytest.mark.parametrize(("unit", "factor"), [("", 1.0), ("milliseconds", 1e3), ("minutes", 1 / 60)])
def test_a_clock_in_another_unit_is_asked_about_instead(unit: str, factor: float) -> None:
    """What else speaks against it is said of a log in seconds alone."""
    alignment = TimeAlignment(**{**GOOD, "share": 0.2})
    path: Any = SimpleNamespace(toolpath=SimpleNamespace(source="part.mod"))
    found = _not_believed(log_of(3.0 + np.array([0.0, 2.0, 9.2]) * factor), path, PROGRAM, alignment)
    if not unit:
        assert found.message.endswith(": 20 % of the force follows the program, at least 50 % must")
        assert found.hint.startswith("is it the log of part.mod, from before its start to after its end?")
    else:
        assert found.message == ("the log cannot be placed by time alone: it goes over "
                                 f"{9.2 * factor:.4g} s, the program takes 9")
        assert found.hint == f"is time_s in {unit}? It is in seconds"


@pytest.mark.parametrize(("stretch", "low", "high"), [((0.0, 2.5), 0, 3), ((3.0, 5.0), 3, 5), ((8.5, 12.0), 9, 9)])
def test_the_one_stretch_that_may_be_odd_is_named_by_its_targets(stretch: tuple[float, float], low: int, high: int) -> None:
    path: Any = SimpleNamespace(toolpath=SimpleNamespace(source="part.mod", line=np.arange(100, 110)))
    [found] = _odd_stretch(path, PROGRAM, TimeAlignment(**{**GOOD, "odd": (stretch,)}))
    assert (found.code, found.level, found.line, found.target) == ("CS3065", "warning", 100 + low, low)
    assert found.message.startswith(f"between targets {low} and {high} the force does not follow the program")
    assert _odd_stretch(path, PROGRAM, TimeAlignment(**GOOD)) == []


@pytest.mark.parametrize(("cuts", "bins"), [(5, 64), (30, 139), (140, 500)])
def test_a_quick_look_takes_four_bins_a_cut(tmp_path: Path, cuts: int, bins: int) -> None:
    """64 of them at least and 500 at most, over a log that is 1.16 times as long as the program; a program without a way has
    nothing to promise."""
    points = [[1000.0 + 2 * k, 0, 700] for k in range(2 * cuts + 1)]
    moves = [move.replace(",v10,", ",v300,") if k % 2 else move for k, move in enumerate(lines(points, "v10", "z0"))]
    path = program(tmp_path, moves)
    timed = program_time(path)
    assert len(timed.stretches) == cuts
    time = np.linspace(0, 1.16 * timed.duration, 4000)
    there = np.clip(np.searchsorted(timed.time, time - 0.08 * timed.duration), 0, 2 * cuts)
    force = np.where(timed.air[there], 0.0, 100.0)[:, None] * np.array([1.0, 0.5, -0.2])
    log = log_of(time + 50.0, force)
    assert promise_by_time(log, path) == pytest.approx(promise(timed, binned(time + 50.0, force, time[-1] / bins)))
    still = program(tmp_path, moves[:1])
    assert promise_by_time(log, still) == 0.0
    with pytest.raises(CompstiffError) as stopped:
        place_by_time(log, still)
    assert [(one.code, one.message, one.file) for one in stopped.value.findings] == [
        ("CS3063", "the program takes no time: it has no move of known length", "log.csv")]

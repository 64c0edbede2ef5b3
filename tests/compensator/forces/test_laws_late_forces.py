"""Which part of a log is asked whether its forces come late: from shortly before the first cut on, no more than is needed."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from compensator.forces.late_forces import _cuts_of, said_of_delay

# Air to 1 m of path, a cut to the end; 0.1 m/s, a sample every 10 ms.
PROGRAM: Any = SimpleNamespace(length=np.array([0.0, 1.0, 50.0]), air=np.array([True, True, False]))


def drive(seconds: float, force: float = 40.0, step: float = 0.01) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """time (M,) [s], force (M, 3) [N], place (M,) [m]."""
    time = np.arange(0, seconds, step)
    return time, np.full((len(time), 3), force), 0.1 * time


def test_half_a_second_before_the_first_cut_and_a_hundred_seconds_on() -> None:
    time, force, place = drive(300.0)
    bins = _cuts_of(time, force, place, PROGRAM)
    assert bins is not None
    # The bins' middles: 10 s after the start the tool is at 1 m.
    assert bins.time[0] == pytest.approx(10 - 0.5 + 0.01, abs=0.015)
    assert bins.time[-1] == pytest.approx(bins.time[0] + 100, abs=0.03)


@pytest.mark.parametrize(("seconds", "force", "enough"), [(11.9, 40.0, False), (12.1, 40.0, True), (12.1, 0.0, False)])
def test_two_seconds_of_a_cut_with_a_force_are_enough(seconds: float, force: float, enough: bool) -> None:
    """However long the air before them: a hundred bins of 20 ms, and such as have a sample."""
    assert (_cuts_of(*drive(seconds, force), PROGRAM) is not None) is enough
    assert _cuts_of(*drive(seconds, force, step=0.1), PROGRAM) is None


def test_what_lies_behind_the_last_target_is_its_move_s() -> None:
    time, force, place = drive(13.0)
    short: Any = SimpleNamespace(length=PROGRAM.length * [1, 1, 0.024], air=PROGRAM.air)
    found, all_of_it = _cuts_of(time, force, place, short), _cuts_of(time, force, place, PROGRAM)
    assert found is not None
    assert all_of_it is not None
    np.testing.assert_array_equal(found.weight, all_of_it.weight)


@pytest.mark.parametrize("other", [{"key": "target"}, {"time": None}, {"spread": np.ones(3)}, {"predicted": np.ones(3)}])
def test_only_measured_forces_by_length_and_with_time_are_asked(other: dict[str, Any]) -> None:
    """Forces that were predicted, or means of several logs, have no clock: nothing of them is looked at."""
    log: Any = SimpleNamespace(**({"key": "path_mm", "time": np.arange(3.0), "spread": None, "predicted": None} | other))
    path: Any = None
    assert said_of_delay(log, path) == []

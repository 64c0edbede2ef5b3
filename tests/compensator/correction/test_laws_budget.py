"""What an error budget says of places, causes and remedies, of numbers that were put into it here."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from compensator.correction.budget import Budget, Place, _places
from compensator.correction.expected_left import CAUSES
from compensator.correction.remedies import Remedy

TOLERANCE = 10e-6
# Targets of the corrected program, every third of which is one of the program given, on the lines from 101 on.
KEPT = 3 * np.arange(20)


def corrected(std_um: dict[int, float], cause: dict[int, str]) -> Any:
    """Of a program of 58 targets, corrected from the second to the last but one: these have so large a sigma [um], by one cause
    at most of it, all others 1 um by their model."""
    targets = np.arange(1, 57)
    std, causes = np.full(58, 1e-6), {name: np.zeros(58) for name in CAUSES}
    causes["model"][:] = 1e-6
    for at, value in std_um.items():
        std[at] = 1e-6 * value
        causes["model"][at] = 0.5e-6 * value
        causes[cause.get(at, "model")][at] = np.sqrt(0.75) * 1e-6 * value
    left = SimpleNamespace(std=std[targets], **{name: values[targets] for name, values in causes.items()})
    at_rest = np.zeros((len(targets), 3))
    at_rest[:4, 0], at_rest[4, 1] = 11e-6, 9.9e-6
    return SimpleNamespace(
        left=left, kept=KEPT, planned=SimpleNamespace(path=SimpleNamespace(toolpath=SimpleNamespace(line=101 + np.arange(20)))),
        predicted=SimpleNamespace(targets=targets, prediction=SimpleNamespace(at_rest=at_rest)))


def test_places_are_runs_of_targets_that_fail_with_their_worst() -> None:
    """Two sigma over the tolerance, no farther apart than three targets; the worst first. A target that was added is on the
    line of the one given that it goes to."""
    over = {4: 5.1, 5: 8.0, 8: 5.5, 12: 30.0, 13: 4.99, 20: 6.0, 24: 7.0}
    found = _places(corrected(over, {5: "cut", 12: "sensor"}), TOLERANCE)
    assert found == (
        Place(105, 105, 1, pytest.approx(60e-6), "sensor"), Place(103, 104, 3, pytest.approx(16e-6), "cut"),
        Place(109, 109, 1, pytest.approx(14e-6), "model"), Place(108, 108, 1, pytest.approx(12e-6), "model"))
    assert _places(corrected({4: 4.99, 5: 5.0}, {}), TOLERANCE) == ()
    assert _places(corrected({56: 6.0}, {}), TOLERANCE)[0].last_line == 120


@pytest.mark.parametrize(("place", "words"), [
    (Place(7, 9, 3, 16.4e-6, "cut"), "lines 7 to 9: up to 16 um, mostly {cut}"),
    (Place(7, 7, 2, 16.6e-6, "model"), "line 7: up to 17 um, mostly {model}")])
def test_a_place_in_words(place: Place, words: str) -> None:
    assert place.words() == words.format(**CAUSES)


@pytest.mark.parametrize(("count", "more"), [(5, ""), (6, "  and at 1 more place (--json, --report)"),
                                            (8, "  and at 3 more places (--json, --report)")])
def test_five_places_are_named_in_the_terminal(count: int, more: str) -> None:
    fails = {4 * k + 4: 6.0 + k for k in range(count)}
    job = corrected(fails, {})
    remedy = Remedy("do this", "an hour", np.full(56, 0.5e-6))
    budget = Budget(job, TOLERANCE, _places(job, TOLERANCE), (remedy,), ())
    std = np.concatenate([list(fails.values()), np.ones(56 - count)])
    rms = 2 * np.sqrt(np.mean(std**2))
    told = budget.lines()
    assert told[0] == (f"error budget for 10 um: uncorrected 4 of 56 targets over it; corrected, two sigma are {rms:.1f} um "
                       f"RMS, {2 * std.max():.1f} um at most, and {count} over it")
    model = 2 * np.sqrt(np.mean(np.where(std > 1, 0.75 * std**2, 1.0)))
    assert told[1] == (f"  {CAUSES['model']}: {10 * model:.1f} % of the tolerance (two sigma {model:.1f} um RMS, "
                       f"{2 * np.sqrt(0.75) * std.max():.1f} um at most)")
    assert told[2:7] == [f"  may fail at {place.words()}" for place in budget.places[:5]]
    assert told[7:] == [*([more] if more else []),
                        f"  gains {rms - 1:.1f} um of {rms:.1f} (then 0 over): do this [an hour]"]
    of = budget.as_dict()
    assert (of["uncorrected_over"], of["over"], of["targets"], of["tolerance_um"]) == (4, count, 56, pytest.approx(10))
    assert of["causes"]["model"]["share_of_square"] == pytest.approx((model / rms) ** 2)
    assert of["causes"]["model"]["share_of_tolerance"] == pytest.approx(model / 10)
    assert of["remedies"][0]["gain_um"] == pytest.approx(rms - 1)


def test_causes_are_told_the_largest_first() -> None:
    job = corrected(dict.fromkeys(range(4, 30), 8.0), {k: "cut" if k % 3 else "sensor" for k in range(4, 30)})
    told = Budget(job, TOLERANCE, (), (), ()).lines()[1:]
    assert [line.partition(":")[0].strip() for line in told] == [CAUSES[name] for name in ("cut", "model", "sensor")]

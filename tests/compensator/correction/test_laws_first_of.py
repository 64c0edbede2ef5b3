"""What a report says to do first, of what would help, where a tolerance is stated."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from compensator.correction import remedies as of_remedies
from compensator.correction.first_screen import first_of
from identification.common.findings import error


@pytest.mark.parametrize(("over", "largest", "first"), [
    ((0, 0, 30), (39.8, 27.0, 64.1), "b"),          # both keep it, the second by far
    ((0, 3, 30), (39.8, 41.0, 64.1), "a"), ((12, 12, 2), (80, 70, 90), "c")])
def test_the_tolerance_decides_and_not_the_mean(over: tuple[int, ...], largest: tuple[float, ...], first: str) -> None:
    """They stand by what they gain on average, the most first."""
    remedies = [{"do": name, "gain_um": 3 - k, "over": over[k], "two_sigma_um": {"rms": 9 + k, "largest": largest[k]}}
                for k, name in enumerate("abc")]
    assert first_of(remedies)["do"] == first


def test_what_cannot_be_worked_out_is_left_out_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    """One that is refused, and one that has nothing to say; those behind them are still looked at."""
    def refused() -> np.ndarray:
        raise error("CS4001", "does not reach")

    left = np.array([1e-6, 2e-6])
    tried = [("a", "an hour", lambda: left), ("b", "a day", refused), ("c", "", lambda: None),
             ("d", "nothing", lambda: 2 * left)]
    monkeypatch.setattr(of_remedies, "_tried", lambda corrected: iter(tried))
    nothing: Any = None
    found = of_remedies.remedies(nothing)
    assert [(one.name, one.effort) for one in found] == [("a", "an hour"), ("d", "nothing")]
    np.testing.assert_array_equal(found[1].left, 2 * left)

"""What a report says to do first, of what would help, where a tolerance is stated."""

from __future__ import annotations

import pytest

from compensator.correction.first_screen import first_of


@pytest.mark.parametrize(("over", "largest", "first"), [
    ((0, 0, 30), (39.8, 27.0, 64.1), "b"),          # both keep it, the second by far
    ((0, 3, 30), (39.8, 41.0, 64.1), "a"), ((12, 12, 2), (80, 70, 90), "c")])
def test_the_tolerance_decides_and_not_the_mean(over: tuple[int, ...], largest: tuple[float, ...], first: str) -> None:
    """They stand by what they gain on average, the most first."""
    remedies = [{"do": name, "gain_um": 3 - k, "over": over[k], "two_sigma_um": {"rms": 9 + k, "largest": largest[k]}}
                for k, name in enumerate("abc")]
    assert first_of(remedies)["do"] == first

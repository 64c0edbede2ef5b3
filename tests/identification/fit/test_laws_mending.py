"""Which slips are said to mend a visit: those that are likely and fit."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.stats import chi2

from identification.fit import mending
from identification.fit.slips import Slip

RIGHT, SLIGHT = (chi2.isf(chance, 3) for chance in (1.1e-3, 0.9e-3))


@pytest.mark.parametrize(("weight", "fits", "told"), [
    ([0.0, -1.0, -9.0], [1.0, RIGHT, 1.0], [0, 1]), ([0.0, -1.0, -9.0], [1.0, SLIGHT, 1.0], [0]),
    ([0.0, -2.36, -9.0], [1.0, 1.0, 1.0], [0]), ([0.0, -2.15, -9.0], [1.0, 1.0, 1.0], [0, 1]),
    ([0.0, -1.0, -9.0], [SLIGHT, RIGHT, 1.0], [1]), ([-8.0, -8.0, -8.0], [1.0, 1.0, 1.0], [])])
def test_a_slip_is_told_that_is_likely_and_fits(
    monkeypatch: pytest.MonkeyPatch, weight: list[float], fits: list[float], told: list[int],
) -> None:
    """A twentieth among all and "none of them" (ln likelihood 0), and a misfit that chance makes in one of a thousand."""
    slips = [Slip(f"kind {k}", f"slip {k}", np.zeros(6)) for k in range(3)]
    visit = SimpleNamespace(expected=None, anything=lambda: 0.0, directions=3, angles_off=list,
                            judged=lambda slips: (np.array(weight), np.array(fits)))
    monkeypatch.setattr(mending, "slips_of", lambda *of: iter(slips))
    monkeypatch.setattr(mending, "_new", lambda *of: True)
    monkeypatch.setattr(mending, "_Visit", lambda *of: visit)
    rows: Any = SimpleNamespace(row=np.arange(4), theta=np.zeros((4, 6)), select=lambda mine: None)
    score: Any = SimpleNamespace(rows=np.array([1, 2]))
    rest: Any = None
    found = mending.mends(rest, rows, score, 1.0, frozenset())
    assert [mend.what for mend in found] == [f"slip {k}" for k in told]
    chance = np.exp(np.array([*weight, 0.0]))
    assert [mend.probability for mend in found] == pytest.approx(list((chance / chance.sum())[told]))


def test_a_response_off_in_any_way_is_as_likely_as_its_parts_are_on_average() -> None:
    """Off by 3 %, by 10 %, or by half of itself: a third each, by the likelihoods themselves."""
    likely = {0.03: 2e-3, 0.1: 0.5, 0.5: 0.04}
    visit: Any = SimpleNamespace(_rows=SimpleNamespace(theta=np.zeros((4, 6))), _loads=None, _own=None,
                                 _against=lambda theta, loads, own, part: (np.log([likely[part]]), np.zeros(1)))
    assert mending._Visit.anything(visit) == pytest.approx(np.log((2e-3 + 0.5 + 0.04) / 3))

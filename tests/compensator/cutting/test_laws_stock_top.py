"""A stock that stood higher or lower than its file says: told where the log tells it, and what a millimetre would do."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from compensator.coefficients.stock_top import said_of_the_top, too_large
from compensator.cutting.materials import coefficients_of
from compensator.cutting.posterior import ForceRows, fit_coefficients
from tests.compensator.cutting.milled import TRUE
from tests.compensator.cutting.test_laws_posterior import simulated

PRIOR = coefficients_of("aluminium", 1e-4)
# Depths of the two halves of the log [m], as the stock's file makes them.
DEPTHS = np.repeat([4e-3, 2e-3], 120)[:, None, None]


def two_levels(higher: float) -> tuple[ForceRows, np.ndarray]:
    """A log of two levels in a stock that stood so much [m] higher, with what a metre does to its forces (N, 3) [N/m]."""
    rows = simulated(31)
    weight = rows.weight * (DEPTHS / 4e-3)
    top = (weight / DEPTHS) @ TRUE
    noise = rows.force - rows.weight @ TRUE
    return replace(rows, weight=weight, force=weight @ TRUE + higher * top + noise), top


@pytest.mark.parametrize(("higher", "words"), [(1e-3, "1.0 mm higher"), (-1.5e-3, "1.5 mm lower"), (0.0, "")])
def test_a_log_of_two_levels_tells_where_the_top_was(higher: float, words: str) -> None:
    """Beside a stock that may stand aside, which it does not."""
    rows, top = two_levels(higher)
    rows = replace(rows, aside=np.random.default_rng(7).normal(0, 1, (240, 3, 2)))
    found = said_of_the_top(top, np.ones(240, dtype=bool), rows, fit_coefficients(rows, *PRIOR), PRIOR, "log")
    assert [finding.code for finding in found] == ["CS4751"] * bool(words)
    assert not words or words in found[0].message


def test_what_a_millimetre_would_do_is_what_it_does() -> None:
    """The coefficient of a log whose forces are those of a millimetre more, fitted; rows that are not used do not count."""
    rows, top = two_levels(0.0)
    found, more = (fit_coefficients(replace(rows, force=rows.force + shift * top), *PRIOR) for shift in (0.0, 1e-4))
    used = np.concatenate([np.ones(240, dtype=bool), np.zeros(7, dtype=bool)])
    share = too_large(np.vstack([top, np.full((7, 3), 1e9)]), used, found)
    assert share == pytest.approx(10 * (more.mean[0] / found.mean[0] - 1), rel=0.15)
    assert 0.1 < share < 0.5                            # a millimetre of 4 and of 2, of which the edges' part takes some
    assert too_large(None, used, found) is None

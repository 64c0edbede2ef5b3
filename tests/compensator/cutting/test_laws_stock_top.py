"""A stock that stood higher or lower than its file says: told where the log tells it, and what a millimetre would do."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from compensator.coefficients.stock_top import by_top, said_of_the_top, too_large
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


@pytest.mark.parametrize(("higher", "codes"), [(0.3e-3, []), (0.8e-3, ["CS4751"])])
def test_of_a_fit_that_leaves_little_no_other_top_is_told(higher: float, codes: list[str]) -> None:
    """A log without noise fits far better with the top where it was, however near that is: told where the fit leaves a part of
    the force that matters."""
    rows, top = two_levels(0.0)
    rows = replace(rows, force=rows.weight @ TRUE + higher * top)
    found = fit_coefficients(rows, *PRIOR)
    told = said_of_the_top(top, np.ones(240, dtype=bool), rows, found, PRIOR, "log")
    assert [finding.code for finding in told] == codes


def test_a_top_that_is_known_or_was_not_tried_is_not_asked_for() -> None:
    """Of a stock that stands just where its file says, and of a cut that was worked out without a tool aside."""
    known: Any = SimpleNamespace(blank=SimpleNamespace(position_std=0.0), engagement=SimpleNamespace(moved=np.zeros(1)))
    untried: Any = SimpleNamespace(blank=SimpleNamespace(position_std=1e-4), engagement=SimpleNamespace(moved=None))
    assert by_top(known, TRUE) is None
    assert by_top(untried, TRUE) is None
    # Of one that may stand elsewhere the cut is asked, by as much as its file says.
    tried: Any = SimpleNamespace(blank=SimpleNamespace(position_std=1e-4), engagement=SimpleNamespace(moved=np.zeros(1)),
                                 by_top=lambda coefficients, step: step * coefficients)
    assert by_top(tried, TRUE) == pytest.approx(1e-4 * TRUE)


def test_where_another_top_leaves_most_of_it_too_none_is_told() -> None:
    """A millimetre more in forces that scatter by as much as it does: some of that would go, which is not far better."""
    rows, top = two_levels(1e-3)
    rows = replace(rows, force=rows.force + np.random.default_rng(1).normal(0, 5, rows.force.shape))
    assert said_of_the_top(top, np.ones(240, dtype=bool), rows, fit_coefficients(rows, *PRIOR), PRIOR, "log") == []

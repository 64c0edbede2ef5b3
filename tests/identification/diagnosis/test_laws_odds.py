"""When a set of causes is certain."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from identification.diagnosis import odds
from identification.diagnosis.judgement import Cause
from identification.diagnosis.naming import CERTAIN
from identification.diagnosis.odds import (
    NO_LIKELIER,
    POSSIBLE,
    certain,
    doubt_by,
    doubt_of,
    log_odds,
    log_posterior,
)


@pytest.mark.parametrize(("together", "each", "expected"), [
    (CERTAIN, (0.1, 0.1), True), (CERTAIN - 0.01, (0.1, 0.1), False), (CERTAIN - 0.01, (CERTAIN, CERTAIN), True),
    (POSSIBLE, (CERTAIN, CERTAIN), True), (POSSIBLE - 0.01, (1.0, 1.0), False), (POSSIBLE, (1.0, CERTAIN - 0.01), False)])
def test_the_set_or_each_of_it(together: float, each: tuple[float, ...], expected: bool) -> None:
    """A set by itself, or one that is likelier than not with every one of its causes certain."""
    causes = cast(tuple[Cause, ...], tuple(SimpleNamespace(probability=value) for value in each))
    assert certain(together, causes) is expected


def test_a_set_costs_what_there_was_to_choose_from(monkeypatch: pytest.MonkeyPatch) -> None:
    """Twenty causes more to choose one from make it two and a half times less likely, by ln; without a cause the evidence is
    that of the files as they are."""
    monkeypatch.setattr(odds, "log_evidence", lambda fitted: fitted.evidence)
    data = object()
    extended: Any = SimpleNamespace(terms=("a",), data=data, evidence=-7.0)
    plain: Any = SimpleNamespace(terms=(), data=data, evidence=-20.0)
    found: Any = SimpleNamespace(log_evidence=-21.0, plain=plain)
    judgement: Any = SimpleNamespace(extended=extended, plain=plain)
    assert log_posterior(found, plain, 8) == -21.0
    few, many = log_posterior(found, extended, 8), log_posterior(found, extended, 20)
    assert few < -7.0
    assert few - many == pytest.approx(np.log(20 / 8))
    assert log_odds(judgement, 8) == pytest.approx(few + 20.0)


@pytest.mark.parametrize(("p_value", "resolution", "odds", "doubted"), [
    (0.06, 0.005, 6.8, "chance"), (0.06, 0.005, 6.9, ""), (0.06, 0.005, 7.0, ""), (0.005, 0.005, 0.1, ""),
    (0.005, 0.005, -0.1, "noise"), (0.06, 0.005, -0.1, "chance"), (0.05, 0.05, 0.1, ""), (0.06, 0.05, 0.1, "chance")])
def test_what_chance_shows_as_well_must_be_that_much_likelier_than_nothing(
    p_value: float, resolution: float, odds: float, doubted: str,
) -> None:
    """Asked for here is 6.9. What no replicate reaches is no chance, however few there were; whatever chance shows, what is
    less likely than nothing is doubted."""
    detection: Any = SimpleNamespace(p_value=p_value, resolution=resolution)
    said = doubt_of(detection, odds, 6.9)
    assert (said == "", said == NO_LIKELIER) == (doubted == "", doubted == "noise")
    assert said.startswith(f"{p_value:.1%} of data sets") == (doubted == "chance")


@pytest.mark.parametrize(("p_value", "resolution", "support", "doubted"), [
    (0.001, 0.001, -3.1, "less"), (0.001, 0.001, -3.0, "less"), (0.001, 0.001, -2.9, ""), (0.3, 0.001, -2.9, "hardly"),
    (0.3, 0.001, 2.9, "hardly"), (0.3, 0.001, 3.0, ""), (0.05, 0.05, 0.0, ""), (0.06, 0.05, 0.0, "hardly")])
def test_readings_that_were_not_fitted_speak_for_a_name(
    p_value: float, resolution: float, support: float, doubted: str,
) -> None:
    """Twenty times (ln 3) less likely is against it; where chance shows as much they must be as much likelier."""
    detection: Any = SimpleNamespace(p_value=p_value, resolution=resolution)
    measured: Any = SimpleNamespace(support=support, held_out="every fifth")
    said = doubt_by(detection, measured)
    assert ("hardly likelier" in said, "less likely" in said) == (doubted == "hardly", doubted == "less")
    assert doubted or not said
    assert doubted != "less" or said.endswith(f"by a factor {np.exp(-support):.2g}")

"""When a set of causes is certain."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from identification.diagnosis import odds
from identification.diagnosis.judgement import Cause
from identification.diagnosis.naming import CERTAIN
from identification.diagnosis.odds import POSSIBLE, certain, log_odds, log_posterior


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

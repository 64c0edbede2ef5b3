"""When a set of causes is certain."""

from __future__ import annotations

from types import SimpleNamespace
from typing import cast

import pytest

from identification.diagnosis.judgement import Cause
from identification.diagnosis.naming import CERTAIN
from identification.diagnosis.odds import POSSIBLE, certain


@pytest.mark.parametrize(("together", "each", "expected"), [
    (CERTAIN, (0.1, 0.1), True), (CERTAIN - 0.01, (0.1, 0.1), False), (CERTAIN - 0.01, (CERTAIN, CERTAIN), True),
    (POSSIBLE, (CERTAIN, CERTAIN), True), (POSSIBLE - 0.01, (1.0, 1.0), False), (POSSIBLE, (1.0, CERTAIN - 0.01), False)])
def test_the_set_or_each_of_it(together: float, each: tuple[float, ...], expected: bool) -> None:
    """A set by itself, or one that is likelier than not with every one of its causes certain."""
    causes = cast(tuple[Cause, ...], tuple(SimpleNamespace(probability=value) for value in each))
    assert certain(together, causes) is expected

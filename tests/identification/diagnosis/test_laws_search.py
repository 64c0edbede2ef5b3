"""The search for sets of causes."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np

from identification.diagnosis.projection import Base
from identification.diagnosis.search import Hypothesis, _exchanged


def test_the_best_set_is_no_exchange_of_itself() -> None:
    """Taken in another order it has the same evidence but for the last digit, which decides nothing."""
    best, again = Hypothesis((0, 1), (0, 1), 1 / 7), Hypothesis((1, 0), (1, 0), 16 / 3)
    other, rest = Hypothesis((1, 2), (1, 2), 5.0), Hypothesis((1,), (1,), 0.1)
    assert best.log_evidence + again.log_evidence - again.log_evidence > best.log_evidence
    found = _exchanged({best.key: best}, {rest.key: rest}, lambda smaller: [again, other] if smaller is rest else [])
    assert set(found) == {other.key}


def test_what_each_visit_may_do_counts_once_a_visit_that_it_moves() -> None:
    """How many coefficients are free says how many readings are left to tell the noise by."""
    weights: Any = SimpleNamespace(freed=lambda moved: weights)
    plain = Base(np.zeros((10, 3, 6)), np.zeros((10, 3)), weights, np.eye(6), np.zeros(6))
    visit, moved = np.repeat(np.arange(5), 2), np.zeros((10, 3, 2))
    assert plain.free == 6
    assert plain.freed(moved, visit) is plain
    moved[3:7, 0, 1] = 1e-5         # visits 1, 2 and 3
    once = plain.freed(moved, visit)
    assert (once.free, once.freed(moved[:, :, 1:], visit).free) == (6 + 6, 6 + 6 + 3)

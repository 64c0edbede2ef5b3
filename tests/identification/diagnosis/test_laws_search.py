"""The search for sets of causes."""

from __future__ import annotations

from identification.diagnosis.search import Hypothesis, _exchanged


def test_the_best_set_is_no_exchange_of_itself() -> None:
    """Taken in another order it has the same evidence but for the last digit, which decides nothing."""
    best, again = Hypothesis((0, 1), (0, 1), 1 / 7), Hypothesis((1, 0), (1, 0), 16 / 3)
    other, rest = Hypothesis((1, 2), (1, 2), 5.0), Hypothesis((1,), (1,), 0.1)
    assert best.log_evidence + again.log_evidence - again.log_evidence > best.log_evidence
    found = _exchanged({best.key: best}, {rest.key: rest}, lambda smaller: [again, other] if smaller is rest else [])
    assert set(found) == {other.key}

"""Causes that each visit begins in a state of its own, told by their fits."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from identification.diagnosis import begun
from identification.diagnosis.search import Hypothesis, Survey

# What a look at each signature of a cause finds; of the last two no visit begins anywhere.
LOOK = ((1.0, 3.0, 2.0), (9.0, 8.0, 7.0), (4.0,), (6.0, 5.0), (0.5, 0.4), (20.0, 19.0), (30.0,))
ANEW = 5
PLAIN = -100.0


@dataclass(frozen=True)
class Start:
    """A term as the fit gets it: one parameter that says how large it is, one of its shape."""

    cause: int
    start: Any
    scale: Any
    effect: Any


def seen() -> Survey:
    """All causes alone, of which the sixth is the likeliest at a look."""
    signatures, entries = [], []
    for k, look in enumerate(LOOK):
        entries.append(SimpleNamespace(signatures=range(len(signatures), len(signatures) + len(look))))
        signatures += [SimpleNamespace(effect=SimpleNamespace(by_visit=k < ANEW))] * len(look)
    dictionary: Any = SimpleNamespace(entries=entries, signatures=signatures)
    base: Any = SimpleNamespace(weights=None)
    state: Any = None
    sets = tuple(Hypothesis((k,), (entry.signatures.start,), max(LOOK[k])) for k, entry in enumerate(entries[: ANEW + 1]))
    return Survey(state, dictionary, base, sets)


def judged(monkeypatch: pytest.MonkeyPatch, gained: dict[int, float]) -> tuple[Any, list[int]]:
    """What is named where the fits of these signatures make the rows so much likelier, ln, and those of all others do not
    converge; and which were fitted."""
    tried: list[int] = []

    def attempt(data: Any, terms: Sequence[Start], near: Any) -> Any:
        (term,) = terms
        tried.append(term.cause)
        return SimpleNamespace(evidence=PLAIN + gained[term.cause], of=term.cause) if term.cause in gained else None

    def terms(survey: Survey, hypothesis: Hypothesis) -> tuple[Start, ...]:
        shape = [SimpleNamespace(shape=False), SimpleNamespace(shape=True)]
        return (Start(hypothesis.signatures[0], np.array([0.1, 0.2]), np.ones(2), SimpleNamespace(parameters=shape)),)

    # Alone and in pairs.
    monkeypatch.setattr(begun, "survey", lambda fitted, catalogue, levels: {2: seen()}[levels])
    monkeypatch.setattr(begun, "own_grams", lambda *of: None)
    monkeypatch.setattr(begun, "scores", lambda *of: SimpleNamespace(evidence=np.concatenate(LOOK)))
    monkeypatch.setattr(Survey, "terms", terms)
    monkeypatch.setattr(begun, "attempt", attempt)
    monkeypatch.setattr(begun, "log_evidence", lambda fit: fit.evidence)
    plain: Any = SimpleNamespace(evidence=PLAIN, data=None)
    return begun.named_by_fits(plain, {}), tried


def test_four_causes_are_fitted_each_from_its_two_best_starts(monkeypatch: pytest.MonkeyPatch) -> None:
    """The likeliest at a look first; signatures are counted through: 0 to 2, 3 to 5, 6, 7 and 8, 9 and 10."""
    _, tried = judged(monkeypatch, {})
    assert tried == [3, 4, 7, 8, 6, 1, 2]


@pytest.mark.parametrize(("gained", "named"), [
    ({1: 25.0, 2: 26.0, 3: 12.0}, 2), ({1: 26.0, 2: 25.0}, 1), ({2: 25.0}, 2), ({1: 19.0, 2: 19.9}, None), ({}, None)])
def test_the_likeliest_of_all_is_named_by_its_best_fit(
    monkeypatch: pytest.MonkeyPatch, gained: dict[int, float], named: int | None,
) -> None:
    """Against the plain model, as everything else is counted: the sixth cause has 20 at a look."""
    found, _ = judged(monkeypatch, gained)
    assert (found is None) == (named is None)
    if found is not None:
        assert found.fitted.of == named
        assert (found.best.entries, found.best.signatures) == ((0,), (named,))
        assert found.best.log_evidence == pytest.approx(max(gained.values()))
        assert found.seen.hypotheses[0] is found.best


@pytest.mark.parametrize(("start", "begins"), [(0.1, 0.5), (-0.1, -0.5), (0.0, 0.5), (0.7, 0.7), (-0.7, -0.7)])
def test_none_begins_smaller_than_is_typical(start: float, begins: float) -> None:
    """With the sign that it has; what its law's shape is stays."""
    shape = [SimpleNamespace(shape=False), SimpleNamespace(shape=True)]
    term: Any = Start(0, np.array([start, start]), np.array([0.5, 0.5]), SimpleNamespace(parameters=shape))
    assert begun._of_size(term).start.tolist() == [begins, start]

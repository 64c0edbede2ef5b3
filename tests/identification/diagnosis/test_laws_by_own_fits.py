"""Sets of causes held against each other, each with its own noise. No fit: numbers that say how likely each is."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from identification.diagnosis import by_own_fits
from identification.diagnosis.by_own_fits import held_against, likelier_fit, likeliest_fit
from identification.diagnosis.naming import Named
from identification.diagnosis.search import Hypothesis, Survey
from tests.identification.diagnosis.sets_of_causes import survey


# Fits as numbers: their ln evidence, and the sets they are of.
def fit_of(evidence: float, *labels: str) -> Any:
    return SimpleNamespace(evidence=evidence, data=None, terms=[SimpleNamespace(label=label) for label in labels])


def fitting(monkeypatch: pytest.MonkeyPatch, fits: dict[tuple[int, ...], Any]) -> list[tuple[int, ...]]:
    """Sets of causes, fitted so; None does not converge. Returned: those that were tried."""
    tried: list[tuple[int, ...]] = []

    def attempt(data: Any, terms: tuple[int, ...], near: Any) -> Any:
        tried.append(terms)
        return fits.get(terms)

    monkeypatch.setattr(by_own_fits, "attempt", attempt)
    monkeypatch.setattr(by_own_fits, "log_evidence", lambda fit: fit.evidence)
    return tried


def seen_of(*sets: tuple[tuple[int, ...], float]) -> Any:
    seen = survey(*sets)
    seen.terms = lambda hypothesis: hypothesis.entries
    return seen


def test_the_rival_that_is_likelier_by_itself_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    """Twenty times (ln 3), of as many causes, no unlikely one, and of the four likeliest that are left."""
    seen = seen_of(((0,), 0.5), ((1,), 0.2), ((3,), 0.1), ((0, 3), 0.1), ((4,), 0.05), ((2,), 0.009))
    other = fit_of(3.1)
    tried = fitting(monkeypatch, {(1,): fit_of(2.9), (4,): other, (0, 3): fit_of(50.0), (2,): fit_of(50.0), (0,): fit_of(50.0)})
    found: Any = SimpleNamespace(best=seen.hypotheses[0], seen=seen, fitted=fit_of(0.0))
    assert likelier_fit(found) is other
    assert tried == [(1,), (3,), (4,)]
    other.evidence = 2.9
    assert likelier_fit(found) is None
    fitting(monkeypatch, {})
    assert likelier_fit(found) is None, "none of the others converges"
    found.best = None
    assert likelier_fit(found) is None
    tried = fitting(monkeypatch, {})
    many = seen_of(((0,), 0.3), *(((k,), 0.1) for k in (1, 2, 3, 4, 1)))
    found = SimpleNamespace(best=many.hypotheses[0], seen=many, fitted=fit_of(0.0))
    likelier_fit(found)
    assert len(tried) == 4


def test_the_likeliest_of_one_and_two_causes(monkeypatch: pytest.MonkeyPatch) -> None:
    """By its own fit and how often so many act at once; the model itself where none converges."""
    seen = seen_of(((0,), 0.3), ((0, 3), 0.3), ((1,), 0.2), ((0, 3, 4), 0.1), ((3, 4), 0.1))
    monkeypatch.setattr(by_own_fits, "survey", lambda *_: seen)
    start: Any = fit_of(0.0)
    one, two = fit_of(5.0, "a"), fit_of(6.0, "a", "b")
    tried = fitting(monkeypatch, {(1,): one, (3, 4): two, (0, 3, 4): fit_of(99.0)})
    # Two of five causes: 0.09 / 10 of all sets, against 0.9 / 5 for one.
    assert likeliest_fit(start, {}, 2) is one
    assert sorted(tried) == [(0,), (0, 3), (1,), (3, 4)]
    two.evidence = 5.0 + float(np.log(0.18 / 0.009)) + 0.01
    assert likeliest_fit(start, {}, 2) is two
    assert likeliest_fit(start, {}, 1) is one
    fitting(monkeypatch, {})
    assert likeliest_fit(start, {}, 2) is start


def ranking(*sets: tuple[tuple[int, ...], float]) -> Survey:
    """Sets of the causes "0" ... "4", two signatures each, with their ln Bayes factors."""
    nothing: Any = None
    causes = [SimpleNamespace(label=str(k), signatures=range(2 * k, 2 * k + 2)) for k in range(5)]
    entries: Any = SimpleNamespace(entries=causes)
    hypotheses = tuple(Hypothesis(of, tuple(2 * k + 1 for k in of), evidence) for of, evidence in sets)
    return Survey(nothing, entries, nothing, hypotheses).instead({})


@pytest.fixture
def held(monkeypatch: pytest.MonkeyPatch) -> Any:
    """What is found with ln evidence 0, beside a plain model with -30, seen so; and fits of other sets: those that were tried
    are returned too."""
    def of(found: Survey, beside_plain: Survey, fits: dict[tuple[int, ...], Any]) -> tuple[Named, Any, list[Any]]:
        tried = fitting(monkeypatch, fits)
        monkeypatch.setattr(Survey, "terms", lambda self, hypothesis: hypothesis.entries)
        monkeypatch.setattr(by_own_fits, "survey", lambda *of: beside_plain)
        plain, best = fit_of(-30.0), fit_of(0.0)
        return *held_against(Named(found, found.hypotheses[0], best), plain, {}), tried

    return of


def test_a_set_is_as_likely_as_its_fit_with_its_own_noise(held: Any) -> None:
    """Seen beside the usual noise set 1 is e^20 times less likely than set 0, by its own fit e^2.7 times."""
    found = ranking(((0,), 33.0), ((1,), 13.0), ((2,), 3.0))
    other = fit_of(-2.7)
    named, likelier, _ = held(found, ranking(((1,), 6.0)), {(1,): other})
    told = {each.entries: (each.log_evidence, each.probability) for each in named.seen.hypotheses}
    assert told[(1,)] == (pytest.approx(33.0 - 2.7), pytest.approx(1 / (1 + np.exp(2.7)), rel=1e-6))
    assert (told[(0,)][0], told[(2,)][0], likelier) == (33.0, 3.0, None)
    assert named.best is found.hypotheses[0]
    # No set becomes less likely: what is seen may be more than what one search of its fit comes to.
    assert held(found, ranking(((1,), 6.0)), {(1,): fit_of(-25.0)})[0].seen.hypotheses[1].log_evidence == 13.0
    # Nor is one left out that had not been among the likeliest before.
    more = held(ranking(((0,), 33.0)), ranking(((3,), 6.0)), {(3,): fit_of(-2.0)})[0].seen
    assert {each.entries: each.log_evidence for each in more.hypotheses} == {(0,): 33.0, (3,): 31.0}
    unchanged = held(found, ranking(((1,), 6.0)), {})[0].seen
    assert [each.log_evidence for each in unchanged.hypotheses] == [33.0, 13.0, 3.0], "it does not converge"


def test_the_likelier_fit_is_one_by_twenty_times(held: Any) -> None:
    found = ranking(((0,), 33.0), ((1,), 13.0), ((2,), 12.0))
    for value, likelier in ((2.9, False), (3.1, True)):
        other = fit_of(value)
        fits = {(1,): other, (2,): fit_of(1.0)}
        assert (held(found, ranking(((1,), 6.0), ((2,), 6.0)), fits)[1] is other) is likelier


def test_only_sets_that_may_be_as_likely_are_fitted(held: Any) -> None:
    """Of no more causes, four of each number, and none that a noise of its own cannot make as likely; the best itself is not
    fitted again, nor what the other dictionary has not."""
    found = ranking(((0,), 33.0), ((1,), 13.0))
    beside = ranking(((0,), 8.0), ((1,), 7.0), ((1, 2), 30.0), ((2,), 5.1), ((3,), 4.9))
    assert held(found, beside, {})[2] == [(1,), (2,)]
    many = ranking(*(((k,), 9.0 - k) for k in range(5)))
    assert held(found, many, {})[2] == [(1,), (2,), (3,)]
    pair = ranking(((0, 1), 33.0), ((0,), 13.0))
    assert held(pair, beside, {})[2] == [(0,), (1,), (2,), (1, 2)]
    other: Any = SimpleNamespace(entries=found.dictionary.entries[:2])
    nothing: Any = None
    assert held(Survey(nothing, other, nothing, found.hypotheses), beside, {})[2] == [(1,)]


def test_nothing_is_held_against_nothing() -> None:
    nothing: Any = None
    named = Named(ranking(), None, nothing)
    assert held_against(named, nothing, {}) == (named, None)

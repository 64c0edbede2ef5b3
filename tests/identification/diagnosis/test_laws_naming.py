"""Which sets of causes are the likeliest, and how sure each name of them is. No fit: sets that are as likely as they are told
to be."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from identification.diagnosis import naming
from identification.diagnosis.naming import (
    converged,
    credible,
    inclusion,
    kindred,
    only_local,
    with_open_laws,
    with_plainer_effects,
)
from identification.diagnosis.search import Hypothesis, Survey
from tests.identification.diagnosis.sets_of_causes import survey


def test_what_a_plainer_effect_explains_better_is_that_one(monkeypatch: pytest.MonkeyPatch) -> None:
    """Its place in every set, with what was on the sets that come to be the same; where it explains less nothing changes."""
    def entry(label: str, number: int) -> Any:
        effect = SimpleNamespace(label=label, neutral=lambda state: np.zeros(1), typical=lambda state, joint: np.ones(1))
        return SimpleNamespace(label=label, effect=effect, signatures=range(10 * number, 10 * number + 3))

    entries = [entry(label, number) for number, label in enumerate(("cross-talk", "turn", "drift"))]
    hypotheses = tuple(Hypothesis(of, tuple(10 * k + 1 for k in of), -1.0, probability) for of, probability in (
        ((0, 2), 0.5), ((1,), 0.2), ((2, 1), 0.2), ((0,), 0.1)))
    wide = SimpleNamespace(label="cross-talk", effect=SimpleNamespace(plainer="turn"))
    other = SimpleNamespace(label="drift", effect=SimpleNamespace(plainer=""))
    fitted: Any = SimpleNamespace(terms=(wide, other), term_values=(np.ones(3), np.ones(1)), load_state=None, data=None,
                                  value=-5.0)
    seen: Any = SimpleNamespace(hypotheses=hypotheses, dictionary=SimpleNamespace(entries=entries))
    monkeypatch.setattr(naming, "Term", lambda effect, *_: SimpleNamespace(label=effect.label))
    monkeypatch.setattr(naming, "replace", lambda each, **given: replace(each, **given) if isinstance(
        each, Hypothesis) else SimpleNamespace(**{**vars(each), **given}))
    monkeypatch.setattr(naming, "log_evidence", lambda fit: fit.value)
    found: Any = SimpleNamespace(seen=seen, best=hypotheses[0], fitted=fitted, lost=())
    for value, labels, sets in (
            (-6.0, ["cross-talk", "drift"], [({0, 2}, 0.5), ({1}, 0.2), ({1, 2}, 0.2), ({0}, 0.1)]),
            (-4.0, ["turn", "drift"], [({1, 2}, 0.7), ({1}, 0.3)])):
        monkeypatch.setattr(naming, "attempt", lambda data, terms, near, value=value: SimpleNamespace(
            terms=terms, term_values=(), load_state=None, data=None, value=value))
        plain: Any = with_plainer_effects(found)
        assert [term.label for term in plain.fitted.terms] == labels
        assert [(set(each.entries), pytest.approx(each.probability)) for each in plain.seen.hypotheses] == sets


def test_of_two_effects_each_gives_way_to_its_plainer_kin(monkeypatch: pytest.MonkeyPatch) -> None:
    """Force sensor and deflection sensor both turned, both first seen as cross-talk: the rows are likelier with either turn,
    likeliest with both; each takes the place of its own."""
    def entry(name: str, number: int) -> Any:
        effect = SimpleNamespace(label=name, neutral=lambda state: np.zeros(1), typical=lambda state, joint: np.ones(1))
        return SimpleNamespace(label=name, effect=effect, signatures=range(number, number + 1))

    def fit(*terms: Any) -> Any:
        value = sum(term.label.endswith("turn") for term in terms) - 9.0
        return SimpleNamespace(terms=terms, term_values=(np.ones(1),) * len(terms), load_state=None, data=None, value=value)

    names = ("force cross-talk", "force turn", "reading cross-talk", "reading turn")
    entries = [entry(name, number) for number, name in enumerate(names)]
    wide = [SimpleNamespace(label=names[k], effect=SimpleNamespace(plainer=names[k + 1])) for k in (0, 2)]
    monkeypatch.setattr(naming, "Term", lambda effect, *_: SimpleNamespace(label=effect.label, effect=effect))
    monkeypatch.setattr(naming, "replace", lambda each, **given: replace(each, **given) if isinstance(
        each, Hypothesis) else SimpleNamespace(**{**vars(each), **given}))
    monkeypatch.setattr(naming, "log_evidence", lambda fit: fit.value)
    monkeypatch.setattr(naming, "attempt", lambda data, terms, near: fit(*terms))
    both = Hypothesis((0, 2), (0, 2), -1.0, 1.0)
    found: Any = SimpleNamespace(seen=SimpleNamespace(hypotheses=(both,), dictionary=SimpleNamespace(entries=entries)),
                                 best=both, fitted=fit(*wide), lost=())
    plain: Any = with_plainer_effects(found)
    assert [term.label for term in plain.fitted.terms] == ["force turn", "reading turn"]
    assert plain.best.key == plain.seen.hypotheses[0].key == {1, 3}


@dataclass(frozen=True)
class Named:
    """A cause with its probability."""

    effect: Any
    joint: int | None
    probability: float
    open_laws: dict[str, float] = field(default_factory=dict)

    @property
    def label(self) -> str:
        return self.effect.name if self.joint is None else f"{self.effect.name}[{self.joint}]"


@pytest.fixture
def named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(naming, "Cause", Named)


@pytest.mark.usefixtures("named")
def test_the_set_of_names_holds_nineteen_in_twenty() -> None:
    """The likeliest sets until they hold as much together, and the one that was fitted, wherever it stands."""
    for second, labels in ((0.36, {"play[1]", "rocking"}), (0.34, {"play[1]", "rocking", "soft[1]"})):
        seen = survey(((0,), 0.6), ((3,), second), ((1,), 0.4 - second - 0.01), ((4,), 0.01))
        assert {cause.label for cause in credible(seen, seen.hypotheses[0])} == labels
        assert {cause.label for cause in credible(seen, seen.hypotheses[3])} == labels | {"drift"}


@pytest.mark.usefixtures("named")
def test_a_cause_is_as_likely_as_the_sets_that_have_it() -> None:
    found = inclusion(survey(((0,), 0.5), ((0, 3), 0.25), ((3,), 0.125), ((1,), 0.125)))
    told = [(cause.label, cause.probability) for cause in found]
    assert told[:3] == [("play[1]", 0.75), ("rocking", 0.375), ("soft[1]", 0.125)]
    assert {cause.probability for cause in found[3:]} == {0.0}
    assert inclusion(survey(((0,), 0.75), ((0, 3), 0.5)))[0].probability == 1.0


@pytest.mark.usefixtures("named")
def test_an_open_law_is_one_of_the_same_gear_that_is_not_unlikely() -> None:
    for other, laws in ((0.25, {"soft": 0.25}), (0.0101, {"soft": 0.0101}), (0.0099, {})):
        seen = survey(((0,), 0.5), ((2,), 0.125), ((3,), 0.125), ((1,), other))
        play, rocking = (next(cause for cause in inclusion(seen) if cause.label == label) for label in ("play[1]", "rocking"))
        found = with_open_laws(seen, (play, rocking))
        assert [cause.open_laws for cause in found] == [laws, {}]
        assert [cause.probability for cause in found] == [0.5 + sum(laws.values()), 0.125]


def test_sets_that_do_not_converge_are_no_candidates_and_eight_are_enough(monkeypatch: pytest.MonkeyPatch) -> None:
    """The search goes on with the likeliest of the others, as seen from the last fit, until it stays the best."""
    def seen_from(order: list[int], lost: set[frozenset[int]]) -> Any:
        hypotheses = [SimpleNamespace(key=frozenset({k}), signatures=(k,), probability=1.0)
                      for k in order if frozenset({k}) not in lost]
        return SimpleNamespace(hypotheses=hypotheses, name=lambda hypothesis: str(set(hypothesis.key)),
                               terms=lambda hypothesis: tuple(hypothesis.key), unweighed=lambda hypothesis: None,
                               dictionary=SimpleNamespace(signatures=[SimpleNamespace(weight=0.0)] * 20, entries=()))

    def searched(orders: dict[str, list[int]], fits: dict[int, str]) -> tuple[Any, list[int]]:
        tried: list[int] = []
        monkeypatch.setattr(naming, "survey", lambda fitted, catalogue, levels: SimpleNamespace(
            without=lambda lost, rejected: seen_from(orders[fitted.name], lost)))

        def attempt(data: Any, terms: tuple[int, ...], near: Any) -> Any:
            tried.append(terms[0])
            return SimpleNamespace(name=fits[terms[0]], data=None, terms=()) if terms[0] in fits else None

        monkeypatch.setattr(naming, "attempt", attempt)
        monkeypatch.setattr(naming, "kindred", lambda seen, hypothesis: (hypothesis,))
        monkeypatch.setattr(naming, "log_evidence", lambda fit: 0.0)
        monkeypatch.setattr(naming, "log_prior", lambda *of: 0.0)
        start: Any = SimpleNamespace(name="start", data=None)
        return converged(start, {}, 2), tried

    found, tried = searched({"start": [3, 1, 2], "one": [2, 1], "two": [2, 1]}, {1: "one", 2: "two"})
    assert (tried, found.best.key, found.fitted.name, found.lost) == ([3, 1, 2], frozenset({2}), "two", ("{3}",))
    found, tried = searched({"start": list(range(12))}, {})
    assert (tried, found.best, found.fitted.name, len(found.lost)) == (list(range(8)), None, "start", 8)
    found, tried = searched({"start": [5]}, {})
    assert (tried, found.best, found.lost) == ([5], None, ("{5}",))
    # Each fit has another favourite: four are enough.
    found, tried = searched({"start": [0], **{f"f{k}": [k + 1] for k in range(6)}}, {k: f"f{k}" for k in range(6)})
    assert (tried, found.best.key, found.fitted.name) == ([0, 1, 2, 3], frozenset({3}), "f3")
    # Two that take turns: the first of them that comes back.
    found, tried = searched({"start": [0], "f0": [1], "f1": [0]}, {0: "f0", 1: "f1"})
    assert (tried, found.best.key, found.fitted.name) == ([0, 1], frozenset({0}), "f0")


@pytest.mark.parametrize(("gained", "alike", "best"), [(2.9, True, "later"), (3.1, True, "first"), (9.0, False, "later")])
def test_a_fit_on_the_way_that_is_far_likelier_is_the_one(
    monkeypatch: pytest.MonkeyPatch, gained: float, alike: bool, best: str) -> None:
    """A look from the first fit takes the later set for e^5 times likelier, with others beside it too; by their fits the first
    one is e^3.1 times likelier, and then so are the sets that have the later one as much less likely than they looked. One that
    visits begin anew is not held against one that they do not."""
    def look(*sets: tuple[tuple[int, ...], float]) -> Any:
        hypotheses = tuple(Hypothesis(of, tuple(2 * k for k in of), value) for of, value in sets)
        nothing: Any = None
        entries: Any = SimpleNamespace(entries=range(9), signatures=[SimpleNamespace(weight=0.0)] * 18)
        return Survey(nothing, entries, nothing, hypotheses).instead({})

    looks = {"start": look(((0,), 9.0), ((1,), 8.0)), "later": look(((1,), 9.0), ((0,), 1.0)),
             "first": look(((1,), 15.0), ((0,), 10.0), ((1, 2), 16.0), ((0, 2), 7.0))}
    anew = (SimpleNamespace(effect=SimpleNamespace(by_visit=True)),)
    fits = {(0,): SimpleNamespace(name="first", data=None, terms=anew, value=gained),
            (1,): SimpleNamespace(name="later", data=None, terms=anew if alike else (), value=0.0)}
    monkeypatch.setattr(Survey, "terms", lambda self, hypothesis: hypothesis.entries)
    monkeypatch.setattr(Survey, "unweighed", lambda self, hypothesis: None)
    for name, stub in (("survey", lambda fit, *of: looks[fit.name]), ("attempt", lambda data, terms, near: fits[terms]),
                       ("kindred", lambda seen, hypothesis: (hypothesis,)), ("log_evidence", lambda fit: fit.value)):
        monkeypatch.setattr(naming, name, stub)
    start: Any = SimpleNamespace(name="start", data=None)
    found: Any = converged(start, {}, 2)
    assert found.fitted.name == best
    told = {each.entries: each.log_evidence for each in found.seen.hypotheses}
    if best == "first":
        assert found.best.entries == (0,)
        less = 5.0 + gained
        assert told == {(0,): 10.0, (1,): pytest.approx(15.0 - less), (1, 2): pytest.approx(16.0 - less), (0, 2): 7.0}
    else:
        assert told == {(1,): 9.0, (0,): 1.0}


def test_kin_differ_in_the_law_of_a_gear_alone() -> None:
    seen = survey(((0, 3), 0.5), ((1, 3), 0.3), ((2, 3), 0.1), ((1,), 0.05), ((0, 4), 0.05))
    assert [each.entries for each in kindred(seen, seen.hypotheses[0])] == [(0, 3), (1, 3)]
    assert [each.entries for each in kindred(seen, seen.hypotheses[3])] == [(1,)]


def test_only_what_touches_one_pose_each_is_local() -> None:
    seen = survey(((0, 3), 0.5), ((0, 2), 0.3), ((4,), 0.2))
    assert [only_local(seen, hypothesis) for hypothesis in seen.hypotheses] == [True, False, False]


@pytest.mark.parametrize(("values", "best"), [
    ((0.0, 2.9, 1.0), 0), ((0.0, 3.1, 1.0), 1), ((0.0, 1.0, 3.1), 2), ((5.0, 7.9, 0.0), 0)])
def test_of_laws_that_imitate_each_other_the_likeliest_stays_unless_another_fits_far_better(
    monkeypatch: pytest.MonkeyPatch, values: tuple[float, ...], best: int) -> None:
    """By e cubed. Those that are a hundredth as likely at a look are fitted too, those that are less are not."""
    kin = [SimpleNamespace(key=frozenset({k}), signatures=(k,), probability=probability)
           for k, probability in enumerate((0.5, 0.3, 0.0051, 0.0049))]
    tried: list[int] = []

    def look(first: int) -> Any:
        order = [kin[first], *(each for each in kin if each is not kin[first])]
        return SimpleNamespace(hypotheses=order, terms=lambda hypothesis: hypothesis.signatures, unweighed=lambda of: None,
                               dictionary=SimpleNamespace(signatures=[SimpleNamespace(weight=0.0)] * 4, entries=()))

    def attempt(data: Any, terms: tuple[int, ...], near: Any) -> Any:
        tried.append(terms[0])
        return SimpleNamespace(name=terms[0], data=None, terms=(), value=(*values, 99.0)[terms[0]])

    monkeypatch.setattr(naming, "survey", lambda fitted, *of: SimpleNamespace(without=lambda *of: look(0)))
    for name, stub in (("attempt", attempt), ("kindred", lambda seen, hypothesis: tuple(seen.hypotheses)),
                       ("log_evidence", lambda fit: fit.value)):
        monkeypatch.setattr(naming, name, stub)
    start: Any = SimpleNamespace(name="start", data=None)
    found: Any = converged(start, {}, 2)
    assert tried == [0, 1, 2]
    assert (found.fitted.name, found.best.key) == (best, frozenset({best}))


def test_an_effect_without_plainer_kin_hides_none_behind_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """Drift stands before the cross-talk that is a turn."""
    effects = [SimpleNamespace(label=label, plainer="turn" if label == "cross-talk" else "", neutral=lambda state: np.zeros(1),
                               typical=lambda state, joint: np.ones(1)) for label in ("drift", "cross-talk", "turn")]
    entries = [SimpleNamespace(label=each.label, effect=each, signatures=range(k, k + 1)) for k, each in enumerate(effects)]
    monkeypatch.setattr(naming, "Term", lambda effect, *_: SimpleNamespace(label=effect.label, effect=effect))
    monkeypatch.setattr(naming, "replace", lambda each, **given: replace(each, **given) if isinstance(
        each, Hypothesis) else SimpleNamespace(**{**vars(each), **given}))
    monkeypatch.setattr(naming, "log_evidence", lambda fit: fit.value)
    monkeypatch.setattr(naming, "attempt", lambda data, terms, near: SimpleNamespace(terms=tuple(terms), value=1.0))
    terms = tuple(SimpleNamespace(label=each.label, effect=each) for each in effects[:2])
    fitted = SimpleNamespace(terms=terms, term_values=(np.ones(1),) * 2, load_state=None, data=None, value=0.0)
    both = Hypothesis((0, 1), (0, 1), -1.0, 1.0)
    found: Any = SimpleNamespace(seen=SimpleNamespace(hypotheses=(both,), dictionary=SimpleNamespace(entries=entries)),
                                 best=both, fitted=fitted, lost=())
    plain: Any = with_plainer_effects(found)
    assert [term.label for term in plain.fitted.terms] == ["drift", "turn"]

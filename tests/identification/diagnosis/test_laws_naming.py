"""Which of the terms of a fitted set are names: small ones beside a law that is uncertain, what is nothing, what is likely
together. No fit: terms that move the rows as they are told to."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from identification.diagnosis import naming
from identification.diagnosis.naming import (
    beyond_nothing,
    brought_along,
    converged,
    credible,
    inclusion,
    kindred,
    likelier_fit,
    likeliest_fit,
    needless,
    of_nothing,
    only_local,
    weighed_anew,
    with_open_laws,
    with_plainer_effects,
    without_slight,
)
from identification.diagnosis.search import Hypothesis

ROWS = 24


def term(label: str, size: float, shaped: bool = True, rows: slice = slice(None), where: str = "") -> Any:
    """Moves these rows by so much along x; shaped: its law has a shape that real ones need not follow."""
    moved = np.zeros((ROWS, 6))
    moved[rows, 0] = size
    moved[:, 3:] = 1e3              # what it turns counts for nothing here
    effect = SimpleNamespace(stiffens=shaped, ways=0, near_laws=(), parameters=(), weighed=False,
                             where={"pose": where} if where else {})
    return SimpleNamespace(label=label, effect=effect, contribution=lambda state, values: moved)


def beside(monkeypatch: pytest.MonkeyPatch, of_use: bool, *terms: Any) -> set[str]:
    """Labels of the small ones, in noise of 1 along each axis."""
    monkeypatch.setattr(naming, "_of_no_use", lambda *_: not of_use)
    extended: Any = SimpleNamespace(
        terms=terms, term_values=[np.zeros(1)] * len(terms), load_state=None,
        at_map=SimpleNamespace(noise=SimpleNamespace(whitening=np.tile(np.eye(3), (ROWS, 1, 1)))),
        weights=SimpleNamespace(inner=lambda a, b: np.einsum("nip,niq->pq", a, b)))
    nothing: Any = None
    return naming._slight_beside(nothing, extended, nothing)


def test_a_small_one_beside_an_uncertain_law_is_no_name(monkeypatch: pytest.MonkeyPatch) -> None:
    """Under 15 % of its signal, and of no use on rows that were not fitted; beside a law that is exact it may be one."""
    gear, exact = term("gear", 100.0), term("exact", 100.0, shaped=False)
    small, larger = (term("other", size, shaped=False) for size in (14.9, 15.1))
    assert beside(monkeypatch, False, gear, small) == {"other"}
    assert beside(monkeypatch, True, gear, small) == set()
    assert beside(monkeypatch, False, gear, larger) == set()
    assert beside(monkeypatch, False, exact, small) == set()
    assert beside(monkeypatch, False, exact, small, gear) == {"other"}


def test_what_is_at_one_pose_is_held_against_the_law_there(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nobody can tell it there from a law that is off, of use or not; and only the rows that it touches count."""
    gear = term("gear", 100.0)
    for size, slight in ((14.9, {"step"}), (15.1, set())):
        step = term("step", size, shaped=False, rows=slice(6, 9), where="P3")
        for of_use in (True, False):
            assert beside(monkeypatch, of_use, gear, step) == slight
    # Of all rows the whole of an effect that is not bound to a place counts, also where it moves none.
    part = term("part", 29.0, shaped=False, rows=slice(0, 6))
    assert beside(monkeypatch, False, gear, part) == {"part"}
    assert beside(monkeypatch, True, gear, part) == set()


@pytest.mark.parametrize(("off", "correlation", "beyond"), [
    ([1.9], 0.0, False), ([2.1], 0.0, True), ([-2.1], 0.0, True), ([1.7, 1.7], 0.0, False), ([1.8, 1.8], 0.0, True),
    ([0.5, 0.5], -0.9, False), ([0.6, 0.6], -0.9, True), ([2.1, 0.0], 0.0, True)])
def test_nothing_is_within_two_sigma_one_by_one_and_together(off: list[float], correlation: float, beyond: bool) -> None:
    """Two sigma of one are 95.45 %; for two together that is a circle of -2 ln 0.0455 = 6.18, on which (1.76, 1.76) lies, and
    (0.556, 0.556) where they are known by their sum to a third of what each is known to."""
    sigma = np.array([3e-5, 7.0])[:len(off)]
    covariance = np.array([[1.0, correlation], [correlation, 1.0]])[:len(off), :len(off)] * np.outer(sigma, sigma)
    assert beyond_nothing(np.array(off) * sigma, covariance) is beyond


def test_what_another_term_brings_along_is_told_with_its_name() -> None:
    def one(name: str, brings: dict[str, float]) -> Any:
        effect = SimpleNamespace(name=name, stored=name, where={}, parameters=[SimpleNamespace(shape=False)],
                                 brings=lambda values: {key: share * values[0] for key, share in brings.items()})
        return SimpleNamespace(label=f"{name}[1]", effect=effect, neutral=np.array([1.0]))

    ball, turn = one("ball", {"turn": 0.1}), one("turn", {})
    for size, found in ((1.9, {"turn[1]": "ball[1]"}), (0.1, {"turn[1]": "ball[1]"}), (2.1, {}), (-0.1, {})):
        extended: Any = SimpleNamespace(terms=[ball, turn], term_values=[np.array([10.0]), np.array([size])])
        assert brought_along(extended) == found
    # What begins at a row is a cause of its own; what holds in all of them may be the zero of what came before.
    turn.effect.where = {"row": 1}
    for from_row, found in ((0, {"turn[1]": "ball[1]"}), (2, {})):
        there = np.where(np.arange(5) >= from_row, 3e-5, 0.0)[:, None] * np.eye(6)[0]
        turn.contribution = lambda state, values, there=there: there
        extended = SimpleNamespace(terms=[ball, turn], term_values=[np.array([10.0]), np.array([1.9])], load_state=None)
        assert brought_along(extended) == found


@pytest.mark.parametrize(("alone", "found"), [(-14.3, {"other"}), (-14.7, set())])
def test_a_further_effect_must_do_what_no_real_law_would(
    monkeypatch: pytest.MonkeyPatch, alone: float, found: set[str],
) -> None:
    """With the laws free a set of one effect less may be as likely: the choice among ninety is ln 90 = 4.5."""
    def fit(*labels: str) -> Any:
        return SimpleNamespace(terms=[SimpleNamespace(label=label) for label in labels], data=None, free=False)

    monkeypatch.setattr(naming, "attempt", lambda data, kept, near: fit(*(term.label for term in kept)))
    monkeypatch.setattr(naming, "with_free_laws", lambda extended: SimpleNamespace(terms=extended.terms, free=True))
    values = {("gear", "other"): -10.0, ("gear",): alone, ("other",): -40.0}
    monkeypatch.setattr(naming, "log_evidence", lambda extended: values[tuple(t.label for t in extended.terms)] - 99.0 * (
        not extended.free))
    assert needless(fit("gear", "other"), 90) == found
    assert needless(fit("gear"), 90) == set()
    # Of a set that does not converge nothing is known.
    monkeypatch.setattr(naming, "attempt", lambda *_: None)
    assert needless(fit("gear", "other"), 90) == set()


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


@dataclass(frozen=True)
class Weighed:
    """A term of a fit; its last parameter is a weight."""

    start: np.ndarray
    effect: Any = field(default_factory=lambda: SimpleNamespace(weighed=True))


@pytest.mark.parametrize(("likelier", "weight"), [(3.1, 150.0), (2.9, 100.0)])
def test_a_weight_is_that_of_the_fit_whose_law_is_free(monkeypatch: pytest.MonkeyPatch, likelier: float, weight: float) -> None:
    """Weights half as much more and a third less are tried; another is taken where it is twenty times likelier so."""
    def fit(of: float) -> Any:
        return SimpleNamespace(terms=(Weighed(np.zeros(2)),), term_values=(np.array([7e-5, of]),), data=None)

    started = []
    monkeypatch.setattr(naming, "attempt", lambda data, terms, near: started.append(terms[0].start) or fit(terms[0].start[-1]))
    monkeypatch.setattr(naming, "with_free_laws", lambda extended: extended)
    monkeypatch.setattr(naming, "log_evidence", lambda extended: likelier * (extended.term_values[0][-1] > 140))
    assert weighed_anew(fit(100.0)).term_values[0][-1] == pytest.approx(weight)
    np.testing.assert_allclose(started, [[7e-5, 65.0], [7e-5, 150.0]])


def survey(*sets: tuple[tuple[int, ...], float]) -> Any:
    """Sets of causes with their probabilities. Of the causes 0 and 1 are laws of gear 1, 2 one of gear 2; 3 and 4 others."""
    def cause(name: str, joint: int | None, family: str) -> Any:
        label = name if joint is None else f"{name}[{joint}]"
        return SimpleNamespace(label=label, joint=joint, effect=SimpleNamespace(name=name, law_family=family))

    entries = [cause("play", 1, "gear"), cause("soft", 1, "gear"), cause("play", 2, "gear"), cause("rocking", None, ""),
               cause("drift", None, "")]
    hypotheses = [SimpleNamespace(entries=entries_of, key=frozenset(entries_of), probability=probability, signatures=entries_of)
                  for entries_of, probability in sets]
    signatures = [SimpleNamespace(local=local) for local in (True, True, False, True, False)]
    return SimpleNamespace(hypotheses=tuple(hypotheses), dictionary=SimpleNamespace(entries=entries, signatures=signatures))


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


# Fits as numbers: their ln evidence, and the sets they are of.
def fit_of(evidence: float, *labels: str) -> Any:
    return SimpleNamespace(evidence=evidence, data=None, terms=[SimpleNamespace(label=label) for label in labels])


def fitting(monkeypatch: pytest.MonkeyPatch, fits: dict[tuple[int, ...], Any]) -> list[tuple[int, ...]]:
    """Sets of causes, fitted so; None does not converge. Returned: those that were tried."""
    tried: list[tuple[int, ...]] = []

    def attempt(data: Any, terms: tuple[int, ...], near: Any) -> Any:
        tried.append(terms)
        return fits.get(terms)

    monkeypatch.setattr(naming, "attempt", attempt)
    monkeypatch.setattr(naming, "log_evidence", lambda fit: fit.evidence)
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
    monkeypatch.setattr(naming, "survey", lambda *_: seen)
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


def set_of(monkeypatch: pytest.MonkeyPatch, sizes: dict[str, float], useless: set[str], brought: set[str]) -> Any:
    """A fit with terms of these sizes [typical ones], of no use, or brought along by another."""
    effect = SimpleNamespace(weighed=False)
    terms = [SimpleNamespace(label=label, typical_sizes=lambda values: float(values[0]), effect=effect) for label in sizes]
    fit = SimpleNamespace(data=None, terms=terms, term_values=[np.array([size]) for size in sizes.values()])

    def attempt(data: Any, kept: list[Any], near: Any) -> Any:
        return SimpleNamespace(data=None, terms=kept, term_values=[np.array([sizes[each.label]]) for each in kept])

    monkeypatch.setattr(naming, "attempt", attempt)
    monkeypatch.setattr(naming, "of_nothing", lambda extended: {"nothing"} & set(sizes))
    monkeypatch.setattr(naming, "needless", lambda extended, choices: set())
    monkeypatch.setattr(naming, "brought_along", lambda extended: dict.fromkeys(brought, "main"))
    monkeypatch.setattr(naming, "_of_no_use", lambda data, extended, label, rng: label in useless)
    monkeypatch.setattr(naming, "_slight_beside", lambda data, extended, rng: {"beside"} & set(sizes))
    return fit


@pytest.mark.parametrize(("sizes", "useless", "brought", "kept", "slight"), [
    ({"main": 2.0, "small": 0.39}, {"small"}, set(), ["main"], set()),
    ({"main": 2.0, "small": 0.39}, set(), set(), ["main", "small"], {"small"}),
    ({"main": 2.0, "small": 0.41}, {"small"}, set(), ["main", "small"], set()),
    ({"main": 2.0, "turn": 3.0}, {"turn"}, {"turn"}, ["main"], set()),
    ({"main": 2.0, "turn": 3.0}, set(), {"turn"}, ["main", "turn"], {"turn"}),
    ({"one": 0.2, "other": 0.3}, {"one", "other"}, set(), ["one", "other"], set()),
    ({"main": 2.0, "beside": 1.0, "small": 0.1}, {"small"}, set(), ["main"], set()),
    ({"main": 2.0, "nothing": 1.0}, set(), set(), ["main"], set()),
    ({"nothing": 1.0}, set(), set(), ["nothing"], set())])
def test_what_is_small_stays_where_it_is_of_use_and_is_no_name(
    monkeypatch: pytest.MonkeyPatch, sizes: dict[str, float], useless: set[str], brought: set[str], kept: list[str],
    slight: set[str],
) -> None:
    """Where all are small none is: something is at work."""
    nothing: Any = None
    extended, labels = without_slight(nothing, set_of(monkeypatch, sizes, useless, brought), 90, nothing)
    assert [term.label for term in extended.terms] == kept
    assert labels == slight


def test_a_term_of_nothing_is_one_that_the_rows_do_not_need(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of its parameters those count that say how large it is; a thousand to one (ln 6.9) is need."""
    def one(label: str, shapes: list[bool]) -> Any:
        return SimpleNamespace(label=label, neutral=np.arange(1.0, 1 + len(shapes)), effect=SimpleNamespace(
            parameters=[SimpleNamespace(shape=shape) for shape in shapes]))

    terms = [one("small", [True, False]), one("large", [True, False]), one("needed", [False])]
    mean = np.concatenate([np.full(6, 50.0), [99.0, 2.0 + 1.9], [1.0, 2.0 + 2.1], [1.0]])
    extended: Any = SimpleNamespace(terms=terms, mean=mean, covariance=np.eye(11), data=None, evidence=0.0)
    for without, found in ((-6.8, {"small", "needed"}), (-7.0, {"small"})):
        monkeypatch.setattr(naming, "log_evidence", lambda fit: fit.evidence)
        monkeypatch.setattr(naming, "attempt", lambda data, kept, near, without=without: SimpleNamespace(
            evidence=without if "needed" not in {term.label for term in kept} and len(kept) == 2 else -1.0))
        assert of_nothing(extended) == found
    # Whose fit without it does not converge is not needed for that.
    monkeypatch.setattr(naming, "attempt", lambda *_: None)
    assert of_nothing(extended) == {"small", "needed"}


def test_of_use_is_what_makes_fresh_rows_twenty_times_likelier(monkeypatch: pytest.MonkeyPatch) -> None:
    asked = []
    extended: Any = SimpleNamespace(data=None, terms=[SimpleNamespace(label="one"), SimpleNamespace(label="other")])
    monkeypatch.setattr(naming, "attempt", lambda data, kept, near: asked.append([term.label for term in kept]) or "fit")
    nothing: Any = None
    for support, useless in ((2.9, True), (3.1, False)):
        monkeypatch.setattr(naming, "gain", lambda *_, support=support: SimpleNamespace(support=support))
        assert naming._of_no_use(nothing, extended, "other", nothing) is useless
    assert asked == [["one"], ["one"]]
    monkeypatch.setattr(naming, "attempt", lambda *_: None)
    assert naming._of_no_use(nothing, extended, "other", nothing) is False


def test_sets_that_do_not_converge_are_no_candidates_and_eight_are_enough(monkeypatch: pytest.MonkeyPatch) -> None:
    """The search goes on with the likeliest of the others, as seen from the last fit, until it stays the best."""
    def seen_from(order: list[int], lost: set[frozenset[int]]) -> Any:
        hypotheses = [SimpleNamespace(key=frozenset({k}), signatures=(k,), probability=1.0)
                      for k in order if frozenset({k}) not in lost]
        return SimpleNamespace(hypotheses=hypotheses, name=lambda hypothesis: str(set(hypothesis.key)),
                               terms=lambda hypothesis: tuple(hypothesis.key), unweighed=lambda hypothesis: None,
                               dictionary=SimpleNamespace(signatures=[SimpleNamespace(weight=0.0)] * 20))

    def searched(orders: dict[str, list[int]], fits: dict[int, str]) -> tuple[Any, list[int]]:
        tried: list[int] = []
        monkeypatch.setattr(naming, "survey", lambda fitted, catalogue, levels: SimpleNamespace(
            without=lambda lost, rejected: seen_from(orders[fitted.name], lost)))

        def attempt(data: Any, terms: tuple[int, ...], near: Any) -> Any:
            tried.append(terms[0])
            return SimpleNamespace(name=fits[terms[0]], data=None) if terms[0] in fits else None

        monkeypatch.setattr(naming, "attempt", attempt)
        monkeypatch.setattr(naming, "kindred", lambda seen, hypothesis: (hypothesis,))
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


def test_kin_differ_in_the_law_of_a_gear_alone() -> None:
    seen = survey(((0, 3), 0.5), ((1, 3), 0.3), ((2, 3), 0.1), ((1,), 0.05), ((0, 4), 0.05))
    assert [each.entries for each in kindred(seen, seen.hypotheses[0])] == [(0, 3), (1, 3)]
    assert [each.entries for each in kindred(seen, seen.hypotheses[3])] == [(1,)]


def test_only_what_touches_one_pose_each_is_local() -> None:
    seen = survey(((0, 3), 0.5), ((0, 2), 0.3), ((4,), 0.2))
    assert [only_local(seen, hypothesis) for hypothesis in seen.hypotheses] == [True, False, False]

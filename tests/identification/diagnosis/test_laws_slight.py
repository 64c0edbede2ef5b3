"""Which of the terms of a fitted set are no names: small ones beside a law that is uncertain, what is nothing, what another
brings along. No fit: terms that move the rows as they are told to."""

from __future__ import annotations

from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from identification.diagnosis import slight
from identification.diagnosis.slight import (
    beyond_laws,
    beyond_nothing,
    brought_along,
    needless,
    no_names,
    of_nothing,
    weighed_anew,
    without_slight,
)

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
    monkeypatch.setattr(slight, "_of_no_use", lambda *_: not of_use)
    extended: Any = SimpleNamespace(
        terms=terms, term_values=[np.zeros(1)] * len(terms), load_state=None,
        at_map=SimpleNamespace(noise=SimpleNamespace(whitening=np.tile(np.eye(3), (ROWS, 1, 1)))),
        weights=SimpleNamespace(inner=lambda a, b: np.einsum("nip,niq->pq", a, b)))
    nothing: Any = None
    return slight._slight_beside(nothing, extended, nothing)


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
    for size, labels in ((14.9, {"step"}), (15.1, set())):
        step = term("step", size, shaped=False, rows=slice(6, 9), where="P3")
        for of_use in (True, False):
            assert beside(monkeypatch, of_use, gear, step) == labels
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

    monkeypatch.setattr(slight, "attempt", lambda data, kept, near: fit(*(term.label for term in kept)))
    monkeypatch.setattr(slight, "with_free_laws", lambda extended: SimpleNamespace(terms=extended.terms, free=True))
    values = {("gear", "other"): -10.0, ("gear",): alone, ("other",): -40.0}
    monkeypatch.setattr(slight, "log_evidence", lambda extended: values[tuple(t.label for t in extended.terms)] - 99.0 * (
        not extended.free))
    assert needless(fit("gear", "other"), 90) == found
    assert needless(fit("gear"), 90) == set()
    # Of a set that does not converge nothing is known.
    monkeypatch.setattr(slight, "attempt", lambda *_: None)
    assert needless(fit("gear", "other"), 90) == set()


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
    monkeypatch.setattr(slight, "attempt", lambda data, terms, near: started.append(terms[0].start) or fit(terms[0].start[-1]))
    monkeypatch.setattr(slight, "with_free_laws", lambda extended: extended)
    monkeypatch.setattr(slight, "log_evidence", lambda extended: likelier * (extended.term_values[0][-1] > 140))
    assert weighed_anew(fit(100.0)).term_values[0][-1] == pytest.approx(weight)
    np.testing.assert_allclose(started, [[7e-5, 65.0], [7e-5, 150.0]])


def set_of(monkeypatch: pytest.MonkeyPatch, sizes: dict[str, float], useless: set[str], brought: set[str]) -> Any:
    """A fit with terms of these sizes [typical ones], of no use, or brought along by another."""
    effect = SimpleNamespace(weighed=False)
    terms = [SimpleNamespace(label=label, typical_sizes=lambda values: float(values[0]), effect=effect) for label in sizes]
    fit = SimpleNamespace(data=None, terms=terms, term_values=[np.array([size]) for size in sizes.values()])

    def attempt(data: Any, kept: list[Any], near: Any) -> Any:
        return SimpleNamespace(data=None, terms=kept, term_values=[np.array([sizes[each.label]]) for each in kept])

    monkeypatch.setattr(slight, "attempt", attempt)
    monkeypatch.setattr(slight, "of_nothing", lambda extended: {"nothing"} & set(sizes))
    monkeypatch.setattr(slight, "needless", lambda extended, choices: set())
    monkeypatch.setattr(slight, "brought_along", lambda extended: dict.fromkeys(brought, "main"))
    monkeypatch.setattr(slight, "_of_no_use", lambda data, extended, label, rng: label in useless)
    monkeypatch.setattr(slight, "_slight_beside", lambda data, extended, rng: {"beside"} & set(sizes))
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
        monkeypatch.setattr(slight, "log_evidence", lambda fit: fit.evidence)
        monkeypatch.setattr(slight, "attempt", lambda data, kept, near, without=without: SimpleNamespace(
            evidence=without if "needed" not in {term.label for term in kept} and len(kept) == 2 else -1.0))
        assert of_nothing(extended) == found
    # Whose fit without it does not converge is not needed for that.
    monkeypatch.setattr(slight, "attempt", lambda *_: None)
    assert of_nothing(extended) == {"small", "needed"}


def test_of_use_is_what_makes_fresh_rows_twenty_times_likelier(monkeypatch: pytest.MonkeyPatch) -> None:
    asked = []
    extended: Any = SimpleNamespace(data=None, terms=[SimpleNamespace(label="one"), SimpleNamespace(label="other")])
    monkeypatch.setattr(slight, "attempt", lambda data, kept, near: asked.append([term.label for term in kept]) or "fit")
    nothing: Any = None
    for support, useless in ((2.9, True), (3.1, False)):
        monkeypatch.setattr(slight, "gain", lambda *_, support=support: SimpleNamespace(support=support))
        assert slight._of_no_use(nothing, extended, "other", nothing) is useless
    assert asked == [["one"], ["one"]]
    monkeypatch.setattr(slight, "attempt", lambda *_: None)
    assert slight._of_no_use(nothing, extended, "other", nothing) is False


@pytest.mark.parametrize(("alone", "plain", "brought", "cause"), [
    (-21.3, -50.0, {}, False), (-21.5, -50.0, {}, True), (-99.0, -99.0, {"other": "gear"}, False),
    (-29.9, -210.0, {}, False), (-30.1, -210.0, {}, True)])
def test_a_small_effect_is_a_cause_where_no_real_law_does_what_it_does(
    monkeypatch: pytest.MonkeyPatch, alone: float, plain: float, brought: dict[str, str], cause: bool,
) -> None:
    """A thousand to one (ln 6.9) with the laws free, the choice among ninety (ln 4.5) counted, and a tenth of the evidence of
    all effects against none; never what another brings along."""
    def fit(*labels: str) -> Any:
        return SimpleNamespace(terms=[SimpleNamespace(label=label) for label in labels], data=None, free=not labels)

    monkeypatch.setattr(slight, "attempt", lambda data, kept, near: fit(*(term.label for term in kept)))
    monkeypatch.setattr(slight, "with_free_laws", lambda extended: SimpleNamespace(terms=extended.terms, free=True))
    monkeypatch.setattr(slight, "brought_along", lambda extended: brought)
    values = {("gear", "other"): -10.0, ("gear",): alone, (): plain}
    monkeypatch.setattr(slight, "log_evidence", lambda extended: values[tuple(t.label for t in extended.terms)] - 99.0 * (
        not extended.free))
    assert beyond_laws(fit(), fit("gear", "other"), "other", 90) is cause
    # Of a set that does not converge nothing is known.
    monkeypatch.setattr(slight, "attempt", lambda *_: None)
    assert not beyond_laws(fit(), fit("gear", "other"), "other", 90)


def test_a_small_term_is_a_name_where_it_is_certain_and_beyond_the_laws(monkeypatch: pytest.MonkeyPatch) -> None:
    asked = []
    monkeypatch.setattr(slight, "beyond_laws", lambda plain, extended, label, choices: asked.append(label) or label != "law's")
    names: Any = [SimpleNamespace(label=label, probability=probability) for label, probability in (
        ("main", 1.0), ("sure", 0.96), ("law's", 0.96), ("likely", 0.94))]
    nothing: Any = None
    assert no_names(frozenset({"sure", "law's", "likely"}), names, nothing, nothing, 90) == {"law's", "likely"}
    assert sorted(asked) == ["law's", "sure"]
    assert no_names(frozenset(), names, nothing, nothing, 90) == frozenset()

"""Which of the sets of causes that the searches come to is taken, and which searches are made."""

from __future__ import annotations

from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any

import pytest

from identification.diagnosis import explaining
from identification.diagnosis.explaining import Explaining


@dataclass(frozen=True)
class Searched:
    """What a search found, as far as these steps ask."""

    fitted: str
    best: Any
    enough: bool
    value: float = 0.0

    def likelier_than(self, other: Searched) -> bool:
        return self.enough >= other.enough and self.value > other.value


ONE: Any = SimpleNamespace(key=frozenset({1}), entries=(1,))


@pytest.mark.parametrize(("usual", "quiet", "begun", "strains", "taken"), [
    (Searched("usual", ONE, False), Searched("quiet", ONE, True), None, False, "quiet"),
    (Searched("usual", None, True), Searched("quiet", ONE, True, 1.0), None, False, "quiet"),
    (Searched("usual", ONE, True), Searched("quiet", ONE, True, 1.0), Searched("begun", ONE, True, 2.0), False, "usual"),
    (Searched("usual", ONE, True), Searched("quiet", ONE, True), Searched("begun", ONE, True), True, "usual"),
    (Searched("usual", ONE, True), Searched("quiet", ONE, True, 1.0), None, True, "quiet"),
    (Searched("usual", ONE, True), Searched("quiet", ONE, True, 1.0), Searched("begun", ONE, True, 2.0), True, "begun")])
def test_parts_of_the_noise_that_have_grown_hide_no_cause(
    monkeypatch: pytest.MonkeyPatch, usual: Searched, quiet: Searched, begun: Searched | None, strains: bool, taken: str,
) -> None:
    """Where the usual noise leaves a misfit, or no cause, or has grown beside one, the search is done again with noise that has
    not, and for causes that each visit begins anew; else not. What is far likelier is taken."""
    asked: list[Any] = []

    def searched(self: Explaining, start: Any, *of: Any, **more: Any) -> Searched:
        asked.append(start)
        return quiet if start == "ordinary" else usual

    monkeypatch.setattr(Explaining, "searched", searched)
    monkeypatch.setattr(explaining, "under_ordinary_noise", lambda fitted: fitted)
    monkeypatch.setattr(explaining, "likeliest_fit", lambda *of: "ordinary")
    monkeypatch.setattr(explaining, "strained", lambda fitted: strains)
    monkeypatch.setattr(explaining, "named_by_fits", lambda *of: begun)
    monkeypatch.setattr(Explaining, "tested", lambda self, named: named)
    start: Any = "as it is"
    nothing: Any = None
    first: Any = usual
    assert Explaining({}, 0.05, 10, nothing).likeliest(start, first).fitted == taken
    assert asked == ["ordinary"] * (strains or taken == "quiet")


@dataclass(frozen=True)
class Lost:
    """Named causes, as far as these steps ask."""

    lost: tuple[str, ...] = ()


@dataclass(frozen=True)
class Found:
    """What a search found, with the test of its fit."""

    fitted: Any
    enough: bool
    best: Any = field(default_factory=lambda: ONE)
    p_value: float = 0.001
    named: Lost = Lost()
    better: bool = False

    @property
    def adequacy(self) -> Any:
        return SimpleNamespace(p_value=self.p_value)

    def likelier_than(self, other: Found) -> bool:
        return self.better


TWO: Any = SimpleNamespace(key=frozenset({1, 2}), entries=(1, 2))


@pytest.mark.parametrize(("rival", "begun", "more", "alone", "taken"), [
    ((True, False), False, TWO, 0.0, "rival"), ((False, False), True, TWO, 0.0, "begun"), (None, False, ONE, 0.9, "more"),
    ((False, False), False, ONE, 0.9, "more"), ((False, False), False, TWO, 0.051, "alone"),
    ((False, False), False, TWO, 0.049, "more"), ((False, False), False, None, 0.9, "more")])
def test_what_two_causes_do_not_explain_is_looked_for_elsewhere(
    monkeypatch: pytest.MonkeyPatch, rival: tuple[bool, bool] | None, begun: bool, more: Any, alone: float, taken: str,
) -> None:
    """In turn: without the set that was found, from a fit that is likelier; among what visits begin anew; with three causes;
    and a single one where another noise leaves it no alarm. The first that explains the rows; what is lost is told."""
    asked: list[Any] = []

    def searched(self: Explaining, start: Any, levels: int = 2, rejected: Any = None) -> Found:
        asked.append((start, levels, rejected))
        if start == "ordinary":
            return Found("quiet", False)
        if start == "another":
            return Found("rival", rival is not None and rival[0])
        if levels == 1:
            return Found("alone", False, p_value=alone)
        return Found("more", False, more, named=Lost(("b", "c")))

    monkeypatch.setattr(explaining, "replace", lambda thing, **changed: type(thing)(**{**vars(thing), **changed}))
    monkeypatch.setattr(Explaining, "searched", searched)
    monkeypatch.setattr(explaining, "under_ordinary_noise", lambda fitted: fitted)
    monkeypatch.setattr(explaining, "likeliest_fit", lambda *of: "ordinary")
    monkeypatch.setattr(explaining, "likelier_fit", lambda named: None if rival is None else "another")
    monkeypatch.setattr(explaining, "strained", lambda fitted: False)
    monkeypatch.setattr(explaining, "named_by_fits", lambda *of: "begun")
    monkeypatch.setattr(Explaining, "tested", lambda self, named: Found("begun", True, better=begun))
    start: Any = "as it is"
    first: Any = Found("usual", False, named=Lost(("a", "b")))
    nothing: Any = None
    found: Any = Explaining({}, 0.05, 10, nothing).likeliest(start, first)
    assert found.fitted == taken
    expected: list[Any] = [("ordinary", 2, None)] + [("another", 2, frozenset({1}))] * (rival is not None)
    if taken in ("more", "alone"):
        expected.append(("usual", 3, None))
        expected += [("as it is", 1, None)] * (more is TWO)
    assert asked == expected
    if taken == "more":
        assert found.named.lost == ("a", "b", "c")


@pytest.mark.parametrize(("likelier", "enough", "better", "taken"), [
    (False, True, True, "held"), (True, True, True, "other"), (True, False, True, "held"), (True, True, False, "held")])
def test_causes_that_are_likelier_in_the_plain_model_s_noise_take_their_place(
    monkeypatch: pytest.MonkeyPatch, likelier: bool, enough: bool, better: bool, taken: str,
) -> None:
    """Where they explain the rows too and are likelier; else the causes stand, beside those held against them."""
    asked: list[Any] = []

    def searched(self: Explaining, start: Any, levels: int = 2) -> Found:
        asked.append((start.terms, levels))
        return Found("other", enough, better=better)

    fit = SimpleNamespace(terms=("a", "b", "c"))
    monkeypatch.setattr(explaining, "replace", lambda thing, named: SimpleNamespace(fitted=named))
    monkeypatch.setattr(explaining, "held_against", lambda *of: ("held", fit if likelier else None))
    monkeypatch.setattr(Explaining, "searched", searched)
    nothing: Any = None
    first: Any = Found("first", True)
    assert Explaining({}, 0.05, 10, nothing).held_against_noise(nothing, first).fitted == taken
    assert asked == [(("a", "b", "c"), 3)] * likelier

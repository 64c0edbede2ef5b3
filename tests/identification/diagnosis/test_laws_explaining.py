"""Which of the sets of causes that the searches come to is taken, and which searches are made."""

from __future__ import annotations

from dataclasses import dataclass
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

"""Which of the terms of a fitted set are names: small ones beside a law that is uncertain, what is nothing, what is likely
together. No fit: terms that move the rows as they are told to."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from identification.diagnosis import naming
from identification.diagnosis.naming import beyond_nothing, brought_along, credible, kindred, only_local

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
        effect = SimpleNamespace(name=name, brings=lambda values: {key: share * values[0] for key, share in brings.items()})
        return SimpleNamespace(label=f"{name}[1]", effect=effect, neutral=np.array([1.0]))

    ball, turn = one("ball", {"turn": 0.1}), one("turn", {})
    for size, found in ((1.9, {"turn[1]": "ball[1]"}), (0.1, {"turn[1]": "ball[1]"}), (2.1, {}), (-0.1, {})):
        extended: Any = SimpleNamespace(terms=[ball, turn], term_values=[np.array([10.0]), np.array([size])])
        assert brought_along(extended) == found


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


def test_the_set_of_names_holds_nineteen_in_twenty(monkeypatch: pytest.MonkeyPatch) -> None:
    """The likeliest sets until they hold as much together, and the one that was fitted, wherever it stands."""
    monkeypatch.setattr(naming, "Cause", lambda effect, joint, probability: SimpleNamespace(
        label=effect.name if joint is None else f"{effect.name}[{joint}]", probability=probability))
    for second, labels in ((0.36, {"play[1]", "rocking"}), (0.34, {"play[1]", "rocking", "soft[1]"})):
        seen = survey(((0,), 0.6), ((3,), second), ((1,), 0.4 - second - 0.01), ((4,), 0.01))
        assert {cause.label for cause in credible(seen, seen.hypotheses[0])} == labels
        assert {cause.label for cause in credible(seen, seen.hypotheses[3])} == labels | {"drift"}


def test_kin_differ_in_the_law_of_a_gear_alone() -> None:
    seen = survey(((0, 3), 0.5), ((1, 3), 0.3), ((2, 3), 0.1), ((1,), 0.05), ((0, 4), 0.05))
    assert [each.entries for each in kindred(seen, seen.hypotheses[0])] == [(0, 3), (1, 3)]
    assert [each.entries for each in kindred(seen, seen.hypotheses[3])] == [(1,)]


def test_only_what_touches_one_pose_each_is_local() -> None:
    seen = survey(((0, 3), 0.5), ((0, 2), 0.3), ((4,), 0.2))
    assert [only_local(seen, hypothesis) for hypothesis in seen.hypotheses] == [True, False, False]

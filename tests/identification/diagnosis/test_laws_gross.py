"""Single bad rows: several that are as far off do not hide each other, and heavy tails alone have hardly ever one."""

from __future__ import annotations

from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from identification.common.findings import error
from identification.diagnosis import gross
from identification.fit.visits import VisitScore, VisitTest

ROWS = 105


def squared(rng: np.random.Generator, degrees: float = np.inf) -> np.ndarray:
    """Squared distances (n,) of readings of three components."""
    heavier = 1.0 if np.isinf(degrees) else rng.chisquare(degrees, ROWS) / degrees
    return np.asarray(rng.chisquare(3, ROWS) / heavier)


def rare(distance: np.ndarray) -> dict[int, float]:
    return gross.rare(distance, np.full(ROWS, 3), np.ones(ROWS, dtype=bool), 0.05 * ROWS)


@pytest.mark.parametrize("off", [(27.0,), (27.0, 27.1), (27.0, 27.1, 27.2)])
def test_readings_that_are_as_far_off_do_not_hide_each_other(off: tuple[float, ...]) -> None:
    """A gauge at the end of its travel, at two loads: each made the tails so heavy that the other was no rarity."""
    for seed in range(5):
        distance = squared(np.random.default_rng(seed))
        distance[: len(off)] = np.square(off)
        assert set(rare(distance)) == set(range(len(off)))
        assert max(rare(distance).values()) <= gross.ALARM


def test_without_a_look_behind_the_first_they_would(monkeypatch: pytest.MonkeyPatch) -> None:
    distance = squared(np.random.default_rng(0))
    distance[:2] = 27.0**2, 27.1**2
    monkeypatch.setattr(gross, "HIDDEN", 1)
    assert not rare(distance)


@pytest.mark.parametrize("degrees", [np.inf, pytest.param(6.0, marks=pytest.mark.long), 3.0])      # long: between the two
def test_heavy_tails_have_hardly_ever_one(degrees: float) -> None:
    """One in two thousand load tests is meant."""
    rng = np.random.default_rng(77)
    assert sum(bool(rare(squared(rng, degrees))) for _ in range(30)) <= 1


def test_too_many_are_no_single_mistakes() -> None:
    distance = squared(np.random.default_rng(3))
    distance[:6] = 60.0**2
    assert not rare(distance)


@pytest.mark.parametrize(("most", "named"), [(3.0, {0, 1}), (2.0, {0, 1}), (1.9, set())])
def test_as_many_as_may_be_are_named(most: float, named: set[int]) -> None:
    distance = squared(np.random.default_rng(0))
    distance[:2] = 27.0**2, 27.1**2
    assert set(gross.rare(distance, np.full(ROWS, 3), np.ones(ROWS, dtype=bool), most)) == named


VISIT = np.arange(ROWS) // 7


class Numbered:
    """Rows with their numbers, lines and readings alone, each in a visit of its own."""

    def __init__(self, row: np.ndarray, line: np.ndarray) -> None:
        self.row, self.line, self.visit, self.deflection = row, line, row, np.full((len(row), 3), 1e-4)

    def __len__(self) -> int:
        return len(self.row)


def test_bad_rows_are_those_of_visits_that_are_not_crowded(monkeypatch: pytest.MonkeyPatch) -> None:
    """Four of the first visit, whose matter that is, and one of the third, which is named by its number, line and reading."""
    monkeypatch.setattr(gross, "_distances", lambda fitted: (np.zeros(ROWS), np.full(ROWS, 3), np.ones(ROWS, dtype=bool)))
    monkeypatch.setattr(gross, "rare", lambda *of: dict.fromkeys((2, 15, 0, 3, 1), 1e-5))
    monkeypatch.setattr(gross, "residual_std", lambda *of: np.full((ROWS, 3), 2e-6))
    number = np.arange(ROWS)
    fitted: Any = SimpleNamespace(
        data=SimpleNamespace(rows=Numbered(number + 100, number + 200)),
        at_map=SimpleNamespace(noise=SimpleNamespace(visit=VISIT, further=None)), components=None, compliance=None,
        residual=np.repeat(1e-6 * number[:, None], 3, axis=1))
    (bad,) = gross.bad_rows(fitted)
    assert (bad.row, bad.line) == (115, 215)
    np.testing.assert_allclose(bad.off, 15e-6)


def test_a_row_may_be_bad_that_was_read_among_two_others_where_nothing_is_loose(monkeypatch: pytest.MonkeyPatch) -> None:
    """One of one component too; a row without a reading is none, one of a pose of two rows is a matter of the pose, and where a
    named gear is in its play it may stand anywhere."""
    visit = np.array([0, 0, 0, 1, 1, 2, 2, 2, 2])
    count = np.array([3, 1, 0, 3, 3, 3, 3, 3, 3])
    monkeypatch.setattr(gross, "distances", lambda *of: (np.arange(9.0), count))

    def term(rows: list[int]) -> Any:
        return SimpleNamespace(joint=2, effect=SimpleNamespace(
            loose=lambda state, joint, values: np.isin(np.arange(9), rows) & (joint == 2) & (values == "values")))

    fitted: Any = SimpleNamespace(
        at_map=SimpleNamespace(noise=SimpleNamespace(visit=visit), residual=None), components=None, weights=None,
        terms=(term([6]), term([8])), term_values=("values", "values"), load_state=None)
    distance, components, kept = gross._distances(fitted)
    assert (distance.tolist(), components.tolist()) == (list(range(9)), count.tolist())
    assert np.flatnonzero(kept).tolist() == [0, 1, 5, 7]


def crowded(distance: np.ndarray) -> dict[int, float]:
    return gross.crowded(VISIT, distance, np.full(ROWS, 3), np.ones(ROWS, dtype=bool))


def test_five_of_one_visit_hide_each_other_but_not_their_visit() -> None:
    """Readings that slipped by a row. Two are no crowd; nor are ten that each belong to a visit of their own."""
    for seed in range(5):
        distance = squared(np.random.default_rng(seed))
        slipped, two, apart = distance.copy(), distance.copy(), distance.copy()
        slipped[14:19] = np.square([40.0, 41.0, 42.0, 43.0, 44.0])
        two[14:16] = np.square([40.0, 41.0])
        apart[3::14] = 40.0**2
        assert not rare(slipped)
        assert set(crowded(slipped)) == {2}
        assert not crowded(two)
        assert not crowded(apart)


@pytest.mark.parametrize("degrees", [np.inf, pytest.param(6.0, marks=pytest.mark.long), 3.0])      # long: between the two
def test_heavy_tails_crowd_no_visit(degrees: float) -> None:
    rng = np.random.default_rng(78)
    assert sum(bool(crowded(squared(rng, degrees))) for _ in range(30)) <= 1


def test_a_visit_is_as_crowded_as_the_third_of_its_bad_readings() -> None:
    """Two far off are no crowd, however many ordinary readings stand beside them: the third decides."""
    distance = squared(np.random.default_rng(5))
    distance[14:21] = 3.0
    distance[14:16] = 45.0**2, 44.0**2
    assert not crowded(distance)
    distance[16] = 43.0**2
    assert set(crowded(distance)) == {2}


@pytest.mark.parametrize(("visits", "crowds", "converges", "bad"), [
    (9, {1: 1e-5, 4: 1e-7}, True, ["P4", "P1"]), (6, {1: 1e-5, 4: 1e-7}, True, ["P4", "P1"]), (9, {}, True, None),
    (9, {2: 1e-5}, True, None), (5, {1: 1e-5, 4: 1e-7}, True, None), (9, {1: 1e-5}, False, None)])
def test_visits_that_are_crowded_are_bad_ones(
        monkeypatch: pytest.MonkeyPatch, visits: int, crowds: dict[int, float], converges: bool, bad: list[str] | None) -> None:
    """Up to a third of those that were looked at, the rarest first, all of whose rows were; without them the others are fitted
    anew, if they can be."""
    row = np.arange(1, 3 * visits + 1)
    visit = np.repeat(np.arange(visits), 3)

    @dataclass(frozen=True)
    class Rows:
        row: NDArray[np.intp]

        def select(self, kept: NDArray[np.bool_]) -> Rows:
            return Rows(self.row[kept])

    def posterior(rows: Rows, terms: Any, near: Any) -> Any:
        if not converges:
            raise error("CS1011", "no")
        return rows.row.tolist()

    monkeypatch.setattr(gross, "_distances", lambda fitted: ())
    monkeypatch.setattr(gross, "crowded", lambda visit: crowds)
    monkeypatch.setattr(gross, "posterior", posterior)
    # Of the third visit a row was not looked at: it is another one's.
    scores = tuple(VisitScore(f"P{k}", row[visit == k][: 2 if k == 2 else 3], 0, 0, 1.0, 0.5, 0.1, np.zeros(3), np.ones(3))
                   for k in range(visits))
    fitted: Any = SimpleNamespace(data=SimpleNamespace(rows=Rows(row), with_rows=lambda rows: rows), terms=(),
                                  at_map=SimpleNamespace(noise=SimpleNamespace(visit=visit)))
    test = VisitTest(scores, 0.5, 0.001)
    found = gross.with_crowded(test, fitted)
    if bad is None:
        assert found is test
        return
    assert [(one.name, one.p_value) for one in found.bad] == [(name, crowds[int(name[1:])]) for name in bad]
    assert found.rest == row[~np.isin(visit, list(crowds))].tolist()

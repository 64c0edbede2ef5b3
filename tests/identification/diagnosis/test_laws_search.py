"""The search for sets of causes."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from identification.diagnosis import explained as of_misfit
from identification.diagnosis import search
from identification.diagnosis.dictionary import Dictionary
from identification.diagnosis.projection import Base
from identification.diagnosis.search import Hypothesis, Survey, _exchanged
from identification.measurements import run_numbers


def test_the_best_set_is_no_exchange_of_itself() -> None:
    """Taken in another order it has the same evidence but for the last digit, which decides nothing."""
    best, again = Hypothesis((0, 1), (0, 1), 1 / 7), Hypothesis((1, 0), (1, 0), 16 / 3)
    other, rest = Hypothesis((1, 2), (1, 2), 5.0), Hypothesis((1,), (1,), 0.1)
    assert best.log_evidence + again.log_evidence - again.log_evidence > best.log_evidence
    found = _exchanged({best.key: best}, {rest.key: rest}, lambda smaller: [again, other] if smaller is rest else [])
    assert set(found) == {other.key}


def test_an_exchange_is_as_much_likelier_than_the_best_as_it_is_beside_what_both_have() -> None:
    """And no exchange where it was taken for as likely before, or where nobody looked at what both have."""
    best, rest = Hypothesis((0, 1), (0, 1), 12.0), Hypothesis((1,), (1,), 2.0)
    beside = [Hypothesis((1, 0), (1, 0), 7.0), Hypothesis((1, 2), (1, 2), 8.5), Hypothesis((1, 3), (1, 3), 4.0)]
    known = [Hypothesis((2, 1), (2, 1), 11.4), Hypothesis((3, 1), (3, 1), 9.1)]
    grown = {each.key: each for each in (best, *known)}
    found = _exchanged(grown, {rest.key: rest}, lambda smaller: beside if smaller is rest else [])
    assert {key: (each.entries, each.log_evidence) for key, each in found.items()} == {frozenset({1, 2}): ((1, 2), 13.5)}
    turned = replace(best, entries=(1, 0), signatures=(1, 0))
    again = _exchanged({turned.key: turned}, {rest.key: rest}, lambda smaller: beside if smaller is rest else [])
    assert {key: each.log_evidence for key, each in again.items()} == {frozenset({1, 2}): 13.5, frozenset({1, 3}): 9.0}
    assert _exchanged(grown, {}, lambda smaller: beside) == {}
    assert _exchanged({}, {rest.key: rest}, lambda smaller: beside) == {}
    assert _exchanged(grown, {rest.key: rest}, lambda smaller: beside[1:]) == {}


def test_what_each_visit_may_do_counts_once_a_visit_that_it_moves() -> None:
    """How many coefficients are free says how many readings are left to tell the noise by."""
    weights: Any = SimpleNamespace(freed=lambda moved: weights)
    plain = Base(np.zeros((10, 3, 6)), np.zeros((10, 3)), weights, np.eye(6), np.zeros(6))
    visit, moved = np.repeat(np.arange(5), 2), np.zeros((10, 3, 2))
    assert plain.free == 6
    assert plain.freed(moved, visit) is plain
    moved[3:7, 0, 1] = 1e-5         # visits 1, 2 and 3
    once = plain.freed(moved, visit)
    assert (once.free, once.freed(moved[:, :, 1:], visit).free) == (6 + 6, 6 + 6 + 3)


def test_what_is_unsure_by_one_sigma_adds_its_own_square_to_the_readings() -> None:
    rng = np.random.default_rng(3)
    weights: Any = SimpleNamespace(apply=lambda columns: columns)
    plain = Base(rng.standard_normal((7, 3, 2)), np.zeros((7, 3)), weights, np.diag([4.0, 0.25]), np.zeros(2))
    columns = rng.standard_normal((7, 3, 4))

    def beside_noise(base: Base) -> np.ndarray:
        flat = base.design.reshape(21, -1)
        return np.asarray(flat @ np.linalg.solve(base.precision, flat.T))

    flat = columns.reshape(21, 4)
    assert np.allclose(beside_noise(plain.unsure_of(columns)), beside_noise(plain) + flat @ flat.T)


def test_runs_end_where_any_label_changes() -> None:
    labels = np.array([["A", "x"], ["A", "x"], ["A", "y"], ["B", "y"], ["B", "y"], ["A", "x"]])
    assert run_numbers(labels).tolist() == [0, 0, 1, 2, 2, 3]


def test_where_the_gear_rests_anywhere_it_may_turn_round_with_the_load() -> None:
    """By the sign of the largest force, whatever the small ones and moments do; in its typical size, in the rows that are
    undecided."""
    rng = np.random.default_rng(5)
    wrench = np.array([[300.0, -4, 9, 0, -900, 0], [-300, 8, 2, 0, 0, 0], [7, -2, -250, 0, 0, 0], [0, 0, 0, 0, 0, 50],
                       [1, 0, 80, 0, 0, 0]])
    state: Any = type("State", (), {"wrench": wrench, "jacobian": rng.standard_normal((5, 6, 6)), "__len__": lambda self: 5})()
    mask = np.array([True, True, True, True, False])
    gear = SimpleNamespace(undecided=lambda state, joint: mask, typical=lambda state, joint: np.array([2e-4]))
    entries: Any = (SimpleNamespace(effect=gear, joint=3), SimpleNamespace(effect=gear, joint=4))
    nothing: Any = None
    found = Dictionary(entries, (), nothing, nothing, nothing, {}).undecided(state, 3)
    move = 2e-4 * state.jacobian[:, :3, 2] * mask[:, None]
    assert np.allclose(found[:, :, 0], move)
    assert np.allclose(found[:, :, 1], move * np.array([1, -1, -1, 0, 1])[:, None])
    assert Dictionary(entries, (), nothing, nothing, nothing, {}).undecided(state, 2).shape == (5, 3, 0)
    assert Dictionary(entries, (), nothing, nothing, nothing, {}).undecided(state, None).shape == (5, 3, 0)


def test_of_several_laws_of_a_gear_the_widest_counts_where_any_is_undecided() -> None:
    """A law that is decided everywhere has no say, nor has another gear's, nor what belongs to no joint."""
    state: Any = type("State", (), {"wrench": np.tile([9.0, 0, 0, 0, 0, 0], (3, 1)), "jacobian": np.full((3, 6, 6), 0.5),
                                    "__len__": lambda self: 3})()

    def law(joint: int | None, size: float, *rows: int) -> Any:
        return SimpleNamespace(joint=joint, effect=SimpleNamespace(
            undecided=lambda state, joint: np.isin(np.arange(3), rows), typical=lambda state, joint: np.array([size, 7.0])))

    laws: Any = (law(2, 3e-4, 0), law(2, 1e-4, 2), law(2, 9e-4), law(5, 8e-4, 1), law(None, 8e-4, 1))
    nothing: Any = None
    found = Dictionary(laws, (), nothing, nothing, nothing, {}).undecided(state, 2)
    assert found[:, 1, 0].tolist() == pytest.approx([1.5e-4, 0.0, 1.5e-4])
    assert Dictionary(laws[2:3], (), nothing, nothing, nothing, {}).undecided(state, 2).shape == (3, 3, 0)


def test_without_a_weight_the_best_signature_of_the_same_law_is_taken(monkeypatch: pytest.MonkeyPatch) -> None:
    """A second entry whose signatures begin at 3: 3 and 5 without a weight, 4 and 6 under one."""
    entries = (SimpleNamespace(signatures=range(3)), SimpleNamespace(signatures=range(3, 7)))
    dictionary: Any = SimpleNamespace(
        entries=entries, signatures=[SimpleNamespace(weight=weight) for weight in (0, 0, 0, 0, 40.0, 0, 60.0)],
        unweighed=lambda entry: [k for k in entry.signatures if k in (0, 1, 2, 3, 5)], of=lambda k: np.full((2, 3, 1), k),
        part=lambda entries: None)
    beside: list[Any] = []
    base: Any = SimpleNamespace(extended=lambda columns: beside.append(columns) or base, weights=None)
    monkeypatch.setattr(search, "own_grams", lambda *of: None)
    for evidence, best in (([1.0, 9.0, 2.0, 8.0], 5), ([3.0, 9.0, 2.0, 8.0], 3)):
        monkeypatch.setattr(search, "scores", lambda *of, known=evidence: SimpleNamespace(evidence=np.array(known)))
        found = Survey(base, dictionary, base, ()).unweighed(Hypothesis((0, 1), (1, 4), 5.0))
        assert found is not None
        assert found.signatures == (1, best)
        assert [np.unique(columns).tolist() for columns in beside] == [[1]], "beside the others alone"
        beside.clear()
    assert Survey(base, dictionary, base, ()).unweighed(Hypothesis((0, 1), (1, 5), 5.0)) is None


@pytest.mark.parametrize(("levels", "count"), [(1, 6), (2, 6 + 14), (3, 6 + 14 + 12)])
def test_sets_grow_from_the_four_likeliest(monkeypatch: pytest.MonkeyPatch, levels: int, count: int) -> None:
    """Of six causes of ln 6 to 1, which add up: every pair but that of the last two, and of the triples those that have one of
    the four best pairs. The cause that has least by itself is the last that was taken."""
    alone, looked_at = [2.0, 6.0, 1.0, 5.0, 4.0, 3.0], []

    class Scan:
        def __init__(self, *of: Any) -> None:
            pass

        def grown(self, hypothesis: Hypothesis) -> list[Hypothesis]:
            looked_at.append(hypothesis.entries)
            return [Hypothesis((*hypothesis.entries, k), (*hypothesis.signatures, 10 + k), hypothesis.log_evidence + value)
                    for k, value in enumerate(alone) if k not in hypothesis.entries]

    monkeypatch.setattr(search, "_Scan", Scan)
    monkeypatch.setattr(search, "_weighed", lambda hypotheses, entries: tuple(hypotheses))
    dictionary: Any = SimpleNamespace(entries=range(6))
    nothing: Any = None
    found = {each.key: each for each in search.searched(nothing, dictionary, nothing, nothing, levels).hypotheses}
    pairs = [{a, b} for a in range(6) for b in range(a) if {a, b} != {0, 2}]
    best = [{1, 3}, {1, 4}, {1, 5}, {3, 4}]
    triples = [{a, b, c} for a in range(6) for b in range(a) for c in range(b) if any(pair <= {a, b, c} for pair in best)]
    expected = [*({k} for k in range(6)), *(pairs if levels > 1 else []), *(triples if levels > 2 else [])]
    assert len(expected) == count
    assert set(found) == {frozenset(each) for each in expected}
    for key, each in found.items():
        assert each.log_evidence == pytest.approx(sum(alone[k] for k in key))
        assert each.signatures == tuple(10 + k for k in each.entries)
        assert alone[each.entries[-1]] == min(alone[k] for k in key)
    assert len(looked_at) == len(set(looked_at)), "each is looked at once"


def test_what_is_explained_is_counted_by_reading_and_spring(monkeypatch: pytest.MonkeyPatch) -> None:
    """30 readings, of which six springs take six: 72 is three a reading; of the two above one, 48 and 24 leave half and all."""
    noise = SimpleNamespace(whitening=np.broadcast_to(np.eye(3), (10, 3, 3)), weights=lambda components: SimpleNamespace(
        inner=lambda left, right: np.einsum("nij,nik->jk", left, right)))
    monkeypatch.setattr(of_misfit, "noise_model", lambda *of: noise)

    def model(chi2: float) -> Any:
        return SimpleNamespace(data=None, compliance=None, components=SimpleNamespace(at_most=lambda limit: None), readings=30,
                               residual=np.full((10, 3), np.sqrt(chi2 / 30)))

    for after, share in ((48.0, 0.5), (20.0, 1.0), (72.0, 0.0)):
        found = of_misfit.explained(model(72.0), model(after))
        assert (found.excess, found.share) == (pytest.approx(3.0), pytest.approx(share))


def test_a_set_that_was_fitted_takes_the_place_of_its_look() -> None:
    """The others stay, and all are weighed anew: of singles among three as their evidence says."""
    dictionary: Any = SimpleNamespace(entries=[None] * 3)
    sets = [Hypothesis((k,), (k,), value) for k, value in enumerate((2.0, 1.0, 0.0))]
    state: Any = None
    base: Any = None
    seen = Survey(state, dictionary, base, tuple(sets))
    fitted = Hypothesis((2,), (7,), 3.0)
    found = seen.instead({fitted.key: fitted}).hypotheses
    assert [(each.entries, each.signatures, each.log_evidence) for each in found] == [
        ((2,), (7,), 3.0), ((0,), (0,), 2.0), ((1,), (1,), 1.0)]
    weight = np.exp([3.0, 2.0, 1.0])
    np.testing.assert_allclose([each.probability for each in found], weight / weight.sum())


def test_an_entry_is_as_likely_as_its_signatures_are_on_average() -> None:
    """Shares of a half, a quarter and a quarter; told is the one that explains most, whatever its share."""
    value, best = search._entry_evidence(np.log([2.0, 4.0, 8.0]), np.log([0.5, 0.25, 0.25]), np.array([5, 6, 7]))
    assert np.exp(value) == pytest.approx(1.0 + 1.0 + 2.0)
    assert best == 7


@pytest.mark.parametrize(("rows", "again"), [(search.ROWS_KEPT, 0), (search.ROWS_KEPT + 1, 3)])
def test_what_is_seen_from_a_model_is_looked_at_once(monkeypatch: pytest.MonkeyPatch, rows: int, again: int) -> None:
    """By catalogue and by how many causes act together; of very many rows it would be most of what is held."""
    class Fit:
        data, log_compliance, weights, load_state = None, None, None, range(rows)
        at_map = SimpleNamespace(noise=None)

    seen: list[int] = []

    def searched(base: Any, dictionary: Any, state: Any, sight: Any, levels: int) -> Any:
        seen.append(levels)
        return SimpleNamespace(levels=levels)

    model: Any = SimpleNamespace(extended=lambda columns: None)
    monkeypatch.setattr(search, "base_at", lambda *of: model)
    monkeypatch.setattr(search, "sag_columns", lambda *of: None)
    monkeypatch.setattr(search, "dictionary_of", lambda *of: None)
    monkeypatch.setattr(search, "searched", searched)
    fitted: Any = Fit()
    other: Any = Fit()
    one: dict[str, Any] = {}
    another: dict[str, Any] = {}
    calls = [(fitted, one, 2), (fitted, one, 1), (fitted, another, 2), (other, one, 2)]
    first = [search.survey(*call) for call in calls]
    assert [found.levels for found in first] == seen == [2, 1, 2, 2]
    assert [search.survey(*call) is found for call, found in zip(calls[:3], first, strict=False)] == [not again] * 3
    assert len(seen) == 4 + again


def test_numbers_of_causes_are_chances() -> None:
    """One, two or three act, or none would be looked for; the fewer the likelier."""
    assert sum(search.PRIOR_OF_SIZE) == pytest.approx(1.0)
    assert list(search.PRIOR_OF_SIZE) == sorted(search.PRIOR_OF_SIZE, reverse=True)


def test_each_cause_of_a_set_begins_with_its_own_coefficients() -> None:
    """Of three causes of one, two and one coefficients, beside a spring: the best ones of all together by least squares, their
    prior 1.5 wide; of one whose sign is known a hundredth at least."""
    rng = np.random.default_rng(11)
    columns = {4: rng.standard_normal((8, 3, 1)), 0: rng.standard_normal((8, 3, 2)), 7: rng.standard_normal((8, 3, 1))}
    weights: Any = SimpleNamespace(apply=lambda columns: columns)
    spring, truth = rng.standard_normal((8, 3, 1)), np.array([0.5, 2.0, -3.0, 1.5, -4.0])
    every = np.concatenate([spring, *columns.values()], axis=2)
    base = Base(spring, every @ truth, weights, np.array([[9.0]]), np.zeros(1))
    dictionary: Any = SimpleNamespace(of=lambda s: columns[s], positive=[s == 7 for s in range(8)],
                                      term=lambda state, s, values: (state, s, values.tolist()))
    state: Any = "arm"
    found: Any = Survey(state, dictionary, base, ()).terms(Hypothesis((1, 0, 2), (4, 0, 7), 0.0))
    prior = np.diag([3.0, *[1 / 1.5] * 4])
    best = np.linalg.lstsq(np.vstack([every.reshape(24, 5), prior]), np.append((every @ truth).ravel(), np.zeros(5)))[0]
    assert best[4] < 0
    assert [(state, signature) for state, signature, _ in found] == [("arm", 4), ("arm", 0), ("arm", 7)]
    assert [values for _, _, values in found] == [[pytest.approx(best[1])], pytest.approx(best[2:4].tolist()), [0.01]]

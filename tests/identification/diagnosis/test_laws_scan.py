"""The look at all causes beside those that are taken: against normal densities of all readings together, and by hand."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from identification.diagnosis import search
from identification.diagnosis.dictionary import Dictionary, Entry
from identification.diagnosis.projection import Base
from identification.diagnosis.search import Hypothesis, Survey, base_at, searched
from identification.fit.load_test import LoadTest
from identification.fit.posterior import posterior
from identification.measurements import read_measurements
from identification.model.cell import read_cell
from tests.support import CELL, measurement_text, random_poses, write_cell

Array = NDArray[np.float64]
ROWS, VISIT = 12, np.repeat(np.arange(3), 4)
# A cause is 1.5 typical sizes large, one standard deviation, eight in a hundred four times, two sixteen times as large.
SIZES = ((0.9, 1.5), (0.08, 6.0), (0.02, 24.0))


def flat(columns: Array) -> Array:
    return columns.reshape(3 * ROWS, -1)


def log_density(values: Array, covariance: Array) -> float:
    """Of normal numbers, without its constant."""
    return -0.5 * float(np.linalg.slogdet(covariance)[1] + values @ np.linalg.solve(covariance, values))


def total(logs: Array) -> float:
    return float(np.log(np.sum(np.exp(logs))))


@dataclass(frozen=True, eq=False)
class Noise:
    """Of this covariance; what visits may do by themselves is told as it is seen."""

    covariance: Array

    def apply(self, columns: Array) -> Array:
        return np.asarray(np.linalg.solve(self.covariance, flat(columns)).reshape(columns.shape))

    def freed(self, moved: Array) -> Noise:
        each = [flat(moved * np.equal(VISIT, number)[:, None, None]) for number in range(3)]
        return Noise(self.covariance + sum(one @ one.T for one in each))


class World:
    """Play and a soft zone of gear 2, which imitate each other, and its friction; a base that rocks, a bearing, play of gear 5,
    something that no row shows, and a hook. A force error decides what gear 2 does in the second visit."""

    def __init__(self, seed: int, links: bool = True) -> None:
        rng = np.random.default_rng(seed)
        root = rng.standard_normal((3 * ROWS, 3 * ROWS))
        self.covariance = root @ root.T / (3 * ROWS) + 0.5 * np.eye(3 * ROWS)
        shapes = (("play", 2, "gives", (1, 1)), ("soft", 2, "gives", (1, 2)), ("friction", 2, "", (1,)),
                  ("rocking", None, "", (3,)), ("tilt", 4, "", (1,)), ("play", 5, "gives", (1,)), ("faint", None, "", (1,)),
                  ("hook", 2, "", (1,)))
        entries: list[Any] = []
        signatures: list[Any] = []
        for name, joint, family, widths in shapes:
            effect: Any = SimpleNamespace(
                name=name, stored=name, law_family=family, gear_law=name in ("play", "soft", "friction"), where={},
                near_laws=("soft",) if name == "play" and joint == 2 else (), carries_weight=name == "hook",
                undecided=lambda state, joint, own=(name, joint): (VISIT == 1) & (own in (("play", 2), ("friction", 2))),
                typical=lambda state, joint, own=name: np.array([{"play": 3.0, "friction": 5.0}.get(own, 1.0)]))
            entries.append(Entry(effect, joint, range(len(signatures), len(signatures) + len(widths))))
            first = len(signatures)
            signatures += [SimpleNamespace(effect=effect, weight=0.0, scale=np.full(width, 0.5 + first + k), width=width)
                           for k, width in enumerate(widths)]
        every = np.array([each.width for each in signatures])
        columns = rng.standard_normal((ROWS, 3, every.sum()))
        columns[:, :, 11] *= 1e-3                    # what no row shows
        self.dictionary = Dictionary(tuple(entries), tuple(signatures), columns, every, np.zeros(len(every), dtype=bool), {})
        self.state: Any = type("State", (), {
            "wrench": rng.normal(0, 100, (ROWS, 6)), "jacobian": 0.1 * rng.standard_normal((ROWS, 6, 6)), "visit": VISIT,
            "robot": SimpleNamespace(link_mass=np.ones(6) if links else None), "__len__": lambda self: ROWS})()
        # Play of gear 2 a little otherwise than its law, and a base that rocks, in typical sizes.
        residual = 2.0 * columns[:, :, 0] + 0.7 * columns[:, :, 1] + columns[:, :, 6:9] @ np.array([1.2, -0.8, 0.5])
        residual += rng.standard_normal((ROWS, 3))
        self.base = Base(rng.standard_normal((ROWS, 3, 2)), residual, Noise(self.covariance), np.array([[4.0, 1], [1, 2]]),
                         np.array([0.3, -0.2]))
        self.ways = rng.standard_normal((ROWS, 3, 1))

    def column(self, s: int) -> Array:
        start = int(self.dictionary.widths[:s].sum())
        return flat(self.dictionary.columns[:, :, start: start + int(self.dictionary.widths[s])])

    @property
    def left(self) -> Array:
        return self.base.residual.ravel() - flat(self.base.design) @ self.base.shift

    def plain(self) -> Array:
        """What the readings scatter by, the springs free."""
        design = flat(self.base.design)
        return self.covariance + design @ np.linalg.inv(self.base.precision) @ design.T

    def by_visit(self) -> Array:
        """What gear 2 may do at each pose by itself: rest on a side, or turn round with the load, 1.5 times its largest typical
        size wide, in the rows in which nobody can tell."""
        force = self.state.wrench[:, :3]
        sign = [np.sign(row[np.argmax(np.abs(row))]) for row in force]
        added = np.zeros((3 * ROWS, 3 * ROWS))
        for turns in (np.ones(ROWS), np.array(sign)):
            one = (5.0 * self.state.jacobian[:, :3, 1] * ((VISIT == 1) * turns)[:, None]).ravel()
            added += 1.5**2 * np.outer(one, one)
        return added

    def mixture(self, signatures: list[int], size: float) -> Array:
        """Three tenths of a gear's size by all laws that imitate each other together, each alike, by their first columns."""
        first = {0: 0.5, 1: 0.5, 2: 2.5, 3: 2.5, 7: 7.5}
        each = [self.column(s)[:, :1] / first[s] for s in signatures]
        return np.asarray((0.3 * size) ** 2 / len(each) * sum(one @ one.T for one in each))

    def evidence(self, covariance: Array, s: int) -> float:
        column, nothing = self.column(s), log_density(self.left, covariance)
        return total(np.array([np.log(share) + log_density(self.left, covariance + size**2 * column @ column.T) - nothing
                               for share, size in SIZES]))

    def size(self, covariance: Array, s: int) -> float:
        """Of its first coefficient, by itself."""
        column = self.column(s)
        weighted = np.linalg.solve(covariance, column)
        return abs(float(np.linalg.solve(weighted.T @ column, weighted.T @ self.left)[0]))

    def looked_at(self, covariance: Array) -> Array:
        """ln of how much likelier the readings are with each signature: laws of gear 2 share out what they have together by the
        rows that tell, then those that imitate each other by what tells them apart whatever the gear's real law."""
        value = np.array([self.evidence(covariance, s) for s in range(10)])
        share = np.log([0.5, 0.5, 0.5, 0.5, 1, 1, 1, 1, 1, 1])
        amplitude = {0: 0.5, 1: 0.5, 2: 2.5, 3: 2.5}
        decided = covariance + self.by_visit()
        for laws, beside in (([0, 1, 2, 3, 4], decided), ([0, 1, 2, 3], None)):
            if beside is None:
                best = max(laws, key=lambda s: value[s])
                if value[best] < 1.0:
                    continue
                beside = decided + self.mixture(laws, self.size(covariance, best) * amplitude[best])
            apart = np.array([self.evidence(beside, s) for s in laws])
            value[laws] = apart + total(value[laws] + share[laws]) - total(apart + share[laws])
        return value


def looked(world: World, monkeypatch: pytest.MonkeyPatch, hypothesis: Hypothesis) -> dict[int, Hypothesis]:
    """What each further cause comes to beside these; how a structure yields otherwise is made up, as large as its size says."""
    monkeypatch.setattr(Dictionary, "term", lambda self, state, s, size: (s, size))
    monkeypatch.setattr(search, "other_ways", lambda state, sight, terms: np.concatenate(
        [np.zeros((ROWS, 3, 0)), *(world.ways * float(size[-1]) for s, size in terms if s == 5)], axis=2))
    sight: Any = None
    scan = search._Scan(world.base, world.dictionary, world.state, sight)
    grown = scan.grown(hypothesis)
    assert all(each.entries[:-1] == hypothesis.entries and each.signatures[:-1] == hypothesis.signatures for each in grown)
    return {each.entries[-1]: each for each in grown}


OF_ENTRY = {0: [0, 1], 1: [2, 3], 2: [4], 3: [5], 4: [6], 5: [7], 7: [9]}


def held(found: dict[int, Hypothesis], value: Array, entries: list[int], before: float = 0.0) -> None:
    assert sorted(found) == entries
    for k in entries:
        members = OF_ENTRY[k]
        together = np.log(np.mean(np.exp(value[members])))
        assert found[k].log_evidence - before == pytest.approx(together, rel=1e-4, abs=1e-4), k
        assert found[k].signatures[-1] == max(members, key=lambda s: value[s])


@pytest.mark.parametrize("seed", [1, 2])
def test_alone_a_cause_is_as_likely_as_the_readings_are_with_it(monkeypatch: pytest.MonkeyPatch, seed: int) -> None:
    """All but what no row shows; laws of one gear by what tells them apart."""
    world = World(seed)
    found = looked(world, monkeypatch, Hypothesis((), (), 0.0))
    value = world.looked_at(world.plain())
    assert max(value[:4]) > 3.0
    held(found, value, [0, 1, 2, 3, 4, 5, 7])
    # Sharing out moves what each law has by more than is asked for here.
    alone = [world.evidence(world.plain(), s) for s in range(5)]
    assert np.abs(value[:5] - alone).max() > 0.05


@pytest.mark.parametrize(("times", "low", "high"), [(0.3, -3.0, 0.0), (1.07, 0.0, 1.0), (1.3, 1.0, 3.0)])
def test_laws_that_explain_nothing_share_out_nothing(
    monkeypatch: pytest.MonkeyPatch, times: float, low: float, high: float) -> None:
    """Those that imitate each other, under e times as likely as nothing: what they have by the rows that tell stays."""
    world = World(1)
    object.__setattr__(world.base, "residual", times * np.random.default_rng(4).standard_normal((ROWS, 3)))
    value = world.looked_at(world.plain())
    assert low < max(value[:4]) < high
    held(looked(world, monkeypatch, Hypothesis((), (), 0.0)), value, [0, 1, 2, 3, 4, 5, 7])


@pytest.mark.parametrize("links", [True, False])
def test_beside_a_law_of_a_gear_another_cause_explains_what_no_such_law_can(
    monkeypatch: pytest.MonkeyPatch, links: bool) -> None:
    """Beside play of gear 2: its shapes and those of the law near it, made as wide as it is large, three tenths of it by all
    that imitate it, what it may do at each pose where nobody can tell. No other law of the gear is looked for; in an arm of
    unknown weight nor is what carries one there."""
    world = World(1, links)
    plain = world.plain()
    best = Hypothesis((0,), (0,), 4.5)
    design = np.column_stack([flat(world.base.design), world.column(0)])
    precision = np.zeros((3, 3))
    precision[:2, :2], precision[2, 2] = world.base.precision, 1 / 1.5**2
    weighted = np.linalg.solve(world.covariance, design)
    pull = weighted.T @ world.base.residual.ravel() + np.append(world.base.precision @ world.base.shift, 0)
    size = abs(float(np.linalg.solve(weighted.T @ design + precision, pull)[2]))
    assert size > 1.5
    shapes = np.column_stack([world.column(s) for s in range(4)])
    covariance = plain + world.by_visit() + size**2 * shapes @ shapes.T
    covariance += world.mixture([0, 1, 2, 3], size * 0.5)
    value = np.array([world.evidence(covariance, s) for s in range(10)])
    held(looked(world, monkeypatch, best), value, [3, 4, 5, *([7] if links else [])], before=4.5)


@pytest.mark.parametrize(("entries", "signatures"), [((3,), (5,)), ((3, 7), (5, 9)), ((7, 3), (9, 5))])
def test_beside_a_structure_it_is_unsure_of_how_that_yields_otherwise(
    monkeypatch: pytest.MonkeyPatch, entries: tuple[int, ...], signatures: tuple[int, ...]) -> None:
    """Beside a base that rocks, and a hook: the columns of each as wide as it is large, 1.5 at least. The laws of gear 2 are
    shared out beside them, by the rows that tell: a hook at its joint is no law of it."""
    world = World(2)
    columns = [world.column(s) for s in signatures]
    design = np.column_stack([flat(world.base.design), *columns])
    precision = np.eye(design.shape[1]) / 1.5**2
    precision[:2, :2] = world.base.precision
    weighted = np.linalg.solve(world.covariance, design)
    pull = weighted.T @ world.base.residual.ravel()
    pull[:2] += world.base.precision @ world.base.shift
    size = np.linalg.solve(weighted.T @ design + precision, pull)[2:]
    covariance, place = world.plain(), 0
    for s, column in zip(signatures, columns, strict=True):
        own = size[place: place + column.shape[1]]
        covariance += max(1.5, float(np.linalg.norm(own))) ** 2 * column @ column.T
        if s == 5:
            covariance += own[-1] ** 2 * flat(world.ways) @ flat(world.ways).T
        place += column.shape[1]
    found = looked(world, monkeypatch, Hypothesis(entries, signatures, -2.0))
    held(found, world.looked_at(covariance), [k for k in OF_ENTRY if k not in entries], before=-2.0)


def test_how_likely_sets_are_stays_a_number_however_far_apart_they_are() -> None:
    """And each has its name; without some of them the others are weighed anew, and without any there is none."""
    entries: Any = SimpleNamespace(entries=[SimpleNamespace(label=label) for label in ("play[2]", "rocking", "creep")])
    nothing: Any = None
    hypotheses = [Hypothesis((0,), (0,), 5000.0), Hypothesis((1, 0), (1, 0), -3000.0), Hypothesis((2,), (2,), 4999.0)]
    seen = Survey(nothing, entries, nothing, tuple(hypotheses)).instead({frozenset({0}): hypotheses[0]})
    odds = np.exp(1.0)
    told = {seen.name(each): each.probability for each in seen.hypotheses}
    assert list(told) == ["play[2]", "creep", "rocking + play[2]"]
    assert list(told.values()) == pytest.approx([odds / (1 + odds), 1 / (1 + odds), 0.0])
    assert seen.without({frozenset({1})}) is seen
    less = seen.without({frozenset({2})})
    assert [seen.name(each) for each in less.hypotheses] == ["play[2]", "rocking + play[2]"]
    assert [each.probability for each in less.hypotheses] == pytest.approx([1.0, 0.0])
    beyond = seen.without(set(), frozenset({1, 0}))
    assert [seen.name(each) for each in beyond.hypotheses] == ["play[2]", "creep"]
    assert [seen.name(each) for each in seen.without(set(), frozenset({0})).hypotheses] == ["creep"]


def test_a_model_linearised_where_it_is_likeliest_has_no_further_to_go(tmp_path: Path) -> None:
    """Readings and prior pull it to nowhere; taken elsewhere it goes back there."""
    cell = read_cell(write_cell(tmp_path, CELL))
    rng = np.random.default_rng(3)
    theta, wrench = random_poses(cell.robot, 6, rng, share=0.6), np.zeros((6, 6))
    wrench[:, 2] = -rng.uniform(100, 300, 6)
    file = tmp_path / "measurements.csv"
    file.write_text(measurement_text(theta, wrench, rng.normal(0, 50, (6, 3)), pose=[f"P{k}" for k in range(6)]))
    fit = posterior(LoadTest.of(cell, read_measurements(file, cell.robot)))
    base = base_at(fit.data, fit.log_compliance, fit.at_map.noise, fit.weights)
    pulled = base.shift @ base.precision @ base.inverse
    assert np.abs(pulled).max() > 0.01
    np.testing.assert_allclose(base.step(base.residual), 0.0, atol=1e-3 * np.abs(pulled).max())
    near = fit.log_compliance + np.array([1e-3, -1e-3, 0, 1e-3, 0, -1e-3])
    base = base_at(fit.data, near, fit.at_map.noise, fit.weights)
    np.testing.assert_allclose(base.step(base.residual), fit.log_compliance - near, atol=4e-4)


def test_single_causes_and_pairs_stand_in_the_order_of_their_probability(monkeypatch: pytest.MonkeyPatch) -> None:
    """Ninety in a hundred times one of the eight acts, nine two of them, all alike beforehand."""
    world = World(1)
    monkeypatch.setattr(Dictionary, "term", lambda self, state, s, size: (s, size))
    monkeypatch.setattr(search, "other_ways", lambda state, sight, terms: np.zeros((ROWS, 3, 0)))
    sight: Any = None
    found = searched(world.base, world.dictionary, world.state, sight, 2).hypotheses
    prior = {1: np.log(0.9 / 8), 2: np.log(0.09 / 28)}
    weight = np.array([each.log_evidence + prior[len(each.entries)] for each in found])
    assert (np.diff(weight) <= 0).all()
    np.testing.assert_allclose([each.probability for each in found], np.exp(weight - total(weight)), rtol=1e-9)
    assert {len(each.entries) for each in found} == {1, 2}

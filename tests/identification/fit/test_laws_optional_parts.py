"""Whether forces were set up anew at each visit, and whether the sensor remembers: how likely each way is, against sums over a
fine grid of sizes with dense covariance matrices."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.stats import halfcauchy, multivariate_normal, norm

from identification.fit import optional_parts
from identification.fit.linearised import Linearised
from identification.fit.load_test import LoadTest
from identification.fit.noise import NoiseModel
from identification.fit.noise_parts import MEMORY, PARTS, SETUP, SetUp, VarianceComponents
from identification.fit.optional_parts import Way, asked_for, averaged_trials, possible
from identification.fit.posterior import posterior
from identification.fit.variance_components import Trials
from identification.measurements import read_measurements
from identification.model.cell import read_cell
from identification.model.compliance import equilibrium
from tests.support import random_poses

VISITS, ROWS = 4, 5
COUNT = VISITS * ROWS
VISIT = np.repeat(np.arange(VISITS), ROWS)
# Sizes in usual ones; what a set-up of the usual size does to a row, in sigmas of the sensor.
SENSOR, OPTIONAL = np.exp(np.linspace(-0.8, 1.0, 19)), np.exp(np.linspace(-4.6, 6.0, 41))
USUAL = 0.15


def noise() -> NoiseModel:
    """Nothing but the sensor, and what set-ups do to rows whose loads grow."""
    setups = np.zeros((COUNT, 3, 9))
    for k in range(9):
        setups[:, k % 3, k] = USUAL * np.tile(np.linspace(-1, 1, ROWS), VISITS) * (1 + k // 3)
    nothing = np.zeros((COUNT, 3, 3))
    return NoiseModel(np.tile(np.eye(3), (COUNT, 1, 1)), nothing, nothing, setups, np.ones((COUNT, 3), dtype=bool), VISIT,
                      np.zeros(3), (False,) * 6, (True, False, False, False, False, False))


def covariance(setups: np.ndarray, sensor: float, setup: float, rho: float) -> np.ndarray:
    """Dense (60, 60) of all readings, row by row, x y z."""
    same = VISIT[:, None] == VISIT
    apart = np.abs(np.subtract.outer(np.arange(COUNT), np.arange(COUNT)))
    own = sensor**2 * np.kron(np.where(same, rho**apart, 0.0), np.eye(3))
    shared = np.kron(same, np.ones((3, 3))) * (setups.reshape(3 * COUNT, -1) @ setups.reshape(3 * COUNT, -1).T)
    return own + setup**2 * shared


def evidence(residual: np.ndarray, design: np.ndarray, setups: np.ndarray | None, memory: bool) -> float:
    """Likelihood of the readings over all sizes, ln: sensor normal in ln with a scale of 0.7, heavier above as it is by
    contract, x normal of 1 sigma."""
    springs = design.reshape(3 * COUNT, -1)
    logs = np.log(SENSOR)
    heavier = (1 + (logs / 0.7) ** 2 / 4) ** -2.5
    sensor_prior = np.where(logs < 0, norm.pdf(logs / 0.7) / norm.pdf(0), heavier)
    optional = halfcauchy(scale=2.0).pdf(OPTIONAL) * OPTIONAL * np.log(OPTIONAL[1] / OPTIONAL[0])
    total = 0.0
    for size, weight in zip(OPTIONAL, optional, strict=True) if setups is not None or memory else [(0.0, 1.0)]:
        rho = 0.1 * size / (1 + 0.1 * size) if memory else 0.0
        base = covariance(np.zeros((COUNT, 3, 1)) if setups is None else setups, 1.0, 0.0, rho)
        for sensor, prior in zip(SENSOR, sensor_prior, strict=True):
            shared = covariance(setups, 0.0, size, 0.0) if setups is not None else 0.0
            dense = sensor**2 * base + shared + springs @ springs.T
            total += weight * prior * np.exp(multivariate_normal(np.zeros(3 * COUNT), dense).logpdf(residual.ravel()) + 60.0)
    return float(np.log(total))


# Long: the same where nothing was set up anew, or each component by itself.
@pytest.mark.parametrize(("setup", "sized"), [
    *(pytest.param(size, False, marks=pytest.mark.long) for size in (0.0, 2.0, 5.0)), (5.0, True)])
def test_each_way_weighs_what_it_is_worth(setup: float, sized: bool) -> None:
    rng, model = np.random.default_rng(12), noise()
    design = rng.normal(size=(COUNT, 3, 2))
    stretched = model.setups[:, :, ::4]
    in_size = stretched.sum(axis=2, keepdims=True)
    drawn = covariance(in_size if sized else stretched, 1.0, setup, 0.0)
    residual = rng.multivariate_normal(np.zeros(3 * COUNT), drawn).reshape(COUNT, 3)
    prior: Any = SimpleNamespace(precision=lambda x: np.eye(2), gradient=lambda x: np.zeros(2))
    at = Linearised(model, design, residual, np.ones(COUNT), prior, np.zeros(2))
    trials = averaged_trials(at, VarianceComponents(), np.zeros((COUNT, 3, 0)))
    of_kinds = [evidence(residual, design, each, False) - np.log(3.0) for each in (in_size, stretched, model.setups)]
    kinds = [trials.weight[(trials.set_up == kind) & (trials.logs[:, 4] > -4.59) & (trials.logs[:, 5] <= -4.59)].sum()
             for kind in SetUp]
    likely = np.array(of_kinds) > max(of_kinds) - 3
    assert_allclose(np.log(np.array(kinds)[likely] / max(kinds)), np.array(of_kinds)[likely] - max(of_kinds), atol=0.15)
    ways = {(True, False): np.logaddexp.reduce(of_kinds),
            (False, True): evidence(residual, design, None, True), (False, False): evidence(residual, design, None, False)}
    share = {way: float(trials.weight[np.all((trials.logs[:, 4:] > -4.59) == way, axis=1)].sum()) for way in ways}
    assert trials.weight.sum() == pytest.approx(1)
    best = max(ways, key=lambda way: ways[way])
    for way, value in ways.items():
        if value > ways[best] - 4:
            assert np.log(share[way] / share[best]) == pytest.approx(value - ways[best], abs=0.15), way
        else:
            assert share[way] < 0.02, way


@pytest.mark.parametrize("kind", SetUp)
def test_the_way_that_is_asked_for_is_the_one_that_set_ups_follow(kind: SetUp) -> None:
    """Forces off by one share, each component by its own, or turned as well: taken for another way they pass for a cause. Where
    visits are alike none is asked for."""
    rng, model = np.random.default_rng(18), noise()
    stretched = model.setups[:, :, ::4]
    loading = {SetUp.SIZED: stretched.sum(axis=2, keepdims=True), SetUp.STRETCHED: stretched, SetUp.TURNED: model.setups}[kind]
    prior: Any = SimpleNamespace(precision=lambda x: np.eye(2), gradient=lambda x: np.zeros(2))
    design, none = rng.normal(size=(COUNT, 3, 2)), rng.normal(size=(COUNT, 3))
    drawn = none + 10.0 * np.einsum("nik,nk->ni", loading, rng.normal(size=(VISITS, loading.shape[2]))[VISIT])
    for residual in (none, drawn):
        at = Linearised(model, design, residual, np.ones(COUNT), prior, np.zeros(2))
        asked = asked_for(at, VarianceComponents(), np.zeros((COUNT, 3, 0)))
        # Where they differ by so much the neighbours in a visit are alike, too.
        assert (asked == Way((), SetUp.TURNED)) == (residual is none)
        assert residual is none or (SETUP in asked.parts and asked.set_up == kind)


def test_what_the_arm_s_weight_does_asks_for_no_other_set_ups() -> None:
    """Set-ups that stretch or turn the force otherwise at each pose would explain it as well, with as many numbers as there are
    poses (stretched by 35 usual sizes: ln 1.0 better than turned by 20)."""
    rng, model = np.random.default_rng(21), noise()
    in_size = model.setups[:, :, ::4].sum(axis=2, keepdims=True)
    pattern = rng.normal(size=(VISITS, 9, 3))
    weight = 20.0 * np.einsum("nik,nkm->nim", model.setups, pattern[VISIT])
    sized = 5.0 * in_size[:, :, 0] * rng.normal(size=VISITS)[VISIT][:, None]
    residual = rng.normal(size=(COUNT, 3)) + sized + weight @ rng.normal(size=3)
    prior: Any = SimpleNamespace(precision=lambda x: np.eye(2), gradient=lambda x: np.zeros(2))
    at = Linearised(model, rng.normal(size=(COUNT, 3, 2)), residual, np.ones(COUNT), prior, np.zeros(2))
    assert asked_for(at, VarianceComponents(), weight).set_up == SetUp.SIZED
    assert asked_for(at, VarianceComponents(), weight[:, :, :0]).set_up == SetUp.STRETCHED


PRIOR: Any = SimpleNamespace(precision=lambda x: np.eye(2), gradient=lambda x: np.zeros(2))
NONE = np.zeros((3 * VISITS, 3, 0))


def nothing_known(visits: int = VISITS) -> Linearised:
    """Rows of which no law below asks anything but how many visits they are."""
    model = noise()
    wide = np.repeat(np.arange(visits), 3)
    model = replace(model, visit=wide, setups=np.ones((len(wide), 3, 9)))
    return Linearised(model, np.zeros((len(wide), 3, 2)), np.zeros((len(wide), 3)), np.ones(len(wide)), PRIOR, np.zeros(2))


def way_of(model: NoiseModel) -> Way:
    return Way(tuple(part for part in (SETUP, MEMORY) if model.active[part]), model.set_up)


def rated(monkeypatch: pytest.MonkeyPatch, value: Callable[[Way, np.ndarray], float]) -> None:
    """The likelihood of the rows, ln, is this of which of the parts are there and the multiples (6,) of all parts."""
    monkeypatch.setattr(optional_parts, "ComponentPosterior", lambda at, beside: SimpleNamespace(
        likelihood=lambda logs: np.array([value(way_of(at.noise), np.exp(each)) for each in logs])))


@pytest.mark.parametrize("lower", [1.0, 0.5, 0.2])
@pytest.mark.parametrize(("gain", "asked"), [(2.9, False), (3.1, True)])
@pytest.mark.parametrize(("part", "kind"), [(SETUP, SetUp.SIZED), (SETUP, SetUp.STRETCHED), (SETUP, SetUp.TURNED),
                                            (MEMORY, SetUp.TURNED)])
def test_a_part_is_asked_for_that_is_worth_three_units_of_ln(
        monkeypatch: pytest.MonkeyPatch, part: int, kind: SetUp, gain: float, asked: bool, lower: float) -> None:
    """Beyond what it brings to have less of the parts that it is taken for: forces wrong by rows for either, and re-seating for
    a memory; none other is made smaller. Of the three ways of set-ups it is the best one that is asked for."""
    taken = (1, 2) if part == SETUP else (1, 2, 3)

    def value(way: Way, multiples: np.ndarray) -> float:
        expected = [lower if other in taken else 1.0 for other in range(4)]
        less = 20.0 * np.allclose(multiples[:4], expected)
        if way.parts != (part,):
            return less
        return less + (gain if way.set_up == kind else 2.0) - 10.0 * abs(np.log(multiples[part] / 5.0))

    rated(monkeypatch, value)
    assert asked_for(nothing_known(), VarianceComponents(), NONE) == (Way((part,), kind) if asked else Way((), SetUp.TURNED))


@pytest.mark.parametrize("size", [0.5, 1.5, 2.1, 3.0, 4.0, 5.0, 6.6, 9.0, 11.5, 15.0, 20.0, 27.0, 36.0, 50.0, 66.0])
def test_a_part_of_any_size_from_half_a_usual_one_is_seen(monkeypatch: pytest.MonkeyPatch, size: float) -> None:
    """Whose likelihood has gone again where it is a factor of 1.43 larger or smaller."""
    rated(monkeypatch, lambda way, multiples: 10.0 * (bool(way.parts) and abs(np.log(multiples[way.parts[0]] / size)) < 0.358))
    assert asked_for(nothing_known(), VarianceComponents(), NONE).parts == (SETUP, MEMORY)


@pytest.mark.parametrize(("unloaded", "visits", "parts"), [
    (0, [0] * 3 + [1] * 3, (SETUP, MEMORY)), (0, [0] * 3 + [1] * 2, ()), (1, [0] * 3 + [1] * 3, (MEMORY,)),
    (0, [0] * 2 + [1] * 2 + [2] * 2, ()), (0, [0] * 6, ())])
def test_parts_of_visits_show_from_two_visits_of_three_rows(unloaded: int, visits: list[int], parts: tuple[int, ...]) -> None:
    """Loaded ones for set-ups."""
    setups = np.ones((len(visits), 3, 9))
    setups[:unloaded] = 0
    assert possible(replace(noise(), visit=np.array(visits), setups=setups)) == parts


def averaged(monkeypatch: pytest.MonkeyPatch, evidence: Callable[[Way], float], top: Callable[[Way], float],
             visits: int = VISITS, whole: bool = True, components: VarianceComponents | None = None,
             ) -> tuple[Trials, dict[Way, tuple[Any, ...]]]:
    """The average over ways with this ln evidence and this ln posterior at its top; and for each way where the search for its
    components began and for how many ways its trials stand. Two trials a way, a quarter and three, sensor at ln 0.1 and 0.2."""
    told: dict[Way, tuple[Any, ...]] = {}
    monkeypatch.setattr(optional_parts, "ComponentPosterior", lambda at, beside: Posterior(way_of(at.noise)))

    class Posterior:
        def __init__(self, way: Way) -> None:
            self.way, self.whole = way, whole

        def __call__(self, logs: np.ndarray) -> tuple[np.ndarray, None]:
            return np.array([top(self.way)]), None

    def likeliest(of_way: Posterior, components: VarianceComponents) -> VarianceComponents:
        told[of_way.way] = (components.values,)
        return components

    def trial_components(of_way: Posterior, top: Any, covariance: Any, of: int = 1) -> Trials:
        told[of_way.way] = (*told.get(of_way.way, ()), of)
        logs = np.tile(np.log(1.5), (2, len(PARTS)))
        logs[:, 0] = 0.1, 0.2
        return Trials(logs, np.array([0.25, 0.75]), np.zeros((2, 1, 1)), evidence(of_way.way), np.full(2, of_way.way.set_up))

    monkeypatch.setattr(optional_parts, "likeliest", likeliest)
    monkeypatch.setattr(optional_parts, "log_covariance", lambda *of: None)
    monkeypatch.setattr(optional_parts, "trial_components", trial_components)
    beside = np.zeros((3 * visits, 3, 0))
    return averaged_trials(nothing_known(visits), components or VarianceComponents(), beside), told


EVERY = [Way(parts + memory, kind) for memory in ((), (MEMORY,)) for parts, kind in (
    ((), SetUp.TURNED), *(((SETUP,), kind) for kind in SetUp))]


def test_each_way_weighs_its_evidence_and_each_part_is_as_likely_as_not_beforehand(monkeypatch: pytest.MonkeyPatch) -> None:
    """The three ways of set-ups share what they have. What is not in a way is as small as a part can be."""
    by_chance = dict(zip(EVERY, np.random.default_rng(3).uniform(-1.5, 1.5, len(EVERY)), strict=True))
    for evidence in (dict.fromkeys(EVERY, 7.0), by_chance):
        trials, told = averaged(monkeypatch, evidence.__getitem__, lambda way: 0.0)
        assert set(told) == set(EVERY)
        each = {way: np.exp(evidence[way]) / (3 if SETUP in way.parts else 1) for way in EVERY}
        total = sum(each.values())
        assert trials.log_evidence == pytest.approx(np.log(total))
        assert trials.weight.sum() == pytest.approx(1.0)
        there = trials.logs[:, [SETUP, MEMORY]]
        assert_allclose(there[there > -4.6], np.log(1.5))
        assert there.min() == pytest.approx(-4.6)
        assert_allclose(trials.logs[:, 1:4], np.log(1.5))
        for way in EVERY:
            mine = np.all((there > -4.5) == [part in way.parts for part in (SETUP, MEMORY)], axis=1) & (
                (trials.set_up == way.set_up) | (SETUP not in way.parts))
            assert_allclose(trials.weight[mine], each[way] / total * np.array([0.25, 0.75]))
            assert_allclose(trials.logs[mine, 0], [0.1, 0.2])
            assert told[way][1] == 8
        assert trials.gram is not None
        assert len(trials.gram) == 16


@pytest.mark.parametrize(("beyond", "counts"), [(5.9, True), (6.1, False)])
@pytest.mark.parametrize("way", [EVERY[0], EVERY[2], EVERY[4]])
def test_a_way_that_is_far_less_likely_at_its_top_is_not_tried(
        monkeypatch: pytest.MonkeyPatch, way: Way, beyond: float, counts: bool) -> None:
    """By e^-6 of the best, beforehand with it."""
    best = Way((SETUP, MEMORY), SetUp.STRETCHED)
    own = {each: np.log(3.0) if SETUP in each.parts else 0.0 for each in EVERY}
    _, told = averaged(monkeypatch, lambda each: 0.0, lambda each: 40.0 + own[each] - (
        0.0 if each == best else beyond if each == way else 50.0))
    assert [each for each, of in told.items() if len(of) > 1] == ([way, best] if counts else [best])
    assert told[best][1] == 1 + counts


def test_the_search_for_the_size_of_a_part_begins_where_it_was_or_at_twice_the_usual(monkeypatch: pytest.MonkeyPatch) -> None:
    fitted = replace(VarianceComponents(), sensor=1.3, setup=7.0)
    _, told = averaged(monkeypatch, lambda way: 0.0, lambda way: 0.0, components=fitted)
    for way, (begins, _) in told.items():
        assert_allclose(begins, [1.3, 1, 1, 1, 7.0, 2.0 if MEMORY in way.parts else 0.0])


@pytest.mark.parametrize(("visits", "whole", "ways"), [(40, True, 8), (41, True, 1), (4, False, 1)])
def test_the_fit_s_own_way_stands_alone_where_rows_are_many(
        monkeypatch: pytest.MonkeyPatch, visits: int, whole: bool, ways: int) -> None:
    """Forty visits tell whether a part is there; of more rows than are looked at there is no evidence of all."""
    trials, told = averaged(monkeypatch, lambda way: 0.0, lambda way: 0.0, visits, whole)
    assert len(told) == ways
    assert len(trials.weight) == 2 * ways


def test_a_way_has_its_parts_and_none_of_the_other_optional_ones() -> None:
    """Whatever the fit had."""
    had = noise().with_parts(SETUP, MEMORY, set_up=SetUp.SIZED)
    assert Way((), SetUp.TURNED).noise(had).active == (True, False, False, False, False, False)
    found = Way((SETUP,), SetUp.STRETCHED).noise(had)
    assert (found.active, found.set_up) == ((True, False, False, False, True, False), SetUp.STRETCHED)
    assert Way((MEMORY,), SetUp.TURNED).noise(had).active == (True, False, False, False, False, True)


def test_a_weight_is_as_heavy_at_every_pose(tmp_path: Path) -> None:
    """Readings that are stretched from pose to pose by some per cent: loads set up anew may do that, known masses may not."""
    (tmp_path / "cell.yaml").write_text("robot: irb6660-205-1.90\ntool: {position_mm: [120, 0, 250]}\n"
                                        "measurement: {deflection_std_um: [2, 2, 2]}\n")
    cell, rng = read_cell(tmp_path / "cell.yaml"), np.random.default_rng(4)
    theta, mass = np.repeat(random_poses(cell.robot, 9, rng, 0.6), 5, axis=0), np.tile([20, 40, 60, 40, 20], 9)
    pull = np.outer(mass * 9.80665, [0, 0, -1, 0, 0, 0])
    read = equilibrium(cell.robot, theta, cell.flange_from_tcp, pull, 1 / cell.prior.stiffness).position
    read = read * np.repeat(rng.normal(1.0, 0.03, 9), 5)[:, None] + rng.normal(0, 2e-6, read.shape)

    def set_up_anew(columns: str, loads: np.ndarray) -> bool:
        table = np.column_stack([np.degrees(theta), loads, 1e6 * read])
        lines = ["q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg," + columns + ",dx_um,dy_um,dz_um",
                 *(",".join(f"{value:.9g}" for value in row) for row in table)]
        (tmp_path / "m.csv").write_text("\n".join(lines) + "\n")
        return posterior(LoadTest.of(cell, read_measurements(tmp_path / "m.csv", cell))).at_map.noise.active[SETUP]

    assert set_up_anew("fx_n,fy_n,fz_n", pull[:, :3])
    assert not set_up_anew("mass_kg", mass[:, None])

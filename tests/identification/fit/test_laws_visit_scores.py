"""How surprising a visit is that was off by so much, by hand: readings with next to no noise, one visit of them not fitted."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.stats import chi2

from identification.fit import mending, visits
from identification.fit.fitted_model import Term
from identification.fit.load_test import LoadTest
from identification.fit.posterior import Posterior, posterior
from identification.fit.slips import Slip
from identification.fit.visits import VisitScore, VisitTest, WrongAngle, _judged, _shared, score_visits
from identification.model.compliance import equilibrium
from identification.model.effects import effects
from tests.identification.fit.exact_rows import by_compliance
from tests.identification.fit.test_laws_posterior import TRUE, simulate

QUIET = """\
robot: irb6660-205-1.90
tool: {position_mm: [120, 0, 250]}
measurement: {deflection_std_um: [0.02, 0.02, 0.02], force_relative_std: 0.00001, force_std_n: [0.001, 0.001, 0.001],
  pose_offset_std_um: [0.02, 0.02, 0.02]}
"""
VISITS, SIZES = 12, np.array([100.0, -100.0, 200.0, -200.0, 300.0, -300.0])
# The visit that is not fitted, whose loads are along z.
LAST = VISITS - 1


@pytest.fixture(scope="module")
def springs(tmp_path_factory: pytest.TempPathFactory) -> tuple[LoadTest, Posterior]:
    """Loads of either sign along one axis at each pose, and what springs make of them; the fit of all visits but the last."""
    rng = np.random.default_rng(3)
    cell, rows = simulate(tmp_path_factory.mktemp("visits"), rng, poses=VISITS, loads=len(SIZES), text=QUIET)
    wrench = np.zeros((len(rows), 6))
    wrench[np.arange(len(rows)), rows.visit % 3] = np.tile(SIZES, VISITS)
    deflection = equilibrium(cell.robot, rows.theta, cell.flange_from_tcp, wrench, 1 / TRUE).position
    whole = LoadTest.of(cell, replace(rows, wrench=wrench, validate=rows.visit == LAST,
                                      deflection=deflection + 2e-8 * rng.standard_normal(deflection.shape)))
    return whole, posterior(whole.with_rows(whole.rows.select(~whole.rows.validate)))


def scored(data: LoadTest, fitted: Posterior, more: np.ndarray) -> VisitTest:
    """With so much more (n, 3) [m] in the last visit's readings."""
    deflection = data.rows.deflection + np.where(data.rows.validate[:, None], more, 0.0)
    return score_visits(fitted, data.with_rows(replace(data.rows, deflection=deflection)), np.random.default_rng(0), 0)


@pytest.mark.parametrize("off", [0.0, 0.01, 0.02])
def test_a_visit_s_forces_may_all_be_off_by_half_a_per_cent(springs: tuple[LoadTest, Posterior], off: float) -> None:
    """One sigma in each direction: a response that is off by so much of itself is that many of them off in one of three."""
    data, fitted = springs
    test = scored(data, fitted, off * data.rows.deflection)
    surprise = [score.surprise for score in test.scores]
    assert surprise[LAST] == pytest.approx(-np.log10(chi2.sf((off / 0.005) ** 2, 3)), abs=0.05, rel=0.03)
    assert max(surprise[:LAST]) < 0.02
    assert test.scale == 1.0
    assert test.p_value == pytest.approx(min(1.0, VISITS * chi2.sf((off / 0.005) ** 2, 3)), rel=0.2)
    assert [score.name for score in test.scores][LAST] == f"the pose from line {data.rows.line[data.rows.validate][0]}"
    assert test.scores[LAST].rows.tolist() == data.rows.row[data.rows.validate].tolist()


@pytest.mark.parametrize("times", [1.0, 1.6])
def test_a_named_cause_may_do_another_third_at_a_pose(springs: tuple[LoadTest, Posterior], times: float) -> None:
    """0.3 of what it does there, 1 sigma, beside the forces' error through the springs; without that it would be a surprise."""
    data, _ = springs
    effect, state = effects()["wrist_coupling"], data.load_state(1 / TRUE)
    neutral, typical = effect.neutral(state), effect.typical(state, None)
    does = effect.contribution(state, None, neutral + typical)[:, :3]
    data = data.with_rows(replace(data.rows, deflection=data.rows.deflection + does))
    fitted = posterior(data.with_rows(data.rows.select(~data.rows.validate)),
                       [Term(effect, None, neutral + typical, typical, neutral)])
    test = scored(data, fitted, times * does)
    mine = np.flatnonzero(data.rows.validate)
    per_newton = does[mine[-2]] / data.rows.wrench[mine[-2], LAST % 3]
    force = np.eye(3)
    of_springs = (by_compliance(np.repeat(data.rows.theta[mine[:1]], 3, axis=0), data.cell.flange_from_tcp.position, force)
                  / TRUE).sum(axis=2).T
    allowed = 0.005**2 * of_springs @ of_springs.T
    z = times**2 * per_newton @ np.linalg.solve(allowed + 0.3**2 * np.outer(per_newton, per_newton), per_newton)
    told = -np.log10(chi2.sf(z, 3))
    assert test.scores[LAST].surprise == pytest.approx(told, rel=0.05, abs=0.05)
    assert -np.log10(chi2.sf(times**2 * per_newton @ np.linalg.solve(allowed, per_newton), 3)) > 2 * told


def test_a_fitted_visit_is_held_against_the_fit_of_the_others(springs: tuple[LoadTest, Posterior]) -> None:
    """As surprising as where it was not fitted: what it tells of the springs itself is taken off. What is off at one visit is
    two in three of its own misfit, and of the others' none."""
    whole, _ = springs
    mine = whole.rows.visit == 4
    data = whole.with_rows(replace(whole.rows, validate=np.zeros(len(mine), dtype=bool), deflection=np.where(
        mine[:, None], 1.008 * whole.rows.deflection, whole.rows.deflection)))
    fitted, others = posterior(data), posterior(data.with_rows(data.rows.select(~mine)))
    with_it, without = (score_visits(fit, data, np.random.default_rng(0), 0) for fit in (fitted, others))
    assert len(with_it.scores) == len(without.scores) == VISITS
    told = [next(score for score in test.scores if score.rows[0] == data.rows.row[mine][0]) for test in (with_it, without)]
    assert told[0].surprise == pytest.approx(-np.log10(chi2.sf((0.008 / 0.005) ** 2, 3)), rel=0.1)
    assert told[1].surprise == pytest.approx(told[0].surprise, rel=0.05)
    misfit = np.sum((data.rows.deflection - others.predicted(data)) ** 2, axis=1)
    assert told[1].share == pytest.approx(misfit[mine].sum() / misfit.sum(), rel=0.01)


@pytest.mark.parametrize(("theta", "load", "machined", "told"), [
    (0.0, 100.0, "", True), (0.0, 0.0, "", False), (1e-6, 100.0, "", False), (0.0, 100.0, "pass", False)])
def test_a_visit_is_looked_at_that_stands_still_under_load(
        springs: tuple[LoadTest, Posterior], theta: float, load: float, machined: str, told: bool) -> None:
    rows = springs[0].rows
    mine = np.flatnonzero(rows.visit == 3)
    angles, wrench = rows.theta.copy(), np.zeros_like(rows.wrench)
    angles[mine[-1], 4] += theta
    wrench[mine[2], 1] = load
    passes = np.full(len(rows), machined, dtype=object)
    assert visits.testable(replace(rows, theta=angles, wrench=wrench, machined_pass=passes), mine) is told


def test_a_visit_is_named_by_its_label_or_its_first_line(springs: tuple[LoadTest, Posterior]) -> None:
    rows = springs[0].rows
    label = np.array([f"P{k}" for k in range(len(rows))], dtype=object)
    mine = np.flatnonzero(rows.visit == 3)
    assert visits.visit_name(replace(rows, pose=label), mine) == f"P{mine[0]}"
    bare = replace(rows, pose=np.full(len(rows), "", dtype=object))
    assert visits.visit_name(bare, mine) == f"the pose from line {rows.line[mine[0]]}"


def test_rows_count_little_that_count_under_three_tenths(
        springs: tuple[LoadTest, Posterior], monkeypatch: pytest.MonkeyPatch) -> None:
    """Of each visit by itself; of rows that were not fitted all count."""
    data, fitted = springs
    weight = np.ones(len(fitted.data.rows))
    weight[:4], weight[9] = [0.29, 0.31, 0.05, 0.5], 0.1
    monkeypatch.setattr(visits, "_matched", lambda fitted, numbers: weight[np.searchsorted(fitted.data.rows.row, numbers)])
    test = score_visits(fitted, data, np.random.default_rng(0), 0)
    assert [score.light for score in test.scores] == [2, 1] + (VISITS - 2) * [0]


def scores(count: int) -> list[VisitScore]:
    return [VisitScore(f"P{k}", np.array([k + 1]), k + 2, 0, 0.0, 1.0, 0.0, np.zeros(3), np.ones(3)) for k in range(count)]


def test_the_largest_surprise_is_held_against_that_of_replicates() -> None:
    """Each visit's z of as many directions as it tells, over the median of all in units of their own medians, one at least."""
    counts = np.array([3, 6, 3])
    squares = np.array([[9.0, 1.0, 8.0, 2.0, 30.0], [12.0, 5.0, 1.0, 3.0, 9.0], [1.0, 2.0, 3.0, 6.0, 20.0]])
    test = _judged(scores(3), squares, counts, 4)
    medians = chi2.isf(0.5, counts)
    scale = [max(1.0, float(np.median(column / medians))) for column in squares.T]
    surprise = np.array([[-np.log10(chi2.sf(z / by, n)) for z, by in zip(row, scale, strict=True)]
                         for row, n in zip(squares, counts, strict=True)])
    largest = surprise[:, 1:].max(axis=0)
    assert test.scale == pytest.approx(scale[0])
    assert scale[0] > 1
    for score, own in zip(test.scores, surprise[:, 0], strict=True):
        assert score.surprise == pytest.approx(own)
        assert score.p_value == (1 + np.count_nonzero(largest >= own)) / 5
    assert len({score.p_value for score in test.scores}) > 1
    assert (test.p_value, test.resolution) == (min(score.p_value for score in test.scores), 1 / 5)


def test_without_replicates_a_surprise_is_as_rare_as_any_visit_shows_it() -> None:
    test = _judged(scores(3), np.array([[16.0], [2.0], [0.5]]), np.array([3, 3, 3]), 0)
    told = [min(1.0, 3 * float(chi2.sf(z, 3))) for z in (16.0, 2.0, 0.5)]
    assert [score.p_value for score in test.scores] == pytest.approx(told)
    assert (test.p_value, test.resolution, test.scale) == (pytest.approx(told[0]), 0.0, 1.0)
    nothing = _judged([], np.zeros((0, 1)), np.zeros(0, dtype=int), 0)
    assert (nothing.scores, nothing.p_value, nothing.resolution) == ((), 1.0, 1.0)


@pytest.mark.parametrize(("weakest", "told"), [(0.9e-6, 5), (1.1e-6, 6)])
def test_a_visit_tells_the_directions_that_readings_see_to_a_millionth(weakest: float, told: int) -> None:
    """Of the information of its best; what no reading of it says is none."""
    columns = np.zeros((3, 3, 7))
    columns[0, :, :3], columns[1, :, 3:6] = np.eye(3), 0.5 * np.eye(3)
    columns[1, 1, 4] = np.sqrt(weakest)
    precision = np.tile(np.eye(3), (3, 1, 1))
    assert visits._directions(columns, precision) == told
    precision[0, 2, 2] = 0.0
    assert visits._directions(columns, precision) == told - 1


def test_a_visit_s_offset_is_told_by_its_largest_component() -> None:
    """In its own standard deviations; null where loads that do not differ cannot tell it."""
    one = replace(scores(1)[0], offset=np.array([1e-6, -9e-6, 5e-6]), offset_std=np.array([1e-6, 3e-6, 1e-6]))
    assert one.offset_sigmas == pytest.approx(5.0)
    assert one.as_dict()["offset_um"] == pytest.approx([1.0, -9.0, 5.0])
    assert one.as_dict()["offset_sigmas"] == pytest.approx(5.0)
    nothing = replace(one, offset=np.full(3, np.nan)).as_dict()
    assert (nothing["offset_um"], nothing["offset_sigmas"], nothing["wrong_angle"]) == (None, None, None)
    angle = WrongAngle(3, 2, np.radians(-10.0), np.radians(0.5), 12.0)
    assert replace(one, wrong_angle=angle).as_dict()["wrong_angle"] == pytest.approx(
        {"joint": 2, "missing_deg": -10.0, "std_deg": 0.5, "log_odds": 12.0})


def test_a_force_error_that_a_visit_s_readings_share_is_half_a_per_cent_of_each_load() -> None:
    """Of 20000 draws: in each direction alike, whatever the load's; alike within a visit, apart between two."""
    noise: Any = SimpleNamespace(visits=2, visit=np.array([0, 0, 1]))
    stiff, force = np.tile(np.diag([1.0, 2.0, 4.0]), (3, 1, 1)), np.array([[0, 0, 100.0], [0, 0, -50.0], [0, 0, 100.0]])
    drawn = _shared(stiff, force, noise, np.random.default_rng(0), 20000)
    assert drawn.shape == (3, 3, 20000)
    np.testing.assert_allclose(drawn[1], -0.5 * drawn[0], atol=1e-12)
    np.testing.assert_allclose(drawn[0].std(axis=1), [0.5, 1.0, 2.0], rtol=0.03)
    assert np.abs(np.corrcoef(np.concatenate([drawn[0], drawn[2]])) - np.eye(6)).max() < 0.04


@pytest.mark.parametrize("has_it", [True, False])
def test_a_visit_is_held_against_the_springs_and_what_a_named_cause_does_there(
        springs: tuple[LoadTest, Posterior], has_it: bool) -> None:
    """As it stands in the table: nothing is left of readings that have the cause, and all of it where they have not, against
    half a per cent of the force through the springs, three where the arm's own weight is not known."""
    data, _ = springs
    effect, state = effects()["wrist_coupling"], data.load_state(1 / TRUE)
    neutral, large = effect.neutral(state), 6 * effect.typical(state, None)
    does = effect.contribution(state, None, neutral + large)[:, :3]
    data = data.with_rows(replace(data.rows, deflection=data.rows.deflection + does))
    rest = posterior(data.with_rows(data.rows.select(~data.rows.validate)),
                     [Term(effect, None, neutral + large, large, neutral)])
    rows = data.rows.select(data.rows.validate)
    mine = np.flatnonzero(data.rows.validate)
    visit = mending._Visit(rest, rows if has_it else replace(rows, deflection=rows.deflection - does[mine]), 1.0)
    np.testing.assert_allclose(visit.expected, data.rows.deflection[mine], atol=1e-6)
    _, (misfit,) = visit.judged([Slip("a digit", "as it is", rows.theta[0])])
    per_newton = does[mine[-2]] / rows.wrench[-2, LAST % 3]
    of_springs = (by_compliance(np.repeat(rows.theta[:1], 3, axis=0), data.cell.flange_from_tcp.position, np.eye(3))
                  / TRUE).sum(axis=2).T
    whole = per_newton @ np.linalg.solve(0.03**2 * of_springs @ of_springs.T, per_newton)
    assert whole > 3
    assert misfit == pytest.approx(0.0 if has_it else whole, rel=0.15, abs=0.15)


@pytest.mark.parametrize(("links", "share"), [(True, 0.005), (False, 0.03)])
def test_a_slip_leaves_of_a_response_what_the_forces_or_the_arm_s_own_weight_may_do(
        springs: tuple[LoadTest, Posterior], links: bool, share: float) -> None:
    """Half a per cent where the robot file has links, else three; a pose that is as it is in the table leaves the response off
    by two per cent, or by none."""
    data, fitted = springs
    assert data.cell.robot.link_mass is None
    if links:
        robot = replace(data.cell.robot, link_mass=np.full(6, 1e-9), link_centre=np.zeros((6, 3)))
        data = LoadTest.of(replace(data.cell, robot=robot), data.rows)
        fitted = posterior(data.with_rows(data.rows.select(~data.rows.validate)))
    mine = data.rows.select(data.rows.validate)
    slip = Slip("a digit", "as it is", mine.theta[0])
    for off in (0.0, 0.02):
        visit = mending._Visit(fitted, replace(mine, deflection=(1 + off) * mine.deflection), 1.0)
        _, (misfit,) = visit.judged([slip])
        assert visit.directions == 3
        assert misfit == pytest.approx((off / share) ** 2, rel=0.05, abs=0.1)
        _, (scaled,) = mending._Visit(fitted, replace(mine, deflection=(1 + off) * mine.deflection), 4.0).judged([slip])
        assert scaled == pytest.approx(misfit / 4)

"""How surprising a visit is that was off by so much, by hand: readings with next to no noise, one visit of them not fitted."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

from identification.fit import mending
from identification.fit.fitted_model import Term
from identification.fit.load_test import LoadTest
from identification.fit.posterior import Posterior, posterior
from identification.fit.slips import Slip
from identification.fit.visits import VisitTest, score_visits
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

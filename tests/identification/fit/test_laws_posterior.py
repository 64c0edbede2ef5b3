"""The posterior: found again on independent data, exact where it can be, honest where the data say nothing."""

import re
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy import stats
from scipy.optimize import minimize

from benchmarks import fifth_arm
from identification.common.findings import CompstiffError
from identification.fit import posterior as posteriors
from identification.fit.fit import fit_stiffness
from identification.fit.fitted_model import response
from identification.fit.linear_start import check_sign
from identification.fit.load_test import LoadTest
from identification.fit.marginal import Draws, _log_posterior, _with_unseen
from identification.fit.priors import PriorModel
from identification.fit.sag import sag_columns
from identification.measurements import Measurements, read_measurements
from identification.model.cell import Cell, read_cell
from identification.model.compliance import equilibrium, regressor
from identification.model.load_state import load_state
from tests.support import measurement_text, random_poses, write_cell
from tests.virtual_cell.arm import IRB6660

TRUE = np.array([1.4e6, 4.5e6, 1.5e6, 0.35e6, 0.25e6, 0.09e6])
NOISY = """\
robot: irb6660-205-1.90
tool: {position_mm: [120, 0, 250]}
measurement: {deflection_std_um: [2, 2, 2], force_relative_std: 0.01, force_std_n: [1, 1, 1], pose_offset_std_um: [4, 4, 4]}
"""


def simulate(folder: Path, rng: np.random.Generator, *, poses: int = 12, loads: int = 3, directions: str = "xyz",
             text: str = NOISY, quiet: bool = False, independent: bool = False) -> tuple[Cell, Measurements]:
    """Load tests under the noise the cell file states; by the independent arm where asked for."""
    cell = read_cell(write_cell(folder, text))
    theta = np.repeat(random_poses(cell.robot, poses, rng, share=0.6), loads, axis=0)
    wrench = np.zeros((len(theta), 6))
    axes = np.array(["xyz".index(direction) for direction in directions])
    wrench[np.arange(len(theta)), rng.choice(axes, len(theta))] = rng.choice([-300, -200, 200, 300], len(theta))
    applied = wrench.copy()
    noise = cell.noise
    if not quiet:
        applied[:, :3] += (noise.force * rng.standard_normal((len(theta), 3))
                           + noise.force_relative * wrench[:, :3] * rng.standard_normal((len(theta), 3)))
    if independent:
        tcp = cell.flange_from_tcp.position
        deflection = np.array([IRB6660.deviation(q, tcp, w, TRUE)[0] for q, w in zip(theta, applied, strict=True)])
    else:
        deflection = equilibrium(cell.robot, theta, cell.flange_from_tcp, applied, 1 / TRUE).position
    if not quiet:
        deflection = deflection + noise.deflection * rng.standard_normal(deflection.shape) + np.repeat(
            noise.pose_offset * rng.standard_normal((poses, 3)), loads, axis=0)
    path = folder / "measurements.csv"
    path.write_text(measurement_text(theta, wrench, 1e6 * deflection))
    return cell, read_measurements(path, cell.robot)


def test_noiseless_data_of_the_independent_arm_give_the_true_stiffnesses(tmp_path) -> None:
    fine = NOISY.replace("[2, 2, 2]", "[0.001, 0.001, 0.001]").replace("0.01,", "0,").replace("[1, 1, 1]", "[0, 0, 0]").replace(
        "[4, 4, 4]", "[0, 0, 0]")
    cell, rows = simulate(tmp_path, np.random.default_rng(1), text=fine, quiet=True, independent=True)
    assert_allclose(fit_stiffness(cell, rows).model.stiffness, TRUE, rtol=1e-4)


def test_the_map_is_the_minimum(tmp_path) -> None:
    """Against SciPy's minimiser of the written-out posterior, dense covariance, variance components as estimated."""
    cell, rows = simulate(tmp_path, np.random.default_rng(2), poses=4)
    fit = fit_stiffness(cell, rows)
    found = fit.posterior
    assert np.all(found.row_weight == 1)
    c = np.exp(found.map)
    columns = regressor(cell.robot, rows.theta, cell.flange_from_tcp, rows.wrench)
    covariance = np.zeros((3 * len(rows), 3 * len(rows)))
    for i in range(len(rows)):
        # First-order compliance from the unit forces' regressors, row by row.
        unit = np.zeros((3, 6))
        unit[range(3), range(3)] = 1.0
        matrix = np.column_stack([regressor(cell.robot, rows.theta[i:i + 1], cell.flange_from_tcp, w[None])[0, :3] @ c
                                  for w in unit])
        force = ((found.components.absolute * cell.noise.force)**2
                 + (found.components.force * cell.noise.force_relative * rows.wrench[i, :3])**2)
        own = slice(3 * i, 3 * i + 3)
        covariance[own, own] += (matrix @ np.diag(force) @ matrix.T
                                 + found.components.sensor**2 * np.diag(cell.noise.deflection**2))
        for j in np.flatnonzero(rows.visit == rows.visit[i]):
            covariance[own, 3 * j:3 * j + 3] += found.components.offset**2 * np.diag(cell.noise.pose_offset**2)
    weight = np.linalg.inv(covariance)
    centre, width = -np.log(cell.prior.stiffness), cell.prior.log_std

    def objective(x: np.ndarray) -> float:
        predicted = equilibrium(cell.robot, rows.theta, cell.flange_from_tcp, rows.wrench, np.exp(x)).position
        r = (rows.deflection - predicted).ravel()
        return float(0.5 * r @ weight @ r + 0.5 * np.sum(((x - centre) / width) ** 2))

    best = minimize(objective, -np.log(TRUE), method="BFGS", options={"gtol": 1e-9})
    assert np.max(np.abs(found.map - best.x) / fit.model.log_std) < 0.03
    # Averaging over the variance components and the shape of the prior moves the centre by less than its uncertainty.
    assert np.max(np.abs(fit.model.mean - found.map) / fit.model.log_std) < 0.6
    assert columns.shape == (len(rows), 6, 6)


def test_the_likeliest_springs_are_those_with_the_weight_free_beside_them(tmp_path) -> None:
    """At the top of the likelihood over springs and weight together the rows pull at neither; the plain MAP is none."""
    cell, rows = simulate(tmp_path, np.random.default_rng(8), poses=16)
    bare = fit_stiffness(cell, rows).posterior
    hanging = np.linalg.inv(bare.at_map.noise.whitening) @ sag_columns(bare.load_state, bare.at_map.noise)
    rows = replace(rows, deflection=rows.deflection + hanging.sum(axis=2))
    found = fit_stiffness(cell, rows).posterior
    noise, weights = found.at_map.noise, found.weights
    weight = sag_columns(found.load_state, noise)

    def pull(x: np.ndarray) -> np.ndarray:
        """On the springs, in their own standard deviations, the weight where it is likeliest with these springs."""
        position, slope = response(found.data, x)
        residual = noise.whitened((rows.deflection - position)[:, :, None])
        taken = np.linalg.solve(weights.inner(weight, weight) + np.eye(11), weights.inner(weight, residual))
        left = residual - (weight @ taken)
        return np.sqrt(np.diag(found.laplace)) * (weights.inner(noise.whitened(slope), left)[:, 0] - found.prior.gradient(x))

    assert np.abs(pull(found.map)).max() > 0.2
    assert np.abs(pull(found.likeliest)).max() < 0.01


@pytest.mark.parametrize("name", ["irb6660-205-1.90", "irb6700-235-2.65"])
def test_what_a_heavy_arm_does_beside_a_light_one_lies_in_the_columns_of_its_weight(tmp_path, name) -> None:
    """By another arm's finite motions, whose links, wrist and spindle are heavy: with a parallel rod and in series. Each column
    takes part by no more than is expected of it."""
    rng, tool = np.random.default_rng(31), np.array([0.12, 0.03, 0.25])
    cell = read_cell(write_cell(tmp_path, f"robot: {name}\ntool: {{position_mm: [120, 30, 250]}}\n"))
    arm = fifth_arm.arm_of(name, tool)
    theta, wrench = random_poses(cell.robot, 25, rng, share=0.5), np.zeros((25, 6))
    wrench[:, :3] = rng.normal(0, 500, (25, 3))

    def moved(weight: float) -> np.ndarray:
        loaded, bare = (fifth_arm.equilibrium(arm, fifth_arm.springs(arm.prior, weight), theta, force).tcp
                        for force in (wrench[:, :3], 0 * wrench[:, :3]))
        return loaded - bare

    state = load_state(cell.robot, cell.flange_from_tcp, theta, wrench, 1 / arm.prior)
    columns = sag_columns(state, SimpleNamespace(whitened=lambda moved: moved)).reshape(75, 11)
    wanted = (moved(1.0) - moved(0.0)).ravel()
    share, *_ = np.linalg.lstsq(np.vstack([columns, 1e-8 * np.eye(11)]), np.append(wanted, np.zeros(11)), rcond=None)
    assert np.linalg.norm(wanted - columns @ share) < 0.03 * np.linalg.norm(wanted)
    assert np.abs(share).max() < 3


def test_the_draws_weigh_by_the_posterior_itself() -> None:
    """Differences between draws by SciPy's densities: log-normal springs, normal effects, a likelihood Gaussian in c; none
    beyond a bound."""
    rng = np.random.default_rng(12)
    prior = PriorModel(SimpleNamespace(stiffness=TRUE, log_std=np.linspace(0.3, 0.8, 6)), term_mean=np.array([0.2, -1.0]),
                       term_std=np.array([0.5, 2.0]), term_low=np.array([-3.0, -9.0]), term_high=np.array([3.0, 9.0]))
    x = np.concatenate([-np.log(TRUE) + 0.1, [0.3, 0.4]])
    draws = x + 0.2 * rng.standard_normal((40, 8))
    draws[7, 6] = 3.01
    root, pull = rng.standard_normal((40, 8, 8)), 3 * rng.standard_normal((40, 8))
    information = root @ np.swapaxes(root, 1, 2)
    found = _log_posterior(draws, x, information, pull, prior)
    step = np.column_stack([np.exp(draws[:, :6]) / np.exp(x[:6]) - 1, draws[:, 6:] - x[6:]])
    peak = np.linalg.solve(information, pull[:, :, None])[:, :, 0]
    wanted = np.array([stats.multivariate_normal(peak[k], np.linalg.inv(information[k])).logpdf(step[k])
                       - stats.multivariate_normal(peak[k], np.linalg.inv(information[k])).logpdf(np.zeros(8))
                       for k in range(40)])
    wanted += stats.norm(-np.log(TRUE), prior.prior.log_std).logpdf(draws[:, :6]).sum(axis=1)
    wanted += stats.norm(prior.term_mean, prior.term_std).logpdf(draws[:, 6:]).sum(axis=1)
    inside = np.arange(40) != 7
    assert found[7] == -np.inf
    assert (found - found[0])[inside] == pytest.approx((wanted - wanted[0])[inside], rel=1e-6, abs=1e-6)


# Long: test_laws_calibration.py asks the same of more data sets, which are smaller.
@pytest.mark.long
def test_coverage_under_the_stated_noise(tmp_path) -> None:
    """30 data sets: the 95 % intervals of six stiffnesses hold the truth, the ellipsoid likewise; ranks over 120 are
    test_laws_calibration.py's."""
    inside, distance = [], []
    for seed in range(30):
        cell, rows = simulate(tmp_path, np.random.default_rng(100 + seed), poses=8)
        model = fit_stiffness(cell, rows).model
        low, high = model.interval_95.T
        inside.append((low <= TRUE) & (high >= TRUE))
        off = model.mean + np.log(TRUE)
        distance.append(off @ np.linalg.solve(model.covariance, off))
    # 180 intervals, correlated in sixes: two standard errors of the binomial with a third as many.
    assert 0.90 < np.mean(inside) < 0.99
    assert np.mean(np.array(distance) <= 12.59) > 0.87       # chi-squared, 6 degrees of freedom, 95 %


def test_a_scaled_model_s_intervals_are_scaled(tmp_path) -> None:
    """Compliances found 1.1 times as large, known to 2 %: the intervals move by it and widen, and are not the old ones."""
    model = fit_stiffness(*simulate(tmp_path, np.random.default_rng(1))).model
    assert model.interval is not None
    scaled = model.scaled(1.1, 0.022)
    ratio = np.log(scaled.interval_95[:, 1] / scaled.interval_95[:, 0])
    assert_allclose(np.sqrt(scaled.interval_95.prod(axis=1)), model.stiffness / 1.1, rtol=1e-9)
    assert_allclose(ratio, 2 * 1.959964 * np.hypot(model.log_std, 0.02), rtol=1e-6)


def test_grades_say_how_far_the_prior_shrank(tmp_path) -> None:
    """Not identifiable where the data took less than a third of the prior's uncertainty, reliable where k is known to a fifth.
    Sensors from fine to useless, so that all three occur, and some shrink, but by less than a third."""
    seen, partly = set(), 0
    for microns in (2, 60, 200, 600):
        cell, rows = simulate(tmp_path, np.random.default_rng(7), poses=6, text=NOISY.replace("[2, 2, 2]", str([microns] * 3)))
        model = fit_stiffness(cell, rows).model
        shrunk = model.log_std / cell.prior.log_std
        for ratio, std, grade in zip(shrunk, model.log_std, model.grades, strict=True):
            assert grade == ("not identifiable" if ratio > 2 / 3 else "reliable" if std <= 0.2 else "tentative"), (ratio, std)
            seen.add(grade)
            partly += 2 / 3 < ratio < 0.95
    assert seen == {"not identifiable", "tentative", "reliable"}
    assert partly > 2


def test_the_paper_s_x_only_data_say_nothing_of_joint_6(tmp_path) -> None:
    """Forces along x in the plane of the arm, as in the paper: joints 1, 4 and 6 stay at the prior and are graded so."""
    cell = read_cell(write_cell(tmp_path, "robot: irb6660-205-1.90\ntool: {position_mm: [0, 0, 250]}\n"))
    theta = np.radians([[0.0, q2, q3, 0, q5, 0] for q2, q3, q5 in [(0, 20, 60), (10, 30, 40), (20, 30, 80), (-10, 20, 50)]])
    wrench = np.tile([300.0, 0, 0, 0, 0, 0], (4, 1))
    deflection = equilibrium(cell.robot, theta, cell.flange_from_tcp, wrench, 1 / TRUE).position
    path = tmp_path / "m.csv"
    path.write_text(measurement_text(theta, wrench, 1e6 * deflection))
    fit = fit_stiffness(cell, read_measurements(path, cell.robot))
    for joint in (0, 3, 5):
        assert fit.model.grades[joint] == "not identifiable"
        assert_allclose(fit.model.stiffness[joint], cell.prior.stiffness[joint], rtol=1e-9)
        assert_allclose(fit.model.log_std[joint], cell.prior.log_std[joint], rtol=1e-9)
    unseen = [finding for finding in fit.findings if finding.code == "CS1012"]
    assert [finding.message[:2] for finding in unseen] == ["k1", "k4", "k6"]
    assert all("was never loaded" in finding.message for finding in unseen)
    assert all("would bring the uncertainty" in finding.hint for finding in unseen)


def test_validation_rows_are_never_fitted(tmp_path) -> None:
    cell, rows = simulate(tmp_path, np.random.default_rng(3))
    validate = rows.visit >= 8
    spoiled = rows.deflection.copy()
    spoiled[validate] *= 3
    kept = fit_stiffness(cell, replace(rows, validate=validate))
    again = fit_stiffness(cell, replace(rows, validate=validate, deflection=spoiled))
    assert_allclose(again.model.mean, kept.model.mean, rtol=0, atol=0)
    assert kept.held_out is not None
    assert again.held_out is not None
    assert kept.held_out[1] < kept.held_out[0]
    assert again.held_out[1] > 10 * kept.held_out[1]


def test_empty_components_carry_no_weight(tmp_path) -> None:
    cell, rows = simulate(tmp_path, np.random.default_rng(4))
    deflection = rows.deflection.copy()
    deflection[::2, 1] = np.nan
    fit = fit_stiffness(cell, replace(rows, deflection=deflection))
    assert np.all(np.abs(fit.model.mean + np.log(TRUE)) < 4 * fit.model.log_std)
    # Only the y readings of half of the rows are gone: at the same noise the uncertainty grows, never falls.
    whole = fit_stiffness(cell, rows)
    components = fit.posterior.components
    kept = [np.diag(np.linalg.inv(f.posterior.at_map.noise.weights(components).inner(
        f.posterior.at_map.design, f.posterior.at_map.design))) for f in (fit, whole)]
    assert np.all(kept[0] >= 0.999 * kept[1])


def test_larger_noise_than_stated_widens_the_intervals_and_is_said(tmp_path) -> None:
    cell, rows = simulate(tmp_path, np.random.default_rng(5))
    loud = rows.deflection + 3e-5 * np.random.default_rng(6).standard_normal(rows.deflection.shape)
    fit = fit_stiffness(cell, replace(rows, deflection=loud))
    assert fit.posterior.components.sensor > 3
    assert fit.posterior.components.offset < 3
    assert any(finding.code == "CS1013" for finding in fit.findings)
    assert np.all(np.abs(fit.model.mean + np.log(TRUE)) < 4 * fit.model.log_std)


def test_far_smaller_noise_than_stated_is_said(tmp_path) -> None:
    """A sensor's noise in nanometres: a hundred times what the readings show."""
    cell, rows = simulate(tmp_path, np.random.default_rng(5))
    stated = replace(cell, noise=replace(cell.noise, deflection=100 * cell.noise.deflection, deflection_stated=True))
    told = {seen: {finding.code for finding in fit_stiffness(seen, rows).findings} for seen in (cell, stated)}
    assert "CS1042" not in told[cell]
    assert "CS1042" in told[stated]


def test_the_sign_turned_round_is_refused(tmp_path) -> None:
    cell, rows = simulate(tmp_path, np.random.default_rng(7))
    with pytest.raises(CompstiffError, match="CS1010.*against the force") as caught:
        fit_stiffness(cell, replace(rows, wrench=-rows.wrench))
    assert "ON the tool" in caught.value.findings[0].hint


def test_one_joint_that_moves_with_the_force_is_no_wrong_sign(tmp_path) -> None:
    """Deflections of the independent arm, joint by joint, against the force in all but one, whose spring is a third as stiff as
    assumed: that is another mistake, and no turned sign. The best factor on all of them is negative still."""
    cell, rows = simulate(tmp_path, np.random.default_rng(21), poses=6, loads=2, quiet=True)
    each = np.array([[IRB6660.deviation(q, cell.flange_from_tcp.position, w, np.where(one, TRUE, 1e15))[0]
                      for q, w in zip(rows.theta, rows.wrench, strict=True)] for one in np.eye(6, dtype=bool)])
    data = LoadTest.of(cell, rows)
    for along in (0, 3):
        check_sign(data, np.einsum("jni,j->ni", each, np.where(np.arange(6) == along, 3.0, -1.0)))
    with pytest.raises(CompstiffError, match="CS1010"):
        check_sign(data, -each.sum(axis=0))


def test_readings_that_show_nothing_have_no_wrong_sign(tmp_path) -> None:
    """Loads of a newton under micrometres of noise: the springs stay those of the prior, whatever sign the noise has."""
    cell, rows = simulate(tmp_path, np.random.default_rng(12))
    noise = 3e-6 * np.random.default_rng(13).standard_normal(rows.deflection.shape)
    for sign in (1, -1):
        fit = fit_stiffness(cell, replace(rows, wrench=1e-3 * rows.wrench, deflection=sign * noise))
        assert not set(fit.model.grades) & {"reliable"}


@pytest.mark.parametrize("loaded", [0, 1])
def test_only_validation_rows_that_are_loaded(tmp_path, loaded) -> None:
    """The zeros alone tell nothing of a spring; one load is little, and no spring is called reliable by it."""
    cell, rows = simulate(tmp_path, np.random.default_rng(8))
    wrench = rows.wrench.copy()
    wrench[:3] = 0.0
    rows = replace(rows, wrench=wrench, validate=np.arange(len(rows)) >= 3 + loaded)
    if loaded:
        assert "not identifiable" in fit_stiffness(cell, rows).model.grades
        return
    with pytest.raises(CompstiffError) as raised:
        fit_stiffness(cell, rows)
    (said,) = raised.value.findings
    assert (said.code, said.message) == ("CS1009", "no loaded row has the purpose identify: all are kept for validation")


def test_a_search_that_runs_out_of_steps_says_so(tmp_path, monkeypatch) -> None:
    cell, rows = simulate(tmp_path, np.random.default_rng(8))
    monkeypatch.setattr(posteriors, "MAX_STEPS", 1)
    with pytest.raises(CompstiffError) as raised:
        fit_stiffness(cell, rows)
    (said,) = raised.value.findings
    assert (said.code, said.file) == ("CS1011", rows.source)
    told = re.fullmatch(r"the fit did not converge in 1 steps: the last moved by (\S+) posterior standard deviations",
                        said.message)
    assert told
    assert float(told[1]) > 0.1



def test_a_few_rows_and_many_rows_are_quick(tmp_path) -> None:
    import time

    cell, rows = simulate(tmp_path, np.random.default_rng(9), poses=700, loads=10)
    start = time.process_time()
    fit = fit_stiffness(cell, rows)
    assert time.process_time() - start < 4
    assert np.all(np.abs(fit.model.mean + np.log(TRUE)) < 4 * fit.model.log_std)


@pytest.mark.parametrize("unseen", [[], [4], [1, 5]])
def test_a_joint_that_no_reading_tells_has_its_prior_exactly(unseen: list[int]) -> None:
    """From a thousandth of what the prior itself tells on it is the data's. What they say of the others stays as it is, apart
    from what such a joint is."""
    rng, log_std = np.random.default_rng(8), np.array([0.5, 0.5, 1.0, 2.0, 0.5, 2.0])
    prior: Any = SimpleNamespace(prior=SimpleNamespace(log_std=log_std, stiffness=np.exp(np.arange(10.0, 16.0))))
    root = rng.standard_normal((8, 8))
    draws = Draws(rng.standard_normal((500, 8)) @ root + 3.0, rng.dirichlet(np.ones(500)), 300.0)
    information = np.where(np.isin(np.arange(6), unseen), 0.9e-3, 1.1e-3) / log_std**2
    found = _with_unseen(draws, information, prior)
    seen = np.setdiff1d(np.arange(8), unseen)
    np.testing.assert_array_equal(found.x[:, seen], draws.x[:, seen])
    assert (found.effective, found.weight is draws.weight) == (300.0, True)
    covariance = found.covariance
    np.testing.assert_allclose(covariance[np.ix_(seen, seen)], draws.covariance[np.ix_(seen, seen)])
    np.testing.assert_allclose(covariance[np.ix_(unseen, unseen)], np.diag(log_std[unseen] ** 2), atol=1e-9)
    np.testing.assert_allclose(covariance[np.ix_(unseen, seen)], 0.0, atol=1e-9)
    np.testing.assert_allclose(found.mean[unseen], -np.arange(10.0, 16.0)[unseen], atol=1e-9)

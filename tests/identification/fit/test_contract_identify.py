"""What `identify` says beyond the estimate: variance components, gross errors, conflicts, profiles, the paper's prior."""

import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.optimize import minimize
from scipy.stats import chi2

from identification.common.findings import CompstiffError
from identification.fit.fit import fit_stiffness
from identification.fit.load_test import LoadTest
from identification.fit.posterior import posterior
from identification.fit.profile import profiles
from identification.model.cell import read_cell
from identification.model.compliance import equilibrium
from tests.identification.fit.test_laws_posterior import TRUE, simulate
from tests.support import write_cell

BARE = "robot: irb6660-205-1.90\ntool: {position_mm: [120, 0, 250]}\n"


def test_noise_that_the_cell_file_does_not_state_is_estimated(tmp_path) -> None:
    """Data with 4 um re-seating and 1 % force error; the cell file names the sensor alone."""
    offsets = []
    for seed in range(2):
        _, rows = simulate(tmp_path, np.random.default_rng(seed), poses=15, loads=6)
        fit = fit_stiffness(read_cell(write_cell(tmp_path, BARE)), rows)
        noise = fit.model.fit["noise"]
        assert not noise["pose_offset_stated"]
        assert noise["pose_offset_told_apart"]
        offsets.append(np.mean(noise["pose_offset_um"]))
        # The data also hold an absolute force error of 1 N, 1 to 2 um here. Unstated it has no part of its own: the sensor's
        # size takes it.
        assert 0.7 < noise["sensor_scale"] < 1.7
    assert 2.8 < np.mean(offsets) < 5.2


def test_a_stated_zero_means_none(tmp_path) -> None:
    _, rows = simulate(tmp_path, np.random.default_rng(1), poses=10, loads=4)
    stated = BARE + "measurement: {pose_offset_std_um: [0, 0, 0], force_relative_std: 0}\n"
    fit = fit_stiffness(read_cell(write_cell(tmp_path, stated)), rows)
    assert fit.model.fit["noise"]["pose_offset_um"] == [0, 0, 0]
    assert fit.posterior.components.sensor > 1.5                 # then all of it is the sensor's


def test_a_gross_error_counts_little_and_is_named_and_nothing_else_is(tmp_path) -> None:
    cell, rows = simulate(tmp_path, np.random.default_rng(2))
    clean = fit_stiffness(cell, rows)
    assert np.all(clean.row_weight == 1)
    deflection = rows.deflection.copy()
    deflection[17] += [0, 3e-4, -2e-4]
    fit = fit_stiffness(cell, replace(rows, deflection=deflection))
    named = [finding for finding in fit.findings if finding.code == "CS1015"]
    assert [finding.line for finding in named] == [int(rows.line[17])]
    assert fit.row_weight[17] < 0.1
    assert np.all(np.abs(fit.model.mean + np.log(TRUE)) < 3.5 * fit.model.log_std)
    # A fit that takes the row as it is would be off by many of the clean fit's standard deviations.
    assert np.max(np.abs(fit.model.mean - clean.model.mean) / clean.model.log_std) < 2


# Long: the same noise, stated, in test_laws_calibration.py, and its sizes where they are not stated above.
@pytest.mark.long
def test_coverage_with_noise_that_is_not_stated(tmp_path) -> None:
    """The fast guard of benchmarks/calibration.py: Student-4 sensor, 1 % force error, 4 um re-seating, none of it stated."""
    inside, distance = [], []
    for seed in range(12):
        rng = np.random.default_rng(300 + seed)
        _, rows = simulate(tmp_path, rng, poses=8)
        heavy = 2e-6 * (rng.standard_t(4, rows.deflection.shape) / np.sqrt(2))
        cell = read_cell(write_cell(tmp_path, BARE))
        model = fit_stiffness(cell, replace(rows, deflection=rows.deflection + heavy)).model
        low, high = model.interval_95.T
        inside.append((low <= TRUE) & (high >= TRUE))
        off = model.mean + np.log(TRUE)
        distance.append(off @ np.linalg.solve(model.covariance, off))
    assert 0.87 < np.mean(inside) < 0.995
    assert np.mean(np.array(distance) <= chi2.ppf(0.95, 6)) > 0.82


def test_a_subset_that_wants_other_stiffnesses_is_found(tmp_path) -> None:
    """Joint 3 is 40 % softer under positive loads: the comparison of the signs, not another, is the clearest."""
    cell, rows = simulate(tmp_path, np.random.default_rng(3), poses=14, loads=6)
    softer = TRUE * [1, 1, 0.6, 1, 1, 1]
    here, there = (equilibrium(cell.robot, rows.theta, cell.flange_from_tcp, rows.wrench, 1 / k).position
                   for k in (TRUE, softer))
    positive = rows.wrench[:, :3].sum(axis=1) > 0
    changed = rows.deflection + np.where(positive[:, None], there - here, 0.0)
    fit = fit_stiffness(cell, replace(rows, deflection=changed))
    assert fit.conflicts[0].part == "positive loads"
    assert fit.conflicts[0].is_conflict
    assert int(np.argmin(fit.conflicts[0].difference)) == 2
    assert any(finding.code == "CS1016" and "positive loads" in finding.message for finding in fit.findings)


def test_data_of_one_set_of_springs_show_no_conflict(tmp_path) -> None:
    alarms = 0
    for seed in range(8):
        cell, rows = simulate(tmp_path, np.random.default_rng(500 + seed), poses=10, loads=4)
        alarms += any(conflict.is_conflict for conflict in fit_stiffness(cell, rows).conflicts)
    assert alarms <= 2              # 5 % family-wise: more than 2 of 8 has a probability of 0.6 %


def test_profiles(tmp_path) -> None:
    cell, rows = simulate(tmp_path, np.random.default_rng(4))
    fit = fit_stiffness(cell, rows, with_profiles=True)
    assert [profile.kind for profile in fit.profiles] == ["bounded"] * 6
    for profile, truth, interval in zip(fit.profiles, TRUE, fit.model.interval_95, strict=True):
        low, high = profile.interval
        assert low is not None
        assert high is not None
        assert low < interval[1]
        assert high > interval[0]
        assert low * 0.7 < truth < high * 1.4
    # In the plane of the arm a force along x says nothing of joints 1, 4 and 6.
    theta = np.radians([[0.0, q2, q3, 0, q5, 0] for q2, q3, q5 in [(0, 20, 60), (10, 30, 40), (20, 30, 80), (-10, 20, 50)]])
    wrench = np.tile([300.0, 0, 0, 0, 0, 0], (4, 1))
    plain = read_cell(write_cell(tmp_path, BARE.replace("[120, 0, 250]", "[0, 0, 250]")))
    few = replace(rows.select(np.arange(len(rows)) < 4), theta=theta, wrench=wrench, visit=np.arange(4), deflection=equilibrium(
        plain.robot, theta, plain.flange_from_tcp, wrench, 1 / TRUE).position)
    kinds = [profile.kind for profile in fit_stiffness(plain, few, with_profiles=True).profiles]
    assert [kinds[i] for i in (0, 3, 5)] == ["flat"] * 3
    assert kinds[2] == "bounded"


@pytest.mark.parametrize("factor", [0.7, 1.5])
def test_profiles_say_what_the_data_say_whatever_the_prior_holds(tmp_path, factor) -> None:
    """A prior that is sure of other stiffnesses: the interval of the data alone still has the truth (here it does for all six),
    not a sliver of what the prior leaves open; the prior's value is outside. It was given 1.448 to 1.449 of the truth."""
    cell, rows = simulate(tmp_path, np.random.default_rng(4))
    sure = replace(cell.prior, stiffness=factor * TRUE, relative_std=np.full(6, 0.005))
    fitted = posterior(LoadTest.of(replace(cell, prior=sure), rows))
    for profile, truth in zip(profiles(fitted), TRUE, strict=True):
        low, high = profile.interval
        assert profile.kind == "bounded"
        assert low is not None
        assert high is not None
        assert low < truth < high
        assert profile.drop.min() == pytest.approx(0, abs=0.05)
        assert profile.stiffness[0] < low < high < profile.stiffness[-1]
        assert not low < factor * truth < high


@pytest.mark.parametrize(("wanted", "std"), [(0.02, 0.1), (0.0, 0.1), (-0.3, 0.2), (-5.0, 1.0)])
def test_data_that_want_no_compliance_say_how_stiff_a_joint_is_at_least(wanted, std) -> None:
    """One joint of its own, whose compliance by the data is wanted +- std of that which the prior holds: where a Gaussian that
    is cut off at zero has fallen by half the 95 % quantile of chi-square, in closed form. It was told to be flat."""
    information = np.diag(np.array([std, *[0.1] * 5]) ** -2)
    pull = information @ np.array([wanted - 1, *[0.0] * 5])
    held = SimpleNamespace(
        at_map=SimpleNamespace(design=None, residual=np.zeros((1, 1))), compliance=np.ones(6), information=information,
        weights=SimpleNamespace(inner=lambda design, residual: pull[:, None]), laplace=0.05**2 * np.eye(6))
    profile = profiles(held)[0]
    low, high = profile.interval
    most = wanted + std * np.sqrt((max(wanted, 0.0) - wanted) ** 2 / std**2 + chi2.ppf(0.95, 1))
    assert (profile.kind, high) == ("one-sided", None)
    assert low == pytest.approx(1 / most, rel=0.01)


@pytest.mark.parametrize("width", [
    pytest.param(None, id="a share of k0"),
    # Equal for all joints, in (N m/rad): Gamma_0 is a multiple of the identity.
    pytest.param(1e6, id="the identity"),
])
def test_the_paper_s_prior_gives_the_minimum_of_its_equation_12(tmp_path, width) -> None:
    cell, rows = simulate(tmp_path, np.random.default_rng(5), poses=3, loads=2)
    std = 2.0 * cell.prior.stiffness
    if width is not None:
        each = ", ".join(f"{width / k!r}" for k in cell.prior.stiffness.tolist())
        cell, std = read_cell(write_cell(tmp_path, BARE + f"prior: {{relative_std: [{each}]}}\n")), np.full(6, width)
    fit = fit_stiffness(cell, rows, prior_kind="gaussian", gamma=2.0)
    at, prior = fit.posterior.at_map, cell.prior

    def objective(share: np.ndarray) -> float:
        k = share * prior.stiffness
        predicted = equilibrium(cell.robot, rows.theta, cell.flange_from_tcp, rows.wrench, 1 / k).position
        r = np.einsum("nij,nj->ni", at.noise.whitening, rows.deflection - predicted)[:, :, None]
        return float(0.5 * fit.posterior.weights.inner(r, r)[0, 0] + np.sum(((k - prior.stiffness) / std) ** 2))

    best = minimize(objective, np.exp(-fit.posterior.map) / prior.stiffness, method="Nelder-Mead",
                    options={"xatol": 1e-6, "fatol": 1e-9, "maxiter": 6000, "maxfev": 6000})
    assert objective(np.exp(-fit.posterior.map) / prior.stiffness) < best.fun + 1e-3
    assert fit.model.fit["prior"] == {"kind": "gaussian", "gamma": 2.0}


def test_the_ellipsoid_s_longest_axis_is_in_words(tmp_path) -> None:
    cell, rows = simulate(tmp_path, np.random.default_rng(6))
    shape = fit_stiffness(cell, rows).ellipsoid
    assert np.all(np.diff(shape.semi_axes) <= 0)
    assert_allclose(shape.directions @ shape.directions.T, np.eye(6), atol=1e-12)
    assert "least certain: k" in shape.sentence


def test_a_pose_that_moved_is_found(tmp_path) -> None:
    """In one pose all deflections are 30 % too large: that pose is left out, and the others agree."""
    cell, rows = simulate(tmp_path, np.random.default_rng(7), poses=10, loads=6)
    spoiled = np.where((rows.visit == 4)[:, None], 1.3 * rows.deflection, rows.deflection)
    fit = fit_stiffness(cell, replace(rows, deflection=spoiled))
    bad, = fit.bad_visits
    assert bad.score.name == f"the pose from line {rows.line[rows.visit == 4][0]}"
    assert bad.score.rows.tolist() == rows.row[rows.visit == 4].tolist()
    assert not any(conflict.is_conflict for conflict in fit.conflicts)
    assert np.all(np.abs(fit.model.mean + np.log(TRUE)) < 4 * fit.model.log_std)


def test_data_against_the_prior(tmp_path) -> None:
    cell, rows = simulate(tmp_path, np.random.default_rng(8))
    assert not any(finding.code == "CS1017" for finding in fit_stiffness(cell, rows).findings)
    softer = fit_stiffness(cell, replace(rows, deflection=30 * rows.deflection))
    assert sum(finding.code == "CS1017" for finding in softer.findings) == 1
    with pytest.raises(CompstiffError, match=r"(?s)CS1018.*looks like a unit"):
        fit_stiffness(cell, replace(rows, deflection=1e-3 * rows.deflection))


@pytest.mark.parametrize(("share", "said"), [
    (0.45, set()), (0.55, {"CS1019"}), (0.58, {"CS1019"}), (0.62, {"CS1019", "CS1021"})])
def test_validation_rows_between_fit_and_prior_are_held_against_both(tmp_path, share: float, said: set[str]) -> None:
    """Rows that lie this share of the way from the true springs' prediction to the prior's: nearer to the prior it is said,
    half as far again the model is rejected."""
    cell, rows = simulate(tmp_path, np.random.default_rng(9), poses=16)
    true, prior = (equilibrium(cell.robot, rows.theta, cell.flange_from_tcp, rows.wrench, 1 / k).position
                   for k in (TRUE, cell.prior.stiffness))
    kept = rows.visit >= 12
    fit = fit_stiffness(cell, replace(rows, validate=kept, deflection=np.where(
        kept[:, None], true + share * (prior - true), rows.deflection)))
    assert {finding.code for finding in fit.findings} & {"CS1019", "CS1021"} == said
    apart = 1e6 * np.sqrt(np.mean((prior - true)[kept] ** 2))
    if said:
        told = next(finding.message for finding in fit.findings if finding.code == "CS1019")
        numbers = re.fullmatch(r"on the validation rows the identified stiffnesses are off by (\S+) um RMS, "
                               r"the prior's by (\S+) um", told)
        assert numbers
        assert [float(one) for one in numbers.groups()] == pytest.approx([share * apart, (1 - share) * apart], rel=0.05)


def test_no_slip_in_a_validation_row_speaks_against_the_stiffnesses(tmp_path) -> None:
    """A digit too many that happens to lie where the prior is wrong makes the prior's figure the smaller one."""
    cell, rows = simulate(tmp_path, np.random.default_rng(4), poses=14, loads=4)
    kept, slip = rows.visit >= 10, 47
    deflection = rows.deflection.copy()
    deflection[slip, 0] -= 1e-3
    fit = fit_stiffness(cell, replace(rows, deflection=deflection, validate=kept))
    assert fit.held_out is not None
    assert fit.held_out[1] > fit.held_out[0]
    assert [(finding.code, finding.line) for finding in fit.findings] == [("CS1732", int(rows.line[slip]))]
    left = 1e6 * np.sqrt(np.mean(fit.residual[kept & (rows.row != rows.row[slip])] ** 2))
    told = re.fullmatch(r"validation rows without 1 outlier: (\S+) um with the identified stiffnesses", fit.lines()[-1])
    assert told
    assert float(told[1]) == pytest.approx(left, rel=0.1)


def test_validation_rows_that_the_prior_tells_better_are_said(tmp_path) -> None:
    """Fitted rows twice too soft, validation rows as they are: the fit explains its own rows, and is rejected all the same."""
    cell, rows = simulate(tmp_path, np.random.default_rng(9))
    kept = rows.visit >= rows.visit.max() - 1
    for times, said in ((2, {"CS1019", "CS1021"}), (1, set())):
        deflection = np.where(kept[:, None], rows.deflection, times * rows.deflection)
        fit = fit_stiffness(cell, replace(rows, deflection=deflection, validate=kept))
        assert {finding.code for finding in fit.findings} & {"CS1019", "CS1021"} == said
        assert bool(fit.model.rejected) == bool(said)
        assert any(grade.grade == "reliable" for grade in fit.grades) != bool(said)

"""How large what nobody stated is taken to be, in what a reading may be off by, and the limits of what is made of it, by the
independent arm's compliance."""

from __future__ import annotations

import re
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose
from numpy.typing import NDArray

from identification.common.findings import CompstiffError
from identification.fit.fit import fit_stiffness
from identification.fit.load_test import LoadTest
from identification.fit.mistakes.evidence import ordinary
from identification.fit.noise import noise_model, residual_std
from identification.fit.noise_parts import VarianceComponents
from identification.fit.posterior import posterior
from identification.fit.report import _two_sigma
from identification.fit.sag import sag_columns
from identification.fit.subsets import Conflict, partitions, subset_conflicts
from tests.identification.fit.exact_rows import by_compliance
from tests.identification.fit.test_laws_posterior import TRUE, simulate

Array = NDArray[np.float64]


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> LoadTest:
    cell, rows = simulate(tmp_path_factory.mktemp("sizes"), np.random.default_rng(5), poses=8, loads=3)
    return LoadTest.of(cell, rows)


def compliance_of(data: LoadTest) -> Array:
    """Motion (n, 3, 3) [m/N] by a force along each axis."""
    theta, tcp = data.rows.theta, data.cell.flange_from_tcp.position
    return np.stack([by_compliance(theta, tcp, np.tile(axis, (len(theta), 1))) @ (1 / TRUE) for axis in np.eye(3)], axis=2)


NOTHING: dict[str, Any] = {"force": 0.0, "absolute": 0.0, "offset": 0.0}


@pytest.mark.parametrize(("part", "stated", "share", "newtons", "microns"), [
    ({"offset": 1.0}, False, 0.0, 0.0, 3.0), ({"offset": 1.0}, True, 0.0, 0.0, 4.0), ({"force": 1.0}, False, 0.005, 0.0, 0.0),
    ({"force": 1.0}, True, 0.01, 0.0, 0.0), ({"setup": 5.0}, False, 0.005, 0.0, 0.0), ({"absolute": 1.0}, True, 0.0, 1.0, 0.0),
    ({"absolute": 1.0}, False, 0.0, 0.4, 0.0)])
def test_what_is_not_stated_is_as_large_as_usual(
        data: LoadTest, part: dict[str, Any], stated: bool, share: float, newtons: float, microns: float) -> None:
    """3 um of re-seating, half a per cent of the force and 0.4 N; from set-up to set-up a thousandth: five are there."""
    noise = replace(data.cell.noise, offset_stated=stated, force_relative_stated=stated, force_stated=stated)
    if not stated:
        noise = replace(noise, force_relative=0.0, force=np.zeros(3))
    named = replace(data, cell=replace(data.cell, noise=noise))
    std = residual_std(named, VarianceComponents(**{**NOTHING, **part}), 1 / TRUE)
    moved = compliance_of(data) * (share * np.abs(data.rows.wrench[:, None, :3]) + newtons)
    if "setup" in part:
        # Stretched and turned: each component of the force by each, as large as the whole of it.
        moved = compliance_of(data) * share * np.linalg.norm(data.rows.wrench[:, :3], axis=1)[:, None, None]
    expected = 2e-6**2 + np.sum(moved**2, axis=2) + (1e-6 * microns) ** 2
    assert_allclose(std, np.sqrt(expected), rtol=2e-3)


def test_a_memory_s_odds_are_a_tenth() -> None:
    assert [VarianceComponents(memory=times).rho for times in (0.0, 1.0, 10.0)] == pytest.approx([0.0, 1 / 11, 0.5])
    assert VarianceComponents(setup=3.0).setup_relative == pytest.approx(0.003)


@pytest.mark.parametrize("times", [0.9, 1.1])
def test_a_force_error_of_ten_thousand_sigmas_is_refused(data: LoadTest, times: float) -> None:
    """Of 1 N, in the row whose tool yields most to it along any axis."""
    most = np.abs(compliance_of(data)).max(axis=(1, 2))
    noise = replace(data.cell.noise, force_relative=0.0, deflection=np.full(3, most.max() / (times * 1e4)))
    fine = replace(data, cell=replace(data.cell, noise=noise))
    if times < 1:
        assert noise_model(fine, 1 / TRUE).absolute.max() == pytest.approx(9e3, rel=1e-3)
    else:
        with pytest.raises(CompstiffError, match="CS1081") as caught:
            noise_model(fine, 1 / TRUE)
        (finding,) = caught.value.findings
        assert finding.message == ("the force error moves the tool by 1.1e+04 times the sensor's 1 sigma, at most 10000 can be "
                                   "computed with")
        assert finding.line == int(data.rows.line[np.argmax(most)])


def test_a_joint_sags_by_a_weight_of_4000_nm(data: LoadTest) -> None:
    """The first two columns: what other angles of joints 2 and 3, as that makes them, do to the motion under load."""
    compliance = 1 / TRUE
    columns = sag_columns(data.load_state(compliance), SimpleNamespace(whitened=lambda moved: moved))
    theta, tcp, force = data.rows.theta, data.cell.flange_from_tcp.position, data.rows.wrench[:, :3]
    for number, joint in enumerate((1, 2)):
        by = 0.1 * 4000.0 * compliance[joint] * np.eye(6)[joint]
        moved = (by_compliance(theta + by, tcp, force) - by_compliance(theta - by, tcp, force)) @ compliance / 0.2
        assert np.abs(columns[:, :, number] - moved).max() < 0.03 * np.abs(moved).max()


@pytest.mark.parametrize(("stated", "relative", "sensor", "setup"), [
    (True, 0.005, 2.0, 5.0), (False, 0.005, 3.0, 5.0), (True, None, 2.0, 2.0), (True, 0.001, 2.0, 2.0), (True, 0.1, 2.0, 9.0)])
def test_noise_is_ordinary_up_to_twice_what_is_stated(
        stated: bool, relative: float | None, sensor: float, setup: float) -> None:
    """Of a fit with three times as much of all, and set-ups that differ by nine thousandths: up to the relative error that is
    stated of forces that is ordinary too."""
    of_cell = SimpleNamespace(force_relative_stated=relative is not None, force_relative=relative or 0.0)
    fitted: Any = SimpleNamespace(
        components=VarianceComponents(3.0, 3.0, 1.5, 3.0, 9.0, 1.0), data=SimpleNamespace(cell=SimpleNamespace(noise=of_cell)),
        at_map=SimpleNamespace(noise=SimpleNamespace(stated=(stated,))))
    assert ordinary(fitted).values == pytest.approx([sensor, 2.0, 1.5, 2.0, setup, 1.0])


@pytest.mark.parametrize(("corrected", "conflict"), [(0.054, False), (0.046, True)])
def test_parts_of_the_data_are_in_conflict_that_chance_makes_in_one_of_twenty(corrected: float, conflict: bool) -> None:
    assert Conflict("a", "b", (9, 9), 3.0, 2, 0.01, corrected, np.zeros(6)).is_conflict is conflict


def test_a_part_of_two_loaded_rows_is_compared_and_each_pose_of_forty(data: LoadTest) -> None:
    rows = data.rows
    for count in (1, 2):
        kept = (rows.visit > 0) | (np.arange(len(rows)) < count)
        compared = subset_conflicts(posterior(data.with_rows(rows.select(kept))))
        assert ("the pose from line 2" in {one.part for one in compared}) is (count == 2)
    for poses in (40, 41):
        many = np.resize(np.arange(len(rows)), 3 * poses)
        table = replace(rows.select(np.ones(len(rows), dtype=bool)), **{name: getattr(rows, name)[many] for name in (
            "wrench", "line")}, visit=np.repeat(np.arange(poses), 3))
        assert (sum(part.startswith("the pose from") for part, _, _ in partitions(table)) == poses) is (poses == 40)


@pytest.mark.parametrize(("log_std", "words"), [(0.145, "29.0 %"), (0.155, "a factor 1.4")])
def test_a_stiffness_known_to_thirty_per_cent_is_told_by_a_factor(log_std: float, words: str) -> None:
    """Two standard deviations of ln k."""
    assert _two_sigma(log_std) == words


def test_what_is_called_the_95_per_cent_interval_leaves_a_fortieth_of_the_draws_to_either_side(data: LoadTest) -> None:
    """Of the stiffness file, by a count of the draws with their weights."""
    fit = fit_stiffness(data.cell, data.rows)
    draws, (low, high) = fit.posterior.draws, fit.model.interval_95.T
    k = np.exp(-draws.x)
    assert draws.weight @ (k < low) == pytest.approx(np.full(6, 0.025), abs=2e-3)
    assert draws.weight @ (k > high) == pytest.approx(np.full(6, 0.025), abs=2e-3)


def test_the_load_that_would_help_does(data: LoadTest) -> None:
    """Its 300 N added to the rows of one pose leave of the joint's uncertainty what the hint says."""
    fit = fit_stiffness(data.cell, data.rows.select(data.rows.visit == 0))
    grade = max((one for one in fit.grades if one.helpful), key=lambda one: one.shrinkage)
    hint = re.fullmatch(r"one load of 300 N along base ([xyz]) at joints \((.*)\) deg would bring the uncertainty of "
                        rf"k{grade.joint} to (?:under )?(\d+) % of what it is", grade.helpful)
    assert hint, grade.helpful
    theta = np.radians([[float(angle) for angle in hint[2].split(",")]])
    force = 300 * np.eye(3)[["xyz".index(hint[1])]]
    (each,) = by_compliance(theta, data.cell.flange_from_tcp.position, force) / fit.model.stiffness
    before = fit.posterior.covariance
    after = np.linalg.inv(np.linalg.inv(before) + each.T @ each / (2e-6 * fit.posterior.components.sensor) ** 2)
    k = grade.joint - 1
    assert np.sqrt(after[k, k] / before[k, k]) == pytest.approx(float(hint[3]) / 100, abs=0.02)

"""The model's own check: quiet where six springs are the truth, loud where they are not; and what follows from it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.linalg import sqrtm
from scipy.spatial.transform import Rotation
from scipy.stats import f, norm

from identification.common.findings import CompstiffError
from identification.diagnosis.diagnose import diagnose
from identification.fit import misfit
from identification.fit.fit import Fit, fit_stiffness
from identification.fit.load_test import LoadTest
from identification.fit.mistakes.evidence import log_evidence
from identification.fit.noise_degrees import NoiseDegrees, beside_the_springs
from identification.fit.noise_parts import SetUp, VarianceComponents
from identification.fit.posterior import posterior
from identification.measurements import Measurements, read_measurements
from identification.model.cell import Cell, read_cell
from tests.second_cell import cell as second_cell
from tests.virtual_cell.cell import Case, Hidden, simulate


def read(case: Case | second_cell.Case, folder: Path) -> tuple[Cell, Measurements]:
    cell_path, rows_path = case.write(folder)
    cell = read_cell(cell_path)
    return cell, read_measurements(rows_path, cell.robot)


def first(rows: Measurements, visits: int) -> Measurements:
    """Its first visits alone: what is plain in them takes less time."""
    return rows.select(rows.visit < visits)


def fitted(case: Case | second_cell.Case, folder: Path) -> Fit:
    return fit_stiffness(*read(case, folder))


@pytest.mark.parametrize("design", ["ladder12", "poses20", "paper5"])
def test_springs_alone_are_not_rejected(design: str, tmp_path: Path) -> None:
    for seed in range(700, 702):
        fit = fitted(simulate(seed, design), tmp_path)
        assert not fit.model.rejected
        assert all(finding.code != "CS1021" for finding in fit.findings)


# Long: others that springs cannot do, by the same check.
@pytest.mark.parametrize(("hidden", "seed"), [
    (Hidden("backlash", 1, 1.5), 710), pytest.param(Hidden("base_rocking", None, 1.5), 711, marks=pytest.mark.long),
    pytest.param(Hidden("deflection_sensor_rotation", None, 1.5), 712, marks=pytest.mark.long)])
def test_what_springs_cannot_do_rejects_them(hidden: Hidden, seed: int, tmp_path: Path) -> None:
    """Then no stiffness is reliable, and the file says so."""
    fit = fitted(simulate(seed, "ladder12", [hidden]), tmp_path)
    assert "reliable" not in fit.model.grades
    content = fit.model.as_dict()
    assert content["fit"]["model_check"]["rejected"] is True
    assert any(finding.code == "CS1021" for finding in fit.findings)
    assert fit.model.rejected


def test_readings_that_no_tail_makes_are_far_off(tmp_path: Path) -> None:
    """Noise is not, with tails as heavy as Student-3; a tenth of the rows under the largest loads that move three deflections
    of the noise and more are, though they count for next to nothing in the fit."""
    for stratum in ("realistic", "heavy tails"):
        cell, rows = read(simulate(2_430_004, "ladder12", (), stratum), tmp_path)
        quiet = posterior(LoadTest.of(cell, rows))
        assert misfit.far_off(quiet) < 1.15
        size = np.linalg.norm(rows.wrench[:, :3], axis=1)
        some = (size > 0.9 * size.max()) & (rows.visit % 3 == 0)
        assert 0.05 < some.mean() < 0.15
        moved = rows.deflection + 80e-6 * (some * np.sign(rows.wrench[:, :3].sum(axis=1)))[:, None]
        assert misfit.far_off(posterior(LoadTest.of(cell, replace(rows, deflection=moved)))) > 1.3


def test_readings_that_are_far_off_make_the_rows_less_likely(tmp_path: Path) -> None:
    """Two of them by 300 um in noise of a few: a Student distribution of 3 degrees of freedom makes one sixty deviations
    off e^22 times less likely, one of more degrees still less. The rows had been likelier with them than without, by e^40."""
    cell, rows = read(simulate(2_430_004, "ladder12"), tmp_path)
    quiet = posterior(LoadTest.of(cell, rows))
    deflection = rows.deflection.copy()
    deflection[np.flatnonzero(np.any(rows.wrench != 0, axis=1))[[20, 47]], 0] += 300e-6
    moved = posterior(LoadTest.of(cell, replace(rows, deflection=deflection)))
    assert np.isinf(quiet.components.degrees)
    assert moved.components.degrees <= 6
    assert log_evidence(moved) < log_evidence(quiet) - 44


# Arms that hang by their own weight, which no file states; one by one they were rejected with p = 5e-8, 1e-4 and 2e-6.
HANGING = {175065: None, 175066: None, 16305: "irb6640-235-2.55"}


# Long: another arm and seed stay.
@pytest.mark.parametrize("seed", [*(pytest.param(seed, marks=pytest.mark.long) for seed in (175065, 175066)), 16305])
def test_an_arm_s_unknown_weight_rejects_no_springs(seed: int, tmp_path: Path) -> None:
    case = second_cell.simulate(seed, "cycles", name=HANGING[seed], weight="unknown")
    fit = fitted(case, tmp_path)
    assert fit.cell.robot.link_mass is None
    assert not fit.model.rejected
    assert fit.model.fit["model_check"]["p_value"] > 0.01
    assert not [conflict for conflict in fit.conflicts if conflict.corrected < 1e-3]


# Long: the same at another seed.
@pytest.mark.parametrize("seed", [178006, pytest.param(178029, marks=pytest.mark.long)])
def test_forces_set_up_anew_at_each_visit_reject_no_springs(seed: int, tmp_path: Path) -> None:
    """One error of the force a visit and component where the file says one a row: rejected once, p = 2e-5 and 2e-7."""
    case = second_cell.simulate(seed, "cycles", "visit_force", weight="known")
    fit = fitted(case, tmp_path)
    assert not fit.model.rejected
    assert fit.model.fit["model_check"]["p_value"] > 0.003
    # Errors of each component by itself turn no force but by stretching it.
    assert fit.posterior.components.set_up is SetUp.STRETCHED
    assert any(one.code == "CS1041" and " are stretched against " in one.message for one in fit.findings)
    assert 0.5 * case.noise.relative < fit.posterior.components.setup_relative < 2 * case.noise.relative


def set_up_by_hand(rows: Measurements, error: float, seed: int) -> Measurements:
    """The same readings under loads that were written as meant, and leaned and were off by so much, anew at each visit."""
    rng, written = np.random.default_rng(seed), rows.wrench.copy()
    for visit in np.unique(rows.visit):
        turned = Rotation.from_rotvec(error * rng.standard_normal(3)).as_matrix() * (1 + error * rng.standard_normal())
        mine = rows.visit == visit
        written[mine, :3] = rows.wrench[mine, :3] @ np.linalg.inv(turned).T
    return replace(rows, wrench=written)


# Long: what is stated too closely is refused by the same test as what is off by far.
@pytest.mark.parametrize(("error", "stated", "adequate"), [
    (0.015, 0.005, True), pytest.param(0.015, 0.002, False, marks=pytest.mark.long),
    pytest.param(0.06, 0.005, False, marks=pytest.mark.long)])
def test_a_rig_that_is_set_up_by_hand_rejects_no_springs(
    error: float, stated: float, adequate: bool, tmp_path: Path,
) -> None:
    """A level and a square leave about a degree: told (CS1041); five times as much is no set-up, nor is what whoever states
    the forces to a fifth of a per cent has not seen."""
    cell, rows = read(simulate(2_430_006, "ladder12"), tmp_path)
    cell = replace(cell, noise=replace(cell.noise, force_relative=stated, force_relative_stated=True))
    fit = fit_stiffness(cell, set_up_by_hand(first(rows, 8), error, 4))
    assert 0.5 * error < fit.posterior.components.setup_relative < 2 * error
    assert bool(fit.model.rejected) is not adequate
    assert not adequate or any(one.code == "CS1041" and "stretched and turned" in one.message for one in fit.findings)


# Long: that the fit rejects such springs or not is seen above, and takes no search for their cause; such a set-up that is no
# cause, test_more_noise_than_stated_is_no_name_by_itself (tests/second_cell/test_answers.py).
@pytest.mark.long
@pytest.mark.parametrize(("error", "adequate"), [(0.015, True), (0.06, False)])
def test_a_rig_that_is_set_up_by_hand_has_no_cause(error: float, adequate: bool, tmp_path: Path) -> None:
    """`unknown` had been the answer of eight in eight."""
    cell, rows = read(simulate(2_430_006, "ladder12"), tmp_path)
    judged = diagnose(cell, set_up_by_hand(rows, error, 4), replicates=49)
    assert (judged.verdict == "adequate") is adequate
    assert not adequate or any(one.code == "CS1041" and "stretched and turned" in one.message for one in judged.findings)


# Long: springs cannot rock a base, as they cannot make play.
# Long: springs that do not hold are rejected above, and a hanging arm with sound ones is not.
@pytest.mark.long
@pytest.mark.parametrize("hidden", [
    second_cell.Hidden("backlash", 1, 1.5),
    pytest.param(second_cell.Hidden("base_rocking", 0, 1.5), marks=pytest.mark.long)])
def test_what_springs_cannot_do_rejects_a_hanging_arm(hidden: second_cell.Hidden, tmp_path: Path) -> None:
    assert fitted(second_cell.simulate(175065, "cycles", hidden=[hidden], weight="unknown"), tmp_path).model.rejected


def mistaken(rows: Measurements, kind: str) -> Measurements:
    wrench, deflection, theta = rows.wrench.copy(), rows.deflection.copy(), rows.theta.copy()
    if kind == "the sign of fy":
        wrench[:, 1] *= -1
    elif kind == "dy and dz swapped":
        deflection[:, [1, 2]] = deflection[:, [2, 1]]
    else:
        theta[:, 1] += np.radians(8.0)
    return replace(rows, wrench=wrench, deflection=deflection, theta=theta)


# Long: `identify` refuses files with other mistakes in tests/runs/mistakes/test_mistakes.py, where a sign is named by
# `diagnose`.
@pytest.mark.long
@pytest.mark.parametrize("kind", ["the sign of fy", pytest.param("dy and dz swapped", marks=pytest.mark.long)])
def test_clear_mistakes_of_people_are_refused(kind: str, tmp_path: Path) -> None:
    cell, rows = read(simulate(720, "ladder12"), tmp_path)
    with pytest.raises(CompstiffError) as refused:
        fit_stiffness(cell, mistaken(first(rows, 3), kind))
    assert refused.value.findings[0].code == "CS1700"


# Long: rejected springs have no reliable grade in test_what_springs_cannot_do_rejects_them; that a zero is a mistake,
# tests/second_cell/test_answers.py.
@pytest.mark.long
@pytest.mark.parametrize("kind", ["a zero of joint 2"])
def test_mistakes_of_people_are_not_reliable(kind: str, tmp_path: Path) -> None:
    """Tables with an ordinary mistake give stiffnesses that are wrong by a tenth and more, and none is called reliable."""
    case = simulate(720, "ladder12")
    cell, rows = read(case, tmp_path)
    fit = fit_stiffness(cell, mistaken(first(rows, 6), kind))
    assert np.max(np.abs(np.log(fit.model.stiffness / case.stiffness))) > 0.1
    assert fit.model.rejected
    assert "reliable" not in fit.model.grades


def test_many_light_rows_are_one_finding(tmp_path: Path) -> None:
    case = simulate(721, "ladder12")
    rng = np.random.default_rng(0)
    off = rng.permutation(len(case.deflection_um))[:60]
    case.deflection_um[off] += 80 * rng.standard_normal((60, 3))
    cell, rows = read(case, tmp_path)
    fit = fit_stiffness(cell, first(rows, 6))
    kept = np.isin(fit.measurements.row, fit.posterior.data.rows.row)
    light = int(np.sum(fit.row_weight[kept] < 0.3))
    assert light > 12
    told = [finding for finding in fit.findings if finding.code == "CS1015"]
    assert len(told) == 1
    assert f"{light} of" in told[0].message


@pytest.mark.parametrize("seed", [701, 702])
def test_a_kind_of_misfit_is_as_unlikely_as_the_f_distribution_says(seed: int, tmp_path: Path) -> None:
    """The same by least squares on all readings at once, whitened by the whole covariance, the prior as readings more: what the
    columns take of the squares that the springs leave."""
    cell, rows = read(simulate(seed, "paper5"), tmp_path)
    fitted = posterior(LoadTest.of(cell, rows))
    degrees = NoiseDegrees(fitted, *beside_the_springs(fitted))
    count, free = 3 * len(fitted.data.rows), degrees.design.shape[2]
    unit = np.eye(count).reshape(-1, 3, count)
    root = np.real(sqrtm(fitted.weights.inner(unit, unit)))
    design = root @ degrees.design.reshape(count, free)
    told = np.vstack([design, np.real(sqrtm(degrees.precision))])
    readings = np.append(root @ fitted.at_map.residual.ravel(), np.zeros(free))

    def squares(columns: np.ndarray) -> float:
        return float(np.sum((readings - columns @ np.linalg.lstsq(columns, readings, rcond=None)[0]) ** 2))

    tried = 0
    for _, columns in misfit._kinds(fitted.load_state):
        columns = columns[:, :, :1]
        moved = root @ (fitted.at_map.noise.whitening @ columns).reshape(count, 1)
        without = squares(told)
        explained = without - squares(np.hstack([told, np.vstack([moved, np.zeros((free, 1))])]))
        left = fitted.readings - 6 - 1
        expected = f.sf(explained / ((without - explained) / left), 1, left)
        if expected >= misfit.WORTH_DEGREES:
            tried += 1
            assert misfit._p_value(degrees, columns) == pytest.approx(expected, rel=1e-6)
    assert tried >= 2


ALL = dict.fromkeys(("sensor", "force", "absolute", "offset"), True)


@pytest.mark.parametrize(("part", "limit", "stated", "relative", "words"), [
    ("sensor", 4.0, ALL, None, "the sensor noise would have to be {:.1f} times the stated"),
    ("absolute", 4.0, ALL, None, "the absolute force error would have to be {:.1f} times the stated"),
    ("offset", 4.0, ALL, None, "the re-seating would have to be {:.1f} times the stated"),
    ("offset", 10.0, {}, None, "the re-seating (3 um is usual) would have to be {:.1f} times that"),
    ("force", 10.0, {}, None, "the force error (0.5 % is usual) would have to be {:.1f} times that"),
    ("absolute", np.inf, {}, None, ""),
    ("setup", 25.0, {}, None, "the forces would have to differ by {:.2g} % from one set-up to the next (0.1 % is usual)"),
    ("setup", 20.0, ALL, 0.005, "the forces would have to differ by {:.2g} % from one set-up to the next (0.5 % is stated of "
     "each force)"),
    ("setup", 10.0, ALL, 0.001, "the forces would have to differ by {:.2g} % from one set-up to the next (0.1 % is stated of "
     "each force)"),
    ("memory", 60.0, {}, None, "the readings of a pose would have to be alike by {:.0f} % (9 % is usual)")])
def test_noise_is_granted_so_many_times_what_is_stated_or_usual(
    part: str, limit: float, stated: dict[str, bool], relative: float | None, words: str,
) -> None:
    """Four times what is stated; of what no file states what whoever measures would know of. The chance of an estimate that
    large where the noise is at the limit is one in twenty."""
    parts = ("sensor", "force", "absolute", "offset", "setup", "memory")
    passes, active = np.full(3, ""), [True] * 4 + [part == name for name in ("setup", "memory")]

    def said(times: float, spread: float = 0.0, **more: float) -> list[str]:
        sizes: dict[str, Any] = {part: times * limit if limit < np.inf else 1e6, **more}
        noise = SimpleNamespace(stated=[stated.get(name, False) for name in parts], active=active)
        told = SimpleNamespace(force_relative=relative, force_relative_stated=relative is not None)
        fit: Any = SimpleNamespace(
            data=SimpleNamespace(rows=SimpleNamespace(machined_pass=passes), cell=SimpleNamespace(noise=told)),
            at_map=SimpleNamespace(noise=noise), components=VarianceComponents(**sizes), components_log_std=np.full(6, spread))
        return [misfit.needed(*one) for one in misfit.beyond_stated(fit, 4.0).items()]

    size = 1.001 * limit
    shown = {"setup": 0.1 * size, "memory": 100 * 0.1 * size / (1 + 0.1 * size)}.get(part, size)
    assert said(0.999) == []
    assert said(1.001) == ([words.format(shown)] if words else [])
    for chance, rare in ((0.06, False), (0.04, True)):
        assert bool(said(np.exp(0.5 * norm.isf(chance)), 0.5)) == (rare and bool(words))
    if part == "memory":
        assert said(1.001, sensor=0.09) == []       # of a sensor that hardly scatters nobody minds it
    if part in ("setup", "memory"):
        active = [True] * 4 + [False] * 2
        assert said(1.001) == []
    active, passes = [True] * 4 + [part == name for name in ("setup", "memory")], np.array(["", "P1", "P1"])
    assert said(1.001) == []                        # the mean of a stretch of a pass is no reading at rest

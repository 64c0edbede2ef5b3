"""One angle that is not the table's: told by how much likelier the rows are with it, where a visit's own response is silent."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.stats import multivariate_normal

from identification.fit.bad_visits import bad_visits
from identification.fit.fit import fit_stiffness
from identification.fit.fitted_model import WIDE
from identification.fit.load_test import LoadTest
from identification.fit.mistakes.evidence import ordinary
from identification.fit.posterior import posterior
from identification.fit.visit_findings import sentence
from identification.fit.visits import score_visits
from identification.fit.wrong_angle import AngleOfVisit, _near_none, likeliest_wrong_angle, wrong_angles
from identification.measurements import Measurements, read_measurements
from identification.model.cell import Cell, read_cell
from tests.virtual_cell.cell import simulate
from tests.virtual_cell.effects_at_poses import rewrite, table
from tests.virtual_cell.noise import Noise

SHEET = Noise(sensor_um=2.0, force_relative=0.005, force_n=0.5, pose_offset_um=3.0, quantum_um=0.1, stated_sensor_um=2.0,
              stated_force_n=0.7, stated_force_relative=0.005, stated_pose_offset_um=4.0)


def read(
    seed: int, design: str, folder: Path, pose: str = "", axis: int = 1, off_deg: float = 0.0,
) -> tuple[Cell, Measurements]:
    """A load test of the virtual cell's, whose table has another angle at one pose than the robot stood at."""
    cell_file, file = simulate(seed, design, noise=SHEET).write(folder)
    if pose:
        right = next(row for row in table(file) if row["pose"] == pose)[f"q{axis}_deg"]
        rewrite(file, pose, {f"q{axis}_deg": f"{float(right) - off_deg:.6f}"})
    cell = read_cell(cell_file)
    return cell, read_measurements(file, cell.robot)


def every_visit(rows: Measurements) -> NDArray[np.intp]:
    return np.unique(rows.visit)


def test_near_none_is_the_ratio_of_two_normal_distributions(tmp_path: Path) -> None:
    """Of all rows, the springs, the arm's weight and the angle among the errors: written out in full."""
    fitted = posterior(LoadTest.of(*read(71501, "poses20", tmp_path, "P4", 3, 2.0)))
    at, rows = fitted.at_map, fitted.data.rows
    weights = at.noise.weights(ordinary(fitted).of_the_usual_parts())
    size = at.residual.size
    sigma = np.linalg.inv(weights.apply(np.eye(size).reshape(-1, 3, size)).reshape(size, size))
    design, beside = at.design.reshape(size, -1), fitted.beside.reshape(size, -1)
    precision = at.prior.precision(at.x)
    none = sigma + beside @ beside.T + design @ np.linalg.solve(precision, design.T)
    expected = design @ -np.linalg.solve(precision, at.prior.gradient(at.x))
    plain = multivariate_normal(expected, 0.5 * (none + none.T)).logpdf(at.residual.ravel())
    support, _ = _near_none(fitted)
    state, wide = fitted.data.load_state(fitted.compliance), WIDE * AngleOfVisit.parameters[0].typical
    for number, visit in enumerate(every_visit(rows)[:5]):
        for joint in (2, 3, 5):
            step = 1e-3
            ahead, behind = (AngleOfVisit(int(visit)).contribution(state, joint, np.array([way * step])) for way in (1, -1))
            column = wide * (at.noise.whitening @ ((ahead - behind)[:, :3] / (2 * step))[:, :, None]).ravel()
            with_it = none + np.outer(column, column)
            likely = multivariate_normal(expected, 0.5 * (with_it + with_it.T)).logpdf(at.residual.ravel())
            assert support[number, joint - 1] == pytest.approx(likely - plain, abs=2e-3)


@pytest.mark.parametrize(("seed", "design", "pose", "axis", "off"), [
    (71502, "poses20", "P4", 3, 8.0), pytest.param(71507, "ladder12", "P8", 2, 2.0, marks=pytest.mark.long)])
def test_an_angle_that_a_visit_s_own_response_hides_is_told(
    seed: int, design: str, pose: str, axis: int, off: float, tmp_path: Path
) -> None:
    """With its size, and the visit is left out; by its own response, at the level of that test, nothing is."""
    cell, rows = read(seed, design, tmp_path, pose, axis, off)
    fitted = posterior(LoadTest.of(cell, rows))
    assert not score_visits(fitted, fitted.data, np.random.default_rng(0), 199).bad
    bad, = fit_stiffness(cell, rows).bad_visits
    found = bad.score.wrong_angle
    assert found is not None
    assert bad.score.name == pose
    assert found.joint == axis
    assert abs(np.degrees(found.missing) - off) < 3 * np.degrees(found.std)
    said = re.search(rf"odds of e\^{found.log_odds:.0f} that axis {axis} stood (\S+) \+- (\S+) degrees", sentence(bad))
    assert said is not None
    assert abs(float(said[1]) - off) < 1.5 * float(said[2])


def test_any_angle_is_tried_where_no_slip_of_the_pen_fits(tmp_path: Path) -> None:
    """A pose that was not read again: -2.617 degrees, of which no digit is as written."""
    cell, rows = read(71513, "ladder12", tmp_path, "P4", 5, -2.617)
    bad, = fit_stiffness(cell, rows).bad_visits
    stands = float(np.degrees(rows.theta[rows.pose == "P4"][0, 4]))
    told = [re.fullmatch(r"axis 5 is \S+ in the table; (\S+) \+- (\S+) would fit", mend.what) for mend in bad.mends]
    value, width = next((float(one[1]), float(one[2])) for one in told if one)
    assert abs(value - stands + 2.617) < 1.5 * width < 1.0


@pytest.mark.parametrize(("seed", "design"), [(71509, "poses20"), (71510, "ladder12")])
def test_right_angles_are_left_alone(seed: int, design: str, tmp_path: Path) -> None:
    fitted = posterior(LoadTest.of(*read(seed, design, tmp_path)))
    assert likeliest_wrong_angle(fitted, every_visit(fitted.data.rows)) is None
    assert bad_visits(fitted).bad == ()


def test_many_wrong_angles_are_no_single_slips(tmp_path: Path) -> None:
    """More than are asked for: none is told, and the rows stay as they are."""
    fitted = posterior(LoadTest.of(*read(71504, "ladder12", tmp_path, "P3", 5, 2.0)))
    assert wrong_angles(fitted, every_visit(fitted.data.rows), 0) == ([], fitted)
    (one,), rest = wrong_angles(fitted, every_visit(fitted.data.rows), 1)
    assert np.all(rest.data.rows.visit != one.visit)

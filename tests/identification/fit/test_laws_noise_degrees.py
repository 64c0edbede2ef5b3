"""How well the size of the noise is known: the textbook's degrees of freedom, of readings and of visits."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from identification.fit.load_test import LoadTest
from identification.fit.noise_degrees import NoiseDegrees
from identification.fit.posterior import Posterior, posterior
from identification.measurements import read_measurements
from identification.model.cell import read_cell
from identification.model.compliance import equilibrium
from tests.identification.fit.test_laws_posterior import TRUE
from tests.support import measurement_text, random_poses, write_cell

VISITS, ROWS = 20, 6
CELL = ("robot: irb6660-205-1.90\ntool: {{position_mm: [120, 0, 250]}}\n"
        "measurement: {{deflection_std_um: [2, 2, 2], force_relative_std: 0, pose_offset_std_um: [{0}, {0}, {0}]}}\n")
# What a stated size is worth beside the data: a normal of scale 0.3 in ln sigma, half of its precision in degrees of freedom.
STATED = 0.5 / 0.3**2


def fitted(folder: Path, offset_um: float) -> Posterior:
    """Twenty poses, six loads each; the sensor's 2 um and re-seating of that size are all the noise there is."""
    rng = np.random.default_rng(4)
    cell = read_cell(write_cell(folder, CELL.format(offset_um)))
    theta = np.repeat(random_poses(cell.robot, VISITS, rng, share=0.6), ROWS, axis=0)
    wrench = np.zeros((len(theta), 6))
    wrench[:, :3] = np.tile(300 * np.concatenate([np.eye(3), -np.eye(3)]), (VISITS, 1))
    seen = equilibrium(cell.robot, theta, cell.flange_from_tcp, wrench, 1 / TRUE).position
    seen += 2e-6 * rng.standard_normal(seen.shape)
    seen += 1e-6 * offset_um * np.repeat(rng.standard_normal((VISITS, 3)), ROWS, axis=0)
    path = folder / "m.csv"
    path.write_text(measurement_text(theta, wrench, 1e6 * seen))
    return posterior(LoadTest.of(cell, read_measurements(path, cell.robot)))


def degrees(found: Posterior, columns: np.ndarray) -> float:
    """Of a test of these columns, beside springs whose prior is as good as none."""
    design, precision = found.at_map.design, 1e-6 * np.eye(6)
    weights = found.weights
    cross = weights.inner(design, columns)
    left = weights.inner(columns, columns) - cross.T @ np.linalg.solve(weights.inner(design, design) + precision, cross)
    return NoiseDegrees(found, design, precision).along(columns, *np.linalg.eigh(left))


def test_of_a_sensor_they_are_the_readings_less_the_springs(tmp_path: Path) -> None:
    found = fitted(tmp_path, 0.0)
    columns = np.random.default_rng(1).standard_normal((VISITS * ROWS, 3, 2))
    assert abs(degrees(found, columns) - (3 * VISITS * ROWS - 6)) < 2 * STATED


def test_of_what_a_visit_shares_they_are_those_of_the_visits(tmp_path: Path) -> None:
    """Re-seating of 40 um: what is alike through a visit is judged by the visits, what changes within it by all readings."""
    found = fitted(tmp_path, 40.0)
    rng = np.random.default_rng(2)
    alike = np.repeat(rng.standard_normal((VISITS, 3, 2)), ROWS, axis=0)
    assert abs(degrees(found, alike) - 3 * VISITS) < 2 * STATED
    within = rng.standard_normal((VISITS, ROWS, 3, 2))
    within = (within - within.mean(axis=1, keepdims=True)).reshape(-1, 3, 2)
    assert abs(degrees(found, within) - 3 * VISITS * (ROWS - 1)) < 3 * STATED


def test_noise_that_is_known_gives_a_chi_squared(tmp_path: Path) -> None:
    found = fitted(tmp_path, 40.0)
    known = replace(found)
    vars(known)["components_covariance"] = np.zeros((6, 6))
    assert degrees(known, np.random.default_rng(3).standard_normal((VISITS * ROWS, 3, 2))) > 1e9

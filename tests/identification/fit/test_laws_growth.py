"""What a fit takes grows with the rows and no faster."""

from __future__ import annotations

import time
import tracemalloc
from dataclasses import replace
from pathlib import Path

import numpy as np

from identification.fit.load_test import LoadTest
from identification.fit.noise import noise_model
from identification.fit.noise_parts import SETUP, VarianceComponents
from identification.fit.validation import _single
from identification.measurements import Measurements, read_measurements
from identification.model.cell import Cell, read_cell
from identification.model.compliance import equilibrium
from tests.support import CELL, measurement_text, random_poses, write_cell

NOISE = "measurement: {deflection_std_um: [2, 2, 2], force_relative_std: 0.005, pose_offset_std_um: [3, 3, 3]}\n"
LOADS = 21
ROUNDS = 5
# As many as the springs, the arm's weight and the residual have.
COLUMNS = 17
# What is held a further row [bytes]; it was 408 when this was last written, and 3342 while the products of all rows were held
# before they were summed over the visits.
MOST_BYTES = 800


def load_test(folder: Path, count: int) -> tuple[Cell, Measurements]:
    """So many rows at poses of their own."""
    cell = read_cell(write_cell(folder, CELL + NOISE))
    rng = np.random.default_rng(count)
    visit = np.arange(count) // LOADS
    theta = random_poses(cell.robot, visit[-1] + 1, rng, share=0.6)[visit]
    wrench = np.concatenate([rng.uniform(-300, 300, (count, 3)), np.zeros((count, 3))], axis=1)
    moved = equilibrium(cell.robot, theta, cell.flange_from_tcp, wrench, 1 / cell.prior.stiffness).position
    file = folder / "measurements.csv"
    file.write_text(measurement_text(theta, wrench, 1e6 * moved, pose=[f"P{k}" for k in visit]))
    return cell, read_measurements(file, cell)


def held(folder: Path, count: int) -> int:
    """The most that is held at once while so many rows are weighted, beside the columns themselves [bytes]."""
    cell, rows = load_test(folder, count)
    noise = noise_model(LoadTest.of(cell, rows), 1 / cell.prior.stiffness).with_parts(SETUP)
    weights = noise.weights(VarianceComponents(setup=1.0))
    columns = np.random.default_rng(0).standard_normal((count, 3, COLUMNS))
    weights.inner(columns, columns)
    tracemalloc.start()
    try:
        weights.inner(columns, columns)
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


def test_memory_grows_with_the_rows(tmp_path: Path) -> None:
    few, many = 10_000, 20_000
    assert (held(tmp_path, many) - held(tmp_path, few)) / (many - few) < MOST_BYTES


def test_time_of_validation_rows_grows_with_them(tmp_path: Path) -> None:
    """Least CPU time of sixteen times the rows, 32 times at most: to hold each against all others takes over 50 times."""
    _, rows = load_test(tmp_path, LOADS)
    spent = [np.inf, np.inf]
    for _ in range(ROUNDS):             # of a few milliseconds the least is what it takes
        for place, count in enumerate((240 * LOADS, 3840 * LOADS)):
            numbers = np.arange(count)
            many = replace(rows, row=numbers, visit=numbers // LOADS)
            start = time.process_time()
            assert len(_single(many, numbers[::LOADS])) == count // LOADS
            spent[place] = min(spent[place], time.process_time() - start)
    assert spent[1] < 32 * spent[0]


def test_products_by_visit_are_those_of_each_visit_alone(tmp_path: Path) -> None:
    """Visits of all lengths, some longer than what is multiplied at once, their rows anywhere in the file."""
    cell, rows = load_test(tmp_path, 9000)
    model = noise_model(LoadTest.of(cell, rows), 1 / cell.prior.stiffness)
    rng = np.random.default_rng(4)
    visit = rng.permutation(np.concatenate([np.zeros(5000), rng.integers(1, 300, 4000)]).astype(np.intp))
    visit = np.unique(visit, return_inverse=True)[1]
    model = replace(model, visit=visit)
    left, right = rng.standard_normal((9000, 3, 2)), rng.standard_normal((9000, 3, 4))
    found = model.products(left, right)
    for number in range(model.visits):
        mine = visit == number
        np.testing.assert_allclose(found[number], np.einsum("nip,niq->pq", left[mine], right[mine]), atol=1e-9)

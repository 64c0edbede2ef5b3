"""What a diagnosis holds grows with the rows and no faster, also where every row is a pose of its own and dead weights leave it
to chance on which side of its play a gear rests."""

from __future__ import annotations

import tracemalloc
from pathlib import Path

import numpy as np

from identification.diagnosis.detect import goodness_of_fit
from identification.diagnosis.gain import gain
from identification.diagnosis.power import showing
from identification.diagnosis.search import survey
from identification.fit.load_test import LoadTest
from identification.fit.posterior import Posterior, posterior
from identification.measurements import read_measurements
from identification.model.cell import read_cell
from identification.model.effects import effects
from tests.support import CELL, measurement_text, random_poses, write_cell

NOISE = "measurement: {deflection_std_um: [2, 2, 2], force_relative_std: 0.005, pose_offset_std_um: [3, 3, 3]}\n"
GEAR = 4
HALF_GAP_RAD = 2e-4
FEWEST, FEW, MANY = 30, 100, 300
# What is held a further row [bytes]; it was 97 000 when this was last written, and 268 000 while all that a gear may do at each
# pose, and each pattern of a pose, was a column of all rows.
MOST_BYTES = 160_000


def load_test(folder: Path, count: int) -> tuple[LoadTest, Posterior]:
    """So many rows, each at a pose of its own under a weight, of a robot with play in one gear; and the fit of its springs."""
    cell = read_cell(write_cell(folder, CELL + NOISE))
    rng = np.random.default_rng(count)
    theta, wrench = random_poses(cell.robot, count, rng, share=0.6), np.zeros((count, 6))
    wrench[:, 2] = -rng.uniform(30, 300, count)
    file = folder / "measurements.csv"

    def read(moved: np.ndarray) -> LoadTest:
        file.write_text(measurement_text(theta, wrench, 1e6 * moved, pose=[f"P{k}" for k in range(count)]))
        return LoadTest.of(cell, read_measurements(file, cell.robot))

    state = read(np.zeros((count, 3))).load_state(1 / cell.prior.stiffness)
    moved = state.elastic + effects()["backlash"].contribution(state, GEAR, np.array([HALF_GAP_RAD, 0.7]))
    data = read(moved[:, :3] + 2e-6 * rng.standard_normal((count, 3)))
    return data, posterior(data)


def held(folder: Path, count: int) -> int:
    """The most that is held at once [bytes] by what a diagnosis does after the fit."""
    data, plain = load_test(folder, count)
    catalogue = {name: effects()[name] for name in ("backlash", "hysteresis")}
    rng = np.random.default_rng(0)
    tracemalloc.start()
    try:
        seen = survey(plain, catalogue, 2)
        best = next(one for one in seen.hypotheses if seen.name(one) == f"backlash[{GEAR}]")
        extended = posterior(data, seen.terms(best), plain)
        detected = goodness_of_fit(extended, catalogue, rng, replicates=19)
        showing(extended, catalogue, detected.critical)
        gain(data, plain, extended, rng)
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


def test_memory_of_single_rows_under_dead_weights_grows_with_them(tmp_path: Path) -> None:
    # The first imports what the others have then.
    _, few, many = (held(tmp_path, count) for count in (FEWEST, FEW, MANY))
    assert (many - few) / (MANY - FEW) < MOST_BYTES

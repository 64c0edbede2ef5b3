"""Force columns in the wrong order, on the virtual cell's end mill and on the sample: right logs are left in peace."""

from __future__ import annotations

from itertools import permutations
from pathlib import Path

import numpy as np
import pyarrow
import pytest
from pyarrow import parquet

from benchmarks import cut_direction, passes
from compensator.correction.files import Inputs
from compensator.forces.cut_direction import Travel, travel
from compensator.forces.placement import place_forces, read_force_log
from compensator.forces.swapped_columns import swapped_columns, turns_over
from compensator.path.robot_path import RobotPath, robot_path
from compensator.rapid import read_rapid
from identification.common.arrays import Array
from identification.model.cell import read_cell

ORDERS = [order for order in permutations(range(3)) if order != (0, 1, 2)]
FORCES = ("fx_n", "fy_n", "fz_n")


def told(path: RobotPath, force: Array, axes: Array, order: tuple[int, ...]) -> bool:
    """Of the force (N, 3), base frame, logged in these axes (N, 3, 3) with its columns in that order."""
    logged = np.einsum("nji,nj->ni", axes, force)[:, order]
    cuts = travel(path, np.any(force != 0, axis=1))
    return bool(swapped_columns(cuts, np.einsum("nij,nj->ni", axes, logged), axes, "log"))


@pytest.mark.parametrize("seed", range(6))
def test_right_columns_are_left_in_peace(tmp_path: Path, seed: int) -> None:
    """Passes beside each other and a slot and a pocket, with an axial force of either sign; benchmarks of both have more."""
    for rng in (np.random.default_rng((3078, seed, k)) for k in range(3)):
        job = passes.drawn(rng)
        force = job.force() * rng.uniform(0.8, 1.2, (len(job.points), 1)) * [1, 1, rng.uniform(-1, 4)]
        rasters = passes.written(job, tmp_path, rng)[0], force
        part = cut_direction.drawn(rng, tmp_path)[:2]
        for path, push in (rasters, part):
            for axes in (np.broadcast_to(np.eye(3), (len(push), 3, 3)), path.base_from_tcp.rotation):
                assert not told(path, push, axes, (0, 1, 2))


def test_many_other_orders_of_a_slot_and_a_pocket_are_told(tmp_path: Path) -> None:
    """Where the path turns about; of passes to and fro on a line few are."""
    said = []
    for seed in range(12):
        path, force, kind = cut_direction.drawn(np.random.default_rng((3078, seed)), tmp_path)
        if kind.startswith("slot and"):
            axes = np.broadcast_to(np.eye(3), (len(force), 3, 3))
            said += [told(path, force, axes, order) for order in ORDERS]
    assert len(said) >= 15
    assert np.mean(said) > 0.3


@pytest.mark.parametrize(("order", "mended"), [((0, 1, 2), ""), ((0, 2, 1), "fx_n fz_n fy_n")])
def test_the_samples_log_with_two_columns_changed(
    sample_inputs: Inputs, tmp_path: Path, order: tuple[int, ...], mended: str
) -> None:
    assert sample_inputs.forces is not None
    table = parquet.read_table(sample_inputs.forces)
    columns = {name: table[name] for name in table.column_names} | {FORCES[k]: table[FORCES[order[k]]] for k in range(3)}
    parquet.write_table(pyarrow.table(columns), tmp_path / "log.parquet")
    cell = read_cell(sample_inputs.cell)
    path = robot_path(read_rapid(sample_inputs.toolpath.read_bytes(), "insert.mod").toolpath, cell)
    found = place_forces(read_force_log(tmp_path / "log.parquet", cell.force_log.form), path, cell, tare=(0, 2)).findings
    said = [one.message for one in found if one.code == "CS3078"]
    assert len(said) == bool(mended)
    assert all(mended in one for one in said)


def to_and_fro(axial: Array, weight: Array) -> bool:
    """Whether forces (4,) [N] along the tool's axis, beside 20 N across it, turn with two moves each way of these weights."""
    feed = np.array([1.0, 1, -1, -1])[:, None] * np.eye(3)[0]
    up = np.tile(np.eye(3)[2], (4, 1))
    cuts = Travel(np.arange(4), feed, np.cross(up, feed), up, weight, np.zeros(4, dtype=np.intp))
    return turns_over(cuts, axial[:, None] * np.eye(3)[2] + 20.0 * np.eye(3)[1])


@pytest.mark.parametrize("metres", [0.003, 1.0, 7.0])
@pytest.mark.parametrize(("explained", "turns"), [(0.49, False), (0.51, True)])
def test_half_of_an_axial_force_that_turns_goes_with_the_travel(metres: float, explained: float, turns: bool) -> None:
    """However long the moves are; the rest of it is of either sign each way."""
    with_travel, rest = 60 * np.sqrt(explained), 60 * np.sqrt(1 - explained)
    axial = with_travel * np.array([1.0, 1, -1, -1]) + rest * np.array([1.0, -1, 1, -1])
    assert to_and_fro(axial, np.full(4, metres)) == turns
    # A move three times as long counts as three do: the mean of both is what it was, and so is what goes with the travel.
    assert to_and_fro(axial, metres * np.array([3.0, 3, 3, 3])) == turns


@pytest.mark.parametrize(("axial", "mean", "turns"), [
    # Beside 20 N across it 0.3 of the whole are 6.29 N; its mean under half of its RMS, where it goes with the travel.
    (6.2, 0.0, False), (6.4, 0.0, True), (60.0, 34.0, True), (60.0, 35.0, False)])
def test_an_axial_force_that_turns_is_large_and_of_either_sign(axial: float, mean: float, turns: bool) -> None:
    assert to_and_fro(axial * np.array([1.0, 1, -1, -1]) + mean, np.array([0.5, 1.5, 1.0, 1.0])) == turns

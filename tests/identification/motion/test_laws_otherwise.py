"""The same joint log described otherwise has the same answer: another sense, other zeros, another clock, another order."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from identification.model.cell import Cell, read_cell
from identification.motion.fit import fit_joint_logs
from identification.motion.log_file import read_motion_log
from tests.identification.motion.simulated_joint import columns, write

Columns = dict[str, np.ndarray]
ROBOT = "name: bench\nprior:\n  stiffness_nm_per_rad: [4.0e6, 4.0e6, 4.0e6, 0.5e6, 0.5e6, 0.3e6]\n  relative_std: 2.0\n"
WAYS: dict[str, Callable[[Columns], Columns]] = {
    "the other sense": lambda log: {name: values if name == "time_s" else -values for name, values in log.items()},
    "another clock": lambda log: log | {"time_s": log["time_s"] + 4000},
    "a clock that is fast": lambda log: log | {"time_s": log["time_s"] * (1 + 2e-5)},
    "a clock that is slow": lambda log: log | {"time_s": log["time_s"] * (1 - 2e-5)},
    "another zero": lambda log: {name: values + 7.25 if name.endswith("_deg") else values for name, values in log.items()},
    "another zero of the link": lambda log: {
        name: values - 0.01 if name.endswith("link_deg") else values for name, values in log.items()},
    "columns in another order": lambda log: dict(reversed(log.items())),
}


@pytest.fixture(scope="module")
def cell(tmp_path_factory: pytest.TempPathFactory) -> Cell:
    folder = tmp_path_factory.mktemp("cell")
    (folder / "robot.yaml").write_text(ROBOT)
    (folder / "cell.yaml").write_text("robot: robot.yaml\ntool: {position_mm: [0, 0, 0]}\n")
    return read_cell(folder / "cell.yaml", geometry=False)


@pytest.fixture(scope="module")
def log() -> Columns:
    return columns(3, {"channel_delay": 1.0, "joint_friction": 1.0})


def answer(cell: Cell, file: Path, log: Columns) -> tuple[list[float], list[str]]:
    """The stiffness of joint 2, its 1 sigma, its lag; its grade and what is said."""
    fit = fit_joint_logs(cell, [read_motion_log(write(file, log))])
    [joint] = fit.joints
    return [joint.compliance, joint.noise_std, joint.law_std, *joint.delay], [joint.grade, *(one.code for one in fit.findings)]


@pytest.mark.parametrize("way", WAYS)
def test_a_log_described_otherwise_has_the_same_stiffness(tmp_path: Path, cell: Cell, log: Columns, way: str) -> None:
    was, now = (answer(cell, tmp_path / f"{name}.csv", one) for name, one in (("was", log), ("now", WAYS[way](log))))
    np.testing.assert_allclose(now[0], was[0], rtol=5e-4)
    assert now[1] == was[1]

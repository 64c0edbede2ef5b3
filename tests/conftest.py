"""The sample job, run once: identify, predict and correct on the shipped files."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from compensator.correction.correct import Corrected, correct
from compensator.correction.files import Inputs, predict_files
from compensator.correction.settings import Settings
from identification.common.shipped import shipped
from identification.fit.fit import fit_stiffness
from identification.measurements import read_measurements
from identification.model.cell import read_cell

TARE = (0, 2)


def pytest_addoption(parser: pytest.Parser) -> None:
    """`--no-posix`: without what Windows does not have (tests/without_posix/removal.py)."""
    parser.addoption("--no-posix", action="store_true", help="take fcntl, fork, POSIX signals and renames over open files away")


@pytest.fixture(scope="session")
def sample_inputs(tmp_path_factory: pytest.TempPathFactory) -> Inputs:
    """The shipped files, with the stiffnesses identified from the shipped measurements."""
    samples = shipped("samples")
    cell = read_cell(samples / "cell.yaml")
    fit = fit_stiffness(cell, read_measurements(samples / "measurements.csv", cell.robot))
    stiffness: Path = tmp_path_factory.mktemp("sample") / "stiffness.json"
    stiffness.write_text(json.dumps(fit.model.as_dict()))
    return Inputs(samples / "cell.yaml", samples / "insert.mod", stiffness, samples / "insert.forces.parquet")


@pytest.fixture(scope="session")
def sample(sample_inputs: Inputs) -> Corrected:
    """The corrected sample program."""
    return correct(predict_files(sample_inputs, Settings.of(tare=(TARE,))))

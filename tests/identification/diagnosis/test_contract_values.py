"""Fit, Diagnosis and PlanOutlook as values: what the command shows is what they say of themselves."""

from __future__ import annotations

import json
from dataclasses import FrozenInstanceError
from pathlib import Path

import numpy as np
import pytest

from identification.common.shipped import shipped
from identification.diagnosis.diagnose import diagnose
from identification.diagnosis.plan import judge_plan
from identification.fit.fit import fit_stiffness
from identification.measurements import Measurements, read_measurements
from identification.model.cell import Cell, read_cell
from tests.support import compstiff

SAMPLES = shipped("samples")


@pytest.fixture(scope="module")
def sample() -> tuple[Cell, Measurements]:
    cell = read_cell(SAMPLES / "cell.yaml")
    return cell, read_measurements(SAMPLES / "measurements.csv", cell.robot)


def shown(*arguments: object) -> tuple[list[str], dict[str, object]]:
    """What a command prints without and with --json."""
    plain, as_json = compstiff(*arguments), compstiff(*arguments, "--json", *(["--force"] if "-o" in arguments else []))
    assert plain.returncode == as_json.returncode == 0, plain.stderr + as_json.stderr
    return plain.stdout.splitlines(), json.loads(as_json.stdout)["result"]


def test_a_fit(sample: tuple[Cell, Measurements], tmp_path: Path) -> None:
    fit = fit_stiffness(*sample)
    assert (fit.lines(), fit.as_dict()) == shown(
        "identify", SAMPLES / "cell.yaml", SAMPLES / "measurements.csv", "-o", tmp_path / "stiffness.json")
    with pytest.raises(FrozenInstanceError):
        fit.held_out = None                                                                     # type: ignore[misc]
    with pytest.raises(ValueError, match="read-only"):
        fit.residual[0] = 0.0


def test_a_diagnosis(sample: tuple[Cell, Measurements], tmp_path: Path) -> None:
    diagnosis = diagnose(*sample, replicates=49)
    assert (diagnosis.lines(), diagnosis.as_dict()) == shown(
        "diagnose", SAMPLES / "cell.yaml", SAMPLES / "measurements.csv", "-o", tmp_path / "diagnosis.json", "--replicates", 49)
    model = diagnosis.extended()
    assert diagnosis.verdict == "adequate"
    assert model.effects == ()
    np.testing.assert_array_equal(model.mean, fit_stiffness(*sample).model.mean)


def test_an_outlook(sample: tuple[Cell, Measurements]) -> None:
    outlook = judge_plan(*sample)
    assert (outlook.lines(), outlook.as_dict()) == shown(
        "diagnose", SAMPLES / "cell.yaml", "--plan", SAMPLES / "measurements.csv")
    assert sum(outlook.counts.values()) == len(outlook.effects)

"""Fit, Diagnosis and PlanOutlook as values: what the command shows is what they say of themselves."""

from __future__ import annotations

import json
from dataclasses import FrozenInstanceError, replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from identification.common.shipped import shipped
from identification.diagnosis.diagnose import diagnose
from identification.diagnosis.judgement import Judgement
from identification.diagnosis.plan import judge_plan
from identification.fit.fit import fit_stiffness
from identification.fit.load_test import LoadTest
from identification.fit.noise_parts import VarianceComponents
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


@pytest.mark.parametrize("verdict", ["ambiguous", "unknown", "mistake", "adequate"])
def test_noise_that_grew_for_want_of_a_cause_is_not_what_the_noise_allows(
        sample: tuple[Cell, Measurements], verdict: str) -> None:
    """Where the model is rejected: as usual, of the sensor as estimated; what the file states, as stated."""
    data = LoadTest.of(*sample)
    compliance = np.full(6, 1e-6)

    def allowed(components: VarianceComponents, *stated: int) -> float:
        judgement = SimpleNamespace(
            verdict=verdict, extended=SimpleNamespace(components=components, compliance=compliance),
            plain=SimpleNamespace(data=data, at_map=SimpleNamespace(noise=SimpleNamespace(
                stated=tuple(part in stated for part in range(6))))))
        expected_std: property = Judgement.__dict__["expected_std"]
        assert expected_std.fget is not None
        return float(np.sqrt(np.mean(expected_std.fget(judgement) ** 2)))

    usual = VarianceComponents(sensor=1.5)
    bare = allowed(usual)
    for grown in ({"force": 4.0}, {"absolute": 4.0}, {"offset": 4.0}, {"setup": 4.0}, {"degrees": 2.5}):
        assert (allowed(replace(usual, **grown)) == bare) is (verdict != "adequate"), grown
        assert verdict != "adequate" or allowed(replace(usual, **grown)) > bare
    sensor_alone = dict.fromkeys(("force", "absolute", "offset"), 0.0)
    quiet = allowed(VarianceComponents(sensor=1.0, **sensor_alone))
    assert allowed(VarianceComponents(sensor=1.5, **sensor_alone)) == pytest.approx(1.5 * quiet)
    if verdict != "adequate":
        assert allowed(VarianceComponents(sensor=1.5, **sensor_alone), 0) == pytest.approx(quiet)

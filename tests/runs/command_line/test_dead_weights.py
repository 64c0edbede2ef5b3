"""Commissioning with two weights from plan to diagnosis: the command line plans, the virtual cell measures, the command line
identifies and diagnoses."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from compstiff.cli.main import compstiff
from identification.measurements import read_measurements
from identification.model.cell import read_cell
from tests.virtual_cell.cell import Case, Hidden, simulate
from tests.virtual_cell.designs import Design


def run(*arguments: object) -> dict:
    done = CliRunner().invoke(compstiff, [str(argument) for argument in (*arguments, "--json")])
    assert done.exit_code == 0, done.output
    return json.loads(done.stdout)


@pytest.fixture(scope="module")
def planned(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Design, dict]:
    """The cell's files and a plan for it, as rows that the virtual cell can take."""
    folder = tmp_path_factory.mktemp("weights")
    simulate(0, "hung12").write(folder)
    document = run("design", folder / "cell.yaml", "--dead-weight", "20,40", "-o", folder / "plan.csv", "--validate", 3,
                   "--quick")
    cell = read_cell(folder / "cell.yaml")
    rows = read_measurements(folder / "plan.csv", cell, planned=True)
    design = Design(rows.theta, rows.wrench[:, :3], rows.time, rows.dwell, rows.visit + 1, rows.validate)
    return folder, design, document


def filled(planned: tuple[Path, Design, dict], seed: int, *hidden: Hidden) -> tuple[Case, Path, Path]:
    """The plan with what the virtual cell reads, beside the cell file of that case."""
    folder, design, _ = planned
    case = simulate(seed, design, hidden)
    here = folder / "_".join([str(seed), *(each.effect for each in hidden)])
    cell, _ = case.write(here)
    readings = (",".join(f"{x:.1f}" for x in row) for row in case.deflection_um)
    lines = [line if line.startswith(("#", "q1")) else line.replace(",,,,", f",{next(readings)},")
             for line in (folder / "plan.csv").read_text().splitlines()]
    (here / "filled.csv").write_text("\n".join(lines) + "\n")
    return case, cell, here / "filled.csv"


def test_the_plan_says_what_it_cannot_show(planned: tuple[Path, Design, dict]) -> None:
    _, design, document = planned
    assert [one["joint"] for one in document["result"]["unseen"]] == [1]
    assert any(finding["code"] == "CS1507" for finding in document["findings"])
    assert set(np.round(design.load[:, 2] / -9.80665, 9)) == {0.0, 20.0, 40.0}
    assert (design.load[:, :2] == 0).all()


@pytest.mark.parametrize("seed", [1, 2, pytest.param(3, marks=pytest.mark.long)])
def test_from_the_plan_to_the_diagnosis(planned: tuple[Path, Design, dict], seed: int) -> None:
    case, cell, file = filled(planned, seed)
    fitted = run("identify", cell, file, "-o", file.with_name("stiffness.json"))["result"]
    grades = [parameter["grade"] for parameter in fitted["parameters"]]
    assert grades[0] == "not identifiable"
    assert "no load turns it" in fitted["details"]["grades"][0]["reason"]
    first = fitted["parameters"][0]["interval_95"]
    assert first[1] / first[0] > 50                                                     # the prior's own width
    for joint in (2, 3, 4, 5):
        parameter = fitted["parameters"][joint - 1]
        assert grades[joint - 1] == "reliable"
        error = np.log(parameter["estimate"] / case.stiffness[joint - 1])
        low, high = np.log(parameter["interval_95"])
        assert abs(error) < (high - low)                                                # 3.9 sigma
        assert abs(error) < 0.2
    diagnosed = run("diagnose", cell, file, "-o", file.with_name("diagnosis.json"))["result"]
    assert diagnosed["verdict"] != "named", diagnosed["causes"]


def test_one_rope_over_a_pulley_shows_joint_1(planned: tuple[Path, Design, dict]) -> None:
    """A zero reading and the load that the plan names, appended as a visit with forces: k1 as well known as forecast."""
    folder, design, document = planned
    (told,) = document["result"]["unseen"]
    q = next(visit["q_deg"] for visit in document["result"]["visits"] if visit["pose"] == told["pose"])
    theta = np.vstack([design.theta, np.radians([q, q])])
    load = np.vstack([design.load, np.zeros(3), told["force_n"]])
    time = np.append(design.time, design.time[-1] + [120.0, 180.0])
    more = Design(theta, load, time, np.append(design.dwell, [20.0, 60.0]), np.append(design.pose, [design.pose[-1] + 1] * 2),
                  np.append(design.validate, [False, False]))
    case = simulate(4, more)
    cell, file = case.write(folder / "pulley")
    fitted = run("identify", cell, file, "-o", file.with_name("stiffness.json"))["result"]["parameters"][0]
    assert fitted["grade"] == "reliable"
    assert fitted["std"] / fitted["estimate"] < 3 * told["log_std_after"]
    assert abs(np.log(fitted["estimate"] / case.stiffness[0])) < 4 * fitted["std"] / fitted["estimate"]


def test_a_hook_beside_the_tool_is_named(planned: tuple[Path, Design, dict]) -> None:
    _, cell, file = filled(planned, 5, Hidden("hook_offset", None, 1.5))
    diagnosed = run("diagnose", cell, file, "-o", file.with_name("diagnosis.json"))["result"]
    # This seed's sensors have heavy tails: one reading of 4.5 sigma may be called a bad row beside it.
    assert [cause["effect"] for cause in diagnosed["causes"] if "single_row" not in cause["parameters"]] == ["hook_offset"]

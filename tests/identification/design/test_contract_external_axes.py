"""`design` in a cell with mechanical units: the arm's plan is the same, its program leaves them where they stand."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

import compstiff
from compstiff.cli.design import design
from tests.identification.design.conftest import CELL
from tests.runs.milling.carried_job import CarriedJob, slide_yaml, table_yaml
from tests.runs.milling.line_job import LINES
from tests.support import write_cell

UNITS = {"none": "", "both": "mechanical_units:\n" + slide_yaml() + table_yaml(),
         "idle": "mechanical_units:\n" + slide_yaml().replace("carries: robot", "carries: nothing")}


def run(*arguments: object) -> dict:
    done = CliRunner().invoke(design, [*map(str, arguments), "--json"])
    assert done.exit_code == 0, done.output
    return json.loads(done.stdout)


@pytest.fixture(scope="module")
def planned(tmp_path_factory: pytest.TempPathFactory) -> dict[str, tuple[Path, dict]]:
    found = {}
    for name, units in UNITS.items():
        folder = tmp_path_factory.mktemp(name)
        cell = write_cell(folder, CELL + units)
        found[name] = folder, run(cell, "-o", folder / "plan.csv", "--measurements", 2, "--axes", "z", "--quick",
                                  "--rapid", folder / "plan.mod")
    return found


@pytest.mark.parametrize("name", ["both", "idle"])
def test_the_plan_is_the_arm_s(planned: dict[str, tuple[Path, dict]], name: str) -> None:
    """Springs sit in the arm: poses and loads are those of the cell without units."""
    assert (planned[name][0] / "plan.csv").read_bytes() == (planned["none"][0] / "plan.csv").read_bytes()


# rapidchecker 0.1.5 calls pyparsing by its old names; can go when it does not
@pytest.mark.filterwarnings("ignore:.*deprecated.*use:DeprecationWarning")
@pytest.mark.parametrize("name", list(UNITS))
def test_the_program_leaves_the_units_where_they_stand(planned: dict[str, tuple[Path, dict]], name: str) -> None:
    """An active external axis without a value stops a controller; one that the controller does not have takes none."""
    folder, document = planned[name]
    text = (folder / "plan.mod").read_text()
    moves = re.findall(r"MoveAbsJ \[(\[[^\]]*\]),([^;]*)\]\\NoEOffs", text)
    plain = re.findall(r"MoveAbsJ \[(\[[^\]]*\]),", (planned["none"][0] / "plan.mod").read_text())
    assert [joints for joints, _ in moves] == plain
    assert len(plain) == text.count("MoveAbsJ") >= 6
    codes = [finding["code"] for finding in document["findings"]]
    if name in ("none", "idle"):
        assert {units for _, units in moves} == {"[9E9,9E9,9E9,9E9,9E9,9E9]"}
        assert "jStart" not in text
        assert "CS4600" not in codes
    else:
        assert {units for _, units in moves} == {"jStart.extax"}
        assert text.index("VAR jointtarget jStart;") < text.index("jStart:=CJointT();") < text.index("MoveAbsJ")
        assert codes.count("CS4600") == 1
    check = pytest.importorskip("rapidchecker.check", reason="rapidchecker is not installed: no independent grammar")
    assert check.check_format(text.split("%%%")[2].lstrip()) == []


@pytest.mark.parametrize("on", ["slide", "table", "both"])
def test_poses_of_a_carried_program_are_where_the_units_put_them(tmp_path: Path, on: str) -> None:
    """--toolpath: the deviation is wanted where the arm really stands, which is not where it would without its track."""
    job = CarriedJob(tmp_path, LINES, on=on)
    ready = job.job("target,fx_n,fy_n,fz_n\n" + "".join(f"{number},100,20,-50\n" for number in range(len(job.xy))))
    ready.program = job.program
    ready.write()
    cell = compstiff.read_cell(tmp_path / "cell.yaml")
    poses = compstiff.milling_poses(cell, tmp_path / "part.mod", tmp_path / "forces.csv")
    origin, turned = job.stands(job.values)
    place = origin + turned.apply(np.array([pose.p for pose in job.poses]))
    assert len(poses.tcp) > 3
    away = np.linalg.norm(poses.tcp[:, None] - place[None], axis=2).min(axis=1)
    assert away.max() < 1e-6
    if on == "both":
        document = run(tmp_path / "cell.yaml", "-o", tmp_path / "plan.csv", "--measurements", 2, "--axes", "z", "--quick",
                       "--toolpath", tmp_path / "part.mod", "--forces", tmp_path / "forces.csv")
        assert document["result"]["certificate"]["efficiency"] > 0.5

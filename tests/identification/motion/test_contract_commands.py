"""`identify` and `diagnose` on joint deflection logs, through the command line's own functions."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner
from scipy.stats import norm

from compstiff.cli.main import compstiff
from identification.model.cell import read_cell
from identification.model.stiffness_file import read_stiffness
from identification.motion.fit import fit_joint_logs, stiffness_findings
from identification.motion.log_file import read_motion_log
from identification.motion.zeros import ZeroShift
from tests.identification.motion.simulated_joint import columns, write

ROBOT = "name: bench\nprior:\n  stiffness_nm_per_rad: [4.0e6, 4.0e6, 4.0e6, 0.5e6, 0.5e6, 0.3e6]\n  relative_std: 2.0\n"


@pytest.fixture
def cell(tmp_path: Path) -> Path:
    (tmp_path / "robot.yaml").write_text(ROBOT)
    (tmp_path / "cell.yaml").write_text("robot: robot.yaml\ntool: {position_mm: [0, 0, 0]}\n")
    return tmp_path / "cell.yaml"


def run(*arguments: object) -> tuple[int, dict[str, Any]]:
    few = ("--replicates", "49") if arguments[0] == "diagnose" else ()
    result = CliRunner().invoke(compstiff, [*map(str, arguments), *few, "--json"])
    return result.exit_code, json.loads(result.stdout) if result.stdout.startswith("{") else {}


def test_identify(tmp_path: Path, cell: Path) -> None:
    log = write(tmp_path / "a.csv", columns(0, {"channel_delay": 1.0, "joint_friction": 1.0}))
    code, document = run("identify", cell, log, "-o", tmp_path / "s.json", "--report", tmp_path / "s.html")
    assert code == 0
    content = json.loads((tmp_path / "s.json").read_text())
    parameters = {one["name"]: one for one in content["parameters"]}
    low, high = parameters["k2"]["interval_95"]
    assert low < 5e6 < high
    assert parameters["k2"]["grade"] == "reliable"
    assert parameters["k1"]["grade"] == "not identifiable"
    assert parameters["k1"]["estimate"] == pytest.approx(4e6)
    assert [finding["message"] for finding in document["findings"] if finding["code"] == "CS1504"] == [
        "k1, k3, k4, k5, k6: no link encoder in the log; the value is the prior's"]
    model = read_stiffness(tmp_path / "s.json", read_cell(cell, geometry=False))
    assert model.stiffness[1] == pytest.approx(parameters["k2"]["estimate"])


def test_two_logs_that_disagree(tmp_path: Path, cell: Path) -> None:
    logs = [write(tmp_path / f"{k}.csv", columns(k, {}, stiffness=k * 1e6)) for k in (5, 8)]
    code, document = run("identify", cell, logs[0], "--also", logs[1], "-o", tmp_path / "s.json")
    assert code == 0
    (said,) = [finding["message"] for finding in document["findings"] if finding["code"] == "CS1503"]
    told = re.fullmatch(r"the records disagree on k2 by (\S+) standard deviations "
                        r"\(.*5.csv: (\S+), .*8.csv: (\S+) N m/rad\)", said)
    assert told
    assert float(told[1]) > 10
    assert [float(told[2]), float(told[3])] == pytest.approx([5e6, 8e6], rel=0.05)
    parameters = {one["name"]: one for one in json.loads((tmp_path / "s.json").read_text())["parameters"]}
    assert parameters["k2"]["grade"] == "tentative"


def test_logs_disagree_where_chance_makes_them_do_so_in_one_of_a_hundred(tmp_path: Path, cell: Path) -> None:
    logs = [read_motion_log(write(tmp_path / f"{k}.csv", columns(k, {}, seconds=10))) for k in (1, 2)]
    fit = fit_joint_logs(read_cell(cell, geometry=False), logs)
    (joint,) = fit.joints
    assert (len(joint.records), joint.grade) == (2, "reliable")
    for chance, said in ((0.011, False), (0.009, True)):
        apart = replace(joint, apart=float(norm.isf(chance / 2)))
        assert [finding.code for finding in stiffness_findings(logs, [apart])] == ["CS1504", *["CS1503"] * said]
    six = [replace(joint, joint=number) for number in range(1, 7)]
    assert stiffness_findings(logs, six) == ()


def test_diagnose(tmp_path: Path, cell: Path) -> None:
    fault = {"hysteresis": 1.0}
    logs = [write(tmp_path / f"{k}.csv", columns(k, fault)) for k in (1, 2)]
    code, document = run("diagnose", cell, logs[0], "--validate", logs[1], "-o", tmp_path / "d.json", "--extended",
                         tmp_path / "e.json", "--report", tmp_path / "d.html")
    assert code == 0
    content = json.loads((tmp_path / "d.json").read_text())
    assert content == document["result"]
    assert content["verdict"] == "named"
    assert content["misfit"]["p_value"] == content["misfit"]["p_resolution"] == 1 / 50      # 49 replicates, none as large
    assert [(cause["effect"], cause["joint"]) for cause in content["causes"]] == [("hysteresis", 2)]
    assert content["gain"]["rms_after_urad"] < content["gain"]["rms_before_urad"]
    assert content["gain"]["held_out"].startswith("validate")
    model = read_stiffness(tmp_path / "e.json", read_cell(cell, geometry=False))
    assert [one.label for one in model.effects] == ["hysteresis[2]"]
    assert "offline" not in (tmp_path / "d.html").read_text()[:10]


def test_one_log_is_held_out_in_blocks(tmp_path: Path, cell: Path) -> None:
    log = write(tmp_path / "a.csv", columns(0, {"channel_delay": 1.0}))
    code, document = run("diagnose", cell, log, "-o", tmp_path / "d.json")
    assert code == 0
    assert document["result"]["causes"][0] | {"parameters": None, "sentence": None, "probability": None} == {
        "effect": "channel_delay", "joint": None, "channel": "link", "probability": None, "family": "force measurement",
        "of_robot": False, "sentence": None, "parameters": None}
    assert "blocks of time" in document["result"]["gain"]["held_out"]


def test_geometry_is_asked_for_where_it_is_needed(tmp_path: Path, cell: Path) -> None:
    (tmp_path / "m.csv").write_text("q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg,fx_n,fy_n,fz_n,dx_um,dy_um,dz_um\n"
                                    "0,0,0,0,30,0,100,0,0,10,0,0\n")
    code, document = run("identify", cell, tmp_path / "m.csv", "-o", tmp_path / "s.json")
    assert code == 1
    assert document["findings"][0]["code"] == "CS0105"


def test_options_that_do_not_fit(tmp_path: Path, cell: Path) -> None:
    log = write(tmp_path / "a.csv", columns(0, {}, seconds=5))
    assert run("identify", cell, log, "-o", tmp_path / "s.json", "--profile")[0] == 2
    (tmp_path / "m.csv").write_text("q1_deg\n1\n")
    assert run("diagnose", cell, tmp_path / "m.csv", "--validate", log, "-o", tmp_path / "d.json")[0] == 2


def test_further_logs_are_fitted_and_each_is_predicted_by_the_others(tmp_path: Path, cell: Path) -> None:
    fault = {"channel_delay": 1.0}
    logs = [write(tmp_path / f"{k}.csv", columns(k, fault, seconds=10)) for k in (1, 2)]
    code, document = run("diagnose", cell, logs[0], "--also", logs[1], "-o", tmp_path / "d.json", "--replicates", 49)
    assert code == 0
    result = document["result"]
    assert result["gain"]["held_out"] == "each record by the others"
    assert result["records"] == [str(log) for log in logs]
    assert [cause["effect"] for cause in result["causes"]] == ["channel_delay"]
    (joint,) = result["joints"]
    (zero,) = joint["zero_shifts"]
    assert [zero["reference"], zero["record"]] == [str(log) for log in logs]
    assert not zero["moved"]
    assert "CS1610" not in [finding["code"] for finding in document["findings"]]
    assert joint["transmission_error"]["named"] is False
    assert set(result["gain"]["by_joint"]["2"]["with_fitted_zero"]) == {"rms_before_urad", "rms_after_urad", "ratio"}


def test_a_zero_that_moved_and_a_log_given_twice(tmp_path: Path, cell: Path) -> None:
    values = columns(1, {"channel_delay": 1.0}, seconds=10)
    other = columns(2, {"channel_delay": 1.0}, seconds=10)
    other["q2_link_deg"] = other["q2_link_deg"] + 0.14
    logs = [write(tmp_path / "a.csv", values), write(tmp_path / "b.csv", other), write(tmp_path / "c.csv", values)]
    code, document = run("diagnose", cell, logs[0], "--validate", logs[1], "-o", tmp_path / "d.json", "--replicates", 49)
    assert code == 0
    (said,) = [finding for finding in document["findings"] if finding["code"] == "CS1610"]
    told = re.fullmatch(r"joint 2: the zero between its encoders differs by (\S+) urad \((\S+) ... (\S+)\) from "
                        r".*a.csv to .*b.csv, 2.4 mm at 1 m from the axis", said["message"])
    assert told, said["message"]
    shift, low, high = map(float, told.groups())
    assert low < -1e6 * np.radians(0.14) < high         # the motor less the link
    assert shift == pytest.approx((low + high) / 2, abs=1)
    assert high - low < 40
    assert said["file"] == str(logs[1])
    for command in ("diagnose", "identify"):
        code, document = run(command, cell, logs[0], "--also", logs[2], "-o", tmp_path / "x.json")
        assert code == 1
        (said,) = document["findings"]
        assert (said["code"], said["file"]) == ("CS1616", str(logs[2]))
        assert said["message"] == f"holds the same samples as {logs[0]}"


@pytest.mark.parametrize(("sigmas", "moved"), [(3.28, False), (-3.28, False), (3.30, True), (-3.30, True)])
def test_a_zero_has_moved_where_chance_moves_it_once_in_a_thousand_times(sigmas: float, moved: bool) -> None:
    assert 2 * norm.sf(3.29) == pytest.approx(0.001, rel=0.01)
    assert ZeroShift(2, "a.csv", "b.csv", 1e-5 * sigmas, 1e-5).moved == moved


def test_also_is_for_logs(tmp_path: Path, cell: Path) -> None:
    (tmp_path / "m.csv").write_text("q1_deg\n1\n")
    assert run("diagnose", cell, tmp_path / "m.csv", "--also", tmp_path / "m.csv", "-o", tmp_path / "d.json")[0] == 2
    assert run("diagnose", cell, tmp_path / "m.csv", "--validate", tmp_path / "m.csv", "-o", tmp_path / "d.json")[0] == 2

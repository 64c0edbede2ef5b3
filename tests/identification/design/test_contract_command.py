"""What `compstiff design` writes: admissible, readable by what comes next, the same for the same seed."""

from __future__ import annotations

import csv
import html
import json
import re
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import click
import numpy as np
import pytest
from click.testing import CliRunner

import compstiff
from compensator.rapid import read_rapid
from compstiff.cli.design import design
from compstiff.cli.diagnose import diagnose
from identification.common.findings import CompstiffError
from identification.design import procedure
from identification.design.discrimination import Diagnosed
from identification.design.domain import Domain
from identification.design.forecast import Forecast, JointForecast
from identification.design.information import instrument
from identification.design.kept_back import distances
from identification.design.loads import slot
from identification.design.order import imbalance, run_order, travel
from identification.design.pages import design_report
from identification.design.plan import DesignPlan
from identification.design.procedure import design_plan
from identification.design.program import _identifier
from identification.design.request import Request
from identification.design.search import Effort, optimal_design
from identification.diagnosis.plan import judge_plan
from identification.fit.fit import fit_stiffness
from identification.measurements import read_measurements
from identification.model.cell import read_cell
from identification.model.compliance import deviation
from identification.model.kinematics import chain, forward
from tests.identification.design.conftest import CELL
from tests.support import write_cell

ROOT = Path(__file__).resolve().parents[3]
RUNS = 3
TRUTH = np.array([1.4e6, 4.1e6, 2.6e6, 0.31e6, 0.27e6, 0.09e6])


def run(*arguments):
    return CliRunner().invoke(design, [str(argument) for argument in arguments])


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    folder = tmp_path_factory.mktemp("command")
    path = write_cell(folder, CELL)
    result = run(path, "-o", folder / "plan.csv", "--measurements", RUNS, "--quick", "--rapid", folder / "plan.mod", "--report",
                 folder / "plan.html", "--json")
    assert result.exit_code == 0, result.output
    return folder, json.loads(result.stdout)


def test_few_of_the_causes_that_are_not_told_apart_are_named():
    alike = [SimpleNamespace(grade="detectable", alike=("base_rocking",), entry=SimpleNamespace(label=f"uneven_gear_{k}"))
             for k in range(20)]
    many, few = (Forecast((), tuple(alike[:count]), {}, (), (), ()).cause_lines() for count in (20, 6))
    assert [line for line in many if line.startswith("  and ")] == [
        "  and 14 more: compstiff diagnose --plan has them all"]
    assert len(many) == len(few) + 1


# Long: the example of design_plan runs in tests/compstiff/test_contract_front_door.py, and what the command writes is read
# above.
@pytest.mark.long
def test_a_script_gets_what_the_command_writes(written, tmp_path):
    """The command is a thin skin: same files, same JSON, from the room's own function."""
    cell = written[0] / "cell.yaml"
    result = run(cell, "-o", tmp_path / "plan.csv", "--measurements", 1, "--axes", "z", "--quick", "--rapid",
                 tmp_path / "plan.mod", "--json")
    plan = design_plan(read_cell(cell), Request(measurements=1, axes="z"), quick=True)
    assert plan.csv() == (tmp_path / "plan.csv").read_bytes()
    assert plan.rapid("plan").content == (tmp_path / "plan.mod").read_bytes()
    assert json.loads(json.dumps(plan.as_dict())) == json.loads(result.stdout)["result"]
    assert not plan.sheet.theta.flags.writeable


@pytest.mark.parametrize("options", [
    {"positions_mm": ((1.0, 2.0, 3.0),), "box_mm": (1.0, 2.0, 3.0, 4.0, 5.0, 6.0)}, {"preset": "paper", "measurements": 3},
    {"free": True, "every_axis": True}, {"free": True, "preset": "outlook"}, {"free": True, "axes": "xy"},
    {"diagnosis": Diagnosed("ambiguous", (), (), "diagnosis.json")}])
def test_requests_that_contradict_themselves(options):
    with pytest.raises(ValueError, match=r"exclude|leave|takes no|belongs"):
        Request(**options)


def test_the_written_rows_keep_every_limit(written):
    folder, _ = written
    cell = read_cell(folder / "cell.yaml")
    rows = read_measurements(folder / "plan.csv", cell.robot, planned=True)
    assert len(rows) == RUNS * 7
    force = rows.wrench[:, :3]
    assert np.abs(force).max() == 300
    assert ((force != 0).sum(axis=1) <= 1).all()
    assert (force == 0).all(axis=1).sum() == RUNS * 2
    assert rows.visit.max() == rows.reference.max() == RUNS - 1
    tcp = forward(cell.robot, rows.theta, cell.flange_from_tcp).position
    assert np.abs(tcp - tcp[0]).max() < 1e-6
    domain = Domain(instrument(cell), tuple(slot(axis, "cycle", 300.0) for axis in "xyz"), tcp[:1])
    axis = np.array([np.argmax(np.abs(force[rows.visit == visit]).max(axis=0)) for visit in rows.visit])
    runs = domain.runs(rows.theta, axis, np.zeros(len(rows), dtype=int), np.tile([1.0, 0, 0], (len(rows), 1)))
    assert domain.excess(runs).max() <= 2e-6
    assert np.isnan(rows.deflection).all()
    # The law of the window itself, |phi| <= 80 deg, with angles and not with cosines.
    lever = domain.look(rows.theta).lever
    angle = np.arctan2(tcp[:, 0] * lever[:, 1] - tcp[:, 1] * lever[:, 0], np.sum(tcp[:, :2] * lever[:, :2], axis=1))
    assert np.abs(np.degrees(angle)).max() <= 80.001


def test_filled_in_it_identifies_as_well_as_forecast(written):
    folder, document = written
    cell = read_cell(folder / "cell.yaml")
    plan = read_measurements(folder / "plan.csv", cell.robot, planned=True)
    with pytest.raises(CompstiffError, match="CS1004"):
        read_measurements(folder / "plan.csv", cell.robot)
    assert judge_plan(cell, plan).effects
    rng = np.random.default_rng(0)
    moved, _ = deviation(cell.robot, plan.theta, cell.flange_from_tcp, plan.wrench, 1 / TRUTH)
    offset = rng.normal(size=(RUNS, 3))[plan.visit] * cell.noise.pose_offset
    reading = 1e6 * (moved + offset + rng.normal(size=moved.shape) * cell.noise.deflection)
    lines = (folder / "plan.csv").read_text().splitlines()
    for number, values in zip(plan.line, reading, strict=True):
        lines[number - 1] = lines[number - 1].replace(",,,,", "," + ",".join(f"{x:.2f}" for x in values) + ",", 1)
    (folder / "filled.csv").write_text("\n".join(lines) + "\n")
    fit = fit_stiffness(cell, read_measurements(folder / "filled.csv", cell.robot))
    expected = np.array([joint["log_std_after"] for joint in document["result"]["forecast"]["joints"]])
    assert (np.abs(np.log(fit.model.stiffness / TRUTH)) < 5 * fit.model.log_std).all()
    assert (fit.model.log_std < 3 * expected).all()
    assert (fit.model.log_std > expected / 3).all()


def test_the_result_says_what_was_certified(written):
    _, document = written
    certificate = document["result"]["certificate"]
    assert 0.9 < certificate["efficiency"] <= 1
    assert certificate["bound"] <= certificate["relaxed_bound"]
    assert certificate["value"] <= certificate["bound"]
    assert "searched from" in certificate["words"]
    counts = document["result"]["forecast"]["causes"]["counts"]
    assert sum(counts.values()) == len(document["result"]["forecast"]["causes"]["effects"])


# rapidchecker 0.1.5 calls pyparsing by its old names; can go when it does not
@pytest.mark.filterwarnings("ignore:.*deprecated.*use:DeprecationWarning")
def test_the_program_drives_to_the_planned_poses(written):
    folder, _ = written
    cell = read_cell(folder / "cell.yaml")
    plan = read_measurements(folder / "plan.csv", cell.robot, planned=True)
    text = (folder / "plan.mod").read_text()
    joints = read_rapid(text.encode(), "plan.mod").toolpath.joints
    assert (cell.robot.limit_excess(joints) <= 1e-9).all()
    poses = plan.theta[np.unique(plan.visit, return_index=True)[1]]
    # there, to the pose, and back
    assert len(joints) == 3 * len(poses)
    np.testing.assert_allclose(joints[1::3], poses, atol=1e-7)
    np.testing.assert_allclose(joints[0::3], joints[2::3], atol=0)
    tcp = forward(cell.robot, joints, cell.flange_from_tcp)
    assert np.linalg.norm(tcp.position[0::3] - tcp.position[1::3], axis=1) == pytest.approx(
        np.full(len(poses), 0.15), abs=0.11)
    np.testing.assert_allclose(tcp.rotation[0::3], tcp.rotation[1::3], atol=1e-6)
    prompts = re.findall(r'TPReadFK nAnswer,"([^"]*)"', text)
    assert max(map(len, prompts)) <= 80
    assert sum("write down" in prompt for prompt in prompts) == len(plan)
    assert text.isascii()
    check = pytest.importorskip("rapidchecker.check", reason="rapidchecker is not installed: no independent grammar")
    assert check.check_format(text.split("%%%")[2].lstrip()) == []


def test_the_report_opens_offline(written):
    page = (written[0] / "plan.html").read_text()
    assert "equivalence theorem" in page
    assert 'src="http' not in page


def test_wrong_calls_and_refusals(written, tmp_path):
    folder, _ = written
    cell = folder / "cell.yaml"
    out = tmp_path / "p.csv"
    assert run(cell, "-o", folder / "plan.csv").exit_code == 1
    without = run(cell, "-o", out, "--criterion", "I")
    assert without.exit_code == 1
    assert f"{cell}: error CS1602: the criterion I is the mean variance over a milling program, and there is none\n" in (
        without.output)
    assert "hint: name it with --toolpath" in without.output
    far = run(cell, "-o", out, "--position", 9000, 0, 0)
    assert far.exit_code == 1
    assert "CS1601" in far.output
    for wrong in (["--position", 1, 2, 3, "--box", 1, 2, 3, 4, 5, 6], ["--forces", cell],
                  ["--preset", "paper", "--measurements", 3], ["--diagnosis", cell],
                  ["--direction", "free", "--every-axis"], ["--direction", "free", "--preset", "paper"]):
        assert run(cell, "-o", out, *wrong).exit_code == 2
    assert isinstance(design, click.Command)
    assert not out.exists()


LITTLE = Effort(200, 2, 1, 0, 1)


def small_plan(cell, monkeypatch) -> DesignPlan:
    """Two poses, searched with little effort and without a forecast: for what is said of the program that drives there."""
    monkeypatch.setattr(procedure, "QUICK", LITTLE)
    monkeypatch.setattr(procedure, "forecast", lambda *of: None)
    return design_plan(cell, Request(measurements=2, axes="z", protocol="single"), quick=True)


def test_the_report_s_headline_is_what_the_plan_will_tell(tmp_path, monkeypatch) -> None:
    plan = small_plan(read_cell(write_cell(tmp_path, CELL)), monkeypatch)
    for weak, headline, known in (
        (0, "PLANNED", "all six stiffnesses will be known well"),
        (1, "PLANNED, BUT NOT EVERY JOINT WILL BE KNOWN", "k1 will not be known well, the others will"),
        (5, "PLANNED, BUT NOT EVERY JOINT WILL BE KNOWN", "k1, k2, k3, k4, k5 will not be known well, the others will"),
        (6, "THIS PLAN TELLS NO STIFFNESS WELL", "none of the six stiffnesses will be known well")):
        joints = tuple(JointForecast(joint, 2.0, 0.05, "tentative" if joint <= weak else "reliable", 0, 0.0)
                       for joint in range(1, 7))
        page = design_report(replace(plan, forecast=Forecast(joints, (), {}, (), (), ()), findings=()))
        told = html.unescape(re.sub(r"<[^>]+>", "\n", page)).replace("\xa0", " ")
        assert f"\n{headline}\n" in told
        assert f"min: {known}. At least " in told


@pytest.mark.parametrize(("kept", "stated"), [
    (", mass_kg: 80, centre_of_mass_mm: [0, 0, 120]", True), (", mass_kg: 80", False),
    (", centre_of_mass_mm: [0, 0, 120]", False), ("", False)])
def test_a_program_without_the_tool_s_load_is_said(tmp_path, monkeypatch, kept: str, stated: bool) -> None:
    """Both numbers make it: then the controller is told them."""
    cell = read_cell(write_cell(tmp_path, CELL.replace(", mass_kg: 80, centre_of_mass_mm: [0, 0, 120]", kept)))
    program = small_plan(cell, monkeypatch).rapid("plan")
    text = program.content.decode()
    told = [(one.level, one.file) for one in program.findings if one.code == "CS1603"]
    assert told == [("note", str(tmp_path / "cell.yaml"))] * (not stated)
    tools = set(re.findall(r"Move\w+ .*,(\w+)\\?.*;", text))
    assert tools == {"tMeasure" if stated else "tool0"}, text
    assert ("[80,[0,0,120]" in text.replace(".0", "")) is stated


def test_a_pose_without_a_retreat_is_named(cell, monkeypatch) -> None:
    """Axis 5 a tenth of a degree and five degrees from its limit: the robot drives straight to the first pose and away, to the
    other one by a place above or behind it."""
    plan = small_plan(cell, monkeypatch)
    near, beside = (np.radians([70, 0, 5, 105, axis, -122]) for axis in (-119.9, -115.0))
    assert (cell.robot.limit_excess(np.stack([near, beside])) <= 0).all()
    for poses, names in (((near, beside), "P01"), ((beside, near), "P02"), ((near, near), "P01, P02"), ((beside, beside), "")):
        program = replace(plan, sheet=replace(plan.sheet, theta=np.stack(poses))).rapid("plan")
        told = [(one.level, one.message) for one in program.findings if one.code == "CS1604"]
        assert told == [("warning", f"no retreat within the joint limits for {names}: the robot drives there and away by a "
                         "direct joint move")][: bool(names)]
        joints = read_rapid(program.content, "plan.mod").toolpath.joints
        visited = [line for pose in poses for line in ([pose] if pose is near else [None, pose, None])]
        assert len(joints) == len(visited)
        for found, wanted in zip(joints, visited, strict=True):
            assert wanted is None or np.abs(found - wanted).max() < 1e-6
            assert (cell.robot.limit_excess(found[None]) <= 1e-9).all()


@pytest.mark.parametrize(("verdict", "rivals", "said"), [
    ("named", 2, "the diagnosis is 'named'"),
    ("ambiguous", 1, "fewer than two of the names that the diagnosis leaves open can be fitted to these rows"),
    ("ambiguous", 2, "")])
def test_a_diagnosis_without_rivals_is_said_to_have_none(monkeypatch, verdict: str, rivals: int, said: str) -> None:
    """Of one that is ambiguous it is not said that it is none; with two rivals the runs are those that tell them apart."""
    cell = read_cell(ROOT / "samples" / "cell.yaml")
    rows = read_measurements(ROOT / "samples" / "measurements.csv", cell.robot)
    for name, value in (("QUICK", LITTLE), ("forecast", lambda *of: None), ("rival_models", lambda *of: {
            f"cause {k}": ("its fit", 0.4) for k in range(rivals)}), ("discriminating_design", lambda task, *of: (
                optimal_design(task, np.random.default_rng(0), LITTLE), "what tells them apart"))):
        monkeypatch.setattr(procedure, name, value)
    plan = design_plan(cell, Request(measurements=1, axes="z", protocol="single", measured=rows.select(rows.visit < 6),
                                     diagnosis=Diagnosed(verdict, (), (), "diagnosis.json")), quick=True)
    told = [(one.level, one.file, one.message) for one in plan.findings if one.code == "CS1651"]
    assert told == [("note", "diagnosis.json", f"{said}: there are no rival causes to tell apart, so the runs are those of the "
                     "criterion")][: bool(said)]
    assert (plan.aim == "what tells them apart") is not bool(said)


def test_order_is_short_and_balanced(cell):
    rng = np.random.default_rng(0)
    theta = rng.uniform(-1, 1, (9, 6))
    kind = np.repeat([0, 1, 2], 3)
    order = run_order(theta, kind, cell.robot.speed, rng)
    time = travel(theta, cell.robot.speed)
    drawn = [rng.permutation(9) for _ in range(200)]
    assert sorted(order.tolist()) == list(range(9))
    assert time[order[:-1], order[1:]].sum() <= np.median([time[p[:-1], p[1:]].sum() for p in drawn])
    assert imbalance(order, kind) <= np.median([imbalance(p, kind) for p in drawn])
    assert imbalance(np.arange(9), kind) > 0.5


# Long: criterion I is planned for over a path of the CAM system below, further runs in test_laws_discrimination.py.
@pytest.mark.long
def test_for_a_milling_program_and_after_measurements(written, tmp_path):
    """I over a program's targets; two more runs make every stiffness surer than what was measured."""
    folder, _ = written
    cell, out = folder / "cell.yaml", tmp_path / "p.csv"
    samples = ROOT / "samples"
    for_program = run(cell, "-o", out, "--toolpath", samples / "insert.mod", "--measurements", 2, "--axes", "yz",
                      "--protocol", "single", "--quick", "--json")
    assert for_program.exit_code == 0, for_program.output
    content = json.loads(for_program.stdout)["result"]
    assert content["criterion"] == "I"
    assert content["prediction_std_um"]["after"] < 0.1 * content["prediction_std_um"]["before"]
    added = run(samples / "cell.yaml", "-o", out, "--force", "--add", 2, samples / "measurements.csv", "--axes", "z",
                "--quick", "--json")
    assert added.exit_code == 0, added.output
    content = json.loads(added.stdout)["result"]
    assert content["measurements"] == 2
    for joint in content["forecast"]["joints"]:
        assert joint["log_std_after"] <= joint["log_std_before"]
    # What it says of causes is what a file of all rows can tell, those that were measured and the further ones.
    both = appended(samples / "measurements.csv", out, tmp_path / "both.csv")
    judged = CliRunner().invoke(diagnose, [str(samples / "cell.yaml"), "--plan", str(both), "--json"])
    assert judged.exit_code == 0, judged.output
    outlooks = json.loads(judged.stdout)["result"]["effects"]
    for cause, expected in zip(content["forecast"]["causes"]["effects"], outlooks, strict=True):
        assert cause["effect"] == expected["effect"]
        if expected["minimal_detectable"] is None:
            assert cause["minimal_detectable"] is None
        else:
            assert cause["minimal_detectable"] == pytest.approx(expected["minimal_detectable"], rel=0.02)


def appended(measured, plan, path):
    """A file of the rows of both, in the order they are taken."""
    tables = []
    for file in (measured, plan):
        lines = [line for line in file.read_text().splitlines() if not line.startswith("#")]
        tables.append(list(csv.DictReader(lines)))
    last = max(float(row["time_s"]) for row in tables[0])
    for row in tables[1]:
        row["time_s"] = f"{float(row['time_s']) + last:g}"
    with path.open("w", newline="") as out:
        writer = csv.DictWriter(out, list(tables[1][0]), restval="the first")
        writer.writeheader()
        writer.writerows(tables[0] + tables[1])
    return path


def test_a_toolpath_of_the_cam_system_plans_like_a_program(written, tmp_path):
    """APT at the middle of the work: the criterion is I, and the TCP stands where the path's middle is."""
    path = tmp_path / "part.apt"
    path.write_text("UNITS/MM\nFEDRAT/600,MMPM\n" + "".join(f"GOTO/{x},0,655,0,0,1\n" for x in range(1150, 1210, 10)))
    result = run(ROOT / "samples" / "cell.yaml", "-o", tmp_path / "p.csv", "--toolpath", path, "--measurements", 1,
                 "--axes", "z", "--protocol", "single", "--quick", "--json")
    assert result.exit_code == 0, result.output
    content = json.loads(result.stdout)["result"]
    assert content["criterion"] == "I"
    assert "(1175, 0, 655)" in content["place"]


# Long: that demand is kept and certified in test_laws_certificate.py, and every option of the command written out above.
@pytest.mark.long
def test_the_papers_plan(written, tmp_path):
    """One position, four poses, three loads along y and two along x, +-300 N; raw k."""
    cell = read_cell(written[0] / "cell.yaml")
    result = run(written[0] / "cell.yaml", "-o", tmp_path / "p.csv", "--preset", "paper", "--quick", "--json")
    assert result.exit_code == 0, result.output
    assert json.loads(result.stdout)["result"]["criterion"] == "A in raw k"
    rows = read_measurements(tmp_path / "p.csv", cell.robot, planned=True)
    loaded = rows.wrench[np.any(rows.wrench != 0, axis=1), :3]
    np.testing.assert_array_equal((loaded != 0).sum(axis=0), [2, 3, 0])
    assert set(np.abs(loaded[loaded != 0])) == {300.0}
    assert rows.visit.max() == 3
    tcp = forward(cell.robot, rows.theta, cell.flange_from_tcp).position
    assert np.abs(tcp - tcp[0]).max() < 1e-6


def test_any_line_and_poses_that_are_kept_back(written, tmp_path):
    """Forces along lines of their own, never over the limit, worth more than along base axes; validate rows stand apart."""
    cell = read_cell(written[0] / "cell.yaml")
    result = run(written[0] / "cell.yaml", "-o", tmp_path / "p.csv", "--measurements", 3, "--validate", 2, "--direction",
                 "free", "--quick", "--rapid", tmp_path / "p.mod", "--json")
    assert result.exit_code == 0, result.output
    content = json.loads(result.stdout)["result"]
    assert content["gain"]["criterion_ratio"] > 1.05
    rows = read_measurements(tmp_path / "p.csv", cell.robot, planned=True)
    size = np.linalg.norm(rows.wrench[:, :3], axis=1)
    assert size.max() == pytest.approx(300, abs=0.02)
    assert ((rows.wrench[:, :3] != 0).sum(axis=1) > 1).any()
    for visit in range(5):                                  # one line a pose: all its loads are multiples of one direction
        assert np.linalg.matrix_rank(rows.wrench[rows.visit == visit, :3], tol=0.1) == 1
    assert len(np.unique(rows.visit[rows.validate])) == 2
    fitted, kept = (np.unique(rows.theta[rows.validate == flag], axis=0) for flag in (False, True))
    apart = distances(kept, fitted, np.ptp(cell.robot.limits, axis=1)).min()
    assert apart > 0.1
    prompts = re.findall(r'TPReadFK nAnswer,"([^"]*)"', (tmp_path / "p.mod").read_text())
    assert max(map(len, prompts)) <= 80
    forces = re.findall(r"F = \(([^)]*)\) N\. Then hold", "\n".join(prompts))
    asked = [[float(part) for part in force.split()] for force in forces]
    np.testing.assert_allclose(asked, rows.wrench[np.any(rows.wrench != 0, axis=1), :3], atol=0.0501)


def test_the_gain_of_any_line_is_told_of_the_joints_that_loads_turn(tmp_path):
    """The tool point stands on axis 6: neither plan tells k6, and "known within a factor 13 instead of 13" says nothing."""
    cell = write_cell(tmp_path, CELL.replace("[120, 0, 250]", "[0, 0, 250]"))
    result = run(cell, "-o", tmp_path / "p.csv", "--measurements", 2, "--direction", "free", "--quick", "--json")
    assert result.exit_code == 0, result.output
    content = json.loads(result.stdout)["result"]
    stds = [joint["log_std_after"] for joint in content["forecast"]["joints"]]
    assert [joint["joint"] for joint in content["unseen"]] == [6]
    assert stds[5] > 1
    gain = content["gain"]
    assert gain["largest_log_std"] == pytest.approx(max(stds[:5]), rel=1e-9)
    assert gain["largest_log_std"] < gain["largest_log_std_there"] < 1


def test_no_pose_near_a_singularity(written):
    """Wrist, elbow and shoulder by where the axes and links really stand."""
    cell = read_cell(written[0] / "cell.yaml")
    theta = read_measurements(written[0] / "plan.csv", cell.robot, planned=True).theta
    frames = chain(cell.robot, np.ascontiguousarray(cell.robot.serial_angles(theta).T))
    wrist, elbow, upper = (np.moveaxis(frames.origins[i], 1, 0) for i in (3, 2, 1))
    assert np.linalg.norm(wrist[:, :2], axis=1).min() >= 0.15 - 1e-6
    arm, fore = elbow - upper, wrist - elbow
    sine = np.linalg.norm(np.cross(arm, fore), axis=1) / np.linalg.norm(arm, axis=1) / np.linalg.norm(fore, axis=1)
    assert sine.min() >= np.sin(np.radians(10)) - 1e-6
    across = np.linalg.norm(np.cross(frames.axes[3].T, frames.axes[5].T), axis=1)
    assert across.min() >= np.sin(np.radians(10)) - 1e-6


def test_a_long_program_is_thinned_evenly(tmp_path: Path) -> None:
    """To two thousand poses or fewer, from the first on."""
    (tmp_path / "cell.yaml").write_text("robot: irb6660-205-1.90\ntool: {position_mm: [0, 0, 200]}\n")
    moves = "".join(f"  MoveL [[1400,{x:.2f},900],[0,0,1,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v50,z1,tool0;\n"
                    for x in np.linspace(-200, 200, 4001))
    (tmp_path / "part.mod").write_text(f"MODULE Part\nPROC main()\n{moves}ENDPROC\nENDMODULE\n")
    poses = compstiff.milling_poses(compstiff.read_cell(tmp_path / "cell.yaml"), tmp_path / "part.mod")
    assert len(poses.theta) == 1334
    np.testing.assert_allclose(1e3 * np.diff(poses.tcp[:, 1]), 0.3, atol=1e-6)
    np.testing.assert_allclose(1e3 * poses.tcp[[0, -1], 1], [-200, 199.9], atol=1e-6)


@pytest.mark.parametrize(("x_mm", "force_n", "poses"), [
    ((9000, 1400, 9000), None, 1), ((9000, 9001, 9002), None, 0), ((1400, 1401, 1402), (0, -60, 0), 1),
    ((1400, 1401, 1402), (0, 0, 0), 0), ((9000, 9001, 1402), (60, 60, 0), 0), ((9000, 9001, 1402), (60, 60, 60), 1)])
def test_a_program_none_of_whose_targets_counts_is_refused(
    tmp_path: Path, x_mm: tuple[int, ...], force_n: tuple[int, ...] | None, poses: int
) -> None:
    """One target that is reached, and with a log shows a force, is enough; nine metres out none is reached."""
    cell = compstiff.read_cell(write_cell(tmp_path, "robot: irb6660-205-1.90\ntool: {position_mm: [0, 0, 200]}\n"))
    program, log = tmp_path / "part.mod", tmp_path / "log.csv"
    moves = "".join(f"  MoveL [[{x},0,900],[0,0,1,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v50,z1,tool0;\n" for x in x_mm)
    program.write_text(f"MODULE Part\nPROC main()\n{moves}ENDPROC\nENDMODULE\n")
    if force_n is not None:
        log.write_text("target,fx_n,fy_n,fz_n\n" + "".join(f"{k},0,0,{force}\n" for k, force in enumerate(force_n)))
    forces = None if force_n is None else log
    if poses:
        assert len(compstiff.milling_poses(cell, program, forces).theta) == poses
        return
    with pytest.raises(CompstiffError) as stopped:
        compstiff.milling_poses(cell, program, forces)
    found, = stopped.value.findings
    why = "none of the 3 targets is reached by the robot" + (" with a force on the tool" if forces else "")
    assert str(found).splitlines()[0] == f"{program}: error CS1602: {why}"


@pytest.mark.parametrize(("stem", "module"), [
    ("plan_2", "plan_2"), ("my plan-2", "my_plan_2"), ("2nd", "M2nd"), ("größe", "gr__e"), ("_a", "M_a"), ("a" * 40, "a" * 32)])
def test_a_program_has_a_name_that_rapid_takes(stem: str, module: str) -> None:
    """A letter, then letters, digits and _, at most 32: RAPID reference manual, identifiers."""
    assert _identifier(stem) == module
    assert re.fullmatch(r"[A-Za-z][A-Za-z0-9_]{0,31}", module)

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
from identification.design.causes import ByCauses
from identification.design.discrimination import Diagnosed, Discrimination
from identification.design.domain import Domain, random_pool
from identification.design.forecast import Forecast, JointForecast
from identification.design.information import instrument
from identification.design.kept_back import distances
from identification.design.loads import slot
from identification.design.milling import MillingPoses, assumed_force, prediction_weight
from identification.design.order import imbalance, run_order, travel
from identification.design.pages import design_report
from identification.design.plan import DesignPlan
from identification.design.procedure import design_plan
from identification.design.program import _identifier
from identification.design.request import Request, prepare
from identification.design.search import Effort, optimal_design
from identification.diagnosis.plan import judge_plan
from identification.fit.fit import fit_stiffness
from identification.measurements import read_measurements
from identification.model.cell import read_cell
from identification.model.compliance import compliance_matrix, deviation
from identification.model.kinematics import chain, forward
from identification.model.rotations import Frame
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
    labels = list(dict.fromkeys(plan.pose))
    assert re.findall(r"! (.* of .*)", text)[-RUNS:] == [f"{k} of {RUNS}: {label}" for k, label in enumerate(labels, 1)]
    assert [prompt for prompt in prompts if "way to the pose clear" in prompt] == [
        f"{label} ({k} of {RUNS}): way to the pose clear?" for k, label in enumerate(labels, 1)]
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


@pytest.mark.parametrize(("design_block", "words", "said", "hint"), [
    ("", ("--position", 9000, 0, 0), "at none of 16000 random tool orientations is the wanted place in reach and inside the "
     "joint limits", "move the place with --position"),
    ("design: {joint_window_deg: {q5: [-9.9, 9.9]}}\n", (), "random poses at the wanted place, in reach and inside the joint "
     "limits, none is inside the windows (of the orientation, reach_mm, the parallel rod's) and away from singularities",
     "widen --phi, or check tool and design"),
    ("", ("--max-force", 2), "it deflects the robot by less than 10 sigmas of the sensors (N) or by more than 5 mm (0)",
     "plan with a larger load: --max-force, or --dead-weight"),
    ("", ("--max-force", 20000), "it deflects the robot by less than 10 sigmas of the sensors (0) or by more than 5 mm (N)",
     "plan with a smaller load: --max-force, or --dead-weight")])
def test_what_no_run_is_admissible_by_is_said(tmp_path, design_block, words, said, hint):
    """A singular wrist; a load that no sensor sees, and one beyond its range: its own hint is about none of the others."""
    done = run(write_cell(tmp_path, CELL + design_block), "-o", tmp_path / "p.csv", "--axes", "z", *words, "--json")
    (finding,) = json.loads(done.stdout)["findings"]
    assert (done.exit_code, finding["code"], Path(finding["file"])) == (1, "CS1601", tmp_path / "cell.yaml")
    told, standing = finding["message"], re.search(r"at (\d+) random poses at the wanted place", finding["message"])
    assert told.startswith("no run with a load along z is admissible: ")
    assert told.endswith(said.replace("N", standing[1] if standing else ""))
    assert hint in finding["hint"]


def test_a_load_that_the_sensors_just_see_at_some_pose_is_planned(cell):
    """Neither limit of the load is met by the most, or the least, that a pose of the pool deflects under 1 N."""
    def with_force(force):
        return Domain(instrument(cell), (slot("z", "single", force),), np.array([[1.36, 0.0, 0.81]]))

    pool = random_pool(with_force(300.0), 400, np.random.default_rng(0))
    moved = compliance_matrix(cell.robot, pool.theta, cell.flange_from_tcp, 1 / cell.prior.stiffness)[:, :3, 2]
    sigmas = np.linalg.norm(moved / cell.noise.deflection, axis=1).max()
    for share, count in ((0.99, 0), (1.01, 1)):
        domain = with_force(10 * share / sigmas)
        if count:
            assert 1 <= len(random_pool(domain, 400, np.random.default_rng(0))) < len(pool)
        else:
            with pytest.raises(CompstiffError, match="CS1601"):
                random_pool(domain, 400, np.random.default_rng(0))


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


@pytest.mark.parametrize(("asked", "slots", "runs", "plainer", "against"), [
    ({"preset": "paper"}, ["yx", "y", "x"], [0, 1, 1, 2], None, ""),
    ({"preset": "outlook"}, ["xyz"], [0] * 4, (["yx", "y", "x"], [0, 1, 1, 2]), "the paper's plan"),
    ({"preset": "outlook", "measurements": 7}, ["xyz"], [0] * 7, (["yx", "y", "x"], [0, 1, 1, 2]), "the paper's plan"),
    ({"free": True, "measurements": 2}, ["free"], [None] * 2, (["x", "y", "z"], [None] * 2),
     "as many runs with loads along base axes"),
    ({"axes": "xz", "measurements": 2}, ["x", "z"], [None] * 2, None, ""),
    ({"axes": "xz", "measurements": 2, "every_axis": True}, ["xz"], [None] * 2, None, "")])
def test_the_loads_are_those_that_were_asked_for_and_what_they_are_held_against(
    cell, asked, slots, runs, plainer, against,
) -> None:
    """The paper's plan: four orientations, y at three and x at two of them, one of them under both."""
    task, other = (prepared := prepare(cell, Request(**asked), None)).task, prepared.plainer
    assert [slot.name for slot in task.domain.slots] == slots
    assert len(task.demand) == len(runs)
    assert None in runs or task.demand.groups[task.demand.wanted].tolist() == runs
    assert (task.criterion.name == "A in raw k") is ("preset" in asked)
    assert (other is None) is (plainer is None)
    if other:
        assert ([slot.name for slot in other[0].domain.slots], len(other[0].demand), other[1]) == (
            plainer[0], len(plainer[1]), against)


FORECAST = Forecast(tuple(JointForecast(joint, 2.0, 0.05, "reliable", 0, 0.0) for joint in range(1, 7)), (), {}, (1, 2),
                    (1.0, 2.0), (0.06, 0.05))


@pytest.fixture(scope="module")
def little(cell) -> DesignPlan:
    """A plan of two runs, searched in no time; what it will tell is invented."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(procedure, "QUICK", LITTLE)
        patch.setattr(procedure, "forecast", lambda *of: FORECAST)
        return design_plan(cell, Request(measurements=2, axes="y", protocol="single"), quick=True)


def words_of(page: str) -> str:
    return " ".join(html.unescape(re.sub(r"<[^>]+>", " ", page)).replace("\xa0", " ").split())


RIVALS = Discrimination(("backlash[2]", "soft_zone[2]", "creep"), np.array([0.61, 0.3, 0.09]), 0.39, 0.12, 1, (
    ("backlash[2]", "soft_zone[2]", 0.96), ("backlash[2]", "creep", 1.04), ("soft_zone[2]", "creep", 3.3)))


@pytest.mark.parametrize(("after", "share", "doubtful"), [
    (0.12, "12 %", True), (0.101, "10 %", True), (0.099, "10 %", False), (0.0101, "1 %", False), (0.0099, "under 1 %", False)])
def test_runs_for_rival_causes_say_what_they_decide(little: DesignPlan, after: float, share: str, doubtful: bool) -> None:
    """Pairs under one sigma stay alike; over a tenth of wrong names it is said what else may help. The certificate is of what
    they were not chosen for, in the terminal, in the table's head and in the report."""
    plan = replace(little, aim=replace(RIVALS, after=after), further=True)
    told = ["1 of the runs was chosen to tell apart: backlash[2] 0.61, soft_zone[2] 0.30, creep 0.09",
            f"the wrong one of these is named with a probability of {share} at most afterwards (without them 39 %), if one of "
            "them is the truth", "  backlash[2] and soft_zone[2] stay alike: 1.0 sigma apart"]
    help_words = "  more runs, more room (--box), --direction free or the checks that the diagnosis names may settle more"
    told += [help_words] * doubtful
    lines = plan.lines()
    at = lines.index(told[0])
    assert lines[at: at + len(told) + 1] == [*told, next(line for line in lines if line.startswith("criterion D"))]
    assert lines[at + len(told) + 1].startswith("by criterion D alone, for which they were not chosen, the runs are at least ")
    assert not any(line.startswith(("most causes would", "largest uncertainty of a stiffness")) for line in lines)
    head = [line[2:] for line in plan.csv().decode().splitlines() if line.startswith("# ")]
    assert head[-len(told) - 1:] == [
        "Append the rows to what was measured before, then diagnose again.", *map(str.strip, told)]
    assert plan.as_dict()["settles"] == {
        "rivals": [{"name": "backlash[2]", "probability": 0.61}, {"name": "soft_zone[2]", "probability": 0.3},
                   {"name": "creep", "probability": 0.09}], "wrong_name_at_most": {"before": 0.39, "after": after}, "runs": 1,
        "pairs": [{"rivals": ["backlash[2]", "soft_zone[2]"], "expected_sigmas": 0.96},
                  {"rivals": ["backlash[2]", "creep"], "expected_sigmas": 1.04},
                  {"rivals": ["soft_zone[2]", "creep"], "expected_sigmas": 3.3}]}
    page = words_of(design_report(plan))
    assert "Which causes it tells apart" in page
    assert ("one other expected difference [sigma] backlash[2] soft_zone[2] 1.0 backlash[2] creep 1.0 soft_zone[2] creep 3.3"
            in page)
    assert "as good as any plan of this length with the same loads by the stiffnesses alone." in page
    assert "at least, by the stiffnesses alone" in page
    assert "diagnose again: compstiff diagnose" in page
    assert "measurements.csv -o diagnosis.json --force" in page


def test_runs_for_all_causes_say_what_they_tell(little: DesignPlan) -> None:
    plan = replace(little, aim=ByCauses(61.6, 0.749, 212, np.log(1.5) / 2, 14, np.log(3) / 2))
    assert plan.as_dict()["by_causes"] == {
        "bits": 61.6, "share_of_best_in_pool": 0.749, "pool": 212, "largest_log_std": np.log(1.5) / 2,
        "by_d": {"causes_named": 14, "largest_log_std": np.log(3) / 2}}
    lines = plan.lines()
    at = lines.index("62 bits about stiffnesses and causes, at least 74 % of what as many out of 212 runs drawn at random "
                     "could tell (equivalence theorem, poses as fractions)")
    assert lines[at + 1] == ("as many runs by criterion D name 14 causes of typical size and know the least known stiffness "
                             "within a factor 3; these know it within a factor 1.5, their causes stand below")
    assert lines[at - 1].startswith("criterion C: what the runs tell of the six stiffnesses and of every cause")
    assert lines[at + 2].startswith("by criterion D alone, for which they were not chosen, the runs are ")
    page = words_of(design_report(plan))
    assert "It names 0 of 0 possible causes. At least " in page
    assert "by the stiffnesses alone." in page


@pytest.mark.parametrize(("axes", "said"), [
    ("xz", True), ("x", False), (("xz",), False), (("free",), False), (("yx", "y", "x"), False)])
def test_every_axis_is_advised_where_it_can_be_taken(little: DesignPlan, axes, said: bool) -> None:
    """Not of plans that have it, and not of those whose other options exclude it."""
    task = little.design.task
    slots = tuple(replace(task.domain.slots[0], name=name) for name in axes)
    causes = (SimpleNamespace(grade="invisible", alike=()),)
    plan = replace(little, forecast=replace(FORECAST, causes=causes), design=replace(
        little.design, task=replace(task, domain=replace(task.domain, slots=slots))))
    (told,) = [line for line in plan.worth(tables=True) if line.startswith("most causes would stay without a name: --crit")]
    assert told.endswith("; --every-axis names more at each pose" if said else "in a --box")


@pytest.mark.parametrize(("identifiable", "advised"), [(1, True), (2, False), (3, False)])
def test_a_plan_that_names_under_half_of_the_causes_advises_the_criterion_for_them(
    little: DesignPlan, identifiable: int, advised: bool) -> None:
    """Of four. Beside tables, which have the causes that are not told apart, these are counted and not listed."""
    causes = tuple(SimpleNamespace(grade="identifiable" if k < identifiable else "detectable", alike=("creep",),
                                   entry=SimpleNamespace(label=f"c{k}")) for k in range(4))
    plan = replace(little, forecast=replace(FORECAST, causes=causes))
    counted = f"of 4 possible causes at their typical size this plan names {identifiable}, only notices {4 - identifiable}"
    for tables in (False, True):
        told = plan.worth(tables=tables)
        assert any(line.startswith("most causes would stay without a name: --criterion C") for line in told) is advised
        (at,) = [k for k, line in enumerate(told) if line.startswith(counted)]
        assert ("noticed at their typical size but not told apart:" in told) is not tables
        assert told[at + 1].startswith("noticed at" if not tables else "most causes" if advised else "largest uncertainty")
        assert any(line.startswith("k1  known ") for line in told) is not tables


def test_along_a_program_without_a_log_it_is_uncertain_by_what_a_force_along_each_axis_makes(little: DesignPlan) -> None:
    """100 N along x, y and z at once, as three forces that know nothing of each other: of each spring by itself, by the forward
    model, at two poses. In a report three digits of it, before and after."""
    task, rig = little.design.task, little.prepared.rig
    theta = little.sheet.theta[:2]
    tool = rig.cell.flange_from_tcp
    milled = MillingPoses(theta, Frame(np.tile(tool.rotation, (2, 1, 1)), np.tile(tool.position, (2, 1))), np.zeros((2, 3)), "",
                          2, assumed_force())
    plan = replace(little, prepared=replace(little.prepared, weight=prediction_weight(rig, milled)))
    # Deflection (2, 3, 6) for each of three forces, by spring: it is linear in their compliances.
    by_spring = np.stack([100 * compliance_matrix(rig.cell.robot, theta, tool, rig.compliance * (np.arange(6) == k))[:, :3, :3]
                          for k in range(6)], axis=3)
    before, after = np.linalg.inv(task.prior), np.linalg.inv(task.information(little.design.runs))
    first, last = (1e6 * np.sqrt(np.einsum("nafi,ij,nafj->", by_spring, covariance, by_spring) / 2)
                   for covariance in (before, after))
    told = plan.prediction_std_um
    assert told is not None
    assert told[0] == pytest.approx(first, rel=1e-6)
    assert last / 1.3 < told[1] < 1.3 * last        # sensors and poses of their own are in what is stated
    assert (f"deflection along the program (under 100 N along each base axis where no force log was given): uncertain by "
            f"{told[1]:.2g} um RMS, before {first:.3g} um") in plan.lines()
    assert plan.as_dict()["prediction_std_um"] == {"before": told[0], "after": told[1]}
    assert little.prediction_std_um is None
    assert not [line for line in little.lines() if "along the program" in line]


def test_one_run_is_no_runs(little: DesignPlan) -> None:
    """A plan of two poses, and the same without the second."""
    sheet = little.sheet
    one = replace(sheet, label=sheet.label[:1])
    assert little.worth()[0].startswith("2 poses, 4 rows, about ")
    assert replace(little, sheet=one).worth()[0].startswith("1 pose, 4 rows, about ")


def test_after_further_runs_the_diagnosis_is_made_anew_over_the_one_there_is(monkeypatch, tmp_path: Path) -> None:
    """Followed as it stands, with the rows appended: `diagnose` would refuse to write over the diagnosis that was given."""
    monkeypatch.setattr(procedure, "QUICK", LITTLE)
    monkeypatch.setattr(procedure, "forecast", lambda *of: FORECAST)
    samples, given = ROOT / "samples", tmp_path / "found.json"
    given.write_text(json.dumps({"format": "compstiff-diagnosis", "robot": "irb6660-205-1.90", "verdict": "named"}))
    rows = tmp_path / "measurements.csv"
    rows.write_bytes((samples / "measurements.csv").read_bytes())
    done = run(samples / "cell.yaml", "-o", tmp_path / "more.csv", "--add", 1, rows, "--axes", "z", "--protocol", "single",
               "--quick", "--diagnosis", given)
    assert done.exit_code == 0, done.output
    assert done.output.rstrip().endswith(
        f"append the rows to {rows}, then compstiff diagnose {samples / 'cell.yaml'} {rows} -o {given} --force")


@pytest.mark.parametrize(("stem", "module"), [
    ("plan_2", "plan_2"), ("my plan-2", "my_plan_2"), ("2nd", "M2nd"), ("größe", "gr__e"), ("_a", "M_a"), ("a" * 40, "a" * 32)])
def test_a_program_has_a_name_that_rapid_takes(stem: str, module: str) -> None:
    """A letter, then letters, digits and _, at most 32: RAPID reference manual, identifiers."""
    assert _identifier(stem) == module
    assert re.fullmatch(r"[A-Za-z][A-Za-z0-9_]{0,31}", module)

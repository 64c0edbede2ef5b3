"""`check`: what is wrong with all files of a cell is said in one go, with the words of the commands that would read them."""

from __future__ import annotations

import errno
import json
import os
import re
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from compensator.learned.learned_file import learned_json
from compstiff.file_checks import Checked, FileCheck
from identification.common.findings import Finding, Level
from identification.model.cell import read_cell
from identification.model.robot import built_in_robots
from tests.compensator.learning.test_contract_learned_file import learned
from tests.identification.formats.test_contract_force_logs import lvm
from tests.identification.motion import simulated_joint
from tests.runs.command_line import test_mistakes as kit_mistakes
from tests.runs.command_line import user_files as kit
from tests.runs.command_line.workshop import workshop
from tests.virtual_cell.arm import ARMS

ROBOT = "irb6660-205-1.90"
SAMPLES = Path(__file__).parents[3] / "samples"

# As `compstiff cutting` writes it.
CUTTING = {"format": "compstiff-cutting", "version": 1, "coefficients": ["Ktc", "Krc", "Kac", "Kte", "Kre", "Kae"],
           "mean": [2100, 600, 400, 40, 40, 4], "covariance": [[0.0] * row + [1.0] for row in range(6)], "model_error": 0.03,
           "cutter": {"diameter_mm": 16, "teeth": 3, "corner_radius_mm": 0, "flute_mm": None}, "material": "titanium",
           "feed_a_tooth_mm": [0.08, 0.08], "told": {}}


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A sound job: cell, measurements, stiffness, a program with its log."""
    for name, content in workshop(ROBOT).files.items():
        (tmp_path / name).write_text(content)
    (tmp_path / "forces.csv").rename(tmp_path / "part.forces.csv")
    return tmp_path


def check(folder: Path, *words: object) -> kit.Run:
    return kit.run("check", folder / "cell.yaml", *words, "--json")


def verdicts(run: kit.Run) -> dict[str, tuple[str, str]]:
    return {Path(one["file"]).name: (one["kind"], one["verdict"]) for one in run.json["result"]["files"]}


def test_a_sound_job_is_sound_and_each_file_has_its_kind(folder: Path) -> None:
    """Those that users write, and those that the commands make of them."""
    assert kit.run("diagnose", folder / "cell.yaml", folder / "measurements.csv", "-o", folder / "diagnosis.json").code == 0
    done = kit.run("correct", folder / "cell.yaml", folder / "part.mod", "--stiffness", folder / "stiffness.json",
                   "--tare", "0:1", "-o", folder / "corrected.mod", "--offsets", folder / "offsets.csv")
    assert done.code == 0, done
    simulated_joint.write(folder / "motion.csv", simulated_joint.columns(1, {}))
    (folder / "before.csv").write_text("target,dx_um,dy_um,dz_um\n0,1,2,3\n1,2,3,4\n")
    (folder / "points.csv").write_text("x_mm,y_mm,z_mm,dx_um,std_um\n1,2,3,10,5\n")
    (folder / "notes.txt").write_text("not asked\n")
    (folder / "part.stock.yaml").write_text("box: {from_mm: [-60, -40, -30], to_mm: [60, 80, 0]}\n")
    (folder / "cutting.json").write_text(json.dumps(CUTTING))
    (folder / "said.json").write_text(kit.run("check", folder / "cell.yaml", "--json").out)
    before = {path.name: path.read_bytes() for path in folder.iterdir()}
    run = check(folder, folder, "--tare", "0:1")
    assert run.code == 0, run
    kinds = {name: kind for name, (kind, _) in verdicts(run).items()}
    assert kinds == {
        "cell.yaml": "cell", "measurements.csv": "measurements", "stiffness.json": "stiffness", "part.mod": "toolpath",
        "corrected.mod": "toolpath", "part.forces.csv": "force log", "along.csv": "force log", "diagnosis.json": "diagnosis",
        "corrected.mod.json": "record", "offsets.csv": "offsets", "motion.csv": "joint log", "before.csv": "measured part",
        "points.csv": "measured part", "said.json": "result", "part.stock.yaml": "stock", "cutting.json": "cutting"}
    found = {Path(one["file"]).name: one["found"] for one in run.json["result"]["files"]}
    assert found["measurements.csv"] == "60 rows, 60 with a load, 10 poses, 0 rows kept back"
    assert found["cutting.json"].endswith("in titanium, Ktc 2100 N/mm^2")
    assert found["part.stock.yaml"] == "x -60 to 60; y -40 to 80; z -30 to 0 mm"
    assert run.json["result"]["passed_over"] == 1
    assert {path.name: path.read_bytes() for path in folder.iterdir()} == before, "nothing is written"


def test_everything_that_is_wrong_is_said_in_one_go(folder: Path) -> None:
    """Six files spoilt, each in its own way; the exit code is 1, and every place stands in the findings."""
    content = json.loads((folder / "stiffness.json").read_text())
    (folder / "stiffness.json").write_text(json.dumps(content | {"robot": "irb4400-60"}))
    (folder / "measurements.csv").write_text((folder / "measurements.csv").read_text().replace(",fx_n", ",force_x"))
    (folder / "part.mod").write_text((folder / "part.mod").read_text().replace("ENDMODULE", ""))
    (folder / "along.csv").write_text("x_mm,y_mm,z_mm,fx_n,fy_n,fz_n\n1,2,3,4,5,six\n")
    (folder / "mine.yaml").write_text("name: mine\njoints: 7\n")
    (folder / "broken.json").write_text('{"format": ')
    run = check(folder, folder)
    assert run.code == 1
    wrong = {name for name, (_, verdict) in verdicts(run).items() if verdict == "error"}
    assert wrong >= {"stiffness.json", "measurements.csv", "along.csv", "mine.yaml", "broken.json"}
    assert {"CS1202", "CS0202", "CS0203", "CS0102", "CS0110"} <= kit.codes(run)
    assert run.json["status"] == "failed"
    placed = {Path(finding["file"]).name: finding["line"] for finding in run.json["findings"] if finding["level"] == "error"}
    assert placed["along.csv"] == 2
    assert placed["measurements.csv"] == 1


def test_a_load_test_under_names_of_its_own_is_asked_for_its_angles(folder: Path) -> None:
    """A1 ... A6 and a mass, as a German sheet has it: what is missing are joint angles, not where a part was measured."""
    (folder / "loads.csv").write_text("A1;A2;A3;A4;A5;A6;Masse;fx_n;fy_n;fz_n;dx_um;dy_um;dz_um\n1;2;3;4;5;6;;0;0;0;1;2;3\n")
    run = check(folder, folder / "loads.csv")
    assert verdicts(run)["loads.csv"] == ("measurements", "error")
    assert kit.codes(run) == {"CS0202"}


def test_each_reader_s_findings_are_those_of_its_command(folder: Path) -> None:
    """An angle beyond the limits, as identify says it: same code, same line and column, same words."""
    sheet = folder / "measurements.csv"
    header, first, *rest = sheet.read_text().splitlines()
    sheet.write_text("\n".join([header, ",".join(["400", *first.split(",")[1:]]), *rest]) + "\n")
    said = [finding for finding in kit.run("identify", folder / "cell.yaml", sheet, "-o", folder / "s.json", "--json")
            .json["findings"] if finding["level"] == "error"]
    assert said[0]["code"] == "CS1002"
    found = [finding for finding in check(folder, sheet).json["findings"] if finding["level"] == "error"]
    assert found == said


def test_a_cell_that_cannot_be_read_leaves_the_rest_open(folder: Path) -> None:
    (folder / "cell.yaml").write_text("robott: irb6660-205-1.90\n")
    run = check(folder, folder / "measurements.csv", folder / "part.mod")
    assert run.code == 1
    assert kit.codes(run) == {"CS0102", "CS0111"}
    assert verdicts(run)["measurements.csv"] == ("measurements", "warning")
    said = [(Path(one["file"]).name, one["message"]) for one in run.json["findings"] if one["code"] == "CS0111"]
    assert said == [(name, f"not judged: a {kind} is read for a cell, and cell.yaml could not be read")
                    for name, kind in (("measurements.csv", "measurements"), ("part.mod", "toolpath"))]
    assert "CS0111" not in kit.codes(check(folder, built_in_robots()["irb4400-60"]))     # read for no cell


def test_a_log_is_held_against_the_program_of_its_name(folder: Path) -> None:
    """Targets beyond the program: as correct says it; by itself the log is sound."""
    log = folder / "part.forces.csv"
    log.write_text(log.read_text() + "40,1,2,3\n")
    assert check(folder, log).code == 0
    run = check(folder, log, folder / "part.mod")
    assert run.code == 1
    assert "CS3004" in kit.codes(run)
    assert verdicts(run)["part.forces.csv"] == ("force log", "error")


@pytest.mark.parametrize(("log", "program"), [
    ("part.forces.csv", "part.mod"), ("Part.forces.csv", "Part.mod"), ("PART.forces.csv", "part.mod"),
    ("Part.Forces.csv", "Part.mod"), ("other.forces.csv", "")])
def test_a_log_goes_with_the_program_whose_name_is_its_own(folder: Path, log: str, program: str) -> None:
    """To the letter where there is one, else whatever its capitals: here a program of one move, and one of them all."""
    text = (folder / "part.mod").read_text()
    moves = re.findall(r"^ *Move.*\n", text, re.MULTILINE)
    (folder / "Part.mod").write_text(text.replace("".join(moves), moves[0]))
    (folder / "part.forces.csv").rename(folder / "log")
    (folder / "log").rename(folder / log)
    run = check(folder, folder / "part.mod", folder / "Part.mod", folder / log, "--tare", "0:1")
    (found,) = [one for one in run.json["result"]["files"] if one["file"].endswith(log)]
    # A log of all targets is none of the program of one.
    assert found["verdict"] == ("error" if program == "Part.mod" else "note")
    assert found["found"].endswith(f"; of {program}") == (program == "part.mod")


def test_a_tare_in_the_cut_is_wrong_here_as_there(folder: Path) -> None:
    assert same_code_as_correct(folder, "--tare", "4:6") == 1


def test_a_refusal_exits_3(folder: Path) -> None:
    """A log with time alone of one steady force, which nothing places: no file is wrong, and the answer is no."""
    lines = ["time_s,fx_n,fy_n,fz_n", *(f"{k / 500},60,-80,{k % 7}" for k in range(1000))]
    (folder / "part.forces.csv").write_text("\n".join(lines) + "\n")
    assert same_code_as_correct(folder) == 3


@pytest.mark.parametrize(("files", "code"), [
    ("", 0), ("note warning", 0), ("refused", 3), ("refused note", 3), ("error", 1), ("refused error", 1), ("error refused", 1),
    ("refused refused", 3)])
def test_a_refusal_beside_a_file_that_is_wrong_is_no_answer(files: str, code: int) -> None:
    level: dict[str, Level] = {"note": "note", "warning": "warning", "refused": "error", "error": "error"}
    checked = Checked(tuple(FileCheck(Path(word), "toolpath", "", (Finding("CS0110", level[word], word),), word == "refused")
                            for word in files.split()))
    assert (checked.exit_code, checked.as_dict()["sound"]) == (code, code == 0)


def same_code_as_correct(folder: Path, *words: str) -> int:
    """The exit code of check, which is correct's."""
    correct = kit.run("correct", folder / "cell.yaml", folder / "part.mod", "--stiffness", folder / "stiffness.json", *words,
                      "-o", folder / "out.mod")
    run = check(folder, folder / "part.mod", folder / "part.forces.csv", *words)
    assert run.code == correct.code, run
    assert run.json["status"] == {1: "failed", 3: "refused"}[run.code]
    return run.code


@pytest.mark.parametrize("rejected", [True, False])
def test_a_stiffness_file_its_own_measurements_reject_is_said(folder: Path, rejected: bool) -> None:
    """As correct will say: it refuses this file, and takes it where they do not."""
    content = json.loads((folder / "stiffness.json").read_text())
    content["fit"] = {"model_check": {"rejected": rejected, "p_value": 0.001, "seen": "a trend"}}
    (folder / "stiffness.json").write_text(json.dumps(content))
    run = check(folder, folder / "stiffness.json")
    assert run.code == 0
    said = [(one["level"], one["message"]) for one in run.json["findings"] if one["code"] == "CS0113"]
    assert said == [("warning", "its own measurements reject it (a trend): correct will refuse it")] * rejected
    correct = kit.run("correct", folder / "cell.yaml", folder / "part.mod", "--stiffness", folder / "stiffness.json",
                      "-o", folder / "out.mod")
    assert correct.code == 3 * rejected, correct


def test_targets_out_of_reach_are_counted(folder: Path) -> None:
    text = (folder / "cell.yaml").read_text() + "base_frame: {position_mm: [-3000, 0, 0]}\n"
    (folder / "cell.yaml").write_text(text)
    run = check(folder, folder / "part.mod")
    assert run.code == 0
    assert "CS0114" in kit.codes(run)


def test_the_first_target_out_of_reach_is_told_with_its_line(folder: Path) -> None:
    """Of two, the fourth and the seventh: its number is that of the targets, its line that of the file."""
    text, lines = (folder / "part.mod").read_text(), []
    moves = list(re.finditer(r"Move[JL] *\[\[(-?[\d.]+),", text))
    for move in (moves[7], moves[4]):
        text = f"{text[:move.start(1)]}9999{text[move.end(1):]}"
        lines.append(text[:move.start()].count("\n") + 1)
    (folder / "part.mod").write_text(text)
    (said,) = [one for one in check(folder, folder / "part.mod").json["findings"] if one["code"] == "CS0114"]
    assert "does not reach 2 of" in said["message"]
    assert (said["target"], said["line"]) == (4, lines[1])


@pytest.mark.parametrize(("body", "code"), [
    ("TriggL [[900,0,900],[0,0,1,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v50,tOpen,fine,tool0;", 0), ("Set doSpindle;", 1)])
def test_a_module_that_moves_by_other_instructions_has_no_move_of_its_own(folder: Path, body: str, code: int) -> None:
    """One that does not move at all is no program."""
    (folder / "open.mod").write_text(f"MODULE Open\nPROC rOpen()\n  {body}\nENDPROC\nENDMODULE\n")
    run = check(folder, folder / "open.mod")
    assert run.code == code
    assert ("no move of its own" in run.out) == (code == 0)
    assert ("CS4202" in kit.codes(run)) == (code == 1)


APT = "UNITS/MM\nRAPID\nGOTO/0,0,60,0,0,1\nFEDRAT/1200,MMPM\n" + "".join(
    f"GOTO/{x},{y},0\n" for y in (0, 40, 80) for x in (0, 240))
PLACED = """\
robot: irb6660-205-1.90
tool: {position_mm: [120, 0, 250], mass_kg: 50, centre_of_mass_mm: [0, 0, 100]}
workobject: {position_mm: [1400, 500, 800], quaternion: %s}
"""


@pytest.mark.parametrize(("quaternion", "said", "asked"), [
    ("[0.965925826, 0, 0, 0.258819045]", "30 deg about z", False),
    ("[0, 0, 0.258819045, 0.965925826]", "180 deg about (0, 0.26, 0.97)", True),
    ("[0.92387953, 0, 0.38268343, 0]", "45 deg about y", False), ("[0.38268343, 0, 0, 0.92387953]", "135 deg about z", False)])
def test_every_turn_is_said_in_degrees(tmp_path: Path, quaternion: str, said: str, asked: bool) -> None:
    (tmp_path / "cell.yaml").write_text(PLACED % quaternion)
    run = check(tmp_path)
    (found,) = (one["found"] for one in run.json["result"]["files"])
    assert f"workobject turned {said}" in found
    assert ("CS0117" in kit.codes(run)) == asked
    assert run.code == 0


@pytest.mark.parametrize(("form", "tilted"), [
    ("apt", ""), ("mod", ""), ("apt", "quaternion: [0.965925826, 0, 0.258819045, 0], ")])
def test_the_order_that_reaches_the_program_is_named(tmp_path: Path, form: str, tilted: str) -> None:
    """A robot that faces the world's y axis: with w last it lies on its back, and reaches nothing of the part. One that stands
    elsewhere reaches it in neither. tilted: the turn of a tool with which, in the other order, nothing can be posted."""
    right = "base_frame: {quaternion: [0.70710678, 0, 0, 0.70710678]}"
    last = "base_frame: {quaternion: [0, 0, 0.70710678, 0.70710678]}"
    placed = PLACED.replace("[1400, 500, 800]", "[100, 1300, 700]") % [1, 0, 0, 0]
    placed = placed.replace("mass_kg", f"{tilted}mass_kg")
    (tmp_path / "cell.yaml").write_text(f"{placed}{right}\n")
    (tmp_path / "part.apt").write_text(APT)
    if form == "mod":
        assert kit.run("post", tmp_path / "cell.yaml", tmp_path / "part.apt", "-o", tmp_path / "part.mod").code == 0
    sound = check(tmp_path, tmp_path / f"part.{form}")
    assert sound.code == 0
    assert "x y z w" not in sound.out
    (tmp_path / "cell.yaml").write_text(f"{placed}{last}\n")
    run = check(tmp_path, tmp_path / f"part.{form}")
    said = [one["message"] + one["hint"] for one in run.json["findings"] if Path(one["file"]).name == f"part.{form}"]
    named = ("with base_frame.quaternion [0.707107, 0, 0, 0.707107], which is cell.yaml's read as x y z w, every target is "
             "reached")
    assert sum(named in text for text in said) == 1
    far = last.replace("{", "{position_mm: [9000, 0, 0], ")
    (tmp_path / "cell.yaml").write_text(f"{placed}{far}\n")
    assert "every target is reached" not in check(tmp_path, tmp_path / f"part.{form}").out


@pytest.mark.parametrize(("placed", "behind", "told"), [
    ("[120, 0, 250]", r"Move\w \[\[.*?\],", "the targets' quaternions"),
    ("[120, 0, 250], quaternion: [0.965925826, 0, 0.258819045, 0]", r"tooldata .*?\[\[.*?\],",
     "the quaternions of its tooldata"),
    ("[100, 1300, 700], quaternion: [0.965925826, 0.258819045, 0, 0]", r"wobjdata .*\[\[.*?\],",
     "the quaternions of its wobjdata")], ids=["robtarget", "tooldata", "wobjdata"])
def test_quaternions_of_a_program_in_the_other_order_are_named(tmp_path: Path, placed: str, behind: str, told: str) -> None:
    """Of its targets, tool or work object: the others stay as they are. behind: what stands before the quaternion."""
    before = placed.partition("]")[0] + "]" + ", quaternion: [1, 0, 0, 0]" * ("1300" in placed)
    cell = PLACED.replace("[1400, 500, 800]", "[100, 1300, 700]") % [1, 0, 0, 0]
    assert before in cell
    (tmp_path / "cell.yaml").write_text(cell.replace(before, placed)
                                        + "base_frame: {quaternion: [0.70710678, 0, 0, 0.70710678]}\n")
    (tmp_path / "part.apt").write_text(APT)
    program = tmp_path / "part.mod"
    assert kit.run("post", tmp_path / "cell.yaml", tmp_path / "part.apt", "-o", program).code == 0
    assert "x y z w" not in check(tmp_path, program).out
    program.write_text(re.sub(rf"({behind})\[(.*?),(.*?),(.*?),(.*?)\]", r"\1[\3,\4,\5,\2]", program.read_text()))
    said = [one["message"] for one in check(tmp_path, program).json["findings"] if one["file"] == str(program)]
    assert sum(words.startswith(f"with {told} read as x y z w, every target is reached") for words in said) == 1, said


def test_how_many_targets_and_how_long_a_way_a_program_has(tmp_path: Path) -> None:
    """Down by 60 mm, three times 240 mm across, and back twice."""
    (tmp_path / "cell.yaml").write_text(PLACED.replace("[1400, 500, 800]", "[100, 1300, 700]") % [1, 0, 0, 0]
                                        + "base_frame: {quaternion: [0.70710678, 0, 0, 0.70710678]}\n")
    (tmp_path / "part.apt").write_text(APT)
    run = check(tmp_path, tmp_path / "part.apt")
    (found,) = [one["found"] for one in run.json["result"]["files"] if one["file"].endswith(".apt")]
    assert found == f"7 targets, 7 reached, {1e-3 * (60 + 3 * 240 + 2 * np.hypot(240, 40)):.3g} m"
    assert run.json["exit_code"] == 0
    first = APT.split("GOTO")[:3]
    (tmp_path / "down.apt").write_text("GOTO".join(first).rstrip() + "\nFINI\n")
    (short,) = [one["found"] for one in check(tmp_path, tmp_path / "down.apt").json["result"]["files"]
                if one["file"].endswith("down.apt")]
    assert short == "2 targets, 2 reached, 0.06 m"


@pytest.mark.parametrize(("home", "told"), [("MoveAbsJ [[0,-20,30,0,60,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v100,fine,tool0;", False),
                                            ("MoveJ [[100,1300,900],[0,-0.70710678,0.70710678,0],[-1,0,-1,0],"
                                             "[9E9,9E9,9E9,9E9,9E9,9E9]],v100,fine,tool0;", True)])
def test_another_tool_is_told_where_it_says_where_the_robot_goes(tmp_path: Path, home: str, told: bool) -> None:
    """To joint angles the robot goes whatever its tool."""
    (tmp_path / "cell.yaml").write_text(PLACED.replace("[1400, 500, 800]", "[100, 1300, 700]") % [1, 0, 0, 0]
                                        + "base_frame: {quaternion: [0.70710678, 0, 0, 0.70710678]}\n")
    (tmp_path / "part.apt").write_text(APT)
    program = tmp_path / "part.mod"
    assert kit.run("post", tmp_path / "cell.yaml", tmp_path / "part.apt", "-o", program).code == 0
    before = kit.codes(check(tmp_path, program))
    program.write_text(program.read_text().replace("    MoveJ [[", f"    {home}\n    MoveJ [[", 1))
    assert bool(kit.codes(check(tmp_path, program)) - before) == told


def test_a_plan_is_no_broken_measurement(folder: Path) -> None:
    sheet = folder / "measurements.csv"
    header, *rows = sheet.read_text().splitlines()
    sheet.write_text("\n".join([header, *(",".join(row.split(",")[:9]) + ",,," for row in rows)]) + "\n")
    run = check(folder, sheet)
    assert run.code == 0
    assert kit.codes(run) == {"CS0112"}
    (folder / "filled.csv").write_text("\n".join([header, *rows]) + "\n")
    beside = check(folder, sheet, folder / "filled.csv")
    assert kit.codes(beside) == set()
    assert {name: verdict for name, (_, verdict) in verdicts(beside).items()} == {
        "cell.yaml": "ok", "measurements.csv": "ok", "filled.csv": "ok"}
    sheet.write_text("\n".join([header, rows[0], *(",".join(row.split(",")[:9]) + ",,," for row in rows[1:])]) + "\n")
    half = check(folder, sheet)
    assert half.code == 1
    assert "CS1004" in kit.codes(half)


@pytest.mark.parametrize(("names", "factor", "said"), [
    (kit_mistakes.READINGS, 1e-3, "deflections in mm"), (kit_mistakes.READINGS, 1e-6, "deflections in m,"),
    (kit_mistakes.FORCES, 1e-3, "forces in kN"), (kit_mistakes.READINGS, -1, "the other sign"),
    (kit_mistakes.READINGS, lambda rows: rows[:, ::-1], "dx and dz seem to be swapped"),
    (kit_mistakes.ANGLES, np.radians, "in radians")])
def test_readings_that_no_such_robot_gives_are_one_finding(folder: Path, names: list[str], factor: object, said: str) -> None:
    """The slip is named, with the check that settles it, before anything is fitted."""
    sheet = folder / "measurements.csv"
    assert check(folder, sheet).json["findings"] == [], "sound as measured"
    sheet.write_text(kit_mistakes.columns(names, factor)(sheet.read_text()))
    findings = check(folder, sheet).json["findings"]
    assert [finding["code"] for finding in findings] == ["CS0115"]
    assert said in findings[0]["message"], findings
    assert findings[0]["hint"].startswith("check: ")


def spoilt_in(rows: np.ndarray, spoil: Callable[[np.ndarray], np.ndarray]) -> Callable[[np.ndarray], np.ndarray]:
    def change(values: np.ndarray) -> np.ndarray:
        values = values.copy()
        values[rows] = spoil(values[rows])
        return values

    return change


@pytest.mark.parametrize(("spoil", "said"), [
    (lambda d: -d, "all forces (or all deflections: that is the same to the springs) seem to have the other sign in them"),
    (lambda d: d / 10, "deflections seem to be ten times too small in them"),
    (lambda d: d[::-1] * [1, -1, 1], "of the readings fit none, without them"),
])
@pytest.mark.parametrize("part", [0.1, 0.3, 0.45])
def test_rows_that_fit_no_springs_which_fit_the_others_are_named(
    folder: Path, part: float, spoil: Callable[[np.ndarray], np.ndarray], said: str
) -> None:
    """From a tenth to nearly half of the table, with their lines, and what would mend them where something usual does."""
    sheet = folder / "measurements.csv"
    count = len(sheet.read_text().splitlines()) - 1
    rows = np.arange(count // 4, count // 4 + round(part * count))
    sheet.write_text(kit_mistakes.columns(kit_mistakes.READINGS, spoilt_in(rows, spoil))(sheet.read_text()))
    finding, = check(folder, sheet).json["findings"]
    assert finding["code"] == "CS0115"
    assert "rows with a load (lines " in finding["message"]
    assert "fit no springs that fit the others: " in finding["message"]
    assert said in finding["message"], finding


def test_one_reading_ten_times_too_large_is_not_said_of_all_rows(folder: Path) -> None:
    sheet = folder / "measurements.csv"
    wild = spoilt_in(np.array([7]), lambda d: 10 * d)
    sheet.write_text(kit_mistakes.columns(kit_mistakes.READINGS, wild)(sheet.read_text()))
    finding, = check(folder, sheet).json["findings"]
    assert "1 of 60 rows with a load (line 9)" in finding["message"]
    assert "all rows" not in finding["message"]


@pytest.mark.parametrize("command", ["identify", "diagnose"])
def test_readings_in_metres_are_refused_by_those_that_fit(folder: Path, command: str) -> None:
    """So small that every joint drowns in the sensor's noise: no stiffness would show the unit."""
    sheet = folder / "measurements.csv"
    sheet.write_text(kit_mistakes.columns(kit_mistakes.READINGS, 1e-6)(sheet.read_text()))
    run = kit.run(command, folder / "cell.yaml", sheet, "-o", folder / "out.json", "--json")
    assert run.code == 1, run
    assert kit.codes(run) == {"CS1018"}
    assert "in m, not in um" in run.json["findings"][0]["message"]
    assert not (folder / "out.json").exists()


def test_an_empty_sheet_still_needs_its_columns(folder: Path) -> None:
    (folder / "measurements.csv").write_text("q1_deg,dx_um\n")
    run = check(folder, folder / "measurements.csv")
    assert run.code == 1
    assert "CS0202" in kit.codes(run)


def elsewhere(place: str) -> kit_mistakes.Change:
    """The work object at another place [mm]."""
    return kit_mistakes.swap("[900.0000000000,50.0000000000,400.0000000000]", f"[{place}]")


@pytest.mark.parametrize(("change", "code"), [
    (kit_mistakes.swap("\\WObj:=wPart", "\\WObj:=wOther"), "CS4104"),
    (kit_mistakes.swap("tMill:=[TRUE", "tMill:=[FALSE"), "CS4104"),
    (kit_mistakes.swap("[9E9,9E9,", "[100,9E9,"), "CS4104"), (elsewhere("9000,50,400"), "CS4105"),
    (elsewhere("-150,-50,400"), "CS4105")])
def test_what_correct_refuses_check_refuses(folder: Path, change: kit_mistakes.Change, code: str) -> None:
    """Each finding of it, word for word."""
    program = folder / "part.mod"
    program.write_text(str(change(program.read_text())))
    refused = kit.run("correct", folder / "cell.yaml", program, "--stiffness", folder / "stiffness.json", "--tare", "0:1", "-o",
                      folder / "out.mod", "--json")
    run = check(folder, program, folder / "part.forces.csv", "--tare", "0:1")
    assert (refused.code, run.code) == (3, 3), run
    wrong, found = ([finding for finding in said.json["findings"] if finding["level"] == "error"] for said in (refused, run))
    assert {finding["code"] for finding in wrong} == {code}
    assert found == wrong
    assert verdicts(run)["part.mod"] == ("toolpath", "error")
    alone = check(folder, program)
    assert alone.code == 0


@pytest.mark.parametrize(("change", "code", "words"), [
    (kit_mistakes.swap("\\WObj:=wPart", "\\WObj:=wOther"), "CS4104", "a move is in work object wOther"),
    (elsewhere("-150,-50,400"), "CS4105", "as planned: joint ")])
def test_places_that_do_not_serve_are_told_before_there_is_a_log(
    folder: Path, change: kit_mistakes.Change, code: str, words: str
) -> None:
    """Whether the moves cut is not known yet: a warning."""
    program = folder / "part.mod"
    program.write_text(str(change(program.read_text())))
    run = check(folder, program)
    found = next(finding for finding in run.json["findings"] if finding["code"] == code)
    assert (run.code, found["level"]) == (0, "warning")
    assert words in found["message"]


@pytest.mark.parametrize(("move", "told"), [("MoveL", True), ("MoveJ", False)])
def test_only_a_move_that_may_cut_is_told_of_its_place_and_with_its_log_one_that_cuts(
    folder: Path, move: str, told: bool
) -> None:
    """The first is in a work object that nobody declares, which is said of it either way; it has no force."""
    program = folder / "part.mod"
    program.write_text(program.read_text().replace("MoveL", move, 1).replace("\\WObj:=wPart", "\\WObj:=wOther", 1))
    alone, logged = check(folder, program), check(folder, program, folder / "part.forces.csv", "--tare", "0:1")
    assert (alone.code, logged.code) == (0, 0), logged
    assert [finding["target"] for finding in alone.json["findings"] if finding["code"] == "CS4104"] == [0] * told
    assert "CS4104" not in kit.codes(logged)
    assert "CS2021" in kit.codes(alone)
    assert "CS2021" in kit.codes(logged)


@pytest.mark.parametrize("text", ["", "MODULE A\nENDMODULE\n"])
def test_a_program_without_a_move_is_none(folder: Path, text: str) -> None:
    """As correct says it."""
    (folder / "empty.mod").write_text(text)
    run = check(folder, folder / "empty.mod")
    assert run.code == 1
    assert kit.codes(run) == {"CS4202"}


@pytest.mark.parametrize(("name", "content"), [
    ("part.step", "ISO-10303-21;"), ("table.csv", "a,b\n1,2\n"), ("other.json", "{}"), ("list.json", "[1]")])
def test_a_file_of_no_kind_is_said_where_it_is_named(folder: Path, name: str, content: str) -> None:
    (folder / name).write_text(content)
    run = check(folder, folder / name)
    assert run.code == 1
    assert kit.codes(run) == {"CS0110"}


def test_files_of_a_folder_that_no_command_reads_are_counted(folder: Path) -> None:
    """What is hidden too; of those that are named each is looked at."""
    cell = folder / "cell.yaml"
    others = sorted({*folder.iterdir()} - {cell})
    for name in ("drawing.pdf", "photo.jpg", ".part.mod"):
        (folder / name).write_text("x")
    run = kit.run("check", cell, folder)
    assert run.code == 0, run
    last = run.out.strip().splitlines()[-1]
    assert last == f"{1 + len(others)} files, 0 with errors; 3 of kinds that no command reads were passed over"
    assert "passed over" not in kit.run("check", cell, *others).out


def test_a_log_under_lines_of_its_own_logger_is_told_as_a_log(folder: Path) -> None:
    """With the columns to put into cell.yaml, as correct says it."""
    (folder / "logged.csv").write_text("Messung vom 12.03.\nProjekt: Tasche\nZeit [ms];Kraft X [N];Kraft Y [N];Kraft Z [N]\n"
                                       + "".join(f"{10 * k};1,5;2,5;3,5\n" for k in range(20)))
    run = check(folder, folder / "logged.csv")
    assert verdicts(run)["logged.csv"] == ("force log", "error")
    assert "columns: [time_ms, fx_n, fy_n, fz_n]" in run.out


def test_the_samples_are_sound(tmp_path: Path) -> None:
    for name in ("cell.yaml", "measurements.csv", "insert.mod"):
        shutil.copy(SAMPLES / name, tmp_path)
    run = check(tmp_path, tmp_path)
    assert run.code == 0
    assert set(verdicts(run).values()) == {("cell", "ok"), ("measurements", "ok"), ("toolpath", "ok")}


@pytest.mark.parametrize(("stated", "code"), [
    ("teeth: 3, material: titanium", ""), ("teeth: 3", ""), ("teeth: 3, material: steel", "CS4721"),
    ("material: steel", ""), ("", "")])
def test_cutting_coefficients_are_held_against_the_cell_s_cutter(folder: Path, stated: str, code: str) -> None:
    cell = folder / "cell.yaml"
    cell.write_text(cell.read_text() + (f"cutting: {{tool_diameter_mm: 16, {stated}}}\n" if stated else ""))
    (folder / "cutting.json").write_text(json.dumps(CUTTING))
    run = check(folder, folder / "cutting.json")
    assert (run.code, kit.codes(run)) == ((1, {code}) if code else (0, set()))


def test_a_labview_file_is_a_force_log_whose_format_is_to_be_named(folder: Path) -> None:
    """As `correct` says it; named, it is read."""
    values = np.random.default_rng(2).normal(0, 20, (30, 3))
    (folder / "log.lvm").write_bytes(lvm([(0.0, values)]).encode())
    run = check(folder, folder / "log.lvm")
    assert (run.code, verdicts(run)["log.lvm"]) == (1, ("force log", "error"))
    [finding] = run.json["findings"]
    assert (finding["code"], finding["hint"]) == ("CS0201", "read it with --log-format lvm")
    named = check(folder, folder / "log.lvm", "--log-format", "lvm")
    assert (named.code, verdicts(named)["log.lvm"][0]) == (0, "force log"), named


def test_rows_with_a_load_and_poses_are_counted(folder: Path) -> None:
    """Of what is filled in; a row of zeros is the unloaded robot."""
    sheet = folder / "measurements.csv"
    header, *rows = sheet.read_text().splitlines()
    names = header.split(",")
    zero = [value if name.startswith("q") else "0" for name, value in zip(names, rows[0].split(","), strict=True)]
    sheet.write_text("\n".join([header, ",".join(zero), *rows, ",".join(zero)]) + "\n")
    (found,) = [one["found"] for one in check(folder, sheet).json["result"]["files"] if one["file"].endswith(".csv")]
    assert found.startswith("62 rows, 60 with a load, ")


def test_each_kind_is_said_in_its_own_words(folder: Path) -> None:
    """What a user would look for in the file: how far, how many, for whom."""
    rows = "\n".join(f"{k},{x},{y},0" for k, (x, y) in enumerate([(0.1, 0.05), (-0.31, 0.2), (0, 0.123)]))
    (folder / "offsets.csv").write_text(f"target,ox_mm,oy_mm,oz_mm\n{rows}\n")
    (folder / "before.csv").write_text("target,dx_um,dy_um,dz_um\n0,1,2,3\n1,2,3,4\n")
    (folder / "points.csv").write_text("x_mm,y_mm,z_mm,dx_um,std_um\n1,2,3,10,5\n2,2,3,10,5\n3,2,3,10,5\n")
    simulated_joint.write(folder / "motion.csv", simulated_joint.columns(1, {}))
    shutil.copy(SAMPLES / "cell.yaml", folder / "second.yaml")
    (folder / "plan.json").write_text(json.dumps({"format": "compstiff-diagnosis", "version": 1}))
    run = check(folder, *(folder / name for name in ("offsets.csv", "before.csv", "points.csv", "motion.csv", "second.yaml",
                                                    "plan.json")))
    found = {Path(one["file"]).name: one["found"] for one in run.json["result"]["files"]}
    assert found["offsets.csv"] == "3 rows from target 0, largest component 0.31 mm"
    assert found["before.csv"] == "2 rows"
    assert found["points.csv"] == "3 points"
    assert found["motion.csv"] == "joints 2, 5000 samples at 250 Hz"
    assert found["second.yaml"].startswith(f"{ROBOT}, TCP at [")
    assert found["plan.json"] == "of a plan"


def test_files_that_the_commands_write_are_said_in_their_own_words(folder: Path) -> None:
    """Without the hours that it takes to make them; of another robot they are refused, and what its own log rejects is said."""
    diagnosis = {"format": "compstiff-diagnosis", "version": 1, "robot": ROBOT, "verdict": "ambiguous",
                 "alternatives": [{"effect": "backlash", "joint": 2}, {"effect": "channel_delay", "joint": None}]}
    files = {"named.json": diagnosis, "other.json": diagnosis | {"robot": "irb6640-180-2.55"}, "cutting.json": CUTTING,
             "doubted.json": CUTTING | {"rejected": "it leaves 40 % of the force"}, "said.json": {
                 "format": "compstiff-correct", "exit_code": 0}, "post.json": {"format": "compstiff-post", "version": 1},
             "learned.json": learned_json(learned(), read_cell(folder / "cell.yaml"))}
    for name, content in files.items():
        (folder / name).write_text(json.dumps(content))
    (folder / "part.stock.yaml").write_text("box: {from_mm: [-60, -40.5, -30], to_mm: [60, 80, 0]}\n")
    shutil.copy(built_in_robots()[ROBOT], folder / "mine.yaml")
    frame = pd.read_csv(folder / "measurements.csv")
    frame.to_parquet(folder / "rows.parquet")
    names = [*files, "part.stock.yaml", "mine.yaml", "rows.parquet"]
    run = check(folder, *(folder / name for name in names))
    told = {Path(one["file"]).name: (one["kind"], one["verdict"], one["found"]) for one in run.json["result"]["files"]}
    assert told.pop("cell.yaml")[1] == "ok"
    cutter = told["cutting.json"][2]
    assert cutter.endswith("in titanium, Ktc 2100 N/mm^2")
    assert told == {
        "named.json": ("diagnosis", "ok", "verdict ambiguous"), "other.json": ("diagnosis", "error", ""),
        "cutting.json": ("cutting", "ok", cutter), "doubted.json": ("cutting", "warning", cutter),
        "said.json": ("result", "ok", "what a command said"), "post.json": ("record", "ok", "what a program was made from"),
        "learned.json": ("learned", "ok", "of this robot"),
        "part.stock.yaml": ("stock", "ok", "x -60 to 60; y -40.5 to 80; z -30 to 0 mm"), "mine.yaml": ("robot", "ok", ROBOT),
        "rows.parquet": ("measurements", "ok", "60 rows, 60 with a load, 10 poses, 0 rows kept back")}
    assert {(one["code"], Path(one["file"]).name): one["message"] for one in run.json["findings"]} == {
        ("CS1650", "other.json"): f"the diagnosis is of robot irb6640-180-2.55, the cell has {ROBOT}",
        ("CS4752", "doubted.json"): "the log that these coefficients were fitted to rejects them: it leaves 40 % of the force"}


@pytest.mark.parametrize(("name", "content", "line"), [
    ("k.json", "{\n  broken\n", 2), ("deep.json", "[" * 200_000, None), ("half.json", b'{"format": "\xff"}', None)])
def test_a_json_file_that_is_none_is_said(folder: Path, name: str, content: str | bytes, line: int | None) -> None:
    (folder / name).write_bytes(content if isinstance(content, bytes) else content.encode())
    run = check(folder, folder / name)
    (told,) = [one for one in run.json["findings"] if one["code"] == "CS0110"]
    assert (run.code, told["level"], Path(told["file"]).name, told["line"]) == (1, "error", name, line)
    assert "is not JSON" in told["message"]


@pytest.mark.parametrize("rows", ["ask,why\n1,2\n", "ask,why,how\n1,2,3\n"])
def test_a_table_with_the_columns_that_the_cell_names_is_a_log(folder: Path, rows: str) -> None:
    """Named by number in cell.yaml: a table of as many columns, whatever stands above them, and no other one."""
    cell = folder / "cell.yaml"
    text = cell.read_text()
    assert "columns:" not in text
    text = re.sub(r"^force_log: *\{", "force_log: {columns: [fx_n, fy_n, fz_n], ", text, flags=re.M)
    assert "columns:" in text
    cell.write_text(text)
    (folder / "odd.csv").write_text(rows)
    run = check(folder, folder / "odd.csv")
    kinds = {name: kind for name, (kind, _) in verdicts(run).items()}
    assert kinds["odd.csv"] == ("force log" if "how" in rows else "")


def test_what_is_told_of_tables_is_counted(tmp_path: Path) -> None:
    """Of 3, 4 and 12 N the force is 13; of two loaded rows of four at two poses one is kept back."""
    (tmp_path / "cell.yaml").write_text(f"robot: {ROBOT}\ntool: {{position_mm: [120, 0, 250]}}\n")
    (tmp_path / "log.csv").write_text("target,fx_n,fy_n,fz_n\n0,3,4,12\n1,-9,0,0\n2,0,0,9\n")
    (tmp_path / "after.csv").write_text("target,dx_um\n0,40\n1,\n")
    (tmp_path / "points.csv").write_text("x_mm,y_mm,z_mm,dx_um,std_um\n1,2,3,10,5\n2,2,3,20,5\n")
    angles = [[0, 10, 20, 0, 30, 0], [20, 10, 20, 0, 30, 0]]
    rows = [[*angle, load, 0, 0, load / 10, 0, 0, name, "validate" if load > 100 else "identify"]
            for angle, name in zip(angles, "ab", strict=True) for load in (0, 100 + 50 * (name == "b"))]
    (tmp_path / "loads.csv").write_text(
        ",".join([*(f"q{k}_deg" for k in range(1, 7)), "fx_n,fy_n,fz_n,dx_um,dy_um,dz_um,pose,purpose"]) + "\n"
        + "".join(",".join(map(str, row)) + "\n" for row in rows))
    run = check(tmp_path, *(tmp_path / name for name in ("log.csv", "after.csv", "points.csv", "loads.csv")))
    assert {Path(one["file"]).name: one["found"] for one in run.json["result"]["files"][1:]} == {
        "log.csv": "3 samples placed by target, largest 13 N", "after.csv": "1 row", "points.csv": "2 points",
        "loads.csv": "4 rows, 2 with a load, 2 poses, 1 row kept back"}, run


def test_what_correct_wrote_is_a_good_file_that_is_not_to_be_corrected_again(folder: Path) -> None:
    """Said beside what is said of any program, as a note; of the program that it was made from it is not said."""
    correct = ("correct", folder / "cell.yaml", folder / "part.mod", "--stiffness", folder / "stiffness.json", "--tare", "0:1")
    assert kit.run(*correct, "-o", folder / "corrected.mod").code == 0
    run = check(folder, folder / "corrected.mod", folder / "part.mod")
    assert (run.code, verdicts(run)["corrected.mod"]) == (0, ("toolpath", "note"))
    told = [(Path(one["file"]).name, one["code"], one["level"]) for one in run.json["findings"]]
    assert told == [("corrected.mod", "CS2013", "note"), ("corrected.mod", "CS4204", "note"), ("part.mod", "CS2013", "note")]
    again = next(one for one in run.json["findings"] if one["code"] == "CS4204")
    assert again["message"].startswith("is the output of an earlier correction (record corrected.mod.json)")
    assert again["hint"].startswith("correct the CAM system's program part.mod; ")


def test_what_is_said_of_a_log_alone_is_not_said_again_beside_its_program(folder: Path) -> None:
    """Two components that are the same: a warning of the log, with or without the program of its name."""
    frame = pd.read_csv(folder / "part.forces.csv").loc[lambda rows: rows.index.repeat(5)]
    frame["fx_n"] += np.random.default_rng(3).normal(0, 1, len(frame))
    frame["fz_n"] = frame["fy_n"] = np.random.default_rng(4).normal(0, 1, len(frame)) + frame["fy_n"]
    frame.to_csv(folder / "part.forces.csv", index=False)
    told = [[(one["code"], one["level"]) for one in run.json["findings"] if one["file"].endswith("part.forces.csv")]
            for run in (check(folder, *(folder / name for name in names), "--tare", "0:1") for names in (
                ("part.forces.csv",), ("part.forces.csv", "part.mod")))]
    assert told[0] == told[1]
    assert told[0].count(("CS3024", "warning")) == 1


@pytest.mark.parametrize("shown", ["", "tcp", "turn"])
def test_the_order_of_a_quaternion_is_asked_unless_the_pendant_proves_it(tmp_path: Path, shown: str) -> None:
    """A tool turned about a line between y and z, as no turn but one about z would stand in the order x y z w; so stands the
    work object, which no pose of the pendant shows. shown: by the poses, nothing, the place alone, or the turn too."""
    quaternion = [0.0, 0.0, 0.258819045, 0.965925826]
    tool = kit.Frame.mm([110.0, -20.0, 260.0], np.array(quaternion))
    lines = []
    for angles in ([10, 20, -5, 40, 50, 60], [-30, 5, 20, -60, 40, -100]):
        pose = kit.tcp_pose(ARMS[ROBOT], np.radians(angles), tool)
        turn = f", quaternion: {kit.quaternion(pose.r).tolist()}" if shown == "turn" else ""
        lines.append(f"  - {{joints_deg: {angles}, tcp_mm: {np.round(1e3 * pose.p, 1).tolist()}{turn}}}\n")
    (tmp_path / "cell.yaml").write_text(
        f"robot: {ROBOT}\ntool: {{position_mm: [110, -20, 260], quaternion: {quaternion}}}\n"
        f"workobject: {{position_mm: [1400, 500, 800], quaternion: {quaternion}}}\n"
        + ("pendant_poses:\n" + "".join(lines) if shown else ""))
    run = check(tmp_path)
    assert run.code == 0, run
    asked = [one["message"].split(" [")[0] for one in run.json["findings"] if one["code"] == "CS0117"]
    assert sorted(asked) == ["tool.quaternion"] * (shown != "turn") + ["workobject.quaternion"]


def test_a_file_that_the_disk_does_not_give_is_said_and_the_others_are_checked(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken(file: Path) -> None:
        raise OSError(errno.EIO, os.strerror(errno.EIO), str(file))

    (folder / "part.stock.yaml").write_text("box: {from_mm: [-60, -40, -30], to_mm: [60, 80, 0]}\n")
    monkeypatch.setattr("compensator.cutting.stock_file.read_stock", broken)
    run = check(folder, folder / "part.stock.yaml", folder / "part.mod")
    assert (run.code, verdicts(run)) == (1, {
        "cell.yaml": ("cell", "ok"), "part.stock.yaml": ("stock", "error"), "part.mod": ("toolpath", "note")})
    (told,) = [one for one in run.json["findings"] if one["level"] == "error"]
    assert (told["code"], told["message"], Path(told["file"]).name) == (
        "CS0005", "cannot be read: Input/output error", "part.stock.yaml")

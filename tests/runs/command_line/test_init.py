"""`init` and the chain it writes: a new cell goes through make from the plan to a corrected program that lands."""

from __future__ import annotations

import csv
import json
import os
import re
import select
import shlex
import subprocess
import sys
import time
from collections.abc import Iterable
from pathlib import Path

import click
import numpy as np
import pytest
import yaml
from click.shell_completion import ShellComplete

from compstiff.cli.init import QUESTIONS
from compstiff.cli.main import compstiff as group
from identification.common.files import check_writable
from identification.model.cell import read_cell
from identification.model.robot import built_in_robots
from tests.runs.command_line import user_files as kit
from tests.runs.command_line.workshop import TOOL, USER, workshop
from tests.virtual_cell.arm import ARMS

ROBOT = "irb6700-200-2.60"
TCP = ",".join(f"{1e3 * x:g}" for x in TOOL.p)
COMPSTIFF = f"{sys.executable} -m compstiff"


def make(folder: Path, *words: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(["make", "-C", str(folder), f"COMPSTIFF={COMPSTIFF}", *words], capture_output=True, text=True,
                          timeout=300)


def measured(plan: Path, sheet: Path, robot: str = ROBOT, k: np.ndarray = kit.K, seed: int = 3) -> None:
    """The plan carried out on the virtual arm: its rows with what a laser would show, 2 um of noise."""
    arm, rng = ARMS[robot], np.random.default_rng(seed)
    lines = [line for line in plan.read_text(encoding="utf-8").splitlines() if not line.startswith("#")]
    rows = list(csv.DictReader(lines))
    for row in rows:
        q = np.radians([float(row[f"q{i}_deg"]) for i in range(1, 7)])
        force = [float(row[f"f{axis}_n"]) for axis in "xyz"] if "fx_n" in row else [0, 0, -9.80665 * float(row["mass_kg"])]
        moved = 1e6 * kit.deviation(arm, q, TOOL.p, np.r_[force, 0, 0, 0], k) + rng.normal(0, 2, 3)
        row |= {f"d{axis}_um": f"{value:.2f}" for axis, value in zip("xyz", moved, strict=True)}
    with sheet.open("w", newline="") as stream:
        writer = csv.DictWriter(stream, rows[0])
        writer.writeheader()
        writer.writerows(rows)


@pytest.fixture(scope="module")
def cell(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("init") / "cell 7"
    made = kit.run("init", folder, "--robot", ROBOT, "--tool-tcp", TCP, "--json")
    assert made.code == 0, made
    assert made.json["result"]["files"] == ["cell.yaml", "measurements.csv", "Makefile", "chain.ps1"]
    assert all("compstiff" in step or "measure" in step or "make" in step for step in made.json["result"]["next_steps"])
    return folder


def test_what_init_writes_is_checked_sound(cell: Path) -> None:
    """The blank sheet is said to be blank, and nothing is wrong."""
    checked = kit.run("check", cell / "cell.yaml", cell, "--json")
    assert checked.code == 0, checked
    kinds = {Path(one["file"]).name: (one["kind"], one["verdict"]) for one in checked.json["result"]["files"]}
    assert kinds == {"cell.yaml": ("cell", "ok"), "measurements.csv": ("measurements", "note")}
    assert kit.codes(checked) == {"CS0112"}
    assert kit.table(cell / "measurements.csv") == []
    # What the help says of an answer that was not given.
    assert yaml.safe_load((cell / "cell.yaml").read_text())["measurement"]["deflection_std_um"] == [2, 2, 2]
    early = kit.run("identify", cell / "cell.yaml", cell / "measurements.csv", "-o", cell / "stiffness.json")
    assert early.code == 1
    assert "the sheet is empty" in early.err


def test_what_is_written_is_laid_out_as_by_hand(cell: Path) -> None:
    """Each file ends with a line of its own, and nothing of what its template decides leaves an empty or indented line."""
    for name in ("cell.yaml", "Makefile", "chain.ps1"):
        text = (cell / name).read_text()
        assert text.endswith("\n")
        assert not text.startswith("\n")
        assert "\n\n\n" not in text
        assert not re.search(r"[ \t]+$", text, re.MULTILINE), name
    text = (cell / "cell.yaml").read_text()
    assert "\n\n" not in text[text.index("\nforce_log:"):text.index("\nlimits:")]


# Long: the tutorial goes the same way through the Makefile (tests/test_documentation.py), and a corrected program lands in
# test_demo.py.
@pytest.mark.long
def test_the_chain_from_the_plan_to_a_part_that_lands(cell: Path) -> None:
    """From plan to correction through the Makefile; the loaded arm is where it was meant to be."""
    planned = make(cell, "plan", "RUNS=4", "KEPT_BACK=1")
    assert planned.returncode == 0, planned.stderr
    assert (cell / "plan.mod").read_text().startswith("%%%")
    measured(cell / "plan.csv", cell / "measurements.csv")
    job = workshop(ROBOT)
    (cell / "programs" / "part.mod").write_text(job.files["part.mod"])
    (cell / "programs" / "part.forces.csv").write_text(job.files["forces.csv"])
    checked = make(cell, "check")
    assert checked.returncode == 0
    # The plan moves by joint angles with tool0: nothing is wrong with its tool.
    assert not [line for line in checked.stderr.splitlines() if "plan.mod" in line and "CS2055" in line]
    done = make(cell, "correct", "TARE=--tare 0:1")
    assert done.returncode == 0, done.stderr
    diagnosis = json.loads((cell / "diagnosis.json").read_text())
    assert diagnosis["verdict"] == "adequate"
    found = np.array([p["estimate"] for p in json.loads((cell / "stiffness_extended.json").read_text())["parameters"]])
    np.testing.assert_allclose(found, kit.K, rtol=0.15)
    before = kit.targets_of(job.files["part.mod"])
    after = kit.targets_of((cell / "corrected" / "part.mod").read_text())
    offsets = kit.table(cell / "corrected" / "part.offsets.csv")
    forced = [row for row in offsets if float(row["ox_mm"] or 0) != 0]
    assert len(forced) == 8
    arm, q = ARMS[ROBOT], np.radians([-15.0, 20, 12, 40, -50, 100])
    left, without = [], []
    for row in forced:
        plan = before[int(row["target"])]
        aim = USER @ plan
        commanded = USER @ min(after, key=lambda pose: float(np.linalg.norm(pose.p - plan.p)))
        force = np.array([80.0 + 4 * int(row["target"]), -120.0 - 3 * int(row["target"]), -150.0])
        for pose, errors in ((commanded, left), (aim, without)):
            at = kit.solve(arm, pose @ TOOL.inv(), q)
            loaded = kit.point(arm, kit.loaded(arm, at, TOOL.p, np.r_[force, 0, 0, 0], kit.K), TOOL.p)[0]
            errors.append(np.linalg.norm(loaded - aim.p))
    assert min(without) > 100e-6
    assert max(left) < 0.1 * max(without)
    assert "no TARE" not in done.stderr
    assert "no TARE" in make(cell, "correct").stderr, "a sensor's zero that nobody named is said"
    unchanged = make(cell, "diagnose")
    assert unchanged.returncode == 0
    assert "compstiff diagnose" not in unchanged.stdout, "nothing has changed"


def test_a_plan_that_was_filled_in_is_not_written_over(cell: Path) -> None:
    """Not by make, though cell.yaml is newer, nor by design itself."""
    plan = cell / "plan.csv"
    if not plan.exists():
        plan.write_text("filled in by hand\n")
    content = plan.read_bytes()
    os.utime(cell / "cell.yaml")
    assert make(cell, "plan").returncode == 0
    assert kit.run("design", cell / "cell.yaml", "--quick", "-o", plan).code == 1
    assert plan.read_bytes() == content


def test_the_filled_plan_is_saved_where_the_chain_reads_it(cell: Path, tmp_path: Path) -> None:
    result = kit.run("design", cell / "cell.yaml", "--quick", "--measurements", "1", "--axes", "z", "-o", tmp_path / "plan.csv")
    # Where the chain of `init` looks for it.
    assert f"-o {tmp_path / 'stiffness.json'}" in result.err
    table = tmp_path / "measurements.csv"
    words = shlex.split(result.err.strip().splitlines()[-1])
    assert words[words.index("save"):words.index("-o")] == [
        "save", "it", "as", f"{table},", "then", "compstiff", "identify", str(cell / "cell.yaml"), str(table)]
    assert "measurements.csv" in make(cell, "-n", "identify").stdout


def test_a_folder_that_exists_is_left_as_it_is(cell: Path) -> None:
    before = {path.name: path.read_bytes() for path in cell.iterdir() if path.is_file()}
    again = kit.run("init", cell, "--robot", "irb4400-60", "--tool-tcp", "0,50,100", "--json")
    assert again.code == 1
    assert kit.codes(again) == {"CS0003"}
    assert {path.name: path.read_bytes() for path in cell.iterdir() if path.is_file()} == before


@pytest.mark.parametrize(("words", "code", "said"), [
    ((), 2, "no terminal to ask on"),
    (("--robot", "irb6660-205-1.90"), 2, "--tool-tcp"),
    (("--robot", "irb6661", "--tool-tcp", "0,0,250"), 1, "CS0104"),
    (("--robot", "irb4400-60", "--tool-tcp", "0,0,0.25"), 1, "CS0100"),
    (("--robot", "irb4400-60", "--tool-tcp", "0,0"), 2, "3 numbers"),
    (("--robot", "irb4400-60", "--tool-tcp", "0,0,inf"), 2, "3 numbers"),
    (("--robot", "irb4400-60", "--tool-tcp", "0,0,250", "--tool-quaternion", "1,1,0,0"), 1, "CS0100"),
    (("--robot", "irb4400-60", "--tool-tcp", "0,0,250", "--force-frame", "sensor"), 2, "--sensor-position"),
    (("--robot", "irb4400-60", "--tool-tcp", "0,0,250", "--sensor-position", "0,0,1"), 2, "belong to"),
    (("--robot", "irb4400-60", "--tool-tcp", "0,0,250", "--weights", "heavy"), 2, "masses in kg"),
    (("--robot", "irb4400-60", "--tool-tcp", "0,0,250", "--material", "wood"), 2, "none of aluminium"),
    (("--robot", "irb4400-60", "--tool-tcp", "0,0,250", "--contact", "3"), 2, "belong to --material"),
])
def test_what_cannot_become_a_cell_is_refused_and_nothing_written(
    tmp_path: Path, words: tuple[str, ...], code: int, said: str
) -> None:
    done = kit.run("init", tmp_path / "new", *words)
    assert done.code == code, done
    assert said in done.err
    assert not (tmp_path / "new").exists()


def test_every_answer_stands_in_the_cell(tmp_path: Path) -> None:
    """Each option, read back from the YAML by another reader than the program's."""
    import yaml

    done = kit.run("init", tmp_path / "new", "--robot", "irb4400-60", "--tool-tcp", "1.5,-2,250", "--tool-quaternion",
                   "0.70710678,0,0.70710678,0", "--tool-mass", "31.25", "--tool-centre", "4,5,-6", "--deflection-std", "7.5",
                   "--force-frame", "sensor", "--sensor-position", "0,0,61", "--sensor-quaternion", "0,1,0,0", "--force-sign",
                   "by_tool", "--spindle-rpm", "12345", "--weights", "20,40", "--serial-number", '12 "b"',
                   "--material", "cast iron", "--cutter-diameter", "12.5", "--contact", "3")
    assert done.code == 0, done
    cell = yaml.safe_load((tmp_path / "new" / "cell.yaml").read_text())
    assert cell["tool"] == {"position_mm": [1.5, -2, 250], "quaternion": [0.70710678, 0, 0.70710678, 0], "mass_kg": 31.25,
                            "centre_of_mass_mm": [4, 5, -6]}
    assert cell["serial_number"] == '12 "b"'
    assert cell["measurement"] == {"deflection_std_um": [7.5, 7.5, 7.5]}
    assert cell["force_log"] == {"frame": "sensor", "sensor_position_mm": [0, 0, 61], "sensor_quaternion": [0, 1, 0, 0],
                                 "sign": "by_tool", "spindle_rpm": 12345}
    assert cell["cutting"] == {"material": "cast_iron", "tool_diameter_mm": 12.5, "contact_mm": 3}
    assert "mass_kg" in (tmp_path / "new" / "measurements.csv").read_text().splitlines()[-1].split(",")
    for name in ("Makefile", "chain.ps1"):
        assert "--dead-weight" in (tmp_path / "new" / name).read_text()


def test_a_robot_file_goes_into_the_folder(tmp_path: Path) -> None:
    mine = tmp_path / "mine.yaml"
    mine.write_text(built_in_robots()["irb4400-60"].read_text().replace("name: irb4400-60", "name: mine"))
    done = kit.run("init", tmp_path / "new", "--robot", mine, "--tool-tcp", "100,0,250", "--json")
    assert done.code == 0, done
    assert done.json["result"]["robot"] == "mine"
    assert (tmp_path / "new" / "mine.yaml").read_bytes() == mine.read_bytes()
    assert kit.run("check", tmp_path / "new" / "cell.yaml").code == 0


@pytest.mark.parametrize(("robot", "tcp", "said"), [
    (ROBOT, TCP, {}), (ROBOT, "0,0,250", {"CS0106": "the TCP stands on axis 6: no pure force turns that joint, and k6 "}),
    (ROBOT, "0.3,-0.4,250", {"CS0106": "the TCP stands 0.5 mm from axis 6: pure forces hardly turn that joint, and k6 "}),
    (ROBOT, "3,4,250", {"CS0106": "the TCP stands 5 mm from axis 6: "}), (ROBOT, "3,4.1,250", {}),
    ("kr60-ha", TCP, {"CS0107": "kr60-ha does not run RAPID"})])
def test_what_a_later_command_cannot_do_is_said(tmp_path: Path, robot: str, tcp: str, said: dict[str, str]) -> None:
    done = kit.run("init", tmp_path / "new", "--robot", robot, "--tool-tcp", tcp, "--json")
    assert done.code == 0, done
    found = {one["code"]: one for one in done.json["findings"] if one["code"] in ("CS0106", "CS0107")}
    assert set(found) == set(said)
    for code, words in said.items():
        assert found[code]["message"].startswith(words)
        assert found[code]["file"] == str(tmp_path / "new" / "cell.yaml")


def test_another_maker_s_robot_has_no_corrected_program(tmp_path: Path) -> None:
    done = kit.run("init", tmp_path / "new", "--robot", "kr60-ha", "--tool-tcp", "0,0,250", "--json")
    assert kit.codes(done) == {"CS0106", "CS0107"}
    for name in ("Makefile", "chain.ps1"):
        text = (tmp_path / "new" / name).read_text()
        assert "rapid" not in text
        assert "compstiff correct" not in text.replace("$(COMPSTIFF)", "compstiff")


def test_the_twin_in_powershell_calls_what_make_calls(cell: Path) -> None:
    """PowerShell is not at hand to run it: the calls, step by step, are those of the Makefile."""
    def calls(text: str, start: str) -> dict[str, str]:
        found = re.findall(rf"^\s+{re.escape(start)} (\w+) (.*)$", text, re.M)
        return {command: re.sub(r"\$\(\w+\)|\$\w+|@Words", "*", words).replace("'", "").replace("* *", "*")
                for command, words in found}

    posix, windows = (cell / "Makefile").read_text(), (cell / "chain.ps1").read_text()
    assert calls(posix, "$(COMPSTIFF)") == calls(windows, "Invoke-Compstiff")
    assert len(calls(posix, "$(COMPSTIFF)")) == 5
    for opening, closing in ("{}", "()", "[]"):
        assert windows.count(opening) == windows.count(closing)


def test_on_a_terminal_it_asks(tmp_path: Path) -> None:
    """A person at a terminal: a question mark lists the robots, a wrong answer is asked again, Enter takes what is shown."""
    pty = pytest.importorskip("pty", reason="a terminal of POSIX")
    primary, secondary = pty.openpty()
    process = subprocess.Popen([sys.executable, "-m", "compstiff", "init", str(tmp_path / "asked"), "--spindle-rpm", "9000"],
                               stdin=secondary, stdout=secondary, stderr=secondary, close_fds=True, start_new_session=True)
    os.close(secondary)
    shown = ""

    def until(words: str) -> None:
        nonlocal shown
        end = time.monotonic() + 120
        seen = ""
        while words not in seen:
            assert time.monotonic() < end, f"no '{words}' in: {shown}{seen}"
            if select.select([primary], [], [], 0.2)[0]:
                seen += os.read(primary, 4096).decode()
        shown += seen

    try:
        for question, answer in (("Robot", "?"), ("Robot (", "KUKA KR 210 R2700"), ("Near it: kr210-r2700-extra", "?"),
                                 ("Robot (", "irb6660-205-1.90"), ("serial number", "6660-1"), ("TCP", "120,0"),
                                 ("TCP", "120,0,250"),
                                 ("Turn of the tool", ""), ("Mass", "80"), ("centre of mass", "10,0,180"), ("1 sigma", ""),
                                 ("hung weights", ""), ("Frame", "tool"), ("Do the logged", ""), ("Material", "wood"),
                                 ("Material", "aluminium"), ("Diameter", "16"), ("How long", "")):
            until(question)
            os.write(primary, f"{answer}\n".encode())
        until("next steps")
    finally:
        if "next steps" not in shown:
            process.kill()
        process.wait(timeout=300)
        os.close(primary)
    assert "irb4400-60" in shown, "the question mark lists the robots"
    assert process.returncode == 0
    text = (tmp_path / "asked" / "cell.yaml").read_text()
    for said in ("robot: irb6660-205-1.90", 'serial_number: "6660-1"',
                 "position_mm: [120, 0, 250]", "mass_kg: 80", "centre_of_mass_mm: [10, 0, 180]",
                 "frame: tool", "spindle_rpm: 9000", "material: aluminium", "  tool_diameter_mm: 16", "# contact_mm"):
        assert said in text


def test_what_the_template_says_of_a_turned_sensor_is_read_so(cell: Path, tmp_path: Path) -> None:
    """The commented lines, taken in: the sensor's x axis stands between the flange's x and y, as their words say."""
    text = (cell / "cell.yaml").read_text()
    text = text.replace("frame: base", "frame: sensor").replace("# sensor_position_mm:", "sensor_position_mm:")
    assert "its x axis between the flange's x and y" in text
    (tmp_path / "cell.yaml").write_text(text.replace("# sensor_quaternion:", "sensor_quaternion:"))
    frame = read_cell(tmp_path / "cell.yaml").force_log.flange_from_sensor
    assert frame is not None
    np.testing.assert_allclose(frame.rotation @ [1, 0, 0], [np.sqrt(0.5), np.sqrt(0.5), 0], atol=1e-6)
    np.testing.assert_allclose(frame.position, [0, 0, 0.06])
    assert "force_log.sensor turned 45 deg about z" in kit.run("check", tmp_path / "cell.yaml").out


def test_a_folder_that_has_programs_already_becomes_a_cell(tmp_path: Path) -> None:
    """Whose programs stay."""
    (tmp_path / "programs").mkdir()
    (tmp_path / "programs" / "part.mod").write_text("MODULE A\nENDMODULE\n")
    made = kit.run("init", tmp_path, "--robot", ROBOT, "--tool-tcp", TCP, "--json")
    assert made.code == 0, made
    assert (tmp_path / "cell.yaml").is_file()
    assert (tmp_path / "programs" / "part.mod").read_text() == "MODULE A\nENDMODULE\n"


@pytest.mark.parametrize(("words", "asked"), [
    ((), False), (("--force-frame", "sensor", "--sensor-position", "0,0,61"), True),
    (("--force-frame", "sensor", "--sensor-position", "0,0,61", "--tool-mass", "30", "--tool-centre", "0,0,90"), False)])
def test_what_a_sensor_carries_is_asked_for(tmp_path: Path, words: tuple[str, ...], asked: bool) -> None:
    """The note is about the cell.yaml that was written."""
    done = kit.run("init", tmp_path / "new", "--robot", ROBOT, "--tool-tcp", TCP, *words, "--json")
    assert done.code == 0, done
    said = [finding for finding in done.json["findings"] if finding["code"] == "CS0103"]
    assert [finding["file"] for finding in said] == [str(tmp_path / "new" / "cell.yaml")] * asked


@pytest.mark.parametrize("of", ["cell.yaml", "mine.yaml"])
def test_a_wrong_answer_is_told_of_the_file_that_would_have_been(tmp_path: Path, of: str) -> None:
    """The cell's, or the robot's own."""
    mine = tmp_path / "mine.yaml"
    text = (built_in_robots()["irb4400-60"]).read_text().replace("name: irb4400-60", "name: mine")
    mine.write_text(text if of == "cell.yaml" else text.replace("joints:", "joins:"))
    tcp = "0,0,0.25" if of == "cell.yaml" else TCP
    done = kit.run("init", tmp_path / "new", "--robot", mine, "--tool-tcp", tcp, "--json")
    assert done.code == 1
    said = [finding for finding in done.json["findings"] if finding["level"] == "error"]
    assert {finding["file"] for finding in said} == {str(tmp_path / "new" / of)}


@pytest.mark.parametrize("name", ["deflection_std", "spindle_rpm", "cutter_diameter", "contact"])
def test_what_cannot_be_nothing_is_asked_again(name: str) -> None:
    """A reading without any error, a spindle that stands, a cutter without a size: on a terminal as by an option."""
    (kind,) = (kind for asked, _, kind, _ in QUESTIONS if asked == name)
    assert kind.convert("0.5", None, None) == 0.5
    with pytest.raises(click.BadParameter, match="range"):
        kind.convert("0", None, None)


def test_of_robots_with_a_name_near_the_one_that_is_none_three_are_named(tmp_path: Path) -> None:
    """The nearest first, as they are spelled."""
    done = kit.run("init", tmp_path / "new", "--robot", "IRB6660-205-1.9", "--tool-tcp", TCP, "--json")
    (finding,) = done.json["findings"]
    near = re.match(r"near it: (.*); compstiff robots lists the built-in ones; ", finding["hint"])
    assert near, finding
    assert len(near[1].split(", ")) == len(set(near[1].split(", ")) & set(built_in_robots())) == 3
    assert near[1].split(", ")[0] == "irb6660-205-1.90"
    far = kit.run("init", tmp_path / "new", "--robot", "xyz", "--tool-tcp", TCP, "--json").json["findings"]
    assert [one["hint"].partition(";")[0] for one in far] == ["compstiff robots lists the built-in ones"]


def test_the_shell_completes_the_name_of_a_robot() -> None:
    words = ShellComplete(group, {}, "compstiff", "_COMPSTIFF_COMPLETE").get_completions(["init", "new", "--robot"], "irb67")
    assert [word.value for word in words] == [name for name in built_in_robots() if name.startswith("irb67")]
    assert len(words) > 1


@pytest.mark.parametrize("overwrite", [False, True])
def test_a_file_that_came_to_be_there_meanwhile_is_kept_unless_it_may_go(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, overwrite: bool
) -> None:
    def looked(paths: Iterable[Path], **named: bool) -> None:
        check_writable(paths, **named)
        (tmp_path / "new" / "measurements.csv").write_text("mine\n")

    monkeypatch.setattr("compstiff.cell_folder.check_writable", looked)
    done = kit.run("init", tmp_path / "new", "--robot", ROBOT, "--tool-tcp", TCP, *(["--force"] if overwrite else []))
    assert done.code == (0 if overwrite else 1)
    assert ((tmp_path / "new" / "measurements.csv").read_text() == "mine\n") != overwrite
    assert (tmp_path / "new" / "cell.yaml").exists() == overwrite

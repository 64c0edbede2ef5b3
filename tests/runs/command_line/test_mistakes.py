"""Ordinary mistakes of a newcomer, each made on purpose in a sound job, on two robots: none passes without a word.

A mistake is a changed file, or a call; what answers it is an exit code and a finding. Where the job is done all the same, the
finding is a warning.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from tests.runs.command_line import user_files as kit
from tests.runs.command_line.workshop import COLUMNS, USER, Workshop, workshop

ROBOTS = ("irb6660-205-1.90", "irb6700-200-2.60")
CORRECT = ("correct", "@cell.yaml", "@part.mod", "--stiffness", "@stiffness.json", "--forces", "@forces.csv", "-o", "@out.mod")
ALONG = tuple("@along.csv" if word == "@forces.csv" else word for word in CORRECT)
IDENTIFY = ("identify", "@cell.yaml", "@measurements.csv", "-o", "@found.json")
Change = Callable[[str], str | bytes]


@dataclass(frozen=True)
class Mistake:
    """name: what was done. file, change: the file that is spoilt, and how. words: the call.

    code: of the finding that answers it, "" where several do: an error, or a warning where exit_code is 0 (then a refusal is an
    answer too).
    """

    name: str
    file: str
    change: Change
    words: tuple[str, ...]
    exit_code: int
    code: str


def swap(old: str, new: str) -> Change:
    def change(text: str) -> str:
        assert old in text
        return text.replace(old, new)

    return change


def rewrite(pattern: str, new: str | Callable[[re.Match[str]], str], count: int = 0) -> Change:
    def change(text: str) -> str:
        changed, times = re.subn(pattern, new, text, count=count, flags=re.M)
        assert times
        return changed

    return change


def columns(names: list[str], factor: float | Callable[[np.ndarray], np.ndarray]) -> Change:
    """The named columns of a table times a factor, or through a function of their values (n, k)."""
    def change(text: str) -> str:
        header, *lines = text.splitlines()
        place = [header.split(",").index(name) for name in names]
        table = np.array([[float(cell) for cell in line.split(",")] for line in lines])
        table[:, place] = factor(table[:, place]) if callable(factor) else factor * table[:, place]
        return "\n".join([header, *(",".join(f"{value:.9g}" for value in row) for row in table)]) + "\n"

    return change


def lines(function: Callable[[list[str]], list[str]]) -> Change:
    return lambda text: "\n".join(function(text.splitlines())) + "\n"


def same(text: str) -> str:
    return text


def call(*words: str) -> tuple[str, ...]:
    return (*CORRECT, *words)


def instead(old: str, new: str, words: tuple[str, ...] = CORRECT) -> tuple[str, ...]:
    assert old in words
    return tuple(new if word == old else word for word in words)


FORCES, READINGS, ANGLES = ["fx_n", "fy_n", "fz_n"], ["dx_um", "dy_um", "dz_um"], COLUMNS[:6]
PLACES = ["x_mm", "y_mm", "z_mm"]
M = Mistake
CELL = [
    M("robot's name misspelt", "cell.yaml", rewrite(r"^robot: irb", "robot: IRB-"), CORRECT, 1, "CS0104"),
    M("position as text", "cell.yaml", rewrite(r"position_mm: \[([^\]]*)\]", r"position_mm: '\1'"), CORRECT, 1, "CS0102"),
    M("position of two numbers", "cell.yaml", rewrite(r"position_mm: \[([^,]*),", "position_mm: ["), CORRECT, 1, "CS0102"),
    M("decimal comma in the cell", "cell.yaml", rewrite(r"\[(\d+)\.(\d+),", r"[\1,\2,"), CORRECT, 1, "CS0102"),
    M("tool in metres", "cell.yaml", rewrite(r"position_mm: \[.*?\]", "position_mm: [0.110, -0.020, 0.260]"), IDENTIFY, 1,
      "CS0102"),
    M("Euler angles for a quaternion", "cell.yaml", rewrite(r"quaternion: \[.*?\]", "quaternion: [0, 90, 0]"), CORRECT, 1,
      "CS0102"),
    M("a quaternion that is none", "cell.yaml", rewrite(r"quaternion: \[.*?\]", "quaternion: [1, 1, 0, 0]"), CORRECT, 1,
      "CS0102"),
    M("a key misspelt", "cell.yaml", swap("measurement:", "mesurement:"), CORRECT, 1, "CS0102"),
    M("a key twice", "cell.yaml", lambda text: text + "force_log: {frame: tool}\n", CORRECT, 1, "CS0102"),
    M("the tool forgotten", "cell.yaml", rewrite(r"^tool:.*\n", ""), CORRECT, 1, "CS0102"),
    M("tabs in YAML", "cell.yaml", swap("tool: {", "tool:\n\t{"), CORRECT, 1, "CS0101"),
    M("the cell file in UTF-16", "cell.yaml", lambda text: text.encode("utf-16"), CORRECT, 1, "CS0101"),
    M("an empty cell file", "cell.yaml", lambda text: "", CORRECT, 1, "CS0102"),
    M("an unknown frame of the log", "cell.yaml", swap("frame: base", "frame: wobj"), CORRECT, 1, "CS0102"),
    M("a sensor without its place", "cell.yaml", swap("frame: base", "frame: sensor"), CORRECT, 1, "CS0102"),
    M("a unit behind a number", "cell.yaml", swap("[2, 2, 2]", "[2 um, 2 um, 2 um]"), CORRECT, 1, "CS0102"),
    M("a negative sigma", "cell.yaml", swap("[2, 2, 2]", "[2, -2, 2]"), CORRECT, 1, "CS0102"),
    M("a limit of zero", "cell.yaml", lambda text: text + "limits: {max_offset_mm: 0}\n", CORRECT, 1, "CS0102"),
    M("a path with backslashes", "cell.yaml", rewrite(r"^robot: .*", r"robot: robots\\\\my.yaml"), CORRECT, 1, "CS0104"),
    M("a robot in capitals", "cell.yaml", rewrite(r"^robot: .*", lambda m: m[0].upper().replace("ROBOT:", "robot:")),
      CORRECT, 1, "CS0104"),
    M("the limit in micrometres", "cell.yaml", lambda text: text + "limits: {max_offset_mm: 2000}\n", CORRECT, 1, "CS0102"),
    M("a prior in units of 1e6", "cell.yaml", lambda text: text + "prior: {stiffness_nm_per_rad: [2, 6, 2, 0.5, 0.2, 0.1]}\n",
      IDENTIFY, 1, "CS1081"),
    M("a payload in grams", "cell.yaml", swap("frame: base", "frame: tool, payload: {mass_kg: 12400}"), CORRECT, 1, "CS3032"),
    M("another robot in the cell", "cell.yaml", rewrite("^robot: .*", "robot: irb4400-60"), CORRECT, 1, "CS1202"),
]
TABLE = [
    M("a column missing", "measurements.csv", swap("fz_n", "fz"), IDENTIFY, 1, "CS0202"),
    M("a column twice", "measurements.csv", swap("fz_n", "fy_n"), IDENTIFY, 1, "CS0202"),
    M("no header", "measurements.csv", lines(lambda rows: rows[1:]), IDENTIFY, 1, "CS0202"),
    M("a header in the middle", "measurements.csv", lines(lambda rows: [*rows, rows[0]]), IDENTIFY, 1, "CS0203"),
    M("a header alone", "measurements.csv", lines(lambda rows: rows[:1]), IDENTIFY, 1, "CS1005"),
    M("an empty table", "measurements.csv", lambda text: "", IDENTIFY, 1, "CS0201"),
    M("text in a cell", "measurements.csv", rewrite(r"250\.0000", "250 N", 1), IDENTIFY, 1, "CS0203"),
    M("an empty cell", "measurements.csv", rewrite(r"250\.0000", "", 1), IDENTIFY, 1, "CS0203"),
    M("a cell too few", "measurements.csv", rewrite(r",[^,\n]*$", "", 3), IDENTIFY, 1, "CS0201"),
    M("a workbook", "measurements.csv", lambda text: b"PK\x03\x04" + text.encode(), IDENTIFY, 1, "CS0201"),
    M("Latin-1", "measurements.csv", lambda text: ("# µm\n" + text).encode("latin-1"), IDENTIFY, 1, "CS0201"),
    M("angles in radians", "measurements.csv", columns(ANGLES, np.pi / 180), IDENTIFY, 0, ""),
    M("angles outside the limits", "measurements.csv", columns(["q2_deg"], lambda q: q + 180), IDENTIFY, 1, "CS1002"),
    M("deflections in millimetres", "measurements.csv", columns(READINGS, 1e-3), IDENTIFY, 1, ""),
    M("deflections in metres", "measurements.csv", columns(READINGS, 1e-6), IDENTIFY, 0, ""),
    M("forces in kilonewtons", "measurements.csv", columns(FORCES, 1e-3), IDENTIFY, 1, ""),
    M("forces in kgf", "measurements.csv", columns(FORCES, 1 / 9.80665), IDENTIFY, 1, "CS1018"),
    M("forces in lbf", "measurements.csv", columns(FORCES, 1 / 4.44822), IDENTIFY, 0, "CS1702"),
    M("deflections with the wrong sign", "measurements.csv", columns(READINGS, -1), IDENTIFY, 1, "CS1010"),
    M("x and y of the forces swapped", "measurements.csv", columns(["fx_n", "fy_n"], lambda f: f[:, ::-1]), IDENTIFY, 0, ""),
    M("the sign of z wrong", "measurements.csv", columns(["dz_um"], -1), IDENTIFY, 1, "CS1700"),
    M("one reading ten times", "measurements.csv", columns(READINGS, lambda d: d * np.where(np.arange(len(d)) == 7, 10,
      1)[:, None]),
      IDENTIFY, 0, "CS1013"),
    M("every row twice", "measurements.csv", lines(lambda rows: [*rows, *rows[1:]]), IDENTIFY, 0, "CS0012"),
    M("a header in capitals", "measurements.csv", lines(lambda rows: [rows[0].upper(), *rows[1:]]), IDENTIFY, 1, "CS0202"),
    M("a unit in brackets", "measurements.csv", swap("q1_deg", "q1 [deg]"), IDENTIFY, 1, "CS0202"),
    M("German thousands", "measurements.csv", lambda text: text.replace(",", ";").replace(".", ",").replace(
      "250,0000", "1.250,0000"), IDENTIFY, 1, "CS0203"),
    M("a line at the end", "measurements.csv", lambda text: text + "End of measurement\n", IDENTIFY, 1, "CS0201"),
    M("a dash for a reading", "measurements.csv", lines(lambda rows: [*rows[:3], rows[3].rsplit(",", 1)[0] + ",-", *rows[4:]]),
      IDENTIFY, 1, "CS0203"),
    M("times to the minute", "measurements.csv",
      lines(lambda rows: [rows[0] + ",time_s", *(row + ",10:21" for row in rows[1:])]), IDENTIFY, 1, "CS0203"),
    M("a plan that was not filled in", "measurements.csv", lines(lambda rows: [rows[0], *(row.rsplit(",", 3)[0] + ",,,"
      for row in rows[1:])]), IDENTIFY, 1, "CS1004"),
    M("a sensor unplugged", "measurements.csv", columns(["dz_um"], 0), IDENTIFY, 0, "CS1021"),
    M("a sensor that is stuck", "measurements.csv", columns(["dx_um"], lambda d: 0 * d + 37.2), IDENTIFY, 0, "CS1021"),
    M("no row with a load", "measurements.csv", columns(FORCES, 0), IDENTIFY, 1, "CS1005"),
    M("the tool's length wrong", "cell.yaml", rewrite(r"260\.0*", "360.0"), IDENTIFY, 0, "CS1013"),
    M("a misspelt purpose", "measurements.csv", lines(lambda rows: [rows[0] + ",purpose",
      *(row + ",validat" for row in rows[1:])]),
      IDENTIFY, 1, "CS1001"),
]
PROGRAM = [
    M("no ENDMODULE", "part.mod", swap("ENDMODULE", ""), CORRECT, 1, "CS2050"),
    M("no ENDPROC", "part.mod", swap("ENDPROC", ""), CORRECT, 1, "CS2050"),
    M("two modules", "part.mod", lambda text: text + "MODULE Other\nENDMODULE\n", CORRECT, 0, "CS2051"),
    M("a program in UTF-16", "part.mod", lambda text: text.encode("utf-16"), CORRECT, 1, "CS2001"),
    M("an empty program", "part.mod", lambda text: "", CORRECT, 1, "CS4202"),
    M("a semicolon forgotten", "part.mod", rewrite(r"wPart;\n", "wPart\n", 1), CORRECT, 1, "CS2003"),
    M("the end cut off", "part.mod", lambda text: text[:-60], CORRECT, 1, "CS2002"),
    M("a quaternion cut short", "part.mod", rewrite(r"(MoveL .*?\],\[)-?\d\.\d+", r"\g<1>0.9"), CORRECT, 1, "CS4103"),
    M("targets in metres", "part.mod", rewrite(r"(MoveL \[\[)([^\]]*)\]", lambda m: m[1] + ",".join(
        f"{float(x) / 1e3:.6f}" for x in m[2].split(",")) + "]"), CORRECT, 3, "CS4105"),
    M("a work object declared nowhere", "part.mod", swap("\\WObj:=wPart", "\\WObj:=wOther"), CORRECT, 3, "CS4104"),
    M("no work object at the moves", "part.mod", swap("\\WObj:=wPart", ""), CORRECT, 0, "CS2052"),
    M("a stationary tool", "part.mod", swap("tMill:=[TRUE", "tMill:=[FALSE"), CORRECT, 3, "CS4104"),
    M("all cuts displaced", "part.mod", swap("PROC main()", "PROC main()\nPDispOn p1,tMill;"), CORRECT, 3, "CS3086"),
    M("an external axis", "part.mod", swap("[9E9,9E9,", "[100,9E9,"), CORRECT, 3, "CS4104"),
    M("moves of other kinds", "part.mod", swap("MoveL", "MoveLAO"), CORRECT, 1, "CS4202"),
    M("the suffix of a text", "part.txt", lambda text: "MODULE a\nENDMODULE\n", instead("@part.mod", "@part.txt"), 1, "CS4201"),
    M("tooldata in metres", "part.mod", rewrite(r"tMill:=\[TRUE,\[\[([^\]]*)\]", lambda m: "tMill:=[TRUE,[[" + ",".join(
        f"{float(x) / 1e3:.6f}" for x in m[1].split(",")) + "]"), CORRECT, 0, "CS2055"),
    M("a decimal comma in a target", "part.mod", rewrite(r"(MoveL \[\[)(-?\d+)\.", r"\1\2,"), CORRECT, 1, "CS2004"),
    M("another program", "part.mod", lines(lambda rows: [row for i, row in enumerate(rows) if i not in (4, 5, 6)]),
      CORRECT, 1, "CS3004"),
]
LOG = [
    M("all forces zero", "forces.csv", columns(FORCES, 0), CORRECT, 3, "CS3086"),
    M("forces of a program in kilonewtons", "forces.csv", columns(FORCES, 1e-3), CORRECT, 0, "CS4125"),
    M("forces in grams", "forces.csv", columns(FORCES, 102), CORRECT, 3, "CS4107"),
    M("targets counted from one", "forces.csv", columns(["target"], lambda n: n + 1), CORRECT, 1, "CS3004"),
    M("the target is no whole number", "forces.csv", columns(["target"], 1.001), CORRECT, 1, "CS3004"),
    M("no column that places", "forces.csv", swap("target,", "number,"), CORRECT, 1, "CS3001"),
    M("a force missing", "forces.csv", swap("fz_n", "fz"), CORRECT, 1, "CS0202"),
    M("not a number", "forces.csv", rewrite(r",(-?\d+\.\d+)$", ",nan", 1), CORRECT, 1, "CS0203"),
    M("an empty log", "forces.csv", lambda text: "", CORRECT, 1, "CS0201"),
    M("a log with a header alone", "forces.csv", lines(lambda rows: rows[:1]), CORRECT, 1, "CS3002"),
    M("a log in UTF-16 without mark", "forces.csv", lambda text: text.encode("utf-16-le"), CORRECT, 1, "CS0202"),
    M("a workbook as log", "forces.csv", lambda text: b"PK\x03\x04", CORRECT, 1, "CS0201"),
    M("places in metres", "along.csv", columns(PLACES, 1e-3), ALONG, 1, "CS3005"),
    M("places in another work object", "along.csv", columns(PLACES, lambda p: p + np.array([300, 0, 0])), ALONG, 1, "CS3005"),
    M("places with x and y swapped", "along.csv", columns(["x_mm", "y_mm"], lambda p: p[:, ::-1]), ALONG, 1, "CS3005"),
    M("half of the log lost", "forces.csv", lines(lambda rows: rows[:30]), CORRECT, 0, "CS3012"),
    M("two passes in one log", "forces.csv", lines(lambda rows: [*rows, *rows[1:]]), CORRECT, 1, "CS3119"),
    M("two passes along the path", "along.csv", lines(lambda rows: [*rows, *rows[1:]]), ALONG, 0, "CS3007"),
    M("the logger's tool longer by 4 mm", "along.csv", columns(PLACES, lambda p: p + np.array([0, 0, 4])), ALONG, 0, "CS3120"),
    M("the log of another version, 0.6 mm higher", "along.csv", columns(PLACES, lambda p: p + np.array([0, 0, 0.6])), ALONG, 0,
      "CS3120"),
    M("a log that runs backwards", "along.csv", lines(lambda rows: [rows[0], *rows[:0:-1]]), ALONG, 3, "CS3086"),
    M("a line at the end of the log", "forces.csv", lambda text: text + "End\n", CORRECT, 1, "CS0201"),
    M("a bias that nobody took off", "forces.csv", columns(FORCES, lambda f: f + np.array([300, -150, 80])), CORRECT, 0,
      "CS3087"),
    M("the tare inside the cut", "forces.csv", same, call("--tare", "4:6"), 1, "CS3039"),
    M("the tare half in the cut", "forces.csv", same, call("--tare", "0:3"), 1, "CS3039"),
    M("another log that is turned over", "second.csv", lambda text: "target,fx_n,fy_n,fz_n\n" + "".join(
        f"{k},{-80 - 4 * k},{120 + 3 * k},150\n" for k in range(2, 10)), call("--other-forces", "@second.csv"), 3, "CS3110"),
    M("the tare behind the program", "forces.csv", same, call("--tare", "90:95"), 1, "CS3006"),
]
CALL = [
    M("cell and program swapped", "part.mod", same, ("correct", "@part.mod", "@cell.yaml", *CORRECT[3:]), 1, "CS0102"),
    M("cell and measurements swapped", "part.mod", same, ("identify", "@measurements.csv", "@cell.yaml", "-o",
      "@found.json"), 1, "CS0102"),
    M("program and log swapped", "part.mod", same, ("correct", "@cell.yaml", "@forces.csv", "--stiffness", "@stiffness.json",
                                                    "--forces", "@part.mod", "-o", "@out.mod"), 1, "CS0202"),
    M("the cell for the stiffness", "part.mod", same, instead("@stiffness.json", "@cell.yaml"), 1, "CS1201"),
    M("the stiffness of another robot", "stiffness.json", rewrite(r'"robot": "[^"]*"', '"robot": "irb4400-60"'), CORRECT,
      1, "CS1202"),
    M("the measurements for the log", "part.mod", same, instead("@forces.csv", "@measurements.csv"), 1, "CS3005"),
    M("the log for the measurements", "part.mod", same, ("identify", "@cell.yaml", "@forces.csv", "-o", "@found.json"), 1,
      "CS0202"),
    M("the scale in per cent", "part.mod", same, call("--scale", "110"), 2, "CS0002"),
    M("the tolerance in millimetres", "part.mod", same, call("--tolerance", "0.005"), 2, "CS0002"),
    M("the cutting stiffness in N/m", "part.mod", same, call("--cutting-stiffness", "10000"), 1, "CS4123"),
    M("the program over itself", "part.mod", same, (*instead("@out.mod", "@part.mod"), "--force"), 1, "CS0006"),
    M("report over the program", "part.mod", same, (*call("--report", "@out.mod"), "--force"), 1, "CS0006"),
    M("report over the stiffness", "part.mod", same, (*IDENTIFY, "--report", "@found.json", "--force"), 1, "CS0006"),
    M("an output that exists", "out.mod", lambda text: "mine", CORRECT, 1, "CS0003"),
    M("a folder that does not exist", "part.mod", same, instead("@out.mod", "@none/out.mod"), 1, "CS0004"),
    M("a file that does not exist", "part.mod", same, instead("@forces.csv", "@forces.txt"), 2, "CS0002"),
    M("an option misspelt", "part.mod", same, call("--tares", "0:1"), 2, "CS0002"),
    M("a tare that is no range", "part.mod", same, call("--tare", "0-1"), 2, "CS0002"),
    M("no stiffness", "part.mod", same, tuple(word for word in CORRECT if "stiffness" not in word), 2, "CS0002"),
    M("a split without its size", "part.mod", same, call("--split-load"), 1, "CS4310"),
    M("a place to design at in metres", "part.mod", same, ("design", "@cell.yaml", "-o", "@plan.csv", "--quick",
      "--position", "1.1",
                                                        "0", "0.9"), 1, "CS1601"),
    M("watched into the watched folder", "part.mod", same, ("watch", "@.", "@out", "--cell", "@cell.yaml", "--stiffness",
                                                         "@stiffness.json", "--once"), 1, "CS6006"),
]
# A slot posted from a table, beside the sound program; readings of three places.
PLACED = "workobject: " + kit.yaml_frame(USER) + "\n"
READ = "target,dx_um,dy_um,dz_um\n" + "".join(f"{k},{100 + k},{-40 - k},{7 + k}\n" for k in range(12))


def slot(robot: str, feed: float, air: float) -> str:
    """A toolpath table beside the sound program of a robot: an approach, 20 mm of cut, a retract."""
    first = kit.targets_of(workshop(robot).files["part.mod"])[3]
    place, turn = 1e3 * first.p, ",".join(f"{value:.8f}" for value in kit.quaternion(first.r))
    steps = [(0, 0, 30, air, 1), (0, 0, 0, air, 1), (10, 0, 0, feed, 0), (20, 0, 0, feed, 0), (20, 0, 30, air, 1)]
    return "x_mm,y_mm,z_mm,q1,q2,q3,q4,feed_mm_s,rapid\n" + "".join(
        f"{place[0] + x:.4f},{place[1] + y:.4f},{place[2] + z:.4f},{turn},{speed},{rapid}\n" for x, y, z, speed, rapid in steps)


MISTAKES = [*CELL, *TABLE, *PROGRAM, *LOG, *CALL]


@pytest.mark.parametrize("robot", ROBOTS)
@pytest.mark.parametrize("words", [CORRECT, ALONG, IDENTIFY])
def test_the_sound_job_is_done_without_a_word(tmp_path: Path, robot: str, words: tuple[str, ...]) -> None:
    result = workshop(robot).run(tmp_path, {}, *words)
    assert result.code == 0, result
    assert {finding["level"] for finding in result.json["findings"]} <= {"note"}


@pytest.mark.parametrize("robot", ROBOTS)
@pytest.mark.parametrize(("feed", "air", "odd"), [(20, 200, False), (1200, 12000, True), (0.02, 0.2, True)])
def test_a_feed_in_another_unit_is_said(tmp_path: Path, robot: str, feed: float, air: float, odd: bool) -> None:
    shop = workshop(robot)
    files = {"part.csv": slot(robot, feed, air), "cell.yaml": shop.files["cell.yaml"] + PLACED}
    result = shop.run(tmp_path, files, "post", "@cell.yaml", "@part.csv", "-o", "@posted.mod")
    assert result.code == 0, result
    assert ("CS4307" in kit.codes(result)) is odd


def test_one_file_of_readings_given_twice_is_said(tmp_path: Path) -> None:
    shop = workshop(ROBOTS[0])
    after = READ.replace("100", "12").replace(",10", ",1")
    for words, same_file in ((("@before.csv", "@after.csv"), False), (("@before.csv", "@before.csv"), True)):
        result = shop.run(tmp_path, {"before.csv": READ, "after.csv": after}, "verify", "@cell.yaml", *words)
        assert result.code == 0, result
        assert ("CS6034" in kit.codes(result)) is same_file


# Long: the same mistake on the other robot.
@pytest.mark.parametrize(("mistake", "robot"), [
    pytest.param(mistake, robot, id=f"{mistake.name}-{robot}", marks=[pytest.mark.long] * (robot != ROBOTS[number % 2]))
    for number, mistake in enumerate(MISTAKES) for robot in ROBOTS])
def test_no_mistake_is_silent(tmp_path: Path, mistake: Mistake, robot: str) -> None:
    shop: Workshop = workshop(robot)
    result = shop.run(tmp_path, {mistake.file: mistake.change(shop.files.get(mistake.file, ""))}, *mistake.words)
    findings = [finding for finding in result.json["findings"] if finding["level"] != "note"]
    assert findings, "silent"
    assert mistake.code in ("", *(finding["code"] for finding in findings)), result
    assert result.code == mistake.exit_code or (mistake.exit_code == 0 and result.code in (1, 3)), result
    if result.code:
        assert findings[0]["level"] == "error"
        assert sum(finding["level"] == "error" for finding in findings) <= 20
        out = tmp_path / "out.mod"
        assert not out.exists() or out.read_text() == "mine"
    assert kit.run("explain", findings[0]["code"]).code == 0


def typed(text: str) -> str:
    """A table with decimal commas and commas between its cells."""
    header, *rows = text.splitlines()
    return "\n".join([header, *(row.replace(".", ",") for row in rows)]) + "\n"


# What is spoilt, the call, what the answer must say beside its code, and on which line where there is one.
SAID: tuple[tuple[str, str, Change, tuple[str, ...], str, str, int | None], ...] = (
    ("unit left out of a name", "measurements.csv", swap("dx_um", "dx"), IDENTIFY, "CS0202", "is 'dx' meant to be dx_um?", 1),
    ("the same, checked", "measurements.csv", swap("dx_um", "dx"), ("check", "@cell.yaml", "@measurements.csv"), "CS0202",
     "is 'dx' meant to be dx_um?", 1),
    ("decimal commas", "measurements.csv", typed, IDENTIFY, "CS0201", "decimal commas? then cells need ';'", 2),
    ("a letter of another encoding", "measurements.csv", lambda text: b"# by J\xfcrgen\n" + text.encode(), IDENTIFY, "CS0201",
     "UTF-8", 1),
    ("a row above the header", "measurements.csv", lambda text: "hall 3" + "," * (len(COLUMNS) - 1) + "\n" + text, IDENTIFY,
     "CS0202", "the first row that does not begin with # must name the columns", 1),
    ("a tab in the cell", "cell.yaml", swap("tool: {", "tool:\n\t{"), IDENTIFY, "CS0101", "no tabs", None),
    ("positions in metres", "along.csv", columns(["x_mm", "y_mm", "z_mm"], 1e-3), ALONG, "CS3005", "in metres", None),
    ("positions in inches", "along.csv", columns(["x_mm", "y_mm", "z_mm"], 1 / 25.4), ALONG, "CS3005", "in inches", None),
    ("a key at the wrong depth", "cell.yaml", lambda text: text + "sign: by_tool\n", IDENTIFY, "CS0102",
     "it stands below force_log", 5),
    ("a key of another program", "cell.yaml", lambda text: text + "xyzzy: 1\n", IDENTIFY, "CS0102", "known keys are robot", 5),
    ("the stiffness for the log", "stiffness.json", same, instead("@forces.csv", "@stiffness.json"), "CS0201", "a JSON file",
     None),
    ("positions in the world", "along.csv", columns(PLACES, lambda p: p + 1e3 * USER.p), ALONG, "CS3005",
     "they do as positions in the world", None),
    ("targets counted from 1", "forces.csv", columns(["target"], lambda t: t + 1), CORRECT, "CS3004", "targets count from 0",
     57),
    ("commas between thousands", "forces.csv", rewrite(r"^5,[^,]*", '5,"1,080.5"'), CORRECT, "CS0203", "without commas", 27),
    ("a unit in the cell", "forces.csv", rewrite(r"^(5,[^,]*)", r"\1 N", 1), CORRECT, "CS0203", "write the number alone", 27),
    ("times of a clock", "forces.csv", lines(lambda rows: [f"{'time_s' if k == 0 else f'10:00:{k:02}'},{row}"
     for k, row in enumerate(rows)][:2]), CORRECT, "CS0203", "write times as seconds", 2),
    ("a first column of another name, checked", "measurements.csv", swap("q1_deg", "A1"),
     ("check", "@cell.yaml", "@measurements.csv"), "CS0202", "found A1", 1),
    ("positions of elsewhere", "along.csv", columns(["x_mm"], lambda x: x + 500), ALONG, "CS3005", "log of this program", None),
)


@pytest.mark.parametrize(("file", "change", "words", "code", "said", "line"), [one[1:] for one in SAID],
                         ids=[one[0] for one in SAID])
def test_the_answer_says_what_to_do(
    tmp_path: Path, file: str, change: Change, words: tuple[str, ...], code: str, said: str, line: int | None
) -> None:
    job = workshop(ROBOTS[1])
    result = job.run(tmp_path, {file: change(job.files[file])}, *words)
    assert result.code == 1, result
    found, = [finding for finding in result.json["findings"] if finding["code"] == code]
    assert said in f"{found['message']} {found['hint']}", found
    assert Path(found["file"]).name == file
    assert line is None or found["line"] == line


def test_rows_with_a_load_that_did_not_move_are_said(tmp_path: Path) -> None:
    """Half of a table, typed as 0 in place of left empty; two such rows may be."""
    job = workshop(ROBOTS[1])

    def still(count: int) -> Change:
        return columns(READINGS, lambda rows: np.where(np.arange(len(rows))[:, None] < len(rows) - count, rows, 0))

    for count, said in ((30, {"CS1025"}), (2, set())):
        sheet = still(count)(job.files["measurements.csv"])
        found = job.run(tmp_path, {"measurements.csv": sheet}, "check", "@cell.yaml", "@measurements.csv").json["findings"]
        assert {finding["code"] for finding in found} == said
        assert not found or (found[0]["line"], "30 of 60 rows" in found[0]["message"]) == (32, True)


def test_a_column_of_loads_that_is_lost_is_said(tmp_path: Path) -> None:
    """A third of the rows then move without any load; zeros that drift by a few micrometres are none."""
    job, zeros = workshop(ROBOTS[1]), np.array([3.0, -4.0, 2.0])
    lost = columns(["fz_n"], 0)(job.files["measurements.csv"])
    header, *rows = job.files["measurements.csv"].splitlines()
    unloaded = [",".join([*row.split(",")[:6], "0,0,0", *(f"{value:g}" for value in zeros)]) for row in rows[::6]]
    for sheet, said in ((lost, {"CS0115"}), ("\n".join([header, *rows, *unloaded]) + "\n", set())):
        found = job.run(tmp_path, {"measurements.csv": sheet}, "check", "@cell.yaml", "@measurements.csv").json["findings"]
        assert {finding["code"] for finding in found} == said
        assert not found or "moves in rows without a load" in found[0]["message"]


@pytest.mark.parametrize(("rpm", "level"), [("9", "warning"), ("9000", "note")])
def test_a_spindle_in_thousands_of_revolutions_is_said(tmp_path: Path, rpm: str, level: str) -> None:
    """Its mean over seconds blurs the force along the path."""
    job = workshop(ROBOTS[1])
    timed = lines(lambda rows: [f"{'time_s' if not k else f'{1e-3 * k:.3f}'},{row}" for k, row in enumerate(rows)])
    said = job.run(tmp_path, {"forces.csv": timed(job.files["forces.csv"])}, *call("--spindle-rpm", rpm)).json["findings"]
    assert [finding["level"] for finding in said if finding["code"] == "CS3027"] == [level]


def test_a_factor_in_per_cent_is_no_factor(tmp_path: Path) -> None:
    result = workshop(ROBOTS[1]).run(tmp_path, {}, *call("--scale", "110"))
    assert result.code == 2
    assert "it is a factor" in result.out


def test_another_tool_in_the_cell_is_said_by_check_as_by_correct(tmp_path: Path) -> None:
    job = workshop(ROBOTS[1])
    longer = {"cell.yaml": job.files["cell.yaml"].replace("260.0000", "240.0000")}
    for words in (("check", "@cell.yaml", "@part.mod"), CORRECT):
        found = [each for each in job.run(tmp_path, longer, *words).json["findings"] if each["code"] == "CS2055"]
        assert len(found) == 1
        assert "20.0 mm" in found[0]["message"]


def test_what_was_noticed_before_an_error_is_told_beside_it(tmp_path: Path) -> None:
    """A cutting stiffness that nothing fits, in a program whose tool is none of this cell: the second may be the reason."""
    job = workshop(ROBOTS[1])
    aside = {"cell.yaml": job.files["cell.yaml"].replace("-20.0000", "20.0000")}
    assert aside["cell.yaml"] != job.files["cell.yaml"]
    result = job.run(tmp_path, aside, *call("--cutting-stiffness", "10000"))
    codes = [finding["code"] for finding in result.json["findings"]]
    assert result.code == 1
    assert codes[0] == "CS4123"
    assert codes.count("CS2055") == 1


@pytest.mark.parametrize("written", [True, False])
def test_the_call_in_the_report_names_the_offsets_that_were_written(tmp_path: Path, written: bool) -> None:
    offsets = ("--offsets", "@mine.csv") if written else ()
    assert workshop(ROBOTS[1]).run(tmp_path, {}, *call("--report", "@out.html"), *offsets).code == 0
    page = re.sub("<[^>]+>", "", (tmp_path / "out.html").read_text(encoding="utf-8"))
    assert (f"--predicted {tmp_path / 'mine.csv'}" in page) == written
    assert ("what --offsets writes" in page) == (not written)


def test_names_that_are_nearly_right(tmp_path: Path) -> None:
    """A robot written as on its plate, and a command a letter short."""
    job = workshop(ROBOTS[1])
    plate = job.run(tmp_path, {"cell.yaml": job.files["cell.yaml"].replace("irb6700-200-2.60", "IRB 6700-200")}, *IDENTIFY)
    assert "irb6700-200-2.60" in next(one["hint"] for one in plate.json["findings"] if one["code"] == "CS0104")
    short = kit.run("identifi")
    assert short.code == 2
    assert "Did you mean identify?" in short.err


@pytest.mark.parametrize("robot", ROBOTS)
def test_a_bias_at_both_ends_of_a_program_with_one_feed_is_said(tmp_path: Path, robot: str) -> None:
    """No move is told from a cut by its feed; the first and the last one are in the air all the same. With a tare it is gone;
    of the sound job it is a note, its noise being what the scatter of five samples lets through."""
    job = workshop(robot)
    biased = columns(["fx_n"], lambda force: force + 30.0)(job.files["forces.csv"])
    for forces, words, level in ((biased, CORRECT, {"warning"}), (biased, (*CORRECT, "--force", "--tare", "0:1"), set()),
                                 (job.files["forces.csv"], (*CORRECT, "--force"), {"note"})):
        result = job.run(tmp_path, {"forces.csv": forces}, *words)
        assert result.code == 0, result
        assert {finding["level"] for finding in result.json["findings"] if finding["code"] == "CS3041"} == level


@pytest.mark.parametrize(("weights", "tool", "over"), [("120", "", False), ("250", "", True), ("20,190+20", "", True),
                                                        ("120", ", mass_kg: 85.5", True), ("120", ", mass_kg: 85", False)])
def test_weights_over_the_payload_are_not_planned(tmp_path: Path, weights: str, tool: str, over: bool) -> None:
    """An IRB 6660-205 carries 205 kg."""
    (tmp_path / "cell.yaml").write_text(f"robot: {ROBOTS[0]}\ntool: {{position_mm: [120, 0, 250]{tool}}}\n")
    run = kit.run("design", tmp_path / "cell.yaml", "-o", tmp_path / "plan.csv", "--quick", "--measurements", "2",
                  "--dead-weight", weights)
    heaviest = weights.split(",")[-1].replace("190+20", "210")
    of_tool = f" of {tool.removeprefix(', mass_kg: ')} kg" if tool else ""
    sentence = f"error CS1512: {heaviest} kg hung on the tool{of_tool} are over the 205 kg that {ROBOTS[0]} carries"
    assert (sentence in run.err) is over, run
    assert ("CS1512" in run.err) is over, run
    assert run.code == (1 if over else 0)


@pytest.mark.parametrize("robot", ROBOTS)
@pytest.mark.parametrize("command", ["check", "correct"])
def test_frames_in_metres_are_said(tmp_path: Path, robot: str, command: str) -> None:
    """The robot's base, and a work object that the program declares: a thousandth of where they are."""
    shop = workshop(robot)
    words = ("check", "@cell.yaml", "@part.mod") if command == "check" else call("--force")
    base = swap("measurement:", "base_frame: {position_mm: [0.5, -0.2, 0.1]}\nmeasurement:")
    user = rewrite(r"(wPart:=.*?\[\[)([^\]]*)\]", lambda m: m[1] + ",".join(
        f"{float(x) / 1e3:.6f}" for x in m[2].split(",")) + "]")
    for file, change in (("cell.yaml", base), ("part.mod", user)):
        said = shop.run(tmp_path, {file: change(shop.files[file])}, *words)
        told = [one for one in said.json["findings"] if one["code"] == "CS0118"]
        assert [Path(one["file"]).name for one in told] == [file], said
    sound = shop.run(tmp_path, {}, *words)
    assert "CS0118" not in kit.codes(sound)


def test_a_share_in_per_cent_and_a_depth_in_micrometres_are_said(tmp_path: Path) -> None:
    shop = workshop(ROBOTS[0])
    cell = shop.files["cell.yaml"].replace("[2, 2, 2]", "[2, 2, 2], force_relative_std: 0.5")
    assert cell != shop.files["cell.yaml"]
    said = shop.run(tmp_path, {"cell.yaml": cell}, *IDENTIFY)
    assert (said.code, kit.codes(said)) == (1, {"CS0102"})
    deep = shop.run(tmp_path, {}, *call("--depth-of-cut", "1000"))
    assert deep.code == 2
    assert "in which unit" in str(deep.json["findings"])


def test_a_watched_program_s_warnings_are_shown(tmp_path: Path) -> None:
    """A log that shows a force in the air: `correct` says so, and `watch` beside the line of its program."""
    shop = workshop(ROBOTS[0])
    biased = columns(FORCES, lambda f: f + np.array([300, -150, 80]))(shop.files["forces.csv"])
    for name in ("cell.yaml", "stiffness.json"):
        (tmp_path / name).write_text(shop.files[name])
    (tmp_path / "in").mkdir()
    (tmp_path / "in" / "part.mod").write_text(shop.files["part.mod"])
    (tmp_path / "in" / "part.forces.csv").write_text(biased)
    words = ("watch", tmp_path / "in", tmp_path / "out", "--cell", tmp_path / "cell.yaml", "--stiffness",
             tmp_path / "stiffness.json", "--once", "--settle", "0")
    assert "warning CS3087" in kit.run(*words).err
    assert "CS3087" not in kit.run(*words, "-q", "--force").err


def test_a_part_is_not_learned_from_by_the_corrected_program(tmp_path: Path) -> None:
    shop = workshop(ROBOTS[0])
    assert shop.run(tmp_path, {}, *CORRECT, "--tare", "0:1").code == 0
    (tmp_path / "points.csv").write_text("x_mm,y_mm,z_mm,dx_um\n1,2,3,4\n")
    run = kit.run("learn", tmp_path / "cell.yaml", tmp_path / "out.mod", tmp_path / "points.csv", "--stiffness",
                  tmp_path / "stiffness.json", "--forces", tmp_path / "forces.csv", "-o", tmp_path / "learned.json")
    assert run.code == 3
    assert "CS4204" in run.err
    assert "--logged-with" in run.err

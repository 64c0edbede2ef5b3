"""External axes as public programs have them: what is corrected, what is refused, and what is said of it."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from tests.runs.command_line import user_files as kit
from tests.runs.command_line.test_placement import line
from tests.runs.command_line.test_refusals import refused
from tests.runs.command_line.user_files import Job
from tests.runs.milling.carried_job import SLIDE, SLIDE_ZERO, CarriedJob, slide_yaml, table_yaml
from tests.runs.milling.line_job import LINES

T = line(3, 10).text
FORCE = "target,fx_n,fy_n,fz_n\n1,60,90,-120\n"
TWO = "target,fx_n,fy_n,fz_n\n1,60,90,-120\n2,60,90,-120\n"
PART = "mechanical_units:\n  - {name: STN1, carries: workobject, axes: [{eax: a}]}\n"
IDLE = PART.replace("workobject", "nothing")
TRACK = "mechanical_units:\n" + slide_yaml()
NONE = kit.Frame.mm([0, 0, 0], np.array([1.0, 0, 0, 0]))


def at(number: int, value: str, kind: str = "MoveL") -> str:
    return kit.move(T[number].replace(kit.E, f"[{value},9E9,9E9,9E9,9E9,9E9]"), kind)


def program(values: tuple[str, str, str], before: dict[int, str] | None = None, data: list[str] | None = None) -> str:
    moves = []
    for number, value in enumerate(values):
        moves += [(before or {})[number]] if number in (before or {}) else []
        moves.append(at(number, value, "MoveL"))
    return kit.module(moves, data)


def corrected(
    folder: Path, values: tuple[str, str, str], units: str, *, forces: str = FORCE, before: dict[int, str] | None = None
) -> tuple[Job, dict]:
    folder.mkdir(exist_ok=True)
    job = Job(folder, cell=kit.cell_text(extra=units), program=program(values, before), forces=forces)
    done = job.correct("--json")
    assert done.code == 0, done
    return job, {finding["code"]: finding["message"] for finding in done.json["findings"]}


def offsets(job: Job) -> np.ndarray:
    return kit.column(job.offsets(), "ox_mm", "oy_mm", "oz_mm")


@pytest.fixture
def plain(tmp_path: Path) -> np.ndarray:
    """The correction of the program without external axes."""
    return offsets(corrected(tmp_path / "plain", ("9E9",) * 3, "")[0])


REFUSED: dict[str, tuple[tuple[str, str, str], str, str]] = {
    "held, and the cell says nothing": (("100", "100", "100"), "", "does not say what it carries"),
    "a constant 0, and the cell says nothing": (("0", "0", "0"), "", "does not say what it carries"),
    "held, and the cell says there is none": (("100", "100", "100"), "mechanical_units: []\n", "no unit"),
    "driven, no direction": (("100", "100", "120"), PART, "how STN1 moves it"),
    "a track without direction": (("100", "100", "100"), IDLE.replace("nothing", "robot"), "neither its direction"),
    "another axis than the cell's": (("100", "100", "100"), PART.replace("eax: a", "eax: b"), "no unit"),
    "a track at 9E9": (("9E9",) * 3, TRACK, "nothing tells where eax_a stands"),
}


@pytest.mark.parametrize("name", sorted(REFUSED))
def test_refused_where_the_cell_says_too_little(tmp_path: Path, name: str) -> None:
    values, units, says = REFUSED[name]
    document = refused(Job(tmp_path, cell=kit.cell_text(extra=units), program=program(values), forces=TWO), 3, file="part.mod",
                       says=says)
    assert document["findings"][0]["code"] == "CS4104"


def test_a_0_where_the_cell_says_there_is_no_axis(tmp_path: Path, plain: np.ndarray) -> None:
    job, said = corrected(tmp_path / "zero", ("0", "0", "0"), "mechanical_units: []\n")
    assert "controller does not use the value" in said["CS4502"]
    assert job.out.read_text().count("[0,9E9,9E9,9E9,9E9,9E9]") == 3
    np.testing.assert_array_equal(offsets(job), plain)


@pytest.mark.parametrize(("values", "units", "code"), [
    (("100", "100", "100"), PART, "CS4503"), (("20", "100", "9E9"), PART, "CS4503"), (("100", "100", "100"), IDLE, ""),
    (("5", "70", "100"), IDLE, ""),
    (("0", "100", "0"), PART.replace("eax: a", "eax: a, direction: [1, 0, 0]"), "CS4503"),
])
def test_what_does_not_carry_the_robot_changes_nothing(
    tmp_path: Path, plain: np.ndarray, values: tuple[str, str, str], units: str, code: str
) -> None:
    """The work object is fixed: the correction is made in it, whatever the value; only moves with force count."""
    job, said = corrected(tmp_path / "held", values, units)
    assert {other for other in said if other.startswith("CS45")} == ({code} if code else set())
    np.testing.assert_array_equal(offsets(job), plain)
    assert [m[0] for m in re.finditer(r"\[[^,\[]*(,9E9){5}\]", job.out.read_text())] == [
        f"[{value},9E9,9E9,9E9,9E9,9E9]" for value in values]


@pytest.mark.parametrize(("last", "code", "how"), [
    ("120", "CS4504", "drive the external axis eax_a of STN1 (from 100 to 120 mm)"),
    ("100.001", "CS4504", "drive the external axis eax_a of STN1 (from 100 to 100.001 mm)"),
    ("100.00005", "CS4503", "hold the external axis eax_a of STN1 (at 100 mm)")])
def test_a_part_that_moves_under_a_fixed_work_object_is_warned_of(
    tmp_path: Path, plain: np.ndarray, last: str, code: str, how: str
) -> None:
    """By more than a tenth of a micrometre; what a move in the air does does not count."""
    units = PART.replace("eax: a", "eax: a, direction: [1, 0, 0]")
    job, said = corrected(tmp_path / "moved", ("90", "100", last), units, forces=TWO)
    assert said.keys() & {"CS4503", "CS4504"} == {code}
    assert said[code].startswith(f"2 moves with force {how}")
    np.testing.assert_allclose(offsets(job)[1], plain[1], atol=1e-12)


def test_a_part_that_stands_under_its_fixed_work_object_is_not_said_to_move_with_another(tmp_path: Path) -> None:
    """One cut in a fixed work object, at 100 mm; the other, at 120 mm, in one that goes with the unit."""
    going = kit.wobjdata(NONE, kit.USER @ kit.OBJECT, fixed="FALSE", unit="STN1").replace("wPart", "wUnit")
    text = program(("90", "100", "120"), data=[kit.tooldata(), kit.wobjdata(), going])
    lines = text.splitlines(keepends=True)
    last = max(number for number, line in enumerate(lines) if "MoveL" in line)
    lines[last] = lines[last].replace("wPart", "wUnit")
    units = PART.replace("eax: a", "eax: a, direction: [1, 0, 0], zero_mm: 120")
    done = Job(tmp_path, cell=kit.cell_text(extra=units), program="".join(lines), forces=FORCE + "2,0.5,0.1,-0.2\n").predict(
        "--json")
    said = {finding["code"]: finding["message"] for finding in done.json["findings"]}
    assert "CS4504" not in said
    assert said["CS4503"].startswith("1 move with force holds the external axis eax_a of STN1 (at 100 mm)")


def test_a_track_at_its_zero_is_no_track(tmp_path: Path, plain: np.ndarray) -> None:
    units = IDLE.replace("nothing", "robot").replace("eax: a", "eax: a, zero_mm: 100")
    job, _ = corrected(tmp_path / "there", ("100", "100", "100"), units)
    np.testing.assert_array_equal(offsets(job), plain)
    # Where it stands elsewhere, the arm stands otherwise.
    job, _ = corrected(tmp_path / "elsewhere", (f"{SLIDE_ZERO + 80}",) * 3, TRACK)
    assert np.abs(offsets(job) - plain).max() > 1e-3


def test_a_unit_that_is_not_driven_stands_where_it_was_left(tmp_path: Path) -> None:
    away = f"{SLIDE_ZERO + 80}"
    there = offsets(corrected(tmp_path / "there", (away,) * 3, TRACK)[0])
    parked = TRACK.replace(f"zero_mm: {SLIDE_ZERO}", f"zero_mm: {SLIDE_ZERO}, parked_mm: {away}")
    for name, values, units, before in (
            ("left", (away, "9E9", "9E9"), TRACK, {}), ("parked", ("9E9",) * 3, parked, {}),
            ("off", (away, "3000", "3000"), TRACK, {1: "    DeactUnit TRACK_1;"}),
            ("on again", ("10", away, away), TRACK, {0: "    DeactUnit track_1;", 1: "    ActUnit TRACK_1;"})):
        parked_units = units if name != "on again" else parked
        job, said = corrected(tmp_path / name, values, parked_units, before=before)
        np.testing.assert_allclose(offsets(job), there, atol=1e-12)
        assert ("CS4507" in said) == (name in ("left", "parked"))


def test_a_move_by_joints_tells_where_the_track_stands(tmp_path: Path) -> None:
    away = f"{SLIDE_ZERO + 80}"
    there = offsets(corrected(tmp_path / "there", (away,) * 3, TRACK)[0])
    joints = ",".join(f"{value:.5f}" for value in np.degrees(line(3, 10).q[0]))
    home = f"    MoveAbsJ [[{joints}],[{away},9E9,9E9,9E9,9E9,9E9]]\\NoEOffs,v100,fine,tMill;"
    job, _ = corrected(tmp_path / "home", ("9E9",) * 3, TRACK, before={0: home}, forces=FORCE.replace("\n1,", "\n2,"))
    np.testing.assert_allclose(offsets(job)[2], there[1], atol=1e-12)


@pytest.mark.parametrize(("unit", "units", "says"), [
    ("ROB_2", TRACK, "does not describe ROB_2"), ("STN1", "", "does not describe STN1"),
    ("TRACK_1", TRACK, "cell.yaml says that TRACK_1 carries the robot"), ("STN1", IDLE, "carries nothing"),
])
def test_work_objects_on_a_unit_of_which_the_cell_says_nothing(tmp_path: Path, unit: str, units: str, says: str) -> None:
    data = [kit.tooldata(), kit.wobjdata(user=NONE, fixed="FALSE", unit=unit)]
    text = program((f"{SLIDE_ZERO}",) * 3, data=data)
    refused(Job(tmp_path, cell=kit.cell_text(extra=units), program=text, forces=FORCE), 3, file="part.mod", says=says)


@pytest.mark.parametrize(("forces", "which"), [(FORCE, 1), (TWO, 1), (FORCE, 2)], ids=["the only cut", "one of two", "none"])
def test_synchronised_robots_are_refused(tmp_path: Path, forces: str, which: int) -> None:
    """Where they cut; in the air they may."""
    moves = [kit.move(text) for text in T]
    moves[which] = moves[which].replace(",v50", "\\ID:=20,v50")
    job = Job(tmp_path, program=kit.module(moves), forces=forces)
    if which == 2:
        done = job.correct("--json")
        assert (done.code, "CS4505" in kit.codes(done)) == (0, False)
        return
    found = refused(job, 3, file="part.mod", says="MultiMove")["findings"][0]
    assert (found["code"], found["target"], found["count"], found["line"]) == ("CS4505", 1, 1, 6)


def test_an_offset_of_the_axes_leaves_the_move_as_it_is(tmp_path: Path) -> None:
    before = {1: "    EOffsSet [30,0,0,0,0,0];", 2: "    EOffsOff;"}
    job, said = corrected(tmp_path / "offset", (f"{SLIDE_ZERO}",) * 3, TRACK, before=before, forces=TWO)
    assert {"CS4501", "CS4101"} <= set(said)
    moved = np.abs(np.nan_to_num(offsets(job))).max(axis=1) > 0
    np.testing.assert_array_equal(moved, [False, False, True])


def test_a_log_by_joint_angles_does_not_tell_where_a_moving_base_stood(tmp_path: Path) -> None:
    job = CarriedJob(tmp_path, LINES, on="slide")
    done = job.job(job.log("joints", 2.0)).correct("--json")
    assert done.code == 1
    assert "CS4509" in {finding["code"] for finding in done.json["findings"]}
    still = CarriedJob(tmp_path, LINES, on="slide", ends=np.array([[900.0, 0, 0], [900.0, 0, 0]]))
    assert still.job(still.log("joints", 2.0)).correct("--force").code == 0


def test_both_units_are_in_force_together(tmp_path: Path) -> None:
    """One cell file for a slide and a table, a program that drives the slide alone: the table counts for nothing."""
    away = f"{SLIDE_ZERO + 80}"
    one = offsets(corrected(tmp_path / "one", (away,) * 3, TRACK)[0])
    both = offsets(corrected(tmp_path / "both", (away,) * 3, TRACK + table_yaml())[0])
    np.testing.assert_array_equal(one, both)
    assert np.linalg.norm(SLIDE) == pytest.approx(1, abs=1e-9)

"""`verify` as a whole: gains and scales are found in every frame, what the part showed is answered, what is wrong is said."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest

from compensator.verification.report import verify_report
from compensator.verification.verify import Verification
from compensator.verification.verify import verify as verify_files
from identification.model.cell import read_cell
from tests.compensator.verification.measured_passes import SIGMAS, csv, of_code, passes_in, remembering, verify
from tests.support import write_cell


@pytest.fixture
def passes(tmp_path: Path) -> dict[str, Path]:
    return passes_in(tmp_path)


@pytest.mark.parametrize("alone", [True, False])
def test_a_part_that_is_off_as_before_is_said_beside_what_else_is_said(tmp_path: Path, alone: bool) -> None:
    """Measured twice with a micrometre of noise, the second time at a place less; the very same readings are said to be that.
    """
    rng, cell = np.random.default_rng(19), read_cell(write_cell(tmp_path))
    before = rng.normal(0, 40, (40, 3))

    def file(name: str, values: np.ndarray) -> Path:
        count = len(values)
        return csv(tmp_path, name, SIGMAS, np.column_stack([np.arange(count), values, np.ones((count, 3))]))

    first, second = file("before.csv", before), before + rng.normal(0, 1, before.shape)
    again = file("again.csv", second if alone else second[:-1])
    said = [finding.code for finding in verify_files(cell, first, again).findings]
    assert ("CS6022" in said, "CS6048" in said, "CS6034" in said) == (not alone, True, False)
    said = [finding.code for finding in verify_files(cell, first, file("same.csv", before)).findings]
    assert ("CS6034" in said, "CS6048" in said) == (True, False)


@pytest.mark.parametrize("columns", ["target", "x_mm,y_mm,z_mm"])
def test_readings_without_a_predicted_target_are_left_out_of_the_scale_and_counted(tmp_path: Path, columns: str) -> None:
    """Three are aside by 1.05 mm, or have other numbers; what is told of the distance helps."""
    cell, rng = read_cell(write_cell(tmp_path)), np.random.default_rng(24)
    target = np.arange(60)
    of_program = rng.normal(0, 80, (60, 3))
    told = csv(tmp_path, "told.csv", "target,x_mm,y_mm,z_mm,dx_um,dy_um,dz_um",
               np.column_stack([target, 5.0 * target, 0 * target, 0 * target, of_program]))
    aside = np.isin(target, (7, 8, 30))
    where = (target + 1000 * aside)[:, None] if columns == "target" else np.column_stack(
        [5.0 * target, 1.05 * aside, 0 * target])
    read = csv(tmp_path, "read.csv", f"{columns},dx_um,dy_um,dz_um", np.column_stack([where, of_program]))
    result = verify_files(cell, read, read, told)
    (found,) = (one for one in result.findings if one.code == "CS6022")
    assert (found.level, found.file) == ("warning", str(read))
    assert found.message == f"3 readings of 60 without a target in {told}; left out of the scale"
    assert found.hint == ("" if columns == "target" else "the nearest may be 1 mm away: --within-mm sets it")
    assert result.scale is not None
    assert result.scale.points == 57
    if columns != "target":
        wider = verify_files(cell, read, read, told, within=1.1e-3)
        assert wider.scale is not None
        assert ("CS6022" in {one.code for one in wider.findings}, wider.scale.points) == (False, 60)


def test_gain_and_scale_are_found(passes: dict[str, Path], tmp_path: Path) -> None:
    report = tmp_path / "r.html"
    result = verify(passes["cell"], passes["before"], passes["after"], "--predicted", passes["predicted"], "--json", "--report",
                    report)
    assert result.exit_code == 0, result.output
    found = json.loads(result.stdout)["result"]
    assert found["verdict"] == "better"
    assert found["ratio_interval_95"][0] < 1.25 / 0.2 < 1.1 * found["ratio_interval_95"][1]
    scale = found["predicted"]
    assert scale["interval"][0] < 1.25 < scale["interval"][1]
    assert scale["advised_scale"] == pytest.approx(1.25, abs=0.02)
    assert re.fullmatch(r"\d\.\d{1,3}", str(scale["advised_scale"]))
    # What s = 1 leaves of 1.25 p and the noise: (0.25^2 + 0.05^2) / (1.25^2 + 0.05^2).
    assert scale["share"] == pytest.approx(1 - 0.065 / 1.565, abs=0.01)
    assert scale["share_scaled"] > 0.99
    assert set(scale["axes"]) == {"x", "y", "z"}
    page = report.read_text()
    assert re.search(r"correct --scale 1\.2[345]\d*:0\.0", re.sub(r"<[^>]+>", "", page))
    assert "http" not in page.split("<body>")[1].split("<script>")[0]


@pytest.mark.parametrize(("tolerance", "word"), [(1000, "ACCEPTED"), (1, "NOT ACCEPTED")])
def test_either_answer_has_a_step_to_copy_and_names_the_worst_place(
        passes: dict[str, Path], tmp_path: Path, tolerance: float, word: str) -> None:
    """The step that the terminal tells, as a command; and where the part is worst, by the file's own numbers."""
    report = tmp_path / "r.html"
    result = verify(passes["cell"], passes["before"], passes["after"], "--tolerance-um", tolerance, "--report", report)
    assert "add --predicted" in result.output
    page = re.sub(r"<[^>]+>", "", report.read_text().split("<body>")[1])
    assert word in page
    assert re.search(r"compstiff verify \S*cell.yaml \S*before.csv \S*after.csv --predicted", page)
    target, *size = np.loadtxt(passes["after"], delimiter=",", skiprows=1).T
    worst = target[np.argmax(np.linalg.norm(size, axis=0))]
    assert f"at target {worst:.0f}" in page


def page_of(passes: dict[str, Path], before: Path, after: Path, *options: object) -> str:
    report = passes["cell"].with_name("answer.html")
    result = verify(passes["cell"], before, after, "--report", report, *options)
    assert result.exit_code in (0, 3), result.output
    return re.sub(r"<[^>]+>", "", report.read_text().split("<body>")[1]).replace("\xa0", " ")


@pytest.mark.parametrize(("first", "second", "options", "word", "advice"), [
    ("before", "after", (), "BETTER", "No tolerance was stated"),
    ("after", "before", (), "WORSE THAN BEFORE", "Do not use this correction"),
    ("after", "before", ("--tolerance-um", 1000), "WORSE THAN BEFORE", "Do not use this correction"),
    ("before", "again", (), "NO CLEAR DIFFERENCE", "do not show that one is better")])
def test_the_page_answers_what_the_part_showed(
    passes: dict[str, Path], tmp_path: Path, first: str, second: str, options: tuple[object, ...], word: str, advice: str,
) -> None:
    """Also where a part that became worse is within a wide tolerance. Where it did, the next step is the log, not the next
    part."""
    target, *off = np.loadtxt(passes["before"], delimiter=",", skiprows=1).T
    again = np.array(off).T + remembering(np.random.default_rng(3), len(target), 0.7, 20.0)
    passes = {**passes, "again": csv(tmp_path, "again.csv", "target,dx_um,dy_um,dz_um", np.column_stack([target, again]))}
    page = page_of(passes, passes[first], passes[second], *options)
    answers = ["NOT ACCEPTED", "ACCEPTED", "BETTER", "WORSE THAN BEFORE", "NO CLEAR DIFFERENCE"]
    assert [each for each in answers if each in page] == [word]
    assert advice in page
    assert ("--other-forces SECOND.forces.csv" in page, "compstiff learn" in page) == (word[0] == "W", word[0] != "W")


@pytest.mark.parametrize(("header", "place", "said"), [
    ("path_mm", [[12.34 * k] for k in range(40)], "at path length 86.4 mm"),
    ("x_mm,y_mm,z_mm", [[12.34 * k, -0.5 * k, 3] for k in range(40)], "at x y z 86.4, -3.5, 3.0 mm")])
def test_the_worst_place_is_named_as_the_file_has_it(
    passes: dict[str, Path], tmp_path: Path, header: str, place: list[list[float]], said: str
) -> None:
    """The eighth, off by 90 um after."""
    rng = np.random.default_rng(4)
    before, after = 100 * rng.normal(size=(40, 1)), 10 * rng.uniform(-1, 1, (40, 1))
    after[7] = -90
    one, two = (csv(tmp_path, name, f"{header},dz_um", np.hstack([place, off]))
                for name, off in (("b.csv", before), ("a.csv", after)))
    page = page_of(passes, one, two, "--tolerance-um", 50)
    assert f"the worst {said}" in page
    assert ("path length [mm]" in page, "in the order of the first file" in page) == (
        header == "path_mm", header != "path_mm")


@pytest.mark.parametrize(("readings", "file", "said"), [
    ("x_mm,y_mm,z_mm,dx_um\n0,0,0,5\n1,0,0,5\n", "told.csv", "has no x_mm y_mm z_mm"),
    ("target,dn_um\n0,5\n1,5\n", "r.csv", "not the normal"), ("target,dn_um,nx,ny,nz\n0,5,0,0,1\n1,5,0,0,1\n", "", "")])
def test_what_a_prediction_needs_of_the_readings_is_asked_for(
    passes: dict[str, Path], tmp_path: Path, readings: str, file: str, said: str
) -> None:
    """Its targets have no places: readings at targets can be joined, those along a normal where that is known."""
    read, told = tmp_path / "r.csv", tmp_path / "told.csv"
    read.write_text(readings)
    told.write_text("target,dx_um,dy_um,dz_um\n0,1,2,3\n1,2,3,4\n")
    result = verify(passes["cell"], read, read, "--predicted", told, "--json")
    errors = [one for one in json.loads(result.stdout)["findings"] if one["level"] == "error"]
    assert [(one["code"], Path(one["file"]).name) for one in errors] == ([("CS6028", file)] if said else [])
    assert all(said in one["message"] for one in errors)
    assert result.exit_code == (1 if said else 0)


@pytest.mark.parametrize(("count", "said"), [(4, "no interval"), (30, "rather too narrow"), (600, "")])
def test_a_scale_of_too_few_places_is_told(passes: dict[str, Path], tmp_path: Path, count: int, said: str) -> None:
    """What it leaves is alike over dozens of places."""
    rng = np.random.default_rng(5)
    target = np.arange(count)
    told = np.column_stack([80 + 40 * np.sin(target / 3), 60 * np.cos(target / 5), 50 * np.sin(target / 7)])
    off = 1.2 * told + remembering(rng, count, 0.9 if count < 600 else 0.5, 10.0)
    read, file = (csv(tmp_path, name, "target,dx_um,dy_um,dz_um", np.column_stack([target, what]))
                  for name, what in (("r.csv", off), ("told.csv", told)))
    result = verify(passes["cell"], read, passes["after"], "--predicted", file, "--json")
    told_of = [one for one in json.loads(result.stdout)["findings"] if one["code"] == "CS6024" and "scale" in one["message"]]
    assert [(one["level"], one["file"], f"{count} places" in one["message"], said in one["message"]) for one in told_of] == (
        [("warning", str(read), True, True)] if said else [])


@pytest.mark.parametrize(("name", "options"), [("places", ("--frame", "workobject")), ("normal", ())])
def test_the_scale_in_other_frames_and_along_the_normal(passes: dict[str, Path], name: str, options: tuple[str, ...]) -> None:
    result = verify(passes["cell"], passes[name], passes[name], "--predicted", passes["predicted"], *options, "--json")
    assert result.exit_code == 0, result.output
    scale = json.loads(result.stdout)["result"]["predicted"]
    assert scale["interval"][0] < 1.25 < scale["interval"][1]
    assert scale["interval"][1] - scale["interval"][0] < 0.04


@pytest.mark.parametrize("frame", ["base", "workobject"])
def test_places_on_the_surface_are_those_of_the_tool_beside_it(passes: dict[str, Path], tmp_path: Path, frame: str) -> None:
    """The table that `learn` takes: 8 mm beside the path along the normal."""
    target, along, *base = np.loadtxt(passes["normal"], delimiter=",", skiprows=1).T
    normal = np.array(base).T
    in_object = np.column_stack([normal[:, 1], -normal[:, 0], normal[:, 2]])       # a quarter turn about z, as above
    surface = np.column_stack([0.5 * target, 0 * target, 0 * target]) - 8 * in_object
    columns = np.column_stack([surface, along, in_object if frame == "workobject" else normal])
    points = csv(tmp_path, "surface.csv", "x_mm,y_mm,z_mm,dn_um,nx,ny,nz", columns)
    words = (passes["cell"], points, points, "--predicted", passes["predicted"], "--frame", frame, "--json")
    result = verify(*words, "--tool-radius-mm", "8")
    assert result.exit_code == 0, result.output
    low, high = json.loads(result.stdout)["result"]["predicted"]["interval"]
    assert 1.2 < low < 1.25 < high < 1.3


@pytest.mark.parametrize(("name", "radius", "refused"), [
    ("before", 8, True), ("normal", 8, True), ("places", 8, True), ("normal", 0, False)])
def test_a_radius_asks_for_places_and_their_normals(passes: dict[str, Path], name: str, radius: float, refused: bool) -> None:
    """Targets, targets with normals, and places without; the test above has both."""
    result = verify(passes["cell"], passes[name], passes[name], "--predicted", passes["predicted"], "--json",
                    *(["--tool-radius-mm", radius] if radius else []))
    assert result.exit_code == int(refused), result.output
    told = [finding for finding in json.loads(result.stdout)["findings"] if finding["level"] == "error"]
    assert [(finding["code"], finding["file"]) for finding in told] == ([("CS5304", str(passes[name]))] if refused else [])


def test_how_far_the_nearest_target_is_is_said(passes: dict[str, Path], tmp_path: Path) -> None:
    rows = np.loadtxt(passes["places"], delimiter=",", skiprows=1) + np.array([0, 0, 8, 0, 0, 0])
    points = csv(tmp_path, "beside.csv", "x_mm,y_mm,z_mm,dx_um,dy_um,dz_um", rows)
    result = verify(passes["cell"], points, points, "--predicted", passes["predicted"], "--json")
    assert result.exit_code == 1, result.output
    assert "8.1 mm away in the middle" in next(
        finding["message"] for finding in json.loads(result.stdout)["findings"] if finding["code"] == "CS6028")


@pytest.mark.parametrize(("carries", "kind", "exit_code"), [
    ("workobject", "linear", 0), ("workobject", "rotary", 1), ("robot", "rotary", 1), ("nothing", "rotary", 0)])
def test_a_work_object_that_may_turn_against_the_base_is_not_compared(
    passes: dict[str, Path], carries: str, kind: str, exit_code: int
) -> None:
    """The predicted deviations are in the base frame, and the file does not say where a table stood; a slide turns nothing."""
    axis = f"{{eax: a, kind: {kind}{'' if carries == 'nothing' else ', direction: [0, 0, 1]'}}}"
    unit = f"{{name: STN1, carries: {carries}, axes: [{axis}]}}"
    passes["cell"].write_text(passes["cell"].read_text() + f"mechanical_units: [{unit}]\n")
    result = verify(passes["cell"], passes["places"], passes["places"], "--predicted", passes["predicted"], "--frame",
                    "workobject", "--json")
    assert result.exit_code == exit_code, result.output
    assert ("CS4513" in result.output) == (exit_code == 1)
    same = verify(passes["cell"], passes["before"], passes["after"], "--predicted", passes["predicted"], "--json")
    assert same.exit_code == 0, same.output


@pytest.mark.parametrize(("name", "options", "code"), [
    ("shifted", (), "CS6029"),                              # a set-up error of 0.4 mm
    ("mirrored", (), "CS6030"),                             # a wrong sign along x
    ("before", ("--frame", "workobject"), "CS6031"),        # the wrong frame
])
def test_what_a_scale_does_not_mend_is_said(passes: dict[str, Path], name: str, options: tuple[str, ...], code: str) -> None:
    result = verify(passes["cell"], passes[name], passes["after"], "--predicted", passes["predicted"], *options, "--json")
    assert result.exit_code == 0, result.output
    assert code in {finding["code"] for finding in json.loads(result.stdout)["findings"]}


def test_a_work_object_that_the_cell_does_not_state_is_not_taken_for_the_base(passes: dict[str, Path]) -> None:
    """A program that declares its own stands elsewhere: at 10 degrees a scale of 1.10 had come out as 1.086 +- 0.002."""
    lines = passes["cell"].read_text().splitlines()
    passes["cell"].write_text("\n".join(line for line in lines if "workobject" not in line) + "\n")
    words = (passes["cell"], passes["places"], passes["places"], "--frame", "workobject", "--json")
    stopped = verify(*words, "--predicted", passes["predicted"])
    assert (stopped.exit_code, "CS6051" in stopped.output) == (1, True), stopped.output
    assert verify(*words).exit_code == 0


@pytest.mark.parametrize(("frame", "way"), [
    ("workobject", "give the readings in the base frame (--frame base)"),
    ("base", "give the places of the tool's centre, without --tool-radius-mm")])
@pytest.mark.parametrize(("lost", "code"), [("workobject", "CS6051"), ("", "CS4513"), (None, "")])
def test_normals_in_the_base_frame_need_the_work_object_too_for_places_on_the_surface(
    passes: dict[str, Path], tmp_path: Path, lost: str | None, code: str, frame: str, way: str
) -> None:
    """Not stated, or turned by a table. Who has them in the base frame already is not told to give them in it."""
    text = passes["cell"].read_text()
    if lost:
        text = "".join(line for line in text.splitlines(keepends=True) if lost not in line)
    elif lost is not None:
        text += "mechanical_units: [{name: T, carries: workobject, axes: [{eax: a, kind: rotary, direction: [0, 0, 1]}]}]\n"
    passes["cell"].write_text(text)
    normal = [1, 0, 0] if frame == "base" else [0, -1, 0]               # -y of the work object is x of the base
    points = csv(tmp_path, "p.csv", "x_mm,y_mm,z_mm,dn_um,nx,ny,nz",
                 np.array([[k / 2, 8, 0, 50 + k, *normal] for k in range(9)]))
    result = verify(passes["cell"], points, points, "--predicted", passes["predicted"], "--frame", frame, "--json",
                    "--tool-radius-mm", 8)
    assert result.exit_code == (1 if code else 0), result.output
    told = [one for one in json.loads(result.stdout)["findings"] if one["level"] == "error"]
    assert [one["code"] for one in told] == [code] * bool(code)
    assert all(way in one["hint"] for one in told)


@pytest.mark.parametrize(("name", "options", "said"), [
    ("mirrored", (), "x with the other sign"), ("turned", (), "turned by 25 deg about"),
    ("before", ("--frame", "workobject"), "the base frame (--frame base)"),
    ("before", (), ""), ("shifted", (), ""), ("places", ("--frame", "workobject"), "")])
def test_readings_along_other_axes_are_told_and_no_scale_is_advised(
    passes: dict[str, Path], name: str, options: tuple[str, ...], said: str
) -> None:
    result = verify(passes["cell"], passes[name], passes["places" if name == "places" else "after"], "--predicted",
                    passes["predicted"], *options, "--json")
    assert result.exit_code == 0, result.output
    document = json.loads(result.stdout)
    told = [finding["message"] for finding in document["findings"] if finding["code"] == "CS6050"]
    assert [said in message for message in told] == ([True] if said else [])
    if said:
        assert document["result"]["predicted"]["advised_scale"] is None


@pytest.mark.parametrize(("count", "said"), [(11, False), (12, True)])
def test_other_axes_are_told_from_twelve_places_on_with_what_they_would_leave(
    passes: dict[str, Path], tmp_path: Path, count: int, said: bool
) -> None:
    """Both by the best multiple, beside a constant."""
    rows, told = (np.loadtxt(passes[name], delimiter=",", skiprows=1)[20:20 + count] for name in ("before", "predicted"))
    mirrored = csv(tmp_path, "m.csv", "target,dx_um,dy_um,dz_um", rows * [1, 1, -1, 1])
    result = verify(passes["cell"], mirrored, mirrored, "--predicted", passes["predicted"], "--json")
    found = [one["message"] for one in json.loads(result.stdout)["findings"] if one["code"] == "CS6050"]
    left = []
    for turned in (1, -1):
        off, p = ((part - part.mean(axis=0)).ravel() for part in (rows[:, 1:] * [1, -1, 1], told[:, 4:] * [1, turned, 1]))
        left.append(np.sqrt(np.mean((off - (off @ p) / (p @ p) * p) ** 2)))
    assert found == [f"the readings are off as is predicted, but along other axes: y with the other sign, which would leave "
                     f"{left[1]:.1f} um in place of {left[0]:.1f}"] * said


@pytest.mark.parametrize(("factor", "said"), [(1.08, False), (1.11, True), (1.25, True)])
def test_axes_that_differ_by_a_few_per_cent_need_no_word(
    passes: dict[str, Path], tmp_path: Path, factor: float, said: bool
) -> None:
    """Of a difference d along one of three like axes one scale leaves d sqrt(2) / 3: 4 % of the deviation, and 11."""
    rows = np.loadtxt(passes["before"], delimiter=",", skiprows=1) * [1, factor, 1, 1]
    unlike = csv(tmp_path, "unlike.csv", "target,dx_um,dy_um,dz_um", rows)
    result = verify(passes["cell"], unlike, passes["after"], "--predicted", passes["predicted"], "--json")
    assert result.exit_code == 0, result.output
    document = json.loads(result.stdout)
    axes = [document["result"]["predicted"]["axes"][axis]["interval"] for axis in "xy"]
    assert axes[0][0] > axes[1][1], "the intervals are apart"
    told_of = [one["message"] for one in document["findings"] if one["code"] == "CS6030"]
    assert bool(told_of) == said
    if said:        # by the squares that the best multiple of all, and of each axis, leaves
        p = np.loadtxt(passes["predicted"], delimiter=",", skiprows=1)[:, 4:]
        one = np.sum(p * rows[:, 1:]) / np.sum(p**2)
        each = np.sum(p * rows[:, 1:], axis=0) / np.sum(p**2, axis=0)
        more = np.sqrt(np.mean(np.sum((rows[:, 1:] - one * p) ** 2 - (rows[:, 1:] - each * p) ** 2, axis=1)))
        assert len(told_of) == 2, "x and y, x and z"
        assert all(f"one scale leaves {more:.1f} um RMS" in message for message in told_of)
        assert told_of[0].startswith(f"along x the measured deviation is {each[0]:.3f} times")
        assert f"along y {each[1]:.3f} times" in told_of[0]


def test_exit_codes_of_the_answer(passes: dict[str, Path], tmp_path: Path) -> None:
    files = (passes["cell"], passes["before"], passes["after"])
    assert verify(*files, "--tolerance-um", 200).exit_code == 0
    report = tmp_path / "r.html"
    refused = verify(*files, "--tolerance-um", 60, "--report", report)
    assert refused.exit_code == 3
    assert "CS6026" in refused.stderr
    assert report.exists()
    document = json.loads(verify(*files, "--tolerance-um", 60, "--json").stdout)
    assert (document["status"], document["result"]["within_tolerance"]) == ("refused", False)
    assert "CS6027" not in refused.stderr
    exchanged = verify(passes["cell"], passes["after"], passes["before"])
    assert exchanged.exit_code == 0
    assert "CS6027" in exchanged.stderr
    assert "became larger" in exchanged.stdout


@pytest.mark.parametrize(("worst", "said"), [
    ((5, 12), "none"), ((40, 96), "none"), ((0, 13), "none"), ((5, 12.01), "1 of 4 readings"), ((0, 13.01), "1 of 4 readings")])
def test_a_reading_of_just_the_tolerance_is_within_it(tmp_path: Path, worst: tuple[float, float], said: str) -> None:
    """Of 5 and 12 um the size is 13. A reading that has no counterpart before counts, too."""
    cell, limit = write_cell(tmp_path), 104 if worst[0] == 40 else 13
    before = csv(tmp_path, "before.csv", "target,dx_um,dz_um", np.array([[k, 50 + k, 20] for k in range(3)]))
    after = csv(tmp_path, "after.csv", "target,dx_um,dz_um", np.array([[0, 1, 2], [1, np.nan, -7], [2, 3, 4], [3, *worst]]))
    result = verify(cell, before, after, "--tolerance-um", limit, "--json")
    over = said != "none"
    assert (result.exit_code, json.loads(result.stdout)["result"]["over_tolerance"]) == ((3, 1) if over else (0, 0))
    assert [said in one["message"] and "the largest by 13.0 um" in one["message"] for one in of_code(result, "CS6026")] == [
        True] * over


def test_no_part_is_within_a_tolerance_that_is_no_number(tmp_path: Path) -> None:
    """By a script as on the command line."""
    cell = write_cell(tmp_path)
    file = csv(tmp_path, "part.csv", "target,dx_um", np.array([[0, 500], [1, 600]]))
    assert verify_files(read_cell(cell), file, file, tolerance_um=np.nan).accepted is False
    refused = verify(cell, file, file, "--tolerance-um", "nan")
    assert (refused.exit_code, "'--tolerance-um': found 'nan'" in refused.stderr) == (2, True), refused.stderr


@pytest.mark.parametrize(("rows", "over"), [
    ([(0, 9), (1, 9), (1, -9), (2, 9)], 0), ([(0, 9), (1, 14), (1, -14), (2, 9)], 2), ([(0, 9), (1, 14), (1, 4), (2, 9)], 1)])
def test_no_reading_hides_behind_another_of_its_target(tmp_path: Path, rows: list[tuple[int, float]], over: int) -> None:
    """The tolerance of 10 um is asked of each; what is compared with the pass before are the means."""
    cell, report = write_cell(tmp_path), tmp_path / "page.html"
    before = csv(tmp_path, "before.csv", "target,dx_um", np.array([[k, 50 + k] for k in range(3)]))
    after = csv(tmp_path, "after.csv", "target,dx_um", np.array(rows))
    result = verify(cell, before, after, "--tolerance-um", 10, "--report", report, "--json")
    found = json.loads(result.stdout)["result"]
    assert (result.exit_code, found["over_tolerance"], found["within_tolerance"]) == (3 if over else 0, over, not over)
    means = [np.mean([off for target, off in rows if target == k]) for k in range(3)]
    assert found["after"]["rms_um"] == pytest.approx(np.sqrt(np.mean(np.square(means))))
    assert [one["message"] for one in of_code(result, "CS6026")] == [
        f"{over} of 4 readings deviate by more than the tolerance of 10 um, the largest by 14.0 um"] * bool(over)
    page = re.sub(r"<[^>]+>", "", report.read_text()).replace("\xa0", " ")
    assert (f"{over} of 4 readings exceed the tolerance of 10 µm, the worst at target 1." if over
            else "All 4 readings are within 10 µm.") in page


def test_a_reading_at_a_target_that_was_added_is_held_to_the_tolerance_too(tmp_path: Path) -> None:
    """It has no counterpart in the pass before, and is part of the part."""
    offsets = tmp_path / "offsets.csv"
    offsets.write_text("target,dx_um,dy_um,dz_um,added\n" + "".join(
        f"{k},{40 + k},{k * k},3,{'0.3 0.6' if k == 2 else ''}\n" for k in range(5)))
    before = csv(tmp_path, "before.csv", "target,dx_um", np.array([[k, 40 + k] for k in range(5)]))
    for worst, over in ((9, 0), (14, 1)):
        after = csv(tmp_path, "after.csv", "target,dx_um", np.array([[k, worst if k == 3 else 5] for k in range(7)]))
        result = verify(write_cell(tmp_path), before, after, "--predicted", offsets, "--tolerance-um", 10, "--json",
                        "--report", tmp_path / "page.html", "--force")
        assert (result.exit_code, len(of_code(result, "CS6037"))) == (3 if over else 0, 1)
        assert [one["message"].partition(" deviate")[0] for one in of_code(result, "CS6026")] == ["1 of 7 readings"] * over
        assert json.loads(result.stdout)["result"]["after"]["max_um"] == pytest.approx(5)
        assert ("the worst at target 3." in re.sub(r"<[^>]+>", "", (tmp_path / "page.html").read_text())) == bool(over)


def test_a_prediction_that_cannot_be_joined(passes: dict[str, Path], tmp_path: Path) -> None:
    by_length = csv(tmp_path, "l.csv", "path_mm,dx_um", np.column_stack([np.arange(20), np.ones(20)]))
    result = verify(passes["cell"], by_length, by_length, "--predicted", passes["predicted"])
    assert result.exit_code == 1
    assert "CS6028" in result.stderr
    unloaded = csv(tmp_path, "u.csv", "target,dx_um,dy_um,dz_um", np.column_stack([np.arange(600), np.zeros((600, 3))]))
    result = verify(passes["cell"], passes["before"], passes["after"], "--predicted", unloaded)
    assert result.exit_code == 1
    assert "predicts no deviation" in result.stderr


@pytest.mark.parametrize(("name", "options"), [("before", ()), ("places", ("--frame", "workobject"))])
def test_a_target_without_a_place_is_no_obstacle(
    passes: dict[str, Path], tmp_path: Path, name: str, options: tuple[str, ...],
) -> None:
    """A MoveAbsJ has a row in offsets.csv and no place: every number is as if the row were not there."""
    header, *rows = passes["predicted"].read_text().splitlines()
    joint = tmp_path / "joint.csv"
    joint.write_text("\n".join([header, "600,,,,0,0,0", *rows, "601,,,,0,0,0"]) + "\n")
    given = (passes["cell"], passes[name], passes[name], *options, "--json", "--predicted")
    without, held = (verify(*given, file) for file in (passes["predicted"], joint))
    assert held.exit_code == 0, held.output
    assert json.loads(held.stdout)["result"] == json.loads(without.stdout)["result"]
    assert json.loads(held.stdout)["findings"] == json.loads(without.stdout)["findings"]
    nowhere = tmp_path / "nowhere.csv"
    nowhere.write_text(f"{header}\n600,,,,0,0,0\n")
    assert verify(*given, nowhere).exit_code == 1


def scaled(folder: Path, scale: float, size: float = 100.0) -> tuple[Verification, list[str]]:
    """A path that is off by so many times the prediction, but for a thousandth: the result and what is said of the scale."""
    rng = np.random.default_rng(6031)
    told = size * rng.normal(size=(200, 3))
    rows = np.column_stack([np.arange(200), scale * told * (1 + 1e-3 * rng.normal(size=told.shape))])
    read = csv(folder, "r.csv", SIGMAS, np.column_stack([rows, np.full((200, 3), max(1e-2, 1e-3 * scale * size))]))
    file = csv(folder, "told.csv", "target,dx_um,dy_um,dz_um", np.column_stack([np.arange(200), told]))
    result = verify_files(read_cell(write_cell(folder)), read, read, file)
    return result, [one.code for one in result.findings if one.code in ("CS6031", "CS6049")]


@pytest.mark.parametrize(("scale", "codes"), [
    (0.45, ["CS6031"]), (0.55, ["CS6049"]), (0.84, ["CS6049"]), (0.86, []), (1.9, []), (2.1, ["CS6031"])])
def test_a_scale_is_advised_from_a_half_to_two_and_doubted_under_85_per_cent(tmp_path: Path, scale: float, codes) -> None:
    result, said = scaled(tmp_path, scale)
    assert result.scale is not None
    assert said == codes
    assert result.scale.advised == (None if "CS6031" in codes else pytest.approx(scale, abs=2e-3))


@pytest.mark.parametrize(("scale", "size", "unit"), [
    (0.04, 100.0, "in mil"), (1e-3, 100.0, "in millimetres"), (1e3, 1.0, "in nanometres"), (2.1, 100.0, "of the diameter"),
    (0.2, 100.0, ""), (4.5, 100.0, "")])
def test_readings_in_another_unit_are_asked_about_it(tmp_path: Path, scale: float, size: float, unit: str) -> None:
    result, _ = scaled(tmp_path, scale, size)
    [hint] = [one.hint for one in result.findings if one.code == "CS6031"]
    assert re.findall(r"are they in micrometres, or (.*)\? Else check sign", hint) == ([unit] if unit else [])


@pytest.mark.parametrize(("count", "size", "change", "said"), [
    (10, 50.0, 0.13, "but for 13 % of it"), (9, 50.0, 0.13, ""), (10, 50.0, 0.17, ""),
    (10, 0.77, 0.0, "but for 2.6 % of it"), (10, 0.64, 0.0, "")])
def test_ten_places_that_are_clearly_off_as_before_but_for_15_per_cent_were_not_corrected(
        tmp_path: Path, count: int, size: float, change: float, said: str) -> None:
    """Sigma of a tenth of a micrometre: five times the noise of both passes are 0.71 um."""
    off = size * (-1.0) ** np.arange(count)
    passes = [csv(tmp_path, name, SIGMAS, np.column_stack([np.arange(count), values, *[np.full(count, np.nan)] * 2,
                                                           *[np.full(count, 0.1)] * 3]))
              for name, values in (("b.csv", off), ("a.csv", (1 - change) * off + (0 if change else 0.02)))]
    found = [one.message for one in verify_files(read_cell(write_cell(tmp_path)), *passes).findings if one.code == "CS6048"]
    assert [said in message for message in found] == [True] * bool(said)


def cells(page: str) -> list[list[str]]:
    """The rows of all tables of a page."""
    row, cell = (re.compile(rf"<{name}[^>]*>(.*?)</{name}>", re.DOTALL) for name in ("tr", "t[dh]"))
    return [[" ".join(re.sub(r"<[^>]+>", " ", text).split()) for text in cell.findall(each)] for each in row.findall(page)]


def test_the_page_has_the_figures_of_the_readings(tmp_path: Path) -> None:
    """Of sizes and of each axis that was measured, and how many times the predicted deviation they are; by plain numpy. The
    share of the tolerance is that of the largest, and a sentence says what the prediction took away."""
    rng, at = np.random.default_rng(53), np.arange(200)
    told = rng.normal(5, 60, (200, 3))
    before = 1.3 * told + rng.normal(0, 8, told.shape)
    after = 0.2 * told + rng.normal(0, 8, told.shape)
    before[:, 2] = after[:, 2] = np.nan
    before[4, 1] = np.nan
    files = [csv(tmp_path, name, "target,dx_um,dy_um,dz_um", np.column_stack([at, values]))
             for name, values in (("b.csv", before), ("a.csv", after), ("t.csv", told))]
    result = verify_files(read_cell(write_cell(tmp_path)), *files, tolerance_um=50.0)
    page = verify_report(result)
    both = np.isfinite(before) & np.isfinite(after)
    of_place = [np.sqrt(np.sum(np.where(both, values, 0.0) ** 2, axis=1)) for values in (before, after)]

    def figures(one: np.ndarray, other: np.ndarray) -> list[str]:
        both = [(np.sqrt(np.mean(values**2)), values.mean(), np.quantile(np.abs(values), 0.95), np.abs(values).max())
                for values in (one, other)]
        return [str(len(one)), *(f"{x:.1f} {y:.1f}" for x, y in zip(*both, strict=True))]

    rows = cells(page)
    assert ["size", *figures(*of_place)] in rows
    for axis, name in enumerate("xy"):
        kept = both[:, axis]
        assert [f"along {name}", *figures(before[kept, axis], after[kept, axis])] in rows
    assert not any(row[:1] == ["along z"] for row in rows)
    known = np.isfinite(before)
    scales = [row for row in rows if len(row) == 6 and "\u2026" in row[2]]
    for name, axes in (("overall", [True] * 3), ("along x", [True, False, False]), ("along y", [False, True, False])):
        chosen = known & axes
        m, p, count = before[chosen], told[chosen], int(chosen.any(axis=1).sum())
        scale = m @ p / (p @ p)
        [row] = [row for row in scales if row[0] == name]
        assert (row[1], row[2].split()[0]) == (str(count), f"{scale:.3f}")
        assert row[3:] == [f"{100 * (1 - np.sum((m - p) ** 2) / (m @ m)):.1f} %",
                           f"{100 * (1 - np.sum((m - scale * p) ** 2) / (m @ m)):.1f} %",
                           f"{np.sqrt(np.sum((m - scale * p) ** 2) / count):.1f}"]
    assert len(scales) == 3
    largest = np.nanmax(np.sqrt(np.nansum(after**2, axis=1)))
    words = re.sub(r"\s+", " ", re.sub(r"<[^>]+>", " ", page)).replace("\xa0", " ")
    assert f"share of the tolerance {100 * largest / 50:.0f} %" in words
    assert result.scale is not None
    assert f"The prediction as it stands explains {100 * result.scale.share:.1f} % of the mean square measured before" in words


@pytest.mark.parametrize("count", [4000, 4001])
def test_of_over_four_thousand_places_every_second_is_drawn(tmp_path: Path, count: int) -> None:
    at = np.arange(count)
    told = 50 * np.sin(at / 9)
    file, read = (csv(tmp_path, name, "target,dx_um,dy_um,dz_um", np.column_stack([at, times * told, told, told]))
                  for name, times in (("told.csv", 1.0), ("read.csv", 1.2)))
    page = verify_report(verify_files(read_cell(write_cell(tmp_path)), read, read, file))
    assert ("One place in 2 is drawn." in page, "One place in" in page) == (count > 4000,) * 2


def test_readings_of_two_components_are_held_against_the_prediction_as_they_stand(passes: dict[str, Path], tmp_path: Path):
    """Along which other axes they may be is asked of whole vectors alone."""
    rows = np.loadtxt(passes["mirrored"], delimiter=",", skiprows=1)[:, :3]
    two = csv(tmp_path, "two.csv", "target,dx_um,dy_um", rows)
    result = verify(passes["cell"], two, two, "--predicted", passes["predicted"], "--json")
    assert result.exit_code == 0, result.output
    scale = json.loads(result.stdout)["result"]["predicted"]
    assert (scale["other_axes"], sorted(scale["axes"]), len(of_code(result, "CS6050"))) == ("", ["x", "y"], 0)

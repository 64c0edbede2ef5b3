"""`diagnose` and `identify` on files with a mistake, from end to end: named, mended, and then as if it had never been."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner, Result

from compstiff.cli.main import compstiff
from identification.fit.load_test import LoadTest
from identification.fit.mistakes.joints import joint_mistakes
from identification.measurements import read_measurements
from identification.model.cell import read_cell
from identification.model.robot import built_in_robots, read_robot
from tests.runs.mistakes.planted import MISTAKES, SHOP, VIRTUAL, first, right, two_robots

FEW = ["--replicates", "39", "--force"]


def call(*arguments: object) -> Result:
    return CliRunner().invoke(compstiff, [str(argument) for argument in arguments])


def diagnosed(folder: Path, cell: Path, table: Path, *options: object) -> dict:
    done = call("diagnose", cell, table, "-o", folder / "diagnosis.json", *FEW, *options)
    assert done.exit_code == 0, done.output
    return dict(json.loads((folder / "diagnosis.json").read_text()))


# `identify` refuses by the same search that `diagnose` names by (a sign: tests/identification/fit/test_laws_misfit.py); these
# are the quickest to search, and the one that is refused before there is a search.
REFUSED = {"readings a row high": "CS1700", "readings raw": "CS1700", "forces in kgf": "CS1018"}


# Long: another sign is named below; angles counted otherwise, on a FANUC; a
# joint's zero is named in tests/second_cell/test_answers.py; what each is put back to is held in
# tests/identification/fit/test_laws_mistakes.py. A few poses: what is plain in them is plain.
@pytest.mark.parametrize(("name", "robot", "seed", "suffix"), [
    pytest.param("force sign", VIRTUAL, 3, ".csv", marks=pytest.mark.long),
    pytest.param("joint zero 2 deg", "irb4400-60", 5, ".csv", marks=pytest.mark.long),
    ("TCP in inches", "irb6700-200-2.60", 4, ".yaml"),
    pytest.param("sign in the second half", "irb6640-235-2.55", 6, ".csv", marks=pytest.mark.long),
    pytest.param("readings a row high", "irb6640-235-2.55", 5910002, ".csv", marks=pytest.mark.long),
    pytest.param("poses one down", "irb4400-60", 9, ".csv", marks=pytest.mark.long),
    ("times in ms", VIRTUAL, 7, ".csv"), ("forces in kgf", VIRTUAL, 8, ".csv"),
    ("readings raw", "irb4400-60", 10, ".csv"), pytest.param("turns not counted", VIRTUAL, 11, ".csv", marks=pytest.mark.long),
    pytest.param("q3 with q2", "irb6640-235-2.55", 12, ".csv", marks=pytest.mark.long),
])
def test_a_mistake_is_named_and_mended(tmp_path: Path, name: str, robot: str, seed: int, suffix: str) -> None:
    # Poses that stand at the next one need their neighbours.
    case = first(right(seed, robot), 12 if name == "poses one down" else 4)
    spoiled, truth = MISTAKES[name](case, np.random.default_rng(seed))
    cell, table = spoiled.write(tmp_path)
    found = diagnosed(tmp_path, cell, table, "--mend", tmp_path / "mended")
    assert found["verdict"] == "mistake"
    (mistake,) = found["mistakes"]
    assert mistake["mistake"] in truth or (truth == ("unit",) and mistake["mistake"] == "force_unit")
    assert found["causes"] == []
    mended = tmp_path / f"mended{suffix}"
    assert mended.read_text().startswith(f"# compstiff diagnose --mend, from {(table if suffix == '.csv' else cell).name}")
    if name in REFUSED:
        refused = call("identify", cell, table, "-o", tmp_path / "stiffness.json", "--force")
        assert refused.exit_code == 1
        assert REFUSED[name] in refused.stderr
        assert not (tmp_path / "stiffness.json").exists()
    files = (cell, mended) if suffix == ".csv" else (mended, table)
    done = call("identify", *files, "-o", tmp_path / "stiffness.json", "--force")
    assert done.exit_code == 0, done.output
    assert not any(code in done.stderr for code in ("CS1700", "CS1701", "CS1018"))
    springs = json.loads((tmp_path / "stiffness.json").read_text())["parameters"]
    known = np.array([spring["std"] < 0.02 * spring["estimate"] for spring in springs])
    off = np.log([spring["estimate"] for spring in springs] / case.stiffness)
    assert known.sum() >= 3
    assert np.all(np.abs(off[known]) < 0.08), off


def test_a_mistake_that_heavy_tails_would_hide_is_named(tmp_path: Path) -> None:
    """Few readings at the end of their gauges count for so little that the detection sees nothing, and leave fifty times what
    the noise allows: the answer had been `adequate`."""
    case = first(right(10, "irb4400-60"), 4)
    end = np.sort(np.abs(case.moved).ravel())[-9]
    found = diagnosed(tmp_path, *replace(case, moved=np.clip(case.moved, -0.7 * end, 0.7 * end)).write(tmp_path))
    assert found["verdict"] == "mistake"
    assert [mistake["mistake"] for mistake in found["mistakes"]] == ["readings_clipped"]


@pytest.mark.parametrize("wrong", [True, False])
def test_a_mistake_that_is_only_likely_is_told_by_identify_and_no_stiffness_is_reliable(tmp_path: Path, wrong: bool) -> None:
    """A zero of joint 5 that is 2 degrees off may be physics as well: the file is written, and correct will refuse it."""
    case = first(right(3, "irb4400-60"), 4)
    if wrong:
        case, _ = MISTAKES["joint zero 2 deg"](case, np.random.default_rng(3))
    done = call("identify", *case.write(tmp_path), "-o", tmp_path / "stiffness.json", "--json")
    assert done.exit_code == 0, done.output
    told = [one for one in json.loads(done.stdout)["findings"] if one["code"] in ("CS1701", "CS1021")]
    grades = {spring["grade"] for spring in json.loads((tmp_path / "stiffness.json").read_text())["parameters"]}
    assert [one["code"] for one in told] == ["CS1021", "CS1701"] * wrong
    assert ("reliable" in grades) is not wrong
    for one in told:
        assert one["level"] == "warning"
        assert "a mistake in the table would explain the misfit: the zero of joint 5 seems to be off" in one["message"]
        assert ": the robot stood at q5 +2." in one["message"]


# Long: gauges at their end are named above.
@pytest.mark.long
def test_one_gauge_that_ends_before_the_others_do_is_named(tmp_path: Path) -> None:
    """The others read more: its readings had been bad ones, each by itself."""
    case = right(5600021, "irb6640-235-2.55")
    axis = int(np.argmin(np.abs(case.moved).max(axis=0)))
    end = np.sort(np.abs(case.moved[:, axis]))[-6]
    assert end < 0.9 * np.abs(case.moved).max()
    moved = case.moved.copy()
    moved[:, axis] = np.clip(moved[:, axis], -end, end)
    found = diagnosed(tmp_path, *replace(case, moved=moved).write(tmp_path))
    assert found["verdict"] == "mistake"
    (mistake,) = found["mistakes"]
    assert mistake["mistake"] == "readings_clipped"
    assert f"readings of d{'xyz'[axis]} of {end:.0f} um" in mistake["sentence"]


# Long: the same crowding out by another robot, where its unknown weight may have moved the readings nearly as well.
# Long: a TCP in inches is named above, and how likely three free coordinates are is held in
# tests/identification/fit/test_laws_mistakes.py.
@pytest.mark.long
@pytest.mark.parametrize(("robot", "seed", "poses", "verdict"), [
    ("irb4400-60", 5600001, 8, "mistake"), pytest.param("irb6640-235-2.55", 5600006, 12, "ambiguous", marks=pytest.mark.long)])
def test_a_tcp_that_is_off_is_no_soft_spindle(tmp_path: Path, robot: str, seed: int, poses: int, verdict: str) -> None:
    """20 mm of one coordinate, little more than the noise, which visits share. A load under which nothing was zeroed had
    crowded it out of the quick look, and three free coordinates had been held against the one number of a spindle."""
    spoiled, _ = MISTAKES["TCP 20 mm"](first(right(seed, robot), poses), np.random.default_rng([seed, 3]))
    found = diagnosed(tmp_path, *spoiled.write(tmp_path))
    assert found["verdict"] == verdict
    (mistake,) = found["mistakes"]
    assert (mistake["mistake"], list(mistake["parameters"])) == ("tcp", ["z"])
    size = mistake["parameters"]["z"]
    assert abs(size["estimate"] - 20) < 3 * size["std"] < 12


# Long: another mix-up of the same rows stays; test_no_model_comes_from_rows_with_a_mistake asks the last one's name.
@pytest.mark.parametrize(("name", "seed", "key", "also"), [
    pytest.param("deflection sign", 430002, "deflection_sign[x]", "", marks=pytest.mark.long),
    pytest.param("deflections swapped", 430002, "deflection_swapped[xy]", "", marks=pytest.mark.long),
    ("force sign", 430004, "force_sign[x]", "dx seems to have the other sign"),
    pytest.param("deflections cyclic", 430004, "deflection_axes[dy dz dx]", "", marks=pytest.mark.long)])
def test_mistakes_that_leave_the_same_rows_are_one(tmp_path: Path, name: str, seed: int, key: str, also: str) -> None:
    """Loads straight down alone (430002), one gauge along the load (430004): other axes turned, or signs of columns that are
    empty, leave the same rows behind, and readings that stand in another column are the misfit of the one they stand in."""
    spoiled, truth = MISTAKES[name](right(seed, SHOP), np.random.default_rng([seed, 3]))
    assert truth == (key,)
    down, one_gauge = not spoiled.force[:, :2].any(), np.all(np.isfinite(spoiled.moved).sum(axis=1) == 1)
    assert (down, one_gauge) == (seed == 430002, seed == 430004)
    found = diagnosed(tmp_path, *spoiled.write(tmp_path))
    assert found["verdict"] == "mistake"
    (mistake,) = found["mistakes"]
    assert mistake["mistake"] == key
    assert ("the same to these rows" in mistake["sentence"]) == bool(also)
    assert also in mistake["sentence"]


# Long: the same in another short test.
@pytest.mark.parametrize("seed", [440000, pytest.param(440005, marks=pytest.mark.long)])
def test_a_load_under_the_zero_is_found_in_a_short_test(tmp_path: Path, seed: int) -> None:
    """Forces that seem to differ from visit to visit had grown until they took up the load, and it was not tried."""
    spoiled, _ = MISTAKES["zeroed under load"](right(seed, SHOP), np.random.default_rng([seed, 3]))
    found = diagnosed(tmp_path, *spoiled.write(tmp_path))
    assert [mistake["mistake"] for mistake in found["mistakes"]] == ["reference_load"]
    # A zero of the force that is off by the same in all rows is the same to a load test.
    assert {cause["effect"] for cause in found["alternatives"]} <= {"force_offset"}


# Long: rows that fit other springs than the rest are told by tests/identification/fit/test_laws_mistakes.py, and on the
# command line by test_check.py.
@pytest.mark.long
def test_rows_of_two_robots_are_parted(tmp_path: Path) -> None:
    cell, table = two_robots(12, "irb6700-200-2.60").write(tmp_path)
    found = diagnosed(tmp_path, cell, table, "--mend", tmp_path / "mended.csv")
    assert [mistake["mistake"] for mistake in found["mistakes"]] == ["two_robots"]
    assert "90 rows are left out" in (tmp_path / "mended.csv").read_text().splitlines()[1]


@pytest.mark.parametrize(("column", "factor", "key", "words"), [
    ("force", 1 / 9.80665, "force_unit", "forces seem to be in kgf"),
    pytest.param("moved", 1e-3, "deflection_unit", "deflections seem to be in mm", marks=pytest.mark.long)])
def test_another_unit_from_a_row_on_is_no_other_robot(tmp_path: Path, column: str, factor: float, key: str, words: str) -> None:
    """Two robots would fit six springs to what one factor is."""
    case = first(right(14, "irb6700-200-2.60"), 4)
    values = getattr(case, column).copy()
    half = len(values) // 2
    values[half:] *= factor
    found = diagnosed(tmp_path, *replace(case, **{column: values}).write(tmp_path))
    (mistake,) = found["mistakes"]
    assert (mistake["mistake"], mistake["last_row"]) == (key, len(values))
    assert words in mistake["sentence"]


def test_rows_that_no_springs_fit_are_mended_too(tmp_path: Path) -> None:
    """Unloaded minus loaded. CS1010: no diagnosis, but the file without the mistake, where asked for, from which the springs
    are as if it had never been; the refusal says how to get it."""
    case = right(15, "irb6640-235-2.55")
    right_files = case.write(tmp_path)
    assert call("identify", *right_files, "-o", tmp_path / "right.json").exit_code == 0
    cell, table = replace(case, moved=-case.moved).write(tmp_path)
    refused = call("identify", cell, table, "-o", tmp_path / "s.json")
    assert (refused.exit_code, "CS1010" in refused.stderr, "--mend MENDED" in refused.stderr) == (1, True, True)
    done = call("diagnose", cell, table, "-o", tmp_path / "d.json", "--mend", tmp_path / "mended", *FEW)
    assert (done.exit_code, "CS1010" in done.stderr, "mended.csv is" in " ".join(done.stderr.split())) == (1, True, True)
    assert not (tmp_path / "d.json").exists()
    assert call("identify", cell, tmp_path / "mended.csv", "-o", tmp_path / "mended.json").exit_code == 0
    found, known = (np.array([spring["estimate"] for spring in json.loads((tmp_path / name).read_text())["parameters"]])
                    for name in ("mended.json", "right.json"))
    np.testing.assert_allclose(found, known, rtol=1e-3)


@pytest.mark.parametrize("earlier", [(), ("mended.csv",)])
def test_nothing_is_mended_without_a_mistake(tmp_path: Path, earlier: tuple[str, ...]) -> None:
    """A file that stands there of an earlier call is said to be that, and stays."""
    cell, table = first(right(12, "irb6640-235-2.55"), 4).write(tmp_path)
    for name in earlier:
        (tmp_path / name).write_text("of yesterday")
    done = call("diagnose", cell, table, "-o", tmp_path / "d.json", "--mend", tmp_path / "mended", *FEW)
    assert done.exit_code == 3
    of_earlier = "; the mended.csv that stands there is of an earlier call" if earlier else ""
    assert (f"warning CS1703: no mistake is named, so that there is nothing to mend: {tmp_path / 'mended'} was not written"
            f"{of_earlier}\n") in done.stderr
    assert json.loads((tmp_path / "d.json").read_text())["mistakes"] == []
    assert {path.name: path.read_text() for path in tmp_path.glob("mended*")} == dict.fromkeys(earlier, "of yesterday")


def exchanged(folder: Path, seed: int, one: int, other: int) -> dict[str, dict]:
    """The causes, by name and place, that are named where the readings of these two rows, from 1, were exchanged."""
    case = right(seed, "irb6640-235-2.55")
    assert case.pose[one - 1] == case.pose[other - 1]
    moved = case.moved.copy()
    moved[[one - 1, other - 1]] = moved[[other - 1, one - 1]]
    done = call("diagnose", *replace(case, moved=moved).write(folder), "-o", folder / "diagnosis.json", *FEW)
    causes = json.loads((folder / "diagnosis.json").read_text())["causes"]
    assert done.stderr.count("CS1407") == " ".join(done.stderr.split()).count("hint: exchanged with the reading of row")
    return {str((parameters.get("single_row") or parameters["pose"])["estimate"]): cause
            for cause in causes for parameters in [cause["parameters"]]}


def test_two_readings_that_were_exchanged_are_told(tmp_path: Path) -> None:
    """Two that differ by 0.4 mm: both are left out, and each is told with the other."""
    found = exchanged(tmp_path, 880, 12, 14)
    assert set(found) == {"12", "14"}
    for row, beside in (("12", 14), ("14", 12)):
        (mend,) = found[row]["mends"]
        assert (mend["kind"], mend["probability"] > 0.9) == ("readings exchanged", True)
        assert f"row {beside} (line {beside + 1})" in mend["what"]


# Long: two that differ are told above; what a slip in the readings of a pose does to its response and how likely it is,
# tests/identification/fit/test_laws_row_slips.py and test_laws_mending.py there.
@pytest.mark.long
def test_so_are_two_that_decide_the_response_of_their_pose(tmp_path: Path) -> None:
    """The two that are farthest apart: the pose seemed to have fz of the other sign, "100 % of what was tried"."""
    (cause,) = exchanged(tmp_path, 16, 177, 180).values()
    assert cause["effect"] == "bad_visit"
    assert cause["mends"][0]["kind"] == "readings exchanged"
    assert "lines 178 and 181 exchanged" in cause["mends"][0]["what"]


def test_no_model_comes_from_rows_with_a_mistake(tmp_path: Path) -> None:
    """Of a short load test, which is diagnosed twice."""
    case = right(430004, SHOP)
    spoiled, (truth,) = MISTAKES["deflections cyclic"](case, np.random.default_rng([430004, 3]))
    cell, table = spoiled.write(tmp_path)
    before = table.read_bytes()
    extended, page = tmp_path / "extended.json", tmp_path / "r.html"
    done = call("diagnose", cell, table, "-o", tmp_path / "d.json", "--extended", extended, "--report", page, *FEW)
    assert done.exit_code == 3
    assert "CS1704" in done.stderr
    assert [mistake["mistake"] for mistake in json.loads((tmp_path / "d.json").read_text())["mistakes"]] == [truth]
    assert not extended.exists()
    assert "Mistakes in the files" in page.read_text()
    assert "earlier call" not in done.stderr
    extended.write_text("{}")           # of yesterday
    stale = call("diagnose", cell, table, "-o", tmp_path / "d.json", "--extended", extended, "--force", *FEW)
    assert "extended.json that stands there is of an earlier call" in " ".join(stale.stderr.split())
    assert extended.read_text() == "{}"
    over = call("diagnose", cell, table, "-o", tmp_path / "d.json", "--mend", table, *FEW)
    assert over.exit_code == 1
    assert "CS0006" in over.stderr
    assert table.read_bytes() == before


def test_another_robot_of_the_same_maker_is_named(tmp_path: Path) -> None:
    """Rows of an IRB 7600 in a cell file that names an IRB 6640: among all of ABB's the right one."""
    case = replace(first(right(12, "irb7600-150-3.50"), 5), robot="irb6640-235-2.55")
    cell, table = case.write(tmp_path)
    found = diagnosed(tmp_path, cell, table, "--mend", tmp_path / "mended")
    assert found["verdict"] == "mistake"
    assert [mistake["mistake"] for mistake in found["mistakes"]] == ["robot[irb7600-150-3.50]"]
    assert "robot: irb7600-150-3.50" in (tmp_path / "mended.yaml").read_text()


# Long: what angles were counted otherwise is told by the fit in tests/identification/fit/test_laws_mistakes.py, and another
# robot is named and mended above.
@pytest.mark.long
def test_angles_from_ros_on_a_fanuc_are_named(tmp_path: Path) -> None:
    """There J3 is counted against the lower arm, not against the horizontal as on the pendant."""
    pendant = first(right(13, "m710ic-50"), 4)
    theta = pendant.theta.copy()
    theta[:, 2] += theta[:, 1]
    cell, table = replace(pendant, theta=theta).write(tmp_path)
    found = diagnosed(tmp_path, cell, table, "--mend", tmp_path / "mended")
    assert found["verdict"] == "mistake"
    assert [mistake["mistake"] for mistake in found["mistakes"]] == ["joint_coupling"]
    mended = read_measurements(tmp_path / "mended.csv", read_cell(cell).robot)
    np.testing.assert_allclose(np.degrees(mended.theta), pendant.theta, atol=1e-6)


@pytest.mark.parametrize(("robot", "maker"), [("kr210-r2700-extra", "KUKA"), ("irb6700-235-2.65", "ABB")])
def test_rows_are_held_against_robots_of_the_same_maker(tmp_path: Path, robot: str, maker: str) -> None:
    case = right(12, robot)
    cell_file, table = case.write(tmp_path)
    cell = read_cell(cell_file)
    tried = [mistake.key for mistake in joint_mistakes(LoadTest.of(cell, read_measurements(table, cell.robot)))
             if mistake.key.startswith("robot[")]
    makers = {read_robot(built_in_robots()[key[6:-1]]).manufacturer for key in tried}
    assert makers <= {maker}
    assert tried

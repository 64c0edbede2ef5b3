"""What robust weights hide: a pose at which something is wrong is found, said in plain words, and left out; nothing else is."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import stats

from identification.common.findings import CompstiffError
from identification.diagnosis.diagnose import Diagnosis, diagnose
from identification.fit import visits
from identification.fit.bad_visits import bad_visits
from identification.fit.fit import Fit, fit_stiffness
from identification.fit.load_test import LoadTest
from identification.fit.mending import BadVisit
from identification.fit.own_response import LoadColumns
from identification.fit.posterior import posterior
from identification.fit.seating import moving_zero
from identification.fit.slips import slips_of_pen
from identification.fit.visit_findings import visit_findings
from identification.fit.visits import score_visits
from identification.measurements import Measurements, read_measurements
from identification.model.cell import Cell, read_cell
from identification.model.compliance import regressor
from tests.virtual_cell.cell import Case, Hidden, simulate
from tests.virtual_cell.effects_at_poses import mistaken_pose, rewrite, table
from tests.virtual_cell.noise import Noise

SHEET = Noise(sensor_um=2.0, force_relative=0.005, force_n=0.5, pose_offset_um=3.0, quantum_um=0.1, stated_sensor_um=2.0,
              stated_force_n=0.7, stated_force_relative=0.005, stated_pose_offset_um=4.0)
Edit = Callable[[Path], None]


def read(case: Case, folder: Path, *edits: Edit) -> tuple[Cell, Measurements]:
    """The case's files as a user has them, with mistakes written into the table."""
    cell_file, file = case.write(folder)
    for edit in edits:
        edit(file)
    cell = read_cell(cell_file)
    return cell, read_measurements(file, cell.robot)


def wrong_angle(pose: str, axis: int, change: Callable[[str], str]) -> Edit:
    def edit(file: Path) -> None:
        right = next(row for row in table(file) if row["pose"] == pose)[f"q{axis}_deg"]
        rewrite(file, pose, {f"q{axis}_deg": change(right)})

    return edit


def other_sign(text: str) -> str:
    return text[1:] if text.startswith("-") else "-" + text


def codes(found: Fit | Diagnosis) -> list[str]:
    return [finding.code for finding in found.findings]


# Long: in another design, as below with another axis' angles beside them.
@pytest.mark.parametrize(("design", "seed", "pose"), [
    pytest.param("ladder12", 71001, "P7", marks=pytest.mark.long), ("poses20", 71002, "P12")])
def test_a_wrong_angle_is_found_and_the_right_one_told(design: str, seed: int, pose: str, tmp_path: Path) -> None:
    case = simulate(seed, design, noise=SHEET)
    right = next(f"{angle:.9g}" for angle, label in zip(np.degrees(case.theta[:, 4]), case.pose, strict=True) if label == pose)
    cell, measurements = read(case, tmp_path, wrong_angle(pose, 5, other_sign))
    fit = fit_stiffness(cell, measurements)
    bad, = fit.bad_visits
    assert bad.score.name == pose
    assert bad.score.p_value <= 0.005
    assert bad.mends[0].what == f"axis 5 is {other_sign(right)} in the table; {right} would fit"
    finding = next(finding for finding in fit.findings if finding.code == "CS1730")
    assert pose in finding.message
    assert right in finding.hint
    # The stiffnesses are those of a table without the pose, the weight of its rows is nothing.
    without = fit_stiffness(cell, measurements.select(measurements.pose != pose))
    assert np.all(np.abs(fit.model.mean - without.model.mean) < 0.1 * without.model.log_std)
    assert np.allclose(fit.posterior.map, without.posterior.map, atol=1e-3)
    assert np.all(fit.row_weight[measurements.pose == pose] == 0)


# Long: what each slip is worth, in tests/identification/fit/test_laws_slips.py; a sign is told with its odds below.
@pytest.mark.long
def test_angles_of_another_visit_are_ten_times_rarer_than_a_slip_of_the_pen(tmp_path: Path) -> None:
    """Six poses, P5 with another sign of axis 5, and a seventh that stood where P5 really did: both would fit to the digit, and
    each kind of slip shares its prior out over the ways there are."""
    def seven(file: Path) -> None:
        kept = [row for row in table(file) if row["pose"] in {f"P{k}" for k in range(1, 7)}]
        kept += [row | {"pose": "P7"} for row in kept if row["pose"] == "P5"]
        file.write_text("\n".join([",".join(kept[0]), *(",".join(row.values()) for row in kept)]) + "\n")

    cell, measurements = read(simulate(71007, "ladder12", noise=SHEET), tmp_path, seven, wrong_angle("P5", 5, other_sign))
    bad, = fit_stiffness(cell, measurements).bad_visits
    assert bad.score.name == "P5"
    told = {mend.kind: mend.probability for mend in bad.mends}
    written = measurements.theta[measurements.pose == "P5"][0]
    signs = [replace_at(written, axis, -written[axis]) for axis in range(6) if abs(written[axis]) > np.radians(0.25)]
    possible = sum(bool(np.all(cell.robot.limit_excess(pose[None]) <= 0)) for pose in signs)
    assert told["sign"] / told["another visit's angles"] == pytest.approx(10 * 6 / possible, rel=1e-3)


def replace_at(values: NDArray[np.float64], place: int, value: float) -> NDArray[np.float64]:
    return np.where(np.arange(len(values)) == place, value, values)


def hose(pose: int) -> Hidden:
    """Along y, which a load of pose 5 of poses20 is."""
    return Hidden("hose_drags", parameters={"share": 0.5, "poses": [pose], "x": 0.0, "y": 1.0, "z": 0.0})


def stuck(joint: int, pose: int) -> Hidden:
    return Hidden("axis_sticks", joint, parameters={"torque_nm": 200.0, "poses": [pose]})


# Long: in the other design.
@pytest.mark.parametrize(("design", "seed", "hidden", "number"), [
    *(pytest.param("ladder12", *case, marks=pytest.mark.long) for case in ((71003, hose(8), 8), (71004, stuck(3, 2), 2))),
    ("poses20", 71005, hose(5), 5), ("poses20", 71006, stuck(3, 6), 6)])
def test_what_drags_or_sticks_at_a_pose_is_found_there(design: str, seed: int, hidden: Hidden, number: int, tmp_path: Path
                                                       ) -> None:
    case = simulate(seed, design, [hidden], SHEET)
    assert np.sqrt(np.mean(case.effect_um[case.design.pose == number] ** 2)) > 10            # three times the re-seating
    test = bad_visits(posterior(LoadTest.of(*read(case, tmp_path))))
    assert [score.name for score in test.bad] == [f"P{number}"]


# Long: `diagnose` names a pose at which one reading is off below (CS1730), and leaves it out as the fit does above.
@pytest.mark.long
def test_diagnose_names_the_pose_and_judges_the_rest(tmp_path: Path) -> None:
    """Of twelve poses, each with every other row."""
    case = simulate(71007, "ladder12", noise=SHEET)
    cell, measurements = read(case, tmp_path, wrong_angle("P5", 5, other_sign))
    diagnosis = diagnose(cell, measurements.select(np.arange(len(measurements)) % 21 % 2 == 0), replicates=39)
    assert diagnosis.verdict == "named"
    cause, = diagnosis.as_dict()["causes"]
    assert cause["effect"] == "bad_visit"
    assert cause["parameters"]["pose"]["estimate"] == "P5"
    assert "CS1730" in codes(diagnosis)
    assert any("P5" in line for line in diagnosis.lines())
    assert len(diagnosis.judgement.rows) == 11 * 11
    assert diagnosis.extended().fit["rows"] == 11 * 11


def in_rows(pose: str, change: Callable[[list[dict[str, str]]], None]) -> Edit:
    """A slip in single rows of one pose, by hand."""
    def edit(file: Path) -> None:
        rows = table(file)
        change([row for row in rows if row["pose"] == pose])
        file.write_text("\n".join([",".join(rows[0]), *(",".join(row.values()) for row in rows)]) + "\n")

    return edit


def a_reading_skipped(rows: list[dict[str, str]]) -> None:
    """From the fourteenth row on; the last one stands twice."""
    for row, after in pairwise(rows[13:]):
        row.update({name: after[name] for name in ("dx_um", "dy_um", "dz_um")})


def loads_halved(rows: list[dict[str, str]]) -> None:
    for row in rows:
        row.update({name: f"{float(row[name]) / 2:g}" for name in ("fx_n", "fy_n", "fz_n")})


def a_turn_lost(rows: list[dict[str, str]]) -> None:
    for row in rows:
        moved = float(row["dy_um"])
        row["dy_um"] = f"{np.sign(moved) * (abs(moved) % 100):.1f}"


Slip = Callable[[list[dict[str, str]]], None]
A_ROW_TOO_HIGH = r"its readings a row too high from line \d+ on: put back they would fit"
TWICE = "its loads twice as large would fit"
TURNS = "dy with the whole turns of 100 um that were not counted would fit"


def check_slipped(bad: BadVisit, said: str) -> None:
    assert bad.score.name == "P4"
    assert bad.score.p_value <= 0.005
    assert re.fullmatch(said, bad.mends[0].what)
    assert bad.mends[0].probability > 0.9


@pytest.mark.parametrize(("slip", "said"), [
    pytest.param(loads_halved, TWICE, marks=pytest.mark.long), (a_turn_lost, TURNS)])
def test_a_slip_in_all_rows_of_a_pose_is_found(slip: Slip, said: str, tmp_path: Path) -> None:
    cell, rows = read(simulate(71010, "ladder12", noise=SHEET), tmp_path, in_rows("P4", slip))
    bad, = fit_stiffness(cell, rows.select(rows.visit < 7)).bad_visits
    check_slipped(bad, said)


# Long: slips in all rows the fit finds too; readings that slipped by a row crowd their visit
# (tests/identification/diagnosis/test_laws_gross.py) and are among the slips that are tried (test_laws_slips.py).
@pytest.mark.long
@pytest.mark.parametrize(("slip", "said"), [(a_reading_skipped, A_ROW_TOO_HIGH), (loads_halved, TWICE), (a_turn_lost, TURNS)])
def test_a_slip_in_the_rows_of_a_pose_is_no_cause(slip: Slip, said: str, tmp_path: Path) -> None:
    """A part of a visit that slipped leaves the response of its other rows as it is."""
    found = diagnose(*read(simulate(71010, "ladder12", noise=SHEET), tmp_path, in_rows("P4", slip)), replicates=39)
    bad, = found.judgement.bad_visits
    check_slipped(bad, said)
    assert found.causes == ()


def test_one_reading_off_at_a_pose_may_be_the_sensor_or_the_table(tmp_path: Path) -> None:
    """They cannot be told apart: the sensor is named, and the slip that would explain the reading too is said."""
    case = simulate(71007, "poses20", noise=SHEET)
    right = next(f"{angle:.9g}" for angle, label in zip(np.degrees(case.theta[:, 4]), case.pose, strict=True) if label == "P5")
    diagnosis = diagnose(*read(case, tmp_path, wrong_angle("P5", 5, other_sign)), replicates=39)
    assert diagnosis.verdict == "named"
    finding, = [finding for finding in diagnosis.findings if finding.code == "CS1730"]
    assert "P5" in finding.message
    assert right in finding.hint


def test_a_wrong_angle_where_few_were_read_is_the_pose_s(tmp_path: Path) -> None:
    """None of the five readings alone is to blame: without any of them the other four still do not fit."""
    data = LoadTest.of(*read(simulate(71003, "ladder12", noise=SHEET), tmp_path, wrong_angle("P7", 5, other_sign)))
    visit = data.rows.visit
    few = data.with_rows(data.rows.select(np.array([np.sum(visit[:row] == visit[row]) < 5 for row in range(len(visit))])))
    bad, = bad_visits(posterior(few)).bad
    assert (bad.name, len(bad.rows)) == ("P7", 5)


@pytest.mark.parametrize("tails", [None, 4])
def test_nothing_wrong_leaves_nothing_out(tails: int | None, tmp_path: Path) -> None:
    noise = replace(SHEET, degrees_of_freedom=tails)
    for seed in range(71010, 71013):
        case = simulate(seed, "poses20", noise=noise)
        assert not bad_visits(posterior(LoadTest.of(*read(case, tmp_path)))).bad


def test_the_same_slip_at_many_poses_is_one_mistake(tmp_path: Path) -> None:
    case = simulate(71020, "poses20", noise=SHEET)
    turned = [wrong_angle(f"P{number}", 5, other_sign) for number in range(1, 12)]
    cell, rows = read(case, tmp_path, *turned)
    with pytest.raises(CompstiffError, match="q5 seems to have the other sign in rows 1 to 11"):
        fit_stiffness(cell, rows)


def test_every_slip_of_the_pen_can_be_taken_back() -> None:
    rng = np.random.default_rng(71021)
    for angle in rng.uniform(-179, 179, 300):
        right = f"{angle:.4f}".rstrip("0")
        wrong, _ = mistaken_pose(right, rng)
        # Zeros in front are not seen any more when the number has been read.
        if not re.match(r"-?0\d", wrong):
            shown = f"{float(wrong):.9g}"
            assert float(right) in [float(other) for _, other in slips_of_pen(shown)], (right, wrong)


def test_an_outlier_among_the_validation_rows_is_named(tmp_path: Path) -> None:
    case = simulate(71030, "poses20", noise=SHEET, validation=4)

    def ten_times(file: Path) -> None:
        lines = file.read_text().splitlines()
        cells = lines[-2].split(",")
        cells[9:12] = [str(10 * float(value)) for value in cells[9:12]]
        lines[-2] = ",".join(cells)
        file.write_text("\n".join(lines) + "\n")

    cell, measurements = read(case, tmp_path, ten_times)
    fit = fit_stiffness(cell, measurements)
    clean = fit_stiffness(*read(case, tmp_path))
    assert clean.held_out is not None
    assert clean.validation is not None
    assert fit.validation is not None
    assert not len(clean.validation.numbers)
    assert fit.validation.numbers.tolist() == [int(measurements.row[-2])]
    assert fit.validation.rms > 10 * clean.held_out[1]
    assert fit.validation.rms_without < 1.3 * clean.held_out[1]
    assert [finding.line for finding in fit.findings if finding.code == "CS1732"] == [int(measurements.line[-2])]
    assert "CS1732" in codes(diagnose(cell, measurements))
    assert "CS1732" not in codes(clean)


def test_a_pose_of_the_validation_rows_is_named(tmp_path: Path) -> None:
    case = simulate(71031, "poses20", noise=SHEET, validation=4)
    fit = fit_stiffness(*read(case, tmp_path, wrong_angle("P22", 5, other_sign)))
    assert fit.validation is not None
    assert [bad.score.name for bad in fit.validation.visits] == ["P22"]
    (said,) = [finding for finding in fit.findings if finding.code == "CS1733"]
    whole, without = (1e6 * np.sqrt(np.nanmean(fit.residual[kept] ** 2)) for kept in (
        fit.measurements.validate, fit.measurements.validate & (fit.measurements.pose != "P22")))
    assert (said.level, said.line) == ("warning", int(fit.measurements.line[fit.measurements.pose == "P22"][0]))
    assert said.message.startswith("validation: the three readings of P22 do not fit any stiffness that fits the other poses")
    assert said.message.endswith(f"; the validation figure is {whole:.1f} um RMS with all rows, {without:.1f} um without the "
                                 "outliers")
    assert "axis 5 is " in said.hint


@pytest.mark.parametrize("wrong", [0, 1, 2, 4])
def test_validation_rows_that_the_stiffnesses_do_not_predict_are_said(wrong: int, tmp_path: Path) -> None:
    """Of four poses one is a slip, two are more than a third: the figure was given with them, and not a word. Where all are
    off none stands out from the others either."""
    case = simulate(71031, "poses20", noise=SHEET, validation=4)
    fit = fit_stiffness(*read(case, tmp_path, *(wrong_angle(f"P{22 + number % 3}" if number < 3 else "P21", 5, other_sign)
                                                for number in range(wrong))))
    said = [finding for finding in fit.findings if finding.code in ("CS1732", "CS1733", "CS1737")]
    assert [finding.code for finding in said] == ([] if not wrong else ["CS1733"] if wrong == 1 else ["CS1737"])
    kept = fit.measurements.validate
    assert fit.validation is not None
    assert fit.validation.expected == pytest.approx(rms_of_noise_and_springs(fit), rel=0.3)
    if wrong > 1:
        assert said[0].level == "warning"
        assert said[0].message == (
            f"{3 * wrong} of 12 validation rows are off by more than chance allows, too many to be single mistakes: "
            f"{1e6 * np.sqrt(np.nanmean(fit.residual[kept] ** 2)):.1f} um RMS over all of them, where their uncertainty "
            f"expects {1e6 * fit.validation.expected:.1f} um")


def rms_of_noise_and_springs(fit: Fit) -> float:
    """How far off readings are expected to be that scatter as the sheet says, each pose re-seated anew, with springs known as
    well as that [m]; forces' own errors, smaller here, left out."""
    rows = fit.measurements.select(fit.measurements.validate)
    slope = regressor(fit.cell.robot, rows.theta, fit.cell.flange_from_tcp, rows.wrench)[:, :3] / fit.model.stiffness
    springs = np.einsum("nij,jk,nik->ni", slope, fit.model.covariance[:6, :6], slope)
    return float(np.sqrt(1e-12 * (SHEET.sensor_um**2 + SHEET.pose_offset_um**2) + springs.mean()))


@pytest.mark.parametrize(("offset_um", "said"), [(3.0, False), (25.0, True)])
def test_a_zero_that_moves_between_poses_is_said(offset_um: float, said: bool, tmp_path: Path) -> None:
    case = simulate(71040, "ladder12", noise=replace(SHEET, pose_offset_um=offset_um))
    cell, measurements = read(case, tmp_path)
    assert ("CS1734" in codes(fit_stiffness(cell, measurements))) == said


def test_a_visit_s_response_is_that_to_its_forces_whatever_their_moments(tmp_path: Path) -> None:
    """Loads along one line whose lever differs: the visit has a response along that line, and no further direction."""
    cell, rows = read(simulate(71040, "ladder12", noise=SHEET), tmp_path)
    wrench = np.zeros_like(rows.wrench)
    wrench[:, 2] = np.where(rows.wrench.any(axis=1), np.linalg.norm(rows.wrench[:, :3], axis=1), 0.0)
    wrench[:, 3:] = np.random.default_rng(1).normal(0, 40, (len(rows), 3))
    seen: list[int] = []

    def of(force: NDArray[np.float64]) -> LoadColumns:
        seen.append(force.shape[1])
        return LoadColumns.of(force)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(visits, "LoadColumns", SimpleNamespace(of=of))
        data = LoadTest.of(cell, replace(rows, wrench=wrench))
        score_visits(posterior(data), data, np.random.default_rng(0), 20)
    assert set(seen) == {3}


def reseated(off: np.ndarray, ratio: float, stated: bool) -> Any:
    """A fit of four visits, off by (4, 3) [m] each, whose re-seating was put at `ratio` times 4 um."""
    rows = SimpleNamespace(machined_pass=np.full(8, ""), source="m.csv", pose=np.repeat(["A", "B", "", "D"], 2),
                           line=np.arange(2, 10))
    noise = SimpleNamespace(visit=np.repeat(np.arange(4), 2), measured=np.ones((8, 3), dtype=bool),
                            offset=np.full((4, 3), 4e-6))
    return SimpleNamespace(
        at_map=SimpleNamespace(noise=noise, residual=None), components=SimpleNamespace(offset=ratio),
        components_log_std=np.full(9, 0.5), weights=SimpleNamespace(offsets=lambda residual: off),
        data=SimpleNamespace(rows=rows, cell=SimpleNamespace(noise=SimpleNamespace(offset_stated=stated))))


OFF = np.array([[0, 9e-6, 12e-6], [2e-6, 0, 0], [0, 0, -40e-6], [20e-6, 0, 0]])


@pytest.mark.parametrize(("stated", "usual"), [(True, 2.0), (False, 3.0)])
@pytest.mark.parametrize(("chance", "said"), [(0.06, False), (0.04, True)])
def test_the_zero_is_said_to_move_where_chance_does_so_in_one_of_twenty(
    stated: bool, usual: float, chance: float, said: bool,
) -> None:
    """By the normal distribution of the logarithm of how far it moves, in units of what was stated, or of what is usual. The
    visits that are farthest off are told in their order, three at most."""
    ratio = usual * np.exp(stats.norm.isf(chance) * 0.5)
    told = moving_zero(reseated(OFF, ratio, stated))
    assert len(told) == said
    if said:
        assert "farthest the pose from line 6 by 40 um, D by 20 um, A by 15 um" in told[0].message
        assert f"{4 * ratio:.2g} um, {ratio:.1f} times the 4 um" in told[0].message


def test_the_zero_is_not_said_to_move_by_more_than_any_pose_is_off() -> None:
    """A table with a mistake makes re-seating large, and no pose is off by as much."""
    (told,) = moving_zero(reseated(10 * OFF, 30.0, False))
    assert "by 120 um, 30.0 times the 4 um" in told.message
    assert moving_zero(reseated(OFF, 30.0, False)) == []


# Long: the same once more, and as many as are still looked for, which takes longest.
@pytest.mark.parametrize(("count", "seed"), [
    pytest.param(4, 71033, marks=pytest.mark.long), (5, 71033), pytest.param(5, 71037, marks=pytest.mark.long)])
def test_more_than_a_third_of_the_poses_are_no_single_mistakes(count: int, seed: int, tmp_path: Path) -> None:
    """Five of twelve, each off by 8 to 25 degrees: none is left out, and it is said that they are too many; four are found."""
    case = simulate(71032, "ladder12", noise=SHEET)
    rng = np.random.default_rng(seed)
    wrong = rng.choice(list(dict.fromkeys(case.pose)), count, replace=False)
    off = rng.choice([-1, 1], count) * rng.uniform(8, 25, count)

    def turned(by: float) -> Callable[[str], str]:
        return lambda text: f"{float(text) + by:.4f}"

    edits = [wrong_angle(pose, int(rng.integers(2, 5)), turned(by)) for pose, by in zip(wrong, off, strict=True)]
    test = bad_visits(posterior(LoadTest.of(*read(case, tmp_path, *edits))))
    too_many = count > 12 / 3
    assert test.too_many == too_many
    assert {score.name for score in test.bad} == (set() if too_many else set(wrong))
    said = visit_findings(test, (), "measurements.csv", "left out")
    assert [finding.code for finding in said] == ["CS1731"] * too_many

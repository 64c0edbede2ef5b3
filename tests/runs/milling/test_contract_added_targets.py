"""Added targets are accounted for: logs that number the corrected program's targets, offsets that are pushed without them."""

from __future__ import annotations

import csv
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from compensator.correction.correct import correct
from compensator.correction.files import Inputs, predict_files
from compensator.correction.pass_offsets import offsets_of_pass
from compensator.correction.waiting import Waiting, told
from compensator.learning.measured_points import read_points
from compensator.learning.path_places import place_points
from identification.common.added_targets import read_added
from identification.common.findings import Refused
from identification.model.cell import read_cell
from tests.runs.command_line import user_files as kit
from tests.runs.milling.milling_job import Correction, MillingJob, rms, settings
from tests.virtual_cell import milling
from tests.virtual_cell.milled_part import slot_and_pocket


@pytest.fixture(scope="module")
def job(tmp_path_factory: pytest.TempPathFactory) -> MillingJob:
    return MillingJob(tmp_path_factory.mktemp("added"), 11, design="poses20", part=slot_and_pocket(1.0, 0.8))


@pytest.fixture(scope="module")
def found(job: MillingJob) -> Correction:
    job.identify()
    return job.correct(job.log(job.first, job.planned, "pass1.csv"), job.folder / "stiffness.json")


@pytest.fixture(scope="module")
def offsets(job: MillingJob, found: Correction) -> Path:
    return job.offsets(found, "offsets.csv")


@pytest.fixture(scope="module")
def second(job: MillingJob, found: Correction) -> milling.Pass:
    return job.mill(found.commands, part=found.part)


def nearest_numbers(job: MillingJob, second: milling.Pass, found: Correction) -> str:
    """The log of the corrected pass, each sample with the number of the nearer of the two targets that it is between."""
    log = milling.log_of(second, found.part, found.commands, job.cutter, job.sensor, np.random.default_rng([job.seed, 77]))
    before = np.maximum(log.target - 1, 0)
    apart = [np.linalg.norm(log.position_mm - found.commands.position_mm[number], axis=1) for number in (before, log.target)]
    return milling.Log(log.time_s, log.force_n, log.position_mm, np.where(apart[0] < apart[1], before, log.target)).csv(
        by_target=True)


def forces(job: MillingJob, log: Path, offsets: Path | None, cell: Path | None = None) -> tuple[np.ndarray, list[str]]:
    """The forces at the targets of the planned program, and the codes of what was said."""
    inputs = Inputs(cell or job.cell, job.program, job.folder / "stiffness.json", log)
    predicted = predict_files(inputs, settings(logged_with=offsets))
    return predicted.forces.wrench[:, :3], [finding.code for finding in predicted.findings]


def test_the_column_says_where_the_written_targets_stand(job: MillingJob, found: Correction, offsets: Path) -> None:
    """By the written program's own planned places: along the planned path, in its order and numbers."""
    added = read_added(offsets)
    assert added is not None
    assert len(found.part.target_mm) > len(job.part.target_mm) + 10
    own = np.linalg.norm(np.diff(job.part.target_mm, axis=0, prepend=job.part.target_mm[:1]), axis=1).cumsum()
    written = np.linalg.norm(np.diff(found.part.target_mm, axis=0, prepend=found.part.target_mm[:1]), axis=1).cumsum()
    assert np.allclose(added.place(own), written, atol=2e-3)
    assert np.allclose(found.part.target_mm[added.number], job.part.target_mm, atol=1e-9)
    assert np.allclose(job.part.target_mm[:added.first], found.part.target_mm[:added.first], atol=1e-9)
    assert not np.allclose(job.part.target_mm[added.first], found.part.target_mm[added.first], atol=1e-3)


def test_each_added_target_has_its_sigma(found: Correction, offsets: Path) -> None:
    """Each in its place among those of the program as given, as the correction states them."""
    rows = list(csv.DictReader(offsets.read_text().splitlines()))
    written = [float(word) for row in rows for word in (*row["added_left_um"].split(), row["left_um"] or "0")]
    assert len(written) == len(found.left_um) > len(rows) + 10
    kept = [row["left_um"] != "" for row in rows for _ in (*row["added"].split(), "")]
    assert np.allclose(np.array(written)[kept], found.left_um[kept], atol=1e-3)
    assert np.count_nonzero(found.left_um) > len(rows) / 2


@pytest.mark.parametrize("ahead", [pytest.param(False, marks=pytest.mark.long), True])
def test_a_log_by_the_corrected_programs_numbers_is_that_log(
    job: MillingJob, found: Correction, offsets: Path, second: milling.Pass, ahead: bool
) -> None:
    """The forces that the same pass shows where its log has positions; taken for the planned program's numbers they are other
    targets' by up to as many as were added."""
    by_place, _ = forces(job, job.log(second, found.commands, "place.csv", part=found.part), offsets)
    log = job.folder / f"numbers_{ahead}.csv"
    text = milling.log_of(second, found.part, found.commands, job.cutter, job.sensor, np.random.default_rng([
        job.seed, 77])).csv(by_target=True) if ahead else nearest_numbers(job, second, found)
    log.write_text(text)
    cell = job.cell_ahead() if ahead else job.cell
    by_number, codes = forces(job, log, offsets, cell)
    assert "CS4127" in codes
    off, size = (np.linalg.norm(each, axis=1) for each in (by_number - by_place, by_place))
    assert rms(off) < 0.05 * rms(size)
    # What the numbers would say of the planned program.
    rows = np.loadtxt(log, delimiter=",", skiprows=1)
    kept = rows[rows[:, 1] < len(job.part.target_mm)]
    log.write_text(text.splitlines()[0] + "\n" + "\n".join(",".join(f"{v:.9g}" for v in row) for row in kept) + "\n")
    shifted, codes = forces(job, log, None, cell)
    assert rms(np.linalg.norm(shifted - by_place, axis=1)) > 4 * rms(off)
    # Cut off there it is a log of the planned program with the offsets pushed, as far as anybody can tell.
    assert "CS4127" not in forces(job, log, offsets, cell)[1]


def test_a_log_that_ends_before_the_numbers_tell_is_refused(
    job: MillingJob, found: Correction, offsets: Path, second: milling.Pass
) -> None:
    lines = nearest_numbers(job, second, found).splitlines()
    number = np.array([int(line.split(",")[1]) for line in lines[1:]])
    short = job.folder / "short.csv"
    short.write_text("\n".join([lines[0], *np.array(lines[1:])[number < len(job.part.target_mm) - 1]]) + "\n")
    with pytest.raises(Refused) as refused:
        forces(job, short, offsets)
    (finding,) = [finding for finding in refused.value.findings if finding.level == "error"]
    assert finding.code == "CS4128"
    assert f"from target {read_added(offsets).first} on" in finding.message
    # Nothing is in doubt before the first that was added; of these the last would be a cut begun, which tells no air.
    begun = job.folder / "begun.csv"
    begun.write_text("\n".join([lines[0], *np.array(lines[1:])[number < read_added(offsets).first - 1]]) + "\n")
    assert "CS4127" not in forces(job, begun, offsets)[1]


def test_shares_that_are_none(job: MillingJob, offsets: Path) -> None:
    rows = offsets.read_text().splitlines()
    wrong = job.folder / "wrong.csv"
    for words in ("0.5 0.25,", "1.5,", "half,", "0.5,", "0.5,0 0", "0.5,0 0 none"):
        wrong.write_text("\n".join([*rows[:-1], ",".join([*rows[-1].split(",")[:-2], words])]) + "\n")
        answer = kit.run("correct", job.cell, job.program, "--stiffness", job.folder / "stiffness.json", "--forces",
                         job.folder / "pass1.csv", "--tare", "0:2", "--logged-with", wrong, "-o", job.folder / "no.mod")
        assert answer.code == 1
        assert "CS4121" in answer.err
        assert not (job.folder / "no.mod").exists()


def test_a_target_left_without_force_is_not_said_to_be_on_the_plan(offsets: Path) -> None:
    """Where the tool leaves, added targets take the force that was logged beside the program's own: it is pushed off, not
    corrected, and nobody knows what is left there."""
    rows = [row for row in kit.table(offsets) if float(row["dx_um"] or 0) and not float(row["left_um"] or 0)]
    assert rows
    assert {(row["left_um"], row["cut_um"], row["note"]) for row in rows} == {("", "", "no force right at it: not corrected")}


def test_push_says_what_it_does_not_send(job: MillingJob, found: Correction, offsets: Path, tmp_path: Path) -> None:
    """A note with the moves and how far the offsets of the added targets are off those that are sent, by a reader of its own; a
    warning where they are many; nothing where no target was added."""
    lines = offsets.read_text().splitlines()
    names, rows = lines[0].split(","), [line.split(",") for line in lines[1:]]
    offset = np.array([[float(row[names.index(f"o{axis}_mm")] or 0) for axis in "xyz"] for row in rows])
    moves = np.array([k for k, row in enumerate(rows) if row[names.index("added")].strip('"')])
    apart = []
    for k in moves:
        share, own = (np.array(rows[k][names.index(name)].strip('"').split(), dtype=float) for name in ("added", "added_mm"))
        straight = offset[k - 1] + share[:, None] * (offset[k] - offset[k - 1])
        apart.append(1e3 * np.linalg.norm(own.reshape(-1, 3) - straight, axis=1).max())
    answer = kit.run("push", job.cell, offsets, "--program", job.program, "--json")
    (said,) = [one for one in answer.json["findings"] if one["code"] == "CS5008"]
    ends = np.any(offset != 0, axis=1)
    corrected = len(set(moves) | set(np.flatnonzero(ends)) | set(np.flatnonzero(ends[:-1]) + 1))
    assert said["message"].startswith(f"in {len(moves)} of {corrected} moves from or to a corrected target")
    assert f"up to about {max(apart):.0f} um at the worst, {np.median(apart):.0f} um in the middle" in said["message"]
    assert said["level"] == ("warning" if len(moves) > corrected / 4 else "note")
    few = tmp_path / "few.csv"
    left = set(moves[:2].tolist())
    few.write_text("\n".join([lines[0], *(",".join([*row[:-3], *(row[-3:] if k in left else ('""', '""', '""'))])
                                          for k, row in enumerate(rows))]) + "\n")
    assert names[-3:] == ["added", "added_mm", "added_left_um"]
    (said,) = [one for one in kit.run("push", job.cell, few, "--program", job.program, "--json").json["findings"]
               if one["code"] == "CS5008"]
    assert (said["level"], said["message"].split(" of")[0]) == ("note", "in 2")
    none = job.correct(job.folder / "pass1.csv", job.folder / "stiffness.json", settings(keep_targets=True))
    assert "CS5008" not in kit.run("push", job.cell, job.offsets(none, "kept.csv"), "--program", job.program, "--json").out


def test_the_column_has_the_offsets_of_the_added_targets(found: Correction, offsets: Path) -> None:
    """Where the written program sends the tool, less the plan: by its own text."""
    written, number = 0, []
    for row in kit.table(offsets):
        own = np.array(row["added_mm"].split(), dtype=float).reshape(-1, 3)
        sent = (found.commands.position_mm - found.part.target_mm)[written:written + len(row["added"].split())]
        assert own.shape == sent.shape
        assert np.abs(own - sent).max(initial=0.0) < 3e-4
        number += range(written, written + len(own))
        written += len(own) + 1
    assert written == len(found.part.target_mm)
    assert np.linalg.norm((found.commands.position_mm - found.part.target_mm)[number], axis=1).max() > 0.1


def test_the_tool_of_a_corrected_pass_stood_on_the_plan_between_the_targets_too(tmp_path: Path) -> None:
    """Of a slot with a target at either end and next to nothing between the offsets are in added targets. Where these are not
    known, as in a file without their columns, the tool is taken to have stood aside by what was corrected already."""
    job = MillingJob(tmp_path, 12, design="poses20", part=slot_and_pocket(200.0, pocket=False))
    springs = job.springs("springs.json", job.case.plant.stiffness)
    found = job.correct(job.log(job.first, job.planned, "pass1.csv"), springs)
    offsets, old = job.offsets(found, "offsets.csv"), tmp_path / "old.csv"
    old.write_text(offsets.read_text().replace("added_mm", "x_added_mm"))
    log = job.log(job.mill(found.commands, part=found.part), found.commands, "pass2.csv", part=found.part)

    def stood(file: Path) -> tuple[float, list[str]]:
        again = correct(predict_files(Inputs(job.cell, job.program, springs, log), settings(logged_with=file)))
        which = np.setdiff1d(again.predicted.targets, again.kept)
        position = np.zeros((len(again.predicted.path.toolpath), 3))
        position[again.predicted.targets] = again.predicted.prediction.position
        sent = again.logged.offsets.over(again.predicted.path, again.kept)
        return rms(1e6 * np.linalg.norm((position + sent)[which], axis=1)), [finding.code for finding in again.findings]

    (aside, codes), (unknown, of_old) = stood(offsets), stood(old)
    assert unknown > 40
    assert aside < 0.15 * unknown
    assert "CS4130" not in codes
    assert "CS4130" in of_old


@pytest.mark.parametrize(("given", "both"), [(21, False), (40, True)])
def test_a_program_of_few_targets_is_not_told_to_name_both_logs(found: Correction, given: int, both: bool) -> None:
    """A pair of passes asks for forty; the call that is advised must not end in an error."""
    (finding,) = told(Waiting(found.job.predicted.targets[:1], np.array([1e-4]), np.array([2e-5])), found.job.predicted, given)
    assert "--logged-with" in finding.hint
    assert ("--first-forces" in finding.hint) == both


def test_a_limit_that_is_passed_is_told_with_what_the_log_says_of_its_pass(
    job: MillingJob, found: Correction, second: milling.Pass
) -> None:
    """The log of a corrected pass without its offsets: its positions say so, and why the correction is too large."""
    log = job.log(second, found.commands, "forgotten.csv", part=found.part)
    tight = job.cell.with_name("tight.yaml")
    tight.write_text(job.cell.read_text() + "limits: {max_offset_mm: 0.02}\n")
    planned = predict_files(Inputs(tight, job.program, job.folder / "stiffness.json", log), settings())
    with pytest.raises(Refused) as refused:
        correct(planned)
    assert {"CS4107", "CS3075"} <= {finding.code for finding in refused.value.findings}


def test_offsets_that_were_pushed_to_the_planned_program_are_taken_for_those(
    job: MillingJob, found: Correction, offsets: Path
) -> None:
    """Positions tell which of the two programs was driven: the added targets have offsets in one of them alone."""
    at = found.job.kept
    own = found.commands.position_mm[at] - found.part.target_mm[at]
    pushed = replace(job.planned, position_mm=job.planned.position_mm + own)
    by_push = job.log(job.mill(pushed), pushed, "pushed.csv")
    by_program = job.log(job.mill(found.commands, part=found.part), found.commands, "written.csv", part=found.part)
    taken = []
    for log in (by_push, by_program):
        inputs = Inputs(job.cell, job.program, job.folder / "stiffness.json", log)
        taken.append(len(offsets_of_pass(offsets, predict_files(inputs, settings(logged_with=offsets))).before))
    assert taken[0] == 0
    assert taken[1] > 0


def measured(folder: Path, name: str, number: np.ndarray, off_um: np.ndarray) -> Path:
    """Readings across the wall by target number."""
    file = folder / name
    rows = [f"{int(target)},0,{value:.3f},0,1,1,1" for target, value in zip(number, off_um, strict=True)]
    file.write_text("\n".join(["target,dx_um,dy_um,dz_um,sx_um,sy_um,sz_um", *rows]) + "\n")
    return file


def test_readings_by_the_corrected_programs_numbers(job: MillingJob, offsets: Path, tmp_path: Path) -> None:
    """A deviation that changes from place to place, measured before by the planned program's numbers and, a tenth of it, after
    by the corrected one's: place by place a tenth is left."""
    added = read_added(offsets)
    planned = np.arange(len(job.part.target_mm))
    off = np.random.default_rng(3).uniform(-90, 90, len(planned))
    before = measured(tmp_path, "before.csv", planned, off)
    at_all = np.interp(np.arange(len(added.given)), added.number, 0.1 * off)
    after = measured(tmp_path, "after.csv", np.arange(len(added.given)), at_all)
    answer = kit.run("verify", job.cell, before, after, "--predicted", offsets, "--json")
    assert "CS6037" in kit.codes(answer)
    result = answer.json["result"]
    assert (result["worse_points"], result["unpaired_before"]) == (0, 0)
    assert result["after"]["points"] == len(planned)
    # Nothing tells the numbers of a part of it.
    part = slice(added.first + 5, added.first + 60)
    some = measured(tmp_path, "some.csv", planned[part], 0.1 * off[part])
    answer = kit.run("verify", job.cell, before, some, "--predicted", offsets, "--json")
    assert "CS6038" in kit.codes(answer)
    assert answer.json["result"]["worse_points"] == 0


def test_points_that_name_targets_by_either_numbers(job: MillingJob, found: Correction, offsets: Path) -> None:
    """Points of the last wall, at the targets, named as each program numbers them: at the same places on the path."""
    inputs = Inputs(job.cell, job.program, job.folder / "stiffness.json", job.folder / "pass1.csv")
    predicted = predict_files(inputs, settings(logged_with=offsets))
    added = read_added(offsets)
    own = predicted.targets[-60:-10]
    places, codes = [], []
    for number in (own, added.number[own]):
        file = job.folder / "points.csv"
        rows = [f"{x:.4f},{y:.4f},{z:.4f},5,{k}" for (x, y, z), k in zip(job.part.target_mm[own], number, strict=True)]
        file.write_text("\n".join(["x_mm,y_mm,z_mm,dx_um,target", *rows]) + "\n")
        placed = place_points(read_points(file, read_cell(job.cell)), predicted, 0.0, 1e-3)
        places.append(placed.length)
        codes.append([finding.code for finding in placed.findings])
    assert np.allclose(*places, atol=1e-5)
    assert np.allclose(places[0], predicted.path.length[own], atol=1e-5)
    assert ["CS5326" in each for each in codes] == [False, True]

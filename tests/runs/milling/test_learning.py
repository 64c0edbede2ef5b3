"""A second part gets better by the first: a cell with a kinematic error, warming and springs softer in motion, milled in the
virtual cell, measured, learned by the command line, corrected with what was learned and milled again. benchmarks/learning.py
has more."""

from __future__ import annotations

import json
from functools import partial
from pathlib import Path

import numpy as np
import pytest

import compstiff
from compensator.correction.expected_left import CAUSES
from compensator.learning.long_moves import said_of_long_moves
from compensator.learning.measured_points import read_points
from compensator.learning.normals_alone import said_of_normals
from compensator.learning.path_places import place_points
from compensator.learning.rows import rows_of
from tests.runs.command_line import user_files as kit
from tests.runs.milling.learning_job import MOTION, Both, ErringJob, corrected, mirrored, off_um
from tests.runs.milling.milling_job import Correction, MillingJob, rms, settings
from tests.virtual_cell.milled_part import slot_and_pocket
from tests.virtual_cell.milling import Commands


@pytest.fixture(scope="module")
def both(tmp_path_factory: pytest.TempPathFactory) -> Both:
    return Both(tmp_path_factory.mktemp("learn") / "cell", 1, slot_and_pocket(),
                slot_and_pocket(allowance_mm=0.7, wall_depth_mm=8.0), job_of=partial(ErringJob, design="poses20"))


@pytest.fixture(scope="module")
def job(both: Both) -> ErringJob:
    return both.first


@pytest.fixture(scope="module")
def stiffness(job: ErringJob) -> Path:
    return job.identify()


@pytest.fixture(scope="module")
def log(job: ErringJob) -> Path:
    return job.log(job.first, job.planned, "pass1.csv")


@pytest.fixture(scope="module")
def plain(job: ErringJob, stiffness: Path, log: Path) -> tuple[Correction, float, float]:
    """The part corrected without what was learned, and what is left before and after."""
    found = corrected(job, log, stiffness)
    return (found, *left_um(job, found))


@pytest.fixture(scope="module")
def learned(job: ErringJob, stiffness: Path, log: Path) -> Path:
    """By the command line, with its report."""
    output, points = job.folder / "part_learned.json", job.measure(job.first, "points.csv")
    done = kit.run("learn", job.cell, job.program, points, "--stiffness", stiffness, "--forces", log, "--tare", "0:2", "-o",
                   output, "--report", job.folder / "learn.html")
    assert done.code == 0, done
    return output


def figures(learned: Path) -> dict:
    return json.loads(learned.read_text())["told"]["figures"]


def left_um(job: ErringJob, given: Commands | Correction) -> tuple[float, float]:
    """RMS off plan before and after [um]."""
    part = given.part if isinstance(given, Correction) else job.part
    first = job.first_with(part)
    done = job.mill(given.commands if isinstance(given, Correction) else given, part=part)
    return rms(off_um(done, first)), rms(off_um(first, done))


def test_it_learns_the_truth(learned: Path) -> None:
    """The springs in motion within three of the standard errors stated, and the stated noise of the machine."""
    found = figures(learned)
    motion = found["motion"]
    assert abs(motion["scale"] - MOTION) < 3 * np.hypot(motion["std"], 0.01)
    assert motion["std"] < 0.02
    assert 0.7 < found["noise"]["factor"] < 1.5
    assert found["remainder"] is not None
    assert found["held_out"]["learned_um"] < 0.3 * found["held_out"]["known_um"]
    gone = list(found["gone"].values())
    assert gone[0] < 0.75
    assert gone[-1] > 0.9


def test_the_second_part_is_better_than_a_mirrored_one(
    job: ErringJob, stiffness: Path, log: Path, learned: Path, plain: tuple[Correction, float, float]
) -> None:
    _, before, unlearned = plain
    _, nothing = left_um(job, corrected(job, log, stiffness, learned))
    _, setup = left_um(job, corrected(job, log, stiffness, learned, "setup"))
    _, again = left_um(job, corrected(job, log, stiffness, learned, "job"))
    _, mirror = left_um(job, mirrored(job, job.first, 3.0))
    assert unlearned > 0.3 * before
    assert again < setup < nothing < unlearned
    assert again < 0.1 * before
    assert again < mirror


# Long: the second part does above, and the springs in motion are what carries over to another: they are learned in
# test_it_learns_the_truth; benchmarks/learning.py has more parts.
@pytest.mark.long
def test_another_part_gets_better_too(both: Both, stiffness: Path, learned: Path) -> None:
    other = both.other
    log = other.log(other.first, other.planned, "pass1.csv")
    _, unlearned = left_um(other, corrected(other, log, stiffness))
    _, nothing = left_um(other, corrected(other, log, stiffness, learned))
    _, setup = left_um(other, corrected(other, log, stiffness, learned, "setup"))
    assert setup < 0.7 * unlearned
    assert nothing < 0.97 * unlearned


# Long: a log of a corrected pass without its offsets is told in test_silent_cutting.py, what the file is made of in
# tests/compensator/learning.
@pytest.mark.long
def test_a_corrected_part_teaches_with_the_offsets_it_was_milled_with(
    job: ErringJob, stiffness: Path, log: Path, tmp_path: Path, plain: tuple[Correction, float, float]
) -> None:
    """The second part, milled with the correction of the first log, measured and learned from: the same truth, and a third part
    that is better still. Without its offsets the part seems to have yielded a fifth of what the log says, and is refused."""
    found, _, left_by_two = plain
    second = job.mill(found.commands, part=found.part)
    offsets = job.offsets(found, "offsets1.csv")
    pass2 = job.log(second, found.commands, "pass2.csv", part=found.part)
    points = job.measure(second, "points2.csv", part=found.part)
    words = ("learn", job.cell, job.program, points, "--stiffness", stiffness, "--forces", pass2, "--tare", "0:2", "-o",
             tmp_path / "learned2.json")
    done = kit.run(*words, "--logged-with", offsets)
    assert done.code == 0, done
    told = figures(tmp_path / "learned2.json")
    assert abs(told["motion"]["scale"] - MOTION) < 3 * np.hypot(told["motion"]["std"], 0.01)
    assert told["parts_um"]["left"] < 5.0
    again = job.correct(pass2, stiffness, settings(logged_with=offsets, learned=tmp_path / "learned2.json", repeats="job"))
    before, left = left_um(job, again)
    assert left < 0.1 * before
    assert left < 0.25 * left_by_two
    forgotten = kit.run(*words, "--force")
    assert (forgotten.code, "CS5310" in forgotten.err, "--logged-with" in forgotten.err) == (3, True, True)
    (tmp_path / "of_another.csv").write_text("target,ox_mm,oy_mm,oz_mm\n0,0,0,0\n")
    other = kit.run(*words, "--force", "--logged-with", tmp_path / "of_another.csv")
    assert (other.code, "CS4121" in other.err) == (1, True)


# Long: that the part gets better is asked above; this says that it could be otherwise.
@pytest.mark.long
def test_the_other_sign_would_make_it_worse(
    job: ErringJob, stiffness: Path, log: Path, learned: Path, plain: tuple[Correction, float, float]
) -> None:
    """What is learned beside the springs, taken off the wrong way: so the test above can fail."""
    content = json.loads(learned.read_text())
    content["mean"][content["springs"]:] = [-value for value in content["mean"][content["springs"]:]]
    wrong = job.folder / "wrong.json"
    wrong.write_text(json.dumps(content))
    _, _, unlearned = plain
    _, turned = left_um(job, corrected(job, log, stiffness, wrong, "job"))
    assert turned > 1.3 * unlearned


def test_what_is_stated_for_the_part_holds_there(job: ErringJob, stiffness: Path, log: Path, learned: Path) -> None:
    found = corrected(job, log, stiffness, learned, "job")
    first = job.first_with(found.part)
    done = job.mill(found.commands, part=found.part)
    cut = first.cutting
    off, left = np.linalg.norm(done.off_um, axis=1)[cut], first.steps.between(found.left_um)[cut]
    assert np.mean(off <= 2 * left) > 0.85
    stated = found.job.as_dict()["expected_left_um"]
    assert np.isclose(stated["rms"] ** 2, sum(stated[cause] ** 2 for cause in CAUSES))
    assert stated["learned"] > 0
    assert stated["sensor"] == stated["motion"] == 0


def test_where_no_part_was_measured_nothing_is_added(job: ErringJob, stiffness: Path, log: Path, learned: Path) -> None:
    """A learned file whose places stand ten of its lengths away: the springs hold, the remainder is nothing and its width
    stays."""
    content = json.loads(learned.read_text())
    far = 10 * content["remainder"]["length_mm"]
    content["remainder"]["places_mm"] = [[x - far, y, z] for x, y, z in content["remainder"]["places_mm"]]
    away = job.folder / "away.json"
    away.write_text(json.dumps(content))
    found = corrected(job, log, stiffness, away)
    width = content["remainder"]["amplitude_um"]
    count = len(found.job.planned.targets)
    assert [(one.level, one.message.partition(":")[0], f"width of {width:.0f} um stays" in one.message) for one in
            found.job.findings if one.code == "CS5323"] == [
        ("warning", f"{count} of {count} targets with force (100 %) stand where no measured part was", True)]
    assert "CS5323" not in [finding.code for finding in corrected(job, log, stiffness, learned, "job").job.findings]
    assert found.job.as_dict()["learned_um"]["largest"] < 0.01 * width
    assert found.job.as_dict()["expected_left_um"]["learned"] > 1.7 * width


# Long: such points are learned from in test_silent_points.py.
@pytest.mark.long
def test_points_of_the_surface_along_their_normal(job: ErringJob, stiffness: Path, log: Path) -> None:
    points = job.measure(job.first, "normals.csv", along_normal=True)
    learning, output = job.learn(stiffness, log, points, radius=1e-3 * job.cutter.radius_mm, within=2e-3)
    assert learning.as_dict()["points_used"] > 0.8 * learning.as_dict()["points"]
    assert learning.as_dict()["causes"]["verdict"] == "adequate"        # what errs are the kinematics, not the force
    before, after = left_um(job, corrected(job, log, stiffness, output, "job"))
    assert after < 0.45 * before


@pytest.mark.parametrize("values", ["turned", "noise"])
def test_a_deviation_that_does_not_follow_is_refused(job: ErringJob, stiffness: Path, log: Path, values: str) -> None:
    off = job.first.off_um
    wrong = -off if values == "turned" else 50 * np.random.default_rng(5).standard_normal(off.shape)
    points, output = job.measure(job.first, f"{values}.csv", values_um=wrong), job.folder / f"{values}.json"
    done = kit.run("learn", job.cell, job.program, points, "--stiffness", stiffness, "--forces", log, "--tare", "0:2", "-o",
                   output)
    assert done.code == 3
    assert "CS5310" in done.err
    assert not output.exists()


def test_a_remainder_larger_than_physics_is_refused(job: ErringJob, stiffness: Path, log: Path) -> None:
    """A bent part: 0.4 mm, over its length, of a second order that no set-up takes."""
    first = job.first
    place = first.steps.between(job.part.target_mm)
    off = first.off_um.copy()
    off[:, 2] += 400 * (np.cos(np.pi * place[:, 0] / 60) * np.cos(np.pi * place[:, 1] / 50))
    points = job.measure(first, "bent.csv", values_um=off)
    with pytest.raises(compstiff.CompstiffError) as stopped:
        job.learn(stiffness, log, points)
    assert stopped.value.findings[0].code == "CS5311"
    assert "calibration" in stopped.value.findings[0].message


def told(job: MillingJob, stiffness: Path, log: Path, points: Path) -> set[str]:
    """What is said of where the points lie and of what was read there, without learning from them."""
    cell = compstiff.read_cell(job.cell)
    program, model = compstiff.read_toolpath(job.program, cell), compstiff.read_stiffness(stiffness, cell)
    predicted, measured = compstiff.predict(cell, program, model, log, settings()), read_points(points, cell)
    placed = place_points(measured, predicted, 0.0, 1e-3)
    rows = rows_of(measured, placed, predicted)
    expected = rows.seen(predicted.prediction.position)[:, 0]
    found = [*said_of_normals(rows, rows.value, expected, predicted, ""), *said_of_long_moves(placed, predicted, "")]
    return {finding.code for finding in found}


def test_vectors_along_the_normal_alone_are_told(job: ErringJob, stiffness: Path, log: Path) -> None:
    """A probe's readings as three components: what the tool did along the feed was not felt, and stands there as nothing."""
    first = job.first
    place = first.steps.between(job.part.target_mm)
    feed = np.gradient(place, axis=0)
    feed /= np.maximum(np.linalg.norm(feed, axis=1), 1e-9)[:, None]
    felt = first.off_um - np.einsum("ni,ni->n", first.off_um, feed)[:, None] * feed
    assert told(job, stiffness, log, job.measure(first, "normals.csv", values_um=felt)) == {"CS5332"}
    assert told(job, stiffness, log, job.measure(first, "whole.csv")) == set()


def test_points_on_long_moves_are_told(tmp_path: Path) -> None:
    """A slot with a target at either end and next to nothing between."""
    plain = MillingJob(tmp_path, 3, design="poses20", part=slot_and_pocket(200.0, pocket=False))
    springs, first = plain.springs("springs.json", plain.case.plant.stiffness), plain.first
    place = first.steps.between(plain.part.target_mm)[first.cutting]
    points = tmp_path / "points.csv"
    rows = [",".join(f"{value:.5g}" for value in row) for row in np.column_stack([place, first.off_um[first.cutting]])]
    points.write_text("\n".join(["x_mm,y_mm,z_mm,dx_um,dy_um,dz_um", *rows]) + "\n")
    assert told(plain, springs, plain.log(first, plain.planned, "log.csv"), points) == {"CS5333"}


# Long: what chance teaches is held in tests/compensator/learning/test_laws_learning.py.
@pytest.mark.long
def test_noise_alone_teaches_nothing(job: ErringJob, stiffness: Path, log: Path) -> None:
    """A cell that is as its model says, measured with noise: no remainder, and the prediction stays within a micrometre."""
    plain = ErringJob(job.folder.parent.parent / "plain", 1, design="poses20", motion=1.0)
    model = plain.identify()
    forces = plain.log(plain.first, plain.planned, "log.csv")
    learning, output = plain.learn(model, forces, plain.measure(plain.first, "points.csv", 10.0))
    assert learning.as_dict()["remainder"] is None
    cell = compstiff.read_cell(plain.cell)
    program, springs = compstiff.read_toolpath(plain.program, cell), compstiff.read_stiffness(model, cell)
    one, two = (compstiff.predict(cell, program, springs, forces, settings(**chosen)).prediction.position
                for chosen in ({}, {"learned": output}))
    assert rms(1e6 * (one - two)) < 1.0


def test_what_does_not_belong_together_is_refused(job: ErringJob, stiffness: Path, log: Path, learned: Path,
                                                  tmp_path: Path) -> None:
    def codes(*options: object, program: Path = job.program, model: Path = stiffness) -> tuple[int, str]:
        done = kit.run("predict", job.cell, program, "--stiffness", model, "--forces", log, "--tare", "0:2", "-o",
                       tmp_path / "d.csv", "--force", *options)
        return done.code, done.err

    for scale in ((), ("--scale", "1")):
        code, said = codes("--learned", learned, *scale)
        assert (code, "CS5324" in said) == (0, False)
    for wanted, exit_code, options in (
            ("CS5324", 1, ("--learned", learned, "--scale", "1.1")),
            ("CS5324", 1, ("--learned", learned, "--scale", "1:0.1")), ("CS5320", 1, ("--learned", stiffness))):
        code, said = codes(*options)
        assert (code, wanted in said) == (exit_code, True), said
    other = job.springs("other.json", 0.5 * job.case.stiffness)
    assert "CS5321" in codes("--learned", learned, model=other)[1]
    moved = tmp_path / "moved.mod"
    moved.write_text(job.program.read_text().replace("[[1350.0000,", "[[1352.0000,"))
    assert moved.read_text() != job.program.read_text()
    code, said = codes("--learned", learned, "--repeats", "setup", program=moved)
    assert (code, "CS5322: --repeats setup, but the work object stands 2 mm from where it was measured: this" in said) == (
        3, True), said
    assert codes("--learned", learned, program=moved)[0] == 0


@pytest.mark.parametrize(("there", "refused"), [("66-1234", False), ("66-4321", True), (None, False)])
def test_what_another_robot_of_the_type_learned_is_refused(
    job: ErringJob, learned: Path, tmp_path: Path, there: str | None, refused: bool
) -> None:
    """By the serial number, where both the learned file and the cell state one."""
    file, cell = tmp_path / "learned.json", job.cell.with_name("numbered.yaml")
    file.write_text(json.dumps(json.loads(learned.read_text()) | {"serial_number": "66-1234"}))
    cell.write_text(job.cell.read_text() + (f"serial_number: '{there}'\n" if there else ""))
    try:
        compstiff.read_learned(file, compstiff.read_cell(cell))
        said = []
    except compstiff.CompstiffError as stopped:
        said = [finding.code for finding in stopped.findings]
    assert said == ["CS5321"] * refused


@pytest.mark.parametrize("edit", [
    lambda c: c.pop("mean"), lambda c: c["mean"].pop(), lambda c: c["covariance"].pop(), lambda c: c.update(version=2),
    lambda c: c["covariance"][3].__setitem__(3, -1.0), lambda c: c["remainder"]["posture_deg"].pop(),
    lambda c: c["unshown"].pop(),
    lambda c: c["covariance"][3].__setitem__(0, 1e3), lambda c: c.update(springs=7),
    lambda c: c["job"].update(quaternion=[0] * 4)])
def test_a_learned_file_that_is_not_whole_is_refused(job: ErringJob, learned: Path, tmp_path: Path, edit) -> None:
    content = json.loads(learned.read_text())
    edit(content)
    file = tmp_path / "edited.json"
    file.write_text(json.dumps(content))
    with pytest.raises(compstiff.CompstiffError) as stopped:
        compstiff.read_learned(file, compstiff.read_cell(job.cell))
    assert stopped.value.findings[0].code == "CS5320"


def test_the_record_and_the_report_name_it(job: ErringJob, stiffness: Path, log: Path, learned: Path, tmp_path: Path) -> None:
    output = tmp_path / "out.mod"
    done = kit.run("correct", job.cell, job.program, "--stiffness", stiffness, "--forces", log, "--tare", "0:2", "--learned",
                   learned, "--repeats", "job", "-o", output, "--report", tmp_path / "correct.html", "--offsets",
                   tmp_path / "o.csv")
    assert done.code == 0, done
    record = json.loads((tmp_path / "out.mod.json").read_text())
    assert record["learned"]["file"] == learned.name
    assert record["settings"]["repeats"] == "job"
    made = json.loads(learned.read_text())["told"]["made_from"]
    assert {"cell", "program", "stiffness", "forces", "points"} <= set(made)
    page = (job.folder / "learn.html").read_text()
    assert "smooth remainder" in page
    assert "left out once" in page


# Long: what was learned is among the causes of what is stated for the part above, and the budget has each cause
# (test_budget.py).
@pytest.mark.long
def test_the_error_budget_has_what_was_learned(
    job: ErringJob, stiffness: Path, log: Path, learned: Path, tmp_path: Path
) -> None:
    """As a cause of its own in the result and on the page; without a learned file it is not mentioned."""
    page = tmp_path / "budget.html"
    arguments = ("predict", job.cell, job.program, "--stiffness", stiffness, "--forces", log, "--tare", "0:2", "-o",
                 tmp_path / "deviation.csv", "--force", "--budget", "--tolerance-um", "30", "--report", page)
    done = kit.run(*arguments, "--json", "--learned", learned)
    assert done.code == 0, done
    causes = done.json["result"]["budget"]["causes"]
    assert causes["learned"]["two_sigma_um"]["rms"] > 1
    assert causes["sensor"]["two_sigma_um"]["rms"] == causes["motion"]["two_sigma_um"]["rms"] == 0
    assert "what was learned" in page.read_text()
    without = kit.run(*arguments)
    assert without.code == 0, without
    assert "what was learned" not in page.read_text()
    assert "what was learned" not in without.out + without.err

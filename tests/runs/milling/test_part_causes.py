"""An effect that came to the robot after its load test is found on a measured part, named, carried, and makes the next part
better; a kinematic error is no effect. Truth is the virtual cell's; benchmarks/learning.py --only causes has the rates."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

import compstiff
from tests.runs.command_line import user_files as kit
from tests.runs.milling.learning_job import ErringJob, corrected, off_um
from tests.runs.milling.milling_job import rms
from tests.virtual_cell.astray import drawn
from tests.virtual_cell.cell import parse

SEED = 3


def job_with(folder: Path, effect: str) -> ErringJob:
    """A robot with a kinematic error and a spindle that warms up, to which the effect came."""
    folder.mkdir()
    return ErringJob(folder, SEED, motion=1.0, astray=drawn(SEED), since=parse(effect))


@pytest.fixture(scope="module")
def job(tmp_path_factory: pytest.TempPathFactory) -> ErringJob:
    return job_with(tmp_path_factory.mktemp("causes") / "play", "backlash:1")


@pytest.fixture(scope="module")
def stiffness(job: ErringJob) -> Path:
    return job.identify()


@pytest.fixture(scope="module")
def log(job: ErringJob) -> Path:
    return job.log(job.first, job.planned, "pass1.csv")


def learn(job: ErringJob, stiffness: Path, log: Path) -> tuple[Path, kit.Done]:
    output, points = job.folder / "learned.json", job.measure(job.first, "points.csv")
    done = kit.run("learn", job.cell, job.program, points, "--stiffness", stiffness, "--forces", log, "--tare", "0:2", "-o",
                   output, "--report", job.folder / "learn.html", "--force")
    assert done.code == 0, done
    return output, done


@pytest.fixture(scope="module")
def learned(job: ErringJob, stiffness: Path, log: Path) -> Path:
    return learn(job, stiffness, log)[0]


def test_play_that_came_is_named_with_its_size(job: ErringJob, learned: Path) -> None:
    content = json.loads(learned.read_text())
    causes = content["told"]["figures"]["causes"]
    assert (causes["verdict"], causes["carried"]) == ("named", True)
    assert [(each["effect"], each["joint"]) for each in causes["causes"]] == [("backlash", 1)]
    assert [each["joint"] for each in content["effects"]] == [1]
    gap = causes["parameters"][0]
    truth = job.came[0]["parameters"]["half_gap_rad"]
    assert abs(gap["estimate"] - truth) < max(3 * gap["std"], 0.1 * truth)
    before, after = causes["left_out_um"]
    assert after < 0.5 * before
    page = (job.folder / "learn.html").read_text()
    assert "free play" in page


def test_the_next_part_is_better_by_it(job: ErringJob, stiffness: Path, log: Path, learned: Path) -> None:
    """With the effect taken out of the learned file, springs and all the rest as they are, the part is worse."""
    content = json.loads(learned.read_text())
    size, own = content["springs"], content["springs"] - len(content["prior"])
    kept = [k for k in range(len(content["mean"])) if not size - own <= k < size]
    content |= {"effects": [], "springs": size - own, "mean": [content["mean"][k] for k in kept],
                "covariance": [[content["covariance"][i][j] for j in kept if j <= i] for i in kept]}
    without = job.folder / "without.json"
    without.write_text(json.dumps(content))
    left = []
    for file in (learned, without):
        made = corrected(job, log, stiffness, file, "job")
        first = job.first_with(made.part)
        left.append(rms(off_um(first, job.mill(made.commands, part=made.part))) / rms(off_um(first, first)))
    assert left[0] < 0.12
    assert left[0] < 0.6 * left[1]


def test_nothing_came_and_nothing_is_named(tmp_path: Path) -> None:
    """A kinematic error of 0.2 mm and warming alone: none of it is taken for a gear."""
    job = job_with(tmp_path / "none", "")
    output, done = learn(job, job.identify(), job.log(job.first, job.planned, "pass1.csv"))
    content = json.loads(output.read_text())
    assert content["effects"] == []
    assert content["told"]["figures"]["causes"]["verdict"] == "adequate"
    assert "CS461" not in done.err


@pytest.mark.parametrize(("effects", "code"), [
    ([{"effect": "worn_belt", "joint": 1}], "CS1204"), ([{"effect": "backlash", "joint": 7}], "CS1204"),
    ([{"effect": "soft_track", "joint": None}], "CS4512"), ([{"effect": "force_gain", "joint": None}], "CS1204"),
    ([], "CS5320")])
def test_an_effect_that_is_not_of_this_cell_is_refused(job: ErringJob, learned: Path, tmp_path: Path, effects: list,
                                                       code: str) -> None:
    content = json.loads(learned.read_text())
    file = tmp_path / "edited.json"
    file.write_text(json.dumps(content | {"effects": effects}))
    with pytest.raises(compstiff.CompstiffError) as stopped:
        compstiff.read_learned(file, compstiff.read_cell(job.cell))
    assert stopped.value.findings[0].code == code


def test_a_learned_file_of_before_is_still_read(job: ErringJob, learned: Path, tmp_path: Path) -> None:
    """Without the key `effects`: none."""
    content = json.loads(learned.read_text())
    size, own = content["springs"], content["springs"] - len(content["prior"])
    kept = [k for k in range(len(content["mean"])) if not size - own <= k < size]
    content |= {"springs": size - own, "mean": [content["mean"][k] for k in kept],
                "covariance": [[content["covariance"][i][j] for j in kept if j <= i] for i in kept]}
    del content["effects"]
    file = tmp_path / "before.json"
    file.write_text(json.dumps(content))
    assert compstiff.read_learned(file, compstiff.read_cell(job.cell)).effects == ()

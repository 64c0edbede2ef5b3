"""The error budget: the figure of a remedy is that of a correction in which it was really taken."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest

from compensator.correction.budget import SIGMAS, Budget, error_budget, said_of_tolerance
from compensator.correction.correct import Corrected
from compensator.correction.expected_left import CAUSES
from compensator.correction.files import Inputs, predict_files
from compensator.correction.remedies import Remedy, remedies
from compensator.correction.settings import Estimate
from tests.runs.command_line import user_files as kit
from tests.runs.milling.milling_job import MillingJob, rms, settings

TOLERANCE_UM = 25.0


@pytest.fixture(scope="module")
def job(tmp_path_factory: pytest.TempPathFactory) -> MillingJob:
    return MillingJob(tmp_path_factory.mktemp("budget"), 2, design="poses20")


@pytest.fixture(scope="module")
def log(job: MillingJob) -> Path:
    return job.log(job.first, job.planned, "pass1.csv")


@pytest.fixture(scope="module")
def budget(job: MillingJob, log: Path) -> Budget:
    return error_budget(predict_files(Inputs(job.cell, job.program, job.identify(), log), settings()), 1e-6 * TOLERANCE_UM)


@pytest.fixture
def everything(budget: Budget, monkeypatch: pytest.MonkeyPatch) -> tuple[Remedy, ...]:
    """Of causes that are small, too, and those that gain nothing."""
    monkeypatch.setattr("compensator.correction.remedies.WORTH", 0.0)
    return tuple(remedies(budget.corrected))


def told(remedies: tuple[Remedy, ...], words: str) -> float:
    """RMS of the sigma [m] that the remedy with these words states."""
    return rms(next(remedy for remedy in remedies if words in remedy.name).left)


def taken(job: MillingJob, log: Path, cell: Path | None = None, **wanted: object) -> float:
    """The same of a correction in which it was taken."""
    return rms(job.correct(log, job.folder / "stiffness.json", settings(**wanted), cell).job.left.std)


def sigma_alone(std: np.ndarray, corrected: Corrected) -> float:
    """RMS [m] of a sigma (M,) but for what this correction leaves by its model: between targets, and at a sharp corner, where
    one target serves two forces. Another correction leaves a little more or less there."""
    return float(np.sqrt(np.mean(std**2 - corrected.left.between**2 - corrected.residual**2)))


def test_causes_make_up_the_whole(budget: Budget) -> None:
    figures = budget.as_dict()
    causes = figures["causes"]
    assert set(causes) == set(CAUSES)
    assert sum(cause["share_of_square"] for cause in causes.values()) == pytest.approx(1)
    whole = np.sqrt(sum(cause["two_sigma_um"]["rms"] ** 2 for cause in causes.values()))
    assert figures["two_sigma_um"]["rms"] == pytest.approx(whole)
    for cause in causes.values():
        assert cause["share_of_tolerance"] == pytest.approx(cause["two_sigma_um"]["rms"] / TOLERANCE_UM)


def test_the_places_are_those_over_the_tolerance(job: MillingJob, budget: Budget) -> None:
    figures = budget.as_dict()
    two = 2e6 * budget.corrected.left.std
    assert figures["over"] == (two > TOLERANCE_UM).sum() == sum(place["targets"] for place in figures["places"]) > 0
    assert figures["places"][0]["two_sigma_um"] == pytest.approx(two.max())
    text = job.program.read_text().splitlines()
    for place in figures["places"]:
        for line in (place["first_line"], place["last_line"]):
            assert "MoveL" in text[line - 1]
            assert "vCut" in text[line - 1]
    # Each line is that of the program's own target that a failing one stands nearest to, or goes to.
    planned, job_path = budget.corrected.planned.path.toolpath, budget.corrected.predicted.path.toolpath
    failing = job_path.position[budget.corrected.predicted.targets[two > TOLERANCE_UM]]
    nearest = np.argmin(np.linalg.norm(failing[:, None] - planned.position[None], axis=2), axis=1)
    possible = {int(planned.line[near + more]) for near in nearest for more in (0, 1)}
    assert {place[end] for place in figures["places"] for end in ("first_line", "last_line")} <= possible
    size = np.linalg.norm(budget.corrected.predicted.prediction.position, axis=1)
    assert figures["uncorrected_over"] == (1e6 * size > TOLERANCE_UM).sum()


def test_a_wide_tolerance_is_kept(job: MillingJob, log: Path, budget: Budget) -> None:
    wide = error_budget(budget.corrected.planned, 5e-3)
    assert (wide.as_dict()["over"], wide.places, wide.findings) == (0, (), ())


def test_remedies_are_ranked_by_what_they_gain(budget: Budget) -> None:
    remedies = budget.as_dict()["remedies"]
    gains = [remedy["gain_um"] for remedy in remedies]
    assert len(gains) >= 4
    assert gains == sorted(gains, reverse=True)
    assert min(gains) > 0
    for remedy, of in zip(budget.remedies, remedies, strict=True):
        assert of["gain_um"] == pytest.approx(1e6 * SIGMAS * (rms(budget.corrected.left.std) - rms(remedy.left)))


def test_stated_numbers_are_worth_what_was_told(
    job: MillingJob, log: Path, budget: Budget, everything: tuple[Remedy, ...]
) -> None:
    gain = job.folder / "cell_gain.yaml"
    gain.write_text(job.cell.read_text() + "  gain_std: 0.003\n")
    assert told(everything, "known weight") == pytest.approx(taken(job, log, gain), rel=1e-6)
    remedy = next(remedy for remedy in everything if "--scale" in remedy.name)
    scaled = job.correct(log, job.folder / "stiffness.json", settings(scale=Estimate(1.0, 0.01))).job
    assert sigma_alone(remedy.left, budget.corrected) == pytest.approx(sigma_alone(scaled.left.std, scaled), rel=1e-6)
    assert rms(remedy.left) == pytest.approx(rms(scaled.left.std), rel=1e-3)
    assert told(everything, "--depth-of-cut") == pytest.approx(taken(job, log, depth_of_cut=0.75e-3), rel=1e-6)
    assert told(everything, "--tighten-zones") == pytest.approx(taken(job, log, tolerance=2.5e-6, tighten_zones=True), rel=1e-6)


# Long: what numbers and another place are worth is asked of the same list above and below.
@pytest.mark.long
def test_another_pass_is_worth_what_was_told(
    job: MillingJob, log: Path, budget: Budget, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Milled with the correction, logged, and corrected again: what is then stated for the part. Where nobody states the depth
    the forecast is one over all depths: in this deep cut there is less left, and the pass is worth more than was told."""
    found = job.correct(log, job.folder / "stiffness.json")
    second = job.mill(found.commands, part=found.part)
    pass2 = job.log(second, found.commands, "pass2.csv", part=found.part)
    assert taken(job, pass2, logged_with=job.offsets(found, "applied.csv")) < told(budget.remedies, "--logged-with")
    depth = {"depth_of_cut": 1e-3 * job.part.allowance_mm}
    inputs = Inputs(job.cell, job.program, job.folder / "stiffness.json", log)
    stated = error_budget(predict_files(inputs, settings(**depth)), 1e-6 * TOLERANCE_UM)
    monkeypatch.setattr("compensator.correction.remedies.WORTH", 0.0)
    found = job.correct(log, job.folder / "stiffness.json", settings(**depth))
    second = job.mill(found.commands, part=found.part)
    pass2 = job.log(second, found.commands, "pass2.csv", part=found.part)
    assert told(tuple(remedies(stated.corrected)), "--logged-with") == pytest.approx(
        taken(job, pass2, logged_with=job.offsets(found, "applied.csv"), **depth), rel=0.1)


# Long: what stated numbers are worth is asked of the same list above.
@pytest.mark.long
def test_another_place_is_worth_what_was_told(job: MillingJob, log: Path, budget: Budget) -> None:
    """The program's own work object moved so, under the same forces."""
    remedy = next(remedy for remedy in budget.remedies if "work object" in remedy.name)
    shift, axis = re.search(r"by ([+-]\d+) mm along base ([xyz])", remedy.name).groups()
    text = job.program.read_text()
    frame = re.search(r"(wobjdata wPart:=.*\[\[0,0,0\],\[1,0,0,0\]\],\[\[)([^\]]*)(\])", text)
    place = [float(value) for value in frame[2].split(",")]
    place["xyz".index(axis)] += float(shift)
    moved = job.folder / "moved.mod"
    moved.write_text(text.replace(frame[0], frame[1] + ",".join(f"{value:.4f}" for value in place) + frame[3]))
    predicted = predict_files(Inputs(job.cell, moved, job.folder / "stiffness.json", log), settings())
    there = error_budget(predicted, 1e-6 * TOLERANCE_UM).corrected
    # All of it, what is left between targets and at a sharp corner too: that is taken to grow as the deviation does.
    assert rms(remedy.left) == pytest.approx(rms(there.left.std), rel=0.1)
    assert rms(remedy.left) < rms(budget.corrected.left.std)


def test_the_command_says_it(job: MillingJob, log: Path, budget: Budget) -> None:
    arguments = ("predict", job.cell, job.program, "--stiffness", job.folder / "stiffness.json", "--forces", log,
                 "--tare", "0:2", "-o", job.folder / "deviation.csv", "--force")
    page = job.folder / "budget.html"
    done = kit.run(*arguments, "--budget", "--tolerance-um", TOLERANCE_UM, "--report", page, "--json")
    assert done.code == 0, done
    said = json.loads(json.dumps(budget.as_dict()))
    told = done.json["result"]["budget"]["remedies"]
    assert [remedy["do"] for remedy in told] == [remedy.name for remedy in budget.remedies]
    assert [remedy["gain_um"] for remedy in told] == pytest.approx([remedy["gain_um"] for remedy in said["remedies"]])
    assert "CS3205" in kit.codes(done)
    html = page.read_text()
    for words in ("Error budget", "Places that may fail", "What would help", budget.remedies[0].name):
        assert words in html
    shown = kit.run(*arguments, "--budget", "--tolerance-um", TOLERANCE_UM)
    assert f"error budget for {TOLERANCE_UM:g} um" in shown.out + shown.err
    for wrong in (("--budget",), ("--tolerance-um", "50"), ("--depth-of-cut", "2"), ("--cutting-stiffness", "20")):
        assert kit.run(*arguments, *wrong).code == 2


# Long: that stated numbers are worth what was told is asked above.
@pytest.mark.long
def test_a_stated_cut_is_spent_less_on(job: MillingJob, log: Path, budget: Budget) -> None:
    arguments = ("predict", job.cell, job.program, "--stiffness", job.folder / "stiffness.json", "--forces", log,
                 "--tare", "0:2", "-o", job.folder / "deviation.csv", "--force")
    said = budget.as_dict()
    known = kit.run(*arguments, "--budget", "--tolerance-um", TOLERANCE_UM, "--cutting-stiffness", "25:5", "--json").json
    assert known["result"]["budget"]["causes"]["cut"]["share_of_tolerance"] < 0.5 * said["causes"]["cut"]["share_of_tolerance"]


@pytest.mark.parametrize(("um", "said"), [
    (1.0, False), (30.0, False), (2000.0, False), (5000.0, False), (0.05, True), (0.99, True), (5001.0, True), (50000.0, True)])
def test_a_tolerance_in_another_unit_is_said(um: float, said: bool) -> None:
    """50 um in millimetres, and 50 mm: under 1 um and over 5 mm."""
    assert [(one.code, one.level, one.file, one.message) for one in said_of_tolerance(1e-6 * um, "part.mod")] == [
        ("CS3206", "warning", "part.mod", f"the tolerance is {um:g} um, {1e-3 * um:g} mm: robots mill to 1 to 5000 um")] * said

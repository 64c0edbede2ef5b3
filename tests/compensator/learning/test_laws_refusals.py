"""What is told of a measured part: with the numbers that were put into it, and from which on."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from compensator.correction.files import Inputs
from compensator.correction.settings import Estimate
from compensator.learned.learned import JobFrame
from compensator.learning import refusals
from compensator.learning.held_out import HeldOut
from compensator.learning.learning import Learning
from compensator.learning.posterior import posterior
from compensator.learning.refusals import refuse_without_physics, refuse_worse, said_of
from identification.common.findings import Finding, Refused
from identification.model.rotations import Frame
from tests.compensator.learning.test_laws_learning import NOISE, drawn, terms
from tests.compensator.learning.two_tracks import TwoTracks, two_tracks

THIRD = slice(None, None, 3)


@pytest.fixture(scope="module")
def tracks(sample_inputs: Inputs, tmp_path_factory: pytest.TempPathFactory) -> TwoTracks:
    return two_tracks(sample_inputs, tmp_path_factory.mktemp("tracks"))


def told(learning: Learning, code: str) -> list[Finding]:
    return [finding for finding in learning.findings if finding.code == code]


def um(finding: Finding) -> float:
    """The first length that it states."""
    return float(finding.message.partition(" um")[0].rpartition(" ")[2])


@pytest.mark.parametrize(("shift_um", "level"), [(0, ""), (170, "note"), (230, "warning")])
def test_how_far_the_part_stood_beside_its_work_object_is_told(
    tracks: TwoTracks, tmp_path: Path, shift_um: float, level: str
) -> None:
    """Along (2, 2, 1) / 3, to some per cent; from 0.2 mm on a warning."""
    points = tracks.measured(tmp_path / "points.csv", THIRD, tracks.off + shift_um * np.array([2, 2, 1]) / 3)
    found = told(tracks.learn(points), "CS5314")
    assert [(finding.level, finding.file, bool(finding.hint)) for finding in found] == (
        [(level, str(points), level == "warning")] if shift_um else [])
    assert not found or abs(um(found[0]) - shift_um) < 15


@pytest.mark.parametrize("drift_um", [0, 100])
def test_how_far_it_drifted_over_the_job_is_told(tracks: TwoTracks, tmp_path: Path, drift_um: float) -> None:
    """Along y, in proportion to the time: 122 mm at 40 mm/s and the way to the tracks at the feed of its move."""
    off = tracks.off.copy()
    off[:, 1] += drift_um * np.linspace(0, 1, len(off))
    points = tracks.measured(tmp_path / "points.csv", THIRD, off)
    found = told(tracks.learn(points), "CS5315")
    assert [(finding.level, finding.file) for finding in found] == ([("note", str(points))] if drift_um else [])
    assert not found or abs(um(found[0]) - drift_um) < 20
    assert not found or "over the 4 s of the job" in found[0].message


@pytest.mark.parametrize("places", [15, 16])
def test_too_few_places_to_leave_stretches_out_are_told(tracks: TwoTracks, tmp_path: Path, places: int) -> None:
    points = tracks.measured(tmp_path / "points.csv", slice(0, 8 * places, 8), tracks.off)
    learning = tracks.learn(points)
    assert [(finding.level, finding.file) for finding in told(learning, "CS5316")] == (
        [("warning", str(points))] if places < 16 else [])
    assert (learning.held_out is None) == (places < 16)


@pytest.mark.parametrize(("learned", "better", "refused"), [
    (50.0, -2.1, True), (50.0, -2.0, False),        # standard errors
    (44.1, -5.0, True), (44.0, -5.0, False)])       # a tenth more than 40 um
def test_what_makes_stretches_left_out_surely_worse_is_refused(learned: float, better: float, refused: bool) -> None:
    tried = HeldOut(40e-6, 40e-6, 1e-6 * learned, better, 8)
    beside = Finding("CS5302", "note", "something else")
    if not refused:
        refuse_worse(tried, "points.csv", (beside,))
        return
    with pytest.raises(Refused) as stopped:
        refuse_worse(tried, "points.csv", (beside,))
    finding, other = stopped.value.findings
    assert (finding.code, finding.file, other) == ("CS5312", "points.csv", beside)
    assert f"{learned:.1f} um are left, 40.0 um without learning" in finding.message


@pytest.mark.parametrize("worse", [1.1, 1.0])
def test_a_part_that_teaches_the_wrong_thing_teaches_nothing(
    tracks: TwoTracks, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, worse: float
) -> None:
    """Eight stretches off to one side and the other in turn: surely a little worse where they were left out, which by less than
    a tenth is let pass."""
    monkeypatch.setattr(refusals, "WORSE", worse)
    side = np.where(8 * np.arange(len(tracks.off)) // len(tracks.off) % 2, -10.0, 10.0)
    points = tracks.measured(tmp_path / "points.csv", THIRD, tracks.off + side[:, None] * [0, 1, 0])
    if worse > 1:
        tried = tracks.learn(points).held_out
        assert tried is not None
        assert tried.better < -2
        assert tried.known < tried.learned < 1.1 * tried.known
        return
    with pytest.raises(Refused) as stopped:
        tracks.learn(points)
    assert (stopped.value.findings[0].code, stopped.value.findings[0].file) == ("CS5312", str(points))


@pytest.mark.parametrize(("remainder_um", "places", "refused"), [(49.9, 5, False), (50.1, 5, True), (400.0, 0, False)])
def test_a_remainder_larger_than_what_physics_explains_is_refused(remainder_um: float, places: int, refused: bool) -> None:
    """Four terms that stand square to each other, of 10, 20, 40 and 20 um: together 50. Without places there is none."""
    rows = type("Rows", (SimpleNamespace,), {"__len__": lambda self: 4})(
        position=np.diag([1.0, 2, 3, 4])[:, :3], direction=np.eye(4)[:, :3], place=np.arange(4))
    signs = np.array([[1, 1, 1, 1], [1, -1, 1, -1], [1, 1, -1, -1], [1, -1, -1, 1]]) * 1e-6
    parts = dict(zip(("predicted", "springs", "setup", "drift"), signs * [[10], [20], [40], [20]], strict=True))
    learned = SimpleNamespace(remainder=SimpleNamespace(places=np.zeros((places, 3))),
                              frame=JobFrame(Frame.identity(), np.zeros(3), 1.0, 1.0))
    learning: Any = SimpleNamespace(parts=parts | {"remainder": remainder_um * signs[1]}, learned=learned,
                                    terms=SimpleNamespace(rows=rows))
    beside = Finding("CS5302", "note", "something else")
    if not refused:
        refuse_without_physics(learning, "points.csv", (beside,))
        return
    with pytest.raises(Refused) as stopped:
        refuse_without_physics(learning, "points.csv", (beside,))
    finding, other = stopped.value.findings
    assert (finding.code, finding.level, finding.file, other) == ("CS5311", "error", "points.csv", beside)
    assert finding.message.startswith("a remainder of 50 um RMS that no term explains, while deflection, set-up and warming "
                                      "together explain 50 um: ")


def test_where_nothing_was_tried_nothing_is_refused() -> None:
    refuse_worse(None, "points.csv", ())


@pytest.mark.parametrize(("large", "turn", "level"), [(0.99, 60, "note"), (1.01, 60, "warning"), (0.5, 198, "note"),
                                                      (0.5, 202, "warning")])
def test_set_up_and_drift_are_told_in_their_units(large: float, turn: float, level: str) -> None:
    """(40, 0, 30) um times four, a turn that moves a place at 0.1 m by so many um, a drift of 70 um in 12 s; no rest."""
    beyond = 1e-6 * np.array([160 * large, 0, 120 * large, 0, turn, 0, 0, 0, 70, 900, 900, 900])
    learned = SimpleNamespace(mean=np.concatenate([np.zeros(6), beyond]), covariance=np.eye(15), springs=6, frame=JobFrame(
        Frame.identity(), np.zeros(3), 0.1, 12.0))
    learning: Any = SimpleNamespace(learned=learned, motion=Estimate(1.0, 0.01), setup_on=True, drift_on=True,
                                    held_out=object(), source="points.csv")
    set_up, drift = said_of(learning, np.eye(6), np.zeros(6))
    assert (set_up.code, set_up.level, drift.code, drift.level) == ("CS5314", level, "CS5315", "note")
    assert f"stood {200 * large:.0f} um and {0.01 * turn:.2f} mrad" in set_up.message
    assert bool(set_up.hint) == (level == "warning")
    assert "a drift of 70 um over the 12 s" in drift.message


def of_springs(mean: np.ndarray, covariance: np.ndarray) -> Any:
    """A part that told of six springs alone: mean (6,), covariance (6, 6)."""
    whole = np.zeros((15, 15))
    whole[:6, :6] = covariance
    learned = SimpleNamespace(mean=np.concatenate([mean, np.zeros(9)]), covariance=whole, springs=6, frame=None)
    return SimpleNamespace(learned=learned, motion=Estimate(1.0, 0.01), setup_on=False, drift_on=False, held_out=object(),
                           source="points.csv")


@pytest.mark.parametrize(("told", "share", "chi2", "pulled"), [
    (6, 1.0, 22.4, False), (6, 1.0, 22.5, True), (2, 1.0, 13.8, False), (2, 1.0, 13.9, True), (2, 0.01, 13.8, False),
    (2, 0.01, 13.9, True), (1, 0.5, 10.8, False), (1, 0.5, 10.9, True), (2, 1e-5, 900.0, False), (0, 1.0, 0.0, False)])
def test_springs_that_their_load_test_lets_no_part_ask_for_are_told(
    told: int, share: float, chi2: float, pulled: bool
) -> None:
    """22.46, 13.82 and 10.83 are what a chi-square with six, two degrees of freedom and one exceeds once in a thousand (any
    table has it). The part took this share of the variance of so many combinations, by which their means scatter then."""
    rng = np.random.default_rng(6)
    root = 1e-2 * (rng.normal(size=(6, 6)) + 3 * np.eye(6))
    turn, _ = np.linalg.qr(rng.normal(size=(6, 6)))
    way, mean = rng.normal(size=told), rng.normal(size=6)
    taken = root @ turn[:, :told]
    change = taken @ way * np.sqrt(share * chi2 / max(way @ way, 1e-9))
    learning = of_springs(mean + change, root @ root.T - share * taken @ taken.T)
    found = said_of(learning, root @ root.T, mean)
    assert [(one.code, one.level, one.file) for one in found] == ([("CS5313", "warning", "points.csv")] if pulled else [])
    assert all(f"chi-square {chi2:.0f} of the {told} of 6 combinations" in one.message for one in found)


def test_right_springs_are_pulled_as_often_as_chance_does(monkeypatch: pytest.MonkeyPatch) -> None:
    """200 parts of springs that scatter as their load tests say, some of which the part tells of and some not: at one in ten
    it is told of 8 to 36 (once in a thousand draws are more or fewer), at one in a thousand of three at most."""
    rng = np.random.default_rng(11)
    given = replace(terms(rng), before=np.diag([0.2, 0.05, 0.02, 0.01, 5e-3, 1e-3]) ** 2)
    residuals, _ = drawn(given, NOISE, rng, 200)
    learnings = []
    for residual in residuals.T:
        found = posterior(replace(given, residual=residual), NOISE)
        learnings.append(of_springs(found.mean[:6], found.covariance[:6, :6]))
    assert sum(bool(said_of(learning, given.before, np.zeros(6))) for learning in learnings) <= 3
    monkeypatch.setattr(refusals, "PULLED", 0.1)
    assert 8 <= sum(bool(said_of(learning, given.before, np.zeros(6))) for learning in learnings) <= 36


@pytest.mark.parametrize("factors", [
    6 * (1.0,), 6 * (1.2,), (1, 1, 1, 1, 3, 1), (1, 1, 1.5, 1, 1, 1), (0.6, 1.3, 1.5, 0.8, 0.7, 1.2)])
def test_a_part_of_other_springs_is_told_whatever_well_known_springs_are_named(
    tracks: TwoTracks, tmp_path: Path, factors: tuple[float, ...]
) -> None:
    """The load tests told the sample's springs to a few per cent: one that is much softer, and those of another robot, are
    told; all of them softer by one factor is what a robot in motion does."""
    true = replace(tracks.model, mean=tracks.model.mean + np.log(factors))
    points = tracks.measured(tmp_path / "points.csv", slice(None, None, 6), tracks.off_of(true))
    found = told(tracks.learn(points), "CS5313")
    assert [(finding.level, finding.file) for finding in found] == (
        [("warning", str(points))] if len(set(factors)) > 1 else [])


@pytest.mark.parametrize("softer", [1.0, 1.5])
def test_a_part_that_pulls_one_spring_alone_is_told(tracks: TwoTracks, tmp_path: Path, softer: float) -> None:
    """The fifth spring of a robot whose load tests told each to some per cent."""
    model = tracks.model
    model = replace(model, covariance=100 * model.covariance)
    true = replace(model, mean=model.mean + np.log(softer) * np.eye(6)[4])
    points = tracks.measured(tmp_path / "points.csv", slice(None, None, 6), tracks.off_of(true), std_um=0.5)
    found = told(tracks.learn(points, model), "CS5313")
    assert [(finding.level, finding.file) for finding in found] == ([("warning", str(points))] if softer > 1 else [])


@pytest.mark.parametrize(("factor", "std", "said"), [
    (0.84, 0.001, "CS5328"), (0.86, 0.001, ""), (0.70, 0.049, "CS5328"), (0.70, 0.051, ""), (1.59, 0.001, ""),
    (1.61, 0.001, "CS5336"), (1.9, 0.099, "CS5336"), (1.9, 0.101, "")])
def test_a_factor_in_motion_that_no_robot_has_is_told_where_it_is_sure(factor: float, std: float, said: str) -> None:
    """Surely, by three sigma, under 0.85 or over 1.6 of what the load tests let expect."""
    learned = SimpleNamespace(mean=np.zeros(18), covariance=np.eye(15), springs=6, frame=JobFrame(
        Frame.identity(), np.zeros(3), 0.1, 12.0))
    learning: Any = SimpleNamespace(learned=learned, motion=Estimate(factor, std), setup_on=False, drift_on=False,
                                    held_out=object(), source="points.csv")
    found = said_of(learning, np.eye(6), np.zeros(6))
    assert [(one.code, one.level, one.file) for one in found] == ([(said, "warning", "points.csv")] if said else [])
    assert all(f"was off by {factor:.2f} +- {2 * std:.2g} (2 sigma) times" in one.message for one in found)

"""Parts get better: a pass milled in the virtual cell, logged by a noisy sensor, corrected with the identified stiffness and
milled again. The truth is the virtual cell alone; benchmarks/milling_loop.py has the figures over many robots."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from compensator.correction.cut_kind import cut_shares
from compensator.correction.engagement import following_the_cut
from compensator.correction.expected_left import CAUSES
from compensator.correction.settings import Estimate
from tests.runs.milling.milling_job import Correction, MillingJob, made_worse, rms, settings
from tests.virtual_cell.cell import parse
from tests.virtual_cell.endmill import PIECES, EndMill
from tests.virtual_cell.files import PRIOR
from tests.virtual_cell.milled_part import PLACES, SLOT_DEPTH, slot_and_pocket
from tests.virtual_cell.milling import Pass, Sensor

# How the force on the wall follows the tool [N/m], over robots (docs/benchmarks/parts.md).
WALL = 25e3
# Linear-edge coefficients of a carbon steel, rounded (Altintas, Manufacturing Automation, ch. 2).
STEEL = EndMill(shear_n_mm2=(1800.0, 700.0, 300.0), edge_n_mm=(25.0, 40.0, 2.0), spindle_rpm=4500.0, feed_mm_s=18.0)


@pytest.fixture(scope="module")
def job(tmp_path_factory: pytest.TempPathFactory) -> MillingJob:
    return MillingJob(tmp_path_factory.mktemp("mill"), 1)


@pytest.fixture(scope="module")
def stiffness(job: MillingJob) -> Path:
    return job.identify()


@pytest.fixture(scope="module")
def log(job: MillingJob) -> Path:
    return job.log(job.first, job.planned, "pass1.csv")


@pytest.fixture(scope="module")
def corrected(job: MillingJob, stiffness: Path, log: Path) -> Correction:
    return job.correct(log, stiffness)


@pytest.fixture(scope="module")
def second(job: MillingJob, corrected: Correction) -> Pass:
    return job.mill(corrected.commands, part=corrected.part)


@pytest.fixture(scope="module")
def first(job: MillingJob, corrected: Correction) -> Pass:
    """The pass without correction, with the steps of the corrected program's targets."""
    return job.first_with(corrected.part)


def gone(first: Pass, after: Pass, *places: str) -> float:
    """Share of the RMS off plan that is gone at these places (everywhere without one)."""
    where = first.cutting | after.cutting
    if places:
        where &= np.isin(first.steps.place, [PLACES.index(place) for place in places])
    return 1 - rms(np.linalg.norm(after.off_um[where], axis=1)) / rms(np.linalg.norm(first.off_um[where], axis=1))


def test_most_of_the_deviation_is_gone(first: Pass, second: Pass) -> None:
    assert rms(np.linalg.norm(first.off_um[first.cutting], axis=1)) > 80
    assert gone(first, second) > 0.9
    assert gone(first, second, "slot", "straight wall") > 0.96
    assert 1 - rms(second.surface_um[second.cutting]) / rms(first.surface_um[first.cutting]) > 0.9


def test_targets_where_the_force_asks_for_them_make_it_better(
    job: MillingJob, stiffness: Path, log: Path, corrected: Correction, second: Pass, first: Pass
) -> None:
    """At entries, exits and corners, although no move is longer than 1.5 mm."""
    assert len(corrected.part.target_mm) > len(job.part.target_mm) + 10
    kept = job.correct(log, stiffness, settings(keep_targets=True))
    without = job.mill(kept.commands)
    for places in (("sharp corner",), ("slot ends",), ()):
        assert 1 - gone(first, second, *places) < 0.9 * (1 - gone(job.first, without, *places))


def test_what_is_stated_for_the_part_holds_there(job: MillingJob, corrected: Correction, first: Pass, second: Pass) -> None:
    """Two sigma hold nearly all of what the part is off, which those of the deviation alone do not; and it is no blank cheque
    where the depth of cut is stated, as a CAM system knows it."""
    off = np.linalg.norm(second.off_um, axis=1)[first.cutting]
    left, sigma = (first.steps.between(values)[first.cutting] for values in (corrected.left_um, corrected.sigma_um))
    assert np.mean(off <= 2 * left) > 0.9
    assert np.mean(off <= 2 * sigma) < 0.6
    assert rms(left) < 6 * rms(off)
    figures = corrected.job.as_dict()["expected_left_um"]
    assert np.isclose(figures["rms"] ** 2, sum(figures[cause] ** 2 for cause in CAUSES))


def test_the_force_grows_with_the_depth(corrected: Correction) -> None:
    """By g = 0.75 |d . n| / a of a depth a, less what the tool stood aside, n across the feed: |d| g / (1 + g) is left; depths
    are drawn from a log-normal distribution. In a slot by g = |d . z| / b of a depth b along the tool's axis z, and no more."""
    predicted = corrected.job.predicted
    targets, position = predicted.targets, predicted.path.base_from_tcp.position
    inner = (targets > 0) & (targets < len(position) - 1)
    deviation, force = predicted.prediction.position[inner], predicted.forces.wrench[targets[inner], :3]
    along = position[targets[inner] + 1] - position[targets[inner] - 1]
    along /= np.linalg.norm(along, axis=1)[:, None]
    across = force - np.sum(force * along, axis=1)[:, None] * along
    pushes = np.linalg.norm(across, axis=1) > 0.06 * np.linalg.norm(force, axis=1)
    depth = 0.75e-3 * np.exp(0.8 * np.random.default_rng(5).standard_normal((20_000, 1)))
    aside = np.sum(deviation * across, axis=1) / np.linalg.norm(across, axis=1)
    growth = 0.75 * np.abs(aside) / np.maximum(depth - aside, 0.25 * depth)
    deep = 2e-3 * np.exp(0.8 * np.random.default_rng(6).standard_normal((20_000, 1)))
    along_axis = np.abs(deviation[:, 2]) / np.maximum(deep - deviation[:, 2], 0.25 * deep)
    left, in_a_slot = (np.linalg.norm(deviation, axis=1) * np.sqrt(np.mean((g / (1 + g)) ** 2, axis=0)) for g in (
        growth, along_axis))
    assert rms(left[pushes]) > 5e-6
    cut = corrected.job.left.cut[inner]
    wall, slot = (np.isin(corrected.part.place[targets[inner]], [PLACES.index(place)]) & pushes for place in (
        "straight wall", "slot"))
    assert wall.sum() > 50
    assert slot.sum() > 20
    assert np.allclose(cut[wall], left[wall], rtol=0.02)
    assert np.allclose(cut[slot], in_a_slot[slot], rtol=0.02)


def test_a_slot_and_a_climbing_cut_are_told_by_the_force(corrected: Correction) -> None:
    predicted = corrected.job.predicted
    force, place = predicted.forces.wrench[:, :3], corrected.part.place
    climbing_and_slotting, turned_over = cut_shares(predicted.path, force), cut_shares(predicted.path, -force)
    for kind, name in enumerate(("straight wall", "slot")):
        there = place == PLACES.index(name)
        assert (climbing_and_slotting[kind][there] > 0.99).mean() > 0.95
        assert climbing_and_slotting[1 - kind][there].max() < 0.05
        # Turned over by a wrong sign it is neither a climbing cut nor a slot.
        assert turned_over[kind][there].max() < 0.5


def test_the_material_makes_walls_better_and_leaves_the_slot_alone(
    job: MillingJob, stiffness: Path, log: Path, corrected: Correction, first: Pass, second: Pass
) -> None:
    cell = job.cell_with("cell_cut.yaml", (
        "  spindle_rpm: 9000\ncutting: {material: aluminium, tool_diameter_mm: 16, contact_mm: 4}\n"))
    known = job.correct(log, stiffness, cell=cell)
    assert known.job.stiffness is not None
    assert 0.5 < known.job.stiffness.value / WALL < 2
    assert {"CS3201", "CS4120"} <= {finding.code for finding in known.job.findings}
    milled, before = job.mill(known.commands, part=known.part), job.first_with(known.part)
    assert 1 - gone(before, milled, "straight wall") < 0.7 * (1 - gone(first, second, "straight wall"))
    assert gone(before, milled, "slot") > gone(first, second, "slot") - 0.005
    off = np.linalg.norm(milled.off_um, axis=1)[before.cutting]
    assert np.mean(off <= 2 * before.steps.between(known.left_um)[before.cutting]) > 0.95


# Long: what a stated depth tells of the force is held in tests/compensator/correction/test_laws_expected_left.py.
@pytest.mark.long
def test_a_stated_depth_of_the_slot_makes_it_right_on_a_soft_arm(tmp_path: Path) -> None:
    """An arm that the push across moves along the tool's axis, in steel: the force in the slot grows with the depth there, by
    nothing that is known of walls. The truth: how the virtual cell's force grows with the depth, at the targets of the slot."""
    soft = MillingJob(tmp_path, 500, design="poses20", part=slot_and_pocket(0.5, pocket=False), cutter=STEEL)
    springs = soft.identify()
    logged = soft.log(soft.first, soft.planned, "log.csv")
    unknown = soft.correct(logged, springs)
    known = soft.correct(logged, springs, settings(slot_depth=SLOT_DEPTH * 1e-3))
    left = {}
    for name, one in (("unknown", unknown), ("known", known)):
        before, after = soft.first_with(one.part), soft.mill(one.commands, part=one.part)
        slot = before.steps.place == PLACES.index("slot")
        off = np.linalg.norm(after.off_um[slot], axis=1)
        left[name] = rms(off)
        assert np.mean(off <= 2 * before.steps.between(one.left_um)[slot]) > 0.9, name
    assert left["known"] < 0.2 * left["unknown"]
    found = known.job.logged.slot
    assert found is not None
    assert found.followed
    force = STEEL.mean_force(np.ones(PIECES), SLOT_DEPTH)
    assert found.value == pytest.approx(1e3 * np.hypot(*force[1:]) / SLOT_DEPTH, rel=0.05)
    assert rms(known.job.left.cut) < 0.5 * rms(unknown.job.left.cut)
    # Nobody needs to state it once two passes were logged.
    second = soft.mill(unknown.commands, part=unknown.part)
    pass2 = soft.log(second, unknown.commands, "pass2.csv", part=unknown.part)
    both = settings(logged_with=soft.offsets(unknown, "applied.csv"), first_forces=logged)
    learned = soft.correct(pass2, springs, both).job.logged.slot
    assert learned is not None
    assert learned.std < 0.25 * learned.value
    assert abs(learned.value - 1e3 * np.hypot(*force[1:]) / SLOT_DEPTH) < 2.5 * learned.std


def test_two_passes_tell_the_cutting_stiffness_of_the_wall(
    job: MillingJob, stiffness: Path, log: Path, corrected: Correction, first: Pass, second: Pass
) -> None:
    """By how much the force on the wall really grew, along its own direction, between the two simulated passes."""
    applied = job.offsets(corrected, "applied.csv")
    pass2 = job.log(second, corrected.commands, "pass2_for_k.csv", part=corrected.part)
    found = job.correct(pass2, stiffness, settings(logged_with=applied, first_forces=log)).job.stiffness
    assert found is not None
    assert found.followed
    wall = first.steps.place == PLACES.index("straight wall")
    across = first.force_n[wall] - np.einsum("si,si->s", first.force_n[wall], flat(first.steps.feed[wall]))[:, None] * flat(
        first.steps.feed[wall])
    n = across / np.linalg.norm(across, axis=1)[:, None]
    grown = np.einsum("si,si->s", second.force_n[wall] - first.force_n[wall], n)
    deeper = np.einsum("si,si->s", first.off_um[wall] - second.off_um[wall], n)
    truth = 1e6 * float(np.median(grown / deeper))
    assert abs(found.value - truth) < 2.5 * found.std
    assert found.std < 0.35 * truth
    # offsets.csv has what of left_um the cut leaves; the pass of the first correction knew nothing of it.
    rows = np.genfromtxt(applied, delimiter=",", names=True, dtype=None, encoding="utf-8")
    known = ~np.isnan(rows["left_um"])          # empty where a target has no force of its own left
    assert known.sum() > 100
    assert np.all(rows["cut_um"][known] <= rows["left_um"][known] + 1e-4)
    assert np.allclose(rows["cut_um"][corrected.job.predicted.forces.forced[corrected.job.kept]], 1e6 * corrected.job.left.cut[
        np.isin(corrected.job.predicted.targets, corrected.job.kept)], atol=1e-4)
    assert found.as_dict()["n_per_mm"] == pytest.approx(1e-3 * found.value)


def test_the_log_of_a_corrected_pass_tells_how_far_off_the_planned_program_is(
    job: MillingJob, stiffness: Path, log: Path, corrected: Correction, second: Pass
) -> None:
    """Which gets its tool pushed aside and cuts less: on the wall that deviation is known from its own log."""
    applied = job.offsets(corrected, "applied_once.csv")
    pass2 = job.log(second, corrected.commands, "pass2_once.csv", part=corrected.part)
    found = job.correct(pass2, stiffness, settings(logged_with=applied, first_forces=log)).job
    cut, _ = following_the_cut(found.predicted, found.kept, found.logged)
    size = np.zeros((3, len(job.part.target_mm)))
    for row, (one, by) in enumerate(((found, 1.0), (found, cut.uncorrected), (corrected.job, 1.0))):
        every = np.zeros(len(one.predicted.path.toolpath))
        every[one.predicted.targets] = by * np.linalg.norm(one.predicted.prediction.position, axis=1)
        size[row] = every[one.kept]
    wall = job.part.place == PLACES.index("straight wall")
    as_logged, told, own = np.median(size[:, wall], axis=1)
    assert as_logged > 1.01 * own
    assert told == pytest.approx(own, rel=0.3 * (as_logged / own - 1))


def test_as_many_are_expected_farther_off_as_are(first: Pass, corrected: Correction, second: Pass) -> None:
    """Steps where the tool barely touches and turns; each as likely as what is said of the targets beside it."""
    cut = first.cutting | second.cutting
    farther = (np.linalg.norm(second.off_um, axis=1) > np.linalg.norm(first.off_um, axis=1))[cut].sum()
    expected = first.steps.between(corrected.worse)[cut].sum()
    assert abs(farther - expected) < 2 * np.sqrt(max(expected, 1.0))
    assert expected < 0.01 * cut.sum()


def flat(feed: np.ndarray) -> np.ndarray:
    """Directions (S, 2) in the plane as (S, 3)."""
    return np.column_stack([feed, np.zeros(len(feed))])


def test_the_moving_robot_is_a_cause_until_a_scale_is_known(
    job: MillingJob, stiffness: Path, log: Path, corrected: Correction
) -> None:
    size = np.linalg.norm(corrected.job.predicted.prediction.position, axis=1)
    assert np.allclose(corrected.job.left.motion, 0.02 * size)
    stated = job.correct(log, stiffness, cell=job.cell_with("cell_motion.yaml", "motion: {compliance_std: 0.1}\n"))
    assert rms(stated.job.left.motion) == pytest.approx(5 * rms(corrected.job.left.motion), rel=0.02)
    scaled = job.correct(log, stiffness, settings(scale=Estimate(1.0, 0.05)))
    assert not scaled.job.left.motion.any()
    more = np.sqrt(rms(scaled.job.left.model) ** 2 - rms(corrected.job.left.model) ** 2)
    assert more == pytest.approx(0.05 * rms(size), rel=0.1)


def test_a_zero_that_drifts_is_in_the_sigma(
    job: MillingJob, stiffness: Path, log: Path, corrected: Correction, tmp_path: Path
) -> None:
    """The sensor's zero runs away from the tare at the start: by its rate, over the time of the program."""
    duration = job.first.steps.duration_s(job.cutter.feed_mm_s)
    drifted = np.linalg.norm(job.sensor.drift_n_min) * (np.cumsum(duration) - 0.5 * duration) / 60
    expected = float(np.sqrt(np.average(drifted**2, weights=duration) / 3))
    forces = corrected.job.predicted.forces
    assert forces.zero_std == pytest.approx(expected, rel=0.25)
    still = MillingJob(tmp_path, 1, sensor=Sensor(drift_n_min=(0.0, 0.0, 0.0)))
    quiet = still.correct(still.log(still.first, still.planned, "log.csv"), stiffness)
    assert quiet.job.predicted.forces.zero_std < 0.3 * expected
    # By the arm's compliance it is part of what is stated, and nothing else has changed.
    both = np.intersect1d(corrected.job.predicted.targets[corrected.job.predicted.targets < 40], quiet.job.predicted.targets)
    wider, narrower = (one.sigma_um[both] for one in (corrected, quiet))
    softness = np.median(np.sqrt(np.maximum(wider**2 - narrower**2, 0)) / forces.zero_std)
    size, force = (np.linalg.norm(each, axis=1) for each in (
        1e6 * corrected.job.predicted.prediction.position, forces.wrench[corrected.job.predicted.targets, :3]))
    assert 0.5 < softness / np.median(size / force) < 2.5


def test_causes_that_are_known_leave_nothing(job: MillingJob, stiffness: Path, log: Path, corrected: Correction) -> None:
    deeper = job.correct(log, stiffness, settings(depth_of_cut=4e-3))
    assert rms(deeper.job.left.cut) < 0.4 * rms(corrected.job.left.cut)
    known = job.correct(log, stiffness, settings(cutting_stiffness=Estimate(25e3, 0.0)))
    assert not known.job.left.cut.any()
    assert np.allclose(known.job.left.sensor, 0.01 * np.linalg.norm(known.job.predicted.prediction.position, axis=1), rtol=0.2)


def test_nothing_gets_worse(first: Pass, corrected: Correction, second: Pass) -> None:
    assert not made_worse(first, second, corrected.sigma_um).any()
    # The other way round there is much that would count as worse.
    assert made_worse(second, first, corrected.sigma_um).mean() > 0.8


def test_literature_stiffness_leaves_more(job: MillingJob, first: Pass, second: Pass, log: Path) -> None:
    mirrored = job.mill(job.mirrored(log, job.springs("prior.json", np.array(PRIOR))))
    assert gone(job.first, mirrored) < gone(first, second) - 0.1


# Long: places that wait for the next log get better by it below.
@pytest.mark.long
def test_what_the_force_follows_goes_with_the_next_log(
    job: MillingJob, stiffness: Path, corrected: Correction, first: Pass, second: Pass
) -> None:
    """The corrected tool cuts deeper than the logged one. With its own log the planned program is corrected for that force;
    so it would have been at once, had the force stayed."""
    again = job.correct(job.log(second, corrected.commands, "pass2.csv", part=corrected.part), stiffness)
    third = job.mill(again.commands, part=again.part)
    held = job.mill(corrected.commands, first.force_n, part=corrected.part)
    wall = second.steps.place == PLACES.index("straight wall")
    assert np.median((np.linalg.norm(second.force_n, axis=1) / np.linalg.norm(first.force_n, axis=1).clip(1))[wall]) > 1.01
    for place in ("slot", "straight wall"):
        left = [1 - gone(before, one, place) for before, one in (
            (first, second), (job.first_with(again.part), third), (first, held))]
        assert left[1] < 0.75 * left[0]
        assert left[2] < 0.75 * left[0]


# Long: play that came to the robot is named and carried in test_part_causes.py; a tool stands on the plan with it in force in
# tests/compensator/correction/test_laws_effects_in_force.py.
@pytest.mark.long
def test_a_hidden_backlash_is_diagnosed_and_corrected(tmp_path: Path) -> None:
    """Half the gap is 60 um at the tool, either way as the force turns."""
    job = MillingJob(tmp_path, 7000, parse("backlash:1"), design="poses20", part=slot_and_pocket(pocket=False))
    extended, diagnosis = job.diagnose()
    assert [(cause["effect"], cause["joint"]) for cause in diagnosis["causes"]] == [("backlash", 1)]
    log = job.log(job.first, job.planned, "pass1.csv")
    named = job.correct(log, extended)
    # The plain model is rejected by its own measurements, and refused unless told.
    plain = job.correct(log, job.identify(), settings(accept_rejected=True))
    ignored = job.mill(plain.commands, part=plain.part)
    truth = job.mill(job.with_the_truth(named.job.planned.forces.wrench))
    share = gone(job.first_with(named.part), job.mill(named.commands, part=named.part), "slot")
    assert share > gone(job.first_with(plain.part), ignored, "slot") + 0.05
    assert share > 0.95 * gone(job.first, truth, "slot")


def test_places_that_wait_for_the_next_log_are_said_and_get_better_by_it(tmp_path: Path) -> None:
    """A soft arm in steel with all depths stated: few places wait, corners and entries, and by the log of the corrected pass
    what is really left there is a half or less."""
    soft = MillingJob(tmp_path, 500, design="poses20", part=slot_and_pocket(0.5, 0.8), cutter=STEEL)
    springs, known = soft.identify(), {"depth_of_cut": 0.8e-3, "slot_depth": SLOT_DEPTH * 1e-3}
    log = soft.log(soft.first, soft.planned, "log.csv")
    found = soft.correct(log, springs, settings(**known))
    second = soft.mill(found.commands, part=found.part)
    waits = found.job.waiting
    assert 5 < len(waits.targets) < 0.1 * len(found.job.correction.targets)
    places = {PLACES[place] for place in found.part.place[waits.targets]}
    assert places <= {"sharp corner", "rolled corner", "slot ends", "roll in and out"}
    (said,) = [finding for finding in found.job.findings if finding.code == "CS4115"]
    assert f"at {len(waits.targets)} targets" in said.message
    pass2 = soft.log(second, found.commands, "pass2.csv", part=found.part)
    again = settings(logged_with=soft.offsets(found, "applied.csv"), first_forces=log, **known)
    third = soft.correct(pass2, springs, again)
    assert not len(third.job.waiting.targets)
    done = soft.mill(third.commands, part=third.part)
    ends = np.isin(np.arange(len(found.part.target_mm)), waits.targets)
    steps, other = soft.first_with(found.part).steps, soft.first_with(third.part).steps
    there = ends[steps.segment] | ends[steps.segment - 1]
    now, then = np.linalg.norm(second.off_um, axis=1), np.linalg.norm(done.off_um, axis=1)
    then = np.interp(np.cumsum(steps.length_mm), np.cumsum(other.length_mm), then)
    assert rms(then[there]) < 0.5 * rms(now[there])
    assert rms(now[there]) > 2 * rms(now[~there & (now > 0)])

"""What is expected on the part: the cut by a stated depth, and what is left between targets, against independent figures."""

from __future__ import annotations

import math
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from compensator.correction.expected_left import _bent_and_turned
from compensator.correction.waiting import waiting
from tests.runs.milling.milling_job import MillingJob, rms, settings
from tests.virtual_cell.endmill import EndMill
from tests.virtual_cell.milled_part import PLACES, slot_and_pocket


def between(position: np.ndarray, deviation: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """How much bends and how much turns, by the planned positions (N, 3) [m] and the deviations (N, 3) [m] at those of them
    that have one."""
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(position, axis=0), axis=1))])
    path = SimpleNamespace(toolpath=position, length=length, rest_from_tcp=SimpleNamespace(position=position),
                           axes=SimpleNamespace(turned_to_rest=lambda vectors, rows: vectors))
    there = np.flatnonzero(np.isfinite(deviation[:, 0]))
    return _bent_and_turned(SimpleNamespace(path=path), SimpleNamespace(targets=there, position=deviation[there]))


@pytest.mark.parametrize("spacing", [0.4e-3, 1.1e-3])
def test_a_smooth_deviation_leaves_what_straight_lines_leave_of_it(spacing: float) -> None:
    place = np.arange(0.0, 40e-3, spacing)
    wave = np.column_stack([80e-6 * np.sin(place / 4e-3), 0 * place, 30e-6 * np.cos(place / 3e-3)])
    found, turned = between(np.column_stack([place, 0 * place, 0 * place]), wave)
    fine = np.linspace(place[1], place[-2], 20001)
    true = np.column_stack([80e-6 * np.sin(fine / 4e-3), 0 * fine, 30e-6 * np.cos(fine / 3e-3)])
    line = np.column_stack([np.interp(fine, place, axis) for axis in wave.T])
    left = np.sqrt(np.mean(np.sum((true - line) ** 2, axis=1)))
    assert np.sqrt(np.mean(found[2:-2] ** 2)) == pytest.approx(left, rel=0.15)
    assert not found[0], "no move goes to the first target"
    assert not turned.any()


def test_a_bend_at_a_target_is_one_of_the_moves_on_either_side_of_it() -> None:
    """At the fifth of ten targets 0.5 mm apart the deviation begins to grow by 20 um a millimetre, square to the way: a second
    derivative of that by 0.5 mm, there alone; its parabola over half a millimetre is off a line by c h^2 / sqrt(120)."""
    place = 0.5e-3 * np.arange(10)
    grows = np.column_stack([0 * place, 20e-3 * np.maximum(place - place[4], 0.0), 0 * place])
    found, turned = between(np.column_stack([place, 0 * place, 0 * place]), grows)
    assert 1e6 * found == pytest.approx(np.where(np.isin(np.arange(10), [4, 5]), 20 * 0.5 / np.sqrt(120), 0.0), abs=1e-9)
    assert not turned.any()


def test_a_force_that_begins_anywhere_on_a_move() -> None:
    """80 um from somewhere on the move on, drawn; the written line goes from none to all."""
    place = np.arange(10) * 0.4e-3
    deviation = np.where(np.arange(10)[:, None] < 4, np.nan, 80e-6 * np.array([0.0, 1.0, 0.0]))
    found, _ = between(np.column_stack([place, 0 * place, 0 * place]), deviation)
    begin, share = np.random.default_rng(5).random(4000)[:, None], np.linspace(0, 1, 201)
    assert found[4] == pytest.approx(80e-6 * rms(share - (share > begin)), rel=0.03)
    assert found[5:] == pytest.approx(0.0, abs=1e-12)
    ends, _ = between(np.column_stack([place, 0 * place, 0 * place]), deviation[::-1] * np.linspace(0.5, 1.4, 10)[:, None])
    assert ends[6] == pytest.approx(found[4]), "the same where it ends: the target behind has no force"
    assert ends[1:6] == pytest.approx(0.0, abs=1e-12)


def test_a_force_that_turns_with_each_straight_move_leaves_a_saw_tooth() -> None:
    """A circle of 60 chords; on each the push is square to it, at a target the mean of both sides."""
    angle = 2 * np.pi * np.arange(61) / 60
    ring = 10e-3 * np.column_stack([np.cos(angle), np.sin(angle), 0 * angle])
    middle = angle[:-1] + np.pi / 60
    push = 100e-6 * np.column_stack([np.cos(middle), np.sin(middle), 0 * middle])
    at_target = 0.5 * (push[:-1] + push[1:])
    _, found = between(ring[1:-1], at_target)
    share = np.linspace(0, 1, 201)[:, None]
    left = [np.sqrt(np.mean(np.sum((push[k] - (1 - share) * at_target[k - 1] - share * at_target[k]) ** 2, axis=1)))
            for k in range(1, 59)]
    assert found[2:-2] == pytest.approx(np.mean(left), rel=0.1)


@pytest.mark.parametrize("allowance", [0.8, pytest.param(1.5, marks=pytest.mark.long)])
def test_a_stated_depth_tells_the_cutting_stiffness_of_the_end_mill(tmp_path: Path, allowance: float) -> None:
    """How the push across of the virtual cell's own end mill grows at the wall; the tool that was logged stood aside."""
    job = MillingJob(tmp_path, 4, design="poses20", part=slot_and_pocket(spacing_mm=1.5, allowance_mm=allowance))
    stiffness = job.identify()
    made = job.correct(job.log(job.first, job.planned, "log.csv"), stiffness, settings(depth_of_cut=1e-3 * allowance))
    found = made.job.stiffness
    mill = EndMill()

    def push(depth: float) -> float:
        return float(mill.mean_force(mill.coverage(-mill.rim_mm[:, 1] - (mill.radius_mm - depth)), 4.0)[1])

    truth = 1e3 * (push(allowance + 0.05) - push(allowance - 0.05)) / 0.1
    assert found.origin == "depth"
    assert found.climb_only
    assert found.followed
    assert abs(found.value - truth) < found.std
    assert found.std < 0.35 * found.value


# Long: that nothing climbs in a slot is asked below, and the slot that is left alone in
# tests/runs/milling/test_milling_loop.py.
@pytest.mark.long
def test_what_is_known_of_a_wall_is_not_said_of_a_slot(tmp_path: Path) -> None:
    """What the growing force really leaves in the slot, the force of the first pass held against it, and what is stated."""
    job = MillingJob(tmp_path, 4, design="poses20")
    stiffness = job.identify()
    made = job.correct(job.log(job.first, job.planned, "log.csv"), stiffness, settings(depth_of_cut=1.5e-3))
    first = job.first_with(made.part)
    follows, held = job.mill(made.commands, part=made.part), job.mill(made.commands, first.force_n, part=made.part)
    slot = first.steps.place == PLACES.index("slot")
    real = np.linalg.norm(follows.off_um - held.off_um, axis=1)[slot]
    stated = np.zeros(len(made.part.target_mm))
    stated[made.job.correction.targets] = 1e6 * made.job.left.cut
    ratio = np.median(first.steps.between(stated)[slot]) / np.median(real)
    assert 0.5 < ratio < 2.5


def test_nothing_climbs_in_a_slot_alone(tmp_path: Path) -> None:
    job = MillingJob(tmp_path, 4, design="poses20", part=slot_and_pocket(pocket=False))
    stiffness = job.identify()
    log = job.log(job.first, job.planned, "log.csv")
    made, guessed = (job.correct(log, stiffness, settings(**stated)).job for stated in ({"depth_of_cut": 1.5e-3}, {}))
    assert made.stiffness is None
    said, = (finding.message for finding in made.findings if finding.code == "CS3241")
    assert "40 are needed" in said
    # A depth across the feed says nothing of a slot; that along the axis does: at twice the depth half as much is left of it.
    deep, shallow = (job.correct(log, stiffness, settings(slot_depth=1e-3 * depth)).job for depth in (3.0, 1.5))
    middle = [float(np.median(one.left.cut[one.left.cut > 0])) for one in (made, guessed, deep, shallow)]
    assert middle[0] == pytest.approx(middle[1])
    assert middle[2] == pytest.approx(0.5 * middle[3], rel=0.1)
    assert middle[3] < 0.5 * middle[1]
    assert guessed.left.at_slot_depths
    assert not shallow.left.at_slot_depths
    assert "CS3243" in [finding.code for finding in shallow.findings]


@pytest.mark.parametrize(("std", "cut", "deviation", "logged_with", "waits"), [
    (60e-6, 59e-6, 600e-6, None, True),         # 12.4 um stay: 95 um less, of 20 um of tolerance
    (60e-6, 59e-6, 600e-6, Path("first.csv"), False),
    (60e-6, 59e-6, 60e-6, None, False),         # nothing is gained where the correction left all of the deviation
    (45e-6, 45e-6, 450e-6, None, True),         # 81 um less
    (44e-6, 44e-6, 440e-6, None, False),        # 79 um less
    (300e-6, 250e-6, 3e-3, None, False),        # 268 um less, but more than half stays
    (300e-6, 262e-6, 3e-3, None, True),         # 148 um stay: just less than half
])
def test_a_target_waits_for_the_log_of_its_pass(std: float, cut: float, deviation: float, logged_with: Path | None,
                                                waits: bool) -> None:
    """Two sigma fall by more than four tolerances, and to less than half; written out by the root of the sum of squares of what
    goes with the cut, in the ratio of what is left to the deviation, and of what does not."""
    position = np.array([[0.0, 0.6 * deviation, 0.8 * deviation], [0.0, 0.0, 0.0]])
    job = SimpleNamespace(settings=SimpleNamespace(correction=SimpleNamespace(tolerance=20e-6, logged_with=logged_with)),
                          targets=np.array([3, 8]), prediction=SimpleNamespace(position=position))
    found = waiting(job, SimpleNamespace(std=np.array([std, 1e-6]), cut=np.array([cut, 0.5e-6])))
    assert found.targets.tolist() == [3] * waits
    assert found.then == pytest.approx([math.hypot(math.sqrt(std**2 - cut**2), cut * std / deviation)] * waits)
    assert found.as_dict()["two_sigma_um"] == pytest.approx(2e6 * std * waits)

"""Which moves are looked at between their targets, and in how short pieces, on a path and a log that are made here."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from compensator.correction import force_changes
from compensator.correction.force_changes import noise_of_one, pieces_to_look_at, shortest_piece
from compensator.correction.settings import CorrectionSettings
from identification.model.kinematics import forward
from identification.model.rotations import Frame, rotation_vector
from tests.support import robot

COMPLIANCE = 1e-6 * np.array([0.2, 0.3, 0.25, 1.0, 1.5, 2.0])
TOOL = Frame(np.eye(3), np.array([0.1, 0.0, 0.25]))
START = np.array([0.1, 0.2, -0.3, 0.2, 0.8, 0.1])


def softest(theta: np.ndarray) -> tuple[float, float]:
    """How far a newton, and a newton metre, move the tool at most: by differences of the forward kinematics."""
    found = np.zeros(2)
    for angles in theta:
        there = forward(robot(), angles[None], TOOL)
        columns = []
        for joint in range(6):
            moved = forward(robot(), (angles + 1e-6 * np.eye(6)[joint])[None], TOOL)
            turn = rotation_vector(moved.rotation @ np.swapaxes(there.rotation, 1, 2))
            columns.append(np.concatenate([moved.position[0] - there.position[0], turn[0]]) / 1e-6)
        matrix = np.array(columns).T @ np.diag(COMPLIANCE) @ np.array(columns)
        found = np.maximum(found, [np.linalg.norm(matrix[:3, :3], 2), np.linalg.norm(matrix[:3, 3:], 2)])
    return float(found[0]), float(found[1])


def planned(length_mm: list[float], forced: list[bool], place_mm: np.ndarray, force: np.ndarray, **told: Any) -> Any:
    """A program with a log by path length; told: moments of the log, tolerance [m], feed [m/s], lines."""
    moment = told.get("moment")
    log = SimpleNamespace(place=1e-3 * place_mm, weight=np.full(len(place_mm), told.get("weight", 1.0)), force=force,
                          moment=np.zeros_like(force) if moment is None else moment, has_moment=moment is not None,
                          lines_left=told.get("lines", 0.0))
    count = len(length_mm)
    theta = START + np.linspace(0, 0.4, count)[:, None] * [1, -0.5, 0.4, 0, 0.6, 0]
    path = SimpleNamespace(length=1e-3 * np.array(length_mm), theta=theta,
                           toolpath=SimpleNamespace(feed=np.full(count, told.get("feed", np.nan))),
                           each_tool=lambda targets: [(TOOL, np.arange(len(targets)))])
    return SimpleNamespace(
        path=path, targets=np.flatnonzero(forced), model=SimpleNamespace(robot=robot(), compliance=COMPLIANCE),
        forces=SimpleNamespace(forced=np.array(forced), named=told.get("named", False), log=log),
        settings=SimpleNamespace(correction=CorrectionSettings(tolerance=told.get("tolerance", 5e-6))))


LENGTH = [0.0, 10, 20, 50, 79.9, 120, 160, 200]
CUT = [False, True, True, True, True, True, False, False]
PLACE = np.arange(0.05, 200, 0.1)


@pytest.mark.parametrize(("named", "long"), [(False, [3, 5, 6]), (True, [3, 5])])
@pytest.mark.parametrize(("spacing_mm", "piece_mm"), [(1.0, 3.0), (4.0, 4.0)])
def test_moves_of_three_centimetres_are_looked_at_beside_a_force(
    named: bool, long: list[int], spacing_mm: float, piece_mm: float
) -> None:
    """In pieces of 3 mm, or as close as targets may stand; of a log that names targets only between two with force."""
    job = planned(LENGTH, CUT, PLACE, np.tile([0.0, 100, 0], (len(PLACE), 1)), named=named)
    found = pieces_to_look_at(job, np.full(8, 1e-3 * spacing_mm), 0.0)
    np.testing.assert_allclose(1e3 * found, [piece_mm if k in long else np.inf for k in range(8)])


def bump(at_mm: float, height: float) -> np.ndarray:
    return np.column_stack([0 * PLACE, 100 + height * np.maximum(1 - np.abs(PLACE - at_mm) / 2, 0), 0 * PLACE])


@pytest.mark.parametrize(("shortest", "feed", "piece_mm"), [
    (0.0, np.nan, 0.4), (0.009, 0.05, 0.45), (0.1, np.nan, 0.4), (0.1, 0.05, 1.0)])
def test_a_move_whose_force_is_no_straight_line_is_looked_at_and_those_beside_it(
    shortest: float, feed: float, piece_mm: float
) -> None:
    """A peak of 60 N, 4 mm wide, amid a move of 30 mm: a mean over a millimetre shows 45 N of it, and the means of both targets
    some 2.5 N. Where 40 N move the tool by half the tolerance it is looked at, where 45 do it is not. In pieces of a third of
    the closest, of four samples, or of the time that is asked for, whichever is longest, and no longer than the closest."""
    cut = [True] * 8
    soft, _ = softest(planned(LENGTH, cut, PLACE, bump(35, 60.0)).path.theta)
    spacing = np.full(8, 1e-3)
    long = np.where(np.isin(np.arange(8), [3, 5, 6, 7]), 3.0, np.inf)
    asks = planned(LENGTH, cut, PLACE, bump(35, 60.0), tolerance=2 * 40 * soft, feed=feed)
    found = pieces_to_look_at(asks, spacing, shortest)
    np.testing.assert_allclose(1e3 * found, np.where(np.isin(np.arange(8), [2, 3, 4]), piece_mm, long))
    idle = planned(LENGTH, cut, PLACE, bump(35, 60.0), tolerance=2 * 45 * soft, feed=feed)
    np.testing.assert_allclose(1e3 * pieces_to_look_at(idle, spacing, shortest), long)


def test_a_move_without_room_or_without_samples_asks_for_nothing() -> None:
    """Room for a target at every half of it; a sample in each half."""
    cut, soft = [True] * 8, softest(planned(LENGTH, [True] * 8, PLACE, bump(15, 60.0)).path.theta)[0]
    for spacing_mm, asks in ((4.9, True), (5.1, False)):
        job = planned(LENGTH, cut, PLACE, bump(12.5, 80.0), tolerance=10 * soft)
        found = pieces_to_look_at(job, np.full(8, 1e-3 * spacing_mm), 0.0)
        assert np.isfinite(found[2]) == asks
    there = (PLACE < 10) | (PLACE > 20)
    job = planned(LENGTH, cut, PLACE[there], bump(15, 60.0)[there], tolerance=10 * soft)
    assert not np.isfinite(pieces_to_look_at(job, np.full(8, 1e-3), 0.0)[[1, 2]]).any()


@pytest.mark.parametrize(("off", "asks"), [
    ((60, -60, 60, -60), True), ((60, -60, 0, 0), True), ((0, 0, 0, 60), True), ((40, -40, 0, 0), False)])
def test_four_samples_of_a_move_stand_for_a_quarter_of_it_each(off: tuple[float, ...], asks: bool) -> None:
    """From 20 to 50 mm, the last of them at the target itself: newtons beside 100, of which 50 move the tool by half the
    tolerance. Under half of a move there is no shape that two samples to and fro do not cancel."""
    few = np.array([21, 29, 37, 50.0])
    place = np.concatenate([PLACE[PLACE < 20], few, PLACE[PLACE > 50]])
    force = np.outer(np.where(np.isin(place, few), 100 + np.interp(place, few, off), 100), [0.0, 1, 0])
    cut = [True] * 8
    job = planned(LENGTH, cut, place, force)
    job = planned(LENGTH, cut, place, force, tolerance=2 * 50 * softest(job.path.theta)[0])
    assert np.isfinite(pieces_to_look_at(job, np.full(8, 1e-3), 0.0))[[1, 2, 4]].tolist() == [False, asks, asks]


def test_a_move_from_or_to_a_target_without_samples_asks_for_nothing() -> None:
    """None within half of the way to its neighbours, from 15 to 35 mm: a force that stays is no force that began there."""
    place = PLACE[(PLACE < 15) | (PLACE > 35)]
    job = planned(LENGTH, [True] * 8, place, np.tile([0.0, 100, 0], (len(place), 1)))
    assert not np.isfinite(pieces_to_look_at(job, np.full(8, 1e-3), 0.0))[[1, 2, 4]].any()


def test_where_a_force_begins_three_pieces_lie_between_two_places_of_targets() -> None:
    """Of 1.8 mm: 0.6, where four samples take 0.4."""
    found = pieces_to_look_at(planned(LENGTH, [True] * 8, PLACE, bump(35, 60.0)), np.full(8, 1.8e-3), 0.0)
    assert 1e3 * found[[2, 3, 4]] == pytest.approx(0.6)


def test_what_lies_on_a_move_ends_at_its_target() -> None:
    job = planned([0.0, 10, 20], [True] * 3, np.array([-0.1, 0.0, 5, 10, 10.1, 20, 20.1, np.nan]), np.zeros((8, 3)))
    rows, move = force_changes._on_moves(job)
    assert (rows.tolist(), move.tolist()) == ([1, 2, 3, 4, 5], [1, 1, 1, 2, 2])
    np.testing.assert_allclose(force_changes._between_samples(job, np.array([0.0, 0.01, 0.02]))[1:], [0.01 / 3, 0.01])


@pytest.mark.parametrize("moments", [False, True])
def test_means_are_of_the_samples_behind_each_row(moments: bool) -> None:
    """Rows that are means of several count as often; what has no sample is nothing, and so are moments that nobody logged."""
    force, moment = np.array([[1.0, 2, 3], [4, 5, 6], [7, 8, 9]]), np.array([[0.1, 0.2, 0.3], [0.4, 0.5, 0.6], [0.7, 0.8, 0.9]])
    job = planned([0.0, 1], [True] * 2, np.zeros(3), force, moment=moment if moments else None)
    job.forces.log.weight = np.array([3.0, 9.0, 1.0])
    weight, mean = force_changes._means(job.forces.log, np.array([0, 2]), np.array([1, 1]), 3)
    np.testing.assert_allclose(weight, [0, 4, 0])
    np.testing.assert_allclose(mean[1, :3], (3 * force[0] + force[2]) / 4)
    np.testing.assert_allclose(mean[1, 3:], moments * (3 * moment[0] + moment[2]) / 4)
    assert not mean[[0, 2]].any()


def test_the_shortest_piece_keeps_the_spindles_lines_below_half_the_tolerance() -> None:
    """A mean over T seconds keeps 1/T of what one over a second does, three times as much in places."""
    job = planned([0.0, 1], [True] * 2, np.zeros(1), np.zeros((1, 3)), lines=0.02, tolerance=8e-6)
    time = shortest_piece(job)
    assert 3 * 0.02 / time * softest(job.path.theta)[0] == pytest.approx(4e-6, rel=1e-4)
    job.forces.log.lines_left = 0.0
    assert shortest_piece(job) == 0.0


def test_the_arm_is_as_soft_as_where_it_is_softest() -> None:
    """By forces and by moments, whatever their direction."""
    job = planned([0.0, 1, 2], [False, True, True], np.zeros(1), np.zeros((1, 3)))
    by_force, by_moment = softest(job.path.theta[1:])
    np.testing.assert_allclose(force_changes._softness(job), np.repeat([by_force, by_moment], 3), rtol=1e-4)


@pytest.mark.parametrize(("count", "beside", "tells"), [
    (16, 0, True), (15, 0, False), (4, 0, False), (20, 4, True), (20, 5, False)])
def test_twelve_places_tell_the_noise(count: int, beside: int, tells: bool) -> None:
    """Each with two neighbours on either side that count; steps of one place are passed over."""
    mean = np.column_stack([100 * (-1.0) ** np.arange(count), np.arange(count) ** 3.0])
    counted = np.arange(count) >= beside
    found = noise_of_one(mean, np.full(count, 4.0), counted)
    assert bool(found[0]) == tells
    if tells:
        # To and fro by 100 a place is off the cubic by 100 + (8 100 + 2 100) / 6, of means of four.
        share = 1 / 4 + (2 * 16 / 4 + 2 / 4) / 36
        np.testing.assert_allclose(found, [(100 + (800 + 200) / 6) / np.sqrt(share) / 0.6745, 0.0], atol=1e-9)


def test_a_program_of_one_target_has_no_move_to_look_at() -> None:
    job = planned([0.0], [True], np.zeros(3), np.tile([0.0, 100, 0], (3, 1)))
    assert pieces_to_look_at(job, np.full(1, 1e-3), 0.0).tolist() == [np.inf]

"""Offsets that a pass had at its targets and between them, two passes held against each other, and what a sensor that is turned
and springs known to a factor make of a deviation: by fine steps, differences and draws."""

from __future__ import annotations

import itertools
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy import stats
from scipy.spatial.transform import Rotation

from compensator.correction import pass_offsets
from compensator.correction.before_touch import held_beside_air
from compensator.correction.logged_pass import known_by_depth, known_by_force, pass_pair
from compensator.correction.pass_offsets import PassOffsets
from compensator.correction.turned_sensor import by_turned_sensor, lever_of, mounting_std
from compensator.correction.wide_springs import WideSprings
from identification.common.findings import CompstiffError, Finding
from identification.model.rotations import Frame
from tests.compensator.correction.test_laws_following import planned

PLACES = np.array([0.0, 4, 4, 10, 25])              # of the targets as given [mm]
GIVEN = 1e-6 * np.array([[0.0, 0, 1], [10, 0, 2], [30, 5, 3], [-20, 8, 4], [40, 0, 5]])
# At a quarter and at half of the move to the last, and half way to the second.
BEFORE, SHARE = np.array([1, 4, 4]), np.array([0.5, 0.2, 0.6])
ADDED = 1e-6 * np.array([[90.0, 0, 0], [0, 50, 0], [0, -50, 7]])
MOVES = PassOffsets(GIVEN, BEFORE, SHARE, ADDED)
ORDER = [0, 2, 4, 4, 10, 13, 19, 25]


def path_of(places_mm: np.ndarray) -> Any:
    return SimpleNamespace(length=1e-3 * np.array(places_mm, dtype=float), toolpath=np.zeros(len(places_mm)))


def everywhere(place_mm: np.ndarray) -> np.ndarray:
    """The straight lines between all targets."""
    values = np.vstack([GIVEN[0], ADDED[0], GIVEN[1], GIVEN[2], GIVEN[3], ADDED[1], ADDED[2], GIVEN[4]])
    return np.column_stack([np.interp(place_mm, ORDER, axis) for axis in values.T])


def test_offsets_are_straight_between_all_targets() -> None:
    np.testing.assert_allclose(1e3 * MOVES.length(1e-3 * PLACES), ORDER)
    at = np.array([0.0, 1, 3, 7, 11.5, 16, 22, 25, 30])
    np.testing.assert_allclose(MOVES.at(path_of(PLACES), 1e-3 * at), everywhere(at), atol=1e-12)
    assert len(MOVES.without_added().added) == len(MOVES.without_added().before) == len(MOVES.without_added().share) == 0
    np.testing.assert_array_equal(MOVES.without_added().given, GIVEN)


@pytest.mark.parametrize(("targets_mm", "kept"), [(PLACES, None), ([0, 1, 4, 4, 7, 10, 25], [0, 2, 3, 5, 6])])
def test_what_a_target_had_is_the_mean_over_half_the_way_to_its_neighbours(targets_mm: Any, kept: Any) -> None:
    """By fine steps; at a place that two targets share, each with the half of its own move."""
    places = np.array(targets_mm, dtype=float)
    found = MOVES.over(path_of(places), None if kept is None else np.array(kept))
    borders = np.concatenate([places[:1], 0.5 * (places[1:] + places[:-1]), places[-1:]])
    for number, (low, high) in enumerate(itertools.pairwise(borders)):
        # From either side of the place of two targets: what stands there itself is of no width.
        steps = np.linspace(low, high, 40_001)
        mean = np.mean(everywhere(0.5 * (steps[1:] + steps[:-1])), axis=0)
        np.testing.assert_allclose(found[number], mean, atol=2e-9, err_msg=str(number))


def test_a_target_on_which_no_way_is_has_its_own_offset() -> None:
    """Three at one place; and of a program without added targets each has its own."""
    given = 1e-6 * np.arange(12.0).reshape(4, 3)
    one = PassOffsets(given, np.array([1]), np.array([0.5]), np.array([[9e-6, 9e-6, 9e-6]]))
    found = one.over(path_of(np.array([0.0, 5, 5, 5])))
    np.testing.assert_allclose(found[2], given[2])
    plain = PassOffsets.at_targets(given)
    np.testing.assert_array_equal(plain.over(path_of(np.array([0.0, 1, 2, 3]))), given)
    np.testing.assert_array_equal(plain.offset, given)
    assert len(plain.share) == len(plain.added) == 0


@pytest.mark.parametrize(("told", "added"), [
    ({"along": "added"}, True), ({"along": "given"}, False), ({"along": "given", "beside": None}, True),
    ({"along": "given", "driven": True}, True), ({"key": "target"}, False), ({"key": "target", "codes": ("CS4127",)}, True)])
def test_a_pass_had_the_added_targets_where_its_log_shows_so(
    monkeypatch: pytest.MonkeyPatch, told: dict[str, Any], added: bool
) -> None:
    """By the places beside the path, where they are known, to 10 um; by the numbers of the written program. A log that tells
    neither, or axes that drive, leave it at what was written."""
    path = path_of(PLACES)
    path.axes = SimpleNamespace(driven=told.get("driven", False), world_from_base=SimpleNamespace(
        inverse=lambda: SimpleNamespace(turn=lambda vectors: -vectors)))
    place = 1e-3 * np.linspace(0, 25, 200)
    there = (MOVES if told.get("along") == "added" else MOVES.without_added()).at(path, place)
    beside = -there + 1e-5 * np.random.default_rng(1).standard_normal((200, 3))
    beside[3], place[7] = np.nan, np.nan
    log = SimpleNamespace(key=told.get("key", "position"), place=place, beside=told.get("beside", beside), findings=tuple(
        Finding(code, "note", "") for code in told.get("codes", ("CS3001",))))
    monkeypatch.setattr(pass_offsets, "read_offsets", lambda file, path: MOVES)
    job: Any = SimpleNamespace(forces=SimpleNamespace(log=log), path=path)
    assert len(pass_offsets.offsets_of_pass(Path("offsets.csv"), job).before) == 3 * added


def test_what_is_written_is_split_into_given_and_added_again() -> None:
    """W targets in order; and of some of the given ones the added are kept whose move is still there."""
    written, kept = MOVES.offset, np.array([0, 2, 3, 4, 7])
    again = PassOffsets.of_written(written, path_of(np.array(ORDER)), kept)
    np.testing.assert_array_equal(again.given, GIVEN)
    np.testing.assert_array_equal(again.added, ADDED)
    assert again.before.tolist() == BEFORE.tolist()
    np.testing.assert_allclose(again.share, SHARE)
    some = MOVES.some(np.array([0, 2, 3, 4]))
    np.testing.assert_array_equal(some.given, GIVEN[[0, 2, 3, 4]])
    assert (some.before.tolist(), some.share.tolist()) == ([3, 3], [0.2, 0.6])
    np.testing.assert_array_equal(some.added, ADDED[1:])
    assert MOVES.some(np.array([0, 1])).before.tolist() == [1]
    assert MOVES.some(np.array([2, 3])).before.tolist() == []


def test_two_passes_are_held_against_each_other_along_the_first_push() -> None:
    """By how much deeper the second stood, along the force's part across the feed, and by how much that grew; its error that of
    both logs along it. Targets without force in either, or without a push, count for nothing."""
    count = 44
    first = planned([[5, 30, 40]] * 42 + [[90, 0, 0], [5, 30, 40]], list(range(count)), [[1, 50, 20]] * count)
    second = planned([[9, 36, 42]] * 43 + [[0, 0, 0]], list(range(count)), [[2, 60, 25]] * 43)
    first.forces.standard_error = np.tile([9, 3, 4.0], (count, 1))
    second.forces.standard_error = np.tile([9, 6, np.nan], (count, 1))
    found = pass_pair(first, second, np.tile([0, -100e-6, 0], (count, 1)))
    n = np.array([0, 0.6, 0.8])
    np.testing.assert_allclose(found.direction, np.tile(n, (42, 1)))
    np.testing.assert_allclose(found.change, 0.6 * 6 + 0.8 * 2)
    np.testing.assert_allclose(found.depth, 1e-6 * (0.6 * (50 - 60 + 100) + 0.8 * (20 - 25)))
    np.testing.assert_allclose(found.error, np.sqrt(0.36 * (9 + 36) + 0.64 * 16))


@pytest.mark.parametrize(("count", "enough"), [(40, True), (39, False)])
def test_forty_targets_in_both_passes_are_needed(count: int, enough: bool) -> None:
    one = planned([[5, 30, 40]] * count, list(range(count)), [[1, 50, 20]] * count)
    one.forces.standard_error = np.zeros((count, 3))
    if enough:
        assert len(pass_pair(one, one, np.zeros((count, 3))).depth) == 40
        return
    with pytest.raises(CompstiffError, match="CS4122.*only 39 targets with force in both, expected at least 40"):
        pass_pair(one, one, np.zeros((count, 3)))


@pytest.mark.parametrize("offset_um", [0.0, -120.0])
def test_a_stated_depth_and_the_push_there_tell_how_stiff_a_climbing_cut_is(offset_um: float) -> None:
    """The middle of three quarters of the push by the depth that was cut, 60 um aside of 1 mm and its offset, known to 0.3."""
    push = np.linspace(80, 120, 45)
    force = np.column_stack([60 + 0 * push, push, 0 * push])
    job = planned(force.tolist(), list(range(45)), [[0, 60, 0]] * 45, depth_of_cut=1e-3)
    found, [said] = known_by_depth(job, np.tile([0, 1e-6 * offset_um, 0], (45, 1)) if offset_um else None)
    law = stats.lognorm(0.3, scale=0.75 * 100 / (1e-3 - 60e-6 - 1e-6 * offset_um))
    assert found is not None
    assert (found.value, found.std, found.mean_std) == pytest.approx((law.mean(), law.std(), law.std()))
    assert (found.origin, found.climb_only) == ("depth", True)
    assert (said.code, said.message) == ("CS3240", f"cutting stiffness by a depth of 1 mm: {found.words()}")
    by_force = known_by_force(job)
    assert by_force is not None
    assert by_force.value == pytest.approx(stats.lognorm(0.8, scale=0.75 * 100 / 1e-3).mean())


def test_where_nothing_pushes_across_no_force_tells_a_cut() -> None:
    """Of few that do the middle is theirs; where no depth is stated it is taken as 0.75 mm."""
    few = planned([[90, 0, 0]] * 5 + [[0, 30, 0]] * 2, list(range(7)), [[0, 0, 0]] * 7)
    found = known_by_force(few)
    assert found is not None
    assert found.value == pytest.approx(stats.lognorm(0.8, scale=0.75 * 30 / 0.75e-3).mean())
    assert known_by_force(planned([[90, 0, 0]] * 5, list(range(5)), [[0, 0, 0]] * 5)) is None
    assert known_by_depth(few) == (None, ())


@pytest.mark.parametrize(("share", "sigma_um", "made"), [
    (0.0, 1.0, 1.0), (0.3, 10.0, 1 / 3), (0.3, 31.0, 1.0), (0.049, 1.0, 1.0), (0.051, 1.0, 1 / 5.1)])
def test_an_offset_beside_air_is_off_there_by_one_sigma_at_most(share: float, sigma_um: float, made: float) -> None:
    """Of 100 um, where the line is off in the air by more than 5 um."""
    offset = 1e-6 * np.array([[0.0, 60, 80]])
    found = held_beside_air(offset, np.array([share]), np.array([1e-6 * sigma_um]), 5e-6)
    np.testing.assert_allclose(found, made * offset)


def test_a_turned_sensor_turns_force_and_moment_about_its_origin() -> None:
    """By draws: the wrench at the sensor's origin turned about each of its axes by a small angle, the springs under it."""
    rng = np.random.default_rng(8)
    columns, compliance = rng.standard_normal((6, 6, 2)), 1e-6 * rng.uniform(0.5, 2, 6)
    wrench, lever = 50 * rng.standard_normal((2, 6)), 0.2 * rng.standard_normal((2, 3))
    found = by_turned_sensor(columns, compliance, wrench, lever, 0.01)
    for k in range(2):
        expected = np.zeros((3, 3))
        for axis in np.eye(3):
            turn = Rotation.from_rotvec(1e-6 * axis)
            force, moment = wrench[k, :3], wrench[k, 3:]
            of_sensor = moment - np.cross(lever[k], force)          # about the origin of the sensor
            other = np.concatenate([turn.apply(force), turn.apply(of_sensor) + np.cross(lever[k], turn.apply(force))])
            torque = columns[:, :, k] @ (other - wrench[k]) / 1e-6
            moved = columns[:, :3, k].T @ (compliance * torque)
            expected += 0.01**2 * np.outer(moved, moved)
        np.testing.assert_allclose(found[:, :, k], expected, rtol=1e-4, atol=1e-6 * np.abs(expected).max())


@pytest.mark.parametrize(("kind", "moments", "placed", "there"), [
    ("sensor", True, True, True), ("sensor", False, True, False), ("tool", True, True, False), ("sensor", True, False, False)])
def test_moments_turn_about_the_sensor_where_its_place_is_known(kind: str, moments: bool, placed: bool, there: bool) -> None:
    """Else the logged forces are taken as at the tool."""
    flange = Frame(np.tile(np.eye(3), (3, 1, 1)), np.tile([1.0, 0, 1], (3, 1)))
    stated = SimpleNamespace(kind=kind, flange_from_sensor=Frame(np.eye(3), np.array([0, 0, 0.1])) if placed else None,
                             form=SimpleNamespace(mounting_std_deg=0.5))
    loaded: Any = SimpleNamespace(
        targets=np.array([0, 2]), forces=SimpleNamespace(log=SimpleNamespace(has_moment=moments)),
        path=SimpleNamespace(cell=SimpleNamespace(force_log=stated), base_from_flange=flange,
                             base_from_tcp=SimpleNamespace(position=np.array([[1, 0, 1.3], [0, 0, 0], [1, 0.2, 1.3]]))))
    np.testing.assert_allclose(lever_of(loaded), np.array([[0, 0, -0.2], [0, -0.2, -0.2]]) * there, atol=1e-12)
    assert mounting_std(loaded) == pytest.approx(0.5 * np.pi / 180)
    stated.form.mounting_std_deg = None
    assert mounting_std(loaded) == 0


@pytest.mark.parametrize(("std", "wide"), [(0.099, False), (0.101, True)])
def test_springs_are_wide_from_a_tenth_on(std: float, wide: bool) -> None:
    """Of the least known; then their mean and covariance are those of log-normal compliances, by draws, and what is lacking to
    first order counts as a mean square."""
    rng = np.random.default_rng(9)
    model: Any = SimpleNamespace(covariance=np.diag([1e-4, std**2, 1e-4, 1e-4, 1e-4, 1e-4, 9.0]), compliance=1e-6 * np.ones(6))
    assert (WideSprings.of(model, 2) is not None) == wide
    root = 0.3 * rng.standard_normal((6, 6))
    model.covariance = root @ root.T
    columns, wrench = rng.standard_normal((6, 6, 2)), 100 * rng.standard_normal((2, 6))
    one = WideSprings.of(model, 3)
    assert one is not None
    one.put(np.array([0, 2]), model, columns, wrench)
    drawn = np.exp(rng.multivariate_normal(np.zeros(6), model.covariance, 400_000))
    for place, k in ((0, 0), (2, 1)):
        pushed = columns[:, :3, k] * (1e-6 * columns[:, :, k] @ wrench[k])[:, None]
        deviation = drawn @ pushed
        shift = deviation.mean(axis=0) - pushed.sum(axis=0)
        covariance = np.cov(deviation.T)
        np.testing.assert_allclose(one.shift[place], shift, atol=0.01 * np.abs(shift).max())
        np.testing.assert_allclose(one.covariance[place], covariance, atol=0.06 * np.abs(covariance).max())
        first = pushed.T @ model.covariance @ pushed
        np.testing.assert_allclose(one.first[place], first)
        more = np.trace(one.covariance[place] - first) + one.shift[place] @ one.shift[place]
        assert one.missing[place] == pytest.approx(more)

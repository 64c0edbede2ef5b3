"""What a program takes of a measured part beside the springs, and the places that carry it."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from compensator.learned.learned import JobFrame, Learned
from compensator.learned.remainder import Remainder, kernel, spread_out
from identification.model.effects import effects
from identification.model.effects_in_force import EffectInForce
from identification.model.rotations import Frame


@pytest.mark.parametrize("most", [1, 2, 7, 40, 90])
def test_each_place_is_the_farthest_from_those_before_it(most: int) -> None:
    """By position in shares of the length, and by joint angles as points on circles of half a radian; the first is the one
    nearest to the middle, and of places that are there twice one is taken."""
    rng = np.random.default_rng(most)
    position, theta, length = 0.2 * rng.standard_normal((60, 3)), rng.uniform(-3, 3, (60, 6)), 0.13
    position[40:], theta[40:] = position[:20], theta[:20]
    points = np.hstack([position / length, 2 * np.cos(theta), 2 * np.sin(theta)])
    chosen = [min(range(60), key=lambda k: float(np.linalg.norm(points[k] - points.mean(axis=0))))]
    while len(chosen) < min(most, 40):
        chosen.append(max(range(60), key=lambda k: min(float(np.linalg.norm(points[k] - points[j])) for j in chosen)))
    assert spread_out(position, theta, length, most).tolist() == chosen


def test_a_remainder_is_known_at_its_places_and_as_wide_as_before_between_them() -> None:
    """Weights are those of the process: at a place all of its variance is told, far away none."""
    rng = np.random.default_rng(2)
    places, posture = 0.3 * rng.standard_normal((5, 3)), 0.2 * rng.standard_normal((5, 6))
    remainder = Remainder(places, posture, 0.1, 20e-6)
    there = remainder.basis(places, posture)
    np.testing.assert_allclose(remainder.unseen(there), 0.0, atol=1e-5 * 400e-12)
    points = np.hstack([places / 0.1, 2 * np.cos(posture), 2 * np.sin(posture)])
    r = np.sqrt(5) * np.linalg.norm(points[:, None] - points, axis=2)
    np.testing.assert_allclose(there @ there.T, (1 + r + r * r / 3) * np.exp(-r), atol=1e-5)
    np.testing.assert_allclose(kernel(points, points), (1 + r + r * r / 3) * np.exp(-r), atol=1e-7)
    nowhere = np.vstack([places[0] + [9.0, 0, 0], np.full(3, np.nan)])
    basis = remainder.basis(nowhere, np.vstack([posture[0], np.full(6, np.nan)]))
    np.testing.assert_allclose(basis, 0.0, atol=1e-12)
    np.testing.assert_allclose(remainder.unseen(basis), 400e-12)


@pytest.mark.parametrize("turned", [False, True])
def test_a_program_takes_set_up_drift_and_remainder_where_it_stands(turned: bool) -> None:
    """Worked out place by place: a set-up that shifts and turns about the middle of the measured part, along with the table it
    stands on; a drift in the base that grows until the job's end, by the times of the moves that are known; and what its one
    place carries. Springs, and effects that the part showed, are not in it."""
    of_rod = EffectInForce(effects()["parallelogram"], None)
    shift, turn, drift, weight = np.array([40e-6, -10e-6, 5e-6]), np.array([0.0, 30e-6, -20e-6]), np.array([0, 9e-6, -3e-6]), (
        np.array([7e-6, -2e-6, 11e-6]))
    own = len(of_rod.effect.parameters)
    assert own > 0
    mean = np.concatenate([np.full(6 + own, 5.0), shift, turn, drift, weight])
    frame = JobFrame(Frame.identity(), np.array([1.0, 0.2, 0.5]), 0.08, 50.0)
    learned = Learned(np.zeros(6), mean, np.eye(len(mean)), frame, Remainder(
        np.array([[1.0, 0.1, 0.5]]), np.zeros((1, 6)), 0.2, 30e-6), (of_rod,))
    assert learned.springs == 6 + own
    rest_position = np.array([[9.0, 9, 9], [1.1, 0.1, 0.5], [1.0, 0.2, 0.7], [0.9, 0.3, 0.4]])
    base_position = rest_position + np.array([0, 0, 0.01])
    tables = Rotation.from_rotvec([[0, 0, 0.1 * k] for k in range(4)]).as_matrix()
    path: Any = SimpleNamespace(
        base_from_tcp=SimpleNamespace(position=base_position), rest_from_tcp=SimpleNamespace(position=rest_position),
        theta=np.zeros((4, 6)), move_time=np.array([np.nan, 20.0, np.inf, 40.0]),
        axes=SimpleNamespace(base_from_rest=SimpleNamespace(rotation=tables) if turned else None))
    found = learned.rest(path, np.array([1, 2, 3]))
    for place, target, share in ((0, 1, 0.4), (1, 2, 0.4), (2, 3, 1.0)):
        moved = shift + np.cross(turn, (rest_position[target] - frame.centre) / 0.08)
        expected = (tables[target] @ moved if turned else moved) + share * drift
        r = np.sqrt(5) * np.linalg.norm(base_position[target] - [1.0, 0.1, 0.5]) / 0.2
        expected = expected + (1 + r + r * r / 3) * np.exp(-r) * weight
        np.testing.assert_allclose(found.mean[place], expected, rtol=1e-5, atol=1e-12)
        # Half of the remainder's variance is told there.
        assert bool(found.inside[place]) is bool(((1 + r + r * r / 3) * np.exp(-r)) ** 2 >= 0.5)
    assert found.inside.tolist() == [True, False, False]


def test_nothing_drifts_in_a_job_that_takes_no_time() -> None:
    frame = JobFrame(Frame.identity(), np.zeros(3), 0.1, 0.0)
    assert not frame.columns(np.ones((2, 3)), np.array([0.0, 5.0]))[:, :, 6:].any()


def test_a_job_of_less_than_a_second_drifts_too() -> None:
    frame = JobFrame(Frame.identity(), np.zeros(3), 0.1, 0.8)
    found = frame.columns(np.ones((3, 3)), np.array([0.0, 0.2, 0.8]))[:, :, 6:]
    np.testing.assert_allclose(found, np.array([0.0, 0.25, 1.0])[:, None, None] * np.eye(3))


@pytest.mark.parametrize(("repeats", "kept"), [("job", (True, True)), ("setup", (True, False)), ("nothing", (False, False))])
def test_a_program_takes_of_set_up_and_drift_what_repeats(repeats: Any, kept: tuple[bool, bool]) -> None:
    """All of both or nothing, in the mean, in every covariance with it, and in what no point showed of the set-up; springs and
    remainder always."""
    rng = np.random.default_rng(7)
    root, blind = rng.standard_normal((18, 18)), rng.standard_normal((9, 9))
    given = Learned(np.zeros(6), rng.standard_normal(18), root @ root.T, JobFrame(Frame.identity(), np.zeros(3), 1.0, 1.0),
                    Remainder(np.zeros((1, 3)), np.zeros((1, 6)), 1.0, 1.0), unshown=blind @ blind.T)
    taken = given.carried(repeats)
    stays = np.ones(18, dtype=bool)
    stays[6:12], stays[12:15] = kept
    np.testing.assert_array_equal(taken.mean, np.where(stays, given.mean, 0.0))
    np.testing.assert_array_equal(taken.covariance, np.where(np.outer(stays, stays), given.covariance, 0.0))
    # A drift that nobody knows when to expect is as wide as it was found, with nothing of it shared with the set-up.
    of_drift = given.unshown[6:, 6:] + given.covariance[12:15, 12:15] + np.outer(given.mean[12:15], given.mean[12:15])
    expected = given.unshown if kept[1] else np.block([
        [given.unshown[:6, :6] * kept[0], np.zeros((6, 3))], [np.zeros((3, 6)), of_drift]])
    np.testing.assert_allclose(taken.unshown, expected)


def test_what_has_no_remainder_takes_set_up_and_drift_alone_and_is_inside_everywhere() -> None:
    """As wide as these are known, with the springs they go together with; nothing lies between places that are none."""
    rng = np.random.default_rng(12)
    root, by_x = rng.standard_normal((15, 15)), rng.standard_normal((5, 3, 6))
    mean, frame = rng.standard_normal(15), JobFrame(Frame.identity(), np.zeros(3), 0.5, 10.0)
    learned = Learned(np.zeros(6), mean, root @ root.T, frame)
    position, time = rng.standard_normal((5, 3)), np.array([0.0, 1, 2, 3, 4])
    path: Any = SimpleNamespace(
        base_from_tcp=SimpleNamespace(position=position), rest_from_tcp=SimpleNamespace(position=position),
        theta=rng.standard_normal((5, 6)), move_time=np.array([0.0, 1, 1, 1, 1]), axes=SimpleNamespace(base_from_rest=None))
    rest = learned.rest(path, np.arange(5))
    slopes = np.array([np.hstack([np.eye(3), np.column_stack([np.cross(axis, at / 0.5) for axis in np.eye(3)]),
                                  share * np.eye(3)]) for at, share in zip(position, time / 10, strict=True)])
    np.testing.assert_allclose(rest.mean, slopes @ mean[6:], rtol=1e-12)
    assert rest.inside.tolist() == [True] * 5
    assert rest.basis.shape == (5, 0)
    added, unseen = learned.covariance_beside(by_x, rest)
    for k, (of_x, of_rest) in enumerate(zip(by_x, slopes, strict=True)):
        both = np.hstack([of_x, of_rest])
        np.testing.assert_allclose(added[k], both @ learned.covariance @ both.T - of_x @ learned.covariance[:6, :6] @ of_x.T)
    assert not unseen.any()

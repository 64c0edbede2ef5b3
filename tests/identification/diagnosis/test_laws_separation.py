"""Which runs separate rival causes, by hand: distances that add up from run to run."""

from __future__ import annotations

from itertools import combinations
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from identification.diagnosis.discrimination import Separation, discriminating, probing_rows
from identification.model.robot import built_in_robots, read_robot

PAIRS = ((0, 1), (0, 2), (1, 2))


def separation(squared: list[list[float]]) -> Separation:
    """Of three rivals of 0.6, 0.3 and 0.1 by runs of these squared distances (runs, pairs), which no parameter can take up."""
    grams = tuple(np.array([np.diag([1.0, run[pair]]) for run in squared]) for pair in range(3))
    return Separation(("play", "creep", "drift"), np.array([0.6, 0.3, 0.1]), PAIRS, grams, (np.eye(1),) * 3)


def mistaken(squared: np.ndarray) -> float:
    """Bhattacharyya's bound."""
    share = (0.6, 0.3, 0.1)
    return min(1.0, float(sum(np.sqrt(share[a] * share[b]) * np.exp(-each / 8) for (a, b), each in zip(
        PAIRS, squared, strict=True))))


def test_what_a_parameter_can_take_up_separates_nothing() -> None:
    """Of a distance of 5 sigma a parameter that is known to a quarter takes 3^2 / (4^2 + 8): as its posterior says."""
    gram = np.array([[[8.0, 3.0], [3.0, 25.0]]])
    found = Separation(("play", "creep"), np.array([0.7, 0.3]), ((0, 1),), (gram,), (np.array([[16.0]]),))
    assert len(found) == 1
    assert found.squared(found.of(np.array([0]))) == pytest.approx([25 - 9 / 24])
    assert found.squared(found.of(np.array([0, 0]))) == pytest.approx([50 - 36 / 32])
    assert found.best_pair(0) == (("play", "creep"), pytest.approx(np.sqrt(25 - 9 / 24)))
    assert len(Separation(("play",), np.ones(1), (), (), ())) == 0


@pytest.mark.parametrize(("run", "pair", "sigmas"), [
    (0, ("play", "drift"), 10.0), (1, ("play", "creep"), 2.0), (2, ("creep", "drift"), 3.0)])
def test_a_run_is_told_by_the_pair_whose_confusion_it_makes_least_likely(
    run: int, pair: tuple[str, str], sigmas: float) -> None:
    """By how likely the two are and how much it leaves of that: a pair that is far apart is worth no more than one that is."""
    found = separation([[1.0, 100.0, 100.0], [4.0, 9.0, 0.0], [0.1, 0.1, 9.0]])
    assert found.best_pair(run) == (pair, pytest.approx(sigmas))


@pytest.mark.parametrize("count", [1, 2, 3, 9])
def test_the_runs_are_those_that_leave_the_least_doubt_one_of_each_pose(count: int) -> None:
    """Against all sets of one run a pose, the best one alone first, then what is best with it."""
    rng = np.random.default_rng(2)
    squared = rng.exponential(6, (9, 3)) * rng.integers(0, 2, (9, 3))
    found, group = separation(squared.tolist()), np.arange(9) // 3
    size = min(count, 3)
    sets = [some for some in combinations(range(9), size) if len({k // 3 for k in some}) == size]
    best = min(sets, key=lambda some: mistaken(squared[list(some)].sum(axis=0)))
    chosen = discriminating(found, count, group)
    assert sorted(chosen) == sorted(best)
    for place in range(1, size):
        rest = [mistaken(squared[[*chosen[:place - 1], k]].sum(axis=0)) for k in chosen[place - 1:]]
        assert rest[0] == min(rest)
    assert float(found.mistaken(found.of(np.array(chosen)))) == pytest.approx(mistaken(squared[chosen].sum(axis=0)))


def test_loads_that_are_looked_at_are_cycles_at_poses_well_inside_the_limits() -> None:
    """Forty poses, each along all three base axes, up to the largest measured force, both ways and back; no joint beyond 0.6 of
    its way to a limit, from zero or from the limit nearest to it. Held 10 s and 60 s in turn, each from its own zero on."""
    robot = read_robot(built_in_robots()["irb6660-205-1.90"])
    data: Any = SimpleNamespace(cell=SimpleNamespace(robot=robot), rows=SimpleNamespace(
        wrench=np.array([[0, 0, 120.0, 900, 0, 0], [-250.0, 30, 0, 0, 0, 0]])))
    rows = probing_rows(data)
    theta, force = rows.theta.reshape(40, 3, 8, 6), rows.wrench.reshape(40, 3, 8, 6)
    assert (theta == theta[:, :1, :1]).all()
    assert len(np.unique(theta[:, 0, 0], axis=0)) == 40
    middle = np.clip(0.0, *robot.limits.T)
    poses = theta[:, 0, 0]
    share = (poses - middle) / np.where(poses > middle, robot.limits[:, 1] - middle, middle - robot.limits[:, 0])
    assert np.abs(share).max() <= 0.6
    assert (np.ptp(share, axis=0) > 0.7).all()
    assert (robot.limit_excess(theta[:, 0, 0]) == 0).all()
    expected = np.zeros((3, 8, 6))
    expected[np.arange(3), :, np.arange(3)] = [0, 82.5, 167.5, 250, 0, -125, -250, 0]
    np.testing.assert_allclose(force, np.broadcast_to(expected, force.shape), atol=1e-9)
    np.testing.assert_allclose(rows.time.reshape(120, 8), np.tile([0, 60, 70, 130, 140, 200, 210, 270], (120, 1)))
    np.testing.assert_allclose(rows.dwell.reshape(120, 8), np.tile([10, 60], (120, 4)))
    assert rows.visit.tolist() == rows.reference.tolist() == np.repeat(np.arange(120), 8).tolist()
    assert not rows.validate.any()
    assert set(rows.row) == {0}
    np.testing.assert_array_equal(probing_rows(data).theta, rows.theta)

"""Segments of a path and steps of the matching, each beside the same by looking at every segment."""

from __future__ import annotations

import numpy as np
import pytest

from compensator.forces.map_matching import _ahead, _better, _end, _project_between, _start, match_forwards
from compensator.forces.path_segments import Segments
from identification.common.arrays import Array

NEAR, BACK, OFF_PATH = 5e-4, 2e-4, 5e-3


def wandering(count: int, seed: int, step: float = 2e-3) -> tuple[Array, Array]:
    """Points of a path that comes near itself again and again, and their arc lengths."""
    rng = np.random.default_rng(seed)
    points = np.cumsum(rng.normal(0, step, (count, 3)), axis=0) % 0.02
    return points, lengths(points)


def lengths(points: Array) -> Array:
    return np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])


def every(points: Array, s: Array, point: Array) -> tuple[Array, Array]:
    """Distance (n,) of a point to each segment, and the arc length there: the best of both ends and of the foot, if within."""
    start, way, found = points[:-1], np.diff(points, axis=0), []
    foot = np.sum((point - start) * way, axis=1) / np.sum(way * way, axis=1)
    for share in (np.zeros(len(way)), np.ones(len(way)), np.where((foot > 0) & (foot < 1), foot, 0.0)):
        found.append((np.linalg.norm(point - start - share[:, None] * way, axis=1), s[:-1] + share * np.diff(s)))
    distance, arc = (np.array(of_all) for of_all in zip(*found, strict=True))
    best, each = distance.argmin(axis=0), np.arange(len(way))
    return distance[best, each], arc[best, each]


@pytest.mark.parametrize("seed", range(3))
def test_of_the_segments_ahead_the_nearest_is_found(seed: int) -> None:
    """Few or many of them, one by one or by boxes; a projection behind the sample before counts for 0.1 mm^2 farther."""
    points, s = wandering(900, seed)
    segments = Segments(points, s)
    rng = np.random.default_rng(seed)
    for number in range(60):
        first = int(rng.integers(0, 890))
        point = points[first] + rng.normal(0, 1e-3, 3)
        here = float(s[first] + rng.uniform(0, s[first + 1] - s[first]))
        assert segments.holding(here, 0) == first
        reach = here + (1e-4, 1e-2, 0.1, 1.5)[number % 4]
        distance, arc = every(points, s, point)
        looked = np.flatnonzero((s[:-1] < reach) & (np.arange(899) >= first))
        cost = distance[looked] ** 2 + np.where(arc[looked] < here, 1e-8, 0.0)
        # Beyond the first twelve all that lies ahead of the sample lies ahead of what was.
        best = looked[np.argmin(cost)]
        found = segments.nearest(point.tolist(), first, here, reach, 1.0)
        assert found == pytest.approx((distance[best], arc[best]), abs=1e-12)


def test_of_two_that_are_as_near_the_first_is_found() -> None:
    """There and back on one line: near its far end, with what was behind, and far off along the path."""
    points = np.array([[0, 0, 0], [1, 0, 0], [0, 0, 0], *([k, k, 5.0] for k in range(30)), [0, 0, 0], [1, 0, 0.0]])
    segments = Segments(points, lengths(points))
    segments.holding(0.0, 0)
    assert segments.nearest([0.25, 0.1, 0], 0, 0.0, 1e9, 1.0) == pytest.approx((0.1, 0.25))
    # Behind 0.3: the way back is as near, and ahead.
    assert segments.nearest([0.25, 0.1, 0], 0, 0.3, 1e9, 1.0) == pytest.approx((0.1, 1.75))


@pytest.mark.parametrize(("lower", "arc"), [(0.9e-4, 1.75), (1.1e-4, 0.25)])
def test_what_lies_behind_is_taken_where_it_is_nearer_by_a_tenth_of_a_millimetre(lower: float, arc: float) -> None:
    """A sample on the way there, behind the one before it at 0.3 m, and the way back so much lower."""
    points = np.array([[0, 0, 0], [1, 0, 0], [1, 0, -lower], [0, 0, -lower]])
    segments = Segments(points, lengths(points))
    segments.holding(0.0, 0)
    assert segments.nearest([0.25, 0, 0], 0, 0.3, 1e9, 1.0)[1] == pytest.approx(arc, abs=2e-4)


@pytest.mark.parametrize("seed", range(3))
def test_a_place_ahead_is_the_nearest_within_the_first_reach_that_comes_near(seed: int) -> None:
    """4 mm ahead, 16, 64 ...; none that is no nearer than the walk is, none behind."""
    points, s = wandering(700, seed + 10)
    segments = Segments(points, s)
    rng = np.random.default_rng(seed)
    told = 0
    for number in range(80):
        here = 0.0 if number < 8 else float(rng.uniform(0, 0.7 * s[-1]))
        # Anywhere, or where the walk stands.
        at = int(np.searchsorted(s, here)) if number % 8 < 4 else rng.integers(700)
        point = points[at] + rng.normal(0, (1e-4, 1.5e-3)[number % 2], 3)
        off = float(rng.choice([1e-4, 1e-3, 3e-3]))
        distance, arc = every(points, s, point)
        begun = np.flatnonzero(s[:-1] <= here - BACK)
        ahead = np.arange(699) >= (begun[-1] if len(begun) else 0)
        able = ahead & (distance < off)
        expected = None
        if able.any():
            within = able
            if (able & (distance <= NEAR)).any():
                reach = 4e-3
                while not (able & (distance <= NEAR) & (s[:-1] <= here + reach)).any():
                    reach *= 4
                within = able & (s[:-1] <= here + reach)
            expected = arc[np.where(within, distance, np.inf).argmin()]
        told += expected is not None
        assert _ahead(segments, point, here, off) == (None if expected is None else pytest.approx(expected, abs=1e-12))
    assert 20 < told < 80


@pytest.mark.parametrize(("share", "taken"), [(0.49, True), (0.51, False)])
def test_a_leap_is_made_to_where_samples_are_off_by_under_half(share: float, taken: bool) -> None:
    """In the mean square, over 60 samples, of which the last are looked at alone where the first leave it open."""
    points = np.array([[0, 0, 0], [0.1, 0, 0.0]])
    samples = np.column_stack([np.linspace(0.01, 0.06, 60), np.where(np.arange(60) < 50, 0.0, 1e-3), np.zeros(60)])
    off = np.where(np.arange(60) < 50, 0.0, 1e-3 / share)
    walk = _better(Segments(points, lengths(points)), samples, 0.01, off.tolist())
    assert (walk is not None) == taken
    if walk is not None:
        # Four that are over half a millimetre off may be those of a corner: they are placed when what follows is known.
        np.testing.assert_allclose(walk.arcs, np.where((np.arange(60) >= 50) & (np.arange(60) < 54), np.nan, samples[:, 0]))
        assert walk.off == pytest.approx(samples[:, 1])


@pytest.mark.parametrize(("arc", "end"), [
    ([0, 0.5, 1], 3), ([0, 0.5, 1, np.nan, 0, 0.5], 3), ([0.99, 0.995, np.nan, 0.3, 0.98, 1, 1, np.nan, np.nan, 0.5], 2),
    ([np.nan, 0, np.nan, 0.5, np.nan, 0.97, 0.985, np.nan, 1], 7), ([0, 0.4, 0.4, np.nan], 3), ([np.nan, np.nan], 2)])
def test_a_pass_ends_with_the_first_sample_off_behind_the_last_part(arc: list[float], end: int) -> None:
    """The last 2 % of the path, or of what the log has of it."""
    assert _end(np.array(arc), np.array([0.0, 1.0])) == end


@pytest.mark.parametrize(("length", "short", "last"), [
    (0.1, 0.0051, False), (0.1, 0.0049, True), (1.0, 0.0201, False), (1.0, 0.0199, True)])
def test_the_last_part_is_a_fiftieth_and_at_least_five_millimetres(length: float, short: float, last: bool) -> None:
    arc = np.array([0.0, length - short, np.nan, length, np.nan, 0.5 * length])
    assert _end(arc, np.array([0.0, length])) == (2 if last else 4)


@pytest.mark.parametrize("seed", range(3))
def test_between_two_keys_a_sample_lies_where_it_is_nearest_to_the_path(seed: int) -> None:
    """The keys are 2 mm apart on a bent path of points 1 mm apart; samples lie up to 3 mm off it, or 6 mm, which is off."""
    rng = np.random.default_rng(seed)
    angle = np.linspace(0, 2, 120)
    points = 0.06 * np.column_stack([np.cos(angle), np.sin(angle), 0.1 * angle])
    s = lengths(points)
    place = np.sort(np.clip(np.linspace(0, s[-1], 200) + rng.uniform(-1e-3, 1e-3, 200), 0, s[-1]))
    keys = np.unique(np.concatenate([[0, 199], np.arange(0, 200, 4)]))
    aside = rng.uniform(-3e-3, 3e-3, 200)
    aside[50:60] = 6e-3
    on = np.column_stack([np.interp(place, s, axis) for axis in points.T])
    samples = on + np.column_stack([np.zeros(200), np.zeros(200), aside])
    found = _project_between(Segments(points, s), samples, 0, keys, place[keys])
    low, high = (np.array([way(k) for k in range(200)]) for way in (
        lambda k: place[keys[keys < k].max(initial=0)] - 1e-4, lambda k: place[keys[keys >= k].min()] + 1e-4))
    fine = np.linspace(0, s[-1], 12_001)
    there = np.column_stack([np.interp(fine, s, axis) for axis in points.T])
    for number in range(0, 200, 3):
        off = np.linalg.norm(there - samples[number], axis=1)
        off[(fine < low[number]) | (fine > high[number])] = np.inf
        assert found[number] == pytest.approx(fine[off.argmin()] if off.min() < OFF_PATH else np.nan, abs=2e-5, nan_ok=True)


def test_of_a_long_log_four_samples_a_target_are_walked_and_all_are_placed() -> None:
    """Of 300000 samples on a path of 3 targets: each where it is nearest, in pieces; a tool that stays lies on one place."""
    points = np.array([[0, 0, 0], [0.1, 0, 0], [0.1, 0.1, 0.0]])
    s = lengths(points)
    place = np.clip(np.linspace(-0.05, 0.25, 300_000), 0, 0.2)
    samples = np.column_stack([np.interp(place, s, axis) for axis in points.T]) + np.array([0, 0, 1e-4])
    assert np.abs(match_forwards(points, s, samples) - place).max() < 1e-9


def test_where_a_program_has_many_targets_no_stop_between_them_is_lost() -> None:
    """Every half millimetre one, and the tool waits at one for 31 samples, and is at the eighth behind it with the next."""
    along = 5e-4 * np.arange(8001)
    points = np.column_stack([along, 0 * along, 0 * along])
    place = along[8 * (np.arange(32_000) // 32)]
    assert np.abs(match_forwards(points, along, np.column_stack([place, 0 * place, 0 * place])) - place).max() < 1e-9


def test_a_path_of_one_target_or_none_has_what_is_near() -> None:
    point, samples = np.array([[0.1, 0, 0.0]]), np.array([[0.1, 0, 0.0049], [0.1, 0, 0.0051]])
    np.testing.assert_array_equal(match_forwards(point, np.zeros(1), samples), [0.0, np.nan])
    np.testing.assert_array_equal(match_forwards(np.empty((0, 3)), np.zeros(0), samples), [np.nan, np.nan])
    away = np.array([[0, 0, 0], [0.05, 0, 0.0]])
    np.testing.assert_array_equal(match_forwards(away, np.array([0.0, 0.05]), samples), [np.nan, np.nan])


@pytest.mark.parametrize(("aside", "start"), [(0.2e-3, 1e-3), (0.6e-3, 18e-3)])
def test_a_log_begins_where_it_goes_on_along_the_path(aside: float, start: float) -> None:
    """There, and back 1 mm beside it; the tool goes there, so much beside it. Nearer to the way back it is told by that alone:
    a sample that is as near to both, but for half a millimetre, does not say where it begins, and what follows does."""
    points = np.array([[0, 0, 0], [0.009, 0, 0], [0.009, 0.001, 0], [0, 0.001, 0.0]])
    samples = np.column_stack([np.linspace(0.001, 0.003, 30), np.full(30, aside), np.zeros(30)])
    assert _start(Segments(points, lengths(points)), samples) == pytest.approx(start)

"""Which points of a grid become targets: by the definitions, point by point."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from compensator.correction.fine_grid import FULL
from compensator.correction.needed_targets import (
    Wanted,
    beyond_noise,
    needed_points,
    off_circles,
    untouched,
    window_means,
    windows,
)

TOLERANCE = 5e-6


@pytest.mark.parametrize("seed", range(4))
def test_a_target_has_the_mean_of_half_the_way_to_its_nearer_neighbour(seed: int) -> None:
    """On both sides; at either end its own value, and where nothing there has weight."""
    rng = np.random.default_rng(seed)
    place = np.cumsum(rng.uniform(0.2, 1.0, 80))
    weight = rng.integers(0, 3, 80) * (np.arange(80) > 20).astype(float)
    values = rng.normal(size=(80, 3))
    at = np.unique(np.r_[0, rng.integers(1, 79, 25), 79])
    first, last = windows(place, at)
    found = window_means(values, weight, first, last, at)
    for k, own in enumerate(at):
        half = 0.0 if k in (0, len(at) - 1) else 0.5 * min(place[own] - place[at[k - 1]], place[at[k + 1]] - place[own])
        inside = np.flatnonzero(np.abs(place - place[own]) <= half)
        assert (first[k], last[k]) == (inside[0], inside[-1] + 1)
        mass = weight[inside].sum()
        expected = weight[inside] @ values[inside] / mass if mass else values[own]
        np.testing.assert_allclose(found[k], expected, atol=1e-12)


def test_the_program_s_own_among_its_own_keep_their_mean() -> None:
    own = np.array([True, True, False, True, True, True, False, False, True])
    assert untouched(own, np.arange(9)).tolist() == [True, False, False, False, True, False, False, False, False]
    assert untouched(own, np.array([0, 1, 3, 4, 5, 8])).all()


@pytest.mark.parametrize("enough", [0.5e-6, 2e-6, 1e-3])
def test_what_is_beyond_scatter_is_by_means_of_up_to_81_neighbours(enough: float) -> None:
    """Less three sigmas of a point, or of the mean over 3, 9, 27, 81 of them, of which the most counts, until three sigmas are
    as little as is enough; at the ends of those there are."""
    rng = np.random.default_rng(3)
    noise = np.where(np.arange(120) % 40 < 10, 1e-7, 2e-6) * rng.uniform(0.5, 1.5, 120)
    off = 4e-6 * np.sin(np.arange(120) / 15.0)[:, None] * [1, -1, 0.5] + noise[:, None] * rng.normal(size=(120, 3))
    expected = np.zeros(120)
    for n in range(120):
        best, unsure = np.linalg.norm(off[n]) - 3 * noise[n], 3 * noise[n]
        for half in (1, 4, 13, 40):
            if unsure <= enough:
                break
            some = slice(max(n - half, 0), n + half + 1)
            unsure = 3 * np.sqrt(np.sum(noise[some] ** 2)) / len(noise[some])
            best = max(best, np.linalg.norm(off[some].mean(axis=0)) - unsure)
        expected[n] = max(best, 0.0)
    np.testing.assert_allclose(beyond_noise(off, noise, enough), expected, atol=1e-15)
    assert (expected > 0).any()


def test_off_a_circle_is_the_way_to_its_nearest_place() -> None:
    """Of two circles and a line, with points in their planes and beside these: by the angle at which the distance is least."""
    rng = np.random.default_rng(5)
    angles, starts = np.array([[0.1, 0.9, 1.6], [0.0, 2.0, 3.9]]), []
    circles = []
    for radius, three in zip((0.02, 0.3), angles, strict=True):
        turn, middle = Rotation.random(random_state=len(circles)), rng.normal(size=3)
        circles.append((turn, middle, radius))
        starts.append(middle + turn.apply(radius * np.column_stack([np.cos(three), np.sin(three), 0 * three])))
    way = np.array([0.6, 0.0, 0.8])
    starts.append(np.array([1.0, 2, 3]) + np.outer([0, 0.1, 0.3], way))
    start, via, end = np.array(starts).transpose(1, 0, 2)
    which = np.repeat([0, 1, 2], 5)
    points, expected = np.empty((15, 3)), np.empty((15, 3))
    for n, of in enumerate(which):
        off = 1e-3 * rng.normal(size=3)
        if of == 2:
            expected[n] = off - (off @ way) * way
            points[n] = starts[2][0] + rng.uniform(-0.2, 0.5) * way + off
            continue
        turn, middle, radius = circles[of]
        angle = rng.uniform(-3, 3)
        outward = turn.apply([np.cos(angle), np.sin(angle), 0])
        expected[n] = off[0] * outward + off[1] * turn.apply([0, 0, 1.0])
        points[n] = middle + radius * outward + expected[n]
    np.testing.assert_allclose(off_circles(start, via, end, which, points), expected, atol=1e-9)


def straight(deviation: np.ndarray, own: list[int], **changed: Any) -> tuple[Any, Wanted]:
    """Pieces of a millimetre along x, with targets of the program at `own`."""
    count = len(deviation)
    further = ~np.isin(np.arange(count), own)
    grid = SimpleNamespace(further=further, may=further, divisible=further, arcs=np.empty((0, 2), dtype=np.intp))
    place, on = 1e-3 * np.arange(count), np.full(count, True)
    wanted = Wanted(deviation, deviation, TOLERANCE, np.zeros(count), np.inf, on, on, place, np.ones(count),
                    np.outer(place, [1, 0, 0]), np.full(count, 1e-3), ~on)
    return grid, replace(wanted, **changed)


@pytest.mark.parametrize(("closest_mm", "slope"), [(1, np.inf), (4, np.inf), (1, 0.02), (3, 0.02)])
@pytest.mark.parametrize("seed", range(3))
def test_no_point_that_may_be_added_is_off_by_more_than_is_allowed(seed: int, closest_mm: float, slope: float) -> None:
    """One that is stands too near to a target, or the way to one would be too steep, where that is no corner."""
    rng = np.random.default_rng(seed)
    knots = np.sort(rng.choice(np.arange(1, 200), 12, replace=False))
    deviation = np.column_stack([np.interp(np.arange(201), knots, 2e-4 * rng.normal(size=12)) for _ in range(3)])
    deviation[120:] += [1.5e-4, 0, 0]
    corner = np.isin(np.arange(201), [60])
    grid, wanted = straight(deviation, [0, 60, 130, 200], closest=np.full(201, 1e-3 * closest_mm), slope=slope, corner=corner)
    grid.may = grid.may & (np.arange(201) % 7 != 3)
    wanted = replace(wanted, known=(np.arange(201) < 150) | (np.arange(201) > 160))
    have, _ = needed_points(grid, wanted)
    at = np.flatnonzero(have)
    assert have[[0, 60, 130, 200]].all()
    assert (grid.may | ~grid.further)[at].all()
    assert len(at) > 12
    # Added ones are as far from their neighbours as they must be.
    added = grid.further[at]
    gap = 1e-3 * np.diff(at)
    assert gap[added[1:] | added[:-1]].min() >= FULL * 1e-3 * closest_mm
    first, last = windows(wanted.place, at)
    value = window_means(deviation, wanted.weight, first, last, at)
    alone = untouched(~grid.further, at)
    value[alone] = deviation[at[alone]]
    line = np.column_stack([np.interp(np.arange(201), at, column) for column in value.T])
    off = np.where(wanted.known, np.linalg.norm(line - deviation, axis=1), 0.0)
    left = 0
    for n in np.flatnonzero((off > TOLERANCE) & grid.may & ~have):
        behind = int(np.searchsorted(at, n))
        beside = (behind - 1, behind)
        near = any(abs(n - at[k]) * 1e-3 < FULL * 1e-3 * closest_mm for k in beside)
        steep = any(np.abs(deviation[n] - value[k]).max() > slope * abs(n - at[k]) * 1e-3 for k in beside if not corner[at[k]])
        assert near or steep, n
        left += 1
    assert left == 0 or closest_mm > 1 or slope < 1


def test_a_step_is_not_made_steeper_than_it_may_be_but_at_a_corner() -> None:
    """100 um at one place, 10 um a millimetre: the means of targets are no farther apart, but on either side of a corner."""
    deviation = np.zeros((101, 3))
    deviation[50:, 1] = 1e-4
    at = {}
    for name, corner in (("none", 200), ("there", 50)):
        grid, wanted = straight(deviation, [0, 50, 100] if corner == 50 else [0, 100], slope=0.01,
                                corner=np.arange(101) == corner)
        at[name] = np.flatnonzero(needed_points(grid, wanted)[0])
    place, means = 1e-3 * np.arange(101), {}
    for name, some in at.items():
        means[name] = window_means(deviation, np.ones(101), *windows(place, some), some)[:, 1] / 1e-6
    slopes = 1e-3 * np.diff(means["none"]) / np.diff(place[at["none"]])
    assert 9.0 < slopes.max() < 10.0 + 1e-9
    assert means["none"].tolist()[:2] + means["none"].tolist()[-2:] == pytest.approx([0, 0, 100, 100])
    assert {49, 50} <= set(at["there"].tolist())


def arc(deviation: np.ndarray, pieces: int, divisible: np.ndarray) -> tuple[np.ndarray, list[list[int]]]:
    """The points, and the arcs, of a quarter circle of 50 mm in so many pieces between the program's own ends and middle."""
    angle = np.linspace(0, np.pi / 2, pieces + 1)
    position = 0.05 * np.column_stack([np.cos(angle), np.sin(angle), 0 * angle])
    further = ~np.isin(np.arange(pieces + 1), [0, pieces // 2, pieces])
    grid: Any = SimpleNamespace(further=further, may=np.zeros(pieces + 1, dtype=bool), divisible=divisible,
                                arcs=np.array([[0, pieces // 2]]))
    on = np.full(pieces + 1, True)
    have, arcs = needed_points(grid, Wanted(deviation, deviation, TOLERANCE, np.zeros(pieces + 1), np.inf, on, on, 0.05 * angle,
                                            np.ones(pieces + 1), position, np.full(pieces + 1, 1e-3), ~on))
    return have, sorted(arcs.tolist())


@pytest.mark.parametrize(("size_um", "where", "whole", "expected"), [
    # As much to one side everywhere, or outwards, a circle remains.
    (100, "aside", (), [[0, 8]]), (100, "outward", (), [[0, 8]]), (0, "hump", (), [[0, 8]]), (6, "hump", (), [[0, 4], [8, 4]]),
    (4, "hump", (), [[0, 8]]), (100, "hump", (8,), [[0, 8]]),
    # A hump in the first quarter alone leaves the second half as it is.
    (60, "early", (), [[0, 1], [2, 1], [4, 2], [8, 4]]), (60, "early", (4,), [[0, 4], [8, 4]]),
    (60, "early", (2,), [[0, 2], [4, 2], [8, 4]]),
    # And one between the last two points the first.
    (60, "late", (), [[0, 4], [8, 2], [12, 1], [14, 1]])])
def test_an_arc_is_halved_where_a_corrected_arc_is_none(
        size_um: float, where: str, whole: tuple[int, ...], expected: list[list[int]]) -> None:
    angle = np.linspace(0, np.pi / 2, 17)
    outward = np.column_stack([np.cos(angle), np.sin(angle), 0 * angle])
    deviation = 1e-6 * size_um * {
        "aside": np.tile([0.3, -0.5, 0.8], (17, 1)), "outward": outward,
        "hump": outward * (np.abs(np.arange(17) - 8)[:, None] == 4),
        "early": outward * np.interp(np.arange(17), [0, 2, 4], [0, 1, 0])[:, None],
        "late": outward * (np.arange(17) == 15)[:, None]}[where]
    have, arcs = arc(deviation, 16, ~np.isin(np.arange(17), whole))
    assert arcs == expected
    assert np.flatnonzero(have).tolist() == sorted({first + k * step for first, step in arcs for k in range(3)})


@pytest.mark.parametrize("bent", [0, 1])
def test_of_two_arcs_the_one_that_is_none_any_more_is_halved(bent: int) -> None:
    """A line of five points, a quarter circle of eight pieces a half, and another with the same end: a hump in the middle of
    each half of one of them."""
    angle = np.linspace(0, np.pi / 2, 17)
    first = 0.05 * np.column_stack([np.cos(angle), np.sin(angle), 0 * angle])
    second = [0.0, 0.08, 0] + 0.03 * np.column_stack([np.sin(angle), -np.cos(angle), 0 * angle])
    line = first[0] - np.outer(1e-3 * np.arange(5, 0, -1), [0.0, 1, 0])
    position = np.vstack([line, first, second[1:]])
    count = len(position)
    outward = np.vstack([0 * line, first / 0.05, (second[1:] - [0, 0.08, 0]) / 0.03])
    hump = np.isin(np.arange(count), [[9, 17], [25, 33]][bent])
    deviation = 6e-6 * outward * hump[:, None]
    further = ~np.isin(np.arange(count), [0, 5, 13, 21, 29, 37])
    grid: Any = SimpleNamespace(further=further, may=np.zeros(count, dtype=bool), divisible=np.full(count, True),
                                arcs=np.array([[5, 8], [21, 8]]))
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(position, axis=0), axis=1))])
    on = np.full(count, True)
    have, arcs = needed_points(grid, Wanted(deviation, deviation, TOLERANCE, np.zeros(count), np.inf, on, on, length,
                                            np.ones(count), position, np.full(count, 1e-3), ~on))
    halved = [[5, 21], [21, 5]][bent]
    assert sorted(arcs.tolist()) == sorted([[halved[0], 4], [halved[0] + 8, 4], [halved[1], 8]])
    assert np.flatnonzero(have).tolist() == sorted({0, 5, 13, 21, 29, 37, *(halved[0] + 4 * k for k in range(5))})

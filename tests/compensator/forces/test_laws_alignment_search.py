"""The coarse search of a log's place in its program, and the slips of its stretches, beside direct sums and a clock that is
known."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from compensator.forces.alignment_regression import Bins
from compensator.forces.alignment_search import _explained, candidates, promise
from compensator.forces.alignment_slips import _log_sum, fine_slips, independent_values, stretch_borders, stretch_slips
from compensator.forces.program_time import ProgramTime
from identification.common.arrays import Array

# Cuts of 1 to 4 s in other directions, 2 s of air between them; 50 mm/s throughout.
LASTING = [1.0, 2.0, 4.0, 1.5, 3.0, 2.5]
TIME = np.concatenate([[0.0], np.cumsum([part for cut in LASTING for part in (2.0, cut)]), [28.0]])
AIR = np.array([True, *(k % 2 == 0 for k in range(12)), True])


def program() -> ProgramTime:
    turn = np.radians(np.arange(len(TIME)) * 47.0)
    along = np.column_stack([np.cos(turn), np.sin(turn), 0 * turn])
    return ProgramTime(TIME, 0.05 * TIME, AIR, np.zeros(len(TIME), dtype=np.intp), along)


def log(override: float, start: float, width: float, count: int, noise: float = 2.0, lag: Array | None = None) -> Bins:
    """A log in bins whose clock shows `start` as the program starts, which is driven at an override; lag (n,) [s] of it."""
    time = (np.arange(count) + 0.5) * width
    planned = override * (time - start) - (0.0 if lag is None else lag)
    move = np.clip(np.searchsorted(TIME, planned), 1, len(TIME) - 1)
    cuts = ~AIR[move] & (planned > 0) & (planned < TIME[-1])
    force = np.where(cuts[:, None], 80.0 + 60.0 * program().direction[move], 0.0) + np.array([5.0, -3, 9])
    return Bins(time, force + np.random.default_rng(3).normal(0, noise, force.shape), np.ones(count), width)


@pytest.mark.parametrize("override", [0.7, 1.0, 1.3])
def test_what_a_program_explains_from_each_bin_on_is_that_of_direct_sums(override: float) -> None:
    """The squares of a regression on a constant and what may carry force, with a ridge of a thousandth of the trace; bins
    without a sample count for nothing. A start before the log's is at the end of the cycle."""
    bins = log(override, 4.0, 0.25, 200)
    weight = np.ones(200)
    weight[[10, 60, 61]] = 0.0
    bins = Bins(bins.time, bins.force * weight[:, None], weight, 0.25)
    share = _explained(program(), bins, override)
    steps = int(np.ceil(28.0 / override / 0.25)) + 1
    seen, _ = program().engagement(override * 0.25 * (np.arange(steps) + 0.5), 0.0, 0.0)
    kept = weight > 0
    centred = np.where(kept[:, None], bins.force - bins.force[kept].mean(axis=0), 0.0)
    for start in (-20, 0, 7, 16, 40, 120):
        column = np.zeros((200, 4))
        for k in range(steps):
            if 0 <= start + k < 200:
                column[start + k] = seen[k] * weight[start + k]
        about = column - np.outer(weight, column.sum(axis=0) / kept.sum())
        gram, cross = about.T @ about, about.T @ centred
        gram += (1e-3 * np.trace(gram) + 1e-9 * kept.sum()) * np.eye(4)
        expected = np.sum(cross * np.linalg.solve(gram, cross)) / np.sum(centred**2)
        assert share[start] == pytest.approx(expected, rel=1e-6, abs=1e-9)


@pytest.mark.parametrize(("override", "start"), [(0.6, 12.0), (1.4, 3.0), (0.9, -4.0)])
def test_the_first_of_the_candidates_is_where_the_log_is(override: float, start: float) -> None:
    """To a bin, and to an override by which the ends of the program are a bin off; the others lie elsewhere by more than half
    a stretch on average."""
    bins = log(override, start, 0.5, 120)
    found = candidates(program(), bins)
    assert 1 < len(found) <= 5
    assert abs(found[0][0] - start) < 0.5
    assert abs(found[0][1] - override) < 0.03
    ends = np.array([bins.time[0], bins.time[-1]])
    planned = [speed * (ends - begun) for begun, speed in found]
    typical = np.median(LASTING)
    for k, one in enumerate(planned):
        assert all(np.mean(np.abs(one - other)) > 0.5 * typical for other in planned[:k])
    # A quick look promises nearly what the best place explains, and of noise nearly nothing.
    assert 0.85 < promise(program(), bins) < 1.0
    noise = Bins(bins.time, np.random.default_rng(0).normal(0, 1, (120, 3)), np.ones(120), 0.5)
    assert promise(program(), noise) < 0.15


def test_stretches_meet_half_way_through_the_air_and_long_ones_are_cut() -> None:
    """At most two times 10 s a piece: as many whole ones as there is room for."""
    middles = [TIME[2 * k] + 1.0 for k in range(1, 6)]
    np.testing.assert_allclose(stretch_borders(program()), [0.0, *middles, 28.0])
    time = np.array([0.0, 1.0, 26.0, 28.0, 30.0, 32.0])
    air = np.array([True, True, False, True, False, True])
    long = ProgramTime(time, time, air, np.zeros(6, dtype=np.intp), np.zeros((6, 3)))
    np.testing.assert_allclose(stretch_borders(long), [0.0, 13.5, 27.0, 32.0])
    last = ProgramTime(time - 5.0 * (time < 5) + 30.0 * (time > 29), time, air, np.zeros(6, dtype=np.intp), np.zeros((6, 3)))
    np.testing.assert_allclose(stretch_borders(last), [*np.linspace(-5, 27, 4), *np.linspace(27, 62, 4)[1:]])


def test_noise_has_as_many_independent_values_as_it_has() -> None:
    """White noise its number; of what is held for five bins a fifth, about."""
    noise = np.random.default_rng(1).standard_normal((4000, 3))
    assert independent_values(noise) == pytest.approx(4000, rel=0.1)
    assert independent_values(np.repeat(noise[:800], 5, axis=0)) == pytest.approx(800, rel=0.2)


def test_a_sum_of_what_is_very_unlikely_is_not_nothing() -> None:
    values = np.array([[-2000.0, 1.0], [-2000.0 + np.log(3), 1.0]])
    np.testing.assert_allclose(_log_sum(values), [-2000 + np.log(4), 1 + np.log(2)])


BIAS = np.array([400.0, 0, 0])


def slipped(lag: Array, noise: float = 5.0, odd: int | None = None, idle: int | None = None) -> tuple[Any, Array]:
    """Ten stretches of 5 s with a second of air between them, of which each lies `lag` (10,) [s] behind the plan; what is left
    of the force is worked out from the planned times alone, beside a bias of 400 N. The log begins 2 s before the program and
    ends as much behind it. `odd`: one of which the force is another; `idle`: one that needs no force, and has none."""
    begin = 6.0 * np.arange(10)
    time = np.sort(np.concatenate([begin, begin + 5.0]))
    size = np.random.default_rng(72).uniform(60, 200, (10, 3))

    def force(planned: Array) -> Array:
        number = np.clip((planned // 6.0).astype(int), 0, 9)
        there = (planned >= 0) & (planned - 6.0 * number < 5.0)
        return np.where(there[:, None], size[number] * (1 + 0.5 * np.sin(planned + number))[:, None], 0.0)

    fine = np.arange(-40, 1220) * 0.05
    number = np.clip(((fine + 0.5) // 6.0).astype(int), 0, 9)
    rng = np.random.default_rng(73)
    measured = force(fine + lag[number]) + rng.normal(0, noise, (len(fine), 3))
    if odd is not None:
        there = (number == odd) & (fine >= 0) & (fine < 59)
        measured[there] = rng.normal(0, 150, (int(there.sum()), 3))
    if idle is not None:
        size[idle] = 0.0
        measured[number == idle] = rng.normal(0, noise, (int((number == idle).sum()), 3))
    regression = SimpleNamespace(
        program=SimpleNamespace(time=time, period=6.0, stretches=[(2 * k, 2 * k + 1) for k in range(10)]),
        planned=lambda _: fine, seen=lambda _, state: force(fine + state), left=lambda seen, _: measured - seen,
        force=measured + BIAS, energy=float(np.sum(measured**2)),
        fit=lambda _, slip: SimpleNamespace(residual=measured - force(fine + slip), coefficients=BIAS[None]))
    return regression, fine


def test_each_stretch_slips_as_its_samples_say() -> None:
    """A walk of about a fifth of a second a step, told to a few hundredths, and finer where it is asked for finely; between the
    middles of two stretches it goes evenly from one to the other."""
    lag = np.cumsum(np.random.default_rng(5).normal(0, 0.12, 10))
    regression, fine = slipped(lag)
    slips = stretch_slips(regression, np.zeros(4))
    middles = np.concatenate([[2.75], 6.0 * np.arange(1, 9) + 2.5, [56.25]])
    np.testing.assert_allclose(np.interp(middles, fine, slips.slip), lag, atol=0.06)
    np.testing.assert_allclose(slips.slip, np.interp(fine, middles, np.interp(middles, fine, slips.slip)), atol=2e-3)
    np.testing.assert_allclose(slips.planned, fine + slips.slip)
    # A grid of 61 states over 2.4 s on either side is known to no better than a cell.
    assert slips.std.min() >= 0.999 * 4.8 / 60 / np.sqrt(12)
    left = regression.fit(0, slips.slip).residual
    assert slips.share == pytest.approx(1 - np.sum(left**2) / regression.energy)
    assert slips.independent == pytest.approx(independent_values(left))
    steps = np.diff(np.interp(middles, fine, slips.slip)) / (0.03 * 6.0)
    assert slips.value == pytest.approx(0.5 * np.log(1 - slips.share) + 0.5 * np.sum(steps**2) / slips.independent, abs=2e-3)
    assert slips.odd == ()
    regression, _ = slipped(0.1 * lag)
    coarse = stretch_slips(regression, np.zeros(4))
    finer = fine_slips(regression, np.zeros(4), coarse)
    assert finer.std.max() < coarse.std.min()
    np.testing.assert_allclose(np.interp(middles, fine, finer.slip), 0.1 * lag, atol=0.02)


@pytest.mark.parametrize("odd", [0, 4, 9])
def test_a_stretch_whose_force_is_another_is_odd(odd: int) -> None:
    """By the times at which it meets those beside it. One without force, as the program lets expect, is not."""
    regression, _ = slipped(np.zeros(10), odd=odd, idle=6)
    borders = np.concatenate([[0.0], 6.0 * np.arange(1, 10) - 0.5, [59.0]])
    assert stretch_slips(regression, np.zeros(4)).odd == ((pytest.approx(borders[odd]), pytest.approx(borders[odd + 1])),)


def walking(lag: Array, sigma: Array) -> tuple[Any, Any]:
    """Ten stretches whose misfit is a parabola of their slip, by which each is known to sigma (10,) [s]; and what a walk of
    normal numbers from stretch to stretch makes of that: mean and std on a grid whose cells are so wide [s]."""
    regression, fine = slipped(np.zeros(10))
    number, within = np.clip(((fine + 0.5) // 6.0).astype(int), 0, 9), (fine >= 0) & (fine < 58.99)
    white = np.random.default_rng(8).normal(0, 2.0, len(fine))
    noise = np.sum(white**2) / independent_values(np.column_stack([0 * white, white, 0 * white]))
    slope = np.where(within, (np.sqrt(noise / np.bincount(number[within])) / sigma)[number], 0.0)

    def left(slip: Array | float) -> Array:
        return np.column_stack([slope * (slip - lag[number]), white, 0 * white])

    regression.seen = lambda _, state: state
    regression.left = lambda seen, _: left(seen)
    regression.fit = lambda _, slip: SimpleNamespace(residual=left(slip), coefficients=np.zeros((1, 3)))
    precision = np.diag(1 / sigma**2)
    precision[0, 0] += 1 / (0.5 * 0.4 * 6.0) ** 2
    for k in range(9):
        precision[k:k + 2, k:k + 2] += np.array([[1, -1], [-1, 1]]) / (0.03 * 6.0) ** 2
    covariance = np.linalg.inv(precision)
    return regression, lambda cell: (covariance @ (lag / sigma**2), np.sqrt(np.diag(covariance) + cell**2 / 12))


MIDDLES = np.concatenate([[2.75], 6.0 * np.arange(1, 9) + 2.5, [56.25]])


@pytest.mark.parametrize(("least", "most", "off"), [(0.1, 0.4, 0.0), (1.0, 1.5, 0.8)])
def test_the_slips_are_those_of_a_walk_whose_stretches_say_as_much_as_they_know(least: float, most: float, off: float) -> None:
    """0.03 periods a step, from 0.2 periods about nothing at first; in 61 states over 0.4 periods to either side."""
    rng = np.random.default_rng(4)
    lag = off + np.cumsum(rng.normal(0, 0.15, 10))
    regression, walk = walking(lag, rng.uniform(least, most, 10))
    slips = stretch_slips(regression, np.zeros(4))
    fine = regression.planned(0)
    mean, std = walk(2 * 0.4 * 6.0 / 60)
    found = np.interp(MIDDLES, fine, slips.slip)
    np.testing.assert_allclose(found, mean, atol=5e-3 if most < 1 else 2e-2)
    np.testing.assert_allclose(np.interp(MIDDLES, fine, slips.std), std, rtol=0.02)
    left = float(np.sum(regression.fit(0, slips.slip).residual**2)) / regression.energy
    assert slips.share == pytest.approx(1 - left)
    assert slips.value == pytest.approx(0.5 * np.log(left) + 0.5 * np.sum((np.diff(found) / 0.18) ** 2) / slips.independent)


@pytest.mark.parametrize(("sigma", "reach"), [(0.003, 0.15), (0.01, 0.15), (0.1, 0.6), (0.3, 2.4)])
def test_slips_are_looked_for_as_finely_as_they_are_known(sigma: float, reach: float) -> None:
    """Within a quarter of the reach where four sigma beside each of them are in that, and again, down to 5 ms a state."""
    lag = min(sigma, 0.01) * (-1.0) ** np.arange(10)
    regression, walk = walking(lag, np.full(10, sigma))
    slips = fine_slips(regression, np.zeros(4), stretch_slips(regression, np.zeros(4)))
    mean, std = walk(2 * reach / 60)
    np.testing.assert_allclose(np.interp(MIDDLES, regression.planned(0), slips.slip), mean, atol=2e-3)
    np.testing.assert_allclose(np.interp(MIDDLES, regression.planned(0), slips.std), std, rtol=0.03)

"""The standard error of a mean force is the scatter of the samples, whatever the force does along its targets: rises, turns,
jumps or ends."""

from __future__ import annotations

import numpy as np
import pytest

from compensator.forces.scatter import of_blocks
from compensator.forces.target_rows import TargetRows, _mean_by_scatter, _rise

NOISE = np.array([3.0, 1.0, 6.0])
SAMPLES = 28


def found(force: np.ndarray, window: int) -> np.ndarray:
    """Standard errors (N, 3) of targets of 28 samples each, force (28 N, 3) after a mean over `window` samples."""
    target = np.repeat(np.arange(len(force) // SAMPLES), SAMPLES)
    rows = TargetRows(target[-1] + 1, target, np.ones(len(target)))
    mean = rows.mean(force)
    return of_blocks(rows.standard_error(force, mean, window), rows.samples, rows.degrees(window), np.abs(mean[:, 0]) > 30)


def logged(smooth: np.ndarray, window: int) -> np.ndarray:
    """The same with white noise, all of it through a moving mean, as a log over whole revolutions of the spindle is."""
    noisy = smooth + NOISE * np.random.default_rng(3).standard_normal(smooth.shape)
    if not window:
        return noisy
    return np.column_stack([np.convolve(axis, np.full(window, 1 / window), mode="same") for axis in noisy.T])


@pytest.mark.parametrize("window", [0, 7, 13])
@pytest.mark.parametrize("kind", ["even", "ramp", "turning", "steps"])
def test_what_the_force_does_is_no_scatter(kind: str, window: int) -> None:
    """Of 300 targets; a ramp of 8 N a target, a force that turns by 2.4 degrees, a step of 400 N at every fortieth target."""
    place = np.arange(300 * SAMPLES) / SAMPLES
    size = {"even": 100 + 0 * place, "ramp": 100 + 8 * place, "turning": 100 + 0 * place,
            "steps": 100.0 + 400.0 * (np.floor((place + 19.7) / 40) % 2)}[kind]
    angle = np.radians(2.4 * place / 4) if kind == "turning" else 0 * place
    force = size[:, None] * np.column_stack([np.cos(0.2 * angle), np.sin(angle), 0.3 + 0 * angle])
    errors = found(logged(force, window), window)
    true = NOISE / np.sqrt(SAMPLES)
    assert np.median(errors, axis=0) == pytest.approx(true, rel=0.2)
    assert np.max(errors[2:-2] / true) < 1.8


def test_a_place_that_scatters_more_has_its_own() -> None:
    """Half of the path chatters: four times the noise, and four times the standard error there."""
    rng = np.random.default_rng(8)
    noise = NOISE * np.where(np.arange(400 * SAMPLES)[:, None] < 200 * SAMPLES, 1.0, 4.0)
    errors = found(100 + noise * rng.standard_normal((400 * SAMPLES, 3)), 0)
    assert np.median(errors[240:], axis=0) / np.median(errors[:160], axis=0) == pytest.approx(4.0, rel=0.2)


def test_few_targets_keep_their_own() -> None:
    own = np.abs(np.random.default_rng(2).standard_normal((9, 3)))
    assert np.array_equal(of_blocks(own, np.full(9, 20.0), np.full(9, 6), np.ones(9, dtype=bool)), own)


@pytest.mark.parametrize("batches", [2, 3, 4, 5, 8])
@pytest.mark.parametrize("window", [1, 12, 30])
def test_what_batches_scatter_is_held_against_what_their_mean_does(batches: int, window: int) -> None:
    """White noise under a moving mean, drawn: the variance of the mean over the squares of its batches about their mean, or
    their line where there are four and more."""
    rng, each, count = np.random.default_rng(batches + window), 40, 10_000
    total = np.cumsum(np.pad(rng.standard_normal((count, batches * each + window - 1)), ((0, 0), (1, 0))), axis=1)
    means = ((total[:, window:] - total[:, :-window]) / window).reshape(count, batches, each).mean(axis=2)
    mean = means.mean(axis=1)
    place = np.arange(batches) - means.shape[1] / 2 + 0.5
    slope = (means @ place / (place @ place) if batches >= 4 else np.zeros(count))[:, None]
    squares = np.sum((means - mean[:, None] - slope * place) ** 2, axis=1).mean()
    given = np.array([batches])
    found = _mean_by_scatter(np.array([batches * each]), given, float(window), _rise(given))
    assert found[0] == pytest.approx(mean.var() / squares, rel=0.07)


@pytest.mark.parametrize("weight", [1.0, 25.0])
@pytest.mark.parametrize("shuffled", [False, True])
def test_of_many_rows_it_is_what_eight_batches_scatter_about_their_line(weight: float, shuffled: bool) -> None:
    """Targets of 16, 40 and 4 rows, in order or not: a line by numpy's polynomials, and its residuals
    over their degrees of freedom and their number. Rows are means of so many samples."""
    rng = np.random.default_rng(5)
    target = np.repeat([0, 1, 2, 3], [16, 40, 4, 16])
    force = rng.normal(0, 3, (76, 3)) + np.arange(76)[:, None] * [0.5, -1, 0]
    order = np.argsort(rng.random(76)) if shuffled else np.arange(76)
    rows = TargetRows(5, target[order], np.full(76, weight))
    mean = rows.mean(force[order])
    found = rows.standard_error(force[order], mean, 0.0)
    for number, batches in ((0, 8), (1, 8), (2, 4), (3, 8)):
        own = force[order][target[order] == number]
        means = np.array([part.mean(axis=0) for part in np.split(own, batches)])
        line = np.polynomial.polynomial.polyfit(np.arange(batches), means, 1)
        left = means - np.polynomial.polynomial.polyval(np.arange(batches), line).T
        assert found[number] == pytest.approx(np.sqrt(np.sum(left**2, axis=0) / (batches - 2) / batches), rel=1e-9)
    assert np.isnan(found[4]).all()
    assert rows.degrees(0.0)[:4].tolist() == [6, 6, 2, 6]


def test_of_few_rows_it_is_what_they_scatter_about_the_slope_of_the_neighbours() -> None:
    """Three rows, and two; none is known of one. A target at an end, or beside one without rows, has no slope."""
    rng = np.random.default_rng(6)
    target = np.repeat([0, 1, 2, 3, 5, 6, 7], [3, 3, 2, 3, 3, 1, 2])
    force = rng.normal(0, 3, (17, 3)) + 20 * target[:, None]
    rows = TargetRows(8, target, np.ones(17))
    mean = rows.mean(force)
    found = rows.standard_error(force, mean, 0.0)
    for number in (0, 1, 2, 3, 5, 7):
        own = force[target == number]
        count = len(own)
        slope = 0.5 * (mean[number + 1] - mean[number - 1]) if number in (1, 2) else np.zeros(3)
        left = own - mean[number] - np.outer((np.arange(count) - 0.5 * (count - 1)) / count, slope)
        assert found[number] == pytest.approx(np.sqrt(np.sum(left**2, axis=0) / (count * (count - 1))), rel=1e-9)
    assert np.isnan(found[[4, 6]]).all()
    assert rows.degrees(0.0)[[0, 2, 6]].tolist() == [2, 1, 0]


@pytest.mark.parametrize(("samples", "window", "batches"), [
    (100, 10.0, 8), (60, 10.0, 6), (39, 10.0, 3), (12, 10.0, 2), (5, 10.0, 2), (3, 0.0, 3)])
def test_no_batch_is_shorter_than_a_revolution_where_there_are_two(samples: int, window: float, batches: int) -> None:
    rows = TargetRows(1, np.zeros(samples, dtype=np.intp), np.ones(samples))
    assert rows.batches(window).tolist() == [batches]


def test_rows_of_a_stretch_are_those_before_the_next_move() -> None:
    """What was taken on the way to the next target is left out, unless nothing else is there; behind the last one none is."""
    target = np.array([0, 1, 1, 2, 2, 3, 3])
    behind = np.array([True, False, True, True, True, False, True])
    rows = TargetRows(4, target, np.ones(7), behind)
    assert rows.between(0, 1).tolist() == [0, 1]
    assert rows.between(1, 2).tolist() == [1, 2]
    assert rows.between(2, 2).tolist() == [3, 4]
    assert rows.between(1, 3).tolist() == [1, 2, 3, 4, 5, 6]
    assert TargetRows(4, target, np.ones(7)).between(0, 1).tolist() == [0, 1, 2]


@pytest.mark.parametrize(("count", "kept"), [(15, True), (16, False)])
def test_sixteen_targets_share_their_scatter(count: int, kept: bool) -> None:
    """The median of what a sample scatters by, of chi-squares of five degrees of freedom, whose median is 4.35."""
    rng = np.random.default_rng(count)
    errors, samples = rng.uniform(1, 2, (count, 3)), rng.integers(5, 50, count).astype(float)
    found = of_blocks(errors, samples, np.full(count, 5), np.ones(count, dtype=bool))
    own = np.median(errors**2 * samples[:, None], axis=0) / (4.3515 / 5)
    expected = errors if kept else np.sqrt(own / samples[:, None])
    assert found == pytest.approx(expected, rel=2e-3)


def test_a_block_is_of_32_targets_and_between_their_middles_it_goes_evenly() -> None:
    """Two blocks of 33 and 32 with force, four times as loud behind; those without, 20 of them, have their own; one that is not
    known stays unknown."""
    place = np.arange(86)
    forced = place < 66
    errors = np.where(place < 34, 1.0, np.where(forced, 4.0, 0.5))[:, None] * np.ones(3)
    errors[10] = np.nan
    found = of_blocks(errors, np.full(86, 4.0), np.full(86, 10**6), forced)
    first, second = np.mean(np.delete(np.arange(34), 10)), np.mean(np.arange(34, 66))
    variance = np.interp(place[:66], [first, second], [1.0, 16.0])
    assert np.delete(found[:66, 1], 10) == pytest.approx(np.delete(np.sqrt(variance), 10), rel=1e-5)
    assert found[66:, 1] == pytest.approx(np.full(20, 0.5), rel=1e-5)
    assert np.isnan(found[10]).all()

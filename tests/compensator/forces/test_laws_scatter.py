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

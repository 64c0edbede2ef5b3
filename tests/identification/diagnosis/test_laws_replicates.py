"""Noise that replicates are drawn from: each draw with parts of a size of its own."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose

from identification.diagnosis import replicates
from identification.diagnosis.replicates import AveragedNoise, FittedNoise
from identification.fit.noise_parts import SetUp

LOGS, WEIGHT = np.array([0.3, -0.5, 0.0, 1.0, -2.0, 0.1]), np.array([1.0, 0.2])


@pytest.mark.parametrize("std", [0.1, 50.0])
def test_sizes_are_drawn_from_their_own_posterior_and_not_far_beyond(std: float) -> None:
    """Normal in ln, two of them going together; no smaller than by e^-2.5 and no larger than by e^1.5."""
    seen: list[Any] = []

    def draw(*of: Any) -> str:
        seen.append(of)
        return "drawn"

    model: Any = SimpleNamespace(draw=draw, measured=np.ones((4, 3), dtype=bool))
    components: Any = SimpleNamespace(logs=LOGS)
    covariance = std**2 * np.eye(6)
    covariance[0, 1] = covariance[1, 0] = 0.6 * std**2
    noise = FittedNoise(model, components, covariance, WEIGHT)
    rng = np.random.default_rng(0)
    assert str(noise.draw(rng, 4000)) == "drawn"
    (sizes, weight, given), = seen
    assert weight is WEIGHT
    assert given is rng
    off = np.log(sizes) - LOGS
    if std < 1:
        assert_allclose(off.mean(axis=0), 0.0, atol=5 * std / np.sqrt(4000))
        assert_allclose(np.cov(off.T) / std**2, covariance / std**2, atol=0.1)
    else:
        assert_allclose(off.min(axis=0), -2.5)
        assert_allclose(off.max(axis=0), 1.5)
        assert np.mean(np.isclose(off, 1.5)) == pytest.approx(0.488, abs=0.02)
    assert noise.readings == 12


def test_trials_are_drawn_by_their_weight_each_in_its_own_way(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of three, two of one way in which set-ups may differ and one of another."""
    ways = list(SetUp)
    asked: list[Any] = []

    def drawn(sizes: Any, weight: Any, rng: Any) -> Any:
        assert weight is WEIGHT
        return np.broadcast_to(sizes[:, 0], (2, 3, len(sizes)))

    def with_parts(*parts: int, set_up: SetUp) -> Any:
        asked.append((parts, set_up))
        return SimpleNamespace(draw=lambda sizes, weight, rng: drawn(sizes, weight, rng) * (1 if set_up == ways[0] else -1))

    monkeypatch.setattr(replicates, "possible", lambda model: (4, 5))
    model: Any = SimpleNamespace(with_parts=with_parts, measured=np.array([[True, False, True]]))
    set_up = np.array([ways[0], ways[1], ways[0]], dtype=object)
    trials: Any = SimpleNamespace(weight=np.array([0.5, 0.2, 0.3]), logs=np.log([[1.0], [2.0], [4.0]]), set_up=set_up)
    noise = AveragedNoise(model, trials, WEIGHT)
    found = noise.draw(np.random.default_rng(1), 5000)
    assert found.shape == (2, 3, 5000)
    values, counts = np.unique(found[0, 0].round(9), return_counts=True)
    assert values.tolist() == [-2.0, 1.0, 4.0]
    assert_allclose(counts / 5000, [0.2, 0.5, 0.3], atol=0.035)
    assert asked == [((4, 5), way) for way in ways]
    assert noise.readings == 2

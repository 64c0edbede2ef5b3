"""Deviations along other axes are told by name, right ones never: by chance experiments."""

from __future__ import annotations

import re

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from identification.common.other_axes import along_other_axes, turned_axes

NOISE = 5e-6


def predicted(rng: np.random.Generator, count: int = 60) -> np.ndarray:
    """Smooth deviations (count, 3) [m] of some 0.2 mm that turn with the path, as a raster's or a pocket's do."""
    place = np.linspace(0, 1, count)[:, None]
    waves = [rng.normal(size=3) * np.sin(2 * np.pi * k * place + rng.uniform(0, 6, 3)) for k in range(1, 6)]
    return np.asarray(1e-4 * sum(waves) + 1e-4 * rng.normal(size=3))


def measured(rng: np.random.Generator, told: np.ndarray) -> np.ndarray:
    """Of a part that gives way by 0.9 to 1.3 times as much, stands up to 0.3 mm aside, and is off by a tenth otherwise."""
    beside = 0.1 * predicted(rng, len(told))
    stands, noise = 3e-4 * rng.uniform(-1, 1, 3), NOISE * rng.normal(size=told.shape)
    return np.asarray(rng.uniform(0.9, 1.3) * told + beside + stands + noise)


def turned(told: np.ndarray, what: str) -> np.ndarray:
    if what == "the base frame":
        return np.asarray(told @ Rotation.from_euler("xyz", [20, -35, 70], degrees=True).as_matrix())
    return told * [1, -1, 1] if "sign" in what else told[:, [2, 1, 0]]


@pytest.mark.parametrize("what", ["the base frame", "y with the other sign", "x and z exchanged"])
def test_the_axes_are_named(what: str) -> None:
    named = []
    for seed in range(40):
        rng = np.random.default_rng((61, seed))
        told = predicted(rng)
        base = {"the base frame": turned(told, "the base frame")}
        found = along_other_axes(measured(rng, turned(told, what)), told, base, NOISE)
        named.append(found[0] if found else "")
    assert named.count(what) >= 36
    assert set(named) <= {what, ""}


@pytest.mark.parametrize("count", [12, 60, 400])
def test_right_ones_are_left_in_peace(count: int) -> None:
    """However well the prediction holds: a part that has nothing to do with it is not along other axes either."""
    for seed in range(200):
        rng = np.random.default_rng((62, seed))
        told = predicted(rng, count)
        base = {"the base frame": turned(told, "the base frame")}
        assert along_other_axes(measured(rng, told), told, base, NOISE) is None
        if count > 12:
            assert along_other_axes(predicted(rng, count), told, base, NOISE) is None
        assert along_other_axes(NOISE * rng.normal(size=told.shape), told, base, NOISE) is None


@pytest.mark.parametrize("degrees", [20, 45, 90, 150])
def test_a_turn_by_any_angle_is_told_with_its_axis(degrees: float) -> None:
    told_turns = 0
    for seed in range(40):
        rng = np.random.default_rng((63, seed))
        axis = rng.normal(size=3)
        axis /= np.linalg.norm(axis)
        turn = Rotation.from_rotvec(np.radians(degrees) * axis)
        told = predicted(rng)
        found = turned_axes(turn.inv().apply(measured(rng, told)), told, NOISE)
        if found is not None:
            told_turns += 1
            words = re.fullmatch(r"turned by (\d+) deg about \((.*)\)", found[0])
            assert words
            angle, about = words.groups()
            seen = Rotation.from_rotvec(np.radians(float(angle)) * np.array([float(x) for x in about.split(",")]))
            assert np.degrees((seen * turn.inv()).magnitude()) < 15
    assert told_turns >= 36


@pytest.mark.parametrize("count", [12, 60, 400])
def test_axes_that_are_right_are_not_told_as_turned(count: int) -> None:
    for seed in range(200):
        rng = np.random.default_rng((64, seed))
        told = predicted(rng, count)
        assert turned_axes(measured(rng, told), told, NOISE) is None
        assert turned_axes(NOISE * rng.normal(size=told.shape), told, NOISE) is None
        if count > 12:
            assert turned_axes(predicted(rng, count), told, NOISE) is None

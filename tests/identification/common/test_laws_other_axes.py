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


def drawn(count: int, sizes: tuple[float, float, float], noise: float) -> tuple[np.ndarray, np.ndarray]:
    """Three components (count, 3) of these RMS, and three of one RMS beside them: each of mean zero, and none has anything of
    another."""
    rng = np.random.default_rng(65)
    columns = np.linalg.qr(np.column_stack([np.ones(count), rng.normal(size=(count, 6))]))[0][:, 1:] * np.sqrt(count)
    return columns[:, :3] * sizes, columns[:, 3:] * noise


MIRRORS = {"x with the other sign": np.diag([-1.0, 1, 1]), "z with the other sign": np.diag([1.0, 1, -1]),
           "x and y exchanged": np.eye(3)[[1, 0, 2]], "y and z exchanged": np.eye(3)[[0, 2, 1]]}


@pytest.mark.parametrize("name", MIRRORS)
@pytest.mark.parametrize(("count", "multiple", "noise", "sigma", "told_so"), [
    (12, 1.0, 0.4, 0.05, True), (11, 1.0, 0.4, 0.05, False), (40, 1.95, 0.4, 0.05, True), (40, 2.05, 0.4, 0.05, False),
    (40, 0.51, 0.1, 0.05, True), (40, 0.49, 0.1, 0.05, False), (40, 1.0, 0.70, 0.05, True), (40, 1.0, 0.71, 0.05, False),
    (40, 1.0, 0.1, 0.316, True), (40, 1.0, 0.1, 0.317, False)])
def test_other_axes_are_told_where_they_leave_under_six_tenths_of_what_is_clear(
        name: str, count: int, multiple: float, noise: float, sigma: float, told_so: bool) -> None:
    """Of components of 1 each a third of the multiple is the best of the stated axes, and leaves sqrt(8/9) of it beside the
    noise; that is over three sigmas or not. A constant counts for nothing."""
    told, beside = drawn(count, (1.0, 1.0, 1.0), noise)
    found = along_other_axes(multiple * told @ MIRRORS[name] + beside + [3.0, -2.0, 5.0], told, {}, sigma)
    as_is = np.sqrt(8 / 9 * multiple**2 + noise**2)
    assert (noise < 0.6 * as_is and 3 * sigma < as_is and count > 11 and 0.5 < multiple < 2) == told_so
    if told_so:
        assert found is not None
        assert found[0] == name
        assert found[1:] == pytest.approx([noise, as_is], rel=1e-9)
    else:
        assert found is None


@pytest.mark.parametrize(("size", "told_so"), [(0.15, True), (0.135, False)])
def test_what_the_stated_axes_leave_is_a_fifth_of_the_whole_or_no_word(size: float, told_so: bool) -> None:
    """One component, of the other sign, is small beside two that are right: by it (1 - 2 share) is the best multiple."""
    told, _ = drawn(40, (size, 1.0, 1.0), 0.0)
    share = size**2 / (2 + size**2)
    left = np.sqrt(1 - (1 - 2 * share) ** 2)
    assert (left > 0.2) == told_so
    found = along_other_axes(told * [-1, 1, 1], told, {}, 1e-9)
    assert (None if found is None else found[0]) == ("x with the other sign" if told_so else None)


@pytest.mark.parametrize(("degrees", "count", "noise", "sigma", "told_so"), [
    (15.5, 12, 0.01, 0.01, True), (15.5, 11, 0.01, 0.01, False), (14.5, 40, 0.01, 0.01, False), (40.0, 40, 0.29, 0.01, True),
    (40.0, 40, 0.31, 0.01, False), (40.0, 40, 0.01, 0.174, True), (40.0, 40, 0.01, 0.177, False), (180.0, 40, 0.1, 0.01, True)])
def test_a_turn_is_told_from_fifteen_degrees_where_it_leaves_under_half(
        degrees: float, count: int, noise: float, sigma: float, told_so: bool) -> None:
    """About z, along which there is little: of the plane the cosine is the best multiple of the stated axes."""
    told, beside = drawn(count, (1.0, 1.0, 0.3), noise)
    turn = Rotation.from_euler("z", degrees, degrees=True).as_matrix()
    found = turned_axes(told @ turn + beside + [3.0, -2.0, 5.0], told, sigma)
    multiple = (2 * np.cos(np.radians(degrees)) + 0.09) / 2.09
    as_is = np.sqrt(2.09 * (1 - multiple**2) / 3 + noise**2)
    assert (noise < 0.5 * as_is and 3 * sigma < as_is and count > 11 and degrees > 15) == told_so
    if told_so:
        assert found is not None
        sense = "-?" if degrees == 180 else ""
        assert re.fullmatch(rf"turned by {degrees:.0f} deg about \(0.00, 0.00, {sense}1.00\)", found[0])
        assert found[1:] == pytest.approx([noise, as_is], rel=1e-6)
    else:
        assert found is None

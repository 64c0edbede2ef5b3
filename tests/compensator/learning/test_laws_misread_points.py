"""Measured points that miss the path are told as what they would lie on it, and right ones, or another part's, as nothing."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from compensator.learning.measured_points import MeasuredPoints
from compensator.learning.misread_points import misread
from identification.model.rotations import Frame

WITHIN, RADIUS = 1e-3, 8e-3
BASE = Frame(Rotation.from_euler("z", 10, degrees=True).as_matrix(), np.array([1.35, -0.1, 0.75]))


def contour() -> tuple[np.ndarray, np.ndarray]:
    """The tool's path (k, 3) [m] round a part like no mirror image of itself, and the normals (k, 3) towards the tool."""
    corners = np.array([[-60, -20, -3], [70, -20, -3], [70, 35, -3], [20, 35, -3], [20, 60, -3], [-60, 50, -3]]) / 1e3
    path, normals = [], []
    for start, end in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        way = end - start
        count = int(np.linalg.norm(way) / 0.25e-3)
        path.append(start + np.arange(count)[:, None] / count * way)
        normals.append(np.tile(np.array([way[1], -way[0], 0]) / np.linalg.norm(way), (count, 1)))
    return np.concatenate(path), np.concatenate(normals)


PATH, NORMAL = contour()


def points(position: np.ndarray, normal: np.ndarray) -> MeasuredPoints:
    count, none = len(position), np.zeros(0)
    return MeasuredPoints("points.csv", position, np.full(count, -1), np.arange(count), normal, np.zeros(0, dtype=int),
                          np.zeros((0, 3)), none, none)


def measured(radius: float, seed: int = 1) -> tuple[np.ndarray, np.ndarray]:
    """Every eighth place of the part, where the tool stood or of its surface, and one in fifty elsewhere."""
    rng = np.random.default_rng([5303, seed])
    position = PATH[::8] - radius * NORMAL[::8] + 1e-5 * rng.standard_normal(PATH[::8].shape)
    position[::50] += [0, 0, 0.02]
    return position, NORMAL[::8].copy()


def said(position: np.ndarray, normal: np.ndarray, radius: float) -> str:
    return misread(points(position, normal), radius, WITHIN, PATH, {"in the robot's base frame": BASE})


WRONG = {
    "in inches": lambda p, n: (p / 25.4, n),
    "in metres": lambda p, n: (p / 1e3, n),
    "in the robot's base frame": lambda p, n: (p @ BASE.rotation.T + BASE.position, n @ BASE.rotation.T),
    "with the other sign of x, as of a mirrored part": lambda p, n: (p * [-1, 1, 1], n * [-1, 1, 1]),
    "with the other sign of y, as of a mirrored part": lambda p, n: (p * [1, -1, 1], n * [1, -1, 1]),
    "with the other sign of z, as of a mirrored part": lambda p, n: (p * [1, 1, -1], n * [1, 1, -1]),
    "turned round by half a turn about x": lambda p, n: (p * [1, -1, -1], n * [1, -1, -1]),
    "turned round by half a turn about y": lambda p, n: (p * [-1, 1, -1], n * [-1, 1, -1]),
    "turned round by half a turn about z": lambda p, n: (p * [-1, -1, 1], n * [-1, -1, 1]),
    "with x and y exchanged": lambda p, n: (p[:, [1, 0, 2]], n[:, [1, 0, 2]]),
    "with x and z exchanged": lambda p, n: (p[:, [2, 1, 0]], n[:, [2, 1, 0]]),
    "with y and z exchanged": lambda p, n: (p[:, [0, 2, 1]], n[:, [0, 2, 1]]),
}


@pytest.mark.parametrize("words", WRONG)
@pytest.mark.parametrize("radius", [0.0, RADIUS])
def test_what_would_put_the_points_onto_the_path_is_said(words: str, radius: float) -> None:
    assert said(*WRONG[words](*measured(radius)), radius) == words


def test_normals_into_the_material_are_said() -> None:
    position, normal = measured(RADIUS)
    assert said(position, -normal, RADIUS).startswith("with normals that point the other way")


@pytest.mark.parametrize("radius", [0.0, RADIUS])
def test_nothing_is_said_of_right_points_or_of_another_part(radius: float) -> None:
    position, normal = measured(radius)
    assert said(position, normal, radius) == ""
    assert said(position + np.array([0.005, 0.003, 0]), normal, radius) == ""
    assert said(position, normal, RADIUS - radius) == ""
    round_part = np.column_stack([0.04 * normal[:, :2], np.full(len(normal), -3e-3)])
    assert said(round_part, normal, radius) == ""


def beside_two_tracks(stand: int, mirrored: int, lost: int) -> str:
    """So many points on the first of two tracks, where the second would be with the other sign of y, and on none."""
    along = np.arange(-0.06, 0.06, 0.25e-3)
    path = np.concatenate([np.column_stack([along, np.full(len(along), y), np.full(len(along), -3e-3)]) for y in (0.0, 0.02)])
    rng = np.random.default_rng(5303)
    y = np.repeat([0.0, -0.02, 0.3], [stand, mirrored, lost])
    place = np.column_stack([rng.uniform(-0.055, 0.055, len(y)), y, np.full(len(y), -3e-3)])
    return misread(points(place, np.full_like(place, np.nan)), 0.0, WITHIN, path, {})


@pytest.mark.parametrize(("stand", "mirrored", "lost", "said"), [
    (89, 11, 0, True), (90, 10, 0, False), (80, 17, 3, True), (80, 16, 4, False), (0, 97, 3, True), (0, 96, 4, False)])
def test_nine_tenths_that_stand_are_left_and_97_in_100_that_would_are_told(
    stand: int, mirrored: int, lost: int, said: bool
) -> None:
    assert beside_two_tracks(stand, mirrored, lost) == ("with the other sign of y, as of a mirrored part" if said else "")


@pytest.mark.parametrize("within", [0.9e-3, 1.1e-3])
def test_a_place_is_on_the_path_that_is_as_near_as_is_said(within: float) -> None:
    """1 mm beside it as it stands, and on it in the other frame."""
    along = np.column_stack([np.arange(-0.06, 0.06, 0.25e-3), *np.zeros((2, 480))])
    position = along[::7] + np.array([0, 1e-3, 0])
    frame = Frame(np.eye(3), np.array([0, 1e-3, 0]))
    found = misread(points(position, np.zeros_like(position)), 0.0, within, along, {"in another frame": frame})
    assert found == ("in another frame" if within < 1e-3 else "")


@pytest.mark.parametrize("count", [4000, 4001])
def test_of_over_four_thousand_points_every_second_is_looked_at(count: int) -> None:
    """Every other one is elsewhere: that is half of them, or of those that are looked at none."""
    along = np.column_stack([np.arange(-0.06, 0.06, 0.25e-3), np.full((480, 1), 0.02), np.zeros((480, 1))])
    place = along[np.arange(count) % 480] / 1e3
    place[1::2] = [9.0, 0.0, 0.0]
    assert misread(points(place, np.zeros_like(place)), 0.0, WITHIN, along, {}) == ("" if count == 4000 else "in metres")

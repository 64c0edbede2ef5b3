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
    "turned round by half a turn about z": lambda p, n: (p * [-1, -1, 1], n * [-1, -1, 1]),
    "with x and y exchanged": lambda p, n: (p[:, [1, 0, 2]], n[:, [1, 0, 2]]),
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

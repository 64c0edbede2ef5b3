"""Outlines on a grid against every edge looked at from every point."""

from __future__ import annotations

import numpy as np
import pytest

from compensator.cutting.sections import signed_distance, windings

CELL, ORIGIN = 0.5e-3, np.array([-0.013, 0.021])
NX, NY = 71, 53


def outline(corner: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Edges (E, 2, 2) [m] of a closed way to the left, and their outward directions (E, 2)."""
    edge = np.stack([corner, np.roll(corner, -1, axis=0)], axis=1)
    way = edge[:, 1] - edge[:, 0]
    return edge, np.column_stack([way[:, 1], -way[:, 0]])


def star(middle: tuple[float, float], low: float, high: float, points: int = 7, seed: int = 3) -> np.ndarray:
    """Corners (2 points, 2) [m] about a middle [mm], in turns `low` and `high` [mm] away."""
    turn = np.linspace(0, 2 * np.pi, 2 * points, endpoint=False) + np.random.default_rng(seed).uniform(0, 0.1, 2 * points)
    far = np.where(np.arange(2 * points) % 2, low, high)
    return 1e-3 * (np.array(middle) + far[:, None] * np.column_stack([np.cos(turn), np.sin(turn)]))


def grid() -> np.ndarray:
    """(NY, NX, 2) [m]."""
    return np.asarray(ORIGIN + CELL * np.stack(np.meshgrid(np.arange(NX), np.arange(NY)), axis=-1))


def inside(corner: np.ndarray) -> np.ndarray:
    """By the angle that the outline goes round each point."""
    off = corner - grid()[..., None, :]
    angle = np.arctan2(off[..., 1], off[..., 0])
    turned = np.roll(angle, -1, axis=-1) - angle
    return np.asarray(np.rint(((turned + np.pi) % (2 * np.pi) - np.pi).sum(axis=-1) / (2 * np.pi)).astype(int))


def away(edge: np.ndarray, points: np.ndarray) -> np.ndarray:
    """From points (ny, nx, 2) [m] to the nearest edge."""
    least = np.full(points.shape[:2], np.inf)
    for a, b in edge:
        way = b - a
        share = np.clip(((points - a) @ way) / (way @ way), 0, 1)
        least = np.minimum(least, np.linalg.norm(points - a - share[..., None] * way, axis=-1))
    return least


HOLED = (star((4.0, 34.0), 8.0, 11.0), star((5.0, 33.0), 2.5, 5.0, 5)[::-1])


def test_points_are_held_by_the_bodies_around_them() -> None:
    """A body with a hole, a second one that reaches into it, and one turned inside out."""
    beside = star((13.0, 38.0), 3.0, 7.0, 4, seed=5)
    edge, out = (np.concatenate(parts) for parts in zip(*map(outline, (*HOLED, beside)), strict=True))
    found = windings(edge, out, ORIGIN, CELL, NY, NX)
    np.testing.assert_array_equal(found, sum(inside(corner) for corner in (*HOLED, beside)))
    assert sorted(set(found.ravel())) == [0, 1, 2]
    edge, out = outline(HOLED[0][::-1])
    np.testing.assert_array_equal(windings(edge, out, ORIGIN, CELL, NY, NX), -inside(HOLED[0]))


def test_a_row_through_corners_passes_them_once() -> None:
    """Corners and level edges on the grid's own rows and columns: a point on the lower or left edge is held, one on the upper
    or right is not, whatever the last bit of a corner is."""
    i, j = np.array([10, 30, 30, 10]), np.array([5, 5, 25, 25])
    corner = ORIGIN + CELL * np.column_stack([i, j]) + 1e-11 * np.array([[1, -1], [-1, 1], [1, 1], [-1, -1]])
    found = windings(*outline(corner), ORIGIN, CELL, NY, NX)
    truth = np.zeros((NY, NX))
    truth[5:25, 10:30] = 1
    np.testing.assert_array_equal(found, truth)


@pytest.mark.parametrize("thin", [False, True])
def test_distances_near_an_edge_are_exact_and_others_to_a_cell(thin: bool) -> None:
    """Within 2 mm, at corners and along edges a few millimetres long, positive within."""
    corner = (1e-3 * np.array([[-8.0, 25.3], [17.3, 25.3], [17.3, 25.9], [-8.0, 25.9]]),) if thin else HOLED
    edge = np.concatenate([outline(one)[0] for one in corner])
    within = sum(inside(one) for one in corner) > 0
    found, truth = signed_distance(edge, within, ORIGIN, CELL), away(edge, grid())
    assert found.dtype == np.float32
    assert found.shape == (NY, NX)
    np.testing.assert_array_equal(found[np.abs(truth) > 1e-9] > 0, within[np.abs(truth) > 1e-9])
    near = truth < 2e-3
    assert np.abs(found)[near] == pytest.approx(truth[near], abs=2e-9)
    assert (~near).sum() > 500
    assert np.abs(np.abs(found) - truth)[~near].max() < 0.75 * CELL


def test_a_coarse_grid_is_exact_for_three_cells() -> None:
    """Of 5 mm, where 2 mm is less than one; a layer without an outline is outside, further than its grid is wide."""
    edge, _ = outline(1e-3 * np.array([[20.0, 20], [133, 31], [140, 90], [15, 88]]))
    least = away(edge, 5e-3 * np.stack(np.meshgrid(np.arange(40), np.arange(31)), axis=-1))
    found = signed_distance(edge, np.zeros(least.shape, dtype=bool), np.zeros(2), 5e-3)
    near = least <= 15e-3
    assert -found[near] == pytest.approx(least[near], abs=1e-8)
    assert np.abs(-found - least).max() < 0.75 * 5e-3
    none = signed_distance(np.zeros((0, 2, 2)), np.zeros((30, 40), dtype=bool), np.zeros(2), 5e-3)
    np.testing.assert_allclose(none, -0.25, rtol=1e-6)

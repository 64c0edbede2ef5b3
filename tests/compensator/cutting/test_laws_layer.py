"""A layer of the stock between its points."""

from __future__ import annotations

import numpy as np
import pytest

from compensator.cutting.cutter import Cutter
from compensator.cutting.stock import Stock, box_stock
from compensator.cutting.swept import Material, between, go_over, sampled


def test_between_its_points_a_stock_is_a_plane_and_outside_nothing() -> None:
    """A slope is met exactly everywhere on the grid, to its last point; half a cell beyond any edge there is no material."""
    rng = np.random.default_rng(7)
    cell, origin = 2e-3, np.array([0.3, -0.1])
    y, x = np.mgrid[0:7, 0:11] * cell
    stock = Stock(origin, cell, np.array([0.0, 1.0]), (5.0 + 2.0 * x - 3.0 * y)[None].astype(np.float32), np.zeros((0, 2, 3)))
    place = np.concatenate([rng.uniform(size=(40, 2)), [[0, 0], [1 - 1e-9, 1 - 1e-9]]]) * [10 * cell, 6 * cell]
    inside = sampled(stock, stock.inside, np.array([0]), origin + place[None])
    np.testing.assert_allclose(inside[0], 5.0 + 2.0 * place[:, 0] - 3.0 * place[:, 1], atol=1e-5)
    beyond = np.array([[-0.5, 3], [10.5, 3], [4, -0.5], [4, 6.5]]) * cell
    assert (sampled(stock, stock.inside, np.array([0]), origin + beyond[None]) < 0).all()


def test_between_thin_layers_it_is_in_proportion_and_in_thick_ones_as_their_own() -> None:
    """Middles at 0.5, 1.5, 2.5, 4.5 and 8.5 mm, the last two thicker than 1.5; under the first and over the last as there."""
    height = 1e-3 * np.array([0.0, 1, 2, 3, 6, 11])
    stock = Stock(np.zeros(2), 1e-3, height, np.zeros((5, 4, 4), dtype=np.float32), np.zeros((0, 2, 3)))
    for at, layer, share in ((-0.5, 0, 0.0), (0.2, 0, 0.0), (0.5, 0, 0.0), (0.75, 0, 0.25), (1.4, 0, 0.9), (2.0, 1, 0.5),
                             (2.4, 1, 0.9), (2.9, 2, 0.0), (3.1, 2, 1.0), (4.6, 3, 0.0), (5.9, 3, 0.0), (6.1, 3, 1.0),
                             (8.4, 3, 1.0), (8.6, 3, 1.0), (12.0, 3, 1.0)):
        low, part = between(stock, np.array([1e-3 * at]), 1.5e-3)
        assert low[0] + part[0] == pytest.approx(layer + share), at
        # That it is the same of one layer's number or another's.
        assert 0 <= part[0] <= 1
    one = Stock(np.zeros(2), 1e-3, height[:2], stock.inside[:1], np.zeros((0, 2, 3)))
    low, part = between(one, 1e-3 * np.array([-1.0, 0.3, 0.8, 2.0]), 1.5e-3)
    assert not low.any()
    assert not part.any()


def test_a_share_of_two_layers_is_of_what_each_knows_near_its_edge() -> None:
    """Further than two cells from an edge within a layer does not tell how far."""
    inside = np.array([0.1e-3, 1.7e-3, 9e-3, -5e-3], dtype=np.float32)[:, None, None] * np.ones((4, 5, 5), dtype=np.float32)
    stock = Stock(np.zeros(2), 1e-3, np.arange(5.0), inside, np.zeros((0, 2, 3)))
    points = np.full((4, 3, 2), 2.2e-3)
    found = sampled(stock, inside, np.array([0, 1, 2, 3]), points, np.array([0.25, 0.5, 0.75, 0.5]))
    assert 1e3 * found[:, 0] == pytest.approx([0.75 * 0.1 + 0.25 * 1.7, 0.5 * (1.7 + 2), 0.25 * 2 - 0.75 * 5, -5], rel=1e-5)


@pytest.mark.parametrize("leaning", [False, True])
def test_what_was_gone_over_is_all_within_the_tool(leaning: bool) -> None:
    """Of a ball, upright or leaning, whose steps turn a corner and change their height: as far off as the nearest of 81 places
    of each way, in each layer a circle, or over the ball the cut of the shank, near it."""
    radius, cell = 3e-3, 0.8e-3
    ball = Cutter(radius, 2, radius)
    height = np.linspace(-6e-3, 6e-3, 13)
    stock = box_stock(np.array([-12e-3, -9e-3, -6e-3]), np.array([12e-3, 9e-3, 6e-3]), height, cell)
    corner = 1e-3 * np.array([[-5.0, -2, -4], [-4, -2, -4], [-2, -2, -4], [1, 1, -4], [1, 1, -1.2], [3, 1.5, -1.2]])
    start, end = corner[:-1], corner[1:]
    axis = np.tile(np.array([0.3, -0.2, np.sqrt(1 - 0.13)]) if leaning else np.array([0.0, 0, 1]), (5, 1))
    material = Material.of(stock, 0.0)
    middle = 0.5 * (height[1:] + height[:-1])
    level = [0, 1, 2, 4]        # of the way up the tests of slopes tell
    go_over(material, ball, start[level], end[level], axis[level], np.full(4, leaning), middle, np.arange(12))
    ny, nx = stock.inside.shape[1:]
    points = stock.origin + cell * np.stack(np.meshgrid(np.arange(nx), np.arange(ny)), axis=-1)
    for layer in range(12):
        least = np.full((ny, nx), np.inf)
        for k in level:
            up = middle[layer] - start[k, 2]
            if up < 0:
                continue
            own = np.sqrt(radius**2 - max(radius - up, 0.0) ** 2)
            over = max(up - radius, 0.0) / axis[k, 2] * axis[k, :2]
            squeeze = np.eye(2)
            if up > radius and leaning:
                lean = axis[k, :2] / np.linalg.norm(axis[k, :2])
                squeeze -= (1 - axis[k, 2]) * np.outer(lean, lean)
            for share in np.linspace(0, 1, 81):
                at = start[k, :2] + share * (end[k, :2] - start[k, :2]) + over
                least = np.minimum(least, np.linalg.norm((points - at) @ squeeze, axis=-1) - own)
        near = least < 1.5 * cell
        assert near.any() == (middle[layer] > -4e-3)
        assert material.swept[layer][near] == pytest.approx(least[near], abs=2e-5)
        assert (material.swept[layer][~near] > cell).all()

"""A layer of the stock between its points."""

from __future__ import annotations

import numpy as np

from compensator.cutting.stock import Stock
from compensator.cutting.swept import sampled


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

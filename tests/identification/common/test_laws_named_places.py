"""Names in the picture of a path: none stands on another, nor on another's dot."""

from __future__ import annotations

import re

import numpy as np
import pytest

from identification.common.scene import EDGE, HEIGHT, WIDTH, Projection, named_places

# A letter of the picture's font is about so wide, a name so high [px], a dot has this radius.
WIDE, HIGH, RADIUS = 6.0, 11.0, 4.0


@pytest.mark.parametrize("seed", range(20))
def test_no_name_covers_a_dot_or_a_name(seed: int) -> None:
    """Dots that crowd, as those of lines next to each other in the program do."""
    rng = np.random.default_rng(seed)
    x, y = 400 + rng.normal(0, 40, 6), 230 + rng.normal(0, 12, 6)
    names = [f"line {rng.integers(10, 4000)}" for _ in range(5)] + ["largest, line 725"]
    drawn = "".join(map(str, named_places(x, y, names)))
    signs = [(float(across), float(foot), 0.5 * WIDE * len(name)) for across, foot, name in re.findall(
        r'<text class="mark" x="([-\d.]+)" y="([-\d.]+)" text-anchor="middle">([^<]*)<', drawn)]
    assert len(signs) == len(names)
    for number, (across, foot, half) in enumerate(signs):
        on = (np.abs(x - across) < half + RADIUS) & (y > foot - HIGH - RADIUS) & (y < foot + RADIUS)
        assert not on.any(), names[number]
        for other, below, wide in signs[:number]:
            assert abs(foot - below) >= HIGH or abs(across - other) >= half + wide


@pytest.mark.parametrize("seed", range(5))
def test_a_picture_holds_all_of_its_points_as_large_as_they_fit(seed: int) -> None:
    """Seen from the right, the front and above, by lengths and angles of its own: two edges are reached, opposite ones."""
    points = np.random.default_rng(seed).normal([5, -7, 100], [3, 2, 1], (50, 3))
    x, y = Projection.fitting(np.concatenate([points, [[np.nan, 0, 0]]]))(points)
    room = [min(x.min(), WIDTH - x.max()), min(y.min(), HEIGHT - y.max())]
    assert min(room) == pytest.approx(EDGE)
    assert (x.min() + x.max(), y.min() + y.max()) == pytest.approx((WIDTH, HEIGHT))
    # Up to one scale the differences are those along two directions at right angles to each other and to the look.
    towards = np.array([0.62, -0.68, 0.5]) / np.linalg.norm([0.62, -0.68, 0.5])
    across = np.array([0.68, 0.62, 0]) / np.hypot(0.68, 0.62)
    flat = (points - points[0]) @ np.column_stack([across, np.cross(towards, across)])
    seen = np.column_stack([x - x[0], y[0] - y])
    scale = np.sum(flat * seen) / np.sum(flat**2)
    np.testing.assert_allclose(seen, scale * flat, atol=1e-9 * scale)

"""Names in the picture of a path: none stands on another, nor on another's dot."""

from __future__ import annotations

import re

import numpy as np
import pytest

from identification.common.scene import named_places

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

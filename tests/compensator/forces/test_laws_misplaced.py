"""What an uncertain place makes of a force: its slope where it changes evenly, and never more than it changes."""

from __future__ import annotations

import numpy as np
import pytest

from compensator.forces.placement import _misplaced


def test_an_even_slope() -> None:
    length = np.linspace(0, 1, 2001)
    force = np.column_stack([1000 * length, -500 * length, 0 * length])
    found = _misplaced(length, force, np.full((2001, 1), 4e-3))
    assert found[1000] == pytest.approx([4.0, 2.0, 0.0], rel=1e-6)


@pytest.mark.parametrize("spacing", [1e-2, 1e-3, 1e-4, 1e-6])
def test_a_step_is_its_height_at_most(spacing: float) -> None:
    """However near the targets on both sides of it stand; half of the places are on its other side: 1 / sqrt(2) of it."""
    length = np.r_[np.linspace(0, 0.5, 400), 0.5 + spacing, np.linspace(0.55, 1, 400)]
    force = np.where(length[:, None] <= 0.5, 0.0, 300.0) * np.array([1.0, 0.0, 0.0])
    found = _misplaced(length, force, np.full((len(length), 1), 4e-3))
    assert found.max() <= 300.0
    if spacing <= 1e-3:
        assert found[400, 0] == pytest.approx(300 / np.sqrt(2), rel=0.1)
    assert found[200].max() < 1e-9


def test_a_target_of_unknown_place() -> None:
    length = np.array([0.0, np.nan, 0.1, 0.2])
    found = _misplaced(length, np.arange(12.0).reshape(4, 3), np.full((4, 1), 1e-3))
    assert np.isfinite(found).all()
    assert not found[1].any()

"""Which targets show a force: by so many sigmas of the sensor's own noise, and of its zero."""

from __future__ import annotations

import numpy as np
import pytest

from compensator.forces.detection import over_noise
from compensator.forces.target_rows import TargetRows


@pytest.mark.parametrize(("samples", "tared"), [(1, np.inf), (16, np.inf), (16, 36.0), (400, 9.0)])
def test_a_force_is_five_sigma_of_the_mean_and_three_of_the_zero(samples: int, tared: float) -> None:
    """Of noise of 2 N a sample the mean of n scatters by 2 / sqrt(n), and the zero, which all targets share, by 2 / sqrt(m)."""
    rows = TargetRows(4, np.repeat(np.arange(3), samples), np.ones(3 * samples))
    least = np.hypot(5 * 2 / np.sqrt(samples), 3 * 2 / np.sqrt(tared))
    mean = np.zeros((4, 6))
    mean[:, 1] = np.array([0.99, -1.01, 1.01, 5.0]) * least
    # The last target has no sample.
    assert over_noise(mean, rows, np.full(6, 2.0), np.full(6, 2 / np.sqrt(tared))).tolist() == [False, True, True, False]

"""Simulation-based calibration, the fast guard of benchmarks/calibration.py: sixty commissionings by five loads each."""

from pathlib import Path

import numpy as np
import pytest
from scipy.stats import binom, norm

from benchmarks import calibration

DATA_SETS = 60
# One true posterior in a thousand would be refused by one comparison.
RARE = 1e-3
ECDF_BAND = 1.95 / np.sqrt(DATA_SETS)


def misses(ranks: np.ndarray) -> list[str]:
    """What is wrong with ranks (D, q) of the truth in its posterior, which are uniform where that is right."""
    found = []
    grid = (np.arange(len(ranks)) + 0.5) / len(ranks)
    for number, column in enumerate(ranks.T):
        if np.max(np.abs(np.sort(column) - grid)) > ECDF_BAND:
            found.append(f"ranks of quantity {number + 1}")
    for level in calibration.LEVELS:
        # The mean over several quantities scatters less than one of them: its band is a wide one.
        inside = float(np.mean(np.abs(ranks - 0.5) <= 0.5 * level)) * len(ranks)
        if not binom.ppf(RARE / 2, len(ranks), level) <= inside <= binom.ppf(1 - RARE / 2, len(ranks), level):
            found.append(f"coverage at {level}")
    # Too wide or too narrow shows best in the squares of the normal scores, 1 in the mean.
    width = float(np.mean(norm.ppf(np.clip(ranks, 1e-4, 1 - 1e-4)) ** 2))
    if abs(width - 1) > norm.isf(RARE / 2) * np.sqrt(2 / len(ranks)):
        found.append(f"width, {width:.2f}")
    return found


# Long: a sensor's noise alone, which the other case has too.
@pytest.mark.parametrize("noise", [pytest.param("white", marks=pytest.mark.long), "stated"])
def test_the_truth_lies_in_its_posterior_as_often_as_that_says(tmp_path: Path, noise: str) -> None:
    """True stiffnesses from the prior; sensor noise alone, or Student-4 with 1 % force error and 5 um re-seating."""
    calibration.write_cells(tmp_path)
    cases = [calibration.one(("loads5", noise, seed, str(tmp_path), False)) for seed in range(DATA_SETS)]
    of_joints, of_task = np.array([case.rank for case in cases]), np.array([[case.task_rank] for case in cases])
    assert not misses(of_joints)
    assert not misses(of_task)
    distance = np.array([case.distance_rank for case in cases])
    for level in calibration.LEVELS:
        inside = np.count_nonzero(distance <= level)
        assert binom.ppf(RARE / 2, DATA_SETS, level) <= inside <= binom.ppf(1 - RARE / 2, DATA_SETS, level), level
    # So many data sets do tell: intervals 1.6 times too narrow or too wide, and values 0.7 sigma off.
    score = norm.ppf(np.clip(of_joints, 1e-4, 1 - 1e-4))
    assert misses(norm.cdf(1.6 * score))
    assert misses(norm.cdf(score / 1.6))
    assert misses(norm.cdf(score + 0.7))

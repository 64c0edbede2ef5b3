"""What a named cause leaves open that no row shows is in the springs' intervals."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from identification.fit.discrepancy import discrepancies
from identification.fit.fitted_model import Term, with_terms
from identification.fit.load_test import LoadTest
from identification.fit.posterior import posterior
from identification.measurements import read_measurements
from identification.model.cell import read_cell
from identification.model.effects import effects
from tests.desk_world import desk


def load_test(folder: Path) -> LoadTest:
    cell_file, table = desk(1000, None).write(folder)
    cell = read_cell(cell_file)
    return LoadTest.of(cell, read_measurements(table, cell.robot))


@pytest.mark.parametrize("axis", range(3))
def test_one_axis_that_is_off_leaves_the_mean_of_all_three_open(tmp_path: Path, axis: int) -> None:
    """Of an axis that is off by 12 % the mean is off by 4 %: about one standard deviation, whichever axis it is."""
    data, effect = load_test(tmp_path), effects()["force_axis_gain"]
    gain = 0.12 * (np.eye(3)[axis] - 1 / 3)
    rows = data.load_state(1 / data.cell.prior.stiffness)
    named = Term(effect, None, gain[:2], effect.typical(rows, None), effect.neutral(rows))
    (common,) = discrepancies(rows, (named,))
    assert common.effect.name == "force_gain"
    (std,) = with_terms(data.prior, (common,)).term_std
    assert 0.8 * 0.04 < std < 1.6 * 0.04
    alone, beside = posterior(data, (named,)), posterior(data, (named, common))
    known, left_open = (np.sqrt(np.diag(fit.laplace))[:6] for fit in (alone, beside))
    assert known.min() < 0.01
    np.testing.assert_allclose(left_open, np.hypot(known, std), rtol=0.15)

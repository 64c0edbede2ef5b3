"""Tails and medians, against SciPy's distributions, which the packages do not import."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
from numpy.testing import assert_allclose
from scipy import stats

from identification.common.tails import chi2_above, chi2_surprise, chi2_tail, f_median, f_tail, normal_above

VALUES, DEGREES = np.array([0.0, 0.3, 2.0, 40.0, 3000.0]), np.array([1.0, 2.5, 6.0, 30.0, 12.0])


def test_they_are_those_of_the_distributions() -> None:
    assert_allclose(chi2_tail(VALUES, DEGREES), stats.chi2.sf(VALUES, DEGREES), rtol=1e-9)
    assert_allclose(chi2_above(0.02, DEGREES), stats.chi2.isf(0.02, DEGREES))
    assert_allclose(f_tail(VALUES, 3, DEGREES), stats.f.sf(VALUES, 3, DEGREES), rtol=1e-9)
    assert_allclose(f_median(DEGREES, 7), stats.f.median(DEGREES, 7))
    assert_allclose(normal_above(1e-4), stats.norm.isf(1e-4))


def test_a_surprise_is_bounded() -> None:
    assert_allclose(chi2_surprise(VALUES[:4], DEGREES[:4]), -stats.chi2.logsf(VALUES[:4], DEGREES[:4]) / np.log(10), atol=1e-12)
    assert chi2_surprise(1e6, 3) == 300


def test_a_diagnosis_imports_no_distributions() -> None:
    """They take longer to import than a small fit takes."""
    code = """if True:
        import sys
        from identification.common.shipped import shipped
        from identification.diagnosis.procedure import judge
        from identification.measurements import read_measurements
        from identification.model.cell import read_cell
        cell = read_cell(shipped("samples") / "cell.yaml")
        judge(cell, read_measurements(shipped("samples") / "measurements.csv", cell))
        assert "scipy.stats" not in sys.modules
    """
    subprocess.run([sys.executable, "-c", code], check=True)

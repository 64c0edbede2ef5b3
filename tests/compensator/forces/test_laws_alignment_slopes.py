"""How well a log's place is known comes from the curvature of its misfit: of a parabola, exactly its own."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np

from compensator.forces.alignment_regression import Regression


def test_the_curvature_of_a_parabola_is_its_own() -> None:
    rng = np.random.default_rng(11)
    root, slope = rng.normal(size=(4, 4)), rng.normal(size=4)
    curvature = root + root.T
    misfit: Any = SimpleNamespace(value=lambda x, slip, independent: 0.5 * x @ curvature @ x + slope @ x + 3.0)
    found = Regression._hessian(misfit, rng.normal(size=4), np.array([0.1, 0.3, 0.02, 1.0]), 0, 1.0)
    np.testing.assert_allclose(found, curvature, atol=1e-8)

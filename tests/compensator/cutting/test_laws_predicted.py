"""What is not known of forces that a program will meet: as widely as they scatter."""

from __future__ import annotations

import numpy as np
import pytest

from compensator.cutting.coefficients import Coefficients
from compensator.cutting.predicted_log import _not_known, _worn
from identification.model.cell import read_cell
from tests.compensator.cutting.milled import FLAT, TRUE
from tests.support import CELL, write_cell


def test_what_is_not_known_is_how_the_forces_scatter() -> None:
    """Of draws of coefficients, of the model's error in any direction, of edges that wear by a share of their own force, and of
    where the stock stands."""
    rng, count = np.random.default_rng(12), 60_000
    root = 0.1 * TRUE[:, None] * rng.normal(size=(6, 6))
    known = Coefficients(TRUE, root @ root.T, 0.1, FLAT, None, (5e-5, 1e-4), {})
    # A chip's force and an edge's are of one size.
    per_step = rng.normal(size=(2, 3, 6)) * np.repeat([1e-7, 3e-3], 3)
    worn, aside = 0.4, 3.0 * rng.normal(size=(2, 3, 3))
    stated = _not_known(per_step, known, worn, aside)
    coefficients, edges = TRUE + rng.standard_normal((count, 6)) @ root.T, np.where(np.arange(6) > 2, TRUE, 0.0)
    drawn = coefficients + worn * rng.standard_normal((count, 1)) * edges
    for step, own, shift in zip(per_step, stated, aside, strict=True):
        size = np.linalg.norm(step @ TRUE)
        force = drawn @ step.T + rng.standard_normal((count, 3)) @ shift.T
        force += 0.1 * size / np.sqrt(3) * rng.standard_normal((count, 3))
        scale = np.sqrt(np.diag(own))
        assert np.abs((np.cov(force.T) - own) / np.outer(scale, scale)).max() < 0.03


@pytest.mark.parametrize(("chip", "share"), [((5e-5, 1e-4), 0.15), (None, 0.0)])
def test_edges_wear_since_they_were_logged(tmp_path, chip: tuple[float, float] | None, share: float) -> None:
    """By what cell.yaml states; what the table says has it in its width."""
    cell = read_cell(write_cell(tmp_path, CELL + "cutting: {wear_std: 0.15}\n"))
    assert _worn(cell, Coefficients(TRUE, np.eye(6), 0.1, FLAT, None, chip, {})) == share

"""What run-out takes of a force, against the virtual cell's end mill, tooth by tooth."""

from __future__ import annotations

import numpy as np
import pytest

from compensator.cutting.runout import lost
from tests.virtual_cell.endmill import PIECES, EndMill


@pytest.mark.parametrize("teeth", [2, 3, 4])
@pytest.mark.parametrize(("first", "last"), [(0, PIECES), (0, 60), (300, PIECES), (90, 200)],
                         ids=["slot", "climb", "conventional", "middle"])
def test_it_is_what_the_edges_of_teeth_that_miss_would_have_given(teeth: int, first: int, last: int) -> None:
    """The axis off by 10 um, 24 ways round: the mean force of edges alone, less that with teeth that stand out alike."""
    whole = EndMill(teeth=teeth, shear_n_mm2=(0.0, 0.0, 0.0), runout_mm=(0.0,) * teeth)
    covered = np.zeros(PIECES)
    covered[first:last] = 1.0
    without = whole.mean_force(covered, 1.0)
    turned = []
    for way in (np.arange(24) + 0.5) * 2 * np.pi / 24:
        out = tuple(float(0.010 * np.cos(way + 2 * np.pi * tooth / teeth)) for tooth in range(teeth))
        turned.append(EndMill(teeth=teeth, shear_n_mm2=(0.0, 0.0, 0.0), runout_mm=out).mean_force(covered, 1.0))
    chip = 1e-3 * whole.feed_mm_s / (teeth * whole.turns_per_s)
    ends = np.array([whole.edges[first]]), np.array([whole.edges[last]])
    own = 1e-3 * lost(*ends, chip, teeth, 1e3 * np.array(whole.edge_n_mm), 10e-6)[0]
    truth = np.mean(turned, axis=0) - without
    assert own == pytest.approx(truth, abs=0.05 * np.linalg.norm(truth) + 1e-6)
    assert (np.linalg.norm(truth) > 0.003 * np.linalg.norm(without)) == ((first, last) != (90, 200))

"""What run-out takes of a force, against the virtual cell's end mill, tooth by tooth."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import compstiff
from compensator.cutting.cut import cut_of
from compensator.cutting.runout import lost, missing_force
from compensator.path.robot_path import robot_path
from tests.compensator.cutting.milled import TRUE
from tests.compensator.cutting.test_contract_asked import FAR, in_own_object, job
from tests.virtual_cell.endmill import PIECES, EndMill


@pytest.mark.parametrize("off_um", [10, 80])
@pytest.mark.parametrize("teeth", [2, 3, 4])
@pytest.mark.parametrize(("first", "last"), [(0, PIECES), (0, 60), (300, PIECES), (90, 200)],
                         ids=["slot", "climb", "conventional", "middle"])
def test_it_is_what_the_edges_of_teeth_that_miss_would_have_given(teeth: int, first: int, last: int, off_um: int) -> None:
    """The axis off by less than the chip is thick or by about as much, 24 ways round: the mean force of edges alone, less that
    with teeth that stand out alike."""
    whole = EndMill(teeth=teeth, shear_n_mm2=(0.0, 0.0, 0.0), runout_mm=(0.0,) * teeth)
    covered = np.zeros(PIECES)
    covered[first:last] = 1.0
    without = whole.mean_force(covered, 1.0)
    turned = []
    for way in (np.arange(24) + 0.5) * 2 * np.pi / 24:
        out = tuple(float(1e-3 * off_um * np.cos(way + 2 * np.pi * tooth / teeth)) for tooth in range(teeth))
        turned.append(EndMill(teeth=teeth, shear_n_mm2=(0.0, 0.0, 0.0), runout_mm=out).mean_force(covered, 1.0))
    chip = 1e-3 * whole.feed_mm_s / (teeth * whole.turns_per_s)
    ends = np.array([whole.edges[first]]), np.array([whole.edges[last]])
    own = 1e-3 * lost(*ends, chip, teeth, 1e3 * np.array(whole.edge_n_mm), 1e-6 * off_um)[0]
    truth = np.mean(turned, axis=0) - without
    assert own == pytest.approx(truth, abs=0.05 * np.linalg.norm(truth) + 1e-6)
    assert (np.linalg.norm(truth) > 0.003 * np.linalg.norm(without)) == (off_um == 80 or (first, last) != (90, 200))


@pytest.mark.parametrize("own", [False, True])
def test_of_a_program_it_is_that_of_its_cuts(tmp_path: Path, own: bool) -> None:
    """A slot's left edge alone, from a quarter of the radius on, along x of the base, which a part's own work object may be
    turned against; 3 mm deep, chips of 0.04 mm, an axis that is off by 6 um. In the air it is nothing."""
    job(tmp_path)
    if own:
        in_own_object(tmp_path, FAR.format(z=640))
    box = "[102, -150, 85], to_mm: [120, 0, 100]" if own else "[1000, 2, 585], to_mm: [1150, 20, 600]"
    (tmp_path / "stock.yaml").write_text(f"box: {{from_mm: {box}}}\nresolution_mm: 0.5\nposition_std_mm: 0.01\n")
    cell = compstiff.read_cell(tmp_path / "cell.yaml")
    path = robot_path(compstiff.read_toolpath(tmp_path / "slot.mod", cell).toolpath, cell)
    found = missing_force(cut_of(path, tmp_path / "stock.yaml", None), TRUE)
    expected = 3e-3 * lost(np.array([np.arcsin(2 / 8)]), np.array([np.pi / 2]), 4e-5, 3, TRUE[3:])[0]
    first = next(k for k, row in enumerate(found) if row.any())
    inside = slice(first + 10, first + 45)
    np.testing.assert_allclose(found[inside], np.tile(expected, (35, 1)), atol=0.02 * np.linalg.norm(expected))
    assert not found[:2].any()
    assert not found[-2:].any()

"""Loads that hang and loads sideways in one table: where one kind is in another unit, that is said, and not slips at poses."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from identification.fit.fit import fit_stiffness
from identification.measurements import read_measurements
from identification.model.cell import read_cell
from tests.runs.command_line import user_files as kit

SPRINGS = np.array([1.6e6, 3.1e6, 2.4e6, 0.6e6, 0.4e6, 0.12e6])
POSES = np.array([[10, 20, 5, 30, 60, 20], [-15, 35, -5, -40, -50, -60], [5, 10, 15, 60, 70, 100], [20, 30, 0, 20, -70, 40],
                  [-25, 15, 10, -70, 65, 10], [0, 25, -10, 110, -60, -30], [30, 5, 20, -20, 80, 70], [-5, 40, 5, 50, 55, -80]])
FEW_PULLED = ((6, 7), "loaded sideways, and none of those that hang")
FEW_HUNG = ((0, 1, 2, 3, 4, 5), "loaded by what hangs, and none of those that are loaded sideways")


@pytest.mark.parametrize(("kinds", "mass_factor", "force_factor", "slip", "said"), [
    (FEW_PULLED, 1.0, 1.0, None, False), (FEW_PULLED, 2.20462, 1.0, None, True), (FEW_PULLED, 1.0, 1 / 9.80665, None, True),
    (FEW_HUNG, 2.20462, 1.0, None, True), (FEW_PULLED, 1.0, 1.0, 7, False), (FEW_PULLED, 1.0, 1.0, 2, False)])
def test_one_kind_of_load_in_another_unit_is_said(
    tmp_path: Path, kinds: tuple[tuple[int, ...], str], mass_factor: float, force_factor: float, slip: int | None, said: bool
) -> None:
    """Masses written in pounds, pulls in kilograms-force, the fewer poses being those that do not fit; and a slip at a single
    pose of either kind, which is neither."""
    sideways, words = kinds
    rng = np.random.default_rng(1736)
    rows = ["pose,q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg,mass_kg,fx_n,fy_n,fz_n,dx_um,dy_um,dz_um"]
    for number, pose in enumerate(POSES):
        wrong = 3.0 if number == slip else 1.0
        if number in sideways:
            loads = [(f",0,{force_factor * push:.4f},0", np.array([0, wrong * push, 0]))
                     for push in (0.0, 600.0, -600.0, 0.0)]
        else:
            loads = [(f"{mass_factor * mass:.4f},,,", np.array([0, 0, -9.80665 * mass * wrong]))
                     for mass in (0.0, 30.0, 60.0, 0.0)]
        for cells, force in loads:
            moved = kit.deviation(kit.IRB6660, np.radians(pose), kit.TOOL.p, np.append(force, np.zeros(3)), SPRINGS)
            read = 1e6 * moved + rng.normal(0, 2, 3)
            rows.append(f"P{number}," + ",".join(f"{angle:g}" for angle in pose) + f",{cells},"
                        + ",".join(f"{v:.2f}" for v in read))
    (tmp_path / "m.csv").write_text("\n".join(rows) + "\n")
    (tmp_path / "cell.yaml").write_text(kit.cell_text(base=None))
    cell = read_cell(tmp_path / "cell.yaml")
    found = [one.message for one in fit_stiffness(cell, read_measurements(tmp_path / "m.csv", cell)).findings
             if one.code == "CS1736"]
    assert len(found) == said
    assert all(one == f"all 2 poses that do not fit are {words}: one kind of load contradicts the other" for one in found)

"""A stiffness that one set-up tells alone takes the error of its load in full: said, where other poses were loaded too."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from identification.fit.fit import fit_stiffness
from identification.measurements import read_measurements
from identification.model.cell import read_cell
from tests.runs.command_line import user_files as kit

SPRINGS = np.array([1.6e6, 3.1e6, 2.4e6, 0.6e6, 0.4e6, 0.12e6])
POSES = np.array([[10, 20, 5, 30, 60, 20], [-15, 35, -5, -40, -50, -60], [5, 10, 15, 60, 70, 100], [20, 30, 0, 20, -70, 40]])


def told(folder: Path, pulls: tuple[int, ...], off: float = 0.0, poses: int = 4, pull: float = 600.0
         ) -> tuple[list[str], float]:
    """What is said of k1, and its estimate, where 60 kg hang at so many poses, and at those of `pulls` a rope over a pulley
    pulls sideways as well, with so much less than the table says."""
    rng = np.random.default_rng(5)
    rows = ["pose,q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg,mass_kg,fx_n,fy_n,fz_n,dx_um,dy_um,dz_um"]
    for number, pose in enumerate(POSES[:poses]):
        loads = [(f"{mass},,,", np.array([0, 0, -9.80665 * mass])) for mass in (0.0, 30.0, 60.0, 0.0)]
        if number in pulls:
            loads += [(f",0,{push},0", np.array([0, (1 - off) * push, 0])) for push in (pull, -pull)]
        for cells, force in loads:
            moved = kit.deviation(kit.IRB6660, np.radians(pose), kit.TOOL.p, np.append(force, np.zeros(3)), SPRINGS)
            read = 1e6 * moved + rng.normal(0, 2, 3)
            rows.append(f"P{number}," + ",".join(f"{angle:g}" for angle in pose) + f",{cells},"
                        + ",".join(f"{v:.2f}" for v in read))
    (folder / "m.csv").write_text("\n".join(rows) + "\n")
    (folder / "cell.yaml").write_text(kit.cell_text(base=None))
    cell = read_cell(folder / "cell.yaml")
    fit = fit_stiffness(cell, read_measurements(folder / "m.csv", cell))
    found = float(np.exp(-fit.model.mean[0]))
    said = [finding.message for finding in fit.findings if finding.code == "CS1043" and finding.message.startswith("k1 ")]
    return said, found


@pytest.mark.parametrize(("pulls", "said"), [((1,), True), ((0, 1, 2, 3), False)])
def test_a_joint_that_one_pull_tells_is_named(tmp_path: Path, pulls: tuple[int, ...], said: bool) -> None:
    messages, found = told(tmp_path, pulls)
    assert (len(messages) == 1) == said
    assert all("loads of P1 alone" in message for message in messages)
    assert abs(found / SPRINGS[0] - 1) < 0.03


@pytest.mark.parametrize(("poses", "pull"), [(2, 600.0), (4, 0.1)])
def test_a_plan_of_two_poses_and_a_joint_that_nothing_tells_are_no_such_joints(tmp_path: Path, poses: int, pull: float) -> None:
    """Of two set-ups each tells something alone; and a joint that a tenth of a newton turns keeps the prior's value, whatever
    that pull is wrong by."""
    assert told(tmp_path, (1,), poses=poses, pull=pull)[0] == []


def test_the_error_of_that_pull_is_the_stiffnesss(tmp_path: Path) -> None:
    """Why it is said: a sheave that takes 6 % makes k1 too stiff by most of that."""
    messages, found = told(tmp_path, (1,), 0.06)
    assert messages
    assert 1.03 < found / SPRINGS[0] < 1.08

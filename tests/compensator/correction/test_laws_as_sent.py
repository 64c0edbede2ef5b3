"""The log of a program that was driven with offsets stands at its targets, whether its rows are placed by logged positions,
which have the offsets in them, or by path length."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from compensator.correction.as_sent import as_sent
from compensator.correction.files import Inputs, predict_files
from compensator.correction.pass_offsets import PassOffsets
from compensator.correction.predict import Predicted
from compensator.forces.log_path import on_path
from tests.runs.command_line import user_files as kit
from tests.runs.command_line.test_placement import Path3
from tests.runs.command_line.user_files import Job

# Targets every millimetre along x, the force up by 100 N/mm of the program: that of an entry or a corner.
COUNT, STEP = 41, 1.0
PUSH = np.array([1.0, 0.4, -0.2])


def met(place_mm: np.ndarray) -> np.ndarray:
    """The force (n, 3) [N] at a place of the program, base frame."""
    return np.clip(100 * (np.asarray(place_mm) - 8.0), 0.0, 2400.0)[:, None] * PUSH


def logged(folder: Path, columns: str, offset_mm: float) -> Predicted:
    """A pass of the program driven with so much offset along the path: a row every 0.02 mm of it."""
    path = Path3(np.array([[STEP * i, 0, 0] for i in range(COUNT)]))
    job = Job(folder, program=path.program(), forces="target,fx_n,fy_n,fz_n\n0,0,0,0\n").write()
    program = np.arange(0.0, STEP * (COUNT - 1), 0.02)
    force = met(program)
    place = program
    if columns == "x_mm,y_mm,z_mm":
        place = path.at(np.column_stack([program + offset_mm, 0 * program, 0 * program]))
    rows = np.column_stack([place, force])
    job.forces = "\n".join([f"{columns},fx_n,fy_n,fz_n", *(",".join(f"{value:.9g}" for value in row) for row in rows)]) + "\n"
    job.write()
    return predict_files(Inputs(folder / "cell.yaml", folder / job.name, folder / "stiffness.json", folder / "forces.csv"))


@pytest.mark.parametrize(("columns", "offset_mm"), [("x_mm,y_mm,z_mm", 0.3), ("x_mm,y_mm,z_mm", -0.2), ("path_mm", -0.25)])
def test_each_force_stands_where_the_program_was(tmp_path: Path, columns: str, offset_mm: float) -> None:
    predicted = logged(tmp_path, columns, offset_mm)
    along = kit.tcp_pose(kit.IRB6660, kit.START, kit.TOOL).r.apply([1.0, 0.0, 0.0])
    found = as_sent(predicted, PassOffsets.at_targets(np.tile(1e-3 * offset_mm * along, (COUNT, 1)))).forces.wrench[:, :3]
    places = np.arange(12, 30)
    assert np.abs(found[places] - met(places * STEP)).max() < 2.0
    as_logged = np.abs(predicted.forces.wrench[places, :3] - met(places * STEP)).max()
    assert (as_logged > 15.0) == (columns != "path_mm"), "positions have the offsets in them"
    assert as_sent(predicted, None) is predicted


@pytest.mark.parametrize("pushed", [False, True])
def test_a_path_length_counts_the_way_with_the_offsets(tmp_path: Path, pushed: bool) -> None:
    """Offsets that go to and fro across the path, by 0.4 mm: the way with them is 3 mm longer at the end of 40. A logger that
    counts the plan's own lengths, as of a program whose offsets are pushed, ends where that ends and is left as it is."""
    path = Path3(np.array([[STEP * i, 0, 0] for i in range(COUNT)]))
    job = Job(tmp_path, program=path.program(), forces="target,fx_n,fy_n,fz_n\n0,0,0,0\n").write()
    side = 0.2 * (-1.0) ** np.arange(COUNT)
    program = np.arange(0.0, STEP * (COUNT - 1) + 1e-9, 0.02)
    way = program * (1.0 if pushed else np.hypot(STEP, 0.4) / STEP)
    rows = np.column_stack([way, met(program)])
    job.forces = "\n".join(["path_mm,fx_n,fy_n,fz_n", *(",".join(f"{value:.9g}" for value in row) for row in rows)]) + "\n"
    job.write()
    predicted = predict_files(Inputs(tmp_path / "cell.yaml", tmp_path / job.name, tmp_path / "stiffness.json",
                                     tmp_path / "forces.csv"))
    across = kit.tcp_pose(kit.IRB6660, kit.START, kit.TOOL).r.apply([0.0, 1.0, 0.0])
    found = as_sent(predicted, PassOffsets.at_targets(1e-3 * side[:, None] * across)).forces.wrench[:, :3]
    places = np.arange(12, 30)
    assert np.abs(found[places] - met(places * STEP)).max() < 2.0
    as_logged = np.abs(predicted.forces.wrench[places, :3] - met(places * STEP)).max()
    assert (as_logged > 100.0) == (not pushed)


def test_a_log_is_placed_once(tmp_path: Path) -> None:
    """Positions that come 30 ms late in the log are moved by that once, however often the log is placed again."""
    path = Path3(np.array([[STEP * i, 0, 0] for i in range(COUNT)]))
    rows = "".join(f"{0.02 * i:.9g},{i:.9g},10,0,0\n" for i in range(COUNT))
    cell = kit.cell_text(extra="force_log: {position_late_ms: 30}\n")
    Job(tmp_path, cell=cell, program=path.program(), forces="time_s,path_mm,fx_n,fy_n,fz_n\n" + rows).write()
    predicted = predict_files(Inputs(tmp_path / "cell.yaml", tmp_path / "part.mod", tmp_path / "stiffness.json",
                                     tmp_path / "forces.csv"))
    log = predicted.forces.log
    assert log.place[:5] == pytest.approx(1e-3 * (np.arange(5) + 1.5))
    assert np.array_equal(on_path(log, predicted.path).place, log.place, equal_nan=True)

"""A log stands where the tool stood: the corrected tool meets each force there, however far along the feed the logged one was
off its command, and whether the log has the offsets of its program in it or not."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from compensator.correction.files import Inputs, predict_files
from compensator.correction.met_on_plan import as_sent, met_on_plan
from compensator.correction.predict import Predicted
from compensator.forces.log_path import on_path
from tests.runs.command_line import user_files as kit
from tests.runs.command_line.test_placement import Path3
from tests.runs.command_line.user_files import Job

# Targets every millimetre along x, the force up from 200 N by 100 N/mm of where the tool is: that of an entry or a corner.
COUNT, STEP = 41, 1.0
PUSH = np.array([1.0, 0.4, -0.2])


def met(place_mm: np.ndarray) -> np.ndarray:
    """What the tool meets (n, 3) [N] at a place of the path, base frame."""
    return np.clip(100 * (np.asarray(place_mm) - 8.0), 0.0, 2400.0)[:, None] * PUSH


def logged(folder: Path, columns: str, offset_mm: float) -> Predicted:
    """A pass of the program driven with so much offset along the path: a row every 0.02 mm of it, at each of which the tool
    stands where force and arm balance."""
    path = Path3(np.array([[STEP * i, 0, 0] for i in range(COUNT)]))
    job = Job(folder, program=path.program(), forces="target,fx_n,fy_n,fz_n\n0,0,0,0\n").write()
    along = kit.tcp_pose(kit.IRB6660, kit.START, kit.TOOL).r.apply([1.0, 0.0, 0.0])
    # By how much the arm yields along the path [mm] under 1 N of the push's first component.
    soft = 1e3 * kit.deviation(kit.IRB6660, path.q[COUNT // 2], kit.TOOL.p, np.r_[100 * PUSH, 0, 0, 0], kit.K) @ along / 100
    program = np.arange(0.0, STEP * (COUNT - 1), 0.02)
    force = np.zeros((len(program), 3))
    for _ in range(60):
        force = met(program + offset_mm + soft * force[:, 0])
    place = program
    if columns == "x_mm,y_mm,z_mm":
        place = path.at(np.column_stack([program + offset_mm, 0 * program, 0 * program]))
    rows = np.column_stack([place, force])
    job.forces = "\n".join([f"{columns},fx_n,fy_n,fz_n", *(",".join(f"{value:.9g}" for value in row) for row in rows)]) + "\n"
    job.write()
    return predict_files(Inputs(folder / "cell.yaml", folder / job.name, folder / "stiffness.json", folder / "forces.csv"))


@pytest.mark.parametrize(("columns", "offset_mm"), [("x_mm,y_mm,z_mm", 0.0), ("x_mm,y_mm,z_mm", 0.3), ("path_mm", -0.25)])
def test_each_force_is_met_where_the_tool_met_it(tmp_path: Path, columns: str, offset_mm: float) -> None:
    predicted = logged(tmp_path, columns, offset_mm)
    along = kit.tcp_pose(kit.IRB6660, kit.START, kit.TOOL).r.apply([1.0, 0.0, 0.0])
    offsets = np.tile(1e-3 * offset_mm * along, (COUNT, 1))
    found = met_on_plan(as_sent(predicted, offsets), offsets).forces.wrench[:, :3]
    places = np.arange(12, 30)
    true = met(places * STEP)
    assert np.abs(found[places] - true).max() < 4.0
    as_logged = np.abs(predicted.forces.wrench[places, :3] - true).max()
    assert as_logged > 12.0, "the tool stood aside"


def test_at_a_corner_the_force_turns_where_it_was_commanded(tmp_path: Path) -> None:
    """Chords of a ring: on each the push is square to it, whatever the tool's place; no sample goes over to another chord."""
    angle = np.radians(6.0 * np.arange(40))
    path = Path3(30 * np.column_stack([np.cos(angle) - 1, np.sin(angle), 0 * angle]))
    length = np.linalg.norm(np.diff(path.xyz, axis=0), axis=1)
    place = np.arange(0, length.sum(), 0.05)
    chord = np.minimum(np.searchsorted(np.cumsum(length), place), len(length) - 1)
    middle = 0.5 * (angle[1:] + angle[:-1])[chord]
    push = 300 * np.column_stack([np.cos(middle) - np.sin(middle), np.sin(middle) + np.cos(middle), 0 * middle])
    force = kit.tcp_pose(kit.IRB6660, kit.START, kit.TOOL).r.apply(push)
    rows = np.column_stack([place, force])
    text = "\n".join(["path_mm,fx_n,fy_n,fz_n", *(",".join(f"{value:.9g}" for value in row) for row in rows)]) + "\n"
    Job(tmp_path, program=path.program(), forces=text).write()
    predicted = predict_files(Inputs(tmp_path / "cell.yaml", tmp_path / "part.mod", tmp_path / "stiffness.json",
                                     tmp_path / "forces.csv"))
    assert np.linalg.norm(predicted.prediction.position, axis=1).max() > 1e-4
    found, before = met_on_plan(predicted, None).forces.wrench[1:-1], predicted.forces.wrench[1:-1]
    assert np.abs(found - before).max() < 4.0


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

"""Learning from a part on a table that turns, or beside a robot that travels: what belongs to the part stands still on it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from compensator.correction.files import Inputs, predict_files
from compensator.correction.predict import Predicted
from compensator.learned.learned import SETUP
from compensator.learning.measured_points import read_points
from compensator.learning.path_places import place_points
from compensator.learning.rows import rows_of
from compensator.learning.terms import frame_of
from compensator.learning.unseen import said_of_unseen
from tests.compensator.learning.test_contract_learned_file import SPRINGS, learned
from tests.runs.milling.carried_job import CarriedJob


def carried(folder: Path, on: str) -> tuple[CarriedJob, Predicted]:
    """Six targets with force, over which the robot travels or the table tilts by 8 and turns by 30 degrees."""
    job = CarriedJob(folder, "J 0,0 L 20,0 L 40,10 L 60,0 L 70,30 L 20,50", on=on,
                     ends=np.array([[950.0, 12, -20], [850.0, 4, 10]]))
    ready = job.job("target,fx_n,fy_n,fz_n\n" + "".join(f"{k},1,1,1\n" for k in range(6)))
    ready.program = job.program
    ready.write()
    return job, predict_files(Inputs(*(folder / name for name in ("cell.yaml", "part.mod", "stiffness.json", "forces.csv"))))


@pytest.mark.parametrize("on", ["slide", "table", "both"])
def test_normals_of_upright_walls_see_nothing_of_the_height_wherever_the_table_tilts(tmp_path: Path, on: str) -> None:
    job, predicted = carried(tmp_path, on)
    table = tmp_path / "points.csv"
    table.write_text("x_mm,y_mm,z_mm,nx,ny,nz,dn_um,std_um,target\n" + "".join(
        f"{x:.6f},{y:.6f},{z:.6f},{k % 2},{1 - k % 2},0,5,1,{k}\n"
        for k, (x, y, z) in enumerate(1e3 * pose.p for pose in job.poses) if k in predicted.targets))
    measured = read_points(table, predicted.path.cell)
    rows = rows_of(measured, place_points(measured, predicted, 0.0, 1e-3), predicted)
    [found] = said_of_unseen(rows, predicted, "points.csv")
    assert (found.code, found.level, found.file) == ("CS5331", "warning", "points.csv")
    assert found.message.startswith("no point tells how far the part is off along (0.00, 0.00, 1.00) of its work object: ")


@pytest.mark.parametrize("on", ["slide", "table", "both"])
def test_a_part_that_stands_aside_on_its_table_is_one_set_up_wherever_that_turns(tmp_path: Path, on: str) -> None:
    """By a shift and a small turn of its own: three shifts and three turns say of all its points, measured in the work object,
    where they are off, and a program takes from that what the part is off by in the robot's base at each target."""
    job, predicted = carried(tmp_path, on)
    path, targets, points = predicted.path, predicted.targets, np.array([1e3 * pose.p for pose in job.poses])
    shift, turn, centre = np.array([30.0, -80.0, 50.0]), np.array([0.4, -0.2, 0.7]), points.mean(axis=0)
    off = shift + np.cross(turn, points - centre)           # um, work object; mrad over mm
    table = tmp_path / "points.csv"
    table.write_text("x_mm,y_mm,z_mm,dx_um,dy_um,dz_um,std_um,target\n" + "".join(
        ",".join(f"{value:.6f}" for value in (*point, *moved)) + f",1,{k}\n"
        for k, (point, moved) in enumerate(zip(points, off, strict=True)) if k in targets))
    measured = read_points(table, path.cell)
    rows = rows_of(measured, place_points(measured, predicted, 0.0, 1e-3), predicted)
    frame = frame_of(rows, predicted)
    columns = rows.along(frame.columns(rows.on_part, rows.time, rows.to_base))[:, :SETUP]
    setup, left = np.linalg.lstsq(columns, rows.value, rcond=None)[:2]
    assert np.linalg.matrix_rank(columns) == SETUP
    assert 1e6 * np.sqrt(left.sum() / len(rows)) < 0.05
    given = learned()
    mean = np.zeros(len(given.mean))
    mean[SPRINGS:SPRINGS + SETUP] = setup
    taken = replace(given, mean=mean, frame=frame).rest(path, targets).mean
    np.testing.assert_allclose(1e6 * taken, job.stands(job.values)[1][targets].apply(off[targets]), atol=0.2)

"""Measured points stand where the program cut them, whatever it does before it cuts."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from compensator.correction.files import Inputs, predict_files
from compensator.correction.settings import Settings
from compensator.learning.measured_points import read_points
from compensator.learning.path_places import STEP, place_points
from identification.model.cell import read_cell

SPEED = "vAir,fine,tSpindle"
POSE = "[0,0,1,0],[-1,-1,-1,0],[9E9,9E9,9E9,9E9,9E9,9E9]]"
BEFORE = {
    "nothing": [],
    "home by joints": [f"MoveAbsJ [[0,0,0,0,60,0],[9E9,9E9,9E9,9E9,9E9,9E9]]\\NoEOffs,{SPEED}\\WObj:=wInsert;"],
    "a pose in the world": [f"MoveJ [[1000,100,900],{POSE},{SPEED}\\WObj:=wobj0;"],
    "both": [f"MoveJ [[1000,100,900],{POSE},{SPEED};", f"MoveAbsJ [[0,0,0,0,60,0],[9E9,9E9,9E9,9E9,9E9,9E9]],{SPEED};"],
}


@pytest.mark.parametrize("moves", BEFORE.values(), ids=BEFORE)
def test_points_between_targets_stand_half_way(sample_inputs: Inputs, tmp_path: Path, moves: list[str]) -> None:
    """A log of 100 N from the 10th target of the sample on; points half way between its targets, to half a piece."""
    text = Path(sample_inputs.toolpath).read_text().replace("WaitTime 5;\n", "\n".join(["WaitTime 5;", *moves, ""]), 1)
    program, log, file = tmp_path / "insert.mod", tmp_path / "log.csv", tmp_path / "points.csv"
    program.write_text(text)
    first = 10 + len(moves)
    log.write_text("target,fx_n,fy_n,fz_n\n" + "".join(f"{k},{100 * (k >= first)},0,0\n" for k in range(first + 60)))
    predicted = predict_files(replace(sample_inputs, toolpath=program, forces=log), Settings())
    position = predicted.path.toolpath.position
    before = np.arange(first + 5, first + 45)
    middle = 1e3 * 0.5 * (position[before] + position[before + 1])
    file.write_text("x_mm,y_mm,z_mm,dx_um\n" + "".join(f"{x:.5f},{y:.5f},{z:.5f},5\n" for x, y, z in middle))
    placed = place_points(read_points(file, read_cell(sample_inputs.cell)), predicted, 0.0, 1e-3)
    assert placed.rows.tolist() == list(range(40))
    assert predicted.targets[placed.before].tolist() == before.tolist()
    step = np.linalg.norm(position[before + 1] - position[before], axis=1)
    assert np.abs((placed.share - 0.5) * step).max() <= 0.5 * STEP + 1e-9

"""A log with positions and joint angles holds the cell against the controller, whatever places its samples."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy.spatial.transform import Rotation

from compensator.correction.files import Inputs, predict_files
from tests.runs.command_line.test_placement import Path3
from tests.runs.command_line.user_files import BASE, IRB6660, TOOL, E, Frame, Job, cell_text, solve, work_object

MM = 1e-3


def codes(folder: Path, cell: str, *, suffix: str = "csv", lag: int = 0, places: str = "", home: bool = False) -> set[str]:
    """The findings of a log at 20 mm/s along 120 mm whose joint angles are `lag` samples late; places: a column before them;
    home: more than half of it is from before, of the flange in wobj0."""
    path = Path3(np.array([[30.0 * k, 0, 0] for k in range(5)]))
    way = np.linspace(0, 120, 400)
    xyz, q, angles = path.at(np.column_stack([way, 0 * way, 0 * way])), path.q[0], []
    for point in xyz:
        q = solve(IRB6660, work_object() @ Frame(MM * point, path.frames[0].r) @ TOOL.inv(), q)
        angles.append(np.degrees(q))
    data = {f"{axis}_mm": xyz[:, k] for k, axis in enumerate("xyz")}
    data |= {f"q{k + 1}_deg": np.roll(np.array(angles)[:, k], lag) for k in range(6)}
    data |= {"fx_n": 0 * way + 30, "fy_n": 0 * way - 20, "fz_n": 0 * way + 5}
    if places:
        data[places] = way if places == "path_mm" else np.round(way / 30)
    program = path.program()
    if home:
        first = program.index("    Move")
        program = f"{program[:first]}    MoveAbsJ [[0,0,0,0,30,0],{E}],v50,fine,tool0;\n{program[first:]}"
        stood = dict(zip(data, [1800, 0, 2000, 0, 0, 0, 0, 30, 0, 0, 0, 0], strict=True))
        data = {name: np.concatenate([np.full(1800, stood[name]), values]) for name, values in data.items()}
    Job(folder, cell=cell, program=program).write()
    frame, file = pd.DataFrame(data), folder / f"forces.{suffix}"
    frame.to_parquet(file) if suffix == "parquet" else frame.to_csv(file, index=False)
    planned = predict_files(Inputs(folder / "cell.yaml", folder / "part.mod", folder / "stiffness.json", file))
    return {finding.code for finding in planned.findings}


@pytest.mark.parametrize("places", ["", "path_mm", "target"])
def test_a_base_that_stands_elsewhere_is_told(tmp_path: Path, places: str) -> None:
    """A pedestal of 300 mm that cell.yaml leaves out; and the same with nothing wrong, angles half a millimetre late."""
    assert "CS3133" not in codes(tmp_path, cell_text(), lag=2, places=places)
    lower = Frame(BASE.p - np.array([0, 0, 0.3]), BASE.r)
    assert "CS3133" in codes(tmp_path, cell_text(base=lower), places=places)


def test_samples_at_home_are_in_other_frames(tmp_path: Path) -> None:
    """Positions there are those of tool0 in wobj0, by the controller; the program's tool and work object are the cut's."""
    assert "CS3133" not in codes(tmp_path, cell_text(), home=True)
    lower = Frame(BASE.p - np.array([0, 0, 0.3]), BASE.r)
    assert "CS3133" in codes(tmp_path, cell_text(base=lower), home=True)


def test_parquet_is_asked_too(tmp_path: Path) -> None:
    assert "CS3133" not in codes(tmp_path, cell_text(), suffix="parquet")
    turned = Frame(BASE.p, BASE.r * Rotation.from_euler("z", 2, degrees=True))
    assert "CS3133" in codes(tmp_path, cell_text(base=turned), suffix="parquet")

"""What the reports under test are made from: small changes of the shipped measurements, and a page around a view."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

import compstiff
from compensator.correction.predict import Predicted
from compensator.learning.learning import Learning
from compensator.verification.verify import Verification
from identification.common.chart import Figure
from identification.common.report import Page, Verdict, View, render
from identification.common.shipped import shipped
from identification.diagnosis.diagnose import Diagnosis
from identification.model.cell import Cell
from tests.identification.motion import simulated_joint
from tests.runs.mistakes.planted import MISTAKES, SHOP, right
from tests.virtual_cell.cell import Hidden, simulate


def page_with(first: Sequence[Figure | View]) -> str:
    return render(Page("A page", Verdict("open", "SHOWN", "What is drawn."), [], [], [], [], first, [], [], {}))


def turned_measurements(folder: Path) -> Path:
    """The sample's, read by deflection sensors that are turned by 4 degrees about z."""
    rows = [line.split(",") for line in (shipped("samples") / "measurements.csv").read_text().splitlines() if line[:1] != "#"]
    columns = [rows[0].index(f"d{axis}_um") for axis in "xyz"]
    angle = np.radians(4.0)
    turn = np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]])
    for row in rows[1:]:
        for column, value in zip(columns, turn @ [float(row[column]) for column in columns], strict=True):
            row[column] = f"{value:.3f}"
    file = folder / "turned.csv"
    file.write_text("\n".join(",".join(row) for row in rows) + "\n")
    return file


def verification(folder: Path, cell: Cell) -> Verification:
    """Two passes, the second a tenth of the first, with noise; the tolerance is not kept."""
    rng = np.random.default_rng(11)
    for name, size in (("before.csv", 100.0), ("after.csv", 10.0)):
        rows = [f"{k},{size * np.sin(k / 50) + n[0]:.3f},{n[1]:.3f},{n[2]:.3f},2,2,2"
                for k, n in zip(range(100, 900, 2), rng.normal(0, 3, (400, 3)), strict=True)]
        (folder / name).write_text("\n".join(["target,dx_um,dy_um,dz_um,sx_um,sy_um,sz_um", *rows]) + "\n")
    return compstiff.verify(cell, folder / "before.csv", folder / "after.csv", tolerance_um=12.0)


# What each verdict of `diagnose` is shown on: seed, and what is hidden in 20 poses.
VERDICTS = {"adequate": (66, ()), "named": (40, (Hidden("base_rocking", None, 2.0),)),
            "ambiguous": (70, (Hidden("base_rocking", None, 0.6),)), "unknown": (67, (Hidden("hose_pull", None, 4.0),))}
# Pages of the kind that another page has too are looked at with --long.
LIKE_ANOTHER = ("predict", "named", "ambiguous")
# Diagnoses whose pages are looked at with --slow (slow.txt): the one of turned sensors, and nothing found, stay.
SLOW_ONES = ("unknown", "mistake")
BENCH = "name: bench\nprior: {stiffness_nm_per_rad: [4e6, 4e6, 4e6, 0.5e6, 0.5e6, 0.3e6], relative_std: 2.0}\n"


def diagnoses(folder: Path, without: Sequence[str] = ()) -> dict[str, Diagnosis]:
    """One with each verdict, and one with a mistake, by its name, but for those in `without`."""
    files = {name: simulate(seed, "poses20", hidden, validation=6) for name, (seed, hidden) in VERDICTS.items()
             if name not in without}
    if "mistake" not in without:
        files["mistake"] = MISTAKES["deflections cyclic"](right(430004, SHOP), np.random.default_rng([430004, 3]))[0]
    found = {}
    for name, case in files.items():
        (folder / name).mkdir()
        cell_file, rows = case.write(folder / name)
        cell = compstiff.read_cell(cell_file)
        found[name] = compstiff.diagnose(cell, compstiff.read_measurements(rows, cell.robot), replicates=19)
    return found


def joint_logs(folder: Path) -> dict[str, object]:
    """`identify` and `diagnose` on two logs of a gear with friction inside."""
    (folder / "robot.yaml").write_text(BENCH)
    (folder / "cell.yaml").write_text("robot: robot.yaml\ntool: {position_mm: [0, 0, 0]}\n")
    cell = compstiff.read_cell(folder / "cell.yaml", geometry=False)
    logs = [compstiff.read_motion_log(simulated_joint.write(
        folder / f"log{seed}.csv", simulated_joint.columns(seed, {"hysteresis": 1.0}))) for seed in (1, 2)]
    return {"motion_identify": compstiff.fit_joint_logs(cell, logs),
            "motion_diagnose": compstiff.diagnose_joint_logs(cell, logs[:1], logs[1], replicates=39)}


def learning(folder: Path, predicted: Predicted) -> Learning:
    """From the sample part, measured on every hundredth target with force: 1.2 times the deviation that was predicted there,
    and noise. Simulated; what is learned is judged elsewhere."""
    points, rows, forces = folder / "points.csv", predicted.targets[::100], shipped("samples") / "insert.forces.parquet"
    place = 1e3 * predicted.path.toolpath.position[rows]
    moved = 1.2e6 * predicted.prediction.position[::100] + np.random.default_rng(5).normal(0, 3, (len(rows), 3))
    text = "\n".join(",".join(f"{value:.4f}" for value in [*at, *off, 3.0]) for at, off in zip(place, moved, strict=True))
    points.write_text(f"x_mm,y_mm,z_mm,dx_um,dy_um,dz_um,std_um\n{text}\n")
    return compstiff.learn(predicted.cell, predicted.program, predicted.model, forces, points, predicted.settings)

"""What the reports under test are made from: small changes of the shipped measurements, and a page around a view."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

import compstiff
from compensator.verification.verify import Verification
from identification.common.chart import Figure
from identification.common.report import Page, Verdict, View, render
from identification.common.shipped import shipped
from identification.model.cell import Cell


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

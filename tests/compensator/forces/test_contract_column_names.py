"""A logger's own header: the refusal says the line for cell.yaml, and with that line the log is read; doubt is no name."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from compensator.forces.column_names import named_columns
from tests.runs.command_line import user_files as kit


@pytest.mark.parametrize(("header", "columns"), [
    ("Zeit [s];Fx [N];Fy [N];Fz [N];X [mm];Y [mm];Z [mm]", "time_s, fx_n, fy_n, fz_n, x_mm, y_mm, z_mm"),
    ("Time (ms);FX(N);FY(N);FZ(N);Mx [Nm];My [N*m];Mz [N m];Target", "time_ms, fx_n, fy_n, fz_n, mx_nm, my_nm, mz_nm, target"),
    ("status;Fx_N;Fy_N;Fz_N;Temp [C];X [mm];X [mm]", "'-', fx_n, fy_n, fz_n, '-', '-', '-'"),
])
def test_meant_beyond_doubt(header: str, columns: str) -> None:
    assert f"columns: [{columns}]" in named_columns(header.split(";"))


def test_what_is_not_beyond_doubt_is_named() -> None:
    """X without a unit would place the samples: it is not left out in silence."""
    told = named_columns(["Zeit [s]", "X", "Y", "Z", "Fx [N]", "Fy [N]", "Fz [N]"])
    assert told.endswith("columns: [time_s, '-', '-', '-', fx_n, fy_n, fz_n]; '-' stands for X, Y, Z, of which quantity or "
                         "unit is not sure")
    assert "stands for" not in named_columns(["Zeit [s]", "Fx [N]", "Fy [N]", "Fz [N]"])


@pytest.mark.parametrize("header", ["Fx;Fy;Fz", "Fx [kN];Fy [N];Fz [kN]", "Fx [N];Fy [N]", "Fx [N];Fx [N];Fy [N];Fz [N]",
                                    "Fx [Nm];Fy [Nm];Fz [Nm]", "", "x [m];fx_n;fy_n"])
def test_doubt_is_no_name(header: str) -> None:
    assert named_columns(header.split(";")) == ""


@pytest.mark.parametrize(("above", "encoding"), [
    ("", "utf-8"), ("Einsatz: Fräsen\nam 12.3.26\n", "utf-8"), ("Einsatz: Fräsen\nam 12.3.26\n", "cp1252")])
def test_the_line_works(tmp_path: Path, above: str, encoding: str) -> None:
    """`check` says it, it is put into cell.yaml, `check` reads the log; with what loggers write above, in their encoding."""
    cell, log = tmp_path / "cell.yaml", tmp_path / "part.forces.csv"
    cell.write_text("robot: irb6660-205-1.90\ntool: {position_mm: [0, 0, 250]}\n")
    log.write_text(above + "Zeit [s];Fx [N];Fy [N];Fz [N];X [mm];Y [mm];Z [mm]\n" + "\n".join(
        f"{0.01 * k:.2f};{3 * k},5;-2,0;7,0;{0.1 * k:.1f};0;0".replace(".", ",") for k in range(50)) + "\n", encoding=encoding)
    refused = kit.run("check", cell, log)
    assert refused.code != 0
    line = re.search(r"force_log: (columns: \[.*\])", refused.err)
    assert line, refused
    cell.write_text(cell.read_text() + f"force_log:\n  {line[1]}\n")
    read = kit.run("check", cell, log)
    assert read.code == 0, read
    other = log.rename(tmp_path / "log_0815.csv")
    assert "force log" in kit.run("check", cell, other).out, "told by its columns, whatever its name"


def test_kilonewtons_are_told_with_their_scale() -> None:
    told = named_columns(["Zeit [ms]", "Fx [kN]", "Fy [kN]", "Fz [kN]", "X [mm]"])
    assert "columns: [time_ms, fx_counts, fy_counts, fz_counts, x_mm], and counts_per_n: 0.001" in told

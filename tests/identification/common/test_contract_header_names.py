"""A table with headers of its own: what its columns should be called is said, and with these names it is read."""

from __future__ import annotations

import re
from pathlib import Path

import openpyxl
import pytest

from identification.common.findings import CompstiffError
from identification.common.header_names import meant, renamed
from identification.common.tables import unread
from identification.measurements import read_measurements
from identification.model.cell import read_cell
from tests.runs.command_line import user_files as kit

GERMAN = [*(f"Achse {k} [°]" for k in range(1, 7)), "Fx [N]", "Fy [N]", "Fz [N]", "dx [µm]", "dy [µm]", "dz [µm]", "Zeit [s]",
          "Haltezeit [s]", "Pose", "Bemerkung"]
ROWS = [[10.5, 20.25, -5, 40, 50, 60, 100 * k, 0, 0, 12.5 * k, -3.5, 0, 30 * k, 10, "P1", ""] for k in range(4)]


@pytest.mark.parametrize(("header", "column"), [
    ("Achse 1 [°]", ("q1_deg", "")), ("A3 (deg)", ("q3_deg", "")), ("J6/°", ("q6_deg", "")), ("Achse 7 [°]", ("", "")),
    ("q2 [rad]", ("q2_deg", "degrees")), ("Kraft x [N]", ("fx_n", "")), ("Fz [kN]", ("fz_n", "newtons")), ("Fx", ("", "")),
    ("Mx [Nm]", ("mx_nm", "")), ("dx [µm]", ("dx_um", "")), ("dx [μm]", ("dx_um", "")), ("dx_mm", ("dx_um", "micrometres")),
    ("Delta y (um)", ("dy_um", "")), ("Zeit [s]", ("time_s", "")), ("t [ms]", ("time_ms", "")), ("X [mm]", ("x_mm", "")),
    ("Zeit [min]", ("time_s", "seconds")), ("Masse [kg]", ("mass_kg", "")), ("fx_n", ("fx_n", "")), ("Bemerkung", ("", "")),
    ("Haltezeit [s]", ("dwell_s", "")), ("t", ("", "")), ("", ("", "")),
])
def test_what_a_header_means(header: str, column: tuple[str, str]) -> None:
    assert meant(header) == column


@pytest.mark.parametrize("form", [".xlsx", ".csv"])
def test_with_the_names_that_are_said_it_is_read(tmp_path: Path, form: str) -> None:
    """As Excel leaves it in Germany: semicolons, decimal commas, umlauts; and the workbook itself."""
    cell, table = tmp_path / "cell.yaml", tmp_path / f"Messung{form}"
    cell.write_text("robot: irb6660-205-1.90\ntool: {position_mm: [0, 0, 250]}\n")

    def write(header: list[str]) -> None:
        if form == ".csv":
            lines = [";".join(str(cell).replace(".", ",") for cell in row) for row in (header, *ROWS)]
            table.write_text("\n".join(lines) + "\n", encoding="utf-8-sig")
        else:
            book = openpyxl.Workbook()
            for row in (header, *ROWS):
                book.active.append(row)
            book.save(table)

    write(GERMAN)
    refused = kit.run("check", cell, table)
    assert refused.code == 1
    assert "CS0202" in refused.err
    told = dict(re.findall(r"'([^']+)' (\w+)", refused.err))
    write([told.get(name, name) for name in GERMAN])
    read = read_measurements(table, read_cell(cell).robot)
    assert read.wrench[:, 0].tolist() == [0, 100, 200, 300]
    assert read.time.tolist() == [0, 30, 60, 90]
    assert read.pose.tolist() == ["P1"] * 4


def test_another_unit_is_said_and_not_renamed(tmp_path: Path) -> None:
    table = tmp_path / "m.csv"
    table.write_text(";".join(GERMAN).replace("[µm]", "[mm]") + "\n" + ";".join(map(str, ROWS[0])) + "\n")
    cell = tmp_path / "cell.yaml"
    cell.write_text("robot: irb6660-205-1.90\ntool: {position_mm: [0, 0, 250]}\n")
    with pytest.raises(CompstiffError) as refused:
        read_measurements(table, read_cell(cell).robot)
    words = "'dx [mm]', 'dy [mm]', 'dz [mm]' must be dx_um, dy_um, dz_um, in micrometres: convert their numbers"
    assert words in refused.value.findings[0].hint


@pytest.mark.parametrize(("header", "column", "unit"), [
    ("mx_nmm", "mx_nm", "newton metres"), ("My [N·mm]", "my_nm", "newton metres"), ("Mz [kNm]", "mz_nm", "newton metres"),
    ("mx_lbf_in", "mx_nm", "newton metres"), ("fx_kgf", "fx_n", "newtons"), ("Fy [lbf]", "fy_n", "newtons"),
    ("dz_m", "dz_um", "micrometres"), ("dx [in]", "dx_um", "micrometres"), ("masse_g", "mass_kg", "kilograms"),
    ("Zeit [us]", "time_s", "seconds"), ("x_m", "x_mm", "millimetres")])
def test_a_unit_of_another_size_is_told_as_one(header: str, column: str, unit: str) -> None:
    """A column that may be missing is left out with a warning, which must not lead to its name over the numbers as they are."""
    assert meant(header) == (column, unit)
    assert unread([header], [column, "target"]) == [
        ("warning", f"column '{header}' is not read; is '{column}' meant? It must be in {unit}: convert its numbers")]


def test_the_csv_that_excel_writes_first_is_no_utf_8(tmp_path: Path) -> None:
    cell, table = tmp_path / "cell.yaml", tmp_path / "m.csv"
    cell.write_text("robot: irb6660-205-1.90\ntool: {position_mm: [0, 0, 250]}\n")
    table.write_bytes(";".join(GERMAN).encode("cp1252") + b"\n")
    run = kit.run("check", cell, table)
    assert "CSV UTF-8" in run.err


@pytest.mark.parametrize(("header", "said"), [
    (["Fx [N]", "Fy [N]"], "call 'Fx [N]' fx_n, 'Fy [N]' fy_n"), (["fx_n", "Fy [N]"], "call 'Fy [N]' fy_n"),
    (["fx_n", "fy_n"], ""), (["Fx [N]", "Kraft x [N]", "Fy [N]"], "call 'Fy [N]' fy_n"), (["Fz [N]", "Zeit [s]"], ""),
    (["Fx [kN]"], "'Fx [kN]' must be fx_n, in newtons: convert its numbers"),
    (["Fx [kN]", "Fy [kN]"], "'Fx [kN]', 'Fy [kN]' must be fx_n, fy_n, in newtons: convert their numbers"),
    (["Fx [kN]", "Fy [N]"], "call 'Fy [N]' fy_n; 'Fx [kN]' must be fx_n, in newtons: convert its numbers")])
def test_what_is_wanted_and_meant_once_is_called_by_its_name(header: list[str], said: str) -> None:
    """Not what has it already, what nobody asks for, or two columns that may mean the same."""
    assert renamed(header, ("fx_n", "fy_n")) == said

"""Excel workbooks: what a sheet holds is what the same CSV file would give, and what Excel does to numbers is no number."""

from __future__ import annotations

import datetime
import zipfile
from pathlib import Path

import numpy as np
import pytest
from openpyxl import Workbook, load_workbook
from openpyxl.chart import LineChart, Reference

from compensator.forces.placement import read_force_log
from identification.common import workbook
from identification.common.findings import CompstiffError
from identification.common.tables import Table, read_table
from tests.runs.command_line import user_files as kit
from tests.runs.command_line.workshop import workshop

HEADER = ["pose", "q1_deg", "dx_um"]


def saved(folder: Path, *sheets: list[list[object]], name: str = "table.xlsx") -> Path:
    book = Workbook()
    book.remove(book.active)
    for number, rows in enumerate(sheets, start=1):
        sheet = book.create_sheet(f"Blatt {number}")
        for row in rows:
            sheet.append(row)
    book.save(folder / name)
    return folder / name


def read(file: Path) -> Table:
    return read_table(file, required=("q1_deg",), optional=("dx_um",), texts=("pose",), may_be_empty=("dx_um",))


def test_numbers_texts_and_empty_cells(tmp_path: Path) -> None:
    table = read(saved(tmp_path, [HEADER, ["P1", 12.5, -3], ["P 2", "1e1", None], [None, 7, "4.25"]]))
    assert table.stack("q1_deg")[:, 0].tolist() == [12.5, 10, 7]
    np.testing.assert_array_equal(table.numbers["dx_um"], [-3, np.nan, 4.25])
    assert table.texts["pose"].tolist() == ["P1", "P 2", ""]
    assert [(finding.code, finding.level) for finding in table.findings] == [("CS0206", "note")]


def test_complaints_name_row_and_column(tmp_path: Path) -> None:
    """An empty row above the table and one in it count, as Excel shows them."""
    with pytest.raises(CompstiffError) as stopped:
        read(saved(tmp_path, [[], HEADER, ["P1", 12.5, 1], [], ["P2", "12 deg", 1]]))
    finding = stopped.value.findings[0]
    assert (finding.code, finding.line, finding.column) == ("CS0203", 5, 2)
    assert "'12 deg'" in finding.message
    assert "Blatt 1" in str(stopped.value)


def test_german_decimal_commas_in_text_cells(tmp_path: Path) -> None:
    table = read(saved(tmp_path, [HEADER, ["P1", "12,75", "-3,5"]]))
    assert (table.numbers["q1_deg"][0], table.numbers["dx_um"][0]) == (12.75, -3.5)


def test_the_first_sheet_with_cells_is_read_and_others_are_said(tmp_path: Path) -> None:
    one = [HEADER, ["P1", 1, 1]]
    alone = read(saved(tmp_path, [], one, name="a.xlsx"))
    assert [(finding.level, "Blatt 2" in finding.message) for finding in alone.findings] == [("note", True)]
    [said] = read(saved(tmp_path, one, [HEADER, ["P1", 2, 2]], name="b.xlsx")).findings
    assert (said.level, "not read: 'Blatt 2'" in said.message) == ("warning", True)
    with pytest.raises(CompstiffError, match="CS0206.*'Notes'|read from the sheet 'Blatt 1'"):
        read(saved(tmp_path, [["measured on Monday"]], one, name="c.xlsx"))


@pytest.mark.parametrize(("cell", "words"), [
    (datetime.datetime(2026, 2, 1), "row 2, column B of the sheet 'Blatt 1': found a date"),
    (datetime.time(1, 2), "found a date or time"), (datetime.timedelta(hours=30), "found a date or time, 1 day, 6:00:00"),
    ("=1+2", "the formula =1\\+2 has no saved value")])
def test_what_excel_makes_of_numbers_is_refused(tmp_path: Path, cell: object, words: str) -> None:
    with pytest.raises(CompstiffError, match=f"CS0207.*{words}"):
        read(saved(tmp_path, [HEADER, ["P1", cell, 1]]))


def test_a_formula_in_a_cell_that_may_be_empty_is_no_empty_cell(tmp_path: Path) -> None:
    with pytest.raises(CompstiffError, match="CS0207.*column C"):
        read(saved(tmp_path, [HEADER, ["P1", 1, "=A1*1000"]]))


def test_merged_cells_are_refused(tmp_path: Path) -> None:
    file = tmp_path / "merged.xlsx"
    book = Workbook()
    for row in [HEADER, ["P1", 1, 1], [None, 1, 2]]:
        book.active.append(row)
    book.active.merge_cells("A2:A3")
    book.save(file)
    with pytest.raises(CompstiffError, match="CS0207.*A2:A3"):
        read(file)


def test_an_error_value_and_a_damaged_workbook(tmp_path: Path) -> None:
    with pytest.raises(CompstiffError, match=r"CS0203.*#DIV/0!"):
        read(saved(tmp_path, [HEADER, ["P1", "#DIV/0!", 1]]))
    whole = saved(tmp_path, [HEADER, ["P1", 1, 1]]).read_bytes()
    (tmp_path / "half.xlsx").write_bytes(whole[:len(whole) // 2])
    with pytest.raises(CompstiffError, match="CS0201"):
        read(tmp_path / "half.xlsx")
    (tmp_path / "old.xls").write_bytes(b"\xd0\xcf\x11\xe0" + bytes(100))
    with pytest.raises(CompstiffError, match=r"CS0201.*old form \(\.xls\); \.xlsx is read"):
        read(tmp_path / "old.xls")


def test_a_force_log_and_the_measurements_of_a_shop(tmp_path: Path) -> None:
    """The same numbers as from CSV, in the library and on the command line."""
    shop = workshop("irb6700-200-2.60")

    def as_rows(text: str) -> list[list[object]]:
        header, *lines = text.splitlines()
        return [list(header.split(",")), *([float(cell) for cell in line.split(",")] for line in lines)]

    (tmp_path / "forces.csv").write_text(shop.files["forces.csv"])
    log = read_force_log(saved(tmp_path, as_rows(shop.files["forces.csv"]), name="forces.xlsx"))
    np.testing.assert_array_equal(log.force, read_force_log(tmp_path / "forces.csv").force)
    measured = saved(tmp_path, as_rows(shop.files["measurements.csv"]), name="measurements.xlsx")
    (tmp_path / "cell.yaml").write_text(shop.files["cell.yaml"])
    result = kit.run("identify", tmp_path / "cell.yaml", measured, "-o", tmp_path / "found.json", "--json")
    assert result.code == 0, result
    assert "CS0206" in kit.codes(result)


def test_a_workbook_without_cells_or_of_many_megabytes_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(CompstiffError, match=r"table.xlsx:1: error CS0201: is empty: a header line with column names"):
        read(saved(tmp_path, [], []))
    file = saved(tmp_path, [HEADER, ["P1", 12.5, 1]], name="one.xlsx")
    for largest in (file.stat().st_size, file.stat().st_size - 1):
        monkeypatch.setattr(workbook, "LARGEST", largest)
        workbook._read.cache_clear()
        if largest == file.stat().st_size:
            assert read(file).numbers["q1_deg"].tolist() == [12.5]
            continue
        with pytest.raises(CompstiffError, match=r"one.xlsx: error CS0201: is a workbook of 0 MB, at most 0 MB are read"):
            read(file)


def test_a_chart_of_its_own_is_no_sheet_with_cells(tmp_path: Path) -> None:
    file = saved(tmp_path, [HEADER, ["P1", 12.5, 1]])
    book, chart = load_workbook(file), LineChart()
    chart.add_data(Reference(book.active, 2, 1, 2, 2), titles_from_data=True)
    book.create_chartsheet("Diagramm", 0).add_chart(chart)
    book.save(file)
    read_in = read(file)
    assert read_in.numbers["q1_deg"].tolist() == [12.5]
    assert [(one.level, one.message) for one in read_in.findings] == [("note", "read from the sheet 'Blatt 1'")]


def test_a_sheet_that_reaches_far_or_a_workbook_that_unpacks_to_much_is_not_read(tmp_path: Path) -> None:
    """A number lost in a far corner: five million cells are read, empty ones included. And what is small while it is packed."""
    file = saved(tmp_path, [HEADER, ["P1", 12.5, 1]])
    book = load_workbook(file)
    book.active.cell(1_000_001, 5, 7)
    book.save(tmp_path / "far.xlsx")
    with pytest.raises(CompstiffError) as stopped:
        read(tmp_path / "far.xlsx")
    (found,) = stopped.value.findings
    assert (found.code, found.message) == (
        "CS0201", "the sheet 'Blatt 1' reaches to row 1000001, column 5: over 5000000 cells")
    with zipfile.ZipFile(file, "a", zipfile.ZIP_DEFLATED, compresslevel=1) as archive, archive.open("xl/media/x", "w") as part:
        for _ in range(257):
            part.write(bytes(1 << 20))
    assert file.stat().st_size < 2 << 20
    with pytest.raises(CompstiffError, match=r"CS0201: is a workbook of 257 MB once unpacked, at most 256 MB are read"):
        read(file)

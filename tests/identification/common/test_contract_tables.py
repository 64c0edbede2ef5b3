"""Tables as spreadsheets and loggers write them: read where there is one meaning, else one complaint that says what to do."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from compensator.forces.log import read_force_log
from compensator.learning.measured_points import read_points
from compensator.verification.readings import read_readings
from identification.common import number_blocks
from identification.common.findings import CompstiffError
from identification.common.number_blocks import parquet_at, parquet_blocks, parquet_names, parse_block, text_at, text_blocks
from identification.common.shipped import shipped
from identification.common.sizes import LARGEST_CELL
from identification.common.table_layout import Layout, read_layout
from identification.common.tables import read_table
from identification.measurements import read_measurements
from identification.model.cell import read_cell
from identification.model.cell_file import ForceLogFile
from tests.support import robot, write_cell

NAMES = ("a_mm", "b_mm")
LOADED = "q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg,fx_n,fy_n,fz_n,dx_um,dy_um,dz_um"
Table = dict[str, np.ndarray]


def short(file: Path) -> Table:
    return read_table(file, required=NAMES).numbers


def long(file: Path) -> Table:
    blocks = [numbers for numbers, _ in text_blocks(file, read_layout(file), NAMES)]
    return {name: np.concatenate([block[name] for block in blocks]) for name in NAMES}


@pytest.fixture(params=[short, long])
def read(request: pytest.FixtureRequest):
    return request.param


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16"])
@pytest.mark.parametrize("rows", ["1.5,2\n-3,0.25\n", '"1,5",2\n-3,"0,25"\n', '"1,500","2"\n"-3","0,250"\n'])
def test_one_meaning_is_read(tmp_path: Path, read, rows: str, encoding: str) -> None:
    file = tmp_path / "table.csv"
    file.write_bytes(f"a_mm,b_mm\n{rows}".encode(encoding))
    table = read(file)
    np.testing.assert_array_equal(table["a_mm"], [1.5, -3])
    np.testing.assert_array_equal(table["b_mm"], [2, 0.25])


def test_the_minus_of_a_swedish_spreadsheet_is_one(tmp_path: Path, read) -> None:
    file = tmp_path / "table.csv"
    file.write_text("a_mm;b_mm\n\u22121,5;2\n3;\u22120,25\n", encoding="utf-8-sig")
    table = read(file)
    np.testing.assert_array_equal(table["a_mm"], [-1.5, 3])
    np.testing.assert_array_equal(table["b_mm"], [2, -0.25])


@pytest.mark.parametrize(("cell", "right"), [("-1.112", False), ("12.345", False), ("1.234.567", False), ("0.125", True),
                                             ("1.2", True), ("1.2345", True)])
def test_a_point_of_thousands_is_not_a_decimal_one(tmp_path: Path, read, cell: str, right: bool) -> None:
    """Beside decimal commas; a file of decimal points alone is read as ever."""
    file = tmp_path / "table.csv"
    file.write_text(f"a_mm;b_mm\n15,2098;7\n32,9;{cell}\n")
    if right:
        assert read(file)["b_mm"][1] == float(cell)
    else:
        with pytest.raises(CompstiffError) as stopped:
            read(file)
        assert [(one.code, one.line, one.column) for one in stopped.value.findings] == [("CS0203", 3, 2)]
        assert "thousands" in stopped.value.findings[0].hint
    file.write_text("a_mm;b_mm\n15.209;7\n-1.112;3\n")
    np.testing.assert_array_equal(read(file)["a_mm"], [15.209, -1.112])


@pytest.mark.parametrize("mark", [";", "\t"])
@pytest.mark.parametrize(("rows", "right"), [
    ("0.5;1,234\n2;3\n", None), ('0.5;"1,234"\n2;3\n', None), ("2;3\n-0.5;-12,345,678\n", None), ("0.5;1,25\n2;3\n", [1.25, 3]),
    ("0.5;1,234\n2;0,5\n", [1.234, 0.5]), ("0.5;1234\n2;3\n", [1234, 3]), ("5;1,234\n2;3\n", [1.234, 3]),
    ("0.5;0,234\n2;3\n", [0.234, 3])])
def test_a_comma_of_thousands_is_not_a_decimal_one(tmp_path: Path, read, mark: str, rows: str, right) -> None:
    """Beside decimal points, where no other comma is certainly a decimal one: tabs between the cells, as an English spreadsheet
    writes them."""
    file = tmp_path / "table.csv"
    file.write_text(f"a_mm;b_mm\n{rows}".replace(";", mark))
    if right is not None:
        np.testing.assert_array_equal(read(file)["b_mm"], right)
        return
    with pytest.raises(CompstiffError) as stopped:
        read(file)
    [found] = stopped.value.findings
    assert (found.code, found.line, found.column) == ("CS0203", 2 if rows[0] == "0" else 3, 2)
    assert "separates thousands, or is a decimal one where other cells have decimal points" in found.message


@pytest.mark.parametrize("mark", [";", "\t"])
def test_a_comma_in_a_note_says_nothing_of_numbers(tmp_path: Path, read, mark: str) -> None:
    file = tmp_path / "table.csv"
    file.write_text("a_mm;b_mm;note\n1.234;0.5;at 1,5 mm\n-12.345;2;\n".replace(";", mark))
    np.testing.assert_array_equal(read(file)["a_mm"], [1.234, -12.345])
    file.write_text("a_mm;b_mm;note\n1.234;0,5;at 1,5 mm\n-12.345;2;\n".replace(";", mark))
    with pytest.raises(CompstiffError, match=r"the point in '1\.234' separates thousands"):
        read(file)


@pytest.mark.parametrize("mark", [";", "\t", "  "])
@pytest.mark.parametrize(("cell", "column"), [("1.234", 2), ("1.234", 4), ("1234", None), ("0.234", None)])
def test_a_force_of_a_thousand_newtons_is_not_read_as_one(tmp_path: Path, mark: str, cell: str, column: int | None) -> None:
    """As a spreadsheet shows it; what is in a column that is not read may be anything."""
    file, row = tmp_path / "log.csv", ["0,2", "1,5", "-2,5", "3,5", "7.125"]
    if column is not None:
        row[column - 1] = cell
    text = [["time_s", "fx_n", "fy_n", "fz_n", "valve"], ["0,1", "0,5", "0,25", "0,125", "1.234"], row]
    file.write_text("\n".join(mark.join(cells) for cells in text) + "\n")
    if column is None:
        row[3] = cell
        file.write_text("\n".join(mark.join(cells) for cells in text) + "\n")
        np.testing.assert_array_equal(read_force_log(file).force, [[0.5, 0.25, 0.125], [1.5, -2.5, float(cell)]])
        return
    with pytest.raises(CompstiffError) as stopped:
        read_force_log(file)
    [found] = stopped.value.findings
    assert (found.code, found.line, found.column) == ("CS0203", 3, column)
    assert found.message.startswith("the point in '1.234' separates thousands")


@pytest.mark.parametrize("mark", [",", ";", "\t"])
def test_what_a_spreadsheet_leaves_behind_a_table_is_nothing(tmp_path: Path, mark: str) -> None:
    """Columns and rows without a word; a word in them is a column without a name."""
    file, rows = tmp_path / "table.csv", ["a_mm,b_mm,,", "1.5,2,,", ",,,", "-3,0.25,,", ",,,"]
    file.write_text("\n".join(rows).replace(",", mark) + "\n")
    table = read_table(file, required=NAMES)
    assert table.columns == ("a_mm", "b_mm")
    np.testing.assert_array_equal(table.stack("a_mm", "b_mm"), [[1.5, 2], [-3, 0.25]])
    np.testing.assert_array_equal(table.line, [2, 4])
    file.write_text("\n".join([*rows, "1,2,,here"]).replace(",", mark) + "\n")
    with pytest.raises(CompstiffError, match="2 of 4 columns have no name"):
        read_table(file, required=NAMES)


@pytest.mark.parametrize("mark", [",", ";", "\t"])
def test_rows_without_a_word_are_none_and_an_empty_cell_is_no_number(tmp_path: Path, read, mark: str) -> None:
    """Behind a table or in it, of a long one too."""
    file, rows = tmp_path / "table.csv", ["a_mm,b_mm", "1.5,2", " ,", "-3,0.25", ",", ","]
    file.write_text("\n".join(rows).replace(",", mark) + "\n")
    table = read(file)
    np.testing.assert_array_equal([table["a_mm"], table["b_mm"]], [[1.5, -3], [2, 0.25]])
    file.write_text("\n".join([*rows[:4], "4,"]).replace(",", mark) + "\n")
    with pytest.raises(CompstiffError) as stopped:
        read(file)
    assert [(one.code, one.line, one.column) for one in stopped.value.findings] == [("CS0203", 5, 2)]


@pytest.mark.parametrize("mark", [",", ";", "\t", " "])
@pytest.mark.parametrize("cell", ["TRUE", "true", "False"])
def test_true_is_no_number(tmp_path: Path, mark: str, cell: str) -> None:
    """Of a valve that cell.yaml has for a force; in a column that is not read it may stand."""
    file = tmp_path / "log.csv"
    file.write_text(f"time_s,valve,fx_n\n0.1,{cell},2\n0.2,{cell},3\n".replace(",", mark))
    layout = read_layout(file)
    [(numbers, _)] = list(text_blocks(file, layout, ("time_s", "fx_n")))
    np.testing.assert_array_equal(numbers["fx_n"], [2, 3])
    with pytest.raises(CompstiffError) as stopped:
        list(text_blocks(file, layout, ("time_s", "valve")))
    assert [(one.code, one.line, one.column) for one in stopped.value.findings] == [("CS0203", 2, 2), ("CS0203", 3, 2)]


@pytest.mark.parametrize(("rows", "says"), [
    ('"1,500","2,125"\n"3,125","4,375"\n', "may be a decimal comma or separate thousands (4 such cells)"),
    ('"1,5",2\n3.5,4\n', "stands beside numbers with a point (1 such cell)"),
])
def test_two_meanings_are_one_complaint(tmp_path: Path, read, rows: str, says: str) -> None:
    file = tmp_path / "table.csv"
    file.write_text(f"a_mm,b_mm\n{rows}")
    with pytest.raises(CompstiffError) as stopped:
        read(file)
    (finding,) = stopped.value.findings
    assert (finding.code, finding.line, finding.column) == ("CS0203", 2, 1)
    assert says in finding.message
    assert "decimal points" in finding.hint


def test_a_table_in_another_encoding_is_named(tmp_path: Path) -> None:
    """A log's header is read all the same (test_contract_header_names.py): its names stand in cell.yaml."""
    file = tmp_path / "table.csv"
    file.write_bytes("a_mm,b_µm\n1,2\n".encode("cp1252"))
    with pytest.raises(CompstiffError, match="UTF-8"):
        short(file)


@pytest.mark.parametrize(("content", "says"), [
    (b"PK\x03\x04\x14\x00\x06\x00", "workbook"), (b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1", "Excel"), (b"PAR1\x15\x04", "Parquet"),
    (b"TDSm\x0e\x00\x00\x00", "TDMS"),
    (b"MATLAB 5.0 MAT-file", "convert"), (b"\xff\xfea\x00\x00\xd8", "UTF-16"),
])
def test_what_is_no_text_is_named(tmp_path: Path, read, content: bytes, says: str) -> None:
    file = tmp_path / "table.csv"
    file.write_bytes(content)
    with pytest.raises(CompstiffError) as stopped:
        read(file)
    (finding,) = stopped.value.findings
    assert finding.code == "CS0201"
    assert says in finding.message
    assert "save the table as CSV" in finding.hint


@pytest.mark.parametrize("spell", ["{!r}".format, "{:.17e}".format, "{:+.6f}".format, " {:.3f} ".format, "{:.0f}.".format])
@pytest.mark.parametrize(("separator", "point"), [(",", "."), (";", ","), ("\t", ".")])
def test_numbers_of_a_long_table_are_those_that_python_reads(spell, separator, point) -> None:
    """To the last bit; signs that Arrow does not take go the other way, which may miss the last one."""
    values = np.random.default_rng(3).standard_normal((500, 3)) * 10.0 ** np.arange(-4, 5, 4)
    cells = [[spell(float(value)).replace(".", point) for value in row] for row in values]
    block = "\n".join(separator.join(row) for row in cells).encode() + b"\n"
    layout = Layout(separator, ("a", "b", "c"), 0, 1, 0, 0, 500)
    numbers, line = parse_block(block, "log.csv", layout, ["c", "a"], 1, 500)
    wanted = np.array([[float(cell.replace(point, ".")) for cell in row] for row in cells])
    assert line.tolist() == list(range(1, 501))
    last_bit = 1e-15 if spell(1.0).startswith("+") else 0.0
    for column, name in ((0, "a"), (2, "c")):
        np.testing.assert_allclose(numbers[name], wanted[:, column], rtol=last_bit, atol=0)


@pytest.mark.parametrize("cell", ["", "nan", "inf", "1e400", "1,5", "x", "0x10", "1 2", "é"])
def test_a_cell_that_is_no_number_is_still_named(cell) -> None:
    block = f"1,2\n3,{cell}\n".replace("1,5", "1.5.5").encode()
    with pytest.raises(CompstiffError) as stopped:
        parse_block(block, "log.csv", Layout(",", ("a", "b"), 0, 1, 0, 0, 2), ["a", "b"], 1, 2)
    assert stopped.value.findings[0].code == "CS0203"
    assert (stopped.value.findings[0].line, stopped.value.findings[0].column) == (2, 2)


def test_a_complaint_about_the_header_names_the_line_it_stands_on(tmp_path):
    """Behind a comment and a blank line, as an editor counts."""
    for header, words in (("a,b,a", "column twice: a"), ("a,c", "missing")):
        (tmp_path / "t.csv").write_text(f"# made by hand\n\n{header}\n1,2,3\n"[:-3 if header == "a,c" else None] + "\n")
        with pytest.raises(CompstiffError) as stopped:
            read_table(tmp_path / "t.csv", required=("a", "b"))
        found = stopped.value.findings[0]
        assert (found.code, found.line) == ("CS0202", 3)
        assert words in found.message


@pytest.mark.parametrize(("read", "code", "header"), [
    (read_points, "CS5300", "x_mm,y_mm,z_mm"), (read_points, "CS5300", "x_mm,y_mm,z_mm,dn_um"),
    (read_points, "CS6039", "x_mm,y_mm,z_mm,samples,note,time_s"), (read_readings, "CS6020", "target"),
    (read_readings, "CS6021", "dx_um,dy_um,dz_um")])
def test_so_does_one_about_what_the_header_lacks(tmp_path: Path, read, code: str, header: str) -> None:
    (tmp_path / "t.csv").write_text(f"# of the probe\n\n{header}\n" + ",".join("1" * (header.count(",") + 1)) + "\n")
    with pytest.raises(CompstiffError) as stopped:
        read(tmp_path / "t.csv", read_cell(write_cell(tmp_path)))
    assert [(found.code, found.line) for found in stopped.value.findings] == [(code, 3)]


@pytest.mark.parametrize(("column", "meant"), [("Dwell", "dwell_s"), ("times", "time_s"), ("tmsx", "time_s"), ("tmsxx", ""),
                                               ("operator", ""), ("pose_name", "pose")])
def test_a_column_that_is_not_read_is_named(tmp_path: Path, column: str, meant: str) -> None:
    """With the name that is meant, where one is much alike; never one that the table has. On the line of the header."""
    file = tmp_path / "m.csv"
    rows = f"{LOADED}\n{','.join('1' * 12)}\n"
    for name in (column, meant):
        header, *body = rows.splitlines()
        file.write_text("\n".join(["# by hand", f"{header},{name}", *(f"{row},1" for row in body)]) + "\n")
        found = read_measurements(file, robot()).findings if name else ()
        told = f"column '{column}' is not read; is '{meant}' meant?" if meant else f"columns that are not read: {column}"
        assert [str(one) for one in found] == (
            [f"{file}:2: {'warning' if meant else 'note'} CS0204: {told}"] if name == column else [])
    file.write_text(f"{LOADED},{meant or 'pose'},{column},other\n{','.join('1' * 15)}\n")
    named = [one.message for one in read_measurements(file, robot()).findings]
    assert named[-1].endswith(": other" if "meant" in named[0] else f": {column}, other")
    assert f"'{meant or 'pose'}' meant" not in named[0]


@pytest.mark.parametrize("suffix", ["csv", "parquet"])
def test_a_column_of_a_force_log_that_is_not_read_is_named(tmp_path: Path, suffix: str) -> None:
    """Rows of Parquet are counted as below a header. A column that cell.yaml leaves out is not spoken of."""
    names = ["target", "fx_n", "fy_n", "fz_n", "tme_s", "spindle_load"]
    frame, file = pd.DataFrame(np.ones((20, 6)), columns=names), tmp_path / f"log.{suffix}"
    frame.to_parquet(file) if suffix == "parquet" else file.write_text("# rig\n" + frame.to_csv(index=False))
    told = [(one.level, one.line, one.message) for one in read_force_log(file).findings if one.code == "CS0204"]
    line = 2 if suffix == "csv" else 1
    assert told == [("warning", line, "column 'tme_s' is not read; is 'time_s' meant?"),
                    ("note", line, "columns that are not read: spindle_load")]
    if suffix == "csv":
        left = read_force_log(file, ForceLogFile(columns=(*names[:4], "-", "-")))
        assert "CS0204" not in {one.code for one in left.findings}


@pytest.mark.parametrize("separator", [",", ";", "\t"])
@pytest.mark.parametrize(("rows", "line", "cells"), [
    (["0,1,2,3,4,5", "1,1,2,3", "2,1,2,3,4"], 7, 6),      # the short one was filled up, both were read
    (["0,1,2,3", "1,1,2,3,4,5", "2,1,2,3,4"], 7, 4),
    (["0,1", "1,1,2,3,4,5", "2,1,2,3,4,5,6"], 7, 2),      # the first row has no third column
    (["0,1,2,3,4", "1,1,2,3,4,5", "2,1,2,3"], 8, 6)])
def test_rows_of_other_widths_are_named_though_their_cells_are_as_many(
    separator: str, rows: list[str], line: int, cells: int,
) -> None:
    """As many separators in all as rows of five columns have; the fifth is not asked for."""
    layout = Layout(separator, ("s", "fx", "fy", "fz", "note"), 0, 7, 1, 0, 3)
    block = "".join(f"{row}\n" for row in rows).replace(",", separator).encode()
    with pytest.raises(CompstiffError) as stopped:
        parse_block(block, "log.csv", layout, ("s", "fx", "fy", "fz"), 7, 3)
    finding, = stopped.value.findings
    assert (finding.code, finding.line) == ("CS0201", line)
    assert finding.message.startswith(f"{cells} cells where")


@pytest.mark.parametrize("separator", [",", ";", "\t"])
@pytest.mark.parametrize(("rows", "line", "cells"), [
    (['"A",1,2,', '"B",3,4,'], 2, 4), (['"A",1,2,9', '"B",3,4,9'], 2, 4), (["A,1,2,9", '"B",3,4'], 2, 4),
    (['"A",1,2', "B,3"], 3, 2), (['"A",1,2', '"B",3,4,5'], 3, 4), (['"A, or ""B""",1,2', "C,3,4,"], 3, 4)])
def test_a_quote_somewhere_moves_no_cell_to_another_column(
    tmp_path: Path, separator: str, rows: list[str], line: int, cells: int,
) -> None:
    """With one cell more in each row than in the header the first of them had been lost, and all others read one column on."""
    file = tmp_path / "t.csv"
    file.write_text("\n".join(["pose,a,b", *rows]).replace(",", separator) + "\n")
    with pytest.raises(CompstiffError) as stopped:
        read_table(file, required=("a", "b"), texts=("pose",), may_be_empty=("b",))
    finding, = stopped.value.findings
    assert (finding.code, finding.line) == ("CS0201", line)
    assert finding.message.startswith(f"{cells} cells where the header names 3 columns")


def test_a_separator_within_quotes_is_none(tmp_path: Path) -> None:
    file = tmp_path / "t.csv"
    file.write_text('pose,a,b,\n"A, or ""B""",1,2,\n "C",3,,\n')
    table = read_table(file, required=("a", "b"), texts=("pose",), may_be_empty=("b",))
    assert table.texts["pose"].tolist() == ['A, or "B"', "C"]
    assert table.numbers["a"].tolist() == [1, 3]


@pytest.mark.parametrize(("cells", "expected"), [
    (("08:14:07", "08:14:37,250", "8:15:00.5"), (29647.0, 29677.25, 29700.5)),
    (("23:59:50", "", "00:00:20"), (86390.0, np.nan, 86420.0)),
    # A clock that was set back by an hour is none of another day.
    (("02:59:50", "02:00:20"), (10790.0, 7220.0)),
])
def test_times_by_the_clock_are_seconds_of_the_day(tmp_path: Path, cells: tuple[str, ...], expected: tuple[float, ...]) -> None:
    """In semicolons, as a spreadsheet with decimal commas writes them; a note says what the first was read as."""
    file = tmp_path / "times.csv"
    file.write_text("time_s;dx_um\n" + "".join(f"{cell};1,5\n" for cell in cells))
    table = read_table(file, required=("dx_um",), optional=("time_s",), may_be_empty=("time_s",))
    np.testing.assert_allclose(table.numbers["time_s"], expected)
    (said,) = table.findings
    assert (said.code, said.level, f"{cells[0]} as {expected[0]:g}" in said.message) == ("CS0208", "note", True)


@pytest.mark.parametrize("cells", [("08:14:07", "12.5"), ("08:14", "08:15"), ("25:00:00", "25:00:01"), ("08:14:07", "later")])
def test_times_that_are_not_all_by_the_clock_are_none(tmp_path: Path, cells: tuple[str, ...]) -> None:
    file = tmp_path / "times.csv"
    file.write_text("time_s,dx_um\n" + "".join(f"{cell},1.5\n" for cell in cells))
    with pytest.raises(CompstiffError) as stopped:
        read_table(file, required=("time_s", "dx_um"))
    assert {finding.code for finding in stopped.value.findings} == {"CS0203"}
    assert "hh:mm:ss" in "".join(finding.hint for finding in stopped.value.findings)


@pytest.mark.parametrize(("cells", "labels"), [
    (("P1", "P 2"), ("P1", "P 2")), (("1", "20"), ("1", "20")), (("1", "x"), ("1", "x")), (("", ""), ("", "")),
    (("007", "x"), ("007", "x")), (("007", "010"), ("7", "10")), (("1.50", "2"), ("1.5", "2.0")), (("", "2"), ("", "2.0")),
    (("true", "FALSE"), ("True", "False")), (("1e2", "inf"), ("100.0", "inf")), (("12-3", "4"), ("12-3", "4")),
])
def test_a_quote_elsewhere_changes_no_label(tmp_path: Path, cells: tuple[str, ...], labels: tuple[str, ...]) -> None:
    """With and without quotes tables are read in two ways; a column of numbers alone is one of numbers in both."""
    for first in ("note", '"note"'):
        file = tmp_path / "t.csv"
        file.write_text(f"note,a,pose\n{first}, 1.25 , {cells[0]}\nnote,-3e2,{cells[1]}\n")
        table = read_table(file, required=("a",), texts=("pose",))
        assert table.numbers["a"].tolist() == [1.25, -300]
        assert tuple(table.texts["pose"]) == labels


def test_tables_and_logs_of_plain_numbers_are_read_without_pandas() -> None:
    """It takes as long to import as the rest of a start."""
    code = ("import sys, compstiff; from compensator.forces.log import read_force_log; "
            "cell = compstiff.read_cell(sys.argv[1]); rows = compstiff.read_measurements(sys.argv[2], cell.robot); "
            "log = read_force_log(sys.argv[3]); print(len(rows), len(log.place), 'pandas' in sys.modules)")
    files = [shipped("samples") / name for name in ("cell.yaml", "measurements.csv", "insert.forces.parquet")]
    done = subprocess.run([sys.executable, "-c", code, *files], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["112", "328756", "False"]


@pytest.mark.parametrize("rows", [3, 30000])
def test_quotes_that_are_never_closed_have_their_line_in_a_long_table_too(tmp_path: Path, rows: int) -> None:
    """Behind so many rows the cell was longer than Python's reader takes, and its line was not told."""
    file = tmp_path / "m.csv"
    file.write_text('pose,q1_deg\n# a comment\nP1,1\n"P2,2\n' + "P3,3\n" * rows)
    with pytest.raises(CompstiffError) as stopped:
        read_table(file, required=("q1_deg",), texts=("pose",))
    (finding,) = stopped.value.findings
    assert (finding.code, finding.line, finding.file) == ("CS0201", 4, str(file))


def test_a_cell_without_end_is_no_table(tmp_path: Path) -> None:
    (tmp_path / "m.csv").write_text('pose,q1_deg\n"' + "P" * 140000 + '",2\n')
    with pytest.raises(CompstiffError, match="m.csv: error CS0201: is not a table: "):
        read_table(tmp_path / "m.csv", required=("q1_deg",), texts=("pose",))


def test_a_log_of_words_alone_has_no_line_of_numbers(tmp_path: Path) -> None:
    (tmp_path / "log.csv").write_text("\nmade by a logger\nno sample was taken\n")
    with pytest.raises(CompstiffError) as stopped:
        read_layout(tmp_path / "log.csv", ("time_s", "fx_n", "fy_n", "fz_n"))
    (finding,) = stopped.value.findings
    assert (finding.code, finding.line, finding.message) == ("CS0201", 2, "no line of numbers was found")


@pytest.mark.parametrize(("cell", "refused"), [("-2e+19", True), ("2e+19", True), ("-5e18", False), ("5e18", False)])
def test_a_number_beyond_1e19_is_none(tmp_path: Path, read, cell: str, refused: bool) -> None:
    """Alone in its column, of either sign."""
    file = tmp_path / "table.csv"
    file.write_text(f"a_mm,b_mm\n1,{cell}\n")
    if not refused:
        assert read(file)["b_mm"].tolist() == [float(cell)]
        return
    with pytest.raises(CompstiffError) as stopped:
        read(file)
    [found] = stopped.value.findings
    assert (found.code, found.line, found.column) == ("CS0203", 2, 2)
    assert found.message == f"column 'b_mm': found '{cell}', expected a finite number up to 1e+19 in size"


@pytest.mark.parametrize(("reader", "column", "offered"), [
    (read_table, "time_s", True), (read_table, "dwell_s", False), (read_force_log, "time_s", False)])
def test_times_by_the_clock_are_offered_where_they_would_be_read(tmp_path: Path, reader, column: str, offered: bool) -> None:
    """Not to who has them already, in a log: there they are refused."""
    times = ["08:14:07", "08:14:08" if reader is read_force_log else "about 08:14:08"]
    file = tmp_path / "table.csv"
    file.write_text(f"{column},fx_n,fy_n,fz_n\n" + "".join(f"{time},1,2,3\n" for time in times))
    with pytest.raises(CompstiffError) as stopped:
        reader(file, **({"required": (column,)} if reader is read_table else {}))
    assert {one.hint for one in stopped.value.findings} == {
        "write times as seconds in one number, from any start" + ", or all of them as hh:mm:ss" * offered}



@pytest.mark.parametrize("end", ["\n", "\r\n", "\r", "\n\n"])
@pytest.mark.parametrize("separator", [",", " "])
def test_a_long_table_is_the_same_in_blocks_of_any_size(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, end: str, separator: str
) -> None:
    """Rows and the lines they stand on, with a row in quotes and one empty line more among them."""
    file = tmp_path / "table.csv"
    rows = [f"{k}{separator}{k / 8:g}" for k in range(9)]
    rows[4] += end
    if separator == ",":
        rows[6] = '"6","0.75"'
    file.write_bytes(end.join([separator.join(NAMES), *rows]).encode())
    layout, step = read_layout(file), 1 + (end == "\n\n")
    lines = [2 + step - 1 + step * (k + (k > 4)) for k in range(9)]
    for size in (1, 2, 3, 5, 7, 12, 1000):
        monkeypatch.setattr(number_blocks, "BLOCK_BYTES", size)
        blocks = list(text_blocks(file, layout, NAMES))
        assert np.concatenate([line for _, line in blocks]).tolist() == lines, size
        assert np.concatenate([numbers["a_mm"] for numbers, _ in blocks]).tolist() == list(range(9))
        assert np.concatenate([numbers["b_mm"] for numbers, _ in blocks]).tolist() == [k / 8 for k in range(9)]


@pytest.mark.parametrize("end", ["\n", "\r\n"])
@pytest.mark.parametrize("last", [True, False])
@pytest.mark.parametrize("separator", [",", " "])
def test_rows_from_a_place_in_a_long_table_are_whole_and_from_there(
    tmp_path: Path, end: str, last: bool, separator: str,
) -> None:
    """About as many as are asked for, one behind the other, from that share of the way; from the first row on at 0, to the last
    one at 1 (where its line is ended)."""
    file, count = tmp_path / "table.csv", 3000
    rows = [f"{k}{separator}{k / 8:.3f}" for k in range(count)]
    file.write_bytes((end.join([separator.join(NAMES), *rows]) + end * last).encode())
    layout = read_layout(file)
    assert layout.rows == pytest.approx(count, rel=0.02)
    for share in (0.0, 0.3, 0.75, 1.0):
        found = text_at(file, layout, NAMES, share, 60)
        first = found["a_mm"][0]
        np.testing.assert_array_equal(found["a_mm"], first + np.arange(len(found["a_mm"])))
        np.testing.assert_array_equal(found["b_mm"], found["a_mm"] / 8)
        assert 55 <= len(found["a_mm"]) <= 90
        assert first == pytest.approx(share * (count - 60), abs=0.04 * count)
        assert share > 0 or first == 0
        assert share < 1 or found["a_mm"][-1] == count - 1 - (not last)
    assert text_at(file, layout, ["b_mm"], 0.0, 5)["b_mm"][:5].tolist() == [0, 0.125, 0.25, 0.375, 0.5]
    assert text_at(file, layout, NAMES, 0.0, 10**6)["a_mm"].tolist() == list(range(count - (not last)))


def test_rows_from_a_place_in_parquet_are_those_of_its_row_group(tmp_path: Path) -> None:
    file, count = tmp_path / "table.parquet", 1000
    pd.DataFrame({"a_mm": np.arange(count), "c": "word", "b_mm": np.arange(count) / 8}).to_parquet(file, row_group_size=100)
    assert parquet_names(file) == (("a_mm", "c", "b_mm"), count)
    shares = [0.0, 0.1, 0.105, 0.5, 0.505, 1.0]
    for share, found in zip(shares, parquet_at(file, ("a_mm", "c", "b_mm"), NAMES, shares, 50), strict=True):
        place = int(share * (count - 50))
        expected = np.arange(place, min(place + 50, 100 * (place // 100 + 1)))
        np.testing.assert_array_equal(found["a_mm"], expected)
        np.testing.assert_array_equal(found["b_mm"], expected / 8)
    assert [len(found["a_mm"]) for found in parquet_at(file, NAMES, NAMES, [0.3], 5000)] == [100]


@pytest.mark.parametrize("size", [number_blocks.BATCH_ROWS, 64])
def test_rows_of_parquet_are_counted_as_below_a_header(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, size: int) -> None:
    monkeypatch.setattr(number_blocks, "BATCH_ROWS", size)
    file, values = tmp_path / "table.parquet", np.arange(200) / 8
    pd.DataFrame({"a_mm": values, "b_mm": -values}).to_parquet(file)
    blocks = list(parquet_blocks(file, NAMES, NAMES))
    assert np.concatenate([line for _, line in blocks]).tolist() == list(range(2, 202))
    np.testing.assert_array_equal(np.concatenate([numbers["b_mm"] for numbers, _ in blocks]), -values)
    values[150] = np.nan
    pd.DataFrame({"a_mm": values, "b_mm": values}).to_parquet(file)
    with pytest.raises(CompstiffError) as stopped:
        list(parquet_blocks(file, NAMES, NAMES))
    said = stopped.value.findings[0]
    assert (said.code, said.line, said.column) == ("CS0203", 152, 1)


@pytest.mark.parametrize("value", [LARGEST_CELL, -LARGEST_CELL])
def test_a_number_that_no_cell_has_is_refused_from_its_limit_on(tmp_path: Path, read, value: float) -> None:
    file = tmp_path / "table.csv"
    file.write_text(f"a_mm,b_mm\n1,2\n3,{value!r}\n")
    assert read(file)["b_mm"].tolist() == [2, value]
    file.write_text(f"a_mm,b_mm\n1,2\n3,{1.001 * value!r}\n")
    with pytest.raises(CompstiffError) as stopped:
        read(file)
    said = stopped.value.findings[0]
    assert (said.code, said.line, said.column) == ("CS0203", 3, 2)


def test_twenty_cells_at_fault_are_named_the_first_ones_first(tmp_path: Path, read) -> None:
    file = tmp_path / "table.csv"
    file.write_text("a_mm,b_mm\n" + "".join(f"1,{'x' if 3 <= k < 28 else k}\n" for k in range(40)))
    with pytest.raises(CompstiffError) as stopped:
        read(file)
    assert [one.line for one in stopped.value.findings] == list(range(5, 25))
    assert {(one.code, one.column) for one in stopped.value.findings} == {("CS0203", 2)}


@pytest.mark.parametrize(("count", "more"), [(20, ""), (21, " and 1 more"), (23, " and 3 more")])
def test_twenty_columns_that_stand_twice_are_named(tmp_path: Path, read, count: int, more: str) -> None:
    file, names = tmp_path / "table.csv", [f"c{k:02d}" for k in range(count)]
    file.write_text(",".join(["a_mm", "b_mm", *names, *names]) + "\n" + ",".join(["1"] * (2 * count + 2)) + "\n")
    with pytest.raises(CompstiffError) as stopped:
        read(file)
    assert (stopped.value.findings[0].code, stopped.value.findings[0].message) == (
        "CS0202", f"column twice: {', '.join(names[:20])}{more}")


@pytest.mark.parametrize(("above", "found"), [(200, True), (201, False)])
def test_two_hundred_lines_may_stand_above_the_numbers(tmp_path: Path, above: int, found: bool) -> None:
    file = tmp_path / "table.csv"
    file.write_text("a word\n" * above + "1,2\n3,4\n")
    if found:
        layout = read_layout(file, NAMES)
        assert (layout.line, layout.skipped, layout.header_line) == (201, 199, 200)
        return
    with pytest.raises(CompstiffError, match="CS0201: no line of numbers was found"):
        read_layout(file, NAMES)

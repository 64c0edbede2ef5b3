"""Tables as spreadsheets and loggers write them: read where there is one meaning, else one complaint that says what to do."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from identification.common.findings import CompstiffError
from identification.common.number_blocks import text_blocks
from identification.common.table_layout import read_layout
from identification.common.tables import read_table

NAMES = ("a_mm", "b_mm")
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


@pytest.mark.parametrize(("content", "says"), [
    (b"PK\x03\x04\x14\x00\x06\x00", "workbook"), (b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1", "Excel"), (b"PAR1\x15\x04", "Parquet"),
    (b"MATLAB 5.0 MAT-file", "convert"), ("a_mm,b_µm\n1,2\n".encode("cp1252"), "UTF-8"), (b"\xff\xfea\x00\x00\xd8", "UTF-16"),
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

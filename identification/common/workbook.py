"""Excel workbooks (.xlsx) as text tables: the first sheet that holds cells, a line a row, so that complaints name it."""

from __future__ import annotations

import csv
import datetime
import io
import warnings
import zipfile
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from identification.common.findings import CompstiffError, Finding, error

if TYPE_CHECKING:
    from openpyxl.worksheet.worksheet import Worksheet

SAVE_AS = "save the table as CSV (UTF-8), or write Parquet"
# A workbook is held in memory whole, at some fifty times its size: larger ones are refused [bytes].
LARGEST = 8 << 20
# What a workbook may unpack to [bytes], and the cells of a sheet from its first to its last, empty ones included.
LARGEST_UNPACKED, MOST_CELLS = 256 << 20, 5_000_000


def is_workbook(file: Path) -> bool:
    """Whether a file that begins like an archive is a workbook that can be read."""
    try:
        with zipfile.ZipFile(file) as archive:
            return "xl/workbook.xml" in archive.namelist()
    except (zipfile.BadZipFile, OSError):
        return False


def workbook_text(file: Path) -> bytes:
    """The first sheet with cells as CSV in UTF-8, one line a row.

    Raises CompstiffError (CS0201) for one that is too large or damaged, CS0207 for merged cells, dates and formulas without
    a value, with the row as line.
    """
    state = file.stat()
    return _read(file, state.st_size, state.st_mtime_ns)[0]


def sheet_finding(file: Path) -> list[Finding]:
    """Which sheet was read (CS0206); a warning where others hold cells, too. Empty for what is no workbook."""
    with open(file, "rb") as stream:
        if stream.read(4) != b"PK\x03\x04" or not is_workbook(file):
            return []
    state = file.stat()
    _, first, others = _read(file, state.st_size, state.st_mtime_ns)
    more = f"; not read: {', '.join(repr(name) for name in others)}" if others else ""
    return [Finding("CS0206", "warning" if others else "note", f"read from the sheet '{first}'{more}", file=str(file),
                    hint="keep what is meant in a workbook of its own, or as CSV" if others else "")]


@lru_cache(maxsize=4)
def _read(file: Path, size: int, time: int) -> tuple[bytes, str, tuple[str, ...]]:
    """CSV, the sheet's name, those of others with cells. size [bytes] and time [ns] of the file: a changed one is read anew."""
    from openpyxl import load_workbook

    if size > LARGEST:
        raise error("CS0201", f"is a workbook of {size / 2**20:.0f} MB, at most {LARGEST >> 20} MB are read", file=str(file),
                    hint=SAVE_AS)
    try:
        with zipfile.ZipFile(file) as archive:
            unpacked = sum(part.file_size for part in archive.infolist())
        if unpacked > LARGEST_UNPACKED:
            raise error("CS0201", f"is a workbook of {unpacked / 2**20:.0f} MB once unpacked, at most "
                        f"{LARGEST_UNPACKED >> 20} MB are read", file=str(file), hint=SAVE_AS)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")         # of what a workbook has beside its cells: charts, formats, validation
            values, formulas = (load_workbook(file, data_only=only, keep_links=False) for only in (True, False))
    except CompstiffError:
        raise
    except Exception as reason:                     # its reader raises whatever it stumbles over in a damaged one
        raise error("CS0201", f"is a damaged workbook: {type(reason).__name__}: {reason}", file=str(file),
                    hint=SAVE_AS) from reason
    for sheet in formulas.worksheets:
        if sheet.max_row * sheet.max_column > MOST_CELLS:
            raise error("CS0201", f"the sheet '{sheet.title}' reaches to row {sheet.max_row}, column {sheet.max_column}: over "
                        f"{MOST_CELLS} cells", file=str(file), hint="delete what stands far away from the table")
    # A workbook's charts are sheets, too; they hold no cells.
    filled = [sheet for sheet in formulas.worksheets if any(cell is not None for row in sheet.values for cell in row)]
    if not filled:
        raise error("CS0201", "is empty: a header line with column names was expected", file=str(file), line=1)
    first = filled[0]
    for merged in first.merged_cells.ranges:
        raise error("CS0207", f"the cells {merged.coord} of the sheet '{first.title}' are merged: all but the first are empty",
                    file=str(file), line=merged.min_row, column=merged.min_col, hint="unmerge them and fill each cell")
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    for row in _rows(file, values[first.title], first):
        writer.writerow(row) if any(row) else text.write("\n")
    return text.getvalue().encode(), first.title, tuple(sheet.title for sheet in filled[1:])


def _rows(file: Path, values: Worksheet, formulas: Worksheet) -> list[list[str]]:
    """The cells of a sheet as text, from its first row and column on, empty columns at the end left out."""
    rows = [[_text(file, formulas, k, i, value, formula) for i, (value, formula) in enumerate(zip(*both, strict=True), start=1)]
            for k, both in enumerate(zip(values.values, formulas.values, strict=True), start=1)]
    width = max((i for row in rows for i, cell in enumerate(row, start=1) if cell), default=0)
    return [row[:width] for row in rows]


def _text(file: Path, sheet: Worksheet, row: int, column: int, value: Any, formula: Any) -> str:
    """A cell as text. Raises CompstiffError (CS0207) for a date, which a number like 1.2 becomes where Excel takes it for one,
    and for a formula whose value was not saved."""
    from openpyxl.utils import get_column_letter

    place = f"row {row}, column {get_column_letter(column)} of the sheet '{sheet.title}'"
    if value is None and isinstance(formula, str) and formula.startswith("="):
        raise error("CS0207", f"{place}: the formula {formula[:40]} has no saved value", file=str(file), line=row,
                    column=column, hint="open the workbook in Excel and save it, or put in the value")
    if isinstance(value, datetime.date | datetime.time | datetime.timedelta):
        raise error("CS0207", f"{place}: found a date or time, {value}, expected a number or text", file=str(file), line=row,
                    column=column, hint="Excel makes dates of entries such as 1.2 or 3-4: format the column as number and "
                    "type them in again; times in seconds")
    if isinstance(value, float):
        return repr(value)
    return "" if value is None else " ".join(str(value).split())

"""What stands in the file of a table: the text of CSV, a workbook or UTF-16, or Parquet, as cells with their lines
(docs/formats.md#conventions)."""

from __future__ import annotations

import codecs
import contextlib
import csv
import io
import re
from collections import Counter
from collections.abc import Callable, Container, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO, TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from identification.common.arrays import Array
from identification.common.findings import CompstiffError, error, verb
from identification.common.sizes import LARGEST_CELL
from identification.common.workbook import SAVE_AS, is_workbook, workbook_text

if TYPE_CHECKING:
    import pandas as pd  # where it is needed: it takes longer to import than many a log to read

Numbers = dict[str, Array]
Texts = dict[str, NDArray[np.object_]]

_DECIMAL_COMMA = re.compile(r"(?<=\d),(?=\d)")
_WHOLE = re.compile(r"0|-?[1-9]\d{0,17}")
_NUMBERS_IN_WORDS = ("true", "false", "nan", "inf", "infinity")
# A point of thousands, as German spreadsheets show it, where the file's other cells have decimal commas.
_POINT_OF_THOUSANDS = re.compile(r"[-\u2212+]?[1-9]\d{0,2}(\.\d{3})+")
# And a comma of thousands, as English ones do; a number with a point in it, and one with a comma.
_COMMA_OF_THOUSANDS = re.compile(r"[-\u2212+]?[1-9]\d{0,2}(,\d{3})+")
_WITH_POINT = re.compile(r"[-\u2212+]?(\d+\.\d*|\.\d+)([eE][-+]?\d+)?")
_WITH_COMMA = re.compile(r"[-\u2212+]?(\d+,\d*|,\d+)([eE][-+]?\d+)?")
# How files begin that are often given for a text table, and what they are.
_NO_TEXT = {
    b"PK\x03\x04": "an archive or a workbook of another form (.ods, .zip)",
    b"\xd0\xcf\x11\xe0": "an Excel workbook of the old form (.xls); .xlsx is read",
    b"{": "a JSON file, such as compstiff writes",
    b"PAR1": "a Parquet file under another name; its suffix is .parquet",
    b"MATLAB": "a MATLAB file; `compstiff convert` reads some", b"%PDF": "a PDF file",
    b"TDSm": "a LabVIEW TDMS file; DIAdem and LabVIEW export it as .lvm (--log-format lvm)",
}
_UTF_16 = (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)
MOST_COMPLAINTS = 20


@dataclass(frozen=True, eq=False)
class Cells:
    """What stands in a file: names of the columns, line (N,) of each row and of the header, all cells as a frame, and body: the
    rows as text where no cell is in quotes, separated by `separator`."""

    names: list[str]
    line: NDArray[np.intp]
    header_line: int
    frame: Callable[[], pd.DataFrame]
    body: list[str] = field(default_factory=list)
    separator: str = ","

    def plain(self, wanted: Sequence[str], texts: Sequence[str]) -> tuple[Numbers, Texts] | None:
        """The wanted columns of numbers, and those of text, without pandas, which takes longer to import than most tables to
        read; None where a cell is no number as a cell may have it, or a text that pandas may read as one."""
        if not self.body:
            return None
        try:
            found = np.loadtxt(self.body, delimiter=self.separator, comments=None, ndmin=2,
                               usecols=[self.names.index(name) for name in wanted]) if wanted else np.empty((0, 0))
        except ValueError:
            return None
        rows = [row.split(self.separator) for row in self.body] if texts else []
        labels = {name: np.array([row[self.names.index(name)].strip() for row in rows], dtype=object) for name in texts}
        if not np.all(np.abs(found) <= LARGEST_CELL) or not all(map(_stays_text, labels.values())):
            return None
        return {name: np.ascontiguousarray(found[:, k]) for k, name in enumerate(wanted)}, labels


def _stays_text(cells: NDArray[np.object_]) -> bool:
    """Whether these are the same when they are taken for numbers where all of them are: words, whole numbers, or nothing."""
    return (any(cell[:1].isalpha() and cell.lower() not in _NUMBERS_IN_WORDS for cell in cells)
            or all(map(_WHOLE.fullmatch, cells)) or not any(cells))


def parquet_cells(file: Path) -> Cells:
    import pyarrow.parquet as pq

    with parquet_complaints(file):
        frame = pq.read_table(file, use_threads=False).replace_schema_metadata(None).to_pandas()
    # A Parquet file has no lines; rows are counted as if a header stood above them.
    return Cells([str(name) for name in frame.columns], np.arange(2, len(frame) + 2), 1, lambda: frame)


def csv_cells(file: Path) -> Cells:
    """Cells of a CSV file, comments and blank lines left out."""
    try:
        with opened(file) as stream:
            text = decoded(stream.read(), str(file)).removeprefix("\ufeff")
    except OSError as reason:
        raise error("CS0005", f"cannot be read: {reason.strerror}", file=str(file)) from reason
    plain = text.replace("\r\n", "\n").replace("\r", "\n")
    lines = plain.split("\n")
    kept = [index for index, line in enumerate(lines) if holds_cells(line)]
    if not kept:
        raise error("CS0201", "is empty: a header line with column names was expected", file=str(file), line=1)
    header = lines[kept[0]]
    separator = next((mark for mark in (";", "\t", ",") if mark in header), ",")
    # Rows and columns without a word, as spreadsheets leave them behind a table.
    kept = [kept[0], *(index for index in kept[1:] if lines[index].strip(separator + " \t"))]
    body = [lines[index] for index in kept[1:]]
    while header.endswith(separator) and all(line.endswith(separator) for line in body):
        header, body = header[:-1], [line[:-1] for line in body]
    if separator != "," and any("," in line for line in body):
        no_thousands(body, lambda line: line.split(separator), str(file), [index + 1 for index in kept[1:]])
        body = with_decimal_points(body)
    try:
        names = [name.strip().strip('"') for name in next(csv.reader([header], delimiter=separator))]
    except csv.Error as reason:
        raise error("CS0201", f"the header line is not CSV: {reason}", file=str(file), line=kept[0] + 1) from reason
    check_unique(names, str(file), kept[0] + 1)
    widths = _widths(body, separator, file, kept[1:])
    # Fewer rows than lines: a cell in quotes goes on over the end of its line, which is said below.
    wrong = np.flatnonzero(widths != len(names)) if len(widths) == len(body) else np.empty(0, dtype=int)
    if len(wrong):
        row = int(wrong[0])
        raise error("CS0201", f"{widths[row]} cells where the header names {len(names)} columns", file=str(file),
                    line=kept[1:][row] + 1, hint=f"cells are separated by {separator!r}, taken from the header line"
                    + ("; are there decimal commas? then cells need ';' between them" if separator == "," else ""))
    line = np.array(kept[1:], dtype=np.intp) + 1
    if '"' not in text:
        return Cells(names, line, kept[0] + 1, lambda: _frame(body, names, separator, file), body, separator)
    frame = _frame(body, names, separator, file) if len(widths) == len(body) else None
    if frame is None or len(frame) != len(body):
        open_quote = next((index for index in kept[1:] if lines[index].count('"') % 2), kept[0])
        raise _over_the_end(str(file), open_quote + 1)
    return Cells(names, line, kept[0] + 1, lambda: frame)


def _over_the_end(file: str, line: int) -> CompstiffError:
    return error("CS0201", "a cell in quotes goes over the end of its line, expected one line a row", file=file, line=line,
                 hint="take the line break out of the cell, or close its quotes")


def _widths(body: list[str], separator: str, file: str | Path, index: list[int]) -> NDArray[np.intp]:
    """How many cells each row has; pandas would take the first of too many for the name of the row, and move the others up.
    index: of each line."""
    if not any('"' in line for line in body):
        return np.array([line.count(separator) + 1 for line in body], dtype=np.intp)
    try:
        return np.array([len(row) for row in csv.reader(body, delimiter=separator, skipinitialspace=True)], dtype=np.intp)
    except csv.Error as reason:                     # a cell without end, since its quotes are never closed
        row = next((row for row, line in enumerate(body) if line.count('"') % 2), None)
        if row is not None:
            raise _over_the_end(str(file), index[row] + 1) from reason
        raise error("CS0201", f"is not a table: {reason}", file=str(file)) from reason


def no_thousands(
    body: Sequence[str], cells_of: Callable[[str], Sequence[str]], file: str, numbers: Sequence[int],
    columns: Container[int] | None = None
) -> None:
    """Raises CompstiffError (CS0203) for a point between thousands beside cells with decimal commas, or for commas all of which
    may separate thousands beside cells with decimal points. body: lines, of these numbers in the file; columns: from 0, of the
    cells that are read, None: all."""
    if not any(_DECIMAL_COMMA.search(line) for line in body):
        return
    points = sure = False               # a decimal point stands in a number; a comma that can separate no thousands
    point: tuple[str, str, str, str, int, int] | None = None
    comma: tuple[str, str, str, str, int, int] | None = None
    for number, line in zip(numbers, body, strict=True):
        for column, cell in enumerate(cells_of(line) if "." in line or not sure else (), 1):
            if columns is not None and column - 1 not in columns:
                continue
            cell = cell.strip().strip('"')
            if _POINT_OF_THOUSANDS.fullmatch(cell):
                point = point or ("point", cell, "commas", file, number, column)
            elif _COMMA_OF_THOUSANDS.fullmatch(cell):
                comma = comma or ("comma", cell, "points", file, number, column)
            points = points or bool(_WITH_POINT.fullmatch(cell))
            sure = sure or bool(_WITH_COMMA.fullmatch(cell) and not _COMMA_OF_THOUSANDS.fullmatch(cell))
    if point is not None and (sure or comma is not None):
        raise _either(*point)
    if comma is not None and points and not sure:
        raise _either(*comma)


def _either(mark: str, cell: str, others: str, file: str, line: int, column: int) -> CompstiffError:
    return error("CS0203", f"the {mark} in {shown(cell)} separates thousands, or is a decimal one where other cells have "
                 f"decimal {others}", file=file, line=line, column=column,
                 hint=f"write it without a mark between thousands, and decimal {others} alike in all cells")


def _frame(body: list[str], names: list[str], separator: str, file: Path) -> pd.DataFrame:
    """The rows of a CSV file as pandas reads them."""
    import pandas as pd

    if not body:
        return pd.DataFrame({name: np.empty(0) for name in names})
    try:
        return pd.read_csv(io.StringIO("\n".join(body)), sep=separator, names=names, header=None, na_values=[""],
                           keep_default_na=False, skipinitialspace=True, skip_blank_lines=False, engine="c",
                           low_memory=False)
    except (pd.errors.ParserError, pd.errors.EmptyDataError) as reason:
        raise error("CS0201", f"is not a table: {reason}", file=str(file)) from reason


def opened(file: Path) -> IO[bytes]:
    """A text file as bytes of UTF-8; UTF-16 with its byte-order mark, as spreadsheets write it, is held in memory, and so is
    the first sheet of an .xlsx workbook.

    Raises OSError, and CompstiffError: CS0201, which says what the file is where that can be told, CS0207 a cell of a workbook.
    """
    with open(file, "rb") as stream:
        head = stream.read(8)
        if head.startswith(b"PK\x03\x04") and is_workbook(file):
            return io.BytesIO(workbook_text(file))
        kind = next((kind for mark, kind in _NO_TEXT.items() if head.startswith(mark)), None)
        if kind:
            raise error("CS0201", f"is no text table but {kind}", file=str(file), hint=SAVE_AS)
        if head.startswith(_UTF_16):
            return io.BytesIO(decoded(head + stream.read(), str(file), encoding="utf-16").encode())
    return open(file, "rb")


def decoded(content: bytes, name: str, offset: int = 0, encoding: str = "utf-8") -> str:
    """The text of a part of a file that begins at byte `offset`. Raises CompstiffError (CS0201)."""
    try:
        return content.decode(encoding)
    except UnicodeDecodeError as reason:
        # The line is known where the part is the whole file.
        line = None if offset or encoding != "utf-8" else content[:reason.start].count(b"\n") + 1
        raise error("CS0201", f"is not {encoding.upper()} text: {reason.reason} at byte {offset + reason.start}", file=name,
                    line=line,
                    hint=f"is it the file that is meant, in its place on the command line? {SAVE_AS}; from Excel as "
                    "'CSV UTF-8', or give the .xlsx itself") from reason


@contextlib.contextmanager
def parquet_complaints(file: Path) -> Iterator[None]:
    """Raises CompstiffError where reading a Parquet file fails: CS0005 cannot be read, CS0201 not Parquet, or damaged."""
    import pyarrow as pa

    try:
        yield
    except CompstiffError:
        raise
    except (OSError, pa.ArrowException, MemoryError, UnicodeDecodeError) as reason:
        # Damaged pages are an OSError too, one that the system did not make.
        if isinstance(reason, OSError) and reason.errno is not None:
            raise error("CS0005", f"cannot be read: {reason.strerror or reason}", file=str(file)) from reason
        said = str(reason).strip().split("\n")[0] or type(reason).__name__
        raise error("CS0201", f"is not a Parquet file, or a damaged one: {said}", file=str(file)) from reason


def check_unique(names: Sequence[str], file: str, line: int) -> None:
    """Raises CompstiffError (CS0202) for a column that stands in the header twice."""
    nameless = sum(not name for name in names)
    if nameless > 1:
        raise error("CS0202", f"{nameless} of {len(names)} columns {verb(nameless, 'have')} no name", file=file, line=line,
                    hint="the first row that does not begin with # must name the columns: delete what stands above it")
    twice = sorted(name for name, count in Counter(names).items() if count > 1)
    if twice:
        more = f" and {len(twice) - MOST_COMPLAINTS} more" if len(twice) > MOST_COMPLAINTS else ""
        raise error("CS0202", f"column twice: {', '.join(twice[:MOST_COMPLAINTS])}{more}", file=file, line=line)


def shown(value: object) -> str:
    import pandas as pd

    return "an empty cell" if value is None or value == "" or value is pd.NA or value != value else f"'{value}'"


def holds_cells(line: str) -> bool:
    """Whether a line of text is neither blank nor a comment."""
    return bool(line.strip()) and not line.lstrip().startswith("#")


def with_decimal_points(lines: Sequence[str]) -> list[str]:
    """The lines of a table that is not separated by commas, with points for decimal commas."""
    return [_DECIMAL_COMMA.sub(".", line) for line in lines]

"""Tables of numbers from CSV or Parquet, every complaint with its line and column (docs/formats.md#conventions)."""

from __future__ import annotations

import codecs
import contextlib
import csv
import difflib
import io
import re
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import IO, TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from identification.common.arrays import Array
from identification.common.clock_times import TIME, with_seconds
from identification.common.findings import CompstiffError, Finding, Level, counted, error, verb
from identification.common.header_names import renamed
from identification.common.sizes import LARGEST_CELL
from identification.common.workbook import SAVE_AS, is_workbook, sheet_finding, workbook_text

if TYPE_CHECKING:
    import pandas as pd  # where it is needed: it takes longer to import than many a log to read

Numbers = dict[str, Array]
Texts = dict[str, NDArray[np.object_]]

_DECIMAL_COMMA = re.compile(r"(?<=\d),(?=\d)")
_WITH_COMMA = re.compile(r"[-+]?\d+,\d+([eE][-+]?\d+)?")
_WHOLE = re.compile(r"0|-?[1-9]\d{0,17}")
_NUMBERS_IN_WORDS = ("true", "false", "nan", "inf", "infinity")
_THOUSANDS = re.compile(r"[-+]?[1-9]\d{0,2},\d{3}")           # 1,234 may be either
# A point of thousands, as German spreadsheets show it, where the file's other cells have decimal commas.
_POINT_OF_THOUSANDS = re.compile(r"[-\u2212+]?[1-9]\d{0,2}(\.\d{3})+")
# What people write in place of a number, and what to do about it.
_SLIPS = (
    (re.compile(r"[-+]?\d{1,3}(,\d{3})+(\.\d*)?"), "write it without commas between thousands"),
    (re.compile(r"[-+]?\d{1,3}([.'\u2019 \u00a0\u202f]\d{3})+([.,]\d*)?"), "write it without a mark between thousands"),
    (re.compile(r".*\d:\d\d.*|\d{1,4}[-./]\d{1,2}[-./]\d{1,4}"),
     "write times as seconds in one number, from any start, or all of them as hh:mm:ss"),
    (re.compile(r"[-+]?\d+([.,]\d+)?\s*[^\W\d_eE][^\d]*"), "write the number alone: its unit is in the column's name"),
)
# How files begin that are often given for a text table, and what they are.
_NO_TEXT = {
    b"PK\x03\x04": "an archive or a workbook of another form (.ods, .zip)",
    b"\xd0\xcf\x11\xe0": "an Excel workbook of the old form (.xls); .xlsx is read",
    b"{": "a JSON file, such as compstiff writes",
    b"PAR1": "a Parquet file under another name; its suffix is .parquet",
    b"MATLAB": "a MATLAB file; `compstiff convert` reads some", b"%PDF": "a PDF file",
}
_UTF_16 = (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)
MOST_COMPLAINTS = 20


@dataclass(frozen=True, eq=False)
class Table:
    """Columns of equal length by name: floats, or text where the caller asked for it. line (N,): source line of each row.
    findings: columns that were not read."""

    source: str
    numbers: Numbers
    texts: Texts
    line: NDArray[np.intp]
    columns: tuple[str, ...]
    findings: tuple[Finding, ...] = ()

    def __len__(self) -> int:
        return len(self.line)

    def stack(self, *names: str) -> Array:
        """Columns side by side (N, len(names))."""
        return np.column_stack([self.numbers[name] for name in names])

    def column(self, name: str) -> int:
        """Position of a column in the file, from 1."""
        return self.columns.index(name) + 1


def read_table(
    file: str | Path, *, required: Sequence[str], optional: Sequence[str] = (), texts: Sequence[str] = (),
    may_be_empty: Sequence[str] = (), together: Sequence[Sequence[str]] = (),
    instead: Mapping[str, Sequence[str]] | None = None,
) -> Table:
    """Reads the named columns, leaves the others alone and says so.

    required, optional: columns of finite numbers. texts: optional columns of text. may_be_empty: among the number
    columns, those whose empty cells are read as NaN. together: optional columns of which all or none must be there.
    instead: for an optional column the required ones whose cells it may stand for; they may then be empty or missing. Raises
    CompstiffError: CS0005 cannot be read, CS0201 not a table, CS0202 column missing or twice, CS0203 text, NaN or infinity
    where a number must be, CS0207 a cell of a workbook that is neither number nor text.
    """
    file = Path(file)
    cells = _parquet(file) if file.suffix.lower() in (".parquet", ".pq") else _csv(file)
    of_sheet = sheet_finding(file)
    try:
        table = _table(cells, str(file), required, optional, texts, may_be_empty, together, instead)
    except CompstiffError as stopped:
        raise type(stopped)(*stopped.findings, *of_sheet) from stopped
    return replace(table, findings=(*of_sheet, *table.findings))


@dataclass(frozen=True, eq=False)
class _Cells:
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


def _table(
    cells: _Cells, file: str, required: Sequence[str], optional: Sequence[str], texts: Sequence[str],
    may_be_empty: Sequence[str], together: Sequence[Sequence[str]], instead: Mapping[str, Sequence[str]] | None,
) -> Table:
    """`read_table` of cells that were read."""
    names, line, header_line = cells.names, cells.line, cells.header_line
    for group in [group for name, group in (instead or {}).items() if name in names]:
        required, optional = [name for name in required if name not in group], [*optional, *group]
        may_be_empty, together = [*may_be_empty, *group], [*together, group]
    check_columns(names, required, together, file, header_line, optional=(*optional, *texts))
    wanted = [*required, *(name for name in optional if name in names)]
    worded = [name for name in texts if name in names]
    clocked = tuple[Finding, ...]()
    plain = cells.plain(wanted, worded)
    if plain is None:
        frame = cells.frame()
        if TIME in wanted:
            frame, clocked = with_seconds(frame, file, line)
        numbers = as_numbers(frame[wanted], file, names, line, may_be_empty=may_be_empty)
        # A column of which all cells are empty, or numbers, is one of numbers so far.
        labels = {name: frame[name].astype(object).where(frame[name].notna(), "").astype(str).str.strip().to_numpy(dtype=object)
                  for name in worded}
    else:
        numbers, labels = plain
    known = (*required, *optional, *texts)
    other = unread([name for name in names if name not in known], [name for name in known if name not in names])
    notes = [Finding("CS0204", level, text, file=file, line=header_line) for level, text in other]
    return Table(file, numbers, labels, line, tuple(names), (*clocked, *notes))


def check_columns(
    names: Sequence[str], required: Sequence[str], together: Sequence[Sequence[str]], file: str, line: int | None, *,
    optional: Sequence[str] = (), hint: str = ""
) -> None:
    """Raises CompstiffError (CS0202) for a required column that is missing, and for a part of a group of which all or none must
    be there. optional: what else is read. hint: what else may help."""
    missing = [name for name in required if name not in names]
    if missing:
        lower = [name.lower() for name in names]
        hint = "; names are in small letters" * any(name in lower for name in missing) + hint
        free = [name for name in names if name not in required]
        near = [(other, name) for name in missing for other in difflib.get_close_matches(name, free, n=1, cutoff=0.5)]
        called = renamed(free, (*missing, *optional))
        if called and not any(name in lower for name in missing):
            hint = f"; if they are meant so, {called}{hint}"
        elif near and not hint:
            hint = "; " + ", ".join(f"is '{other}' meant to be {name}?" for other, name in near)
        raise error("CS0202", f"column{'s' if len(missing) > 1 else ''} missing: {', '.join(missing)}; "
                    f"found {', '.join(names) or 'none'}", file=file, line=line,
                    hint="the header line names the columns, unit included, as in docs/formats.md of the project" + hint)
    for group in together:
        there = [name for name in group if name in names]
        if there and len(there) < len(group):
            raise error("CS0202", f"found {', '.join(there)} without {', '.join(name for name in group if name not in names)}",
                        file=file, line=line, hint="give all of them or none")


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


def as_numbers(
    frame: pd.DataFrame, file: str, names: Sequence[str], line: NDArray[np.intp], *, may_be_empty: Sequence[str] = ()
) -> dict[str, Array]:
    """The columns of a frame as finite numbers, NaN where a cell is empty that may be; names: all columns of the file, line
    (N,) of each row. Raises CompstiffError (CS0203) with every complaint."""
    numbers: dict[str, Array] = {}
    findings: list[Finding] = []
    frame = _commas_read(frame, file, names, line)
    for name in frame.columns:
        numbers[name], bad = as_floats(frame[name], empty=name in may_be_empty)
        findings += [
            Finding("CS0203", "error", f"column '{name}': found {shown(frame[name].iloc[row])}, expected a finite number"
                    + beyond(numbers[name][row]), file=file, line=int(line[row]), column=list(names).index(name) + 1,
                    hint=_mend(frame[name].iloc[row]))
            for row in bad[:MOST_COMPLAINTS]
        ]
    if findings:
        raise CompstiffError(*sorted(findings, key=lambda finding: finding.line or 0)[:MOST_COMPLAINTS])
    return numbers


def _mend(cell: object) -> str:
    """What to do about a cell that is no number."""
    return next((hint for pattern, hint in _SLIPS if pattern.fullmatch(str(cell).strip())),
                "mend the cell, or delete the row if the value is lost")


def _commas_read(frame: pd.DataFrame, file: str, names: Sequence[str], line: NDArray[np.intp]) -> pd.DataFrame:
    """The frame with decimal commas (quoted, where commas separate the cells) as points.

    Raises CompstiffError (CS0203) where every one of them may as well separate thousands, or its column has points too.
    """
    import pandas as pd

    texts = {name: frame[name].fillna("").astype(str).str.strip()
             for name in frame.columns if frame[name].dtype.kind not in "fiu"}
    commas = {name: held for name, text in texts.items() if (held := text.str.fullmatch(_WITH_COMMA)).any()}
    if not commas:
        return frame
    cells = pd.concat([texts[name][held] for name, held in commas.items()])
    either = bool(cells.str.fullmatch(_THOUSANDS).all())
    points = any(texts[name].str.contains(".", regex=False).any() for name in commas)
    if either or points:
        name = next(iter(commas))
        row = int(np.flatnonzero(commas[name])[0])
        why = "may be a decimal comma or separate thousands" if either else "stands beside numbers with a point"
        raise error("CS0203", f"column '{name}': the comma in {shown(frame[name].iloc[row])} {why} "
                    f"({counted(len(cells), 'such cell')})", file=file, line=int(line[row]), column=list(names).index(name) + 1,
                    hint="write decimal points; or semicolons between the cells and decimal commas in them")
    return frame.assign(**{name: texts[name].str.replace(",", ".", regex=False).where(held, frame[name])
                           for name, held in commas.items()})


def unread(extra: Sequence[str], absent: Sequence[str]) -> list[tuple[Level, str]]:
    """What to say of columns that are not read: a warning for one that looks like a misspelt name."""
    texts: list[tuple[Level, str]] = []
    others = []
    for name in extra:
        near = difflib.get_close_matches(name.lower(), absent, n=1, cutoff=0.6)
        if near:
            texts.append(("warning", f"column '{name}' is not read; is '{near[0]}' meant?"))
        else:
            others.append(name)
    if others:
        texts.append(("note", f"columns that are not read: {', '.join(others)}"))
    return texts


def shown(value: object) -> str:
    import pandas as pd

    return "an empty cell" if value is None or value == "" or value is pd.NA or value != value else f"'{value}'"


def beyond(value: float) -> str:
    """What to add where a number is finite, and too large for a cell."""
    return f" up to {LARGEST_CELL:g} in size" if np.isfinite(value) else ""


def as_floats(column: pd.Series, *, empty: bool) -> tuple[Array, NDArray[np.intp]]:
    """The column as floats and the rows that are not finite numbers, or too large for a cell."""
    if column.dtype.kind in "fiu":
        values = column.to_numpy(dtype=float)
        return values, np.flatnonzero(~((np.abs(values) <= LARGEST_CELL) | (empty & np.isnan(values))))
    import pandas as pd

    # The typographic minus, as Swedish spreadsheets write it.
    text = column.fillna("").astype(str).str.strip().str.replace("\u2212", "-", regex=False)
    values = pd.to_numeric(text.where(text != "", None), errors="coerce").to_numpy(dtype=float)
    good = (np.abs(values) <= LARGEST_CELL) | (empty & (text == "").to_numpy())
    return values, np.flatnonzero(~good)


def holds_cells(line: str) -> bool:
    """Whether a line of text is neither blank nor a comment."""
    return bool(line.strip()) and not line.lstrip().startswith("#")


def with_decimal_points(lines: Sequence[str]) -> list[str]:
    """The lines of a table that is not separated by commas, with points for decimal commas."""
    return [_DECIMAL_COMMA.sub(".", line) for line in lines]


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


def _parquet(file: Path) -> _Cells:
    import pyarrow.parquet as pq

    with parquet_complaints(file):
        frame = pq.read_table(file, use_threads=False).replace_schema_metadata(None).to_pandas()
    # A Parquet file has no lines; rows are counted as if a header stood above them.
    return _Cells([str(name) for name in frame.columns], np.arange(2, len(frame) + 2), 1, lambda: frame)


def _widths(body: list[str], separator: str, file: str | Path) -> NDArray[np.intp]:
    """How many cells each row has; pandas would take the first of too many for the name of the row, and move the others up."""
    if not any('"' in line for line in body):
        return np.array([line.count(separator) + 1 for line in body], dtype=np.intp)
    try:
        return np.array([len(row) for row in csv.reader(body, delimiter=separator, skipinitialspace=True)], dtype=np.intp)
    except csv.Error as reason:
        raise error("CS0201", f"is not a table: {reason}", file=str(file)) from reason


def _no_thousands(body: list[str], separator: str, file: str, index: list[int]) -> None:
    """Raises CompstiffError (CS0203) for a point between thousands beside cells with decimal commas; index: of each line."""
    if not any(_DECIMAL_COMMA.search(line) for line in body):
        return
    for row, line in enumerate(body):
        for column, cell in enumerate(line.split(separator) if "." in line else (), 1):
            if _POINT_OF_THOUSANDS.fullmatch(cell.strip()):
                raise error("CS0203", f"the point in {shown(cell.strip())} separates thousands, or is a decimal one where "
                            "other cells have decimal commas", file=file, line=index[row] + 1, column=column,
                            hint="write it without a mark between thousands, and decimal commas alike in all cells")


def _csv(file: Path) -> _Cells:
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
        _no_thousands(body, separator, str(file), kept[1:])
        body = with_decimal_points(body)
    try:
        names = [name.strip().strip('"') for name in next(csv.reader([header], delimiter=separator))]
    except csv.Error as reason:
        raise error("CS0201", f"the header line is not CSV: {reason}", file=str(file), line=kept[0] + 1) from reason
    check_unique(names, str(file), kept[0] + 1)
    widths = _widths(body, separator, file)
    # Fewer rows than lines: a cell in quotes goes on over the end of its line, which is said below.
    wrong = np.flatnonzero(widths != len(names)) if len(widths) == len(body) else np.empty(0, dtype=int)
    if len(wrong):
        row = int(wrong[0])
        raise error("CS0201", f"{widths[row]} cells where the header names {len(names)} columns", file=str(file),
                    line=kept[1:][row] + 1, hint=f"cells are separated by {separator!r}, taken from the header line"
                    + ("; are there decimal commas? then cells need ';' between them" if separator == "," else ""))
    line = np.array(kept[1:], dtype=np.intp) + 1
    if '"' not in text:
        return _Cells(names, line, kept[0] + 1, lambda: _frame(body, names, separator, file), body, separator)
    frame = _frame(body, names, separator, file)
    if len(frame) != len(body):
        open_quote = next((index for index in kept[1:] if lines[index].count('"') % 2), kept[0])
        raise error("CS0201", "a cell in quotes goes over the end of its line, expected one line a row", file=str(file),
                    line=open_quote + 1, hint="take the line break out of the cell, or close its quotes")
    return _Cells(names, line, kept[0] + 1, lambda: frame)


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

"""Tables of numbers: the columns that are wanted, every complaint with its line and column (docs/formats.md#conventions)."""

from __future__ import annotations

import difflib
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from identification.common.arrays import Array
from identification.common.cells import MOST_COMPLAINTS, Cells, Numbers, Texts, csv_cells, parquet_cells, shown
from identification.common.clock_times import TIME, with_seconds
from identification.common.findings import CompstiffError, Finding, Level, counted, error
from identification.common.header_names import meant, renamed
from identification.common.sizes import LARGEST_CELL
from identification.common.workbook import sheet_finding

if TYPE_CHECKING:
    import pandas as pd  # where it is needed: it takes longer to import than many a log to read

_WITH_COMMA = re.compile(r"[-+]?\d+,\d+([eE][-+]?\d+)?")
_THOUSANDS = re.compile(r"[-+]?[1-9]\d{0,2},\d{3}")           # 1,234 may be either
# What people write in place of a number, and what to do about it.
_SECONDS = "write times as seconds in one number, from any start"
_SLIPS = (
    (re.compile(r"[-+]?\d{1,3}(,\d{3})+(\.\d*)?"), "write it without commas between thousands"),
    (re.compile(r"[-+]?\d{1,3}([.'\u2019 \u00a0\u202f]\d{3})+([.,]\d*)?"), "write it without a mark between thousands"),
    (re.compile(r".*\d:\d\d.*|\d{1,4}[-./]\d{1,2}[-./]\d{1,4}"), _SECONDS),
    (re.compile(r"[-+]?\d+([.,]\d+)?\s*[^\W\d_eE][^\d]*"), "write the number alone: its unit is in the column's name"),
)


@dataclass(frozen=True, eq=False)
class Table:
    """Columns of equal length by name: floats, or text where the caller asked for it. line (N,): source line of each row,
    header_line that of the names. findings: columns that were not read."""

    source: str
    numbers: Numbers
    texts: Texts
    line: NDArray[np.intp]
    columns: tuple[str, ...]
    header_line: int
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
    cells = parquet_cells(file) if file.suffix.lower() in (".parquet", ".pq") else csv_cells(file)
    of_sheet = sheet_finding(file)
    try:
        table = _table(cells, str(file), required, optional, texts, may_be_empty, together, instead)
    except CompstiffError as stopped:
        raise type(stopped)(*stopped.findings, *of_sheet) from stopped
    return replace(table, findings=(*of_sheet, *table.findings))


def _table(
    cells: Cells, file: str, required: Sequence[str], optional: Sequence[str], texts: Sequence[str],
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
        numbers = as_numbers(frame[wanted], file, names, line, may_be_empty=may_be_empty, clock=True)
        # A column of which all cells are empty, or numbers, is one of numbers so far.
        labels = {name: frame[name].astype(object).where(frame[name].notna(), "").astype(str).str.strip().to_numpy(dtype=object)
                  for name in worded}
    else:
        numbers, labels = plain
    known = (*required, *optional, *texts)
    other = unread([name for name in names if name not in known], [name for name in known if name not in names])
    notes = [Finding("CS0204", level, text, file=file, line=header_line) for level, text in other]
    return Table(file, numbers, labels, line, tuple(names), header_line, (*clocked, *notes))


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


def as_numbers(
    frame: pd.DataFrame, file: str, names: Sequence[str], line: NDArray[np.intp], *, may_be_empty: Sequence[str] = (),
    clock: bool = False
) -> dict[str, Array]:
    """The columns of a frame as finite numbers, NaN where a cell is empty that may be; names: all columns of the file, line
    (N,) of each row; clock: times by the clock would have been read. Raises CompstiffError (CS0203) with every complaint."""
    numbers: dict[str, Array] = {}
    findings: list[Finding] = []
    frame = _commas_read(frame, file, names, line)
    for name in frame.columns:
        numbers[name], bad = as_floats(frame[name], empty=name in may_be_empty)
        findings += [
            Finding("CS0203", "error", f"column '{name}': found {shown(frame[name].iloc[row])}, expected a finite number"
                    + beyond(numbers[name][row]), file=file, line=int(line[row]), column=list(names).index(name) + 1,
                    hint=_mend(frame[name].iloc[row], clock=clock and name == TIME))
            for row in bad[:MOST_COMPLAINTS]
        ]
    if findings:
        raise CompstiffError(*sorted(findings, key=lambda finding: finding.line or 0)[:MOST_COMPLAINTS])
    return numbers


def _mend(cell: object, *, clock: bool) -> str:
    """What to do about a cell that is no number; clock: times by the clock are read in its column, if all are such."""
    hint = next((hint for pattern, hint in _SLIPS if pattern.fullmatch(str(cell).strip())),
                "mend the cell, or delete the row if the value is lost")
    return f"{hint}, or all of them as hh:mm:ss" if clock and hint == _SECONDS else hint


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
    """What to say of columns that are not read: a warning for one that looks like a misspelt name, or is in another unit."""
    texts: list[tuple[Level, str]] = []
    others = []
    for name in extra:
        column, needed = meant(name)
        near = [column] if column in absent else difflib.get_close_matches(name.lower(), absent, n=1, cutoff=0.6)
        if near:
            convert = f" It must be in {needed}: convert its numbers" if needed and near == [column] else ""
            texts.append(("warning", f"column '{name}' is not read; is '{near[0]}' meant?{convert}"))
        else:
            others.append(name)
    if others:
        texts.append(("note", f"columns that are not read: {', '.join(others)}"))
    return texts


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

"""How a long text table is written: what separates its cells, which columns it has, where its rows begin."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from identification.common.cells import check_unique, decoded, holds_cells, opened
from identification.common.findings import CompstiffError, error

HEAD_BYTES = 1 << 20
MOST_LINES_ABOVE = 200
BLANKS = r"\s+"
NUMBER = re.compile(r"[-+]?(\d+([.,]\d*)?|[.,]\d+)([eE][-+]?\d+)?|[-+]?(nan|inf)", re.IGNORECASE)
_LINE = re.compile(rb"([^\r\n]*)(\r\n|\n|\r|$)")


@dataclass(frozen=True)
class Layout:
    """How a text table is written. separator: `,` `;` tab, or BLANKS; names: one a column, "" for one that is not read.

    start: byte the rows begin at; line: their first line, from 1; header_line: 0 without a header; skipped: lines of other
    headers; rows: about how many there are. above: the cells of the line right above the numbers, where that is another one.
    """

    separator: str
    names: tuple[str, ...]
    start: int
    line: int
    header_line: int
    skipped: int
    rows: int
    above: tuple[str, ...] = ()


def cells_of(line: str, separator: str) -> list[str]:
    """The cells of one line, blanks and quotes around them taken off."""
    if separator == BLANKS:
        return line.split()
    try:
        return [cell.strip() for cell in next(csv.reader([line], delimiter=separator, skipinitialspace=True))]
    except (csv.Error, StopIteration):
        return [cell.strip() for cell in line.split(separator)]


def separator_of(line: str) -> str:
    """What separates the cells of a line: `;` or tab where there is one, blanks between whole numbers or names, else `,`."""
    for mark in (";", "\t"):
        if mark in line:
            return mark
    words = line.split()
    if len(words) > 1 and not any(word.endswith(",") or word.startswith(",") for word in words) and (
            "," not in line or all(NUMBER.fullmatch(word) for word in words)):
        return BLANKS
    return ","


def read_layout(file: Path, columns: Sequence[str] | None = None) -> Layout:
    """Looks at the head of a text table. columns: names by position, where the file's own are missing or mean nothing.

    Raises CompstiffError: CS0005 cannot be read, CS0201 not text or empty, CS0202 a column twice, CS3020 no header and no
    `columns`, or another number of them.
    """
    try:
        with opened(file) as stream:
            head = stream.read(HEAD_BYTES)
            size = stream.seek(0, io.SEEK_END)
    except OSError as reason:
        raise error("CS0005", f"cannot be read: {reason.strerror}", file=str(file)) from reason
    lines = _lines(head, str(file))
    # `above`: how many of the lines stand above the numbers; `start` and `before`: byte and line behind the last of them.
    if columns is None:
        _check_header(lines[0], str(file))
        above, start, before, header_line = 1, lines[0].end, lines[0].number, lines[0].number
        separator = separator_of(lines[0].text)
        names = [cell.strip('"') for cell in cells_of(lines[0].text, separator)]
    else:
        above = next((k for k, line in enumerate(lines) if _numeric(line.text)), len(lines))
        if above == len(lines):
            raise error("CS0201", "no line of numbers was found", file=str(file), line=lines[0].number)
        names = ["" if column == "-" else column for column in columns]
        separator = separator_of(lines[above].text)
        header_line = before = lines[above - 1].number if above else 0
        start = lines[above - 1].end if above else _begin(head)
    check_unique([name for name in names if name], str(file), header_line or 1)
    if above < len(lines):
        row = cells_of(lines[above].text, separator)
        # A separator at the end of each line, as some loggers write it.
        if len(row) == len(names) + 1 and not row[-1]:
            names.append("")
        if columns is not None and len(row) != len(names):
            raise error("CS3020", f"has {len(row)} columns, force_log.columns in cell.yaml names {len(names)}", file=str(file),
                        line=lines[above].number, hint="name every column in order, '-' for one that is not to be read")
    body = head[start:]
    ends = max(body.count(b"\n"), body.count(b"\r"), 1)
    return Layout(separator, tuple(names), start, before + 1, header_line, max(above - 1, 0),
                  -(-(size - start) * ends // max(len(body), 1)), _right_above(lines) if columns is None else ())


class _Line(NamedTuple):
    """A line that counts: its number from 1, the byte behind it, its text."""

    number: int
    end: int
    text: str


def _begin(head: bytes) -> int:
    return 3 if head.startswith(b"\xef\xbb\xbf") else 0


def _lines(head: bytes, name: str) -> list[_Line]:
    """The lines that count, up to the first of numbers behind another one. Raises CompstiffError (CS0201) where none does."""
    begin = _begin(head)
    lines: list[_Line] = []
    for number, match in enumerate(_LINE.finditer(head[begin:]), start=1):
        end = match.end() + begin
        try:
            text = decoded(match[1], name, match.start() + begin)
        except CompstiffError:
            # What a logger writes above its numbers does not stand in the way of reading them, nor a degree sign of a name.
            text = match[1].decode("latin-1")
        if holds_cells(text):
            lines.append(_Line(number, end, text))
            if len(lines) > MOST_LINES_ABOVE or (len(lines) > 1 and _numeric(text)):
                break
        if end >= len(head):
            break
    if not lines:
        raise error("CS0201", "is empty: a header line with column names was expected", file=name, line=1)
    return lines


def _right_above(lines: Sequence[_Line]) -> tuple[str, ...]:
    """The cells of the last line above the numbers, where others stand above it; () else."""
    first = next((k for k, line in enumerate(lines) if _numeric(line.text)), 0)
    if first < 2:
        return ()
    return tuple(cells_of(lines[first - 1].text, separator_of(lines[first].text)))


def _check_header(line: _Line, name: str) -> None:
    """Raises CompstiffError (CS3020) where the first line is numbers."""
    if _numeric(line.text):
        cells = len(cells_of(line.text, separator_of(line.text)))
        raise error("CS3020", f"has no header line: it begins with {cells} numbers, and cell.yaml does not say what they "
                    "are", file=name, line=line.number, hint="name them in order in cell.yaml, such as "
                    "force_log: {columns: [time_s, fx_n, fy_n, fz_n, '-']}, '-' for one that is not to be read")


def _numeric(line: str) -> bool:
    cells = [cell for cell in cells_of(line, separator_of(line)) if cell]
    return bool(cells) and all(NUMBER.fullmatch(cell) for cell in cells)



"""Long tables of numbers, block by block in bounded memory: CSV in any dialect with or without a header, and Parquet.

A block is parsed at once; only one that holds comments, blank lines, quotes or a cell at fault is looked at line by line. So a
long log costs what its parser costs, and a complaint still names its line and column.
"""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from identification.common.findings import CompstiffError, Finding, error
from identification.common.tables import MOST_COMPLAINTS, Array, as_floats, shown

Indices = NDArray[np.intp]
BLOCK_BYTES = 1 << 22
BATCH_ROWS = 1 << 17
HEAD_BYTES = 1 << 20
BLANKS = r"\s+"
NUMBER = re.compile(r"[-+]?(\d+([.,]\d*)?|[.,]\d+)([eE][-+]?\d+)?|[-+]?(nan|inf)", re.IGNORECASE)


@dataclass(frozen=True)
class Layout:
    """How a text table is written. separator: `,` `;` tab, or BLANKS; names: one a column, "" for one that is not read.

    start: byte the rows begin at; line: their first line, from 1; header_line: 0 without a header; skipped: lines of other
    headers; rows: about how many there are.
    """

    separator: str
    names: tuple[str, ...]
    start: int
    line: int
    header_line: int
    skipped: int
    rows: int


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


def read_layout(path: Path, columns: Sequence[str] | None = None) -> Layout:
    """Looks at the head of a text table. columns: names by position, where the file's own are missing or mean nothing.

    Raises CompstiffError: CS0005 cannot be read, CS0201 not text or empty, CS0202 a column twice, CS3020 no header and no
    `columns`, or another number of them.
    """
    name = str(path)
    try:
        with open(path, "rb") as stream:
            head = stream.read(HEAD_BYTES)
            size = stream.seek(0, io.SEEK_END)
    except OSError as reason:
        raise error("CS0005", f"cannot be read: {reason.strerror}", file=name) from reason
    begin = 3 if head.startswith(b"\xef\xbb\xbf") else 0
    found: list[tuple[int, int, str]] = []      # number, end, text of the lines that count
    for number, match in enumerate(re.finditer(rb"([^\r\n]*)(\r\n|\n|\r|$)", head[begin:]), start=1):
        text = _text(match[1], name, match.start() + begin)
        if text.strip() and not text.lstrip().startswith("#"):
            found.append((number, match.end() + begin, text))
            if len(found) > 200 or (len(found) > 1 and _numeric(text)):
                break
        if match.end() + begin >= len(head):
            break
    if not found:
        raise error("CS0201", "is empty: a header line with column names was expected", file=name, line=1)
    first = next((k for k, (_, _, text) in enumerate(found) if _numeric(text)), len(found))
    if columns is None:
        if first == 0:
            cells = len(cells_of(found[0][2], separator_of(found[0][2])))
            raise error("CS3020", f"has no header line: it begins with {cells} numbers, and cell.yaml does not say what they "
                        "are", file=name, line=found[0][0], hint="name them in order in cell.yaml, such as "
                        "force_log: {columns: [time_s, fx_n, fy_n, fz_n, '-']}, '-' for one that is not to be read")
        number, start, text = found[0]
        separator = separator_of(text)
        names = [cell.strip('"') for cell in cells_of(text, separator)]
        first, header_line = 1, number
    else:
        if first == len(found):
            raise error("CS0201", "no line of numbers was found", file=name, line=found[0][0])
        names = ["" if column == "-" else column for column in columns]
        separator = separator_of(found[first][2])
        start, number = (found[first - 1][1], found[first - 1][0]) if first else (begin, 0)
        header_line = found[first - 1][0] if first else 0
    twice = sorted({one for one in names if one and names.count(one) > 1})
    if twice:
        raise error("CS0202", f"column twice: {', '.join(twice)}", file=name, line=header_line or 1)
    if first < len(found):
        row = cells_of(found[first][2], separator)
        # A separator at the end of each line, as some loggers write it.
        if len(row) == len(names) + 1 and not row[-1]:
            names.append("")
        if columns is not None and len(row) != len(names):
            raise error("CS3020", f"has {len(row)} columns, force_log.columns in cell.yaml names {len(names)}", file=name,
                        line=found[first][0], hint="name every column in order, '-' for one that is not to be read")
    body = head[start:]
    lines = max(body.count(b"\n"), body.count(b"\r"), 1)
    return Layout(separator, tuple(names), start, number + 1, header_line, max(first - 1, 0),
                  -(-(size - start) * lines // max(len(body), 1)))


def _occurrences(block: bytes, mark: str) -> int:
    """How often a character stands in a block: bytes.count stops at each."""
    return int(np.count_nonzero(np.frombuffer(block, np.uint8) == ord(mark)))


def _numeric(line: str) -> bool:
    cells = [cell for cell in cells_of(line, separator_of(line)) if cell]
    return bool(cells) and all(NUMBER.fullmatch(cell) for cell in cells)


def _text(content: bytes, name: str, offset: int = 0) -> str:
    try:
        return content.decode()
    except UnicodeDecodeError as reason:
        raise error("CS0201", f"is not UTF-8 text: {reason.reason} at byte {offset + reason.start}", file=name) from reason


def text_blocks(path: Path, layout: Layout, wanted: Sequence[str]) -> Iterator[tuple[dict[str, Array], Indices]]:
    """The wanted columns and the line of each row, block by block. Raises CompstiffError: CS0201 (a row of another width, not
    text), CS0203 (not a finite number) with line and column."""
    line = layout.line
    with open(path, "rb") as stream:
        stream.seek(layout.start)
        rest = b""
        while True:
            content = stream.read(BLOCK_BYTES)
            block = rest + content
            if content:
                cut = max(block.rfind(b"\n"), -1 if b"\n" in block else block.rfind(b"\r", 0, -1)) + 1
                block, rest = block[:cut], block[cut:]
            if b"\r" in block:
                block = block.replace(b"\r\n", b"\n").replace(b"\r", b"\n")
            count = _occurrences(block, "\n")
            if block.strip():
                yield parse_block(block, str(path), layout, wanted, line, count)
            line += count
            if not content:
                return


def text_at(path: Path, layout: Layout, wanted: Sequence[str], share: float, rows: int) -> dict[str, Array]:
    """About `rows` rows from a place `share` (0 to 1) of the way through the file."""
    with open(path, "rb") as stream:
        size = stream.seek(0, io.SEEK_END)
        length = max((size - layout.start) // max(layout.rows, 1), 1) + 1
        stream.seek(layout.start + int(share * max(size - layout.start - rows * length, 0)))
        if share > 0:
            stream.readline()
        block = stream.read(rows * length)
    block = block[: block.rfind(b"\n") + 1].replace(b"\r\n", b"\n")
    return parse_block(block, str(path), layout, wanted, 1, _occurrences(block, "\n"))[0] if block.strip() else {}


def parse_block(
    block: bytes, name: str, layout: Layout, wanted: Sequence[str], line: int, ends: int
) -> tuple[dict[str, Array], Indices]:
    """Columns and lines of whole rows of text whose first stands on `line`; ends: how many line ends they have."""
    width, count = len(layout.names), ends + (not block.endswith(b"\n"))
    even = layout.separator != BLANKS and _occurrences(block, layout.separator) == count * (width - 1)
    if b'"' not in block and b"#" not in block and (even or layout.separator == BLANKS):
        decimal = "," if layout.separator != "," and b"," in block else "."
        found = _parsed(block, layout, wanted, decimal)
        if found is not None and len(next(iter(found.values()))) == count:
            return found, np.arange(line, line + count)
    lines = _text(block, name).split("\n")
    kept = [k for k, text in enumerate(lines) if text.strip() and not text.lstrip().startswith("#")]
    number = np.array(kept, dtype=np.intp) + line
    body = [lines[k] for k in kept]
    if layout.separator != ",":
        body = [re.sub(r"(?<=\d),(?=\d)", ".", text) for text in body]
    rows = [cells_of(text, layout.separator) for text in body]
    for k, row in enumerate(rows):
        if len(row) != width:
            raise error("CS0201", f"{len(row)} cells where {'the header names' if layout.header_line else 'cell.yaml has'} "
                        f"{width} columns", file=name, line=int(number[k]),
                        hint=f"cells are separated by {layout.separator!r}, taken from the first line")
    frame = pd.DataFrame({one: [row[k] for row in rows] for k, one in enumerate(layout.names) if one in wanted})
    return as_numbers(frame, name, layout.names, number), number


def _parsed(block: bytes, layout: Layout, wanted: Sequence[str], decimal: str) -> dict[str, Array] | None:
    """The block at one go; None where a cell is not a finite number."""
    place = {one: layout.names.index(one) for one in wanted}
    try:
        frame = pd.read_csv(
            io.BytesIO(block.lstrip(b" ") if layout.separator == BLANKS else block), sep=layout.separator, header=None,
            decimal=decimal, usecols=None if layout.separator == BLANKS else sorted(place.values()), dtype=np.float64,
            engine="c", na_filter=False, skipinitialspace=True, skip_blank_lines=False, low_memory=False)
    except (ValueError, pd.errors.ParserError):
        return None
    if layout.separator == BLANKS and frame.shape[1] != len(layout.names):
        return None
    found = {one: frame[k].to_numpy() for one, k in place.items()}
    return found if all(np.isfinite(values).all() for values in found.values()) else None


def as_numbers(frame: pd.DataFrame, name: str, names: Sequence[str], line: Indices) -> dict[str, Array]:
    """The columns of a frame as finite numbers, or every complaint (CS0203)."""
    numbers: dict[str, Array] = {}
    findings: list[Finding] = []
    for one in frame.columns:
        numbers[one], bad = as_floats(frame[one], empty=False)
        findings += [
            Finding("CS0203", "error", f"column '{one}': found {shown(frame[one].iloc[row])}, expected a finite number",
                    file=name, line=int(line[row]), column=list(names).index(one) + 1,
                    hint="mend the cell, or delete the row if the value is lost")
            for row in bad[:MOST_COMPLAINTS]
        ]
    if findings:
        raise CompstiffError(*sorted(findings, key=lambda finding: finding.line or 0)[:MOST_COMPLAINTS])
    return numbers


def parquet_names(path: Path) -> tuple[tuple[str, ...], int]:
    """Column names and number of rows of a Parquet file. Raises CompstiffError: CS0005, CS0201."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        file = pq.ParquetFile(path)
    except OSError as reason:
        raise error("CS0005", f"cannot be read: {reason.strerror or reason}", file=str(path)) from reason
    except pa.ArrowInvalid as reason:
        raise error("CS0201", f"is not a Parquet file: {reason}", file=str(path)) from reason
    with file:
        return tuple(file.schema_arrow.names), file.metadata.num_rows


def parquet_blocks(path: Path, names: Sequence[str], wanted: Sequence[str]) -> Iterator[tuple[dict[str, Array], Indices]]:
    """The wanted columns batch by batch; rows are counted as if a header stood above them."""
    import pyarrow.parquet as pq

    line = 2
    with pq.ParquetFile(path, pre_buffer=False) as file:
        for batch in file.iter_batches(batch_size=BATCH_ROWS, columns=list(wanted), use_threads=False):
            number = np.arange(line, line + batch.num_rows)
            numbers = {name: batch.column(name).to_numpy(zero_copy_only=False) for name in wanted}
            sound = all(values.dtype == np.float64 and np.isfinite(values).all() for values in numbers.values())
            yield numbers if sound else as_numbers(batch.to_pandas(), str(path), names, number), number
            line += batch.num_rows


def parquet_at(
    path: Path, names: Sequence[str], wanted: Sequence[str], shares: Sequence[float], rows: int
) -> Iterator[dict[str, Array]]:
    """At most `rows` rows from each of these places (0 to 1, ascending) along the file, within one row group."""
    import pyarrow.parquet as pq

    held, frame = -1, pd.DataFrame()
    with pq.ParquetFile(path, pre_buffer=False) as file:
        ends = np.cumsum([file.metadata.row_group(group).num_rows for group in range(file.num_row_groups)])
        for share in shares:
            place = int(share * max(file.metadata.num_rows - rows, 0))
            group = int(np.searchsorted(ends, place, side="right"))
            if group != held:
                held, frame = group, file.read_row_group(group, columns=list(wanted)).to_pandas()
            first = place - int(ends[group] - len(frame))
            part = frame.iloc[first:first + rows]
            yield as_numbers(part, str(path), names, np.zeros(len(part), dtype=np.intp))

"""Long tables of numbers, block by block in bounded memory: CSV in any dialect with or without a header, and Parquet.

A block is parsed at once; only one that holds comments, blank lines, quotes or a cell at fault is looked at line by line. So a
long log costs what its parser costs, and a complaint still names its line and column.
"""

from __future__ import annotations

import io
import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from identification.common.arrays import Array
from identification.common.arrow import arrow_csv, floats_of
from identification.common.cells import decoded, holds_cells, no_thousands, opened, parquet_complaints, with_decimal_points
from identification.common.findings import error
from identification.common.sizes import LARGEST_CELL
from identification.common.table_layout import BLANKS, Layout, cells_of
from identification.common.tables import as_numbers

Indices = NDArray[np.intp]
BLOCK_BYTES = 1 << 20
BATCH_ROWS = 1 << 17
_TRUTH = re.compile(rb"true|false", re.IGNORECASE)


def _occurrences(block: bytes, mark: str) -> int:
    """How often a character stands in a block: bytes.count stops at each."""
    return int(np.count_nonzero(np.frombuffer(block, np.uint8) == ord(mark)))


def text_blocks(file: Path, layout: Layout, wanted: Sequence[str]) -> Iterator[tuple[dict[str, Array], Indices]]:
    """The wanted columns and the line of each row, block by block. Raises CompstiffError: CS0201 (a row of another width, not
    text), CS0203 (not a finite number, or a mark that may be of thousands) with line and column."""
    line = layout.line
    with opened(file) as stream:
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
                yield parse_block(block, str(file), layout, wanted, line, count)
            line += count
            if not content:
                return


def text_at(file: Path, layout: Layout, wanted: Sequence[str], share: float, rows: int) -> dict[str, Array]:
    """About `rows` rows from a place `share` (0 to 1) of the way through the file."""
    with opened(file) as stream:
        size = stream.seek(0, io.SEEK_END)
        length = max((size - layout.start) // max(layout.rows, 1), 1) + 1
        stream.seek(layout.start + int(share * max(size - layout.start - rows * length, 0)))
        if share > 0:
            stream.readline()
        block = stream.read(rows * length)
    block = block[: block.rfind(b"\n") + 1].replace(b"\r\n", b"\n")
    return parse_block(block, str(file), layout, wanted, 1, _occurrences(block, "\n"))[0] if block.strip() else {}


def parse_block(
    block: bytes, name: str, layout: Layout, wanted: Sequence[str], line: int, ends: int
) -> tuple[dict[str, Array], Indices]:
    """Columns and lines of whole rows of text whose first stands on `line`; ends: how many line ends they have."""
    width, count = len(layout.names), ends + (not block.endswith(b"\n"))
    even = layout.separator != BLANKS and _occurrences(block, layout.separator) == count * (width - 1)
    if b'"' not in block and b"#" not in block and (even or layout.separator == BLANKS):
        decimal = "," if layout.separator != "," and b"," in block else "."
        numbers = _parsed(block, layout, wanted, decimal)
        if numbers is not None and len(next(iter(numbers.values()))) == count:
            return numbers, np.arange(line, line + count)
    lines = decoded(block, name).split("\n")
    # Rows without a word, as spreadsheets leave them behind a table, are none.
    marks = " \t" if layout.separator == BLANKS else f"{layout.separator} \t"
    kept = [k for k, text in enumerate(lines) if holds_cells(text) and text.strip(marks)]
    number = np.array(kept, dtype=np.intp) + line
    body = [lines[k] for k in kept]
    if layout.separator != ",":
        no_thousands(body, lambda text: cells_of(text, layout.separator), name, number.tolist(),
                     {k for k, column in enumerate(layout.names) if column in wanted})
        body = with_decimal_points(body)
    rows = [cells_of(text, layout.separator) for text in body]
    for k, row in enumerate(rows):
        if len(row) != width:
            raise error("CS0201", f"{len(row)} cells where {'the header names' if layout.header_line else 'cell.yaml has'} "
                        f"{width} columns", file=name, line=int(number[k]),
                        hint=f"cells are separated by {layout.separator!r}, taken from the first line")
    import pandas as pd

    frame = pd.DataFrame({column: [row[k] for row in rows] for k, column in enumerate(layout.names) if column in wanted})
    return as_numbers(frame, name, layout.names, number), number


def _parsed(block: bytes, layout: Layout, wanted: Sequence[str], decimal: str) -> dict[str, Array] | None:
    """The block at one go; None where a cell is not a finite number."""
    plain = _plain(block, layout, wanted, decimal)
    if plain is not None:
        return plain
    if (layout.separator != BLANKS and not _even(block, layout)) or _TRUTH.search(block):
        return None         # pandas fills short rows up, takes its columns from the first, and TRUE for 1
    import pandas as pd

    place = {column: layout.names.index(column) for column in wanted}
    try:
        frame = pd.read_csv(
            io.BytesIO(block.lstrip(b" ") if layout.separator == BLANKS else block), sep=layout.separator, header=None,
            decimal=decimal, usecols=None if layout.separator == BLANKS else sorted(place.values()), dtype=np.float64,
            engine="c", na_filter=False, skipinitialspace=True, skip_blank_lines=False, low_memory=False)
    except (ValueError, pd.errors.ParserError):
        return None
    if layout.separator == BLANKS and frame.shape[1] != len(layout.names):
        return None
    numbers = {column: frame[k].to_numpy() for column, k in place.items()}
    return numbers if all(_sound(values) for values in numbers.values()) else None


def _even(block: bytes, layout: Layout) -> bool:
    """Whether every line has as many cells as there are columns."""
    text = np.frombuffer(block.removesuffix(b"\n") + b"\n", np.uint8)
    marks, ends = (np.flatnonzero(text == ord(mark)) for mark in (layout.separator, "\n"))
    return bool((np.diff(np.searchsorted(marks, ends), prepend=0) == len(layout.names) - 1).all())


def _plain(block: bytes, layout: Layout, wanted: Sequence[str], decimal: str) -> dict[str, Array] | None:
    """The same where all is plain ASCII and the cells are numbers and no more; None where one is anything else."""
    if layout.separator == BLANKS or not block.isascii():
        return None
    import pyarrow as pa

    csv = arrow_csv()
    place = {column: str(layout.names.index(column)) for column in wanted}
    try:
        table = csv.read_csv(
            pa.BufferReader(block),
            csv.ReadOptions(use_threads=False, column_names=[str(k) for k in range(len(layout.names))],
                            block_size=max(len(block), 1)),
            csv.ParseOptions(delimiter=layout.separator, quote_char=False, ignore_empty_lines=False),
            csv.ConvertOptions(check_utf8=False, column_types=dict.fromkeys(place.values(), pa.float64()), null_values=[],
                               include_columns=list(place.values()), decimal_point=decimal))
    except pa.ArrowInvalid:
        return None
    return _all_sound({column: floats_of(table[k]) for column, k in place.items()})


def _all_sound(columns: dict[str, Array | None]) -> dict[str, Array] | None:
    """The columns, if each is one of numbers as a cell may have them."""
    numbers = {name: values for name, values in columns.items() if values is not None and _sound(values)}
    return numbers if len(numbers) == len(columns) else None


def _sound(values: Array) -> bool:
    """Whether all are finite numbers of a size that a cell may have."""
    return not len(values) or bool(values.min() >= -LARGEST_CELL and values.max() <= LARGEST_CELL)


def parquet_names(file: Path) -> tuple[tuple[str, ...], int]:
    """Column names and number of rows of a Parquet file. Raises CompstiffError: CS0005, CS0201."""
    import pyarrow.parquet as pq

    with parquet_complaints(file):
        table = pq.ParquetFile(file)
    with table:
        return tuple(table.schema_arrow.names), table.metadata.num_rows


def parquet_blocks(file: Path, names: Sequence[str], wanted: Sequence[str]) -> Iterator[tuple[dict[str, Array], Indices]]:
    """The wanted columns batch by batch; rows are counted as if a header stood above them."""
    import pyarrow.parquet as pq

    line = 2
    with parquet_complaints(file), pq.ParquetFile(file, pre_buffer=False) as table:
        for batch in table.iter_batches(batch_size=BATCH_ROWS, columns=list(wanted), use_threads=False):
            number = np.arange(line, line + batch.num_rows)
            yield _numbers_of(batch, file, names, wanted, number), number
            line += batch.num_rows


def parquet_at(
    file: Path, names: Sequence[str], wanted: Sequence[str], shares: Sequence[float], rows: int
) -> Iterator[dict[str, Array]]:
    """At most `rows` rows from each of these places (0 to 1, ascending) along the file, within one row group."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    held, table = -1, pa.table({})
    with parquet_complaints(file), pq.ParquetFile(file, pre_buffer=False) as source:
        ends = np.cumsum([source.metadata.row_group(group).num_rows for group in range(source.num_row_groups)])
        for share in shares:
            place = int(share * max(source.metadata.num_rows - rows, 0))
            group = int(np.searchsorted(ends, place, side="right"))
            if group != held:
                held, table = group, source.read_row_group(group, columns=list(wanted))
            part = table.slice(place - int(ends[group] - len(table)), rows)
            yield _numbers_of(part, file, names, wanted, np.zeros(len(part), dtype=np.intp))


def _numbers_of(
    part: Any, file: Path, names: Sequence[str], wanted: Sequence[str], line: Indices
) -> dict[str, Array]:
    """The wanted columns of a part of a Parquet file. Raises CompstiffError (CS0203)."""
    numbers = _all_sound({name: floats_of(part[name]) for name in wanted})
    return as_numbers(part.replace_schema_metadata(None).to_pandas(), str(file), names, line) if numbers is None else numbers

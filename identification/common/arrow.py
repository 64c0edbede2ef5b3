"""Arrow as it is used here: its CSV; and columns to and from it by their buffers, since its own conversions import pandas,
which takes longer than many a file."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from identification.common.arrays import Array


def arrow_csv() -> Any:
    """pyarrow.csv, which leaves Ctrl-C to this program: by itself its reader gives up at a signal, also at one that is only
    noted until the program under way is finished."""
    import pyarrow as pa
    from pyarrow import csv

    pa.enable_signal_handlers(False)
    return csv


def number_column(values: Array | NDArray[np.int64]) -> Any:
    """An Arrow array of floats or whole numbers (N,); NaN becomes null."""
    import pyarrow as pa

    whole = values.dtype.kind == "i"
    there = np.ones(len(values), dtype=bool) if whole else ~np.isnan(values)
    valid = None if there.all() else pa.py_buffer(np.packbits(there, bitorder="little"))
    content = pa.py_buffer(np.ascontiguousarray(values, dtype=np.int64 if whole else np.float64))
    return pa.Array.from_buffers(pa.int64() if whole else pa.float64(), len(values), [valid, content])


def text_column(texts: Sequence[str]) -> Any:
    """An Arrow array of texts."""
    import pyarrow as pa

    encoded = [text.encode() for text in texts]
    ends = np.cumsum([0, *map(len, encoded)]).astype(np.int64)
    return pa.Array.from_buffers(pa.large_utf8(), len(encoded), [None, pa.py_buffer(ends), pa.py_buffer(b"".join(encoded))])


def floats_of(column: Any) -> Array | None:
    """The numbers (N,) of an Arrow array or table column of numbers without nulls, as floats; None of any other."""
    import pyarrow as pa

    if not (pa.types.is_floating(column.type) or pa.types.is_integer(column.type)) or column.null_count:
        return None
    kind = np.dtype(column.type.to_pandas_dtype())
    parts = column.chunks if isinstance(column, pa.ChunkedArray) else [column]
    numbers = [np.frombuffer(part.buffers()[1], kind, len(part), kind.itemsize * part.offset) for part in parts if len(part)]
    return np.asarray(numbers[0] if len(numbers) == 1 else np.concatenate([np.empty(0), *numbers]), dtype=float)

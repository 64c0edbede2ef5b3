"""The bytes of a program: encoding, and where in the text an offset is.

Everything works on the bytes as they stand, so a rewritten program keeps its encoding, byte-order mark and line ends
by construction. Offsets are byte offsets; lines and columns are worked out only for what is reported.
"""

from __future__ import annotations

import codecs
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from identification.common.findings import CompstiffError, error

Offsets = NDArray[np.int64]

_CHUNK = 1 << 22        # bytes compared at a time, so that a large program needs no large temporary
_FEW = 1 << 13          # offsets looked up at a time, for the same reason


@dataclass(frozen=True, slots=True, eq=False)
class Source:
    """One program text.

    encoding: "utf-8" or "latin-1"; start: where the text begins, behind a byte-order mark; ends: `line_ends` of it.
    """

    data: bytes
    name: str
    encoding: str
    start: int
    ends: Offsets

    def text(self, start: int, end: int) -> str:
        return self.data[start:end].decode(self.encoding, errors="replace")

    def fold(self, word: bytes) -> str:
        """A RAPID identifier or keyword in the one spelling it is compared in (RAPID ignores case)."""
        return word.decode(self.encoding, errors="replace").lower()

    def fail(self, code: str, message: str, offset: int, hint: str = "") -> CompstiffError:
        """The error `code` at byte `offset`, to be raised."""
        line, column = locate(self, [offset])
        where: dict[str, Any] = {"file": self.name, "line": int(line[0]), "column": int(column[0]), "hint": hint}
        return error(code, message, **where)


def decode(data: bytes, name: str) -> Source:
    """Finds the encoding: UTF-8 with or without byte-order mark if the bytes are valid UTF-8, else Latin-1.

    Raises CS2001 for UTF-16 and UTF-32, which would otherwise be read as a program without a single move.
    """
    if data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        raise error("CS2001", "the file is UTF-16 text; RAPID programs are UTF-8 or Latin-1 (ISO 8859-1)", file=name,
                    line=1, column=1, hint="save the program as UTF-8 or ANSI text")
    start = len(codecs.BOM_UTF8) if data.startswith(codecs.BOM_UTF8) else 0
    try:
        if not data.isascii():
            data.decode("utf-8")
        return Source(data, name, "utf-8", start, line_ends(data))
    except UnicodeDecodeError:
        return Source(data, name, "latin-1", 0, line_ends(data))


def line_ends(data: bytes) -> Offsets:
    """Offsets just behind every line end, ascending.

    LF, CRLF, CR CR LF (RobotStudio has written it) and a lone CR each end one line. An editor that takes the extra CR
    of CR CR LF for a line of its own counts twice as many; `grep -n`, vim and the program's author count as here.
    """
    array = np.frombuffer(data, dtype=np.uint8)
    feeds = where_is(array, 10)
    returns = where_is(array, 13)
    if len(returns):
        last = len(array) - 1
        following = np.where(returns < last, array[np.minimum(returns + 1, last)], 0)
        second = np.where(returns + 1 < last, array[np.minimum(returns + 2, last)], 0)
        lone = (following != 10) & ~((following == 13) & (second == 10))
        return np.sort(np.concatenate([feeds, returns[lone]])) + 1
    return feeds + 1


def locate(source: Source, offsets: Offsets | Sequence[int]) -> tuple[Offsets, Offsets]:
    """Line and column (characters) of byte offsets, both from 1."""
    offsets = np.asarray(offsets, dtype=np.int64)
    line, column = np.empty((2, len(offsets)), dtype=np.int64)
    inner = None            # bytes within a character
    if source.encoding == "utf-8" and not source.data.isascii():
        inner = np.flatnonzero((np.frombuffer(source.data, dtype=np.uint8) & 0xC0) == 0x80)
    for at in range(0, len(offsets), _FEW):
        part = slice(at, at + _FEW)
        row = np.searchsorted(source.ends, offsets[part], side="right")
        starts = np.where(row > 0, source.ends[row - 1], source.start) if len(source.ends) else source.start
        line[part], column[part] = row + 1, np.maximum(offsets[part] - starts, 0) + 1
        if inner is not None:
            column[part] -= np.searchsorted(inner, offsets[part]) - np.searchsorted(inner, starts)
    return line, column


def where_is(array: NDArray[np.uint8], value: int) -> Offsets:
    """Where a byte stands in a text, by blocks: a mask of all of it would be as large as the text."""
    parts = [np.flatnonzero(array[at:at + _CHUNK] == value) + at for at in range(0, len(array), _CHUNK)]
    return np.concatenate(parts).astype(np.int64) if parts else np.empty(0, dtype=np.int64)

"""Converts the numbers of many robtargets at once."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from compensator.rapid.targets import WIDTH
from compensator.rapid.text import Offsets

Array = NDArray[np.float64]

_CHUNK = 1 << 15        # targets converted at a time: bounds the memory their texts take
_NOISE = b"[] \t\r\n\f\v"


def convert(data: bytes, start: Offsets, rest: Offsets, end: Offsets) -> tuple[Array, list[int]]:
    """Numbers (K, WIDTH) of K robtargets written in figures, and which of them hold text that is no number.

    start, rest, end (K,): offsets of a target, of its confdata, and behind it.
    """
    values = np.empty((len(start), WIDTH))
    bad: list[int] = []
    for at in range(0, len(start), _CHUNK):
        chunk = slice(at, at + _CHUNK)
        spans = (start[chunk].tolist(), rest[chunk].tolist(), end[chunk].tolist())
        try:
            values[chunk] = _convert(data, *spans)
        except ValueError:
            for number, span in enumerate(zip(*spans, strict=True), at):
                try:
                    values[number] = _convert(data, *([offset] for offset in span))
                except ValueError:
                    values[number] = np.nan
                    bad.append(number)
    return values, bad


def _convert(data: bytes, start: list[int], rest: list[int], end: list[int]) -> Array:
    values = np.empty((len(start), WIDTH))
    poses = [data[a:b] for a, b in zip(start, rest, strict=True)]       # each ends with a comma
    values[:, :7] = _floats(b"".join(poses), 7)
    # Configuration and external axes hardly ever change from one target to the next: each spelling is converted once.
    spellings: dict[bytes, int] = {}
    which = [spellings.setdefault(data[a:b], len(spellings)) for a, b in zip(rest, end, strict=True)]
    values[:, 7:] = _floats(_ended(spellings), WIDTH - 7)[which]
    return values


def _ended(texts: Iterable[bytes]) -> bytes:
    return b",".join(texts) + b","


def _floats(text: bytes, columns: int) -> Array:
    """Numbers (R, columns) of a text in which each is followed by a comma."""
    words = text.translate(None, _NOISE).decode("ascii").split(",")
    words.pop()
    return np.fromiter(map(float, words), np.float64, len(words)).reshape(-1, columns)

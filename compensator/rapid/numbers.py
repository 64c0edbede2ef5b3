"""Converts the numbers of many robtargets at once."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from compensator.rapid.targets import POSE, WIDTH
from compensator.rapid.text import Offsets
from identification.common.arrow import arrow_csv, floats_of

Array = NDArray[np.float64]

_CHUNK = 1 << 14        # targets converted at a time: bounds the memory their texts take
_NOISE = b"[] \t\r\n\f\v"
_LINES = bytes.maketrans(b",", b"\n")
_LONG = 1 << 15         # bytes of text from which on Arrow is worth its start


@dataclass(frozen=True, slots=True, eq=False)
class Numbers:
    """Those of K robtargets: pose (K, 7), x y z [mm] and q1..q4; and configuration and external axes, which hardly ever change
    from one target to the next: each set of them once in settings (S, 10), and which of them setting (K,) each target has."""

    pose: Array
    settings: Array
    setting: NDArray[np.int32]

    @classmethod
    def of(cls, values: Array) -> Numbers:
        """Out of all numbers (K, WIDTH) of each."""
        return cls(values[:, :POSE], values[:, POSE:], np.arange(len(values), dtype=np.int32))

    def __getitem__(self, row: int) -> list[float]:
        """All numbers (WIDTH) of one target."""
        return [*self.pose[row].tolist(), *self.settings[self.setting[row]].tolist()]

    def and_then(self, others: Numbers) -> Numbers:
        """These, and others behind them."""
        if not len(others.pose):
            return self
        return Numbers(np.concatenate([self.pose, others.pose]), np.concatenate([self.settings, others.settings]),
                       np.concatenate([self.setting, others.setting + np.int32(len(self.settings))]))


def convert(data: bytes, start: Offsets, rest: Offsets, end: Offsets) -> tuple[Numbers, list[int]]:
    """Numbers of K robtargets written in figures, and which of them hold text that is no number: those have none.

    start, rest, end (K,): offsets of a target, of its confdata, and behind it.
    """
    pose, setting, bad = np.empty((len(start), POSE)), np.empty(len(start), dtype=np.int32), set[int]()
    settings, spellings, unsound, count = [np.empty((0, WIDTH - POSE))], dict[bytes, int](), list[int](), 0
    for at in range(0, len(start), _CHUNK):
        chunk = slice(at, at + _CHUNK)
        spans = [offsets[chunk].tolist() for offsets in (start, rest, end)]
        pose[chunk], wrong = _rows([data[a:b] for a, b in zip(*spans[:2], strict=True)], b"", POSE)    # each ends with a comma
        if len(spellings) > _CHUNK:     # they do change
            spellings = {}
        known = len(spellings)
        first = count - known
        setting[chunk] = [spellings.setdefault(data[a:b], first + len(spellings)) for a, b in zip(*spans[1:], strict=True)]
        more, wrong_settings = _rows(list(spellings)[known:], b",", WIDTH - POSE)
        settings.append(more)
        unsound += [count + number for number in wrong_settings]
        count += len(more)
        bad.update(at + number for number in wrong)
    bad.update(np.flatnonzero(np.isin(setting, unsound)).tolist() if unsound else ())
    return Numbers(pose, np.concatenate(settings), setting), sorted(bad)


def _rows(texts: list[bytes], end: bytes, columns: int) -> tuple[Array, list[int]]:
    """Numbers (R, columns) of texts in which each number is followed by a comma, the last one by `end`; and the texts that hold
    anything else, whose numbers are NaN."""
    try:
        return _floats(end.join(texts) + end, columns), []
    except ValueError:
        values, bad = np.full((len(texts), columns), np.nan), []
    for number, text in enumerate(texts):
        try:
            values[number] = _floats(text + end, columns)
        except ValueError:
            bad.append(number)
    return values, bad


def _floats(text: bytes, columns: int) -> Array:
    """Numbers (R, columns) of a text in which each is followed by a comma. Raises ValueError where one is none."""
    values = _by_arrow(text) if len(text) > _LONG else None
    if values is None:
        words = text.translate(None, _NOISE).decode("ascii").split(",")
        words.pop()
        values = np.fromiter(map(float, words), np.float64, len(words))
    return values.reshape(-1, columns)


def _by_arrow(text: bytes) -> Array | None:
    """The same numbers, to the last bit, in less than half the time; None where Arrow does not take all for numbers."""
    import pyarrow as pa

    csv = arrow_csv()
    try:
        table = csv.read_csv(
            pa.BufferReader(text.translate(_LINES, _NOISE)),
            csv.ReadOptions(use_threads=False, column_names=["number"], block_size=len(text)),
            csv.ParseOptions(quote_char=False, ignore_empty_lines=False),
            csv.ConvertOptions(check_utf8=False, column_types={"number": pa.float64()}, null_values=[]))
    except pa.ArrowInvalid:
        return None
    return floats_of(table["number"])

"""Columns that slipped in the table: readings or forces that stand a row too low or too high, angles a pose.

One cell that was left out or pasted twice moves all below it. Of every run of rows that slipped the first or the last has lost
what belongs to it: it is left without a reading.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from identification.fit.load_test import LoadTest
from identification.fit.mistakes.mistake import Mistake, table_mistake

Array = NDArray[np.float64]
Rows = NDArray[np.intp]
SETTLES = "hold the first and the last rows of the table against the sheet that was written at the robot"
DIRECTIONS = ((1, "low"), (-1, "high"))
# Loads that differ by less than this share are the same.
ALIKE = 0.02
# Source of each row (n,), -1 where it is lost.
Sources = Callable[[LoadTest], Rows]


def slipped_mistakes(data: LoadTest) -> list[Mistake]:
    """Those that the rows have room for: more than two rows, and poses."""
    found, visits = [], _lengths(data)
    for (by, words), (_, opposite) in zip(DIRECTIONS, DIRECTIONS[::-1], strict=True):
        if len(data.rows) > 2:
            same = _begin_or_end_alike(data)
            others = f", or the forces a row too {opposite}" if same else ""
            found.append(_slipped("deflection", f"the readings seem to stand a row too {words}{others}", _next_row(by), by))
            if not same:
                found.append(_slipped("wrench", f"the forces seem to stand a row too {words}", _next_row(by), by))
        if len(visits) > 2 and len(data.rows) > len(visits):
            alike = _loaded_alike(data, visits)
            others = f", or the forces with their readings a pose too {opposite}" if alike else ""
            found.append(_slipped("theta", f"the joint angles seem to stand a pose too {words}{others}", _next_visit(by), by))
            if len(set(visits)) == 1 and not alike:
                rows = by * visits[0]
                found.append(_slipped("deflection", f"the readings seem to stand a pose too {words}", _next_row(rows), rows))
    return found


def _begin_or_end_alike(data: LoadTest) -> bool:
    """Whether each visit begins, or each ends, with the same load: it is the same to the others which of the two slipped."""
    rows = data.rows
    first = np.unique(rows.visit, return_index=True)[1]
    last = np.append(first[1:], len(rows)) - 1
    return len(first) < len(rows) and any(
        np.allclose(rows.wrench[ends], rows.wrench[ends[:1]], rtol=ALIKE, atol=0.01) for ends in (first, last))


def _loaded_alike(data: LoadTest, lengths: list[int]) -> bool:
    """Whether the same loads stand at each visit."""
    if len(set(lengths)) > 1:
        return False
    wrench = data.rows.wrench.reshape(len(lengths), lengths[0], 6)
    return bool(np.allclose(wrench, wrench[:1], rtol=ALIKE, atol=0.01))


def _slipped(quantity: str, words: str, sources: Sources, by: int) -> Mistake:
    def change(data: LoadTest) -> dict[str, Array]:
        """What belongs to each row; no reading where that is lost, while the rest stays as it is."""
        source = sources(data)
        lost = source < 0
        moved = np.where(lost[:, None], getattr(data.rows, quantity), getattr(data.rows, quantity)[source])
        deflection = moved if quantity == "deflection" else data.rows.deflection
        return {quantity: moved, "deflection": np.where(lost[:, None], np.nan, deflection)}

    key = {"deflection": "readings", "wrench": "forces", "theta": "joints"}[quantity]
    return table_mistake(f"{key}_slipped[{by:+d}]", f"{words}, in {{rows}}", SETTLES, change, from_a_row=True)


def _next_row(by: int) -> Sources:
    """The row so many further down."""
    def sources(data: LoadTest) -> Rows:
        source = np.arange(len(data.rows)) + by
        return np.where((source >= 0) & (source < len(source)), source, -1)

    return sources


def _next_visit(by: int) -> Sources:
    """The first row of the visit so many further down."""
    def sources(data: LoadTest) -> Rows:
        _, first, number = np.unique(data.rows.visit, return_index=True, return_inverse=True)
        wanted = number + by
        there = (wanted >= 0) & (wanted < len(first))
        return np.where(there, first[np.where(there, wanted, 0)], -1)

    return sources


def _lengths(data: LoadTest) -> list[int]:
    """How many rows each visit has."""
    return [int(count) for count in np.unique(data.rows.visit, return_counts=True)[1]]

"""Mistake: one that people make in the table or in the cell file, and how to mend it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from identification.fit.load_test import LoadTest
from identification.measurements import Measurements

Array = NDArray[np.float64]
# Columns of numbers that a mistake may spoil.
NUMBERS = ("theta", "wrench", "deflection", "sigma", "time", "dwell")


def _unscaled() -> Array:
    return np.ones(3)


@dataclass(frozen=True, eq=False)
class Mistake:
    """key: its name in diagnosis.json. sentence: in plain words, {rows} for the rows it holds for. settles: what would tell
    for sure. of: the file it stands in. change: the data without it. usual: one of those that are met every week. scale (3,):
    by how much the readings of each axis grow when it is mended. in_part: made in a part of the rows alone; in all of them
    it is another matter (units.py). from_a_row: it may begin in the middle of a visit. like_physics: what mends it may do what
    a large cause does, too."""

    key: str
    sentence: str
    settles: str
    of: Literal["table", "cell"]
    change: Callable[[LoadTest], LoadTest]
    usual: bool = True
    scale: Array = field(default_factory=_unscaled)
    in_part: bool = False
    from_a_row: bool = False
    like_physics: bool = False

    def mended(self, data: LoadTest, rows: NDArray[np.bool_] | None = None) -> LoadTest:
        """The data without the mistake, in these rows (n,) alone where they are given."""
        if rows is None:
            return self.change(data)
        return data.with_rows(_merged(data.rows, self.change(data.with_rows(data.rows.select(rows))).rows, rows))


def table_mistake(
    key: str, sentence: str, settles: str, change: Callable[[LoadTest], dict[str, Any]], *, usual: bool = True,
    scale: Array | None = None, in_part: bool = False, from_a_row: bool = False,
) -> Mistake:
    """A mistake in columns of the table; change: the mended columns, by their names in Measurements."""
    def mend(data: LoadTest) -> LoadTest:
        columns: dict[str, Any] = dict(change(data))
        return data.with_rows(replace(data.rows, **columns))

    return Mistake(key, sentence, settles, "table", mend, usual, _unscaled() if scale is None else scale, in_part, from_a_row)


def _merged(table: Measurements, mended: Measurements, rows: NDArray[np.bool_]) -> Measurements:
    """The table with these rows (n,) as they were mended."""
    columns: dict[str, Any] = {name: getattr(table, name).copy() for name in NUMBERS}
    for name, values in columns.items():
        values[rows] = getattr(mended, name)
    return replace(table, **columns)

"""Zeros that somebody typed, or a machine wrote, where nothing was measured: they pass for a perfect part."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from identification.common.arrays import Array
from identification.common.findings import Finding
from identification.common.tables import Table

# So many rows, and this share of all, that are exactly 0 are over three times what chance makes of a finer step; rows that are
# next to 0 without being it are fewer than this share of them (engineering judgement).
FEWEST, SHARE, TIMES, NEXT = 4, 0.02, 3.0, 1 / 3


def typed_zeros(values: Array, sigma: Array) -> NDArray[np.bool_]:
    """Rows (N,) of values (N, C), NaN where nothing was measured, all of whose numbers are exactly 0, where these are too many
    for readings with the noise sigma (N, C); else none. Nothing is said of a table that is rounded coarser than its noise."""
    measured = ~np.isnan(values)
    size = np.abs(np.nan_to_num(values))
    zero: NDArray[np.bool_] = measured.any(axis=1) & (size == 0).all(axis=1)
    none = np.zeros_like(zero)
    steps = np.diff(np.unique(size[measured]))
    if zero.sum() < max(FEWEST, SHARE * len(zero)) or not len(steps):
        return none
    step = float(steps.min())
    # Of a normal reading, how likely the step about 0 is; of several together.
    likely = np.where(measured, np.minimum(0.4 * step / sigma, 1.0), 1.0)
    by_chance = float(np.sum(np.prod(likely[measured.any(axis=1)], axis=1)))
    beside = measured.any(axis=1) & ~zero & (size <= 1.5 * step).all(axis=1)
    return zero if zero.sum() > TIMES * by_chance and beside.sum() < NEXT * zero.sum() else none


def said_of_zeros(table: Table, values: Array, sigma: Array) -> list[Finding]:
    """A warning (CS6047) with the line of the first."""
    rows = typed_zeros(values, sigma)
    if not rows.any():
        return []
    return [Finding("CS6047", "warning", f"{int(rows.sum())} of {len(rows)} readings are exactly 0: no part is so right, to "
                    "the last digit, at so many places", file=table.source, line=int(table.line[np.argmax(rows)]),
                    hint="was 0 written where nothing was measured? Leave these cells empty")]

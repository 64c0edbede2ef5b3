"""A share of a very long load test: as many rows as a diagnosis needs, so that memory and time do not grow with the file.

The dictionary holds every suspected effect in every row. Two thousand rows tell all that is of any use for a correction; of
more, whole visits are taken evenly over the file, since the history of a load must stay whole. Where the visits themselves
are that long, rows are taken evenly from each, and those at which the load turns: only there does a gear's friction turn round.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from identification.measurements import Measurements

# Rows that are looked at, and visits that are left of a file of long ones.
MOST_ROWS = 2000
FEWEST_VISITS = 40


@dataclass(frozen=True)
class Share:
    """Rows that are looked at, of how many."""

    rows: int
    of: int


def share_of(measurements: Measurements) -> tuple[Measurements, Share | None]:
    """The rows to look at, in their order: all where they are few. Validate rows stay."""
    fitted = ~measurements.validate
    count = int(fitted.sum())
    if count <= MOST_ROWS:
        return measurements, None
    visits, number = np.unique(measurements.visit[fitted], return_inverse=True)
    every = max(1, min(-(-count // MOST_ROWS), len(visits) // FEWEST_VISITS))
    chosen = np.flatnonzero(fitted)[number % every == 0]
    if len(chosen) > MOST_ROWS:
        mask = np.zeros(len(measurements), dtype=bool)
        mask[chosen] = True
        chosen = chosen[_evenly(measurements.select(mask))]
    kept = ~fitted
    kept[chosen] = True
    return measurements.select(kept), Share(len(chosen), count)


def _evenly(rows: Measurements) -> NDArray[np.bool_]:
    """Rows (n,) evenly over each visit, its first and last ones, and those at which a component of the load turns."""
    step = -(-2 * len(rows) // MOST_ROWS)
    starts = np.flatnonzero(np.concatenate([[True], np.diff(rows.visit) != 0]))
    place = np.arange(len(rows)) - np.repeat(starts, np.diff([*starts, len(rows)]))
    change = np.sign(np.diff(rows.wrench[:, :3], axis=0))
    # A load that is held for some rows goes on as it went before.
    change = np.take_along_axis(change, np.maximum.accumulate(
        np.where(change != 0, np.arange(len(change))[:, None], 0), axis=0), axis=0)
    turns = np.zeros(len(rows), dtype=bool)
    turns[1:-1] = np.any(change[1:] * change[:-1] < 0, axis=1)
    ends = np.zeros(len(rows), dtype=bool)
    ends[starts] = True
    ends[np.concatenate([starts[1:], [len(rows)]]) - 1] = True
    kept = (place % step == 0) | ends
    # Noise turns at every row: then turns are no history.
    return np.asarray(kept | turns if turns.sum() < MOST_ROWS // 2 else kept)

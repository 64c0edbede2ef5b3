"""Beside the air: where the tool touches the stock, or leaves it, between two targets the line between them must not cut.

A target in the air is not moved, and mostly one is added where the tool touches (needed_targets.py). Where the program has one
of its own that stands nearer to that place than two targets may, none can be, and the line to the first corrected target begins
in the air: there the tool is off the plan by its correction, into the stock, where it had stood on the plan without. Where that
is by more than the tolerance, where the log last shows air, the first corrected target, or the last, goes so far only that it
is by one sigma of the target's own deviation; what the target does not get is left as stock until the next one. What the
scatter of the log explains there is no air for certain: a force that fades falls under what the log shows before it is none.
With a part learned the tool stood off the plan in the air too, and the line takes it nearer: nothing is held then. Nor where no
target can be added to the move at all, as of a loop, and less than half of it is air: that would leave all of the move for a
little at its end; CS3091 says what is left.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from compensator.correction.grid_forces import place_of
from compensator.correction.intermediate_targets import LookedAt
from compensator.correction.needed_targets import SIGMAS
from compensator.correction.restraint import TINY
from identification.common.arrays import Array

Indices = NDArray[np.intp]
# Along a move to which no target can be added, so much of it is air before the other end is held for that.
MOST = 0.5


def air_beside(looked_at: LookedAt | None, targets: Indices) -> Array:
    """At the corrected targets (M,) of the program: which share of the way from a neighbour in the air the log shows to be
    air, the larger of both sides; 0 beside no air, where the line is off there by no more than the log's scatter explains, and
    where nothing was looked at."""
    share = np.zeros(len(targets))
    if looked_at is None:
        return share
    at, number = looked_at.at, looked_at.number
    placed, place = looked_at.fine.forces, place_of(looked_at.fine.path)
    air = ~placed.forced & (placed.samples > 0)
    corrected = np.isin(number, targets)
    yields = np.zeros(len(place))
    yields[looked_at.fine.targets] = np.linalg.norm(looked_at.fine.prediction.position, axis=1)
    for side, beside in ((1, -1), (-1, 1)):     # air behind a target's back, and before it
        here = np.flatnonzero(corrected)
        other = here + beside
        here, other = (ends[(other >= 0) & (other < len(at))] for ends in (here, other))
        pairs = (number[here] + beside == number[other]) & ~corrected[other] & air[at[other]]
        for one, from_air in zip(here[pairs].tolist(), other[pairs].tolist(), strict=True):
            way = np.arange(at[from_air], at[one] + side, side)
            last = way[int(np.argmin(np.append(air[way[:-1]], False))) - 1]
            refined = (looked_at.grid.crowded | looked_at.grid.divisible)[way[1:-1]].any()
            q = abs(place[last] - place[way[0]]) / max(abs(place[way[-1]] - place[way[0]]), TINY)
            if (refined or q > MOST) and q * yields[at[one]] > SIGMAS * looked_at.noise[last]:
                row = int(np.searchsorted(targets, number[one]))
                share[row] = max(share[row], q)
    return share


def held_beside_air(offset: Array, share: Array, sigma: Array, tolerance: float) -> Array:
    """The offsets (M, 3) [m], made shorter where a `share` (M,) of the line to the target is air and the tool would be off by
    more than the tolerance [m] there: so that it is by `sigma` (M,) [m] at most."""
    size = share * np.linalg.norm(offset, axis=1)
    held = np.where(size > tolerance, np.minimum(1.0, sigma / np.maximum(size, TINY)), 1.0)
    return np.asarray(offset * held[:, None])

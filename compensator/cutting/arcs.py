"""Where a cut begins and ends on the front of a cutter: where one of the distances to the edges of what stands passes zero."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from compensator.cutting.chips import integrals
from identification.common.arrays import Array

# A film thinner than this is none [m]: the grid's error at an edge that the cutter itself left is c^2 / 8R, 0.6 um for a grid
# of 0.2 mm and a radius of 8 mm.
FILM = 2e-6


@dataclass(frozen=True, eq=False)
class Arcs:
    """Where M places cut: place (n,), from begin to stop (n,) [rad]; integral (M, 5) over all of a place."""

    place: NDArray[np.intp]
    begin: Array
    stop: Array
    integral: Array


def arcs_of(distances: tuple[Array, ...], angle: Array) -> Arcs:
    """Which places cut, from where to where. distances, each (M, P) [m]: how far points of the front, at angles (M, P), are
    within what the blank, and what each of the ways before, leaves; cut is where it is within all. Each passes zero by itself:
    the least of two has a bend where they meet, and no straight line ends it rightly."""
    first, last = (np.stack(distances)[:, :, some] - FILM for some in (slice(None, -1), slice(1, None)))
    place, piece = np.nonzero(((first > 0) | (last > 0)).all(axis=0))
    a, b = first[:, place, piece], last[:, place, piece]
    low, high = angle[place, piece], angle[place, piece + 1]
    share = np.maximum(a, b) / np.maximum(np.abs(a - b), 1e-15) * (high - low)
    begin = np.where(a > 0, low, high - share).max(axis=0)
    stop = np.where(b > 0, high, low + share).min(axis=0)
    some = begin < stop
    place, begin, stop = place[some], begin[some], stop[some]
    integral = integrals(begin, stop)
    summed = np.column_stack([np.bincount(place, column, minlength=len(angle)).astype(float) for column in integral.T])
    return Arcs(place, begin, stop, summed)

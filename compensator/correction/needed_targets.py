"""Of the points of a fine grid those that a program needs, so that lines and arcs between them follow the deviation."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from compensator.correction.fine_grid import ARC_PIECES, Grid
from compensator.path.arc_length import circle

Array = NDArray[np.float64]
Indices = NDArray[np.intp]
Mask = NDArray[np.bool_]


def windows(place: Array, at: Indices) -> tuple[Indices, Indices]:
    """The stretch of points, first to before last, that each point `at` stands for: half the way to its nearer neighbour on
    either side, so that the mean over it is what is there even where the values rise. place (G,) [m] ascending."""
    here = place[at]
    gap = np.diff(here)
    half = 0.5 * np.minimum(np.append(gap, 0.0), np.insert(gap, 0, 0.0))
    first = np.minimum(np.searchsorted(place, here - half, side="left"), at)
    last = np.maximum(np.searchsorted(place, here + half, side="right"), at + 1)
    narrow = half == 0
    return np.where(narrow, at, first), np.where(narrow, at + 1, last)


def window_means(values: Array, weight: Array, first: Indices, last: Indices, at: Indices) -> Array:
    """Weighted means (K, n) of values (G, n) over the windows; the point's own value where nothing has weight."""
    total = np.concatenate([np.zeros((1, values.shape[1])), np.cumsum(weight[:, None] * values, axis=0)])
    mass = np.concatenate([[0.0], np.cumsum(weight)])
    size = (mass[last] - mass[first])[:, None]
    return np.where(size > 0, (total[last] - total[first]) / np.where(size > 0, size, 1.0), values[at])


def needed_points(deviation: Array, allowed: Array, length: Array, weight: Array, own: Mask, may: Mask) -> Mask:
    """Which points (G,) a path needs so that straight lines between them follow the deviation to what is allowed.

    deviation (G, 3) [m] at path lengths (G,) [m], weight (G,) of each in means over `windows`; own (G,): there from the start;
    may (G,): can be added. Each round adds the worst point between two neighbours.
    """
    have = own.copy()
    place = np.maximum.accumulate(np.nan_to_num(length))
    while True:
        at = np.flatnonzero(have)
        value = window_means(deviation, weight, *windows(place, at), at)
        line = np.column_stack([np.interp(place, place[at], value[:, axis]) for axis in range(3)])
        excess = np.where(may & ~have, np.linalg.norm(line - deviation, axis=1) - allowed, -np.inf)
        worst = np.maximum.reduceat(excess, at)
        if not (worst > 0).any():
            return have
        gap = np.cumsum(have) - 1
        have |= (excess > 0) & (excess == worst[gap])


def arc_parts(grid: Grid, vias: Indices, wanted: Array, allowed: Array) -> dict[int, int]:
    """Into how many arcs each half of a MoveC must be cut, by its circle point, where the corrected arc alone is not enough.

    vias (V,): the circle points of the program; wanted (G, 3) [m] corrected positions of the grid's points; allowed (G,) [m].
    """
    parts: dict[int, int] = {}
    for via in vias:
        if not (grid.owner == via).any():       # a short arc, or one that does not stand by itself
            continue
        first = grid.kept[via - 1]
        point, room = (values[first:first + 2 * ARC_PIECES + 1] for values in (wanted, allowed))
        if np.isinf(room).any():
            continue
        for count in (0, 1, 2, 4):
            step = 2 * ARC_PIECES if count == 0 else ARC_PIECES // count
            pieces = [slice(i, i + step + 1) for i in range(0, 2 * ARC_PIECES, step)]
            if all(_off_circle(point[piece]) <= room[piece].min() for piece in pieces):
                break
        if count:
            parts[int(via)] = count
    return parts


def _off_circle(points: Array) -> float:
    """Largest distance [m] of points (n, 3) from the circle through the first, the middle and the last of them."""
    start, middle, end = points[0], points[len(points) // 2], points[-1]
    straight, centre, axis = circle(start[None], middle[None], end[None])
    if straight[0]:
        along = (end - start) / max(float(np.linalg.norm(end - start)), 1e-12)
        off = (points - start) - ((points - start) @ along)[:, None] * along
        return float(np.linalg.norm(off, axis=1).max())
    radius = points - centre[0]
    height = radius @ axis[0]
    across = np.linalg.norm(radius - height[:, None] * axis[0], axis=1) - np.linalg.norm(start - centre[0])
    return float(np.hypot(across, height).max())

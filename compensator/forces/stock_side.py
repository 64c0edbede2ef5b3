"""On which side of the tool the stock stands, by the order of the passes: where the tool has been the stock is gone, where it
comes later it still stands. A pass between an earlier and a later one climbs, or is conventional, whatever a log says."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from identification.common.arrays import Array

Indices = NDArray[np.intp]
# Another pass is looked for so far away [m]; a point of it stands beside the tool where it is so much more to the side than
# ahead or above; and it is another pass where the way to it along the path is so many times the distance.
REACH, AHEAD, ABOVE, DETOUR = 12e-3, 0.3, 0.5, 3.0
# So many places, evenly along the path, are looked at; places nearer to each other than this [m] are one.
PLACES, APART = 400, 0.5e-3


def stock_side(point: Array, length: Array, feed: Array, left: Array, up: Array) -> Indices:
    """1 where the stock is on the right of the feed (the tool climbs), -1 on the left (conventional), 0 where the passes do not
    tell it: (n,) of the moves that cut, whose ends are at point (n, 3) [m] and path length (n,) [m], ascending; feed, left and
    up (n, 3) unit vectors."""
    side = np.zeros(len(point), dtype=np.intp)
    if not np.isfinite(length).all():
        return side
    kept = np.flatnonzero(np.diff(np.floor(length / APART), prepend=-1.0) > 0)
    # In the order of the longest axis those within reach stand together.
    longest = int(np.argmax(np.ptp(point[kept], axis=0)))
    ordered = kept[np.argsort(point[kept, longest], kind="stable")]
    there = np.ascontiguousarray(point[ordered].T)
    looked = kept[np.unique(np.linspace(0, len(kept) - 1, PLACES).astype(np.intp))]
    first, last = (np.searchsorted(there[longest], point[looked, longest] + by) for by in (-REACH, REACH))
    for i, start, end in zip(looked, first, last, strict=True):
        x, y, z = (axis[start:end] - at for axis, at in zip(there, point[i], strict=True))
        others = np.sort(ordered[start:end][x * x + y * y + z * z < REACH**2])
        away = point[others] - point[i]
        distance = np.linalg.norm(away, axis=1)
        ahead, aside, above = np.abs(away @ feed[i]), away @ left[i], np.abs(away @ up[i])
        beside = ((ahead < AHEAD * np.abs(aside) + APART) & (above < ABOVE * np.abs(aside))
                  & (np.abs(length[others] - length[i]) > DETOUR * distance) & (distance > 0))
        times = []
        for sign in (1.0, -1.0):
            these = np.flatnonzero(beside & (sign * aside > 0))
            times.append(0.0 if not len(these) else
                         np.sign(length[others[these[np.argmin(distance[these])]]] - length[i]))
        if times[0] * times[1] < 0:
            side[i] = int(times[1])
    return side

"""Of the points of a fine grid those that a program needs, so that lines and arcs between them follow the deviation."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from compensator.correction.fine_grid import FULL, Grid
from compensator.path.arc_length import circle

Array = NDArray[np.float64]
Indices = NDArray[np.intp]
Mask = NDArray[np.bool_]
# What may be scatter does not count: so many sigmas of a point, or of the mean over so many neighbours on either side.
# Where they are less than this share of the tolerance no mean is needed.
SIGMAS, HALVES, ENOUGH = 3.0, (1, 4, 13, 40), 0.25


@dataclass(frozen=True, eq=False)
class Wanted:
    """What the points (G,) of a grid ask for. deviation (G, 3) [m], resting frame (external_axes.py); own (G, 3) [m]: that of
    the program's own targets under the mean force of half their moves. tolerance [m]; noise (G,) [m]: 1 sigma of the deviation,
    from the scatter of the force; slope [m/m]: the steepest change that is made between targets; known (G,): there is something
    to follow; forced (G,): a force, without which a target stays where it is. place (G,) [m] along the path, ascending;
    weight (G,) in means; position (G, 3) [m] as planned; closest (G,) [m]: how near to another target a further one may stand;
    corner (G,): targets at sharp corners, to and from which any step is made."""

    deviation: Array
    own: Array
    tolerance: float
    noise: Array
    slope: float
    known: Mask
    forced: Mask
    place: Array
    weight: Array
    position: Array
    closest: Array
    corner: Mask


def windows(place: Array, at: Indices) -> tuple[Indices, Indices]:
    """The stretch of points, first to before last, that each point `at` stands for: half the way to its nearer neighbour on
    either side, alike on both, so that the mean over it is what is there even where the values rise. place (G,) [m] ascending.
    """
    here = place[at]
    gap = np.diff(here)
    # A point half way between two belongs to neither.
    half = (0.5 - 1e-6) * np.minimum(np.append(gap, 0.0), np.insert(gap, 0, 0.0))
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


def untouched(own: Mask, at: Indices) -> Mask:
    """Which of the points `at` (K,) are the program's own with none but its own beside them: they keep their own mean."""
    mine = own[at]
    return np.asarray(mine & np.append(mine[1:], True) & np.insert(mine[:-1], 0, True))


def needed_points(grid: Grid, wanted: Wanted) -> tuple[Mask, Indices]:
    """The points (G,) that a program needs, its own among them, so that straight lines and arcs between them follow the
    deviation to what is allowed; and its arcs (P, 2), each by its first point and the points to its circle point.

    Each round adds the worst point between two neighbours, and halves the arcs that are too coarse.
    """
    own = ~grid.further
    have, arcs = own.copy(), grid.arcs.copy()
    have[arcs.sum(axis=1)] = True
    followed = wanted.position - wanted.deviation
    while True:
        at = np.flatnonzero(have)
        value = window_means(wanted.deviation, wanted.weight, *windows(wanted.place, at), at)
        alone = untouched(own, at)
        value[~wanted.forced[at]] = 0.0
        value[alone] = wanted.own[at[alone]]
        line = np.column_stack([np.interp(wanted.place, wanted.place[at], value[:, axis]) for axis in range(3)])
        missing = np.where(wanted.known[:, None], line - wanted.deviation, 0.0)
        off = beyond_noise(missing, wanted.noise, ENOUGH * wanted.tolerance)
        before = np.cumsum(have) - 1
        free = grid.may & wanted.known & ~have & _apart(wanted, at, before) & ~_too_steep(wanted, at, value, before)
        excess = np.where(free, off - wanted.tolerance, -np.inf)
        worst = np.maximum.reduceat(excess, at)
        coarse = _coarse(grid, wanted, arcs, wanted.position - line, followed)
        if not (worst > 0).any() and not coarse.any():
            have[at[_idle(grid, wanted, arcs, at, value)]] = False
            return have, arcs
        chosen = np.flatnonzero((excess > 0) & (excess == worst[before]))
        have[chosen[np.unique(before[chosen], return_index=True)[1]]] = True
        first, step = arcs[coarse, 0], arcs[coarse, 1]
        arcs = np.concatenate([arcs[~coarse], np.column_stack([first, step // 2]), np.column_stack([first + step, step // 2])])
        have[arcs.sum(axis=1)] = True


def _idle(grid: Grid, wanted: Wanted, arcs: Indices, at: Indices, value: Array) -> Mask:
    """Which of the points `at` (K,) that were added stay where they are, values (K, 3) of nothing, between points that do so
    too: a force that leaves at once had asked for them, until its own target stood in the air. None of an arc, and none beside
    a target that would be moved were it alone."""
    still = ~value.any(axis=1)
    left_alone = still & ~(~grid.further[at] & wanted.own[at].any(axis=1))
    bent = np.unique(arcs[:, :1] + arcs[:, 1:] * np.arange(3))
    return np.asarray(still & grid.further[at] & ~np.isin(at, bent) & np.append(left_alone[1:], False)
                      & np.insert(left_alone[:-1], 0, False))


def _apart(wanted: Wanted, at: Indices, before: Indices) -> Mask:
    """Points (G,) that stand far enough from the targets `at` (K,) before and behind them; before (G,): the former's number."""
    behind = np.minimum(before + 1, len(at) - 1)
    here, least = wanted.place, FULL * wanted.closest
    return np.asarray((here - here[at[before]] >= least) & ((here[at[behind]] - here >= least) | (behind == before)))


def _too_steep(wanted: Wanted, at: Indices, value: Array, before: Indices) -> Mask:
    """Points (G,) from which the way to the target before or behind them would be steeper than the slope, in any coordinate:
    the correction would be held back there. at (K,): the targets, values (K, 3) theirs; before (G,): number of the one before.
    """
    steep = np.zeros(len(before), dtype=bool)
    if np.isfinite(wanted.slope):
        for number in (before, np.minimum(before + 1, len(at) - 1)):
            change = np.abs(wanted.deviation - value[number]).max(axis=1)
            steep |= ~wanted.corner[at[number]] & (change > wanted.slope * np.abs(wanted.place - wanted.place[at[number]]))
    return steep


def _coarse(grid: Grid, wanted: Wanted, arcs: Indices, commanded: Array, followed: Array) -> Mask:
    """The arcs (P,) that can be halved and are off what is wanted, commanded (G, 3) and followed (G, 3) [m] being the corrected
    points of the grid with the points there are, and with all."""
    if not len(arcs):
        return np.zeros(0, dtype=bool)
    first, step = arcs.T
    count = 2 * step + 1
    piece = np.repeat(np.arange(len(arcs)), count)
    point = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count) + first[piece]
    off = off_circles(commanded[first], commanded[first + step], commanded[first + 2 * step], piece, followed[point])
    seen = beyond_noise(np.where(wanted.known[point, None], off, 0.0), wanted.noise[point],
                        ENOUGH * wanted.tolerance)
    over = (seen > wanted.tolerance) & wanted.known[point] & grid.further[point]
    return np.asarray((np.bincount(piece, over) > 0) & (step > 1) & grid.divisible[first + step])


def off_circles(start: Array, via: Array, end: Array, which: Indices, points: Array) -> Array:
    """Points (n, 3) seen from the nearest place (n, 3) of the circle `which` (n,) of those through start, via and end (P, 3);
    of the line where these are in line."""
    straight, centre, axis = circle(start, via, end)
    along = (end - start) / np.maximum(np.linalg.norm(end - start, axis=1), 1e-12)[:, None]
    from_start = points - start[which]
    beside = from_start - np.einsum("ni,ni->n", from_start, along[which])[:, None] * along[which]
    safe = np.where(straight[:, None], start, centre)
    radius = points - safe[which]
    height = np.einsum("ni,ni->n", radius, axis[which])[:, None] * axis[which]
    flat = radius - height
    size = np.linalg.norm(flat, axis=1)
    across = (1 - np.linalg.norm(start - safe, axis=1)[which] / np.maximum(size, 1e-12))[:, None] * flat
    return np.asarray(np.where(straight[which, None], beside, across + height))


def beyond_noise(off: Array, noise: Array, enough: float) -> Array:
    """How far points (n,) in order are off for certain, off (n, k) [m] with 1 sigma (n,) [m] of each: less SIGMAS of it, and
    where these are over `enough` [m], the largest over means of more and more neighbours, less SIGMAS of the mean's sigma."""
    sum_off = np.concatenate([np.zeros((1, off.shape[1])), np.cumsum(off, axis=0)])
    sum_square = np.concatenate([[0.0], np.cumsum(noise**2)])
    number, count = np.arange(len(off)), len(off)
    unsure = SIGMAS * noise
    certain = np.linalg.norm(off, axis=1) - unsure
    for half in HALVES:
        wanting = unsure > enough
        if not wanting.any():
            break
        first, last = np.maximum(number - half, 0), np.minimum(number + half + 1, count)
        size = last - first
        mean = np.linalg.norm(sum_off[last] - sum_off[first], axis=1) / size
        unsure = np.where(wanting, SIGMAS * np.sqrt(np.maximum(sum_square[last] - sum_square[first], 0.0)) / size, unsure)
        certain = np.where(wanting, np.maximum(certain, mean - unsure), certain)
    return np.asarray(np.maximum(certain, 0.0))

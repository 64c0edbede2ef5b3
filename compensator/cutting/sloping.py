"""A ball that climbs or descends: how far round its front goes, and its way through the stock, as distances in space.

A patch of the ball with the outer normal n cuts where n . f > 0, f the feed with its slope. At a height where n stands at kappa
to the axis, that is to angles of

    cos(phi) > tan(slope) cot(kappa)

on both sides of the feed: half a circle on the level, less of it climbing, more of it descending, all of it near the tip. (By
a feed c a tooth, from the ball one tooth before, from n . f > -c / 2R on: of a shallow climbing cut that is some per cent.) The
way of a ball is all that is within its radius of the line of its middle, and what is above that, which is its shank's.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from compensator.cutting.swept import AROUND, Material
from identification.common.arrays import Array

Indices = NDArray[np.intp]
# Near the tip the front turns fast with the height: a layer is looked at in pieces of so much of the normal's angle [rad].
FINE = np.radians(2.5)


def front(sine: Array, travel: Array, least: Array) -> Array:
    """Half of the angle (n,) [rad] that cuts, about the feed, where the normal's sine to the axis is sine (n,); travel (n, 3):
    unit vectors of the feed; least (n,): n . f from which on it does where that has a slope. Half of the flank where it is
    upright."""
    level, cosine = np.hypot(travel[:, 0], travel[:, 1]), np.sqrt(np.maximum(1 - sine**2, 0.0))
    against = np.where(travel[:, 2] == 0, 0.0, travel[:, 2] * cosine + least)
    return np.asarray(np.arccos(np.clip(against / np.maximum(level * sine, 1e-12), -1.0, 1.0)))


def rings(foot: Array, thick: Array, radius: float, some: NDArray[np.bool_]) -> tuple[Indices, Array, Array]:
    """The pieces of a ball's layers from foot, thick (M,) [m], of `some` of them (M,): which layer, foot and thickness (n,)."""
    lower, upper = (np.arccos(np.clip(1 - height / radius, -1.0, 1.0)) for height in (foot, foot + thick))
    count = np.where(some & (foot + thick < radius), np.ceil((upper - lower) / FINE), 1.0).astype(np.intp)
    count = np.maximum(count, 1)
    own = np.repeat(np.arange(len(foot)), count)
    share = (np.arange(len(own)) - np.repeat(np.cumsum(count) - count, count)) / count[own]
    width = upper - lower
    begin, end = (radius * (1 - np.cos(lower[own] + one * width[own])) for one in (share, share + 1 / count[own]))
    whole = count[own] == 1
    return own, np.where(whole, foot[own], begin), np.where(whole, thick[own], end - begin)


def beyond_way(points: Array, first: Array, last: Array, shank: bool) -> Array:
    """How far (...) [m] points (3, ...) are from the straight way of a ball's middle, first and last (3,); shank: or from what
    stands above that. On the level alone: (2, ...) and (2,)."""
    along, off = last - first, [own - begin for own, begin in zip(points, first, strict=True)]
    square = float(along @ along)
    share = sum(own * step for own, step in zip(off, along, strict=True)) / (square or 1.0)
    share = np.clip(share, 0.0, 1.0, out=share)
    away = np.sqrt(sum((own - share * step) ** 2 for own, step in zip(off, along, strict=True)))
    if not shank:
        return np.asarray(away)
    some = np.nonzero(points[2] > min(first[2], last[2]))
    if len(some[0]):
        # Above a place of its way is the shank that stands there: on the part of it that is lower.
        x, y, z = (own[some] for own in off)
        level = (x * along[0] + y * along[1]) / (float(along[:2] @ along[:2]) or 1.0)
        lower = np.clip(z / along[2], 0.0, 1.0) if along[2] else 0.0
        level = np.clip(level, lower if along[2] < 0 else 0.0, lower if along[2] > 0 else 1.0)
        away[some] = np.minimum(away[some], np.hypot(x - level * along[0], y - level * along[1]))
    return np.asarray(away)


def beside_ball(spot: Array, step: Indices, first: Array, last: Array, shank: NDArray[np.bool_], radius: float) -> Array:
    """How far (M, P) [m] points (3, M, P), each of a step (M,), are outside of the ways of the steps of this batch before: of a
    ball's middle from first to last (K, 3) [m]; shank (K,): and of what stands above that."""
    order = np.argsort(step, kind="stable")
    spot, ascending = spot[:, order], step[order]
    result = np.ones(spot.shape[1:])
    for before in range(len(first) - 1):
        later = int(np.searchsorted(ascending, before, side="right"))
        away = beyond_way(spot[:, later:], first[before], last[before], bool(shank[before])) - radius
        np.minimum(result[later:], away, out=result[later:])
    back = np.empty_like(order)
    back[order] = np.arange(len(order))
    return np.asarray(result[back])


@dataclass(frozen=True, eq=False)
class Standing:
    """The points of the grid near the way of K steps where material may stand: layer, row and column (n,); away (K, n) [m]:
    from each step's way."""

    layer: Indices
    row: Indices
    column: Indices
    away: Array


def standing(material: Material, radius: float, first: Array, last: Array, shank: NDArray[np.bool_], within: Indices
             ) -> Standing:
    """Of the layers `within`, near the ways of a ball's middle from first to last (K, 3) [m]; shank (K,): that stands above
    it."""
    stock, (_, ny, nx) = material.stock, material.swept.shape
    height, cell = stock.height, stock.cell
    thick = float(np.diff(height)[within].max())
    reach = radius + AROUND * cell + 0.5 * thick
    low, high = np.minimum(first, last), np.maximum(first, last)
    lo = np.floor((low[:, :2].min(axis=0) - reach - stock.origin) / cell).astype(int)
    hi = np.ceil((high[:, :2].max(axis=0) + reach - stock.origin) / cell).astype(int) + 1
    (i0, i1), (j0, j1) = (np.clip([lo[k], hi[k]], 0, n) for k, n in ((0, nx), (1, ny)))
    x, y = stock.origin[0] + cell * np.arange(i0, i1), stock.origin[1] + cell * np.arange(j0, j1)
    points = np.stack(np.meshgrid(x, y))
    # The lowest that any of the steps comes to in a column.
    lowest = np.full(points.shape[1:], np.inf)
    for a, b, floor in zip(first, last, low[:, 2], strict=True):
        square = reach**2 - beyond_way(points, a[:2], b[:2], False) ** 2
        np.minimum(lowest, np.where(square > 0, floor - np.sqrt(np.maximum(square, 0.0)), np.inf), out=lowest)
    layer_middle = 0.5 * (height[1:] + height[:-1])
    box = (slice(within[0], within[-1] + 1), slice(j0, j1), slice(i0, i1))
    stands = (stock.inside[box] > -AROUND * cell) & (material.swept[box] > -AROUND * cell)
    stands &= layer_middle[box[0], None, None] >= lowest
    # What lies between two layers is found from both.
    alone = stands.copy()
    stands[1:] |= alone[:-1]
    stands[:-1] |= alone[1:]
    layer, row, column = np.nonzero(stands)
    layer, row, column = layer + within[0], row + j0, column + i0
    points = np.stack([stock.origin[0] + cell * column, stock.origin[1] + cell * row, layer_middle[layer]])
    away = np.stack([beyond_way(points, a, b, bool(up)) for a, b, up in zip(first, last, shank, strict=True)])
    return Standing(layer, row, column, away)


def met(found: Standing, radius: float, cell: float, thick: Array) -> tuple[Indices, Indices]:
    """Which steps may meet material in which layers: layer and step (M,), by layer; thick (L,) [m]."""
    near = found.away < radius + AROUND * cell + 0.5 * thick[found.layer]
    pairs = np.zeros((len(thick), len(near)), dtype=bool)
    for own, some in enumerate(near):
        pairs[found.layer[some], own] = True
    layer, step = np.nonzero(pairs)
    return layer, step


def go_along(material: Material, radius: float, found: Standing) -> None:
    """The steps go over what stands."""
    if len(found.layer):
        at = (found.layer, found.row, found.column)
        material.swept[at] = np.minimum(material.swept[at], (found.away.min(axis=0) - radius).astype(np.float32))

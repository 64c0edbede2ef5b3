"""What of the stock still stands while a cutter goes over it: distances to the edges of the material, layer by layer."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from compensator.cutting.cutter import Cutter
from compensator.cutting.leaning import across_shank
from compensator.cutting.stock import Grid, Stock
from identification.common.arrays import Array

Flags = NDArray[np.bool_]
# Points of the grid matter so many cells around an edge: what lies between two of them is found from both.
AROUND = 2.0


@dataclass(frozen=True, eq=False)
class Material:
    """stock: the blank; swept (L, ny, nx) [m]: how far its points are from where the cutter was; aside [m]: how far the tool is
    moved to see what that changes, 0: not at all; kind (L,): layers of one number have the same outline."""

    stock: Stock
    swept: Grid
    aside: float
    kind: NDArray[np.intp]

    @classmethod
    def of(cls, stock: Stock, aside: float) -> Material:
        """Before anything was gone over."""
        grid = stock.inside
        kind = np.cumsum([0, *(not _alike(one, other) for one, other in pairwise(grid))]) if aside else np.arange(len(grid))
        return cls(stock, np.full(grid.shape, np.float32(1.0)), aside, kind)


def _alike(one: Grid, other: Grid) -> bool:
    """Whether two layers have the same outline; those of a box are one array."""
    return one.__array_interface__["data"] == other.__array_interface__["data"] or np.array_equal(one, other)


def beside_own_way(rim: Array, step: NDArray[np.intp], start: Array, end: Array, radius: Array) -> Array:
    """How far (M, P) [m] points of the rim, rim (M, P, 2), each of a step (M,), ascending, are outside of where the cutter was
    on the steps of this batch before; start, end (K, 3) and radius (K,) [m] of the steps."""
    result = np.ones(rim.shape[:2])
    for before in np.flatnonzero(radius > 0):
        later = int(np.searchsorted(step, before, side="right"))
        away = distance(rim[later:], start[before, :2], end[before, :2]) - radius[before]
        np.minimum(result[later:], away, out=result[later:])
    return result


def distance(points: Array, first: Array, last: Array) -> Array:
    """From points (..., 2) to the straight line between first and last (2,) [m]."""
    along = last - first
    square = float(along @ along)
    off = points - first
    if square > 0:
        share = np.clip((off @ along) / square, 0.0, 1.0)
        off = off - share[..., None] * along
    return np.asarray(np.hypot(off[..., 0], off[..., 1]))


def between(stock: Stock, height: Array, thin: float) -> tuple[NDArray[np.intp], Array]:
    """The layer (n,) whose middle is under heights (n,) [m], and the share (n,) of the one above it; of the nearer one all
    where either is no thinner than `thin` [m], and what a layer says holds for all of it."""
    middle, thick = 0.5 * (stock.height[1:] + stock.height[:-1]), np.diff(stock.height)
    low = np.clip(np.searchsorted(middle, height, side="right") - 1, 0, max(len(middle) - 2, 0))
    high = np.minimum(low + 1, len(middle) - 1)
    share = np.clip((height - middle[low]) / np.maximum(middle[high] - middle[low], 1e-12), 0.0, 1.0)
    return low, np.where(np.maximum(thick[low], thick[high]) < thin, share, height > stock.height[low + 1]) * (high > low)


def sampled(stock: Stock, grid: Grid, layer: NDArray[np.intp], points: Array, share: Array | None = None) -> Array:
    """A distance (M, P) [m] at points (M, P, 2) in layers (M,), between the points of a layer's grid in proportion, grid
    (L, ny, nx); outside of the grid there is nothing. share (M,): of the layer above."""
    if share is not None:
        most = AROUND * stock.cell          # further from its edge a layer may not know of another's way
        low, high = (np.minimum(sampled(stock, grid, one, points), most)
                     for one in (layer, np.minimum(layer + 1, len(grid) - 1)))
        return np.asarray(low + share[:, None] * (high - low))
    _, ny, nx = grid.shape
    x, y = ((points[..., k] - stock.origin[k]) / stock.cell for k in range(2))
    on = (x >= 0) & (y >= 0) & (x <= nx - 1) & (y <= ny - 1)
    i, j = (np.clip(v.astype(np.intp), 0, n - 2) for v, n in ((x, nx), (y, ny)))
    u, v = x - i, y - j
    one = not grid.strides[0]       # the layers of a box are one array
    flat = grid[0].ravel() if one else grid.reshape(-1)
    base = (0 if one else layer[:, None] * (ny * nx)) + j * nx + i
    low = flat[base] * (1 - u) + flat[base + 1] * u
    high = flat[base + nx] * (1 - u) + flat[base + nx + 1] * u
    return np.asarray(np.where(on, low * (1 - v) + high * v, -stock.cell))


def go_over(material: Material, cutter: Cutter, start: Array, end: Array, axis: Array, leans: Flags, layer_middle: Array,
            within: NDArray[np.intp]) -> None:
    """The way of the steps, start, end and the tool's axis (K, 3), is gone over in the layers `within`; leans (K,): whether it
    is that of a ball that leans."""
    for first, last in _straight_runs(start, end, axis):
        low, high = np.minimum(start[first], end[last]), np.maximum(start[first], end[last])
        tip = 0.5 * (low[2] + high[2])
        height = layer_middle[within] - tip
        radius = cutter.radius_at(height)
        reached = radius > 0
        level = reached & ~((height > cutter.radius) & leans[first])
        _take(material, within[level], radius[level], start[first, :2], end[last, :2])
    shanks_go_over(material, cutter, start, end, axis, leans, layer_middle, within)


def shanks_go_over(material: Material, cutter: Cutter, start: Array, end: Array, axis: Array, leans: Flags, layer_middle: Array,
                   within: NDArray[np.intp]) -> None:
    """The same of what stands above the ball of a tool that leans: aside, an ellipse about its axis."""
    for first, last in _straight_runs(start, end, axis) if leans.any() else ():
        if not leans[first]:
            continue
        height = layer_middle[within] - 0.5 * (start[first, 2] + end[last, 2])
        radius = cutter.radius_at(height)
        above = (radius > 0) & (height > cutter.radius)
        for layer, own, up in zip(within[above], radius[above], height[above] - cutter.radius, strict=True):
            aside = up * axis[first, :2] / axis[first, 2]
            _take(material, np.array([layer]), np.array([own]), start[first, :2] + aside, end[last, :2] + aside,
                  axis[first])


def _take(material: Material, layers: NDArray[np.intp], radius: Array, first: Array, last: Array, axis: Array | None = None
          ) -> None:
    """Circles of radius (n,) [m], or the ellipses of a shank with an axis (3,), go over the layers (n,) from first to last
    (2,)."""
    stock, (_, ny, nx) = material.stock, material.swept.shape
    if not len(layers):
        return
    low, high = np.minimum(first, last), np.maximum(first, last)
    # Beyond the cutter too: the edge's distance is wanted on both sides of it.
    reach = radius.max() / (1.0 if axis is None else axis[2]) + 2 * stock.cell
    i0, i1 = (int(np.clip(v, 0, nx)) for v in ((low[0] - reach - stock.origin[0]) / stock.cell,
                                               (high[0] + reach - stock.origin[0]) / stock.cell + 2))
    j0, j1 = (int(np.clip(v, 0, ny)) for v in ((low[1] - reach - stock.origin[1]) / stock.cell,
                                               (high[1] + reach - stock.origin[1]) / stock.cell + 2))
    if i0 >= i1 or j0 >= j1:
        return
    x = stock.origin[0] + stock.cell * np.arange(i0, i1)
    y = stock.origin[1] + stock.cell * np.arange(j0, j1)
    points = np.stack(np.meshgrid(x, y), axis=-1)
    if axis is not None:
        points, first, last = (across_shank(xy, axis) for xy in (points, first, last))
    away = distance(points, first, last)
    for layer, own in zip(layers, radius, strict=True):
        box = material.swept[layer, j0:j1, i0:i1]
        np.minimum(box, (away - own).astype(np.float32), out=box)


def _straight_runs(start: Array, end: Array, axis: Array) -> list[tuple[int, int]]:
    """First and last step of each run in one direction at one height, with one axis (K, 3): its way is one long step's."""
    way = end - start
    size = np.linalg.norm(way, axis=1)
    unit = way / np.maximum(size, 1e-12)[:, None]
    bends = (np.linalg.norm(np.diff(unit, axis=0), axis=1) > 1e-7) | (np.abs(np.diff(way[:, 2])) > 1e-9) | (
        np.abs(way[1:, 2]) > 1e-9) | (np.abs(start[1:] - end[:-1]).max(axis=1, initial=0.0) > 1e-9) | (
        np.abs(np.diff(axis, axis=0)).max(axis=1, initial=0.0) > 1e-9)
    edges = [0, *(1 + np.flatnonzero(bends)), len(start)]
    return [(int(a), int(b) - 1) for a, b in pairwise(edges)]

"""Stock: horizontal layers, each with the signed distance of a grid of points to the edge of its material.

A point is inside where the distance is positive. Taking material away is the lesser of two distances, so the edge that a cutter
leaves stands where it went, to c^2 / 8R of a grid of c, and not at the border of a cell. A layer is cut where the tip stands
below its middle: layers end at the levels of the program, where it has few.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from identification.common.arrays import Array
from identification.common.findings import CompstiffError, counted, error

Grid = NDArray[np.float32]
# Bytes that the layers of one stock may take: a part of 1 m x 1 m at 0.5 mm in 128 layers. What a cutter leaves takes as much
# again, but for a box, whose layers are one.
MOST_BYTES = 2.1e9
# Levels nearer to each other than this [m] are one. More levels than this: the layers are even.
SAME_LEVEL, MOST_LEVELS, MOST_LAYERS = 2e-6, 64, 400
# So many points are worked on at once, so that no stock takes a multiple of its own memory on the way.
AT_ONCE = 500_000
# Pieces of a quarter of a rounding, the most that fit.
ROUNDING = (24, 8)


@dataclass(frozen=True, eq=False)
class Stock:
    """origin (2,) [m]: x, y of the first point; cell [m]: between points; height (L + 1,) [m], ascending: between layers;
    inside (L, ny, nx) [m]: how far within the material, negative outside. All in the work object. unknown (K, 2, 3) [m]:
    corners of boxes in which nothing is said of what stands there. position_std [m]: 1 sigma of where it stands, each of x, y,
    z."""

    origin: Array
    cell: float
    height: Array
    inside: Grid
    unknown: Array
    position_std: float = 0.0

    @property
    def volume(self) -> float:
        """[m^3]; a point counts as its cell, cut by the edge as by a straight line."""
        share = np.clip(0.5 + self.inside / self.cell, 0.0, 1.0).sum(axis=(1, 2), dtype=float)
        return float(share @ np.diff(self.height)) * self.cell**2

    def words(self) -> str:
        """For people."""
        layers, ny, nx = self.inside.shape
        size = 1e3 * self.cell * np.array([nx - 1, ny - 1])
        thick = 1e3 * np.diff(self.height)
        return (f"{size[0]:g} x {size[1]:g} mm at {1e3 * self.cell:.3g} mm, {layers} layers of {thick.min():.3g} to "
                f"{thick.max():.3g} mm")


def grid_of(low: Array, high: Array, cell: float, margin: float = 2.0) -> tuple[Array, Array, Array]:
    """Origin (2,), x (nx,) and y (ny,) [m] of a grid over a rectangle, `margin` cells wider on all sides."""
    count = np.ceil((high - low) / cell + 2 * margin).astype(int) + 1
    origin = low - margin * cell
    return origin, origin[0] + cell * np.arange(count[0]), origin[1] + cell * np.arange(count[1])


def box_stock(low: Array, high: Array, height: Array, cell: float) -> Stock:
    """A box from low to high (3,) [m], in layers between height (L + 1,) [m]."""
    origin, x, y = grid_of(low[:2], high[:2], cell)
    check_size(len(height) - 1, len(y), len(x))
    along, across = np.minimum(x - low[0], high[0] - x), np.minimum(y - low[1], high[1] - y)
    one = np.empty((len(y), len(x)), dtype=np.float32)
    some = max(AT_ONCE // len(x), 1)
    for first in range(0, len(y), some):
        here = across[first:first + some, None]
        # Outside of a corner the distance is that to the corner.
        outside = np.hypot(np.maximum(-along, 0.0), np.maximum(-here, 0.0))
        one[first:first + some] = np.where(outside > 0, -outside, np.minimum(along, here))
    return Stock(origin, cell, height, np.broadcast_to(one, (len(height) - 1, *one.shape)), np.zeros((0, 2, 3)))


def check_size(layers: int, ny: int, nx: int) -> None:
    """Raises CompstiffError (CS4704), without its file, for a stock that is too large for the memory it may take."""
    if 4.0 * layers * ny * nx > MOST_BYTES:
        raise error("CS4704", f"the stock would take {4e-9 * layers * ny * nx:.4g} GB: {counted(layers, 'layer')} of {nx} x "
                    f"{ny} points, expected at most {1e-9 * MOST_BYTES:.3g} GB",
                    hint="a coarser resolution_mm, of a stock that --leaves wrote in the file that it began with; or a stock "
                    "file of what is near this program alone")


@contextmanager
def made_of(file: Path) -> Iterator[None]:
    """What is raised inside without a file is of this one."""
    try:
        yield
    except CompstiffError as stopped:
        raise CompstiffError(*(replace(one, file=one.file or str(file)) for one in stopped.findings)) from stopped


def layers_for(low: float, high: float, tips: Array, corner: float, thickness: float) -> Array:
    """Heights (L + 1,) [m] between low and high that suit a program whose tip comes to the heights `tips` (n,) [m].

    At its levels where they are few, else even, of `thickness` [m] or as many as may be; the rounding of a cutter of corner
    radius `corner` is cut in 24 where that fits, so that the edge of a thin cut lies where it should, else in eight.
    """
    levels = np.unique(np.round(tips[(tips > low) & (tips < high)] / SAME_LEVEL)) * SAME_LEVEL
    if len(levels) > MOST_LEVELS:
        count = int(min(np.ceil((high - low) / thickness), MOST_LAYERS))
        return np.linspace(low, high, count + 1)
    for pieces in ROUNDING:
        above = corner * (1 - np.cos(np.linspace(0, np.pi / 2, pieces + 1))) if corner else np.zeros(1)
        edges = np.sort(np.concatenate([[low, high], (levels[:, None] + above).ravel()]))
        edges = edges[(edges >= low) & (edges <= high)]
        kept = edges[np.insert(np.diff(edges) > SAME_LEVEL, 0, True)]
        kept[-1] = high
        if len(kept) <= MOST_LAYERS:
            return kept
    return np.linspace(low, high, MOST_LAYERS + 1)


def more_layers(stock: Stock, level: Array, off: Array, step: float) -> Stock:
    """The same stock with layers that end where a tool stood off its levels (n,) [m] by so much (n,) [m], too, in steps of
    `step` [m], or of twice that and so on, as many layers as may be: what it cuts below its level is gone when it comes by
    again, in a thick layer that begins at the level it would not be."""
    low, high = stock.height[[0, -1]]
    while (steps := np.round(off / step)).any():
        more = np.unique(np.round(level / SAME_LEVEL) * SAME_LEVEL + step * steps)
        height = np.union1d(stock.height, more[(more > low) & (more < high)])
        kept = height[np.insert(np.diff(height) > SAME_LEVEL, 0, True)]
        if len(kept) <= MOST_LAYERS + 1:
            kept[-1] = high
            return relayered(stock, kept)
        step *= 2
    return stock


def relayered(stock: Stock, height: Array) -> Stock:
    """The same stock between other heights (L + 1,) [m] within its own: each layer is that which its middle lies in."""
    middle = 0.5 * (height[1:] + height[:-1])
    which = np.clip(np.searchsorted(stock.height, middle, side="right") - 1, 0, len(stock.inside) - 1)
    check_size(len(which), *stock.inside.shape[1:])
    # A box's layers are one.
    inside = stock.inside[which] if stock.inside.strides[0] else np.broadcast_to(
        stock.inside[0], (len(which), *stock.inside.shape[1:]))
    return Stock(stock.origin, stock.cell, height, inside, stock.unknown, stock.position_std)

"""An outline of straight edges as the signed distance of a grid of points to it: exact where the grid meets the edge."""

from __future__ import annotations

import numpy as np

from compensator.cutting.solid import Solid
from compensator.cutting.stock import Grid, Stock, check_size, grid_of
from identification.common.arrays import Array
from identification.common.findings import error
from identification.common.progress import progress

# Distances are exact within so much of an edge [m], and so many cells at least: two points of a cutter's half circle between
# which an edge passes stand no further apart, up to a diameter of 76 mm. So many points are looked at at once.
NEAR, CELLS, AT_ONCE = 2e-3, 3, 2_000_000
# Edges meet at corners that two triangles' cuts do not give to the last bit: a row or column through one, to so many decimals
# of a cell, passes it on the same side of both.
SAME = 6


def solid_stock(solid: Solid, height: Array, cell: float) -> Stock:
    """The solid in layers between height (L + 1,) [m]; each is what its middle cuts.

    Raises CompstiffError: CS4704 too large, CS4713 bodies that overlap, or one inside out.
    """
    low, high = solid.bounds
    origin, x, y = grid_of(low[:2], high[:2], cell)
    check_size(len(height) - 1, len(y), len(x))
    inside = np.empty((len(height) - 1, len(y), len(x)), dtype=np.float32)
    with progress("cutting the blank into layers", len(inside)) as bar:
        for layer, middle in enumerate(0.5 * (height[1:] + height[:-1])):
            edge, out = solid.edges_at(float(middle))
            sense = windings(edge, out, origin, cell, len(y), len(x))
            if len(edge) and (sense.min() < 0 or sense.max() > 1):
                raise error("CS4713", f"at z {1e3 * middle:.3g} mm bodies of it overlap, or one is inside out",
                            file=str(solid.source), hint="unite its bodies in CAM, and export one solid")
            inside[layer] = signed_distance(edge, sense > 0, origin, cell)
            bar.add(1)
    return Stock(origin, cell, height, inside, np.zeros((0, 2, 3)))


def windings(edge: Array, out: Array, origin: Array, cell: float, ny: int, nx: int) -> Grid:
    """How many bodies hold each point (ny, nx) of a grid around them: edges (E, 2, 2) [m] counted along the rows, in (+1) where
    the outward direction (E, 2) is against x, else out (-1)."""
    first, last = np.sort(np.round((edge[:, :, 1] - origin[1]) / cell, SAME), axis=1).T
    begin, end = np.ceil(first).astype(np.intp), np.ceil(last).astype(np.intp)
    count = end - begin
    owner = np.repeat(np.arange(len(edge)), count)
    row = begin[owner] + np.arange(len(owner)) - np.repeat(np.cumsum(count) - count, count)
    a, b = edge[owner, 0], edge[owner, 1]
    share = np.clip((origin[1] + cell * row - a[:, 1]) / (b[:, 1] - a[:, 1]), 0.0, 1.0)
    column = np.ceil(np.round((a[:, 0] + share * (b[:, 0] - a[:, 0]) - origin[0]) / cell, SAME)).astype(np.intp)
    change = np.zeros((ny, nx + 1), dtype=np.float32)
    np.add.at(change, (row, column), np.where(out[owner, 0] < 0, 1.0, -1.0))
    return np.asarray(np.cumsum(change, axis=1)[:, :nx])


def signed_distance(edge: Array, within: np.ndarray, origin: Array, cell: float) -> Grid:
    """Distance (ny, nx) [m] to the nearest of edges (E, 2, 2) [m], positive `within`.

    Points near an edge look at all edges around; further off it is true to a cell.
    """
    from scipy.ndimage import distance_transform_edt

    ny, nx = within.shape
    if not len(edge):
        return np.full((ny, nx), -cell * float(np.hypot(nx, ny)), dtype=np.float32)
    best, owner = np.full(ny * nx, np.inf), np.zeros(ny * nx, dtype=np.int32)
    way = edge[:, 1] - edge[:, 0]
    # In pieces of that length, each with the points around it.
    near = int(max(np.ceil(NEAR / cell), CELLS))
    pieces = np.maximum(np.ceil(np.hypot(*way.T) / (near * cell)), 1).astype(np.intp)
    of = np.repeat(np.arange(len(edge)), pieces)
    share = (np.arange(len(of)) - np.repeat(np.cumsum(pieces) - pieces, pieces) + 0.5) / pieces[of]
    middle = np.rint((edge[of, 0] + share[:, None] * way[of] - origin) / cell).astype(np.intp)
    reach = np.arange(-(near + near // 2 + 2), near + near // 2 + 3)
    dx, dy = (v.ravel() for v in np.meshgrid(reach, reach))
    some = max(AT_ONCE // len(dx), 1)
    for first in range(0, len(of), some):
        rows = slice(first, first + some)
        i, j = middle[rows, 0, None] + dx, middle[rows, 1, None] + dy
        on = (i >= 0) & (i < nx) & (j >= 0) & (j < ny)
        i, j, which = i[on], j[on], np.broadcast_to(of[rows, None], on.shape)[on]
        index, away = j * nx + i, _to_edges(i, j, which, edge, origin, cell)
        np.minimum.at(best, index, away)
        mine = away == best[index]
        owner[index[mine]] = which[mine]
    # Beyond: the edge that is nearest to the nearest point beside an edge.
    nearest = distance_transform_edt((best > cell).reshape(ny, nx), return_distances=False, return_indices=True)
    at = nearest.reshape(2, -1)
    for first in range(0, ny * nx, AT_ONCE):
        far = first + np.flatnonzero(best[first:first + AT_ONCE] > near * cell)
        j, i = np.divmod(far, nx)
        best[far] = _to_edges(i, j, owner[at[0, far].astype(np.intp) * nx + at[1, far]], edge, origin, cell)
    away = best.reshape(ny, nx)
    return np.asarray(np.negative(away, where=~within, out=away).astype(np.float32))


def _to_edges(i: np.ndarray, j: np.ndarray, which: np.ndarray, edge: Array, origin: Array, cell: float) -> Array:
    """Distance (n,) [m] of the grid's points, column i and row j, to one edge each."""
    (ax, ay), (wx, wy) = edge[:, 0].T, (edge[:, 1] - edge[:, 0]).T
    x, y = origin[0] + cell * i - ax.take(which), origin[1] + cell * j - ay.take(which)
    square = np.maximum(wx**2 + wy**2, 1e-300).take(which)
    wx, wy = wx.take(which), wy.take(which)
    share = np.minimum(np.maximum((x * wx + y * wy) / square, 0.0), 1.0)
    return np.asarray(np.hypot(x - share * wx, y - share * wy))

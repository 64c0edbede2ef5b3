"""A cutter goes through the stock: how it engages on every step of its way, and what it leaves.

Steps are taken in batches of a few. For each batch the half circle that faces the feed is looked at in every layer, at the
middle of every step: what stands there is the lesser of two distances to the material's edge, that of the stock as the batches
before left it, and that to the way of the cutter in this batch up to the step. Then the way of the whole batch is taken out of
the stock. Where the distance passes zero between two points of the half circle the cut begins or ends.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from compensator.cutting.chips import integrals, weights
from compensator.cutting.cutter import Cutter
from compensator.cutting.stock import Stock
from compensator.cutting.track import Track
from identification.common.arrays import Array, read_only
from identification.common.progress import progress

Flags = NDArray[np.bool_]
# Points of the half circle; steps of a batch; a film thinner than this is none [m]: the grid's error at an edge that the cutter
# itself left is c^2 / 8R, 0.6 um for a grid of 0.2 mm and a radius of 8 mm.
POINTS, BATCH, FILM = 61, 24, 2e-6
ANGLE = np.linspace(-np.pi / 2, np.pi / 2, POINTS)
# A step that goes down by more than this in its length plunges [m/m]: the floor of the cutter cuts, which no end mill's
# coefficients describe.
STEEPEST = np.tan(np.radians(5.0))


@dataclass(frozen=True, eq=False)
class Engagement:
    """How the cutter is engaged on S steps of a track. weights (S, 3, 6): of the coefficients in the mean force, per metre of
    feed a tooth in the chip's three (chips.py), work object; low, high (S,) [rad]: the cut's ends, to the left of the feed, NaN
    where nothing is cut; depth (S,) [m]: largest, along the axis; width (S,) [m]: across the feed, mean over the depth; unknown
    (S,): it cuts, and the force is not known."""

    weights: Array
    low: Array
    high: Array
    depth: Array
    width: Array
    unknown: Flags

    def __post_init__(self) -> None:
        read_only(self.weights, self.low, self.high, self.depth, self.width, self.unknown)

    @property
    def cuts(self) -> Flags:
        """Steps (S,) that take material away."""
        return np.asarray(self.depth > 0)


@dataclass(frozen=True, eq=False)
class _Slice:
    """What of a cutter stands in one layer, at K steps: thick, radius, edge (K,) [m], sine (K,) as `weights` wants them."""

    thick: Array
    radius: Array
    sine: Array
    edge: Array


def mill_through(stock: Stock, track: Track, cutter: Cutter) -> Engagement:
    """Takes the way of the cutter out of the stock, IN PLACE, and says how it engaged."""
    count = len(track)
    engaged = Engagement(np.zeros((count, 3, 6)), np.full(count, np.nan), np.full(count, np.nan), np.zeros(count),
                         np.zeros(count), np.zeros(count, dtype=bool))
    arrays = {name: np.array(getattr(engaged, name)) for name in ("weights", "low", "high", "depth", "width", "unknown")}
    near = _near(stock, track, cutter)
    with progress("milling through the stock", count) as bar:
        for first in range(0, count, BATCH):
            rows = first + np.flatnonzero(near[first:first + BATCH])
            if len(rows):
                _one_batch(stock, track, cutter, rows, arrays)
            bar.add(min(BATCH, count - first))
    in_a_box = np.zeros(count, dtype=bool)
    for low, high in stock.unknown:
        reach = np.array([cutter.radius, cutter.radius, 0.0])
        in_a_box |= ((track.end >= low - reach) & (track.start <= high + reach)).all(axis=1)
    cuts = arrays["depth"] > 0
    arrays["unknown"] = (cuts & (track.joint | ~track.upright | _plunges(track) | ~np.isfinite(track.chip))) | in_a_box
    return Engagement(**arrays)


def _plunges(track: Track) -> Flags:
    """Steps (S,) that go down steeply."""
    way = track.end - track.start
    return np.asarray(-way[:, 2] > STEEPEST * np.hypot(way[:, 0], way[:, 1]))


def _near(stock: Stock, track: Track, cutter: Cutter) -> Flags:
    """Steps (S,) on which the cutter may reach the stock."""
    _, ny, nx = stock.inside.shape
    low = stock.origin - cutter.radius
    high = stock.origin + stock.cell * np.array([nx - 1, ny - 1]) + cutter.radius
    flat_low, flat_high = (pick(track.start, track.end)[:, :2] for pick in (np.minimum, np.maximum))
    return np.asarray((flat_high >= low).all(axis=1) & (flat_low <= high).all(axis=1)
                      & (np.minimum(track.start, track.end)[:, 2] < stock.height[-1]))


def _one_batch(stock: Stock, track: Track, cutter: Cutter, rows: NDArray[np.intp], into: dict[str, Array]) -> None:
    """Looks at the steps `rows` (K,), then takes them out."""
    start, end = track.start[rows], track.end[rows]
    middle = 0.5 * (start + end)
    way = (end - start)[:, :2]
    size = np.hypot(way[:, 0], way[:, 1])
    flat = size > 1e-9
    feed = np.where(flat[:, None], way / np.maximum(size, 1e-12)[:, None], [1.0, 0.0])
    left = np.column_stack([-feed[:, 1], feed[:, 0]])
    tip = middle[:, 2]
    layer_middle = 0.5 * (stock.height[1:] + stock.height[:-1])
    within = np.flatnonzero(stock.height[1:] > tip.min())
    rim_of: dict[bytes, tuple[Array, Array]] = {}
    for layer in within:
        bottom, top = stock.height[layer], stock.height[layer + 1]
        # Of a layer that the tip stands in, the part above it.
        thick = np.clip(top - np.maximum(bottom, tip), 0.0, top - bottom)
        at = np.maximum(layer_middle[layer] - tip, 0.5 * thick)
        radius, sine = cutter.radius_at(at), cutter.sine_at(at)
        looking = (thick > 0) & (radius > 0)
        if not looking.any():
            continue
        radius = np.where(looking, radius, 0.0)
        gone = cutter.radius_at(layer_middle[layer] - tip)
        key = radius.tobytes() + gone.tobytes()         # layers on the flank of a cutter are alike
        if key in rim_of:
            rim, own = rim_of[key]
        else:
            rim = (middle[:, None, :2] + radius[:, None, None] * (
                np.cos(ANGLE)[None, :, None] * feed[:, None, :] + np.sin(ANGLE)[None, :, None] * left[:, None, :]))
            own = _beside_own_way(rim, start, end, gone)
            rim_of[key] = (rim, own)
        inside = np.minimum(_sampled(stock, int(layer), rim), own) - FILM
        inside[~looking] = -1.0
        foot = np.maximum(bottom, tip) - tip
        edge = cutter.edge_length(foot, foot + thick)
        _add(inside, _Slice(thick, radius, sine, edge), feed, left, cutter.teeth, rows, into)
    _take_out(stock, cutter, start, end, layer_middle, within)


def _beside_own_way(rim: Array, start: Array, end: Array, radius: Array) -> Array:
    """How far (K, P) [m] points of the rim of each step, rim (K, P, 2), are outside of where the cutter was on the steps of
    this batch before."""
    result = np.full(rim.shape[:2], np.inf)
    for before in np.flatnonzero(radius[:-1] > 0):
        some = rim[before + 1:]
        away = _distance(some, start[before, :2], end[before, :2]) - radius[before]
        np.minimum(result[before + 1:], away, out=result[before + 1:])
    return result


def _distance(points: Array, first: Array, last: Array) -> Array:
    """From points (..., 2) to the straight line between first and last (2,) [m]."""
    along = last - first
    square = float(along @ along)
    off = points - first
    if square > 0:
        share = np.clip((off @ along) / square, 0.0, 1.0)
        off = off - share[..., None] * along
    return np.asarray(np.hypot(off[..., 0], off[..., 1]))


def _sampled(stock: Stock, layer: int, points: Array) -> Array:
    """The distance to the material's edge (K, P) [m] at points (K, P, 2), between the grid's points in proportion; outside of
    the grid there is nothing."""
    grid = stock.inside[layer]
    ny, nx = grid.shape
    x, y = ((points[..., k] - stock.origin[k]) / stock.cell for k in range(2))
    on = (x >= 0) & (y >= 0) & (x <= nx - 1) & (y <= ny - 1)
    i, j = (np.clip(v.astype(np.intp), 0, n - 2) for v, n in ((x, nx), (y, ny)))
    u, v = x - i, y - j
    flat = grid.ravel()
    base = j * nx + i
    low = flat[base] * (1 - u) + flat[base + 1] * u
    high = flat[base + nx] * (1 - u) + flat[base + nx + 1] * u
    return np.asarray(np.where(on, low * (1 - v) + high * v, -stock.cell))


def _add(inside: Array, piece_of: _Slice, feed: Array, left: Array, teeth: int, rows: NDArray[np.intp],
         into: dict[str, Array]) -> None:
    """Adds one layer's cut to the steps: inside (K, P) [m] within the material around the half circle."""
    first, last = inside[:, :-1], inside[:, 1:]
    step, piece = np.nonzero((first > 0) | (last > 0))
    if not len(step):
        return
    a, b = first[step, piece], last[step, piece]
    share = np.clip(np.where(a > 0, a, b) / np.maximum(np.abs(a - b), 1e-15), 0.0, 1.0)
    low, high = ANGLE[piece], ANGLE[piece + 1]
    both = (a > 0) & (b > 0)
    begin = np.where(both | (a > 0), low, high - share * (high - low))
    stop = np.where(both | (b > 0), high, low + share * (high - low))
    integral = integrals(begin, stop)
    summed = np.column_stack([np.bincount(step, column, minlength=len(inside)).astype(float) for column in integral.T])
    # Local axes: feed, left, up -> work object.
    thick = piece_of.thick
    local = weights(summed, thick, piece_of.sine, piece_of.edge, teeth)
    turned = local.copy()
    turned[:, :2] = np.einsum("kai,kac->kic", np.stack([feed, left], axis=1), local[:, :2])
    into["weights"][rows] += turned
    cut = np.flatnonzero(summed[:, 4] > 0)
    at = rows[cut]
    lowest, highest = np.full(len(inside), np.inf), np.full(len(inside), -np.inf)
    np.minimum.at(lowest, step, begin)
    np.maximum.at(highest, step, stop)
    into["low"][at] = np.fmin(into["low"][at], lowest[cut])
    into["high"][at] = np.fmax(into["high"][at], highest[cut])
    depth = into["depth"][at] + thick[cut]
    across = piece_of.radius[cut] * summed[cut, 2]
    into["width"][at] += thick[cut] / depth * (across - into["width"][at])
    into["depth"][at] = depth


def _take_out(stock: Stock, cutter: Cutter, start: Array, end: Array, layer_middle: Array, within: NDArray[np.intp]) -> None:
    """Takes the way of the steps out of the layers `within`."""
    _, ny, nx = stock.inside.shape
    for first, last in _straight_runs(start, end):
        low, high = np.minimum(start[first], end[last]), np.maximum(start[first], end[last])
        tip = 0.5 * (low[2] + high[2])
        height = layer_middle[within] - tip
        radius = cutter.radius_at(height)
        layers = within[radius > 0]
        if not len(layers):
            continue
        # Beyond the cutter too: the edge's distance is wanted on both sides of it.
        reach = cutter.radius + 2 * stock.cell
        i0, i1 = (int(np.clip(v, 0, nx)) for v in ((low[0] - reach - stock.origin[0]) // stock.cell,
                                                   (high[0] + reach - stock.origin[0]) // stock.cell + 2))
        j0, j1 = (int(np.clip(v, 0, ny)) for v in ((low[1] - reach - stock.origin[1]) // stock.cell,
                                                   (high[1] + reach - stock.origin[1]) // stock.cell + 2))
        if i0 >= i1 or j0 >= j1:
            continue
        x = stock.origin[0] + stock.cell * np.arange(i0, i1)
        y = stock.origin[1] + stock.cell * np.arange(j0, j1)
        away = _distance(np.stack(np.meshgrid(x, y), axis=-1), start[first, :2], end[last, :2])
        for layer, own in zip(layers, radius[radius > 0], strict=True):
            box = stock.inside[layer, j0:j1, i0:i1]
            np.minimum(box, (away - own).astype(np.float32), out=box)


def _straight_runs(start: Array, end: Array) -> list[tuple[int, int]]:
    """First and last step of each run in one direction at one height: its way is that of one long step."""
    way = end - start
    size = np.linalg.norm(way, axis=1)
    unit = way / np.maximum(size, 1e-12)[:, None]
    bends = (np.linalg.norm(np.diff(unit, axis=0), axis=1) > 1e-7) | (np.abs(np.diff(way[:, 2])) > 1e-9) | (
        np.abs(way[1:, 2]) > 1e-9) | (np.abs(start[1:] - end[:-1]).max(axis=1, initial=0.0) > 1e-9)
    edges = [0, *(1 + np.flatnonzero(bends)), len(start)]
    return [(int(a), int(b) - 1) for a, b in pairwise(edges)]

"""A cutter goes through the stock: how it engages on every step of its way, and what it leaves.

Steps are taken in batches of a few. For each batch the half circle that faces the feed is looked at in every layer, at the
middle of every step: what stands there is the least of three distances to the material's edge, that of the blank, that to what
the batches before went over, and that to the way of the cutter in this batch up to the step. Then the way of the whole batch is
gone over. Where one of them passes zero between two points of the half circle the cut begins or ends.

Where the blank stands aside only the first of the three is another. So one going through tells the engagement with it aside
too: along x and y anew at the steps that come near the blank's own edge, along z by how much of each layer is then another's.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from compensator.cutting.chips import integrals, weights
from compensator.cutting.cutter import Cutter
from compensator.cutting.leaning import (
    MOST_LEAN,
    above_the_ball,
    across_shank,
    leaning_weights,
    leans,
    leans_too_far,
    shank_rim,
)
from compensator.cutting.stock import Stock
from compensator.cutting.swept import Material, beside_own_way, distance, go_over, sampled
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
    (S,): it cuts, and the force is not known; moved (3, S, 3, 6): `weights` with the tool aside along x, y and z, None: not
    asked for."""

    weights: Array
    low: Array
    high: Array
    depth: Array
    width: Array
    unknown: Flags
    moved: Array | None = None

    def __post_init__(self) -> None:
        read_only(self.weights, self.low, self.high, self.depth, self.width, self.unknown)
        if self.moved is not None:
            read_only(self.moved)

    @property
    def cuts(self) -> Flags:
        """Steps (S,) that take material away."""
        return np.asarray(self.depth > 0)


@dataclass(frozen=True, eq=False)
class _Slice:
    """What of a cutter stands in one layer, at K steps: foot (above the tip), thick, radius, edge (K,) [m], sine (K,) as
    `weights` wants them."""

    foot: Array
    thick: Array
    radius: Array
    sine: Array
    edge: Array

    def at(self, some: NDArray[np.intp]) -> _Slice:
        """At some of the steps."""
        return _Slice(self.foot[some], self.thick[some], self.radius[some], self.sine[some], self.edge[some])


@dataclass(frozen=True, eq=False)
class _Axes:
    """Of K steps: feed and its left (K, 2), level; chip (K,) [m]: feed a tooth; the tool's axis (K, 3), and whether it leans
    (K,) and is that of a ball."""

    feed: Array
    left: Array
    chip: Array
    axis: Array
    leans: Flags

    def at(self, some: NDArray[np.intp]) -> _Axes:
        """At some of the steps."""
        return _Axes(self.feed[some], self.left[some], self.chip[some], self.axis[some], self.leans[some])


@dataclass(frozen=True, eq=False)
class _Arcs:
    """Where K steps cut in a layer: step (M,), from begin to stop (M,) [rad]; integral (K, 5) over all of a step."""

    step: NDArray[np.intp]
    begin: Array
    stop: Array
    integral: Array


def mill_through(stock: Stock, track: Track, cutter: Cutter, aside: float = 0.0) -> tuple[Engagement, Stock]:
    """How the cutter engages on its way through a stock, and what it leaves; aside [m]: also with the tool moved by so much
    along x, y and up, each by itself."""
    count = len(track)
    arrays = {"weights": np.zeros((count, 3, 6)), "low": np.full(count, np.nan), "high": np.full(count, np.nan),
              "depth": np.zeros(count), "width": np.zeros(count)}
    if aside:
        arrays["moved"] = np.zeros((3, count, 3, 6))
    if cutter.ball:
        arrays["beyond"] = np.zeros(count, dtype=bool)
    near = _near(stock, track, cutter)
    material = Material.of(stock, aside)
    with progress("milling through the stock", count) as bar:
        for first in range(0, count, BATCH):
            rows = first + np.flatnonzero(near[first:first + BATCH])
            if len(rows):
                _one_batch(material, track, cutter, rows, arrays)
            bar.add(min(BATCH, count - first))
    left = replace(stock, inside=np.minimum(stock.inside, material.swept, out=material.swept))
    in_a_box = np.zeros(count, dtype=bool)
    for low, high in stock.unknown:
        reach = np.array([cutter.radius, cutter.radius, 0.0])
        in_a_box |= ((track.end >= low - reach) & (track.start <= high + reach)).all(axis=1)
    cuts = arrays["depth"] > 0
    # Where a ball leans so far that nothing is worked out, its shank may cut wherever there is stock.
    beyond = arrays.pop("beyond") | (near & leans_too_far(track.axis)) if cutter.ball else cuts & leans(track.axis)
    unknown = (cuts & (track.joint | _plunges(track) | ~np.isfinite(track.chip))) | in_a_box | beyond
    return Engagement(unknown=unknown, **arrays), left


def _plunges(track: Track) -> Flags:
    """Steps (S,) that go down steeply."""
    way = track.end - track.start
    return np.asarray(-way[:, 2] > STEEPEST * np.hypot(way[:, 0], way[:, 1]))


def _near(stock: Stock, track: Track, cutter: Cutter) -> Flags:
    """Steps (S,) on which the cutter may reach the stock."""
    _, ny, nx = stock.inside.shape
    # The shank of a tool that leans reaches further, as far up as there is stock.
    upright = np.clip(track.axis[:, 2:], np.cos(MOST_LEAN), 1.0)
    above = np.maximum(stock.height[-1] - np.minimum(track.start, track.end)[:, 2:], 0.0)
    reach = cutter.radius / upright + above * np.sqrt(1 - upright**2) / upright
    low = stock.origin - reach
    high = stock.origin + stock.cell * np.array([nx - 1, ny - 1]) + reach
    flat_low, flat_high = (pick(track.start, track.end)[:, :2] for pick in (np.minimum, np.maximum))
    return np.asarray((flat_high >= low).all(axis=1) & (flat_low <= high).all(axis=1)
                      & (np.minimum(track.start, track.end)[:, 2] < stock.height[-1]))


def _one_batch(material: Material, track: Track, cutter: Cutter, rows: NDArray[np.intp], into: dict[str, Array]) -> None:
    """Looks at the steps `rows` (K,), then goes over them."""
    stock = material.stock
    start, end = track.start[rows], track.end[rows]
    middle = 0.5 * (start + end)
    way = (end - start)[:, :2]
    size = np.hypot(way[:, 0], way[:, 1])
    flat = size > 1e-9
    feed = np.where(flat[:, None], way / np.maximum(size, 1e-12)[:, None], [1.0, 0.0])
    left = np.column_stack([-feed[:, 1], feed[:, 0]])
    axes = _Axes(feed, left, np.nan_to_num(track.chip[rows]), track.axis[rows],
                 leans(track.axis[rows]) & ~leans_too_far(track.axis[rows]) & cutter.ball)
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
            own = beside_own_way(rim, start, end, gone)
            rim_of[key] = (rim, own)
        if axes.leans.any():
            own = np.where(above_the_ball(ANGLE, at, cutter.radius, feed, axes.axis) & axes.leans[:, None], -1.0, own)
            met = _shank_cuts(material, int(layer), cutter, middle, start, end, at, axes) & looking
            into["beyond"][rows[met]] = True
        blank = sampled(stock, stock.inside[layer], rim)
        gone_over = (sampled(stock, material.swept[layer], rim), own)
        foot = np.maximum(bottom, tip) - tip
        piece = _Slice(foot, thick, radius, sine, cutter.edge_length(foot, foot + thick))
        inside = np.where(looking[:, None], blank, -1.0)
        turned = _add((inside, *gone_over), piece, axes, cutter, rows, into)
        if material.aside:
            _add_moved(material, int(layer), turned, blank, gone_over, rim, tip, piece, looking, axes, cutter, rows,
                       into["moved"])
    go_over(material, cutter, start, end, axes.axis, axes.leans, layer_middle, within)


def _shank_cuts(material: Material, layer: int, cutter: Cutter, middle: Array, start: Array, end: Array, at: Array, axes: _Axes
                ) -> Flags:
    """Steps (K,) at which what stands above the ball of a leaning tool meets material in a layer, at (K,) [m] above the tip."""
    stock, high = material.stock, at - cutter.radius
    rim = shank_rim(ANGLE, high, cutter.radius, axes.feed, axes.axis)
    points = middle[:, None, :2] + np.nan_to_num(rim)
    aside = np.maximum(high, 0.0)[:, None] * axes.axis[:, :2] / axes.axis[:, 2:]
    own = np.ones(points.shape[:2])
    for before in np.flatnonzero(axes.leans[:-1] & (at[:-1] > cutter.radius)):
        some, first, last = (across_shank(xy, axes.axis[before]) for xy in (
            points[before + 1:], start[before, :2] + aside[before], end[before, :2] + aside[before]))
        np.minimum(own[before + 1:], distance(some, first, last) - cutter.radius, out=own[before + 1:])
    for grid in (stock.inside[layer], material.swept[layer]):
        own = np.minimum(own, sampled(stock, grid, points))
    return np.asarray(axes.leans & ((own > FILM) & ~np.isnan(rim[..., 0])).any(axis=1))


def _arcs(distances: tuple[Array, ...]) -> _Arcs:
    """Which steps cut, from where to where. distances, each (K, P) [m]: how far the half circle is within what the blank, and
    what each of the ways before, leaves; cut is where it is within all. Each passes zero by itself: the least of two has a bend
    where they meet, and no straight line ends it rightly."""
    first, last = (np.stack(distances)[:, :, some] - FILM for some in (slice(None, -1), slice(1, None)))
    step, piece = np.nonzero(((first > 0) | (last > 0)).all(axis=0))
    a, b = first[:, step, piece], last[:, step, piece]
    low, high = ANGLE[piece], ANGLE[piece + 1]
    share = np.maximum(a, b) / np.maximum(np.abs(a - b), 1e-15) * (high - low)
    begin = np.where(a > 0, low, high - share).max(axis=0)
    stop = np.where(b > 0, high, low + share).min(axis=0)
    some = begin < stop
    step, begin, stop = step[some], begin[some], stop[some]
    integral = integrals(begin, stop)
    summed = np.column_stack([np.bincount(step, column, minlength=len(distances[0])).astype(float) for column in integral.T])
    return _Arcs(step, begin, stop, summed)


def _turned(arcs: _Arcs, piece_of: _Slice, axes: _Axes, cutter: Cutter) -> Array:
    """Weights (K, 3, 6) in the work object of what is cut; local axes are feed, left, up."""
    local = weights(arcs.integral, piece_of.thick, piece_of.sine, piece_of.edge, cutter.teeth)
    turned = local.copy()
    turned[:, :2] = np.einsum("kai,kac->kic", np.stack([axes.feed, axes.left], axis=1), local[:, :2])
    if axes.leans.any():
        some = np.flatnonzero(axes.leans[arcs.step])
        step = arcs.step[some]
        each = leaning_weights(arcs.begin[some], arcs.stop[some], piece_of.foot[step], piece_of.thick[step], cutter,
                               axes.feed[step], axes.axis[step], axes.chip[step])
        turned[axes.leans] = 0.0
        np.add.at(turned, step, each)
    return turned


def _add(inside: tuple[Array, ...], piece_of: _Slice, axes: _Axes, cutter: Cutter, rows: NDArray[np.intp],
         into: dict[str, Array]) -> Array | None:
    """Adds one layer's cut to the steps, and returns its weights; None where nothing is cut."""
    arcs = _arcs(inside)
    if not len(arcs.step):
        return None
    thick, summed = piece_of.thick, arcs.integral
    turned = _turned(arcs, piece_of, axes, cutter)
    into["weights"][rows] += turned
    cut = np.flatnonzero(summed[:, 4] > 0)
    at = rows[cut]
    lowest, highest = np.full(len(rows), np.inf), np.full(len(rows), -np.inf)
    np.minimum.at(lowest, arcs.step, arcs.begin)
    np.maximum.at(highest, arcs.step, arcs.stop)
    into["low"][at] = np.fmin(into["low"][at], lowest[cut])
    into["high"][at] = np.fmax(into["high"][at], highest[cut])
    depth = into["depth"][at] + thick[cut]
    across = piece_of.radius[cut] * summed[cut, 2]
    into["width"][at] += thick[cut] / depth * (across - into["width"][at])
    into["depth"][at] = depth
    return turned


def _add_moved(material: Material, layer: int, turned: Array | None, blank: Array, gone_over: tuple[Array, ...], rim: Array,
               tip: Array, piece_of: _Slice, looking: Flags, axes: _Axes, cutter: Cutter, rows: NDArray[np.intp], moved: Array
               ) -> None:
    """Adds the cut of one layer with the tool aside along x, y and up, to moved (3, S, 3, 6). turned: its weights where it is
    on its way; blank and each of gone_over (K, P) [m]: the distances there."""
    stock, aside, count = material.stock, material.aside, len(rows)

    def cut(some: NDArray[np.intp], other: Array) -> Array:
        """Weights (len(some), 3, 6) of steps where the blank is `other`."""
        return _turned(_arcs((other, *(one[some] for one in gone_over))), piece_of.at(some), axes.at(some), cutter)

    as_it_is = np.zeros((count, 3, 6)) if turned is None else turned
    # Two neighbours on the rim are so far apart: an edge that is further away than that does not pass between them.
    reach = aside + piece_of.radius * (ANGLE[1] - ANGLE[0])
    gone = np.minimum(*gone_over)
    feels = ((np.abs(blank) < reach[:, None]) & (blank - aside < gone) & (gone > -reach[:, None])).any(axis=1)
    some = np.flatnonzero(looking & feels)
    for axis in range(2):
        change = as_it_is.copy()
        if len(some):
            shift = np.zeros(2)
            shift[axis] = aside
            change[some] = cut(some, sampled(stock, stock.inside[layer], rim[some] + shift))
        moved[axis, rows] += change
    # Up: what stands in this layer is the blank a little higher, and under its floor there is some more of it.
    height = stock.height
    bottom, top = height[layer] - (aside if layer == 0 else 0.0), height[layer + 1]
    from_foot = np.maximum(bottom, tip)
    last = int(np.searchsorted(height, top + aside, side="left"))
    share_of_kind: dict[int, Array] = {}
    for other in range(layer, min(last, len(height) - 1)):
        thick = np.maximum(np.minimum(top, height[other + 1] - aside) - np.maximum(from_foot, height[other] - aside), 0.0)
        kind = int(material.kind[other])
        share_of_kind[kind] = share_of_kind.get(kind, np.zeros(count)) + np.where(
            looking, thick / np.maximum(piece_of.thick, 1e-12), 0.0)
    for kind, share in share_of_kind.items():
        if kind == material.kind[layer]:
            moved[2, rows] += share[:, None, None] * as_it_is
            continue
        some = np.flatnonzero(share > 0)
        if len(some):
            grid = stock.inside[int(np.argmax(material.kind == kind))]
            moved[2, rows[some]] += share[some, None, None] * cut(some, sampled(stock, grid, rim[some]))



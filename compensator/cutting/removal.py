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

from compensator.cutting.arcs import FILM, Arcs, arcs_of
from compensator.cutting.chips import weights
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
from compensator.cutting.places import Places, Steps
from compensator.cutting.sloping import beside_ball, front, go_along, met, rings, standing
from compensator.cutting.stock import Stock
from compensator.cutting.swept import Material, beside_own_way, between, distance, go_over, sampled, shanks_go_over
from compensator.cutting.track import Track
from identification.common.arrays import Array, read_only
from identification.common.progress import progress

Flags = NDArray[np.bool_]
Indices = NDArray[np.intp]
# Points of the half circle; steps of a batch.
POINTS, BATCH = 61, 24
ANGLE = np.linspace(-np.pi / 2, np.pi / 2, POINTS)
# A step that goes down by more than this in its length plunges [m/m]: the floor of the cutter cuts, which no end mill's
# coefficients describe; a ball has none, and near its tip, which stands next to still, it plunges too. A step that climbs by so
# much [m] is not level.
STEEPEST, STEEPEST_BALL, LEVEL = np.tan(np.radians(5.0)), np.tan(np.radians(60.0)), 1e-9
# So far up it is near its tip, in radii: there the feed turns the edges' speed on the way down.
TIP = 0.15
# Layers thinner than this, in radii, are samples of what slopes: between two of them it is in proportion.
THIN = 1 / 16


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

    def some(self, steps: Indices) -> Engagement:
        """Of these steps (n,)."""
        return Engagement(self.weights[steps], self.low[steps], self.high[steps], self.depth[steps], self.width[steps],
                          self.unknown[steps], None if self.moved is None else self.moved[:, steps])

    @property
    def cuts(self) -> Flags:
        """Steps (S,) that take material away."""
        return np.asarray(self.depth > 0)


def mill_through(stock: Stock, track: Track, cutter: Cutter, aside: float = 0.0) -> tuple[Engagement, Stock]:
    """How the cutter engages on its way through a stock, and what it leaves; aside [m]: also with the tool moved by so much
    along x, y and up, each by itself."""
    count = len(track)
    arrays = {"weights": np.zeros((count, 3, 6)), "low": np.full(count, np.nan), "high": np.full(count, np.nan),
              "depth": np.zeros(count), "area": np.zeros(count), "tip": np.zeros(count, dtype=bool)}
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
        in_a_box |= _reaches(track, cutter, low, high)
    cuts = arrays["depth"] > 0
    arrays["width"] = arrays.pop("area") / np.where(cuts, arrays["depth"], 1.0)
    # Where a ball leans so far that nothing is worked out, its shank may cut wherever there is stock.
    beyond = arrays.pop("beyond") | (near & leans_too_far(track.axis)) if cutter.ball else cuts & leans(track.axis)
    unknown = (cuts & (track.joint | _plunges(track, cutter, arrays.pop("tip")) | ~np.isfinite(track.chip))) | in_a_box | beyond
    return Engagement(unknown=unknown, **arrays), left


def _reaches(track: Track, cutter: Cutter, low: Array, high: Array) -> Flags:
    """Steps (S,) on which the tool, which is all that is above its tip, along its axis, comes into a box from low to high (3,)
    [m]."""
    upright = np.clip(track.axis[:, 2:], np.cos(MOST_LEAN), 1.0)
    radius, above = cutter.radius / upright, np.maximum(high[2] - track.lowest[:, 2:] - cutter.corner, 0.0)
    aside = above * track.axis[:, :2] / upright
    return np.asarray((track.highest[:, :2] + np.maximum(aside, 0.0) + radius >= low[:2]).all(axis=1)
                      & (track.lowest[:, :2] + np.minimum(aside, 0.0) - radius <= high[:2]).all(axis=1)
                      & (track.lowest[:, 2] <= high[2]))


def _plunges(track: Track, cutter: Cutter, tip: Flags) -> Flags:
    """Steps (S,) that go down, or up, too steeply for the cutter; tip (S,): it cuts near its tip."""
    way = track.end - track.start
    size = np.hypot(way[:, 0], way[:, 1])
    if cutter.ball:
        return np.asarray(tip & (-way[:, 2] > STEEPEST_BALL * size))
    # Rising, the floor cuts nothing, but the way of a rounding is known on the level alone.
    return np.asarray((np.abs(way[:, 2]) if cutter.corner else -way[:, 2]) > STEEPEST * size)


def _near(stock: Stock, track: Track, cutter: Cutter) -> Flags:
    """Steps (S,) on which the cutter may reach the stock."""
    _, ny, nx = stock.inside.shape
    # The shank of a tool that leans reaches further, as far up as there is stock.
    upright = np.clip(track.axis[:, 2:], np.cos(MOST_LEAN), 1.0)
    above = np.maximum(stock.height[-1] - track.lowest[:, 2:], 0.0)
    reach = cutter.radius / upright + above * np.sqrt(1 - upright**2) / upright
    low = stock.origin - reach
    high = stock.origin + stock.cell * np.array([nx - 1, ny - 1]) + reach
    return np.asarray((track.highest[:, :2] >= low).all(axis=1) & (track.lowest[:, :2] <= high).all(axis=1)
                      & (track.lowest[:, 2] < stock.height[-1]))


def _one_batch(material: Material, track: Track, cutter: Cutter, rows: Indices, into: dict[str, Array]) -> None:
    """Looks at the steps `rows` (K,), then goes over them."""
    stock, steps = material.stock, Steps.of(track, rows, cutter)
    tip = steps.middle[:, 2]
    layer_middle = 0.5 * (stock.height[1:] + stock.height[:-1])
    within = np.flatnonzero(stock.height[1:] > tip.min())
    if cutter.ball and len(within) and (np.abs(steps.start[:, 2] - steps.end[:, 2]) > LEVEL).any():
        up = np.array([0.0, 0.0, cutter.radius])
        first, last = steps.start + up, steps.end + up
        found = standing(material, cutter.radius, first, last, ~steps.leans, within)
        layer, step = met(found, cutter.radius, stock.cell, np.diff(stock.height))
        if steps.leans.any():       # its shank may meet what the ball does not
            other = np.array([(a, b) for a in within for b in np.flatnonzero(steps.leans)])
            layer, step = np.unique(np.concatenate([np.column_stack([layer, step]), other]), axis=0).T
        places = _places(stock, cutter, steps, layer, step)
        if len(places.step):
            rim = _rim(places, steps)
            spot = np.stack([rim[..., 0], rim[..., 1], np.broadcast_to((tip[places.step] + places.at)[:, None], rim.shape[:2])])
            _look(material, cutter, steps, places, rim, beside_ball(spot, places.step, first, last, ~steps.leans,
                                                                     cutter.radius), rows, into)
        go_along(material, cutter.radius, found)
        shanks_go_over(material, cutter, steps.start, steps.end, steps.axis, steps.leans, layer_middle, within)
        return
    rim_of: dict[bytes, tuple[Array, Array]] = {}
    for one in within:
        places = _places(stock, cutter, steps, np.full(len(rows), one), np.arange(len(rows)))
        if not len(places.step):
            continue
        gone = cutter.radius_at(layer_middle[one] - tip)
        key = places.step.tobytes() + places.radius.tobytes() + gone.tobytes()  # layers on the flank of a cutter are alike
        if key not in rim_of:
            rim = _rim(places, steps)
            rim_of[key] = (rim, beside_own_way(rim, places.step, steps.start, steps.end, gone))
        _look(material, cutter, steps, places, *rim_of[key], rows, into)
    go_over(material, cutter, steps.start, steps.end, steps.axis, steps.leans, layer_middle, within)


def _places(stock: Stock, cutter: Cutter, steps: Steps, layer: Indices, step: Indices) -> Places:
    """Those of steps in layers (M,) where the cutter is."""
    bottom, top, tip = stock.height[layer], stock.height[layer + 1], steps.middle[step, 2]
    # Of a layer that the tip stands in, the part above it.
    foot = np.maximum(bottom, tip) - tip
    thick = np.clip(top - np.maximum(bottom, tip), 0.0, top - bottom)
    at = np.maximum(0.5 * (top + bottom) - tip, 0.5 * thick)
    share = np.full(len(step), np.nan)
    if cutter.ball and steps.sloping:
        own, fine_foot, fine_thick = rings(foot, thick, cutter.radius, steps.travel[step, 2] != 0)
        step, layer, at = step[own], layer[own], np.where(fine_thick < thick[own], fine_foot + 0.5 * fine_thick, at[own])
        foot, thick, tip = fine_foot, fine_thick, tip[own]
        layer, share = between(stock, tip + at, THIN * cutter.radius)
    radius, sine = cutter.radius_at(at), cutter.sine_at(at)
    angle, gain = np.broadcast_to(ANGLE, (len(step), POINTS)), np.zeros(len(step))
    if steps.sloping:
        least = -steps.chip[step] / (2 * cutter.radius) if cutter.ball else np.zeros(len(step))
        angle = ANGLE * (front(sine, steps.travel[step], least) / (0.5 * np.pi))[:, None]
        gain = cutter.radius_at(np.minimum(foot + thick, cutter.flute)) - cutter.radius_at(np.minimum(foot, cutter.flute))
    some = np.flatnonzero((thick > 0) & (radius > 0))
    return Places(step, layer, thick, foot, at, radius, sine, gain, cutter.edge_length(foot, foot + thick), angle,
                  share)[some]


def _rim(places: Places, steps: Steps) -> Array:
    """Points (M, P, 2) [m] of the front."""
    angle, step = places.angle[:, :, None], places.step
    return np.asarray(steps.middle[step, None, :2] + places.radius[:, None, None] * (
        np.cos(angle) * steps.feed[step, None, :] + np.sin(angle) * steps.left[step, None, :]))


def _look(material: Material, cutter: Cutter, steps: Steps, places: Places, rim: Array, own: Array, rows: Indices,
          into: dict[str, Array]) -> None:
    """Adds what is cut at the places to the steps `rows` (K,); rim (M, P, 2) [m], own (M, P) [m]: how far that is outside of
    the way of this batch."""
    stock, step = material.stock, places.step
    if steps.leans.any():
        some = steps.leans[step]
        own = np.where(above_the_ball(places.angle, places.at, cutter.radius, steps.feed[step], steps.axis[step])
                       & some[:, None], -1.0, own)
        meets = some.copy()
        meets[some] = _shank_cuts(material, cutter, steps, places[np.flatnonzero(some)])
        into["beyond"][rows[step[meets]]] = True
    share = places.between
    blank = sampled(stock, stock.inside, places.layer, rim, share)
    gone_over = (sampled(stock, material.swept, places.layer, rim, share), own)
    turned = _add((blank, *gone_over), places, steps, cutter, rows, into)
    if material.aside:
        _add_moved(material, turned, blank, gone_over, rim, places, steps, cutter, rows, into["moved"])


def _shank_cuts(material: Material, cutter: Cutter, steps: Steps, places: Places) -> Flags:
    """Places (M,) of leaning tools at which what stands above the ball meets material."""
    stock, step, high = material.stock, places.step, places.at - cutter.radius
    rim = shank_rim(ANGLE, high, cutter.radius, steps.travel[step], steps.axis[step])
    points = steps.middle[step, None, :2] + np.nan_to_num(rim)
    own = np.ones(points.shape[:2])
    for before in np.flatnonzero(steps.leans[:-1]):
        height = high + steps.middle[step, 2] - steps.middle[before, 2]
        some, axis = np.flatnonzero((step > before) & (height > 0)), steps.axis[before]
        aside = height[some, None, None] * axis[:2] / axis[2]
        squeezed, first, last = (across_shank(xy, axis) for xy in (
            points[some] - aside, steps.start[before, :2], steps.end[before, :2]))
        own[some] = np.minimum(own[some], distance(squeezed, first, last) - cutter.radius)
    for grid in (stock.inside, material.swept):
        own = np.minimum(own, sampled(stock, grid, places.layer, points, places.between))
    return np.asarray(((own > FILM) & ~np.isnan(rim[..., 0])).any(axis=1))


def _turned(arcs: Arcs, places: Places, steps: Steps, cutter: Cutter) -> Array:
    """Weights (M, 3, 6) in the work object of what is cut; local axes are feed, left, up."""
    step = places.step
    rise = steps.travel[step, 2]
    slope = (np.hypot(*steps.travel[:, :2].T)[step], rise * places.gain) if steps.sloping else ()
    local = weights(arcs.integral, places.thick, places.sine, places.edge, cutter.teeth, *slope)
    turned = local.copy()
    turned[:, :2] = np.einsum("kai,kac->kic", np.stack([steps.feed, steps.left], axis=1)[step], local[:, :2])
    leaning = steps.leans[step] | ((rise < 0) & cutter.ball & (places.foot < TIP * cutter.radius))
    if leaning.any():
        some = np.flatnonzero(leaning[arcs.place])
        place = arcs.place[some]
        own = step[place]
        each = leaning_weights(arcs.begin[some], arcs.stop[some], places.foot[place], places.thick[place], cutter,
                               steps.feed[own], steps.travel[own], steps.axis[own], steps.chip[own])
        turned[leaning] = 0.0
        np.add.at(turned, place, each)
    return turned


def _add(inside: tuple[Array, ...], places: Places, steps: Steps, cutter: Cutter, rows: Indices, into: dict[str, Array]
         ) -> Array:
    """Adds the cut of the places to the steps, and returns its weights (M, 3, 6)."""
    arcs = arcs_of(inside, places.angle)
    summed, at = arcs.integral, rows[places.step]
    turned = np.zeros((len(at), 3, 6))
    cut = np.flatnonzero(summed[:, 4] > 0)
    if not len(cut):
        return turned
    turned = _turned(arcs, places, steps, cutter)
    np.add.at(into["weights"], at[cut], turned[cut])
    np.fmin.at(into["low"], at[arcs.place], arcs.begin)
    np.fmax.at(into["high"], at[arcs.place], arcs.stop)
    np.add.at(into["depth"], at[cut], places.thick[cut])
    into["tip"][at[cut[places.foot[cut] < TIP * cutter.radius]]] = True
    travel = steps.travel[places.step[cut]]
    np.add.at(into["area"], at[cut], places.radius[cut] * (
        np.hypot(*travel[:, :2].T) * places.thick[cut] * summed[cut, 2] - travel[:, 2] * places.gain[cut] * summed[cut, 4]))
    return turned


def _add_moved(material: Material, turned: Array, blank: Array, gone_over: tuple[Array, ...], rim: Array, places: Places,
               steps: Steps, cutter: Cutter, rows: Indices, moved: Array) -> None:
    """Adds the cut of the places with the tool aside along x, y and up, to moved (3, S, 3, 6). turned (M, 3, 6): its weights
    where it is on its way; blank and each of gone_over (M, P) [m]: the distances there."""
    stock, aside, at = material.stock, material.aside, rows[places.step]

    def cut(some: Indices, other: Array) -> Array:
        """Weights (len(some), 3, 6) of places where the blank is `other`."""
        own = places[some]
        return _turned(arcs_of((other, *(one[some] for one in gone_over)), own.angle), own, steps, cutter)

    sloping = places.between is not None
    # Two neighbours on the rim are so far apart: an edge that is further away than that does not pass between them.
    reach = aside + places.radius * (places.angle[:, 1] - places.angle[:, 0])
    gone = np.minimum(*gone_over)
    some = np.flatnonzero(((np.abs(blank) < reach[:, None]) & (blank - aside < gone) & (gone > -reach[:, None])).any(axis=1))
    for axis in range(2):
        change = turned.copy()
        if len(some):
            shift = np.zeros(2)
            shift[axis] = aside
            change[some] = cut(some, sampled(stock, stock.inside, places.layer[some], rim[some] + shift,
                                             places.share[some] if sloping else None))
        np.add.at(moved[axis], at, change)
    if sloping:
        # What stands a little higher, up to the top of it all.
        lowest = steps.middle[places.step, 2] + places.foot + aside
        under = np.clip((stock.height[-1] - lowest) / places.thick, 0.0, 1.0)
        layer, share = between(stock, steps.middle[places.step, 2] + places.at + aside, THIN * cutter.radius)
        some = np.flatnonzero((under > 0) & (turned.any(axis=(1, 2)) | (gone > 0).any(axis=1)))
        if len(some):
            np.add.at(moved[2], at[some], under[some, None, None] * cut(
                some, sampled(stock, stock.inside, layer[some], rim[some], share[some])))
        return
    # Up: what stands in this layer is the blank a little higher, and under its floor there is some more of it.
    height, kind, layer = stock.height, material.kind, places.layer
    tip = steps.middle[places.step, 2]
    from_foot = tip + places.foot
    top = from_foot + places.thick
    from_foot = np.where(layer == 0, np.maximum(height[0] - aside, tip), from_foot)
    for further in range(len(kind)):
        above = np.flatnonzero((layer + further < len(kind)) & (height[np.minimum(layer + further, len(kind))] < top + aside))
        if not len(above):
            break
        other = layer[above] + further
        thick = np.minimum(top[above], height[other + 1] - aside) - np.maximum(from_foot[above], height[other] - aside)
        share = np.maximum(thick, 0.0) / places.thick[above]
        alike = kind[other] == kind[layer[above]]
        np.add.at(moved[2], at[above[alike]], share[alike, None, None] * turned[above[alike]])
        unlike = ~alike & (share > 0)
        if unlike.any():
            some = above[unlike]
            np.add.at(moved[2], at[some], share[unlike, None, None] * cut(
                some, sampled(stock, stock.inside, other[unlike], rim[some])))

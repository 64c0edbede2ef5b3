"""Steps of a batch, and the places that are looked at on them: each a step in a layer of the stock."""

from __future__ import annotations

from dataclasses import dataclass, fields
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from compensator.cutting.cutter import Cutter
from compensator.cutting.leaning import leans, leans_too_far
from compensator.cutting.track import Track
from identification.common.arrays import Array

Flags = NDArray[np.bool_]
Indices = NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class Places:
    """M places to look at, each a step in a layer: step, of the K of a batch, and layer (M,); thick (M,) [m] of the layer above
    the tip, foot (M,) [m]: where that begins, above the tip; at (M,) [m] above the tip: where it is looked at; radius (M,) [m]
    and sine (M,) of the cutter there; gain (M,) [m]: of radius over the thickness, edge (M,) [m]; angle (M, P) [rad] of the
    points of the front, from the feed; share (M,): of the layer above, NaN: what the layer says holds for all of it."""

    step: Indices
    layer: Indices
    thick: Array
    foot: Array
    at: Array
    radius: Array
    sine: Array
    gain: Array
    edge: Array
    angle: Array
    share: Array

    def __getitem__(self, some: Indices) -> Places:
        return Places(*(getattr(self, field.name)[some] for field in fields(self)))

    @property
    def between(self) -> Array | None:
        """`share`, None where each is in one layer."""
        return None if np.isnan(self.share).any() else self.share


@dataclass(frozen=True, eq=False)
class Steps:
    """K steps of a batch: start, end (K, 3) [m] of the tip; feed and its left (K, 2), level; travel (K, 3): the feed with its
    slope; chip (K,) [m]: feed a tooth; the tool's axis (K, 3), and whether it leans (K,) and is that of a ball."""

    start: Array
    end: Array
    feed: Array
    left: Array
    travel: Array
    chip: Array
    axis: Array
    leans: Flags

    @classmethod
    def of(cls, track: Track, rows: Indices, cutter: Cutter) -> Steps:
        """Of a track."""
        start, end, axis = track.start[rows], track.end[rows], track.axis[rows]
        way = end - start
        size = np.hypot(way[:, 0], way[:, 1])
        feed = np.where((size > 1e-9)[:, None], way[:, :2] / np.maximum(size, 1e-12)[:, None], [1.0, 0.0])
        level, rise = np.where(size > 1e-9, size, 0.0), way[:, 2]
        full = np.maximum(np.hypot(level, rise), 1e-12)
        travel = np.column_stack([(level / full)[:, None] * feed, rise / full])
        return cls(start, end, feed, np.column_stack([-feed[:, 1], feed[:, 0]]), travel, np.nan_to_num(track.chip[rows]), axis,
                   leans(axis) & ~leans_too_far(axis) & cutter.ball)

    @cached_property
    def sloping(self) -> bool:
        """Whether any of them climbs or descends."""
        return bool(self.travel[:, 2].any())

    @cached_property
    def middle(self) -> Array:
        """Of the tip (K, 3) [m]."""
        return np.asarray(0.5 * (self.start + self.end))

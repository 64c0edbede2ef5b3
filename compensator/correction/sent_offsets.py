"""The offsets that a program had in a logged pass, between its targets too: `correct` adds targets where a correction changes
on the way, and these carry it there. A pass along 110 mm may have no offset at either end and a millimetre in between."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from compensator.correction.predict import Predicted
from compensator.path.robot_path import RobotPath
from identification.common.added_targets import ADDED, ADDED_OFFSETS, added_of, added_offsets
from identification.common.findings import Finding, counted, error
from identification.common.tables import read_table

Array = NDArray[np.float64]
Indices = NDArray[np.intp]
# The planned positions in an offsets file are this program's [m].
SAME_PLACE = 2e-6
OFFSETS, PLACES = ("ox_mm", "oy_mm", "oz_mm"), ("x_mm", "y_mm", "z_mm")


@dataclass(frozen=True, eq=False)
class SentOffsets:
    """place (W,), ascending: where the targets of the program that was driven stand, counted in targets as given: target j at
    j, one that was added at half of the move to it at j - 0.5. offset (W, 3) [m], base frame: straight from one to the next."""

    place: Array
    offset: Array
    findings: tuple[Finding, ...] = ()

    @property
    def _given(self) -> NDArray[np.bool_]:
        return np.asarray(self.place == np.round(self.place))

    @property
    def has_added(self) -> bool:
        return not bool(self._given.all())

    def without_added(self) -> SentOffsets:
        """Those of the planned program whose offsets were pushed to it."""
        return SentOffsets(self.place[self._given], self.offset[self._given], self.findings)

    def of(self, targets: Indices) -> SentOffsets:
        """Those of a part of the program, whose targets as given these (K,) are, ascending."""
        to, share = np.ceil(self.place).astype(np.intp), self.place - np.ceil(self.place)
        at = np.minimum(np.searchsorted(targets, to), len(targets) - 1)
        follows = np.diff(targets, prepend=-2) == 1
        here = (targets[at] == to) & ((share == 0) | follows[at])
        return SentOffsets((at + share)[here], self.offset[here], self.findings)

    def at(self, place: Array) -> Array:
        """At any places (n,): (n, 3) [m]."""
        return np.column_stack([np.interp(place, self.place, axis) for axis in self.offset.T])

    def at_targets(self, length: Array) -> Array:
        """At the targets as given (N,), at path lengths (N,) [m], as `felt`: (N, 3) [m]."""
        return self.felt(np.arange(float(len(length))), length)

    def felt(self, place: Array, length: Array) -> Array:
        """At the points of a path (G,), at path lengths (G,) [m], as a log's mean force knows them: where added targets stand
        within the half ways beside a point, the mean over these, which that of the force is; else the offset at it."""
        own = self.at(place)
        start, end = place.copy(), place.copy()
        start[1:] -= 0.5 * np.diff(place)
        end[:-1] += 0.5 * np.diff(place)
        added = self.place[~self._given]
        within = np.searchsorted(added, end, side="left") - np.searchsorted(added, start, side="right")
        way = np.nan_to_num(np.diff(length), nan=0.0)
        before, behind = np.insert(way, 0, 0.0), np.append(way, 0.0)
        total = before + behind
        mean = (before[:, None] * self._mean(start, place) + behind[:, None] * self._mean(place, end)) / np.where(
            total > 0, total, 1.0)[:, None]
        return np.asarray(np.where(((within > 0) & (total > 0))[:, None], mean, own))

    def _mean(self, start: Array, end: Array) -> Array:
        """Means (G, 3) over stretches of places; at a point where one has no length."""
        width = end - start
        area = self._area(end) - self._area(start)
        return np.asarray(np.where(width[:, None] > 0, area / np.where(width > 0, width, 1.0)[:, None], self.at(end)))

    def _area(self, place: Array) -> Array:
        """The integral (G, 3) of the offsets from the first target to places (G,)."""
        step = np.diff(self.place)[:, None]
        whole = np.vstack([np.zeros(3), np.cumsum(0.5 * step * (self.offset[1:] + self.offset[:-1]), axis=0)])
        last = np.clip(np.searchsorted(self.place, place, side="right") - 1, 0, len(self.place) - 1)
        rest = np.maximum(place - self.place[last], 0.0)[:, None]
        return np.asarray(whole[last] + rest * 0.5 * (self.offset[last] + self.at(place)))


def places_of(kept: Indices, length: Array) -> Array:
    """Where the points (G,) of a path at path lengths (G,) [m] stand, counted in targets as given, which are at `kept` (N,)."""
    point = np.arange(len(length))
    to = np.minimum(np.searchsorted(kept, point), len(kept) - 1)
    start, end = kept[np.maximum(to - 1, 0)], kept[to]
    with np.errstate(invalid="ignore", divide="ignore"):
        share = (length - length[start]) / (length[end] - length[start])
    by_number = (point - start) / np.maximum(end - start, 1)
    share = np.where(np.isfinite(share) & (share >= 0) & (share <= 1), share, by_number)
    return np.asarray(np.where(point == end, to, to - 1 + np.clip(share, 0.0, 1.0)), dtype=float)


def read_offsets(file: Path, path: RobotPath) -> SentOffsets:
    """The offsets that the program had in a pass: an offsets.csv of this program, the targets that were added among them.

    Raises CompstiffError: CS4121 the file belongs to another program, or is none that `correct` wrote; what `read_table`
    raises.
    """
    table = read_table(file, required=("target", *OFFSETS), optional=PLACES, texts=(ADDED, *ADDED_OFFSETS), may_be_empty=PLACES)
    count = len(path.toolpath)
    wrong = "" if np.array_equal(table.numbers["target"], np.arange(count)) else (
        f"has {counted(len(table), 'row')}, the program {counted(count, 'target')}: expected one row a target, in order")
    if not wrong and all(name in table.numbers for name in PLACES):
        apart = np.linalg.norm(1e-3 * table.stack(*PLACES) - path.toolpath.position, axis=1)
        if np.nanmax(apart, initial=0.0) > SAME_PLACE:
            wrong = f"target {int(np.nanargmax(apart))} is {1e3 * np.nanmax(apart):.4g} mm from where this program has it"
    if wrong:
        raise error("CS4121", f"these are not the offsets of this program: {wrong}", file=str(file),
                    hint="name the offsets.csv that was written with the program the log was taken with")
    base, own = path.base_from_object.rotation, 1e-3 * table.stack(*OFFSETS)
    added = added_of(table)
    if added is None:
        return SentOffsets(np.arange(float(count)), np.einsum("nij,nj->ni", base, own))
    between = added_offsets(table, added)
    if between is None:
        old = Finding("CS4130", "warning", f"does not say which offsets the {counted(int((added.share < 1).sum()), 'target')} "
                      "had that were added: they are taken to lie straight between those of the program's own", file=str(file),
                      hint="it was written by an older version; correct the first log once more for offsets that say it")
        return SentOffsets(np.arange(float(count)), np.einsum("nij,nj->ni", base, own), (old,))
    offset = np.where((added.share == 1)[:, None], own[added.given], between)
    return SentOffsets(added.given - 1 + added.share, np.einsum("nij,nj->ni", base[added.given], offset))


def driven_with(offsets: SentOffsets, planned: Predicted) -> SentOffsets:
    """Those of the corrected program, or, where the log shows so, those of the planned one that had its own pushed: the targets
    that were added were not driven then. A log without positions is taken to be of the corrected program."""
    log = planned.forces.log
    if not offsets.has_added:
        return offsets
    if log.key == "target" and all(finding.code != "CS4127" for finding in log.findings):
        return offsets.without_added()
    if log.beside is None or planned.path.axes.driven:
        return offsets
    placed = np.isfinite(log.place) & np.isfinite(log.beside).all(axis=1)
    length = planned.path.length
    known = np.flatnonzero(np.isfinite(length))
    place = np.interp(log.place[placed], np.maximum.accumulate(length[known]), known)
    beside = planned.path.axes.world_from_base.inverse().turn(log.beside[placed])
    # Of the offsets the part across the path shows: by its own direction, which is that of what is beside.
    away = [float(np.sum((each.at(place) - beside)**2)) for each in (offsets, offsets.without_added())]
    return offsets if away[0] <= away[1] else offsets.without_added()


def corrected_offsets(offset: Array, kept: Indices, length: Array) -> SentOffsets:
    """The offsets (G, 3) [m] of a program that has targets as given at `kept` (N,) and others between them."""
    place = places_of(kept, length)
    ascending = np.append(True, np.diff(np.maximum.accumulate(place)) > 0)
    return replace(SentOffsets(place, offset), place=place[ascending], offset=offset[ascending])

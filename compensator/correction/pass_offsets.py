"""The offsets that a program had in a pass: at its targets as given, and at those that `correct` added between them."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from compensator.correction.predict import Predicted
from compensator.path.robot_path import RobotPath
from identification.common.added_targets import ADDED, ADDED_MM, added_of, added_offsets
from identification.common.arrays import Array, read_only
from identification.common.findings import Finding, counted, error
from identification.common.tables import read_table

Indices = NDArray[np.intp]
# The planned positions in an offsets file are this program's [m].
SAME_PLACE = 2e-6
# A stretch of a path that is shorter [m] is a place.
NO_WAY = 1e-9
OFFSETS, PLACES = ("ox_mm", "oy_mm", "oz_mm"), ("x_mm", "y_mm", "z_mm")


@dataclass(frozen=True, eq=False)
class PassOffsets:
    """given (N, 3) [m], base frame, at the targets as given; added (A, 3) [m] at those that were added, each before the target
    `before` (A,), at `share` (A,) of the move to it, ascending. Between all of these they are straight."""

    given: Array
    before: Indices
    share: Array
    added: Array
    findings: tuple[Finding, ...] = ()

    def __post_init__(self) -> None:
        read_only(self.given, self.before, self.share, self.added)

    @staticmethod
    def at_targets(given: Array) -> PassOffsets:
        """Of a program without added targets."""
        return PassOffsets(given, np.empty(0, dtype=np.intp), np.empty(0), np.empty((0, 3)))

    @staticmethod
    def of_written(offset: Array, path: RobotPath, kept: Indices) -> PassOffsets:
        """Of a program with offsets (W, 3) [m], in which the targets as given stand at `kept` (N,)."""
        added = np.setdiff1d(np.arange(len(offset)), kept)
        before = np.searchsorted(kept, added)
        length = np.maximum.accumulate(np.nan_to_num(path.length))
        start, end = length[kept[before - 1]], length[kept[before]]
        return PassOffsets(offset[kept], before, (length[added] - start) / np.maximum(end - start, NO_WAY), offset[added])

    def without_added(self) -> PassOffsets:
        """Of the planned program, whose offsets were pushed to it."""
        return PassOffsets(self.given, self.before[:0], self.share[:0], self.added[:0], self.findings)

    def some(self, targets: Indices) -> PassOffsets:
        """At these targets (K,), ascending, and at the added ones of moves between two of them that follow each other."""
        row = np.clip(np.searchsorted(targets, self.before), 1, len(targets) - 1)
        here = (targets[row] == self.before) & (targets[row - 1] == self.before - 1)
        return PassOffsets(self.given[targets], row[here], self.share[here], self.added[here], self.findings)

    def in_order(self, given: Array, added: Array) -> Array:
        """Values of the targets as given (N, ...) and of the added ones (A, ...), as the path comes by them (N + A, ...)."""
        number = np.concatenate([np.arange(len(given)), self.before - 1 + self.share])
        return np.asarray(np.concatenate([given, added])[np.argsort(number, kind="stable")])

    def length(self, given: Array) -> Array:
        """Path lengths (N + A,) [m] in this order, by those of the targets as given (N,)."""
        start = given[self.before - 1]
        return self.in_order(given, start + self.share * (given[self.before] - start))

    @property
    def offset(self) -> Array:
        """(N + A, 3) [m] in this order."""
        return self.in_order(self.given, self.added)

    def at(self, path: RobotPath, place: Array) -> Array:
        """At path lengths (n,) [m] of the planned program: (n, 3) [m]."""
        where = self.length(np.maximum.accumulate(np.nan_to_num(path.length)))
        return np.column_stack([np.interp(place, where, axis) for axis in self.offset.T])

    def over(self, path: RobotPath, kept: Indices | None = None) -> Array:
        """Means (W, 3) [m] over half the way to the neighbours of each target of a path in which the targets as given stand at
        `kept` (N,), None: it has no others: the way that the mean force of a target is of."""
        count = len(path.toolpath)
        kept = np.arange(count) if kept is None else kept
        if not len(self.before) and len(kept) == count:
            return self.given.copy()
        place = np.maximum.accumulate(np.nan_to_num(path.length))
        where, offset = self.length(place[kept]), self.offset
        total = np.cumsum(0.5 * np.diff(where)[:, None] * (offset[1:] + offset[:-1]), axis=0)
        total = np.vstack([np.zeros((1, 3)), total])

        def at(length: Array) -> tuple[Array, Array]:
            """The offsets at path lengths (n,), and their integral up to there."""
            first = np.clip(np.searchsorted(where, length, side="right") - 1, 0, len(where) - 2)
            way = length - where[first]
            share = np.clip(way / np.maximum(where[first + 1] - where[first], NO_WAY), 0, 1)[:, None]
            here = offset[first] + share * (offset[first + 1] - offset[first])
            return here, total[first] + 0.5 * way[:, None] * (offset[first] + here)

        border = 0.5 * (place[1:] + place[:-1])
        way = np.diff(np.concatenate([place[:1], border, place[-1:]]))[:, None]
        integral = at(np.concatenate([place[:1], border, place[-1:]]))[1]
        there = at(place)[0]
        there[kept] = self.given
        return np.where(way > NO_WAY, np.diff(integral, axis=0) / np.maximum(way, NO_WAY), there)


def offsets_of_pass(file: Path, predicted: Predicted) -> PassOffsets:
    """Those of the corrected program, as its offsets.csv has them; or, where its log shows so, of the planned one to which its
    own were pushed: the added targets were not driven then. A log that tells neither places nor targets is taken to be of the
    corrected program. Raises what `read_offsets` raises."""
    offsets, log, path = read_offsets(file, predicted.path), predicted.forces.log, predicted.path
    if not len(offsets.before):
        return offsets
    pushed = offsets.without_added()
    if log.key == "target":
        return offsets if any(finding.code == "CS4127" for finding in log.findings) else pushed
    if log.beside is None or path.axes.driven:
        return offsets
    placed = np.isfinite(log.place) & np.isfinite(log.beside).all(axis=1)
    beside = path.axes.world_from_base.inverse().turn(log.beside[placed])
    away = [float(np.sum((each.at(path, log.place[placed]) - beside) ** 2)) for each in (offsets, pushed)]
    return offsets if away[0] <= away[1] else pushed


def read_offsets(file: Path, path: RobotPath) -> PassOffsets:
    """What the corrected program has: an offsets.csv of this program.

    Raises CompstiffError: CS4121 the file belongs to another program, or tells of its added targets what it cannot; and what
    `read_table` raises.
    """
    table = read_table(file, required=("target", *OFFSETS), optional=PLACES, may_be_empty=PLACES, texts=(ADDED, ADDED_MM))
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
    turn = path.base_from_object.rotation
    given = np.einsum("nij,nj->ni", turn, 1e-3 * table.stack(*OFFSETS))
    added, offsets = added_of(table), added_offsets(table)
    if added is None or offsets is None:
        found = PassOffsets.at_targets(given)
        return found if added is None else _without_their_offsets(found, str(file))
    beside = added.share < 1
    before = added.given[beside]
    return PassOffsets(given, before, added.share[beside], np.einsum("nij,nj->ni", turn[before], 1e-3 * offsets))


def _without_their_offsets(found: PassOffsets, file: str) -> PassOffsets:
    said = Finding("CS4130", "warning", f"targets were added, and what offsets they had is not in the file (column {ADDED_MM}):"
                   " they count as straight between the targets of the program", file=file,
                   hint="correct anew with this version, and log that pass")
    return PassOffsets(found.given, found.before, found.share, found.added, (said,))

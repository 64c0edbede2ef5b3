"""The loads of one run: which forces are applied, in which order, while the robot stands at one pose."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from identification.design.dead_weights import EMPTY, DeadWeights, Level

Array = NDArray[np.float64]
Indices = NDArray[np.intp]
AXES = "xyz"
FREE, DOWN = "free", "down"
# Up in three steps, back to zero, two steps to the other side: both signs, more than three magnitudes, a zero reading between.
CYCLE = (0.0, 1 / 3, 2 / 3, 1.0, 0.0, -0.5, -1.0)
SINGLE = (0.0, 1.0)
PROTOCOLS = {"cycle": CYCLE, "single": SINGLE}


@dataclass(frozen=True, eq=False)
class Slot:
    """name: the axes that are loaded, such as "y", "free" for a line of its own at each pose, or "down" for dead weights.
    forces (L, 3) [N] at the TCP in the base frame, in their order; of a free slot, as if that line were x. hung: the weights
    that hang at each row, empty where nothing is hung."""

    name: str
    forces: Array
    hung: tuple[Level, ...] = ()

    @property
    def one_way(self) -> bool:
        """Whether the loads cannot be turned round: weights only pull down."""
        return bool(self.hung)

    @property
    def free(self) -> bool:
        """Whether each run has a line of its own."""
        return self.name == FREE

    def along(self, line: Array) -> Array:
        """The forces (L, 3) [N] of a run; line (3,): where a free slot's loads act."""
        if not self.free:
            return self.forces
        return np.asarray(self.forces[:, :1] * line, dtype=float)

    @cached_property
    def grouped(self) -> list[tuple[Array, Array]]:
        """Distinct forces up to their sign (3,) [N], and the signs of the rows that have them."""
        groups: list[tuple[Array, list[float]]] = []
        for force in self.forces:
            for first, signs in groups:
                if np.array_equal(first, force) or np.array_equal(first, -force):
                    signs.append(1.0 if np.array_equal(first, force) else -1.0)
                    break
            else:
                groups.append((force, [1.0]))
        return [(force, np.array(signs)) for force, signs in groups]

    @cached_property
    def peaks(self) -> Array:
        """The largest force (A, 3) [N] along each line that is loaded."""
        peaks: list[Array] = []
        for force in self.forces[np.argsort(-np.linalg.norm(self.forces, axis=1), kind="stable")]:
            size = np.linalg.norm(force)
            if size > 0 and not any(abs(force @ peak) > (1 - 1e-9) * size * np.linalg.norm(peak) for peak in peaks):
                peaks.append(force)
        return np.array(peaks)


@dataclass(frozen=True, eq=False)
class Loads:
    """The loads of n runs (or of one, for all). force (n, K, 3) [N]: distinct ones up to their sign; rows (n, K): how many rows
    have them; surplus (n, K): rows with them less rows against; peak (n, A, 3) [N]: the largest along each axis.

    by_line (n, K), peak_by_line (n, A): derivative of force and peak by the run's line, 0 where it has none.
    """

    force: Array
    rows: Array
    surplus: Array
    peak: Array
    by_line: Array
    peak_by_line: Array


@dataclass(frozen=True, eq=False)
class LoadTable:
    """The loads of all slots, padded to one size by loads that no row has and by peaks that are there already."""

    slots: tuple[Slot, ...]

    @cached_property
    def _stacked(self) -> Loads:
        most = max(len(slot.grouped) for slot in self.slots)
        peaks = max(len(slot.peaks) for slot in self.slots)
        force, peak = np.zeros((len(self.slots), most, 3)), np.zeros((len(self.slots), peaks, 3))
        rows, surplus = np.zeros((2, len(self.slots), most))
        for s, slot in enumerate(self.slots):
            for k, (magnitude, signs) in enumerate(slot.grouped):
                force[s, k], rows[s, k], surplus[s, k] = magnitude, signs.size, signs.sum()
            peak[s] = slot.peaks[np.minimum(np.arange(peaks), len(slot.peaks) - 1)]
        free = np.array([slot.free for slot in self.slots])[:, None]
        return Loads(force, rows, surplus, peak, np.where(free, force[:, :, 0], 0.0), np.where(free, peak[:, :, 0], 0.0))

    @property
    def free(self) -> bool:
        """Whether a run may have a line of its own."""
        return any(slot.free for slot in self.slots)

    def of(self, slot: Indices, line: Array) -> Loads:
        """The loads of runs with these slots (n,); line (n, 3): the lines of those that have one."""
        table = self._stacked
        force, peak = table.force[slot], table.peak[slot]
        by_line, peak_by_line = table.by_line[slot], table.peak_by_line[slot]
        if self.free:
            own = np.array([each.free for each in self.slots])[slot][:, None, None]
            force = np.where(own, by_line[:, :, None] * line[:, None], force)
            peak = np.where(own, peak_by_line[:, :, None] * line[:, None], peak)
        return Loads(force, table.rows[slot], table.surplus[slot], peak, by_line, peak_by_line)


def slot(axes: str, protocol: str, force: float) -> Slot:
    """The protocol along each of `axes` in turn, one base axis at a time, up to +-force [N]; axes "free": along a line of the
    run's own."""
    steps = force * np.array(PROTOCOLS[protocol])
    if axes == FREE:
        return Slot(FREE, np.outer(steps, np.eye(3)[0]))
    return Slot(axes, np.concatenate([np.outer(steps, np.eye(3)[AXES.index(axis)]) for axis in axes]))


def weight_slot(weights: DeadWeights, protocol: str, fall: Array) -> Slot:
    """Dead weights hung on and taken off ("cycle"), or the heaviest level alone ("single"); fall (3,) [m/s^2], base frame."""
    steps = weights.steps if protocol == "cycle" else (EMPTY, weights.rising[-1], EMPTY)
    return Slot(DOWN, weights.forces(steps, fall), steps)


def loads_of(slot: Slot, line: Sequence[float] = (1.0, 0.0, 0.0)) -> Loads:
    """The loads of one slot, for any number of runs."""
    return LoadTable((slot,)).of(np.zeros(1, dtype=np.intp), np.array([line], dtype=float))

"""The rows of a log by the targets they belong to: means, and their standard errors by batch means."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from identification.common.arrays import Array
from identification.model.kinematics import chunks

Indices = NDArray[np.intp]
BATCHES = 8
# Of so many batches and more the straight line through them is taken off.
STRAIGHT = 4
# Targets at a time: bounds the memory their batches take.
CHUNK = 8192


@dataclass(frozen=True, eq=False)
class TargetRows:
    """The m rows of a log that lie on targets, of which there are `count` (N). target (m,) of each row; weight (m,): samples in
    it. behind (m,): the row was taken on the way to the next target, where that is known."""

    count: int
    target: Indices
    weight: Array
    behind: NDArray[np.bool_] | None = None

    @cached_property
    def samples(self) -> Array:
        """How many samples (N,) each target has."""
        return np.asarray(np.bincount(self.target, self.weight, minlength=self.count))

    @cached_property
    def rows(self) -> Indices:
        """How many rows (N,) each target has."""
        return np.bincount(self.target, minlength=self.count)

    def sum(self, values: Array) -> Array:
        """Sum (N,) over the samples of each target of what its rows have, values (m,)."""
        return np.asarray(np.bincount(self.target, self.weight * values, minlength=self.count))

    def mean(self, values: Array) -> Array:
        """Mean (N, c) over the samples of each target of what its rows have, values (m, c); 0 without any."""
        return np.column_stack([self.sum(column) for column in values.T]) / np.maximum(self.samples, 1)[:, None]

    def between(self, first: int, last: int) -> Indices:
        """The rows of the targets `first` to `last`, those on the way to the next one left out: that move may cut."""
        inside = np.flatnonzero((self.target >= first) & (self.target <= last))
        if self.behind is None or last >= self.count - 1:
            return inside
        before = inside[~(self.behind[inside] & (self.target[inside] == last))]
        return before if len(before) else inside

    def standard_error(self, force: Array, mean: Array, window: float) -> Array:
        """Standard error (N, 3) of the mean force by batch means, NaN under two rows: force (m, 3) with mean (N, 3), which are
        means over `window` samples already (0: they are not).

        Samples that follow each other are not independent (tooth passing, the sensor's own filter): the scatter is that of up
        to 8 consecutive batches a target. From STRAIGHT of them on it is that about the straight line through them, of fewer
        that about the slope of the neighbours' means: a force that grows along a stretch is no error of its mean. Of means over
        a revolution no batch is shorter than one where there are two, and the scatter is put up by what white noise loses to
        that mean.
        """
        batches = self.batches(window)
        order = None if (np.diff(self.target) >= 0).all() else np.argsort(self.target, kind="stable")
        ends = np.append(0, np.cumsum(self.rows))
        errors = np.full((self.count, 3), np.nan)
        for part in chunks(self.count, CHUNK):
            of_part = slice(int(ends[part.start]), int(ends[part.stop]))
            errors[part] = self._errors(part, of_part if order is None else order[of_part], ends, force, mean, batches[part],
                                        window)
        return errors

    def _slope(self, part: slice, mean: Array, window: float) -> Array:
        """How much the mean force (n, 3) [N] of some targets grows from one to the next, by their neighbours; 0 where one of
        these has no row, or where means over `window` samples are longer than the stretch and are the neighbours' too."""
        number = np.arange(self.count)[part]
        before, behind = np.maximum(number - 1, 0), np.minimum(number + 1, self.count - 1)
        there = (self.rows[before] > 0) & (self.rows[behind] > 0) & (before < number) & (behind > number)
        there &= self.samples[part] >= window
        return np.where(there[:, None], 0.5 * (mean[behind] - mean[before]), 0.0)

    def batches(self, window: float) -> Indices:
        """The batches (N,) that the rows of each target are taken in, which are means over `window` samples."""
        most = np.clip(self.samples // window, 2, BATCHES).astype(np.intp) if window else np.full(self.count, BATCHES)
        return np.asarray(np.minimum(self.rows, most))

    def degrees(self, window: float) -> Indices:
        """The degrees of freedom (N,) of `standard_error`."""
        batches = self.batches(window)
        return np.asarray(batches - np.where(batches >= STRAIGHT, 2, 1))

    def _errors(
        self, part: slice, places: slice | Indices, ends: Indices, force: Array, mean: Array, batches: Indices, window: float
    ) -> Array:
        """`standard_error` (n, 3) of some targets, whose rows stand at these places, target by target; ends (N + 1,): how many
        rows those before each target have; batches (n,) of each."""
        target, weight, own = self.target[places], self.weight[places], self.rows[part]
        count = len(own)
        here = target - part.start
        rank = np.arange(ends[part.start], ends[part.stop]) - ends[target]
        batch = here * BATCHES + rank * batches[here] // own[here]
        size = np.bincount(batch, weight, minlength=count * BATCHES).reshape(count, BATCHES)
        rise, enough = _rise(batches), own >= 2
        beside = _beside(batches)
        slope = self._slope(part, mean, window)
        by_scatter = _mean_by_scatter(self.samples[part], batches, window, rise)
        errors = np.full((count, 3), np.nan)
        for axis in range(3):
            total = np.bincount(batch, weight * force[places, axis], minlength=count * BATCHES).reshape(count, BATCHES)
            spread = np.where(size > 0, total / np.maximum(size, 1) - mean[part, axis, None], 0.0)
            spread -= slope[:, axis, None] * beside
            with np.errstate(over="ignore", invalid="ignore"):          # absurd numbers
                straight = (spread * rise).sum(axis=1)
                variance = np.maximum((spread**2).sum(axis=1) - straight**2, 0.0) * by_scatter
            errors[enough, axis] = np.sqrt(variance[enough])
        return errors


def _beside(batches: Indices) -> Array:
    """How far beside the middle of its stretch each batch stands (N, BATCHES), in stretches, of under STRAIGHT of them; 0 of
    more."""
    place = (np.arange(BATCHES) - 0.5 * (batches[:, None] - 1)) / np.maximum(batches, 1)[:, None]
    return np.where((np.arange(BATCHES) < batches[:, None]) & (batches[:, None] < STRAIGHT), place, 0.0)


def _rise(batches: Indices) -> Array:
    """Unit vectors (N, BATCHES) of what grows evenly over the batches of each target; zeros under STRAIGHT of them."""
    place = np.arange(BATCHES) - 0.5 * (batches[:, None] - 1)
    place = np.where((np.arange(BATCHES) < batches[:, None]) & (batches[:, None] >= STRAIGHT), place, 0.0)
    return np.asarray(place / np.maximum(np.linalg.norm(place, axis=1), 1e-300)[:, None])


def _mean_by_scatter(samples: Array, batches: Indices, window: float, rise: Array) -> Array:
    """Variance (N,) of the mean of so many samples of white noise after a moving mean over `window` (0: none), by the sum of
    squares of its batch means about their mean, or their line: those overlap, and so scatter too little."""

    def variance(length: Array) -> Array:
        longer, shorter = np.maximum(length, window), np.minimum(length, window)
        return np.asarray((1 - shorter / (3 * longer)) / longer)

    several, straight = np.maximum(batches, 2), batches >= STRAIGHT
    whole, part = variance(np.maximum(samples, 1)), variance(np.maximum(samples, 1) / several)
    # Neighbours alone overlap where there are more than two batches: what they have in common, part of it along the line.
    common = np.where(straight, several * (several * whole - part) / (2.0 * (several - 1)), 0.0)
    along = part + 2.0 * common * (rise[:, 1:] * rise[:, :-1]).sum(axis=1)
    return np.asarray(whole / (several * (part - whole) - np.where(straight, along, 0.0)))

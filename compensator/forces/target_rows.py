"""The rows of a log by the targets they belong to: means, and their standard errors by batch means."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from identification.common.arrays import Array

Indices = NDArray[np.intp]
BATCHES = 8


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
        to 8 consecutive batches a target. Of means over a revolution no batch is shorter than one where there are two, and the
        scatter is put up by what white noise loses to that mean.
        """
        order = np.argsort(self.target, kind="stable")
        rank = np.empty(len(self.target), dtype=np.intp)
        first = np.cumsum(self.rows) - self.rows
        rank[order] = np.arange(len(self.target)) - first[self.target[order]]
        most = np.clip(self.samples // window, 2, BATCHES).astype(np.intp) if window else BATCHES
        batches = np.minimum(self.rows, most)
        batch = self.target * BATCHES + rank * batches[self.target] // self.rows[self.target]
        size = np.bincount(batch, self.weight, minlength=self.count * BATCHES).reshape(self.count, BATCHES)
        errors = np.full((self.count, 3), np.nan)
        enough = self.rows >= 2
        for axis in range(3):
            total = np.bincount(batch, self.weight * force[:, axis], minlength=self.count * BATCHES).reshape(
                self.count, BATCHES)
            spread = np.where(size > 0, total / np.maximum(size, 1) - mean[:, axis, None], 0.0)
            variance = (spread**2).sum(axis=1) / np.maximum(batches - 1, 1) / np.maximum(batches, 1)
            if window:
                variance *= _lost_to_mean(self.samples, batches, window)
            errors[enough, axis] = np.sqrt(variance[enough])
        return errors


def _lost_to_mean(samples: Array, batches: Indices, window: float) -> Array:
    """Variance (N,) of the mean of so many samples of white noise after a moving mean over `window`, in units of what batch
    means make of it: those overlap, and so scatter too little."""

    def variance(length: Array) -> Array:
        longer, shorter = np.maximum(length, window), np.minimum(length, window)
        return np.asarray((1 - shorter / (3 * longer)) / longer)

    several = np.maximum(batches, 2)
    whole, part = variance(np.maximum(samples, 1)), variance(np.maximum(samples, 1) / several)
    return np.asarray(whole * (several - 1) / (part - whole))

"""Machined passes: rows along a path are neighbours in time, and their noise is not independent.

Rows of a pass are averaged over blocks longer than the noise is correlated; a block counts as one reading, and how many
readings the rows are really worth is reported. That length comes from the integrated autocorrelation time of the residual's
fast part (what a running mean over `SLOW` rows leaves), since a misfit of the model is slow along the path and must stay.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from identification.common.autocorrelation import AutocorrelationTime, autocorrelation_time
from identification.fit.load_test import LoadTest
from identification.fit.posterior import posterior
from identification.measurements import Measurements, run_numbers
from identification.model.cell import Cell
from identification.model.compliance import joint_torque

Array = NDArray[np.float64]
SLOW = 200
MOST_BLOCKS = 1200
# Rows, evenly spread, that the residual's model is fitted to.
THINNED = 1500
NO_TORQUE_NM = 5.0
# Each pass is held out in so many stretches.
STRETCHES = 10


@dataclass(frozen=True)
class Thinning:
    """What averaging did: rows of passes, blocks made of them, and the autocorrelation time in rows."""

    rows: int
    blocks: int
    autocorrelation_time: float


def in_blocks(cell: Cell, measurements: Measurements) -> tuple[Measurements, Thinning | None]:
    """The measurements with the rows of machined passes averaged over blocks; as they are where there is no pass."""
    on_path = measurements.machined_pass != ""
    if not on_path.any():
        return measurements, None
    memory = residual_memory(LoadTest.of(cell, measurements.select(on_path)))
    count = int(on_path.sum())
    length = max(memory.block, -(-count // MOST_BLOCKS))
    block = np.arange(len(measurements), dtype=np.intp)
    # A gear's play or soft zone is crossed where a torque changes sign: no block reaches over that.
    torque = joint_torque(cell.robot, measurements.theta, cell.flange_from_tcp, measurements.wrench)
    signs = np.sign(np.where(np.abs(torque) > NO_TORQUE_NM, torque, 0.0))
    stretch = np.full(len(measurements), "", dtype=object)
    key = measurements.visit * 2 + measurements.validate
    for number in np.unique(key[on_path]):
        rows = np.flatnonzero(on_path & (key == number))
        run = run_numbers(np.column_stack([np.arange(len(rows)) // length, signs[rows]]))
        # By its first row: between these may stand rows of the other purpose, with blocks of their own.
        block[rows] = rows[np.searchsorted(run, run)]
        part = np.arange(len(rows)) * STRETCHES // len(rows)
        stretch[rows] = [f"{measurements.machined_pass[rows[0]]} part {k + 1}" for k in part]
    _, first, member = np.unique(block, return_index=True, return_inverse=True)

    def summed(values: Array) -> Array:
        total = np.zeros((len(first), *values.shape[1:]))
        np.add.at(total, member, values)
        return total

    def mean(values: Array) -> Array:
        known = ~np.isnan(values)
        total, counts = summed(np.where(known, values, 0.0)), summed(known)
        return np.divide(total, counts, out=np.full_like(total, np.nan), where=counts > 0)

    # Of each component by itself: a reading that is missing is worth nothing.
    worth = np.sqrt(summed(~np.isnan(measurements.deflection)) / min(memory.values, length))
    stated = np.where(np.isnan(measurements.sigma), cell.noise.deflection, measurements.sigma)
    picked = measurements.select(np.isin(np.arange(len(measurements)), first))
    averaged = replace(
        picked, theta=mean(measurements.theta), wrench=mean(measurements.wrench), deflection=mean(measurements.deflection),
        sigma=mean(stated) / np.maximum(worth, 1.0), time=mean(measurements.time), dwell=mean(measurements.dwell),
        pose=np.where(stretch[first] == "", picked.pose, stretch[first]))
    return averaged, Thinning(count, len(np.unique(block[on_path])), memory.values)


def residual_memory(data: LoadTest) -> AutocorrelationTime:
    """Of the fast part of the residual, in rows: the longest of all passes and components."""
    rows = data.rows
    every = max(1, len(rows) // THINNED)
    residual = posterior(data.with_rows(rows.select(np.arange(len(rows)) % every == 0))).residual_of(data)
    longest = AutocorrelationTime(1.0, len(rows))
    for visit in np.unique(rows.visit):
        mine = residual[rows.visit == visit]
        for axis in range(3):
            series = mine[~np.isnan(mine[:, axis]), axis]
            window = min(SLOW, len(series) // 4)
            if window < 8:
                continue
            smooth = np.convolve(series, np.ones(window) / window, mode="same")
            fast = (series - smooth)[window // 2: -window // 2]
            # Summed up to the first lag that is not above its own noise.
            memory = autocorrelation_time(fast - fast.mean(), 2.0 / np.sqrt(len(fast)), window // 2)
            longest = max(longest, memory, key=lambda time: time.values)
    return longest

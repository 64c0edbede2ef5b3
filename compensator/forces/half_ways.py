"""A log that names the target nearest to the tool, placed along the path: its samples go on in time, and so over the half ways
beside their target.

Without that the mean over both half ways is all that is known of a target. Nothing is known between two, and where a cut
begins, ends or turns back the mean is the force of neither side.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from compensator.forces.log import ForceLog
from compensator.forces.program_time import moves_in_air
from compensator.path.arc_length import borders
from compensator.path.robot_path import RobotPath
from identification.common.arrays import Array
from identification.common.findings import Finding

Indices = NDArray[np.intp]
# The middling target of the cuts has so many rows at least: fewer tell nothing between targets.
FEWEST = 8
# Rows without time were taken evenly where of so many targets of the cuts, at least, this share has as many as its half ways
# take, within a share of that, and less than half of them as many as the middling one: a logger that takes so many a
# target, or one when it likes, has others (engineering judgement).
TARGETS, MOST, WITHIN, HALF = 3, 0.75, 0.2, 0.5


def on_half_ways(log: ForceLog, path: RobotPath) -> ForceLog:
    """A log by target numbers as one by path length: the samples of each target as taken evenly, by the programmed time, over
    the half ways beside it, and at the target itself for as long as they last longer: there the robot brakes or waits. As it is
    where it has no time and its rows do not show that they were taken evenly, the feeds, the way or the order of the moves are
    not known, or the numbers go back, or have few rows.
    """
    toolpath, target = path.toolpath, log.place.astype(np.intp)
    time = np.cumsum(np.insert(path.move_time[1:], 0, 0.0))
    if toolpath.driven is not None or toolpath.ways or (np.diff(target) < 0).any() or not (
            np.isfinite(time).all() and np.isfinite(path.length).all()):
        return log
    border = np.interp(borders(path.length), path.length, time)
    start, end = np.insert(border, 0, time[0]), np.append(border, time[-1])
    samples = np.bincount(target, log.weight, minlength=len(time)).astype(np.float64)
    rows = np.bincount(target, minlength=len(time))
    cut = ~moves_in_air(toolpath) & (samples > 0) & (end > start)
    if not cut.any() or np.median(rows[cut]) < FEWEST or (
            log.time is None and not _taken_evenly(samples[cut], (end - start)[cut])):
        return log
    rate = float(np.median(samples[cut] / (end - start)[cut]))
    share = log.on_stretches(np.zeros(len(time)), np.ones(len(time))).place
    place = np.interp(_when(share, target, samples / rate, (start, time, end)), time, path.length)
    shown = "" if log.time is not None else ", and there are as many of each as these take, so that no time is needed"
    said = Finding("CS3040", "note", "the column target names the nearest target: its samples count as taken evenly over the "
                   f"half ways beside it{shown}", file=log.source)
    return replace(log, key="path_mm", place=place, on_path=True, findings=(*log.findings, said))


def _taken_evenly(samples: Array, takes: Array) -> bool:
    """Whether how many samples (n,) targets have shows that they were taken evenly in time; takes (n,) [s]: what the half ways
    beside each take."""
    def alike(count: Array) -> float:
        return float(np.mean(np.abs(samples - count) <= WITHIN * count))

    by_time = takes * np.median(samples / takes)
    return (len(samples) >= TARGETS and alike(by_time) >= MOST
            and alike(np.full(len(samples), np.median(samples))) < HALF)


def _when(share: Array, target: Indices, lasted: Array, stretch: tuple[Array, Array, Array]) -> Array:
    """The programmed time (M,) [s] of rows that stand at a share (M,) of the samples of a target (M,). lasted (N,) [s]: what
    all of these take at the log's rate; stretch: when the half ways beside each target (N,) begin, pass it and end [s]."""
    start, middle, end = (each[target] for each in stretch)
    waited = np.maximum(lasted[target] - (end - start), 0.0)
    gone = start + share * (end - start + waited)
    return np.asarray(np.where(gone < middle, gone, np.maximum(gone - waited, middle)))

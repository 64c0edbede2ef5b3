"""The moves worth looking at between their targets: those along which the log shows another force than a straight line from one
target's force to the next, and long ones, along which the arm's posture changes."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from compensator.correction.fine_grid import FULL
from compensator.correction.needed_targets import ENOUGH, beyond_noise
from compensator.correction.predict import Predicted
from compensator.forces.placement import ForceLog
from compensator.path.arc_length import nearest_target
from identification.model.compliance import compliance_matrix

Array = NDArray[np.float64]
Indices = NDArray[np.intp]
Mask = NDArray[np.bool_]

# Along a move of this length [m] the posture changes the deviation by up to a micrometre; pieces as long as that [m] show it.
LONG, SLOWLY = 30e-3, 3e-3
# A median of absolute values of a normal distribution, in sigmas.
MEDIAN = 0.6745
# Pieces of a move, and places at which the arm's softness is looked at; moves that need less than this share of the
# tolerance are passed over.
MOST_PIECES, PLACES, SHARE = 1000, 50, 0.5
# A force begins and ends somewhere between two places at which targets may stand: so many pieces lie between these.
# Each with so many samples at least.
FINER, SAMPLES = 3, 4
# So many places tell the noise.
FEWEST = 12
# The lines of a spindle whose speed is ambiguous are in places so many times their mean over the log.
WORSE = 3.0


def pieces_to_look_at(planned: Predicted, spacing: Array, shortest: float) -> Array:
    """In how short pieces each move (N,), from the target before, is worth looking at [m]: inf where the correction along it
    does not vary by more than half the tolerance.

    spacing (N,) [m]: the closest targets each move may have; shortest [s]: no piece lasts less. A log that names targets tells
    nothing of the way between them.
    """
    forced = planned.forces.forced
    behind = np.insert(forced[:-1], 0, False)
    step = np.nan_to_num(np.diff(planned.path.length, prepend=np.nan))
    named = planned.forces.named
    long = (forced & behind if named else forced | behind) & (step >= LONG)
    pieces = np.where(long, np.maximum(spacing, SLOWLY), np.inf)
    if named:
        return pieces
    asking = _asking(planned, step, spacing)
    # What an added target does to the mean of the program's own beside it is looked at too.
    around = asking | np.append(asking[1:], False) | np.insert(asking[:-1], 0, False)
    least = np.fmax(spacing / FINER, shortest * planned.path.toolpath.feed)
    return np.where(around, np.minimum(spacing, np.maximum(least, SAMPLES * _between_samples(planned, step))), pieces)


def _between_samples(planned: Predicted, step: Array) -> Array:
    """How far apart [m] the samples stand along each move (N,) of lengths step (N,) [m]; inf where there is none."""
    _, move = _on_moves(planned)
    return np.asarray(step / np.maximum(np.bincount(move, minlength=len(step)), 1e-300))


def _on_moves(planned: Predicted) -> tuple[Indices, Indices]:
    """The rows (M,) of the log that lie on the path, and the target (M,) that the tool moves to there."""
    log, length = planned.forces.log, _ascending(planned)
    rows = np.flatnonzero(np.isfinite(log.place) & (log.place >= 0) & (log.place <= length[-1]))
    return rows, np.clip(np.searchsorted(length, log.place[rows], side="left"), 1, len(length) - 1)


def _ascending(planned: Predicted) -> Array:
    """Path length (N,) [m], known everywhere."""
    return np.maximum.accumulate(np.nan_to_num(planned.path.length))


def shortest_piece(planned: Predicted) -> float:
    """The time [s] that a piece of a move must last, so that what a plain mean over it keeps of the spindle's lines moves the
    tool by less than half the tolerance; 0 where means go over whole revolutions, or there are no lines."""
    left = planned.forces.log.lines_left
    return WORSE * left * float(_softness(planned)[0]) / (SHARE * planned.settings.correction.tolerance) if left else 0.0


def _asking(planned: Predicted, step: Array, spacing: Array) -> Mask:
    """The moves (N,) of lengths step (N,) [m] whose force is not a straight line between the means of their targets."""
    log, length = planned.forces.log, _ascending(planned)
    count = len(length)
    rows, move = _on_moves(planned)
    room = np.minimum(step // (2 * FULL * spacing), np.bincount(move, minlength=count) // 2)
    halves = np.clip(np.nan_to_num(room), 1, MOST_PIECES // 2).astype(np.intp)
    begin = np.cumsum(2 * halves) - 2 * halves
    share = (log.place[rows] - length[move - 1]) / np.maximum(step[move], 1e-12)
    piece = begin[move] + np.clip(2 * halves[move] * share, 0, 2 * halves[move] - 1).astype(np.intp)
    weight, mean = _means(log, rows, piece, int(2 * halves.sum()))
    target_weight, target = _means(log, rows, nearest_target(planned.path.length, log.place[rows]), count)
    filled = np.flatnonzero(weight)
    owner = np.repeat(np.arange(count), 2 * halves)[filled]
    along = ((filled - begin[owner] + 0.5) / (2 * halves[owner]))[:, None]
    known = (target_weight[owner] > 0) & (target_weight[owner - 1] > 0)
    off = mean[filled] - ((1 - along) * target[owner - 1] + along * target[owner])
    near = planned.forces.forced[owner] | planned.forces.forced[owner - 1]
    soft, tolerance = _softness(planned), planned.settings.correction.tolerance
    noise = np.linalg.norm(soft * noise_of_one(mean[filled], weight[filled], near)) / np.sqrt(weight[filled])
    asked = beyond_noise(np.where(known[:, None], soft * off, 0.0), noise, ENOUGH * tolerance)
    asks = known & (step[owner] >= 2 * FULL * spacing[owner]) & (asked > SHARE * tolerance)
    return np.bincount(owner[asks], minlength=count) > 0


def _means(log: ForceLog, rows: Indices, group: Indices, count: int) -> tuple[Array, Array]:
    """Samples (count,) and mean load (count, 6) [N, N m], as logged, of these rows by group."""
    weight = np.bincount(group, log.weight[rows], minlength=count).astype(float)
    load = (*log.force.T, *log.moment.T) if log.has_moment else tuple(log.force.T)
    total = [np.bincount(group, log.weight[rows] * values[rows], minlength=count) for values in load]
    nothing = [np.zeros(count)] * (6 - len(total))
    return weight, np.column_stack([*total, *nothing]) / np.maximum(weight, 1)[:, None]


def noise_of_one(mean: Array, weight: Array, counted: Mask) -> Array:
    """Standard deviation (c,) of one sample about a force that changes smoothly: from how far means (n, c) of weight (n,)
    samples, in order, are off the cubic through two neighbours on either side, where all five are counted (n,). Steps are few,
    and a median passes them over; 0 where there is too little to tell.
    """
    if len(mean) < 5:
        return np.zeros(mean.shape[1])
    inside = np.all([counted[k:len(counted) - 4 + k] for k in range(5)], axis=0)
    if inside.sum() < FEWEST:
        return np.zeros(mean.shape[1])
    first, before, here, after, last = (mean[k:len(mean) - 4 + k] for k in range(5))
    off = here - (4 * (before + after) - (first + last)) / 6
    share = 1 / weight
    variance = share[2:-2] + (16 * (share[1:-3] + share[3:-1]) + share[:-4] + share[4:]) / 36
    return np.asarray(np.median(np.abs(off[inside]) / np.sqrt(variance[inside])[:, None], axis=0) / MEDIAN)


def _softness(planned: Predicted) -> Array:
    """By how much a load (6,) [N, N m] moves the tool where, and in the direction in which, the arm is softest (6,) [m/N,
    1/N]."""
    some = planned.targets[np.unique(np.linspace(0, len(planned.targets) - 1, PLACES).astype(np.intp))]
    soft = np.zeros(2)
    for tool, places in planned.path.each_tool(some):
        matrix = compliance_matrix(planned.model.robot, planned.path.theta[some[places]], tool, planned.model.compliance)
        sizes = [np.linalg.norm(part, ord=2, axis=(1, 2)).max() for part in (matrix[:, :3, :3], matrix[:, :3, 3:])]
        soft = np.maximum(soft, sizes)
    return np.repeat(soft, 3)

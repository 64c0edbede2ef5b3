"""Which targets show a force: a mean that is told apart from zero by its own scatter, or by what the sensor shows in air."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from compensator.forces.target_rows import BATCHES, TargetRows
from identification.common.arrays import Array

Flags = NDArray[np.bool_]
# A mean so many sigmas from zero is a force; one next to a force from GROW sigmas on; gaps of at most GAP targets are filled.
SIGMAS, GROW, GAP = 5.0, 2.0, 3
# The zero that a tare found is trusted to so many sigmas: in space it is off by more as rarely as by 3 along one of three axes.
OF_ZERO = 3.44
# A target in a gap belongs to the cut with so much of the force that stands between its ends.
HALF = 0.5


def over_noise(mean: Array, rows: TargetRows, noise: Array, of_zero: Array) -> Flags:
    """Targets (N,) whose mean (N, 6) is other than zero by 5 sigma of a sensor with this noise (6, 6) of one sample in air, and
    3.44 sigma of its zero, of_zero (6, 6), one for all, or (N, 6, 6): covariances.

    Force and moment are held against what each has in its own direction, which is the same in whatever axes they were logged.
    """
    over = np.zeros(rows.count, dtype=bool)
    for part in (slice(0, 3), slice(3, 6)):
        vector = mean[:, part]
        variance = (SIGMAS**2 / np.maximum(rows.samples, 1))[:, None, None] * noise[part, part] + (
            OF_ZERO**2 * of_zero[..., part, part])
        with np.errstate(over="ignore", invalid="ignore"):          # absurd numbers
            size = np.linalg.norm(vector, axis=1)
            along = vector / np.maximum(size, 1e-300)[:, None]
            least = np.sqrt(np.maximum(np.einsum("ni,nij,nj->n", along, variance, along), 0.0))
            # Without noise (no moments logged, a clean simulation) it shows a force by being other than zero.
            over |= size > np.maximum(least, SIGMAS * 1e-12)
    return np.asarray((rows.samples > 0) & over)


def over_scatter(mean: Array, standard_error: Array, rows: TargetRows) -> Flags:
    """Runs of targets (N,) whose mean force is other than zero by its own scatter: each target by 2 sigma, and one of them,
    or their common mean, by 5.

    The error of one target comes from 8 batches; it is steadied by the lower quartile of all targets, which is the noise of
    air where there is air. Under 8 rows of the log any mean that is not zero is a force.
    """
    few = (rows.rows > 0) & (rows.rows < BATCHES)
    many = np.flatnonzero(rows.rows >= BATCHES)
    other = np.any(mean != 0, axis=1)
    if not len(many):
        return np.asarray(few & other)
    samples = rows.samples[many, None]
    variance = np.full((rows.count, 3), np.inf)
    own = standard_error[many] ** 2 * samples
    variance[many] = np.maximum(0.5 * (own + np.quantile(own, 0.25, axis=0)) / samples, 1e-24)
    sigmas = np.max(np.abs(mean[:, :3]) / np.sqrt(variance), axis=1)
    # Moments and single samples have no such error: they count as they are.
    sigmas[other & (few | np.any(mean[:, 3:] != 0, axis=1))] = np.inf
    possible = sigmas > GROW
    run = np.cumsum(np.diff(possible, prepend=False))
    total, spread = np.zeros((run.max() + 1, 3)), np.zeros((run.max() + 1, 3))
    np.add.at(total, run, mean[:, :3])
    np.add.at(spread, run, np.where(np.isfinite(variance), variance, 0.0))
    together = np.max(np.abs(total) / np.sqrt(np.maximum(spread, 1e-24)), axis=1) > SIGMAS
    alone = np.bincount(run, sigmas > SIGMAS) > 0
    return np.asarray(possible & (together | alone)[run])


def without_gaps(forced: Flags, sampled: Flags, cutting: Flags, force: Array) -> Flags:
    """Targets (N,) that belong to a cut: those with force, and between two of them up to GAP that were sampled, are reached at
    the cutting feed, and show at least half of the force between both sides, though it is not told apart from zero.

    cutting (N,): the move to the target cuts. force (N, 3) [N]: the means. No step in the surface where a light force dips; a
    target without force, and one that the robot reaches through the air, is never filled.
    """
    filled = forced.copy()
    targets = np.flatnonzero(forced)
    step = np.diff(targets)
    for gap in np.flatnonzero((step > 1) & (step <= GAP + 1)):
        first, last = targets[gap], targets[gap + 1]
        inside = np.arange(first + 1, last)
        if not cutting[first + 1:last + 1].all():
            continue
        share = ((inside - first) / (last - first))[:, None]
        between = (1 - share) * force[first] + share * force[last]
        alike = np.einsum("ni,ni->n", force[inside], between) >= HALF * np.einsum("ni,ni->n", between, between)
        if (alike & between.any(axis=1)).all():
            filled[inside] = sampled[inside]
    return filled

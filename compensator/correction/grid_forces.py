"""The forces of a log on the points of a grid: placed on them, moved to where they stand, and averaged into targets."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from compensator.correction.fine_grid import FULL, Grid
from compensator.correction.force_changes import noise_of_one
from compensator.correction.needed_targets import untouched, window_means, windows
from compensator.correction.predict import Predicted
from compensator.forces.placement import ForceLog, place_forces
from compensator.forces.program_time import moves_in_air
from compensator.forces.target_forces import TargetForces
from compensator.path.arc_length import nearest_target
from compensator.path.robot_path import RobotPath
from compensator.toolpath import Move

Array = NDArray[np.float64]
Indices = NDArray[np.intp]


def forces_on(planned: Predicted, fine: RobotPath, grid: Grid, closest: Array) -> TargetForces:
    """The log on the points of a grid. Where it names targets, the points between two with force get forces in between; else
    all of the program must stand on the grid. closest (G,) [m]: how near to each other targets may stand."""
    forces, log, kept = planned.forces, planned.forces.log, grid.kept
    if not forces.named:
        given = planned.path.length
        known = ~np.isnan(given)
        # The chords of an arc are shorter than it is.
        log = _on_their_moves(log, planned)
        log = replace(log, place=along_chords(log.place, given[known], fine.length[kept][known]))
        air = kept[np.minimum(np.array(planned.settings.log.tare, dtype=np.intp).reshape(-1, 2), len(kept) - 1)]
        # The tare was judged on the program itself.
        placed = place_forces(log, fine, fine.cell, tare=[(int(first), int(last)) for first, last in air], trust_tare=True,
                              fill_gaps=False)
        placed = _still_at_touch(_without_short_gaps(_centred(placed, fine), place_of(fine), closest), planned, grid)
        of_arc = grid.further & np.isin(planned.path.toolpath.move[grid.owner], (Move.ARC_VIA, Move.ARC_END))
        of_cut = np.zeros(len(grid.owner), dtype=bool)
        of_cut[kept[forces.forced[grid.targets]]] = True
        return _unsure_at_steps(_between_samples(placed, place_of(fine), np.flatnonzero(of_cut | of_arc)), kept)
    own = ~grid.further
    number = np.interp(np.arange(len(own)), kept, np.arange(len(kept)))
    before = np.floor(number).astype(np.intp)
    share = (number - before)[:, None]
    low, high = grid.targets[before], grid.targets[np.minimum(before + 1, len(kept) - 1)]

    def between(values: Array) -> Array:
        return (1 - share) * values[low] + share * values[high]

    samples = np.zeros(len(own), dtype=np.intp)
    samples[kept] = forces.samples[grid.targets]
    forced = forces.forced[low] & (own | forces.forced[high])
    return replace(forces, wrench=np.where(forced[:, None], between(forces.wrench), 0.0), samples=samples,
                   standard_error=between(forces.standard_error), forced=forced,
                   weight_std=None if forces.weight_std is None else between(forces.weight_std))


def along_chords(place: Array, given: Array, now: Array) -> Array:
    """Where places (M,) [m] along a path whose targets stand at path lengths given (n,) [m] are if these are `now` (n,) [m]: in
    proportion between two of them, and as far before the first and behind the last one."""
    return np.asarray(place + np.interp(place, given, now - given))


def _on_their_moves(log: ForceLog, planned: Predicted) -> ForceLog:
    """The log without the rows of moves that a call leads to: they stand at the ends of these, and are taken elsewhere. Those
    at targets that tell the zero stay."""
    order = planned.path.toolpath.driven
    if order is None:
        return log
    led = np.flatnonzero(np.diff(order) != 1)
    ends = np.unique(np.concatenate([order[led], order[led + 1]]))
    for first, last in planned.settings.log.tare:
        ends = ends[(ends < first) | (ends > last)]
    there = np.isin(log.place, planned.path.length[ends])
    return log.rows(~there) if there.any() and not there.all() else log


def _still_at_touch(placed: TargetForces, planned: Predicted, grid: Grid) -> TargetForces:
    """A slow log may have no sample at a target to which the tool comes at the air feed: where the last one before it shows no
    force there is none at the target either, as if one had been taken there. The tool may leave by the air out of a cut."""
    sampled = np.flatnonzero(placed.samples > 0)
    reached = grid.kept[moves_in_air(planned.path.toolpath)[grid.targets] & (placed.samples[grid.kept] == 0)
                        & ~placed.forced[grid.kept]]
    if not len(sampled):
        return placed
    before = np.searchsorted(sampled, reached) - 1
    still = reached[(before >= 0) & ~placed.forced[sampled[np.maximum(before, 0)]]]
    samples = placed.samples.copy()
    samples[still] = 1
    return replace(placed, samples=samples)


def _centred(placed: TargetForces, fine: RobotPath) -> TargetForces:
    """The forces of the points (G,) where they stand, out of the means of their samples, whose middle may lie beside them:
    moved by the lesser of the slopes on either side, which at a step is none."""
    log, place, count = placed.log, place_of(fine), len(placed.samples)
    on = np.flatnonzero(np.isfinite(log.place) & (log.place >= 0) & (log.place <= place[-1]))
    point = nearest_target(fine.length, log.place[on])
    weight = np.bincount(point, log.weight[on], minlength=count)
    middle = np.bincount(point, log.weight[on] * log.place[on], minlength=count) / np.maximum(weight, 1)
    inner = 1 + np.flatnonzero(placed.forced[:-2] & placed.forced[1:-1] & placed.forced[2:])
    before, behind = middle[inner] - middle[inner - 1], middle[inner + 1] - middle[inner]
    aside = place[inner] - middle[inner]
    near = (before > 0) & (behind > 0) & (np.abs(aside) <= 0.5 * np.minimum(before, behind))
    here, wrench = inner[near], placed.wrench.copy()
    rising = (wrench[here] - wrench[here - 1]) / before[near, None]
    going_on = (wrench[here + 1] - wrench[here]) / behind[near, None]
    slope = np.where(rising * going_on > 0, np.sign(rising) * np.minimum(np.abs(rising), np.abs(going_on)), 0.0)
    wrench[here] += slope * aside[near, None]
    return replace(placed, wrench=wrench)


def _without_short_gaps(placed: TargetForces, place: Array, closest: Array) -> TargetForces:
    """Points without force between two with it that stand no farther apart than two targets may get what lies between those:
    their few samples may have met no tooth."""
    on = np.flatnonzero(placed.forced)
    begin = np.flatnonzero((np.diff(on) > 1) & (np.diff(place[on]) <= closest[on[1:]] / FULL))
    inside = np.zeros(len(place), dtype=bool)
    for first, last in zip(on[begin], on[begin + 1], strict=True):
        inside[first + 1:last] = True
    if not inside.any():
        return placed
    wrench = placed.wrench.copy()
    wrench[inside] = np.column_stack([np.interp(place[inside], place[on], axis[on]) for axis in placed.wrench.T])
    return replace(placed, wrench=wrench, forced=placed.forced | inside)


def _between_samples(placed: TargetForces, place: Array, stay: Indices) -> TargetForces:
    """Points `stay` (n,) on whose own short piece no sample lies, as between two of a slow log: the program's targets with
    force, and points of arcs, which are halved wherever the samples lie. They get what lies between the sampled points before
    and behind them, where either has a force."""
    sampled = np.flatnonzero(placed.samples > 0)
    alone = stay[(placed.samples[stay] == 0) & ~placed.forced[stay]]
    if not len(alone) or not len(sampled):
        return placed
    number = np.searchsorted(sampled, alone)
    before, behind = sampled[np.maximum(number - 1, 0)], sampled[np.minimum(number, len(sampled) - 1)]
    alone = alone[placed.forced[before] | placed.forced[behind]]
    measured = np.where(placed.forced[sampled, None], placed.wrench[sampled], 0.0)
    wrench, forced = placed.wrench.copy(), placed.forced.copy()
    wrench[alone] = np.column_stack([np.interp(place[alone], place[sampled], axis) for axis in measured.T])
    forced[alone] = True
    return replace(placed, wrench=wrench, forced=forced)


def _around(placed: TargetForces, points: Indices) -> tuple[Indices, Indices]:
    """The sampled points before and behind each of these (n,); the last one at either end."""
    sampled = np.flatnonzero(placed.samples > 0)
    before, behind = np.searchsorted(sampled, points, side="left") - 1, np.searchsorted(sampled, points, side="right")
    return sampled[np.maximum(before, 0)], sampled[np.minimum(behind, len(sampled) - 1)]


def _unsure_at_steps(placed: TargetForces, points: Indices) -> TargetForces:
    """The standard error at these points (n,) with what a step of the force makes of it, which lies anywhere between the
    sampled points on either side: a force v between b and a is a or b, and its variance (v - b)(a - v) in each component."""
    if not (placed.samples > 0).any():
        return placed
    before, behind = _around(placed, points)
    force = np.where(placed.forced[:, None], placed.wrench[:, :3], 0.0)
    variance = np.maximum((force[points] - force[before]) * (force[behind] - force[points]), 0.0)
    standard_error = placed.standard_error.copy()
    standard_error[points] = np.hypot(np.nan_to_num(standard_error[points]), np.sqrt(variance))
    return replace(placed, standard_error=standard_error)


def place_of(path: RobotPath) -> Array:
    """Path length (G,) [m], known everywhere and ascending."""
    return np.maximum.accumulate(np.nan_to_num(path.length))


def weight_of(placed: TargetForces) -> Array:
    """What the points (G,) weigh in a mean: their samples; nothing where the log names targets: each has its own."""
    return np.zeros(len(placed.samples)) if placed.named else placed.samples.astype(float)


def noise_of(placed: TargetForces) -> Array:
    """Standard error (G, 3) [N] of the mean forces: from their scatter about a smooth force, not from a force that rises."""
    weight = weight_of(placed)
    sampled = np.flatnonzero(weight)
    one = noise_of_one(placed.wrench[sampled, :3], weight[sampled], placed.forced[sampled])
    return np.asarray(one / np.sqrt(np.maximum(weight, 1))[:, None] * (weight > 0)[:, None])


def averaged(
    planned: TargetForces, placed: TargetForces, grid: Grid, place: Array, at: Indices, by_place: NDArray[np.bool_]
) -> TargetForces:
    """The forces of the points `at` (n,) of a grid as a program's targets, out of those placed on all of it, path lengths place
    (G,) [m]; one of the program's own without a new neighbour keeps what was planned, but for those `by_place` (G,), which take
    what there is at their very place."""
    weight = weight_of(placed)
    first, last = windows(place, at)
    samples = np.concatenate([[0], np.cumsum(placed.samples)])
    size = np.maximum((samples[last] - samples[first]).astype(float), 1.0)[:, None]
    error = np.nan_to_num(placed.standard_error) * np.maximum(placed.samples, 1)[:, None]
    squares = np.concatenate([np.zeros((1, 3)), np.cumsum(error**2, axis=0)])
    own_error = placed.standard_error[at]
    wide = (last - first > 1)[:, None] & (weight[at] > 0)[:, None]
    forced = placed.forced[at].copy()
    wrench = np.where(forced[:, None], window_means(placed.wrench, weight, first, last, at), 0.0)
    standard_error = np.where(wide, np.sqrt(squares[last] - squares[first]) / size, own_error)
    count = samples[last] - samples[first]
    alone = untouched(~grid.further, at)
    there = alone & by_place[at]
    wrench[there] = np.where(forced[there, None], placed.wrench[at[there]], 0.0)
    standard_error[there], count[there] = own_error[there], placed.samples[at[there]]
    alone &= ~there
    own = grid.owner[at[alone]]
    wrench[alone], standard_error[alone] = planned.wrench[own], planned.standard_error[own]
    count[alone], forced[alone] = planned.samples[own], planned.forced[own]
    unknown, follows, weight_std = (None if values is None else values[at]
                                    for values in (placed.unknown, placed.follows, placed.weight_std))
    return replace(placed, wrench=wrench, standard_error=standard_error, samples=count, forced=forced, unknown=unknown,
                   follows=follows, weight_std=weight_std)


def among_others(planned: TargetForces, kept: Indices, some: TargetForces, number: Indices) -> TargetForces:
    """The forces of all targets of a program: those planned (N), which stand at `kept` (N,) now, but for `some` (n), which are
    of its targets `number` (n,)."""
    count = int(kept[-1]) + 1

    def both(name: str) -> NDArray[Any]:
        before, now = getattr(planned, name), getattr(some, name)
        values = np.empty((count, *before.shape[1:]), dtype=before.dtype)
        values[kept] = before
        values[number] = now
        return values

    return replace(some, wrench=both("wrench"), samples=both("samples"), standard_error=both("standard_error"),
                   forced=both("forced"), unknown=None if some.unknown is None else both("unknown"),
                   follows=None if some.follows is None else both("follows"),
                   weight_std=None if planned.weight_std is None or some.weight_std is None else both("weight_std"))

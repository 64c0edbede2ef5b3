"""ForceLog -> one quasi-static wrench a target, with the number of samples behind each (FORMATS.md, forces.csv)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from compensator.forces.log import ForceLog, read_force_log
from compensator.forces.log_path import on_path
from compensator.forces.time_alignment import air_moves
from compensator.forces.zero import Range, base_from_log, zero_of
from compensator.path.arc_length import nearest_target
from compensator.path.robot_path import RobotPath
from compensator.toolpath import Move
from identification.common.findings import Finding, Level, counted, error
from identification.model.cell import Cell
from identification.model.rotations import Frame

__all__ = ["ForceLog", "TargetForces", "place_forces", "read_force_log"]
Array = NDArray[np.float64]
Indices = NDArray[np.intp]
BATCHES = 8
# A log with more than this share of its samples off the path is that of another program.
MOST_LOST = 0.9
# A mean so many sigmas from zero is a force; one next to a force from GROW sigmas on; gaps of at most GAP targets are filled.
SIGMAS, GROW, GAP = 5.0, 2.0, 3


@dataclass(frozen=True, eq=False)
class TargetForces:
    """One wrench a target: wrench (N, 6) [N, N m] on the tool at the TCP, base frame; samples (N,) behind each.

    standard_error (N, 3) [N] of the mean force, base frame, from the scatter of the samples; NaN under two samples.
    forced (N,): the force is told apart from zero. tare (6,): the bias that was subtracted, log frame, None: none is known.
    log: by path length, or by target where it names them.
    """

    wrench: Array
    samples: Indices
    standard_error: Array
    forced: NDArray[np.bool_]
    tare: Array | None
    findings: tuple[Finding, ...]
    log: ForceLog

    @property
    def named(self) -> bool:
        """Whether the log gave the target of each sample."""
        return self.log.key == "target"


def place_forces(
    log: ForceLog, path: RobotPath, cell: Cell, *, tare: Range | Sequence[Range] | None = None
) -> TargetForces:
    """Averages the samples around each target, takes off bias and weight, and turns the mean into the base frame at the TCP.

    tare: first and last target of an air stretch, or several such. Their mean is the sensor's bias (zero.py), and their scatter
    says what a mean of so many samples shows without any force: targets within 5 sigma of that are without force. Without a
    tare the scatter about each mean itself decides. Short gaps inside a cut belong to the cut.
    Raises CompstiffError: CS3004 target beyond the program, CS3005 log not on this path, and what `on_path` and
    `zero_of` raise.
    """
    count = len(path.toolpath)
    log = on_path(log, path)
    target = _assign(log, path)
    findings: list[Finding] = []
    placed = target >= 0
    number = int(log.weight.sum())
    lost = int(log.weight[~placed].sum())
    if lost > MOST_LOST * number:
        few = "none" if not placed.any() else f"only {number - lost}"
        raise error("CS3005", f"{few} of the {number} samples {'lies' if number - lost < 2 else 'lie'} on this path",
                    file=log.source, hint="is it the log of this program, with TCP positions in its work object?")
    if lost:
        level: Level = "warning" if lost > 0.01 * number else "note"
        findings.append(Finding("CS3007", level, f"{lost} of {counted(number, 'sample')} not on the path, not used",
                                file=log.source, line=int(log.line[np.argmin(placed)])))
    loads = np.concatenate([log.force, log.moment], axis=1)[placed]
    index, share = target[placed], log.weight[placed]
    samples = np.bincount(index, share, minlength=count).astype(np.intp)
    mean, standard_error = _means(loads, index, share, count, log)
    # Whether there is a force is for the samples of a target alone to say: a mean over a revolution reaches over an edge.
    before = log.plain[placed]
    plain = mean if log.revolution is None else _mean(before, index, share, count)
    zero = zero_of(log, path, cell, before, index, share, _ranges(tare))
    findings += zero.findings
    if zero.offset.any():
        mean, plain = (np.where(samples[:, None] > 0, each - zero.offset, 0.0) for each in (mean, plain))
        for each in (mean, plain):
            each[np.abs(each) < 1e-9] = 0.0
    rows = np.bincount(index, minlength=count)
    if zero.noise is None:
        forced, words = _told_apart(plain, standard_error, samples, rows), "a mean force that is not told apart from zero"
    else:
        # A component without noise (no moments logged, a clean simulation) shows a force by being other than zero.
        sigma = np.abs(plain) / np.maximum(zero.noise / np.sqrt(np.maximum(samples, 1))[:, None], 1e-12)
        forced, words = (samples > 0) & (sigma > SIGMAS).any(axis=1), "a mean force within what the sensor shows in air"
    forced = _without_gaps(forced, samples > 0)
    silent = np.flatnonzero((samples > 0) & ~forced & np.any(mean != 0, axis=1))
    if len(silent):
        findings.append(Finding(
            "CS3009", "note", f"{counted(len(silent), 'target')} with {words} ({SIGMAS:g} sigma) taken as without force",
            file=path.toolpath.source, line=int(path.toolpath.line[silent[0]]), target=int(silent[0])))
    findings += _weak(log, path, forced, samples, index[log.saturated[placed]])
    wrench, standard_error = _to_base(mean, standard_error, log, path, cell)
    if log.spread is not None:
        doubt = np.bincount(index, share * log.spread[placed], minlength=count) / np.maximum(samples, 1)
        standard_error = np.hypot(standard_error, _by_place(path, wrench[:, :3]) * doubt[:, None])
    wrench = np.where(forced[:, None], wrench, 0.0)
    findings += _gaps(log, path, samples, forced)
    if zero.bias is None:
        findings += _in_air(log, path, samples, forced, wrench)
    return TargetForces(wrench, samples, standard_error, forced, zero.bias, (*log.findings, *findings), log)


def _in_air(log: ForceLog, path: RobotPath, samples: Indices, forced: NDArray[np.bool_], wrench: Array) -> list[Finding]:
    """Where no bias is known and moves at the air feed show a force, the bias is likely it."""
    by_joints = np.isin(path.toolpath.move, (Move.JOINT, Move.ABSOLUTE))
    air = np.flatnonzero(air_moves(path.toolpath.feed, by_joints) & (samples > 0))
    touched = air[forced[air]]
    if 2 * len(touched) <= len(air):
        return []
    size = np.linalg.norm(wrench[touched, :3], axis=1)
    return [Finding("CS3041", "warning", f"{len(touched)} of {counted(len(air), 'move')} at the air feed show a force, "
                    f"{np.median(size):.1f} N in the middle, and are moved with the others: no bias was taken off",
                    file=log.source, line=None, target=int(touched[0]),
                    hint="name targets in the air with --tare FIRST:LAST, or state force_log.bias_n in cell.yaml")]


def _ranges(tare: Range | Sequence[Range] | None) -> list[Range]:
    """One stretch or several as several."""
    if tare is None:
        return []
    if len(tare) == 2 and isinstance(tare[0], int) and isinstance(tare[1], int):
        return [(tare[0], tare[1])]
    return [one for one in tare if not isinstance(one, int)]


def _weak(log: ForceLog, path: RobotPath, forced: NDArray[np.bool_], samples: Indices, saturated: Indices) -> list[Finding]:
    """Targets with force whose mean is not what it should be. saturated: target of each row with a saturated sample."""
    found = []
    hurt = np.flatnonzero(np.bincount(saturated, minlength=len(forced)).astype(bool) & forced)
    if len(hurt):
        found.append(Finding("CS3026", "warning", f"the force of {counted(len(hurt), 'target')} depends on saturated samples: "
                             "it is larger than what is corrected for", file=path.toolpath.source,
                             line=int(path.toolpath.line[hurt[0]]), target=int(hurt[0])))
    if log.rate and log.revolution:
        short = np.flatnonzero(forced & (samples < log.rate * log.revolution))
        if len(short):
            found.append(Finding("CS3029", "note", f"{counted(len(short), 'target')} with force and less than one revolution "
                                 "of the spindle: the mean reaches into the neighbours' stretches", file=path.toolpath.source,
                                 line=int(path.toolpath.line[short[0]]), target=int(short[0])))
    return found


def _assign(log: ForceLog, path: RobotPath) -> Indices:
    """Target (M,) of each sample, -1 where it is not on the path."""
    if log.key == "target":
        return log.place.astype(np.intp)
    length = path.length
    known = ~np.isnan(length)
    if not known.any():
        raise error("CS3005", "the program has no target of known position to place the log on", file=log.source)
    inside = (log.place >= -1e-3) & (log.place <= np.nanmax(length) + 1e-3)
    return np.where(inside, nearest_target(length, np.where(inside, log.place, 0.0)), -1)


def _by_place(path: RobotPath, force: Array) -> Array:
    """How fast the force (N, 3) [N] changes along the path, |dF/ds| (N, 3) [N/m]: the steeper side of each target."""
    length = path.length
    slope = np.zeros_like(force)
    with np.errstate(invalid="ignore", divide="ignore"):
        steep = np.abs(np.diff(force, axis=0)) / np.diff(length)[:, None]
    steep = np.where(np.isfinite(steep), steep, 0.0)
    slope[:-1] = steep
    slope[1:] = np.maximum(slope[1:], steep)
    return slope


def _mean(loads: Array, index: Indices, share: Array, count: int) -> Array:
    """Mean (N, 6) of the samples of each target; 0 without any."""
    divisor = np.maximum(np.bincount(index, share, minlength=count), 1)[:, None]
    return np.column_stack([np.bincount(index, share * column, minlength=count) for column in loads.T]) / divisor


def _means(loads: Array, index: Indices, share: Array, count: int, log: ForceLog) -> tuple[Array, Array]:
    """Mean (N, 6) of the samples of each target, and standard error (N, 3) of the mean force by batch means; row k of loads
    (m, 6) is the mean of share[k] samples.

    Samples that follow each other are not independent (tooth passing, the sensor's own filter): the scatter is that of
    up to 8 consecutive batches a target. Of forces that are means over a revolution already, no batch is shorter than one
    where there are two, and the scatter is put up by what white noise loses to that mean.
    """
    rows = np.bincount(index, minlength=count)
    samples = np.bincount(index, share, minlength=count)
    mean = _mean(loads, index, share, count)
    order = np.argsort(index, kind="stable")
    rank = np.empty(len(index), dtype=np.intp)
    first = np.cumsum(rows) - rows
    rank[order] = np.arange(len(index)) - first[index[order]]
    window = log.rate * log.revolution if log.rate and log.revolution else 0.0
    most = np.clip(samples // window, 2, BATCHES).astype(np.intp) if window else BATCHES
    batches = np.minimum(rows, most)
    cell = index * BATCHES + rank * batches[index] // rows[index]
    size = np.bincount(cell, share, minlength=count * BATCHES).reshape(count, BATCHES)
    errors = np.full((count, 3), np.nan)
    enough = rows >= 2
    for axis in range(3):
        total = np.bincount(cell, share * loads[:, axis], minlength=count * BATCHES).reshape(count, BATCHES)
        spread = np.where(size > 0, total / np.maximum(size, 1) - mean[:, axis, None], 0.0)
        variance = (spread**2).sum(axis=1) / np.maximum(batches - 1, 1) / np.maximum(batches, 1)
        if window:
            variance *= _lost_to_mean(samples, batches, window)
        errors[enough, axis] = np.sqrt(variance[enough])
    return mean, errors


def _lost_to_mean(samples: Array | Indices, batches: Indices, window: float) -> Array:
    """Variance (N,) of the mean of so many samples of white noise after a moving mean over `window`, in units of what batch
    means make of it: those overlap, and so scatter too little."""

    def variance(length: Array) -> Array:
        longer, shorter = np.maximum(length, window), np.minimum(length, window)
        return np.asarray((1 - shorter / (3 * longer)) / longer)

    several = np.maximum(batches, 2)
    whole, part = variance(np.maximum(samples, 1)), variance(np.maximum(samples, 1) / several)
    return np.asarray(whole * (several - 1) / (part - whole))


def _told_apart(mean: Array, standard_error: Array, samples: Indices, rows: Indices) -> NDArray[np.bool_]:
    """Runs of targets (N,) whose mean force is other than zero by its own scatter: each target by 2 sigma, and one of them,
    or their common mean, by 5.

    The error of one target comes from 8 batches; it is steadied by the lower quartile of all targets, which is the noise of
    air where there is air. Under 8 rows of the log any mean that is not zero is a force.
    """
    few = (rows > 0) & (rows < BATCHES)
    many = np.flatnonzero(rows >= BATCHES)
    other = np.any(mean != 0, axis=1)
    if not len(many):
        return np.asarray(few & other)
    variance = np.full((len(samples), 3), np.inf)
    own = standard_error[many] ** 2 * samples[many, None]
    variance[many] = np.maximum(0.5 * (own + np.quantile(own, 0.25, axis=0)) / samples[many, None], 1e-24)
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


def _without_gaps(forced: NDArray[np.bool_], sampled: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """A stretch of at most GAP sampled targets between targets with force belongs to the cut: no step in the surface."""
    filled = forced.copy()
    places = np.flatnonzero(forced)
    step = np.diff(places)
    for place in np.flatnonzero((step > 1) & (step <= GAP + 1)):
        inside = slice(places[place] + 1, places[place + 1])
        filled[inside] = sampled[inside]
    return filled


def _to_base(mean: Array, standard_error: Array, log: ForceLog, path: RobotPath, cell: Cell) -> tuple[Array, Array]:
    """The mean wrench (N, 6) on the tool at the TCP in the base frame, and the force's standard error there."""
    frame = cell.force_log
    force, moment = frame.sign * mean[:, :3], frame.sign * mean[:, 3:]
    if frame.kind == "base":
        return np.concatenate([force, moment], axis=1), standard_error
    base_from_axes = base_from_log(path, cell)
    if log.has_moment:
        # Moments are those about the log's origin: carried to the TCP, M_tcp = M_log + (log - tcp) x F.
        lever = base_from_axes.position - path.base_from_tcp.position
        carried = np.cross(lever, base_from_axes.turn(force))
        moment = moment + Frame(base_from_axes.rotation, np.zeros(3)).inverse().turn(carried)
    wrench = np.concatenate([base_from_axes.turn(force), base_from_axes.turn(moment)], axis=1)
    variance = np.einsum("nij,nj->ni", np.broadcast_to(base_from_axes.rotation, (len(mean), 3, 3)) ** 2, standard_error**2)
    return np.nan_to_num(wrench), np.sqrt(variance)


def _gaps(log: ForceLog, path: RobotPath, samples: Indices, forced: NDArray[np.bool_]) -> list[Finding]:
    """Targets without a sample between targets with force: they stay where they are, and that leaves a step."""
    empty = samples == 0
    inside = empty[1:-1] & forced[:-2] | empty[1:-1] & forced[2:]
    count = int(inside.sum())
    level: Level = "warning" if 2 * empty.sum() > len(empty) else "note"
    findings = []
    if empty.any():
        findings.append(Finding(
            "CS3011", level, f"{int(empty.sum())} of {len(samples)} targets got no sample and stay as they are",
            file=log.source, hint="is it the log of this program?" if level == "warning" else ""))
    if count:
        first = int(np.argmax(inside)) + 1
        findings.append(Finding(
            "CS3012", "warning", f"{count} targets without a sample stand next to targets with force: left where they are, "
            "each is a step in the surface", file=path.toolpath.source, line=int(path.toolpath.line[first]), target=first,
            hint="log at a higher rate, or check that the log covers the whole cut"))
    return findings



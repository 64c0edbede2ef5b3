"""ForceLog -> one quasi-static wrench a target, with the number of samples behind each (docs/formats.md#force-logs)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from statistics import NormalDist

import numpy as np
from numpy.typing import NDArray

from compensator.forces.cut_direction import said_of_direction, travel
from compensator.forces.detection import SIGMAS, over_noise, over_scatter, without_gaps
from compensator.forces.driven_feed import said_of_clock, said_of_feed
from compensator.forces.driven_moves import AsDriven, as_driven
from compensator.forces.edges import at_edges
from compensator.forces.gaps import filled, said_of_gaps, said_of_held, said_of_left_out, short_gaps
from compensator.forces.in_air import drifted, said_of_air, said_of_trial
from compensator.forces.late_forces import said_of_delay
from compensator.forces.log import ForceLog, read_force_log
from compensator.forces.misread_places import misread
from compensator.forces.one_pass import check_once, said_of_lost, targets_of
from compensator.forces.program_time import moves_in_air
from compensator.forces.ripple import said_of_teeth
from compensator.forces.scatter import of_blocks
from compensator.forces.swapped_columns import swapped_columns
from compensator.forces.tare_check import Range
from compensator.forces.target_forces import TargetForces, at_target
from compensator.forces.target_rows import TargetRows
from compensator.forces.turned_over import said_of_axial, said_of_mirror, said_of_moments
from compensator.forces.zero import Zero, base_from_log, of_six, zero_of
from compensator.path.robot_path import RobotPath
from identification.common.arrays import Array
from identification.common.findings import Finding, counted, error
from identification.model.cell import Cell
from identification.model.cell_file import FrameKind
from identification.model.quaternion_order import other_order
from identification.model.rotations import Frame

__all__ = ["ForceLog", "place_forces", "read_force_log"]
Indices = NDArray[np.intp]
# Middles of sixteen equal shares of a normal distribution, of unit variance.
SHIFTS = np.array([NormalDist().inv_cdf((k + 0.5) / 16) for k in range(16)])
SHIFTS /= SHIFTS.std()


def place_forces(
    log: ForceLog, path: RobotPath, cell: Cell, *, tare: Range | Sequence[Range] | None = None,
    trust_tare: bool = False, fill_gaps: bool = True
) -> TargetForces:
    """Averages the samples around each target, takes off bias and weight, and turns the mean into the base frame at the TCP.

    tare: first and last target of an air stretch, or several such. Their mean is the sensor's bias (zero.py), and their scatter
    says what a mean of so many samples shows without any force: targets within 5 sigma of that are without force. Without a
    tare the scatter about each mean itself decides. trust_tare: one that the log speaks against is used, with a warning. Short
    gaps of small force inside a cut, at its feed, belong to the cut; fill_gaps: those without a sample take what lies between
    (gaps.py).
    Raises CompstiffError: CS3004 target beyond the program, CS3005 log not on this path, CS3119 it goes twice over it, and what
    `as_driven` and `zero_of` raise.
    """
    given, driven = log, as_driven(log, path)
    log, held = _without_held(driven.log, path)
    target = targets_of(log, path)
    on = target >= 0
    findings = [*check_once(log, target, path.toolpath.driven),
                *said_of_lost(log, on, path.toolpath.others, partial(misread, given, path))]
    behind = None if log.key == "target" else log.place[on] > path.length[target[on]]
    here = slice(None) if on.all() else on
    rows = TargetRows(len(path.toolpath), target[here], log.weight[here], behind)
    load, before_averaging = log.load[here], log.plain[here]
    mean = of_six(rows.mean(load))
    window = log.rate * log.revolution if log.rate and log.revolution else 0.0
    zero = zero_of(log, path, cell, before_averaging, rows, _stretches(tare), _outside(log, on), trusted=trust_tare)
    # Whether there is a force is for the samples of a target alone to say: a mean over a revolution reaches over an edge.
    own_mean = mean if log.revolution is None else of_six(rows.mean(before_averaging))
    if zero.offset.any():
        mean, own_mean = _without_offset(mean, zero, rows), _without_offset(own_mean, zero, rows)
    # Along the base, so that how the sensor sits on the tool does not matter.
    turn, offset = _turn_to_base(path, cell), zero.offset[:, :3]
    force = np.einsum("mij,mj->mi", turn[rows.target], load[:, :3] - offset[rows.target])
    standard_error = rows.standard_error(force, _turned(turn, mean)[:, :3], window)
    forced = over_scatter(_turned(turn, own_mean), standard_error, rows) if zero.spread is None else over_noise(
        own_mean, rows, *zero.spread)
    forced = without_gaps(forced, rows.samples > 0, ~moves_in_air(path.toolpath), own_mean[:, :3])
    standard_error = of_blocks(standard_error, rows.samples, rows.degrees(window), forced)
    if log.key == "target":
        standard_error = np.hypot(standard_error, at_edges(rows, force, mean[:, :3], forced))
    wrench = _to_base(mean, log, path, cell)
    if log.spread is not None:
        spread = rows.mean(log.spread[on, None])
        standard_error = np.hypot(standard_error, _misplaced(path.length, wrench[:, :3], spread))
    samples = rows.samples.astype(np.intp)
    gaps = short_gaps(path, samples, forced, held) if fill_gaps and log.predicted is None else []
    zero_std = max(drifted(own_mean, path, rows, zero, forced), zero.own_std)
    between, with_gaps = filled(path, wrench, standard_error, forced, gaps), forced.copy()
    with_gaps[between] = True
    forces = TargetForces(np.where(with_gaps[:, None], wrench, 0.0), samples, standard_error, with_gaps,
                          zero.bias, (), log.without_rows() if log.key == "target" else log,
                          *_of_predicted(log, on, rows, forced),
                          zero_std=zero_std, weight_std=_of_weight(zero, zero_std, path, cell))
    findings += [*zero.findings, *_without_force(path, forces, mean, zero),
                 *_weak(log, path, forces, target[on & log.saturated]), *said_of_gaps(log, path, forces, between),
                 *said_of_left_out(log, path, forces, on),
                 *said_of_air(log, path, forces),
                 *said_of_trial(log, path, forces),
                 *(_said_of_time(driven, forced, float(log.weight[on].sum())) if log.predicted is None else ()),
                 *(_direction(log, path, cell, forced, wrench, mean) if log.predicted is None else ())]
    held = held[forces.samples[held] == 0]
    return replace(forces, held=held, findings=(*log.findings, *findings, *said_of_held(held, path)))


def _said_of_time(driven: AsDriven, forced: NDArray[np.bool_], samples: float) -> list[Finding]:
    """What the time in a log says, along the moves as they were driven; forced (N,): targets with force; samples: so many are
    on the path."""
    along = driven.along
    along = along if along.held is None else along.rows(~along.held)
    return [*said_of_feed(along, driven.run, forced[driven.order]), *said_of_clock(along, driven.run, samples),
            *said_of_delay(along, driven.run)]


def _without_held(log: ForceLog, path: RobotPath) -> tuple[ForceLog, Indices]:
    """The placed log without the rows in which a channel stood still, and the targets these are of. Raises CompstiffError
    (CS3024) where there are no others."""
    if log.held is None or not log.held.any():
        return log, np.empty(0, dtype=np.intp)
    if log.held.all():
        raise error("CS3024", "a channel stands still in all of the log: nothing in it is a force", file=log.source,
                    hint="check the logger, and log the pass again")
    target = targets_of(log.rows(log.held), path)
    return log.rows(~log.held), np.unique(target[target >= 0])


def _direction(
    log: ForceLog, path: RobotPath, cell: Cell, forced: NDArray[np.bool_], wrench: Array, mean: Array
) -> list[Finding]:
    """What the direction of logged forces tells of sign, frame and the order of the columns, and their ripple of the cutter."""
    if not forced.any():
        return []
    cuts, force, stated = travel(path, forced), wrench[:, :3], "sign" in cell.force_log.form.model_fields_set
    axes, source = base_from_log(path, cell), log.source
    frames = _in_frames(force, mean[:, :3], path, cell)
    said = [*said_of_direction(cuts, frames, cell.force_log.kind, source, sign_stated=stated),
            *swapped_columns(cuts, force, axes.rotation, source)]
    if all(finding.code == "CS3071" for finding in said):
        said += [*said_of_mirror(cuts, force, source), *said_of_axial(cuts, path, force, source)]
    if log.has_moment:
        said += said_of_moments(mean, axes.rotation, path.base_from_tcp.position - axes.position, forced, cell, source)
    return [*said,
            *said_of_teeth(log.ripple, cell.cutting.teeth, log.source)]


def _of_predicted(
    log: ForceLog, on: NDArray[np.bool_], rows: TargetRows, forced: NDArray[np.bool_]
) -> tuple[Array | None, Array | None]:
    """Covariance (N, 3, 3) [N^2] of predicted forces at the targets, and what they follow (N, 3, 3) [N/m]; None where they were
    logged."""
    if log.predicted is None:
        return None, None
    step, samples = log.predicted.step[on], np.maximum(rows.samples, 1)

    def means(values: Array) -> Array:
        columns = [np.where(forced, rows.sum(column[step]) / samples, 0.0) for column in values.reshape(-1, 9).T]
        return np.stack(columns, axis=1).reshape(-1, 3, 3)

    return means(log.predicted.covariance), means(log.predicted.follows)


def _stretches(tare: Range | Sequence[Range] | None) -> list[Range]:
    """One stretch or several as several."""
    if tare is None:
        return []
    if len(tare) == 2 and isinstance(tare[0], int) and isinstance(tare[1], int):
        return [(tare[0], tare[1])]
    return [stretch for stretch in tare if not isinstance(stretch, int)]


def _outside(log: ForceLog, on: NDArray[np.bool_]) -> tuple[Array, Array]:
    """Loads (k, 3 or 6) of the rows before the first and after the last one on the path (M,)."""
    inside, load = np.flatnonzero(on), log.load
    return (load[:inside[0]], load[inside[-1] + 1:]) if len(inside) else (load[:0], load[:0])


def _without_offset(mean: Array, zero: Zero, rows: TargetRows) -> Array:
    less = np.where(rows.samples[:, None] > 0, mean - zero.offset, 0.0)
    less[np.abs(less) < 1e-9] = 0.0
    return less


def _misplaced(length: Array, force: Array, spread: Array) -> Array:
    """What standing `spread` (N, 1) [m, 1 sigma] further on or back along `length` (N,) [m] makes of the force (N, 3) [N], each
    component, root mean square: |dF/ds| times the spread where the force changes evenly, and never more than it changes."""
    known = np.isfinite(length)
    length, values = length[known], force[known]
    square = np.zeros_like(values)
    for shift in SHIFTS:
        at = length + shift * spread[known, 0]
        square += (np.stack([np.interp(at, length, axis) for axis in values.T], axis=1) - values) ** 2
    found = np.zeros_like(force)
    found[known] = np.sqrt(square / len(SHIFTS))
    return found


def _turn_to_base(path: RobotPath, cell: Cell) -> Array:
    """The rotation (N, 3, 3) from the log's axes to those of the base; none where a target's pose is not known."""
    rotation = base_from_log(path, cell).rotation
    known = np.isfinite(rotation.sum(axis=(1, 2)))
    return np.asarray(np.where(known[:, None, None], rotation, np.eye(3)))


def _turned(turn: Array, mean: Array) -> Array:
    """Mean loads (N, 6), of which the force is turned."""
    return np.concatenate([np.einsum("nij,nj->ni", turn, mean[:, :3]), mean[:, 3:]], axis=1)


def _to_base(mean: Array, log: ForceLog, path: RobotPath, cell: Cell) -> Array:
    """The mean wrench (N, 6) on the tool at the TCP in the base frame."""
    frame = cell.force_log
    force, moment = frame.sign * mean[:, :3], frame.sign * mean[:, 3:]
    if frame.kind == "base":
        return np.concatenate([force, moment], axis=1)
    base_from_axes = base_from_log(path, cell)
    if log.has_moment:
        # Moments are those about the log's origin: carried to the TCP, M_tcp = M_log + (log - tcp) x F.
        lever = base_from_axes.position - path.base_from_tcp.position
        carried = np.cross(lever, base_from_axes.turn(force))
        moment = moment + Frame(base_from_axes.rotation, np.zeros(3)).inverse().turn(carried)
    wrench = np.concatenate([base_from_axes.turn(force), base_from_axes.turn(moment)], axis=1)
    return np.asarray(np.nan_to_num(wrench))


def _of_weight(zero: Zero, zero_std: float, path: RobotPath, cell: Cell) -> Array | None:
    """By how much the zero at each target is less sure (N, 3) [N, 1 sigma], base frame, than zero_std [N]: its payload was told
    by the tare."""
    if zero.spread is None or zero.spread[1].ndim == 2:
        return None
    rotation = base_from_log(path, cell).rotation
    square = np.nan_to_num(np.einsum("nij,njk,nik->ni", rotation, zero.spread[1][:, :3, :3], rotation))
    return np.asarray(np.sqrt(np.maximum(square - zero_std**2, 0.0)))


def _in_frames(force: Array, mean: Array, path: RobotPath, cell: Cell) -> dict[str, Array]:
    """The force (N, 3) on the tool, base frame, were the mean (N, 3) that was logged in each of the frames a log may be in;
    `force` in that of cell.yaml; `sensor` where it is known."""
    form = cell.force_log
    known: list[FrameKind] = ["base", "tool", "sensor"]
    others = {kind: base_from_log(path, replace(cell, force_log=replace(form, kind=kind)))
              for kind in (known if form.flange_from_sensor is not None else known[:2]) if kind != form.kind}
    turned = {} if form.kind != "sensor" or form.flange_from_sensor is None else {
        "sensor, its quaternion read as x y z w": base_from_log(path, replace(cell, force_log=replace(
            form, flange_from_sensor=Frame(other_order(form.flange_from_sensor.rotation), form.flange_from_sensor.position))))}
    return {form.kind: force, **{
        kind: form.sign * mean if kind == "base" else np.nan_to_num(frame.turn(form.sign * mean))
        for kind, frame in (others | turned).items()}}


def axes_of_log(path: RobotPath, cell: Cell) -> dict[str, Array]:
    """The rotation (N, 3, 3) into the base frame of each frame that a log may be in; `sensor` where it is known."""
    form = cell.force_log
    kinds: list[FrameKind] = ["base", "tool", *(("sensor",) if form.flange_from_sensor is not None else ())]
    return {kind: base_from_log(path, replace(cell, force_log=replace(form, kind=kind))).rotation for kind in kinds}


def _without_force(path: RobotPath, forces: TargetForces, mean: Array, zero: Zero) -> list[Finding]:
    """Targets whose mean (N, 6), though not zero, is not told apart from it."""
    silent = np.flatnonzero((forces.samples > 0) & ~forces.forced & np.any(mean != 0, axis=1))
    if not len(silent):
        return []
    which = "that is not told apart from zero" if zero.noise is None else "within what the sensor shows in air"
    return [Finding("CS3009", "note", f"{counted(len(silent), 'target')} with a mean force {which} ({SIGMAS:g} sigma) taken "
                    "as without force", **at_target(path, silent[0]))]


def _weak(log: ForceLog, path: RobotPath, forces: TargetForces, saturated: Indices) -> list[Finding]:
    """Targets with force whose mean is not what it should be. saturated: target of each row with a saturated sample."""
    findings = []
    hurt = np.flatnonzero(np.bincount(saturated, minlength=len(forces.forced)).astype(bool) & forces.forced)
    if len(hurt):
        findings.append(Finding("CS3026", "warning", f"the force of {counted(len(hurt), 'target')} depends on saturated "
                                "samples: it is larger than what is corrected for", **at_target(path, hurt[0])))
    if log.rate and log.revolution:
        short = np.flatnonzero(forces.forced & (forces.samples < log.rate * log.revolution))
        if len(short):
            findings.append(Finding("CS3029", "note", f"{counted(len(short), 'target')} with force and less than one "
                                    "revolution of the spindle: the mean reaches into the neighbours' stretches",
                                    **at_target(path, short[0])))
    return findings

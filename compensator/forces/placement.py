"""ForceLog -> one quasi-static wrench a target, with the number of samples behind each (docs/formats.md#force-logs)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from statistics import NormalDist
from typing import Any

import numpy as np
from numpy.typing import NDArray

from compensator.forces.cut_direction import said_of_direction, travel
from compensator.forces.detection import SIGMAS, over_noise, over_scatter, without_gaps
from compensator.forces.driven_feed import said_of_clock, said_of_feed
from compensator.forces.driven_moves import AsDriven, as_driven
from compensator.forces.edges import at_edges
from compensator.forces.gaps import filled, left_out, short_gaps, without_sample_in_cut
from compensator.forces.late_forces import said_of_delay
from compensator.forces.log import ForceLog, read_force_log
from compensator.forces.misread_places import misread
from compensator.forces.one_pass import check_once, said_of_lost, targets_of
from compensator.forces.program_time import moves_in_air
from compensator.forces.ripple import said_of_teeth
from compensator.forces.scatter import of_blocks
from compensator.forces.swapped_columns import swapped_columns
from compensator.forces.tare_check import Range
from compensator.forces.target_rows import TargetRows
from compensator.forces.turned_over import said_of_axial, said_of_mirror, said_of_moments
from compensator.forces.zero import Zero, base_from_log, of_six, zero_of
from compensator.path.robot_path import RobotPath
from identification.common.arrays import Array, read_only
from identification.common.findings import Finding, Level, counted, error, verb
from identification.model.cell import Cell
from identification.model.cell_file import FrameKind
from identification.model.quaternion_order import other_order
from identification.model.rotations import Frame

__all__ = ["ForceLog", "TargetForces", "place_forces", "read_force_log"]
Indices = NDArray[np.intp]
# So many stretches of targets are listed in a finding.
MOST_LISTED = 6
# A force in air under this [N], and under this share of the largest, is drift that is no more than worth a note.
SMALL, SMALL_SHARE = 5.0, 0.05
# A log shows no cut where under this share of the targets at the cutting feed, of so many at least, has a force, and one of
# under so much in the middle [N].
HARDLY_ANY, SOME, WEAK = 0.1, 50, 10.0
# A feed is for cutting where this share of the logged targets that are reached at it has a force.
CUTS = 0.5
# Middles of sixteen equal shares of a normal distribution, of unit variance.
SHIFTS = np.array([NormalDist().inv_cdf((k + 0.5) / 16) for k in range(16)])
SHIFTS /= SHIFTS.std()


@dataclass(frozen=True, eq=False)
class TargetForces:
    """One wrench a target: wrench (N, 6) [N, N m] on the tool at the TCP, base frame; samples (N,) behind each.

    standard_error (N, 3) [N] of the mean force, base frame, by the samples' scatter (scatter.py); NaN under two samples.
    forced (N,): the force is told apart from zero. tare (6,): the bias that was subtracted, log frame, None: none is known.
    log: by path length; where it names targets without its rows, which nobody asks for again. unknown (N, 3, 3) [N^2], base
    frame: covariance of forces that were predicted; follows (N, 3, 3) [N/m]: what those change by where the tool stands off
    its plan. None where they were logged. held (k,): targets all of whose samples stood still (health.py), of which no force
    is known. zero_std [N]: 1 sigma of each axis of the sensor's zero, as moves in the air beside the tare show it.
    """

    wrench: Array
    samples: Indices
    standard_error: Array
    forced: NDArray[np.bool_]
    tare: Array | None
    findings: tuple[Finding, ...]
    log: ForceLog
    unknown: Array | None = None
    follows: Array | None = None
    held: Indices = field(default_factory=lambda: np.empty(0, dtype=np.intp))
    zero_std: float = 0.0

    @property
    def named(self) -> bool:
        """Whether the log gave the target of each sample."""
        return self.log.key == "target"

    def __post_init__(self) -> None:
        read_only(self.wrench, self.samples, self.standard_error, self.forced)


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
    standard_error = rows.standard_error(load[:, :3], mean, window)
    zero = zero_of(log, path, cell, before_averaging, rows, _stretches(tare), _outside(log, on), trusted=trust_tare)
    # Whether there is a force is for the samples of a target alone to say: a mean over a revolution reaches over an edge.
    own_mean = mean if log.revolution is None else of_six(rows.mean(before_averaging))
    if zero.offset.any():
        mean, own_mean = _without_offset(mean, zero, rows), _without_offset(own_mean, zero, rows)
    forced = over_scatter(own_mean, standard_error, rows) if zero.noise is None else over_noise(
        own_mean, rows, zero.noise, zero.tared)
    forced = without_gaps(forced, rows.samples > 0, ~moves_in_air(path.toolpath), own_mean[:, :3])
    standard_error = of_blocks(standard_error, rows.samples, rows.degrees(window), forced)
    if log.key == "target":
        standard_error = np.hypot(standard_error, at_edges(rows, load[:, :3], mean[:, :3], forced))
    wrench, standard_error = _to_base(mean, standard_error, log, path, cell)
    if log.spread is not None:
        spread = rows.mean(log.spread[on, None])
        standard_error = np.hypot(standard_error, _misplaced(path.length, wrench[:, :3], spread))
    samples = rows.samples.astype(np.intp)
    gaps = short_gaps(path, samples, forced, held) if fill_gaps and log.predicted is None else []
    between, with_gaps = filled(path, wrench, standard_error, forced, gaps), forced.copy()
    with_gaps[between] = True
    forces = TargetForces(np.where(with_gaps[:, None], wrench, 0.0), samples, standard_error, with_gaps,
                          zero.bias, (), log.without_rows() if log.key == "target" else log,
                          *_of_predicted(log, on, rows, forced), zero_std=_drifted(own_mean, path, rows, zero, forced))
    findings += [*zero.findings, *_without_force(path, forces, mean, zero),
                 *_weak(log, path, forces, target[on & log.saturated]), *_gaps(log, path, forces, between),
                 *_left_out(log, path, forces, on),
                 *_in_air(log, path, forces),
                 *_driven_in_air(log, path, forces),
                 *(_said_of_time(driven, forced, float(log.weight[on].sum())) if log.predicted is None else ()),
                 *(_direction(log, path, cell, forced, wrench, mean) if log.predicted is None else ())]
    held = held[forces.samples[held] == 0]
    return replace(forces, held=held, findings=(*log.findings, *findings, *_held(held, path)))


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


def _held(left: Indices, path: RobotPath) -> list[Finding]:
    """The targets whose samples stood still and that have no others, and so no correction."""
    if not len(left):
        return []
    return [Finding("CS3070", "warning", f"{counted(len(left), 'target')} left where planned, since the log stood still there: "
                    f"{_listed(left)}", **_at(path, int(left[0])),
                    hint="log the pass again; what stands in the log there is no force")]


def _listed(targets: Indices) -> str:
    """Targets (n,), ascending, as stretches."""
    starts = targets[np.flatnonzero(np.diff(targets, prepend=-2) > 1)]
    ends = targets[np.flatnonzero(np.diff(targets, append=targets[-1] + 2) > 1)]
    runs = [f"{first} to {last}" if last > first else f"{first}" for first, last in zip(starts, ends, strict=True)]
    more = f" and {len(runs) - MOST_LISTED} more" if len(runs) > MOST_LISTED else ""
    return f"{', '.join(runs[:MOST_LISTED])}{more}"


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


def _at(path: RobotPath, target: int) -> dict[str, Any]:
    """Where a target stands, for a finding."""
    return {"file": path.toolpath.source, "line": int(path.toolpath.line[target]), "target": int(target)}


def _without_force(path: RobotPath, forces: TargetForces, mean: Array, zero: Zero) -> list[Finding]:
    """Targets whose mean (N, 6), though not zero, is not told apart from it."""
    silent = np.flatnonzero((forces.samples > 0) & ~forces.forced & np.any(mean != 0, axis=1))
    if not len(silent):
        return []
    which = "that is not told apart from zero" if zero.noise is None else "within what the sensor shows in air"
    return [Finding("CS3009", "note", f"{counted(len(silent), 'target')} with a mean force {which} ({SIGMAS:g} sigma) taken "
                    "as without force", **_at(path, silent[0]))]


def _weak(log: ForceLog, path: RobotPath, forces: TargetForces, saturated: Indices) -> list[Finding]:
    """Targets with force whose mean is not what it should be. saturated: target of each row with a saturated sample."""
    findings = []
    hurt = np.flatnonzero(np.bincount(saturated, minlength=len(forces.forced)).astype(bool) & forces.forced)
    if len(hurt):
        findings.append(Finding("CS3026", "warning", f"the force of {counted(len(hurt), 'target')} depends on saturated "
                                "samples: it is larger than what is corrected for", **_at(path, hurt[0])))
    if log.rate and log.revolution:
        short = np.flatnonzero(forces.forced & (forces.samples < log.rate * log.revolution))
        if len(short):
            findings.append(Finding("CS3029", "note", f"{counted(len(short), 'target')} with force and less than one "
                                    "revolution of the spindle: the mean reaches into the neighbours' stretches",
                                    **_at(path, short[0])))
    return findings


def _gaps(log: ForceLog, path: RobotPath, forces: TargetForces, between: Indices) -> list[Finding]:
    """Targets without a sample: those in short gaps of a cut, which are `between` (n,) others, and those that stay where they
    are, which in the cut leaves a step."""
    empty = forces.samples == 0
    inside = np.flatnonzero(without_sample_in_cut(path, forces.samples, forces.forced))
    level: Level = "warning" if 2 * empty.sum() > len(empty) else "note"
    at_feed = ~moves_in_air(path.toolpath)
    # A cut that is not in the log: where what the log has at the cutting feed has forces, that feed is for cutting.
    missed = empty & at_feed
    missed[between], missed[inside] = False, False
    if log.predicted is not None or forces.forced[at_feed & ~empty].sum() < CUTS * (at_feed & ~empty).sum():
        missed[:] = False
    findings = []
    if empty.sum() > len(between):
        alone = "" if not missed.any() else (f", {int(missed.sum())} of them reached at the cutting feed, from line "
                                             f"{path.toolpath.line[missed].min()} on")
        hint = ("was a cut added to the program since, or does the log end before it?" if missed.any()
                else "is it the log of this program?" if level == "warning" else "")
        findings.append(Finding(
            "CS3011", "warning" if missed.any() else level, f"{int(empty.sum()) - len(between)} of "
            f"{counted(len(empty), 'target')} got no sample: left where planned{alone}",
            file=log.source, hint=hint))
    if len(between):
        findings.append(Finding(
            "CS3014", level, f"{counted(len(between), 'target')} of the cut without a sample {verb(len(between), 'take')} what "
            f"lies between the forces on either side: {_listed(between)}", **_at(path, int(between[0])),
            hint="log at a higher rate; what may lie between is in their sigma"))
    if len(inside):
        findings.append(Finding(
            "CS3012", "warning", f"{counted(len(inside), 'target')} of the cut without a sample, beside targets with force: "
            f"left where planned, with a step in the surface at either end: {_listed(inside)}", **_at(path, int(inside[0])),
            hint="log at a higher rate, or check that the log covers the whole cut"))
    return findings


def _left_out(log: ForceLog, path: RobotPath, forces: TargetForces, on: NDArray[np.bool_]) -> list[Finding]:
    """Stretches of a cut without a sample between two targets that have some. on (M,): the log's rows on the path."""
    if log.key != "path_mm" or log.spread is not None or log.predicted is not None or path.toolpath.driven is not None:
        return []
    to, lost = left_out(path, log.place[on])
    known = (forces.samples[to] > 0) & (forces.samples[to - 1] > 0) & (forces.forced[to] | forces.forced[to - 1])
    if not known.any():
        return []
    to, lost = to[known], lost[known]
    worst = int(np.argmax(lost))
    more = f", and less of {len(to) - 1} more" if len(to) > 1 else ""
    return [Finding("CS3134", "warning", f"the log leaves out {1e3 * lost[worst]:.0f} mm of the move to this target, in the "
                    f"cut{more}: there the force is taken to lie between those on either side", **_at(path, int(to[worst])),
                    hint="log the pass again where that matters: what the force did there is in no sigma")]


def _drifted(mean: Array, path: RobotPath, rows: TargetRows, zero: Zero, forced: NDArray[np.bool_]) -> float:
    """1 sigma [N] of each axis of the sensor's zero after a tare, over the time of the program: what the mean loads (N, 6) of
    moves at the air feed show beyond their noise, and between them evenly; those that cut all the same are not asked. 0 without
    a tare, or where that is no drift."""
    in_air = moves_in_air(path.toolpath)
    air = np.flatnonzero(in_air & np.append(in_air[1:], True) & (rows.samples > 0))
    if zero.bias is None or zero.noise is None or not len(air):
        return 0.0
    force = np.linalg.norm(mean[:, :3], axis=1)
    size = force[air]
    small = min(SMALL, SMALL_SHARE * float(force[forced].max(initial=0.0)))
    if np.median(size) > small:
        return 0.0
    # A drift of that middle is at most twice as much anywhere; more is a touch, or a cut that is driven with MoveJ.
    calm = size <= 2 * small
    air, size = air[calm], size[calm]
    noise = np.sum(zero.noise[:3] ** 2) / rows.samples[air]
    drift = np.sqrt(np.maximum(size**2 - noise, 0.0))
    # Samples are time.
    time = np.cumsum(rows.samples)
    return float(np.sqrt(np.average(np.interp(time, time[air], drift) ** 2, weights=np.maximum(rows.samples, 1e-9)) / 3))


def _driven_in_air(log: ForceLog, path: RobotPath, forces: TargetForces) -> list[Finding]:
    """A pass that cut next to nothing: a trial run above the part."""
    cuts = ~moves_in_air(path.toolpath) & (forces.samples > 0)
    forced = cuts & forces.forced
    size = float(np.median(np.linalg.norm(forces.wrench[forced, :3], axis=1))) if forced.any() else 0.0
    if log.predicted is not None or cuts.sum() < SOME or forced.sum() > HARDLY_ANY * cuts.sum() or size > WEAK:
        return []
    return [Finding("CS3077", "warning", f"of {cuts.sum()} targets at the cutting feed {int(forced.sum()) or 'none'} with a "
                    f"force{f', {size:.1f} N in the middle' if forced.any() else ''}: was this pass driven in the air?",
                    file=log.source, hint="correct needs the log of a pass that cuts; right where it only grazes the part")]


def _in_air(log: ForceLog, path: RobotPath, forces: TargetForces) -> list[Finding]:
    """Where moves at the air feed show a force it is likely the sensor's bias, or what that has become."""
    in_air = moves_in_air(path.toolpath)
    # The stretch of a target reaches into the move behind it, which may cut.
    air = np.flatnonzero(in_air & np.append(in_air[1:], True) & (forces.samples > 0))
    where = "at the air feed"
    if not in_air.any() and forces.tare is None and forces.forced.all():
        # At one feed everywhere a program still begins and ends in the air.
        air, where = np.unique([0, len(path.toolpath) - 1]), "to the first and the last target"
    touched = air[forces.forced[air]]
    if 2 * len(touched) <= len(air):
        return []
    size = np.linalg.norm(forces.wrench[touched, :3], axis=1)
    why = "no bias was taken off"
    hint = "name targets in the air with --tare FIRST:LAST, or state force_log.bias_n in cell.yaml"
    if forces.tare is not None:
        why = "the bias that was taken off is not theirs"
        hint = "does the sensor's zero drift, or does a payload turn whose mass cell.yaml does not state?"
    small = np.median(size) < min(SMALL, SMALL_SHARE * float(np.linalg.norm(forces.wrench[:, :3], axis=1).max()))
    return [Finding("CS3041", "note" if small else "warning", f"{len(touched)} of {counted(len(air), 'move')} {where} "
                    f"{verb(len(touched), 'show')} a force, {np.median(size):.1f} N in the middle, and "
                    f"{verb(len(touched), 'are')} moved with the others: {why}",
                    file=log.source, line=None, target=int(touched[0]), hint=hint)]

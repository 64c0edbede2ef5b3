"""ForceLog -> one quasi-static wrench a target, with the number of samples behind each (FORMATS.md, forces.csv)."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from compensator.placement import arc_length, match_forwards, nearest_target
from compensator.planning import Plan
from identification.cell import Cell
from identification.findings import Finding, error
from identification.measurements import FORCES, JOINTS, MOMENTS
from identification.model.kinematics import forward
from identification.model.rotations import Frame
from identification.tables import Table, read_table

Array = NDArray[np.float64]
Indices = NDArray[np.intp]
Key = Literal["target", "path_mm", "position", "joints"]
POSITION = ("x_mm", "y_mm", "z_mm")
BATCHES = 8


@dataclass(frozen=True, eq=False)
class ForceLog:
    """A logged pass, M samples in time order, as logged: forces (M, 3) [N] and moments (M, 3) [N m] in the log's frame.

    key: what places a sample; place: (M,) target index or path length [m], (M, 3) TCP position in the work object [m], or
    (M, 6) joint angles [rad].
    """

    source: str
    force: Array
    moment: Array
    has_moment: bool
    key: Key
    place: Array
    line: Indices
    findings: tuple[Finding, ...] = ()


@dataclass(frozen=True, eq=False)
class TargetForces:
    """One wrench a target: wrench (N, 6) [N, N m] on the tool at the TCP, base frame; samples (N,) behind each.

    standard_error (N, 3) [N] of the mean force, base frame, from the scatter of the samples; NaN under two samples.
    forced (N,): the force is told apart from zero. tare (6,): what was subtracted, log frame, None without tare.
    """

    wrench: Array
    samples: Indices
    standard_error: Array
    forced: NDArray[np.bool_]
    tare: Array | None
    findings: tuple[Finding, ...]


def read_force_log(path: str | Path) -> ForceLog:
    """Reads a force log. Raises CompstiffError: CS0201 to CS0203, CS3001 no column places the samples, CS3002 empty."""
    table = read_table(path, required=FORCES, optional=(*MOMENTS, "target", "path_mm", *POSITION, *JOINTS, "time_s"))
    if not len(table):
        raise error("CS3002", "no samples", file=table.source)
    force = table.stack(*FORCES)
    has_moment = any(name in table.numbers for name in MOMENTS)
    moment = np.column_stack([table.numbers.get(name, np.zeros(len(table))) for name in MOMENTS])
    key, place = _placing_columns(table)
    note = Finding("CS3003", "note", f"{len(table)} samples, placed by {_KEY_WORDS[key]}", file=table.source)
    return ForceLog(table.source, force, moment, has_moment, key, place, table.line, (note,))


_KEY_WORDS = {"target": "target number", "path_mm": "path length", "position": "TCP position", "joints": "joint angles"}


def _placing_columns(table: Table) -> tuple[Key, Array]:
    if "target" in table.numbers:
        target = table.numbers["target"]
        broken = np.flatnonzero((target != np.round(target)) | (target < 0))
        if len(broken):
            row = int(broken[0])
            raise error("CS3004", f"target {target[row]:g} is not a target number, expected 0, 1, 2 ...", file=table.source,
                        line=int(table.line[row]), column=table.column("target"))
        return "target", target
    if "path_mm" in table.numbers:
        return "path_mm", 1e-3 * table.numbers["path_mm"]
    if all(name in table.numbers for name in POSITION):
        return "position", 1e-3 * table.stack(*POSITION)
    if all(name in table.numbers for name in JOINTS):
        return "joints", np.radians(table.stack(*JOINTS))
    alone = "time_s is there, but placing a log by time alone is not supported yet" if "time_s" in table.numbers else (
        f"found {', '.join(table.columns)}")
    raise error("CS3001", f"no column says where on the path a sample belongs: {alone}", file=table.source, line=1,
                hint="log one of: target, path_mm, x_mm y_mm z_mm (TCP in the work object), q1_deg ... q6_deg")


def place_forces(
    log: ForceLog, plan: Plan, cell: Cell, *, tare: tuple[int, int] | None = None, significance: float = 4.0
) -> TargetForces:
    """Averages the samples around each target and turns the mean into the base frame at the TCP.

    tare: first and last target of an air stretch whose mean is the sensor's bias. significance: a mean of 8 samples or
    more counts as no force while every component is within so many standard errors of zero.
    Raises CompstiffError: CS3004 target beyond the program, CS3005 log not on this path, CS3006 no samples in the tare.
    """
    count = len(plan.toolpath)
    target, findings = _assign(log, plan)
    placed = target >= 0
    if not placed.any():
        raise error("CS3005", f"none of the {len(target)} samples lies on this path", file=log.source,
                    hint="is it the log of this program, with TCP positions in its work object?")
    lost = int((~placed).sum())
    if lost:
        level: Literal["warning", "note"] = "warning" if lost > 0.01 * len(target) else "note"
        findings.append(Finding("CS3007", level, f"{lost} of {len(target)} samples are not on the path and were not used",
                                file=log.source))
    loads = np.concatenate([log.force, log.moment], axis=1)[placed]
    index = target[placed]
    samples = np.bincount(index, minlength=count)
    mean, standard_error = _means(loads, index, samples)
    subtracted = None
    if tare is not None:
        subtracted = _tare(log, loads, index, tare)
        mean = np.where(samples[:, None] > 0, mean - subtracted, 0.0)
        if not log.has_moment:
            mean[:, 3:] = 0.0
        findings.append(Finding("CS3008", "note", f"bias {', '.join(f'{x:.2f}' for x in subtracted[:3])} N, mean of targets "
                                f"{tare[0]} to {tare[1]}, was subtracted", file=log.source))
    told_apart = (samples < BATCHES) | (np.abs(mean[:, :3]) > significance * standard_error).any(axis=1)
    forced = (samples > 0) & np.any(mean != 0, axis=1) & (told_apart | (log.has_moment & np.any(mean[:, 3:] != 0, axis=1)))
    silent = int(((samples > 0) & ~forced & np.any(mean != 0, axis=1)).sum())
    if silent:
        findings.append(Finding("CS3009", "note", f"{silent} targets whose mean force is not told apart from zero "
                                f"({significance:g} standard errors) were taken as without force", file=log.source))
    wrench, standard_error = _to_base(mean, standard_error, log, plan, cell)
    wrench = np.where(forced[:, None], wrench, 0.0)
    findings += _gaps(log, plan, samples, forced)
    return TargetForces(wrench, samples, standard_error, forced, subtracted, (*log.findings, *findings))


def _assign(log: ForceLog, plan: Plan) -> tuple[Indices, list[Finding]]:
    """Target (M,) of each sample, -1 where it is not on the path."""
    count = len(plan.toolpath)
    if log.key == "target":
        target = log.place.astype(np.intp)
        if target.max() >= count:
            row = int(np.argmax(target >= count))
            raise error("CS3004", f"target {target[row]} is beyond the program, which has {count} targets (0 to {count - 1})",
                        file=log.source, line=int(log.line[row]), hint="is it the log of this program?")
        return target, []
    length = arc_length(plan.world_position, plan.toolpath.move)
    known = ~np.isnan(length)
    if not known.any():
        raise error("CS3005", "the program has no target of known position to place the log on", file=log.source)
    if log.key == "path_mm":
        inside = (log.place >= -1e-3) & (log.place <= np.nanmax(length) + 1e-3)
        return np.where(inside, nearest_target(length, log.place), -1), []
    place = match_forwards(plan.world_position, length, _world_positions(log, plan))
    on_path = ~np.isnan(place)
    return np.where(on_path, nearest_target(length, np.where(on_path, place, 0.0)), -1), []


def _world_positions(log: ForceLog, plan: Plan) -> Array:
    """TCP positions of the samples (M, 3) [m] in the world frame; one tool and one work object are required."""
    used = plan.used_frames
    if log.key == "joints":
        if len(used.tools) != 1:
            raise error("CS3010", f"a log placed by joint angles needs one tool, the program uses {len(used.tools)}",
                        file=log.source, hint="log the column target or path_mm")
        return plan.cell.world_from_base.apply(forward(plan.cell.robot, log.place, used.tools[0]).position)
    if len(used.workobjects) != 1:
        raise error("CS3010", f"a log placed by TCP position needs one work object, the program uses "
                    f"{len(used.workobjects)}", file=log.source, hint="log the column target or path_mm")
    return used.workobjects[0].apply(log.place)


def _means(loads: Array, index: Indices, samples: Indices) -> tuple[Array, Array]:
    """Mean (N, 6) of the samples of each target, and standard error (N, 3) of the mean force by batch means.

    Samples that follow each other are not independent (tooth passing, the sensor's own filter): the scatter is that of
    up to 8 consecutive batches a target.
    """
    count = len(samples)
    divisor = np.maximum(samples, 1)[:, None]
    mean = np.column_stack([np.bincount(index, column, minlength=count) for column in loads.T]) / divisor
    order = np.argsort(index, kind="stable")
    rank = np.empty(len(index), dtype=np.intp)
    first = np.cumsum(samples) - samples
    rank[order] = np.arange(len(index)) - first[index[order]]
    batches = np.minimum(samples, BATCHES)
    cell = index * BATCHES + rank * batches[index] // samples[index]
    size = np.bincount(cell, minlength=count * BATCHES).reshape(count, BATCHES)
    errors = np.full((count, 3), np.nan)
    enough = samples >= 2
    for axis in range(3):
        total = np.bincount(cell, loads[:, axis], minlength=count * BATCHES).reshape(count, BATCHES)
        spread = np.where(size > 0, total / np.maximum(size, 1) - mean[:, axis, None], 0.0)
        variance = (spread**2).sum(axis=1) / np.maximum(batches - 1, 1) / np.maximum(batches, 1)
        errors[enough, axis] = np.sqrt(variance[enough])
    return mean, errors


def _tare(log: ForceLog, loads: Array, index: Indices, tare: tuple[int, int]) -> Array:
    air = (index >= tare[0]) & (index <= tare[1])
    if not air.any():
        raise error("CS3006", f"no sample lies on the targets {tare[0]} to {tare[1]} of --tare", file=log.source,
                    hint="name targets of an air move during which the log was already running")
    return np.asarray(loads[air].mean(axis=0))


def _to_base(mean: Array, standard_error: Array, log: ForceLog, plan: Plan, cell: Cell) -> tuple[Array, Array]:
    """The mean wrench (N, 6) on the tool at the TCP in the base frame, and the force's standard error there."""
    frame = cell.force_log
    force, moment = frame.sign * mean[:, :3], frame.sign * mean[:, 3:]
    if frame.kind == "base":
        return np.concatenate([force, moment], axis=1), standard_error
    if frame.kind == "tool":
        base_from_log = Frame(plan.base_from_tcp.rotation, np.zeros(3))
    else:
        assert frame.flange_from_sensor is not None
        base_from_log = plan.base_from_flange @ frame.flange_from_sensor
        if log.has_moment:
            # Moments are those at the sensor's origin: carried to the TCP, M_tcp = M_sensor + (sensor - tcp) x F.
            lever = base_from_log.position - plan.base_from_tcp.position
            carried = np.cross(lever, base_from_log.turn(force))
            moment = moment + Frame(base_from_log.rotation, np.zeros(3)).inverse().turn(carried)
    wrench = np.concatenate([base_from_log.turn(force), base_from_log.turn(moment)], axis=1)
    variance = np.einsum("nij,nj->ni", np.broadcast_to(base_from_log.rotation, (len(mean), 3, 3)) ** 2, standard_error**2)
    return np.nan_to_num(wrench), np.sqrt(variance)


def _gaps(log: ForceLog, plan: Plan, samples: Indices, forced: NDArray[np.bool_]) -> list[Finding]:
    """Targets without a sample between targets with force: they stay where they are, and that leaves a step."""
    empty = samples == 0
    inside = empty[1:-1] & forced[:-2] | empty[1:-1] & forced[2:]
    count = int(inside.sum())
    findings = [Finding("CS3011", "note", f"{int(empty.sum())} of {len(samples)} targets got no sample and stay as they are",
                        file=log.source)] if empty.any() else []
    if count:
        first = int(np.argmax(inside)) + 1
        findings.append(Finding(
            "CS3012", "warning", f"{count} targets without a sample stand next to targets with force: left where they are, "
            "each is a step in the surface", file=plan.toolpath.source, line=int(plan.toolpath.line[first]), target=first,
            hint="log at a higher rate, or check that the log covers the whole cut"))
    return findings



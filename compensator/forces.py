"""ForceLog -> one quasi-static wrench a target, with the number of samples behind each (FORMATS.md, forces.csv)."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from compensator.placement import arc_length, match_forwards, nearest_target, polyline
from compensator.planning import Plan
from compensator.program_time import force_by_place, place_log
from identification.cell import Cell
from identification.findings import Finding, Level, counted, error
from identification.measurements import FORCES, JOINTS, MOMENTS
from identification.model.kinematics import forward
from identification.model.rotations import Frame
from identification.tables import Table, read_table

Array = NDArray[np.float64]
Indices = NDArray[np.intp]
Key = Literal["target", "path_mm", "position", "joints", "time"]
POSITION = ("x_mm", "y_mm", "z_mm")
BATCHES = 8
# A mean so many sigmas from zero is a force; one next to a force from GROW sigmas on; gaps of at most GAP targets are filled.
SIGMAS, GROW, GAP = 5.0, 2.0, 3


@dataclass(frozen=True, eq=False)
class ForceLog:
    """A logged pass, M samples in time order, as logged: forces (M, 3) [N] and moments (M, 3) [N m] in the log's frame.

    key: what places a sample; place: (M,) target index or path length [m], (M, 3) TCP position in the work object [m], (M, 6)
    joint angles [rad], or (M,) time [s].
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
    table = read_table(path, required=FORCES, optional=(*MOMENTS, "target", "path_mm", *POSITION, *JOINTS, "time_s"),
                       together=(MOMENTS, POSITION, JOINTS))
    if not len(table):
        raise error("CS3002", "no samples below the header line", file=table.source, hint="check the logger")
    force = table.stack(*FORCES)
    has_moment = any(name in table.numbers for name in MOMENTS)
    moment = np.column_stack([table.numbers.get(name, np.zeros(len(table))) for name in MOMENTS])
    key, place = _placing_columns(table)
    others = [words for other, words in _KEY_WORDS.items() if other not in (key, "time") and _FIRST[other] in table.numbers]
    unused = f"; not used: {', '.join(others)}" if others else ""
    note = Finding("CS3003", "note", f"{counted(len(table), 'sample')}, placed by {_KEY_WORDS[key]}{unused}", file=table.source)
    return ForceLog(table.source, force, moment, has_moment, key, place, table.line, (note, *table.findings))


_KEY_WORDS = {"target": "target number", "path_mm": "path length", "position": "TCP position", "joints": "joint angles",
              "time": "time alone"}


_FIRST = {"target": "target", "path_mm": "path_mm", "position": "x_mm", "joints": "q1_deg", "time": "time_s"}


def _placing_columns(table: Table) -> tuple[Key, Array]:
    if "target" in table.numbers:
        target = table.numbers["target"]
        broken = np.flatnonzero((target != np.round(target)) | (target < 0))
        if len(broken):
            row = int(broken[0])
            raise error("CS3004", f"target {target[row]:g} is not a target number, expected 0, 1, 2 ...", file=table.source,
                        line=int(table.line[row]), column=table.column("target"),
                        hint="targets count from 0 in the order of the text; MoveC has two")
        return "target", target
    if "path_mm" in table.numbers:
        return "path_mm", 1e-3 * table.numbers["path_mm"]
    if all(name in table.numbers for name in POSITION):
        return "position", 1e-3 * table.stack(*POSITION)
    if all(name in table.numbers for name in JOINTS):
        return "joints", np.radians(table.stack(*JOINTS))
    if "time_s" in table.numbers:
        return "time", table.numbers["time_s"]
    raise error("CS3001", f"no column says where on the path a sample belongs: found {', '.join(table.columns)}",
                file=table.source, line=1,
                hint="log one of: target, path_mm, x_mm y_mm z_mm (TCP in the work object), q1_deg ... q6_deg, or time_s")


def place_forces(
    log: ForceLog, plan: Plan, cell: Cell, *, tare: tuple[int, int] | None = None
) -> TargetForces:
    """Averages the samples around each target and turns the mean into the base frame at the TCP.

    tare: first and last target of an air stretch. Its mean is the sensor's bias, and its scatter says what a mean of so many
    samples shows without any force: targets within 5 sigma of that are without force. Without a tare the scatter about each
    mean itself decides. Short gaps inside a cut belong to the cut.
    Raises CompstiffError: CS3004 target beyond the program, CS3005 log not on this path, CS3006 no samples in the tare.
    """
    count = len(plan.toolpath)
    target, doubt, findings = _assign(log, plan)
    placed = target >= 0
    if not placed.any():
        raise error("CS3005", f"none of the {len(target)} samples lies on this path", file=log.source,
                    hint="is it the log of this program, with TCP positions in its work object?")
    lost = int((~placed).sum())
    if lost:
        level: Level = "warning" if lost > 0.01 * len(target) else "note"
        findings.append(Finding("CS3007", level, f"{lost} of {counted(len(target), 'sample')} not on the path, not used",
                                file=log.source, line=int(log.line[np.argmin(placed)])))
    loads = np.concatenate([log.force, log.moment], axis=1)[placed]
    index = target[placed]
    samples = np.bincount(index, minlength=count)
    mean, standard_error = _means(loads, index, samples)
    subtracted = None
    if tare is None:
        forced, words = _told_apart(mean, standard_error, samples), "a mean force that is not told apart from zero"
    else:
        subtracted, noise = _tare(log, loads, index, tare)
        mean = np.where(samples[:, None] > 0, mean - subtracted, 0.0)
        # A component without noise (no moments logged, a clean simulation) shows a force by being other than zero.
        share = np.abs(mean) / np.maximum(noise / np.sqrt(np.maximum(samples, 1))[:, None], 1e-12)
        forced, words = (samples > 0) & (share > SIGMAS).any(axis=1), "a mean force within what the sensor shows in air"
        findings.append(Finding("CS3008", "note", f"bias {', '.join(f'{x:.2f}' for x in subtracted[:3])} N, mean of targets "
                                f"{tare[0]} to {tare[1]}, was subtracted", file=log.source))
    forced = _without_gaps(forced, samples > 0)
    silent = np.flatnonzero((samples > 0) & ~forced & np.any(mean != 0, axis=1))
    if len(silent):
        findings.append(Finding(
            "CS3009", "note", f"{counted(len(silent), 'target')} with {words} ({SIGMAS:g} sigma) taken as without force",
            file=plan.toolpath.source, line=int(plan.toolpath.line[silent[0]]), target=int(silent[0])))
    mass = cell.tool_mass
    if mass and cell.force_log.kind != "base":
        findings.append(Finding("CS3013", "warning", f"tool.mass_kg {mass:g} kg: the payload is not "
                                "subtracted from the log", file=log.source, hint="log with payload compensation on"))
    wrench, standard_error = _to_base(mean, standard_error, log, plan, cell)
    if doubt is not None:
        standard_error = np.hypot(standard_error, force_by_place(plan, wrench[:, :3]) * doubt[:, None])
    wrench = np.where(forced[:, None], wrench, 0.0)
    findings += _gaps(log, plan, samples, forced)
    return TargetForces(wrench, samples, standard_error, forced, subtracted, (*log.findings, *findings))


def _assign(log: ForceLog, plan: Plan) -> tuple[Indices, Array | None, list[Finding]]:
    """Target (M,) of each sample, -1 where it is not on the path; and how uncertain the place is (N,) [m], 1 sigma, where it is
    estimated."""
    count = len(plan.toolpath)
    if log.key == "target":
        if log.place.max() >= count:
            row = int(np.argmax(log.place >= count))
            raise error("CS3004", f"target {log.place[row]:g} is beyond the program, which has "
                        f"{counted(count, 'target')} (0 to {count - 1})", file=log.source, line=int(log.line[row]),
                        hint="is it the log of this program?")
        return log.place.astype(np.intp), None, []
    length = arc_length(plan.world_position, plan.toolpath.move)
    known = ~np.isnan(length)
    if not known.any():
        raise error("CS3005", "the program has no target of known position to place the log on", file=log.source)
    if log.key == "path_mm":
        inside = (log.place >= -1e-3) & (log.place <= np.nanmax(length) + 1e-3)
        return np.where(inside, nearest_target(length, log.place), -1), None, []
    if log.key == "time":
        placed = place_log(plan, log.source, log.place, log.force, log.line)
        return placed.target, placed.doubt, list(placed.findings)
    place = match_forwards(*polyline(plan.world_position, plan.toolpath.move), _world_positions(log, plan))
    on_path = ~np.isnan(place)
    return np.where(on_path, nearest_target(length, np.where(on_path, place, 0.0)), -1), None, []


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


def _tare(log: ForceLog, loads: Array, index: Indices, tare: tuple[int, int]) -> tuple[Array, Array]:
    """Mean (6,) of the air stretch, and the noise (6,) of one sample as a mean of many shows it: sigma of a mean of n is
    noise / sqrt(n), correlation between neighbouring samples included, from up to 32 consecutive batches."""
    air = np.flatnonzero((index >= tare[0]) & (index <= tare[1]))
    if not len(air):
        raise error("CS3006", f"no sample lies on the targets {tare[0]} to {tare[1]} of --tare", file=log.source,
                    hint="name targets of an air move during which the log was already running")
    batches = np.array_split(loads[air], min(32, max(len(air) // 4, 1)))
    means = np.array([batch.mean(axis=0) for batch in batches])
    size = len(air) / len(batches)
    spread = means.std(axis=0, ddof=1) * np.sqrt(size) if len(batches) > 1 else np.zeros(6)
    return np.asarray(loads[air].mean(axis=0)), np.asarray(spread)


def _told_apart(mean: Array, standard_error: Array, samples: Indices) -> NDArray[np.bool_]:
    """Runs of targets (N,) whose mean force is other than zero by its own scatter: each target by 2 sigma, and one of them,
    or their common mean, by 5.

    The error of one target comes from 8 batches; it is steadied by the lower quartile of all targets, which is the noise of
    air where there is air. Under 8 samples any mean that is not zero is a force.
    """
    few = (samples > 0) & (samples < BATCHES)
    many = np.flatnonzero(samples >= BATCHES)
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



"""A log with a column `mark`: its edges are the targets at which the program switches an output, its feed steady between."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from compensator.forces.driven_moves import HINT, in_text
from compensator.forces.log import ForceLog
from compensator.forces.packet_counter import PacketCounter
from compensator.forces.source import TIMES
from compensator.path.driven_path import driven_path
from compensator.path.robot_path import RobotPath
from identification.common import number_blocks
from identification.common.arrays import Array
from identification.common.findings import Finding, counted, error
from identification.common.table_layout import read_layout
from identification.model.cell_file import ForceLogFile

Indices = NDArray[np.intp]
MARK = "mark"
# High is above, low below these shares of the way from the lowest to the highest value: noise between them makes no edge.
LOW, HIGH = 0.3, 0.7
# Nothing drives faster between two marks than this many times the programmed feed; engineering judgement: rounded corners are
# shorter, and an override may be over 100 %.
FASTER = 1.5


def has_marks(log: ForceLog, form: ForceLogFile) -> bool:
    """Whether a log has the column."""
    return MARK in _names(Path(log.source), form)


def placed_by_marks(
    log: ForceLog, form: ForceLogFile, path: RobotPath, ways: Sequence[tuple[Indices | None, Indices]]
) -> ForceLog:
    """The log with the key `path_mm`, NaN before the first mark and behind the last.

    ways: those that the program may go: its targets (D,) in the order in which they are driven, None for that of the text, and
    where (k,) among them it switches. Raises CompstiffError: CS3088 the log has another number of edges than the program
    switches on any of them, CS3089 it was driven faster than programmed between two edges, CS3123 several ways have as many.
    """
    changes, up = _changes(Path(log.source), form)
    # A fall before the first rise is the reset of an output that an earlier run left high.
    edges = changes[int(np.argmax(up)):] if up.any() else changes[:0]
    fits = _ways(log, ways, len(edges), len(changes))
    order, at = fits[0]
    if len(fits) > 1:
        log = replace(log, findings=(*log.findings, Finding(
            "CS3123", "warning", "neither the text nor the marks say which branches were driven, between two marks: the log is "
            "placed as if the first of these ways was driven", file=log.source, hint=HINT)))
    if order is None:
        return _at_marks(log, path, edges, at, at)
    driven = driven_path(path, order)
    if driven is None:
        raise error("CS3123", "the routines run in another order than they stand in the text, which cannot be followed: too "
                    "few positions are known, or external axes move", file=log.source, hint="let them stand as they run")
    return in_text(_at_marks(log, driven.run, edges, at, order[at]), "time", driven)


def _ways(
    log: ForceLog, ways: Sequence[tuple[Indices | None, Indices]], edges: int, changes: int
) -> list[tuple[Indices | None, Indices]]:
    """Those of the ways on which the program switches as often as the log shows, at the same targets. edges: from the first
    rise on; changes: with a fall before it."""
    fits = [(order, at) for order, at in ways if len(at) == edges]
    if not fits:
        counts = " or ".join(str(count) for count in sorted({len(at) for _, at in ways}))
        counts += " target" if counts == "1" else " targets"
        if not changes:
            raise error("CS3088", f"the column {MARK} has one value from its first row to its last, the program switches its "
                        f"output at {counts}", file=log.source,
                        hint="is the output wired to the input that is logged, and is this the log of the marked program?")
        low = any(len(at) == changes for _, at in ways)
        turned = ("; it begins high, and counted from its first fall it has as many: is the wire active low, high while the "
                  "output is off?" if low else "")
        hint = (f"turn the column {MARK} over, or the input: high while the output is on" if low else
                "log from before the first target until behind the last, once, at more than 100 samples a second; a loop or an "
                "IF switches another number of times")
        raise error("CS3088", f"the column {MARK} has {counted(edges, 'edge')}, the program switches its output at {counts}"
                    f"{turned}", file=log.source, hint=hint)
    if len({tuple((at if order is None else order[at]).tolist()) for order, at in fits}) > 1:
        raise error("CS3123", f"the column {MARK} has {counted(edges, 'edge')}, and so many has the program by several of its "
                    "branches", file=log.source, hint=HINT)
    return fits


def _at_marks(log: ForceLog, path: RobotPath, edges: Array, at: Indices, target: Indices) -> ForceLog:
    """The log along a path whose targets `at` (k,), numbered in the text as `target`, are those of the edges (k,) [s]."""
    length, feed = path.length[at], path.toolpath.feed
    lasting = np.diff(edges)
    # A feed that is not known, of a move in the air as like as not, leaves open how fast it was.
    programmed = np.array([np.max(feed[a + 1:b + 1], initial=0.0) for a, b in pairwise(at.tolist())])
    with np.errstate(divide="ignore"):
        faster = np.divide(np.diff(length) / lasting, programmed, out=np.zeros(len(lasting)), where=programmed > 0)
    if len(faster) and faster.max() > FASTER:
        k = int(faster.argmax())
        raise error("CS3089", f"between the marks at targets {target[k]} and {target[k + 1]} the log drives {faster[k]:.1f} "
                    f"times as fast as programmed ({1e3 * programmed[k]:g} mm/s)", file=log.source, target=int(target[k]),
                    hint="is it the log of this program? An edge that was lost and another one too many shift all behind them")
    place = np.interp(np.asarray(log.place), edges, length, left=np.nan, right=np.nan)
    outside = int(np.isnan(place).sum())
    left = f"; {counted(outside, 'row')} before the first and behind the last left out" if outside else ""
    note = Finding("CS3090", "note", f"placed by the {len(target)} edges of {MARK}, at targets {target[0]} to {target[-1]}, at "
                   f"steady feed between them{left}", file=log.source)
    return replace(log, key="path_mm", place=place, on_path=True, findings=(*log.findings, note))


def _names(file: Path, form: ForceLogFile) -> Sequence[str]:
    if file.suffix.lower() in (".parquet", ".pq"):
        return number_blocks.parquet_names(file)[0]
    return read_layout(file, form.columns).names


def _blocks(file: Path, form: ForceLogFile) -> Iterator[tuple[Array, Array]]:
    """Time [s] and mark of the samples, block by block."""
    names = _names(file, form)
    time = next((name for name in TIMES if name in names), None)
    packets = "sequence" if time is None and "sequence" in names else None
    wanted = [MARK, *(name for name in (time, packets) if name)]
    read = (number_blocks.parquet_blocks(file, names, wanted) if file.suffix.lower() in (".parquet", ".pq")
            else number_blocks.text_blocks(file, read_layout(file, form.columns), wanted))
    count, counter = 0, PacketCounter()
    for numbers, _ in read:
        mark = np.asarray(numbers[MARK], dtype=float)
        lost = counter.read(np.asarray(numbers[packets], dtype=float))[1] if packets else np.zeros(len(mark))
        at = (np.asarray(numbers[time], dtype=float) * (1e-3 if time == "time_ms" else 1.0) if time
              else (count + np.arange(len(mark)) + lost) / (form.rate_hz or np.nan))
        count += len(mark)
        yield at, mark


def _changes(file: Path, form: ForceLogFile) -> tuple[Array, NDArray[np.bool_]]:
    """When the mark changes (k,) [s], half way between the samples on either side, and whether it rises."""
    low = min((float(mark.min()) for _, mark in _blocks(file, form) if len(mark)), default=0.0)
    high = max((float(mark.max()) for _, mark in _blocks(file, form) if len(mark)), default=0.0)
    if not high > low:
        return np.zeros(0), np.zeros(0, dtype=bool)
    times, levels = [], []
    for at, mark in _blocks(file, form):
        share = (mark - low) / (high - low)
        sure = (share < LOW) | (share > HIGH)
        times.append(at[sure])
        levels.append(share[sure] > HIGH)
    time, level = np.concatenate(times), np.concatenate(levels)
    change = np.flatnonzero(np.diff(level.astype(int)))
    return np.asarray(0.5 * (time[change] + time[change + 1])), level[change + 1]

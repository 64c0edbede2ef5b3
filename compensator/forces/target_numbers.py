"""What the column target of a log names: how many samples each number has is told by the program's feeds and ways.

A logger counts what its controller counts: the target nearest to the tool, or the one that it moves to; from 0 or from 1; a
MoveC as two targets or as one instruction. Read otherwise every force stands a move or more from where it was.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from compensator.forces.log import ForceLog
from compensator.forces.program_time import moves_in_air
from compensator.path.robot_path import RobotPath
from compensator.toolpath import Move
from identification.common.arrays import Array
from identification.common.findings import Finding

# Said where the shares of the samples differ from the program's by this at least, as the column is read, and read otherwise by
# this part of it at most; shares tell only over so many numbers, of which the middling one has so many samples.
DIFFERS, FITS, NUMBERS, SAMPLES = 0.08, 0.4, 6, 8
AHEAD = "the target that the tool moves to"
READ_AHEAD = "state force_log.target: ahead in cell.yaml"
READ_NEAREST = "leave force_log.target out of cell.yaml"
BY_ONE = "targets are counted from 0: take 1 off the column"
MOVE_C = ("a MoveC has two targets, its circle point and its end: log the number of the target, not of the instruction, or log "
          "x_mm y_mm z_mm")


def said_of_numbers(log: ForceLog, path: RobotPath) -> list[Finding]:
    """A warning (CS3132) where the samples of a log that names targets are shared out as the program's moves would have it only
    where its numbers name something else."""
    if path.toolpath.driven is not None or path.toolpath.ways:
        return []
    count = len(path.toolpath)
    samples = np.bincount(log.place.astype(np.intp), log.weight, minlength=count).astype(float)
    stated = path.cell.force_log.form.target
    read = {words: _differs(samples, taken, number) for words, taken, number in _readings(path, log)}
    here = read.pop(stated)
    if not read or not np.isfinite(here) or here < DIFFERS:
        return []
    best = min(read, key=lambda words: read[words])
    if read[best] > FITS * here:
        return []
    what, hint = {
        "nearest": ("the target nearest to the tool", READ_NEAREST), "ahead": (AHEAD, READ_AHEAD),
        "nearest from 1": ("the nearest target, counted from 1", BY_ONE), "ahead from 1": (f"{AHEAD}, counted from 1", BY_ONE),
        "instructions": ("the move instruction under way, a MoveC counted as one", MOVE_C)}[best]
    as_read = "the target nearest to the tool" if stated == "nearest" else AHEAD
    return [Finding("CS3132", "warning", f"the column target is read as {as_read}, and how many samples each number has fits "
                    f"{what}: {100 * here:.0f} % of them stand elsewhere as it is read, {100 * read[best]:.0f} % as that",
                    file=log.source, hint=hint)]


def _readings(path: RobotPath, log: ForceLog) -> Iterator[tuple[str, Array, NDArray[np.intp]]]:
    """Each way to read the column, with the time (n,) [s] that the program takes for n of its numbers, NaN where the feed does
    not say, and these numbers (n,)."""
    toolpath = path.toolpath
    with np.errstate(invalid="ignore", divide="ignore"):
        time = np.diff(path.length, prepend=np.nan) / toolpath.feed
    time[moves_in_air(toolpath) | ~np.isfinite(time)] = np.nan
    number = np.arange(len(time))
    nearest = 0.5 * (time + np.append(time[1:], np.nan))
    yield "nearest", nearest, number
    yield "ahead", time, number
    via = toolpath.move == Move.ARC_VIA
    if log.place.min() == 1:
        yield "nearest from 1", nearest[:-1], number[1:]
        yield "ahead from 1", time[:-1], number[1:]
    if via.any():
        arc = toolpath.move == Move.ARC_END
        arc[0] = False
        whole = time.copy()
        whole[arc] += time[np.flatnonzero(arc) - 1]
        yield "instructions", whole[~via], np.arange(int((~via).sum()))


def _differs(samples: Array, time: Array, number: NDArray[np.intp]) -> float:
    """The share of the samples (N,) of numbers (n,) that would have to stand at others for them to be as the times (n,) [s];
    infinite where these do not tell."""
    known = np.isfinite(time) & (number < len(samples))
    seen, expected = samples[number[known]], time[known]
    if known.sum() < NUMBERS or np.median(seen) < SAMPLES or expected.sum() <= 0:
        return float(np.inf)
    return float(0.5 * np.abs(seen / seen.sum() - expected / expected.sum()).sum())

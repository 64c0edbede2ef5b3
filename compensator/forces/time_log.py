"""A force log with time alone, placed on a program: what is refused, and what is said of the alignment."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from compensator.forces.alignment_regression import binned
from compensator.forces.alignment_search import promise
from compensator.forces.driven_feed import unit_of_time
from compensator.forces.log import ForceLog
from compensator.forces.program_time import HINT, ProgramTime, program_time
from compensator.forces.time_alignment import MOST_ODD, TimeAlignment, align
from compensator.path.robot_path import RobotPath
from identification.common.findings import Finding, Refused, counted, error

# A quick look takes so many bins a stretch, and so many in all.
LOOK, LOOKS = 4, (64, 500)
# Fewer samples than this say nothing about time.
FEWEST_SAMPLES = 100


def place_by_time(log: ForceLog, path: RobotPath) -> ForceLog:
    """A log with time alone as one placed by path length, NaN outside the program, with the spread of each row.

    Raises CompstiffError: CS3060 a move without known time, CS3062 time runs backwards, CS3063 a log that says nothing; Refused
    (CS3061) where no alignment is believed.
    """
    _check_times(log)
    program = program_time(path)
    if not program.time[-1] > 0:
        raise error("CS3063", "the program takes no time: it has no move of known length", file=log.source, hint=HINT)
    alignment = align(program, log.place, log.force)
    if not alignment.believed:
        raise Refused(_not_believed(log, path, program, alignment))
    findings = [_placed(log, alignment), *_odd_stretch(path, program, alignment)]
    return replace(log, key="path_mm", place=alignment.length, spread=np.nan_to_num(alignment.spread),
                   findings=(*log.findings, *findings))


def promise_by_time(log: ForceLog, path: RobotPath) -> float:
    """What a quick look tells of how well a log with time alone fits a path, 0 to 1. Raises as `place_by_time`, but CS3061."""
    _check_times(log)
    program = program_time(path)
    span = float(log.place[-1] - log.place[0])
    bins = int(np.clip(LOOK * span / max(program.period, 1e-3), *LOOKS))
    return promise(program, binned(log.place, log.force, span / bins))


def _check_times(log: ForceLog) -> None:
    """Raises CompstiffError (CS3062, CS3063) for times that say nothing about a place."""
    time, source = log.place, log.source
    if len(time) < FEWEST_SAMPLES:
        raise error("CS3063", f"{counted(len(time), 'sample')} {'is' if len(time) == 1 else 'are'} too few to place a log by "
                    f"time alone, at least {FEWEST_SAMPLES} are needed", file=source, hint=HINT)
    back = np.flatnonzero(np.diff(time) < 0)
    if len(back):
        row = int(back[0]) + 1
        raise error("CS3062", f"time_s {time[row]:g} stands before the one above it, {time[row - 1]:g}", file=source,
                    line=int(log.line[row]), hint="samples must be in the order of time, one pass a file")
    if not np.ptp(log.force, axis=0).any() or time[-1] == time[0]:
        raise error("CS3063", "the force never changes, or time does not: nothing says where the cut begins", file=source,
                    hint=HINT)


def _not_believed(log: ForceLog, path: RobotPath, program: ProgramTime, alignment: TimeAlignment) -> Finding:
    reasons = list(alignment.against)
    if len(alignment.odd) > MOST_ODD:
        targets = ", ".join("{} to {}".format(*_targets(program, stretch)) for stretch in alignment.odd[:5])
        reasons[-1] += f" (targets {targets}{' ...' if len(alignment.odd) > 5 else ''})"
    span, whole = float(log.place[-1] - log.place[0]), float(program.time[-1])
    unit = unit_of_time(whole / span)
    if unit:
        reasons = [f"it goes over {span:.4g} s, the program takes {whole:.4g}"]
        hint = f"is time_s in {unit}? It is in seconds"
    else:
        hint = (f"is it the log of {path.toolpath.source}, from before its start to after its end? Passes that are alike "
                f"cannot be told apart: {HINT}")
    return Finding("CS3061", "error", f"the log cannot be placed by time alone: {'; '.join(reasons)}", file=log.source,
                   hint=hint)


def _placed(log: ForceLog, alignment: TimeAlignment) -> Finding:
    typical, largest = 1e3 * np.nanquantile(alignment.spread, [0.5, 0.95])
    others = (f"score {alignment.score:.0f} against the best other place {alignment.rival:.1f} s away"
              if np.isfinite(alignment.rival) else "and no other place is possible")
    return Finding(
        "CS3064", "warning", f"placed by time alone: the program starts at {alignment.start:.2f} s of the log's clock, "
        f"override {100 * alignment.override:.1f} %, stretches slip by up to {alignment.slip:.2f} s; "
        f"{100 * alignment.share:.0f} % of the force follows the program, {others}; 1 sigma of a sample's place is up to "
        f"{largest:.1f} mm, of half of them {typical:.1f} mm, and of its time {np.median(alignment.std):.3f} s",
        file=log.source)


def _odd_stretch(path: RobotPath, program: ProgramTime, alignment: TimeAlignment) -> list[Finding]:
    """The one stretch that may be odd."""
    if not alignment.odd:
        return []
    low, high = _targets(program, alignment.odd[0])
    return [Finding("CS3065", "warning", f"between targets {low} and {high} the force does not follow the program: its samples "
                    "are left out. Is there no stock, or did the program stand still?", file=path.toolpath.source,
                    line=int(path.toolpath.line[low]), target=low)]


def _targets(program: ProgramTime, stretch: tuple[float, float]) -> tuple[int, int]:
    """Between which targets a stretch of planned time [s] is."""
    low, high = np.minimum(np.searchsorted(program.time, stretch), len(program.time) - 1)
    return int(low), int(high)

"""Moves that a program drives more than once, or in another order than they stand in it: a log is of one pass, in the order of
the text."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from compensator.rapid.program import RapidProgram
from compensator.rapid.runs import Driven
from compensator.rapid.text import locate
from identification.common.findings import Finding, counted, verb

Flags = NDArray[np.bool_]
# So many calls are named in a finding.
NAMED = 4


def said_of_order(program: RapidProgram, forced: Flags, key: str, *, followed: bool) -> list[Finding]:
    """Warnings: targets with force, forced (N,), are driven more than once (CS4117), or not in the order of the text (CS4118).
    A log by path length counts along moves in the air, too; target numbers are those of the text. followed: the log is placed
    along the moves as they are driven."""
    if not forced.any():
        return []
    runs = program.runs
    times = runs.times
    findings = []
    again = forced & (times > 1)
    number = int(again.sum())
    if number:
        lines = locate(program.source, runs.calls_of(again))[0].tolist()
        calls = f" (called in line {', '.join(map(str, lines[:NAMED]))}{' ...' if len(lines) > NAMED else ''})" if lines else ""
        findings.append(_at(program, int(np.argmax(again)), "CS4117",
                            f"{counted(number, 'target')} with force {verb(number, 'are')} driven more than once a run{calls}: "
                            "each time with the one correction of this log",
                            "right where each pass cuts alike, as on the next part; a second pass over the same stock is "
                            "pushed less, and comes out too deep: give it moves and a log of its own"))
    if key == "target" or followed:
        return findings
    if key in ("path_mm", "time") and runs.unsettled >= 0:
        return [*findings, _not_followed(program)]
    whole = key == "path_mm"
    back = runs.first_back(np.ones_like(forced) if whole else forced & (times == 1))
    if back is not None:
        findings.append(_out_of_order(program, back, whole))
    return findings


def _not_followed(program: RapidProgram) -> Finding:
    start = program.runs.unsettled
    line = int(locate(program.source, [start])[0][0])
    shown = " ".join(program.source.text(start, start + 60).split("\n")[0].split())
    return Finding("CS4118", "warning", f"'{shown}' cannot be followed: the log is placed as if all moves were driven once, in "
                   "the order of the text", file=program.toolpath.source, line=line, hint="log the column target, numbered by "
                   "the text, or x_mm y_mm z_mm; or write it as IF, FOR or a call by its name")


def _out_of_order(program: RapidProgram, back: Driven, whole: bool) -> Finding:
    line = f", called in line {locate(program.source, [back.start])[0][0]}" if back.start >= 0 else ""
    return _at(program, back.first, "CS4118",
               f"the moves from here on{line} are driven behind moves that stand after them in the text: "
               + ("path lengths count in the order of the text" if whole else "the log is followed in the order of the text"),
               "log the column target, numbered by the text, or let the routines stand in the order in which they run")


def _at(program: RapidProgram, target: int, code: str, message: str, hint: str) -> Finding:
    return Finding(code, "warning", message, file=program.toolpath.source, line=int(program.toolpath.line[target]),
                   target=target, hint=hint)

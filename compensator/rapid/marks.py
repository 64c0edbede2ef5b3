"""Marks: moves that switch a digital output at their target (MoveLDO), so that a force log shows when the robot was where."""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from compensator.rapid.insertion import marked, move_text
from compensator.rapid.program import RapidProgram
from compensator.rapid.reader import read_rapid
from compensator.toolpath import Move
from identification.common.findings import Finding, counted, error

Indices = NDArray[np.intp]
_NAME = re.compile(r"[A-Za-z]\w{0,31}", re.ASCII)
_LEVELS = {"low": 0, "high": 1}
# Marks stand this far apart [m], and so long at the programmed feed [s]: a logger of 100 Hz tells them apart, and the some
# milliseconds by which an output's edge scatters are little of it; engineering judgement.
APART, LASTING = 0.01, 0.1


@dataclass(frozen=True, eq=False)
class Marks:
    """The targets (k,) at which the output `signal` changes, in the order in which they are driven, its value (k,) from there
    on, and where (k,) among all targets that are driven they come."""

    signal: str
    target: Indices
    value: Indices
    at: Indices

    def __len__(self) -> int:
        return len(self.target)


def marks_of(program: RapidProgram, signal: str | None = None, order: Indices | None = None) -> Marks | None:
    """The marks of an output; without its name those of the one output that moves set. None where there are none. order (D,):
    the targets as they are driven, if it is not that of the toolpath.

    Raises CompstiffError (CS2053) where moves set several outputs and none is named.
    """
    source = program.source
    names = sorted(set(_outputs(program)) - {""})
    if signal is None and len(names) > 1:
        raise error("CS2053", f"moves set {len(names)} outputs ({', '.join(names)}): which of them marks the targets for the "
                    "force log is not known", file=source.name, hint="name it with --mark")
    wanted = signal.lower() if signal else names[0] if names else ""
    if not wanted or wanted not in names:
        return None
    level = _levels(program, wanted)
    order = _driven(program) if order is None else order
    at = np.flatnonzero(level[order] >= 0)
    value = level[order[at]]
    changes = np.concatenate([value[:1] == 1, np.diff(value) != 0])     # it is low when the program begins
    return Marks(wanted, order[at][changes], value[changes], at[changes])


def _driven(program: RapidProgram) -> Indices:
    driven = program.toolpath.driven
    return np.arange(len(program.toolpath)) if driven is None else driven


def _outputs(program: RapidProgram) -> list[str]:
    """The output that each tail of a move sets, "" for none."""
    source = program.source
    return [source.fold(source.data[tail.signal.start:tail.signal.end].strip()) if tail.signal else ""
            for tail in program.scan.tails]


def _levels(program: RapidProgram, wanted: str) -> Indices:
    """To which value each target (N,) sets an output, -1 where it does not."""
    source, tails, spelled = program.source, program.scan.tails, _outputs(program)
    level = np.full(len(tails), -1)
    for k, tail in enumerate(tails):
        if spelled[k] == wanted and tail.value is not None:
            word = source.fold(source.data[tail.value.start:tail.value.end].strip())
            level[k] = _LEVELS.get(word, int(word) if word in ("0", "1") else -1)
    # The output is set at the end of an arc, not at its circle point.
    return np.where(program.toolpath.move == Move.ARC_VIA, -1, level[np.array(program.scan.tail, dtype=np.intp)])


def with_marks(program: RapidProgram, signal: str) -> tuple[bytes, tuple[Finding, ...]]:
    """The program whose moves switch an output, high and low in turn, at its first target, its last, and between them where
    edges can be told apart; as it is where it does so already.

    Raises CompstiffError (CS2053): no name of a signal, no two targets that can be marked, or the text does not read back.
    """
    if not _NAME.fullmatch(signal):
        raise error("CS2053", f"'{signal}' is no name of a signal", hint="a letter, then letters, digits and _, at most 32")
    there = marks_of(program, signal)
    if there is not None:
        return program.source.data, (_told(program, there, "sets already"),)
    chosen = _chosen(program)
    if len(chosen) < 2:
        raise error("CS2053", f"{counted(len(chosen), 'target')} can be marked, two at least are "
                              f"needed", file=program.source.name,
                    hint="MoveL and MoveC without \\V, \\Z, \\Inpos, \\T, \\ID, \\Conc and \\Corr can")
    values = _alternating(program, chosen)
    content = marked(program, chosen, signal, values.tolist())
    again = read_rapid(content, program.source.name)
    found, old, new = marks_of(again, signal), program.toolpath, again.toolpath
    same = all(np.array_equal(getattr(old, name), getattr(new, name), equal_nan=name != "move")
               for name in ("move", "position", "quaternion", "confdata", "external", "joints", "feed", "zone"))
    levels = _levels(again, signal.lower())
    if found is None or not same or not (np.array_equal(np.flatnonzero(levels >= 0), chosen)
                                         and np.array_equal(levels[chosen], values)):
        raise error("CS2053", "the marked program does not read back as the one without marks", file=program.source.name,
                    hint="a defect in compstiff: please report it with this program")
    return content, (_told(again, found, "now sets"),)


def _alternating(program: RapidProgram, chosen: list[int]) -> Indices:
    """High and low in turn (k,), as the targets `chosen` are driven for the first time."""
    first = np.full(len(program.toolpath), len(program.toolpath))
    driven, at = np.unique(_driven(program), return_index=True)
    first[driven] = at
    values = np.empty(len(chosen), dtype=np.intp)
    values[np.argsort(first[chosen], kind="stable")] = (np.arange(len(chosen)) + 1) % 2
    return values


def _told(program: RapidProgram, marks: Marks, how: str) -> Finding:
    return Finding("CS2054", "note", f"the program {how} {marks.signal} at {len(marks)} of {len(program.toolpath)} targets, "
                   f"from {marks.target[0]} to {marks.target[-1]}", file=program.source.name,
                   hint="define the output, wire it to the logger and log it as the column mark (docs/marking.md)")


def _chosen(program: RapidProgram) -> list[int]:
    """The targets to mark."""
    toolpath = program.toolpath
    possible = []
    posed = ~np.isnan(toolpath.position[:, 0])
    for i in np.flatnonzero(np.isin(toolpath.move, (Move.LINEAR, Move.ARC_END)) & posed).tolist():
        text = move_text(program, i - int(toolpath.move[i] == Move.ARC_END))
        if text is not None and text.bare and text.tail_end == text.end - 1:
            possible.append(i)
    if not possible:
        return []
    steps = np.linalg.norm(np.diff(toolpath.position, axis=0, prepend=toolpath.position[:1]), axis=1)
    along = np.cumsum(np.nan_to_num(steps))
    apart = np.maximum(APART, LASTING * np.nan_to_num(toolpath.feed))
    chosen = possible[:1]
    for i in possible[1:]:
        if along[i] - along[chosen[-1]] >= apart[i] - 1e-9:
            chosen.append(i)
    # The last target ends the log: it takes the place of a mark too near to it.
    if chosen[-1] != possible[-1]:
        chosen = [*(chosen[:-1] if len(chosen) > 1 else chosen), possible[-1]]
    return chosen

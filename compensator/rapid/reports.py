"""Findings of reading, one for each kind and reason with its count, and why targets cannot be corrected."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from compensator.rapid.blocks import arguments
from compensator.rapid.handed import Elsewhere, handed_out
from compensator.rapid.moves import OVERRIDE
from compensator.rapid.quaternions import SLIGHT, UNUSABLE
from compensator.rapid.rows import Rows
from compensator.rapid.scan import Scan
from compensator.rapid.tails import Tails
from compensator.rapid.text import Offsets, Source, locate
from compensator.rapid.values import Values
from compensator.toolpath import Array, Move, ToolFrame, WorkObject
from identification.common.findings import Finding, Level, counted, verb

Mask = NDArray[np.bool_]

# What `post` writes before each module that it joins.
JOINED = b"! compstiff module: "
_CELL = "it is taken from cell.yaml; check that it is the one there"


@dataclass(frozen=True, slots=True)
class Places:
    """Lines and columns (N,) of the targets."""

    source: Source
    line: Offsets
    column: Offsets

    def targets(self, code: str, level: Level, message: str, which: Iterable[int], hint: str = "") -> Finding:
        """One finding for all targets in `which` (not empty, ascending), at the first one's place."""
        numbers = list(which)
        first = int(numbers[0])
        return Finding(code, level, message, self.source.name, int(self.line[first]), int(self.column[first]), first, hint,
                       len(numbers))

    def offset(self, code: str, level: Level, message: str, offsets: list[int], hint: str = "") -> Finding:
        """One finding for places in the text that are no targets."""
        line, column = locate(self.source, offsets[:1])
        return Finding(code, level, message, self.source.name, int(line[0]), int(column[0]), None, hint, len(offsets))


def report(
    scan: Scan, values: Values, rows: Rows, tails: Tails, places: Places, off: Array, displaced: Mask, soft: Mask,
    axes_offset: Mask, elsewhere: Mapping[int, Elsewhere], held: Mapping[str, frozenset[str]]
) -> tuple[NDArray[np.object_], tuple[Finding, ...]]:
    """Reasons (N,) and findings. off (N,): how far the quaternion's sum of squares is off 1; displaced (N,): a program
    displacement is on; soft (N,): a soft servo is; axes_offset (N,): the target drives an external axis while an offset of
    these is on; elsewhere: calls of routines that this file does not hold; held: which names of targets (in lower case) that it
    does not declare each file beside it does."""
    block = np.full(len(off), "", dtype=object)
    findings = [*_unsettled(rows, places, block, held), *_looped(scan, rows, places, block), *_called(scan, places, block)]
    findings += _quaternions(tails, places, off, block)
    findings += _shifted(scan, tails, places, displaced, soft, axes_offset, block)
    findings += _frames(tails.tools, tails.tool, "tool", "CS2020", "CS2022", places)
    findings += _frames(tails.workobjects, tails.workobject, "work object", "CS2021", "CS2023", places)
    findings += _handed(scan, tails, places)
    findings += _forgotten_object(scan, tails, places)
    findings += _unknown(scan, tails, places)
    findings += _overridden(scan, values, tails, places)
    findings += _others(scan, places, elsewhere)
    return block, tuple(findings)


def _unsettled(
    rows: Rows, places: Places, block: NDArray[np.object_], held: Mapping[str, frozenset[str]]
) -> list[Finding]:
    if not rows.problem.any():
        return []
    problem = rows.problem[rows.row]
    findings, undeclared = [], dict[str, Offsets]()
    for number, which in _places_of(problem).items():
        if not number:
            continue
        reason = rows.problems[number]
        block[which] = reason.why
        if reason.code == "CS2011":
            undeclared[reason.name] = which
            continue
        hint = "write it as a robtarget with numbers, or declared with numbers in this file, if it is to be corrected"
        if reason.code == "CS2056":
            hint = ("write a move for each position, to a robtarget or to an element of the array (p{1}, p{2} ...), if it is "
                    "to be corrected")
        findings.append(places.targets(
            reason.code, "warning", f"the target is left as it is: {reason.why}", which, hint))
    if undeclared:
        findings.append(_undeclared(places, undeclared, held))
    return sorted(findings, key=lambda finding: finding.target or 0)


def _undeclared(places: Places, names: Mapping[str, Offsets], held: Mapping[str, frozenset[str]]) -> Finding:
    """One finding for all names that this file does not declare; names: the targets of each; held: as of `report`."""
    which = np.sort(np.concatenate(list(names.values())))
    first = next(name for name, targets in names.items() if targets[0] == which[0])
    wanted = {name.lower() for name in names}
    named = first if len(wanted) == 1 else f"{first} and {counted(len(wanted) - 1, 'more name')}"
    whole = [file for file, found in held.items() if found == wanted]
    files = whole or list(held)
    own = re.split(r"[\\/]", places.source.name)[-1]
    where, give = "", "declare them with numbers in this file, or give the module that does beside it: "
    if files:
        shown = ", ".join(files[:3]) + (f" and {len(files) - 3} more" if len(files) > 3 else "")
        known = len(frozenset().union(*held.values()))
        some = not whole and known < len(wanted)
        where = (f"; {known} of them {verb(known, 'are')} in {shown} beside it" if some
                 else f", but in {'each of ' if len(whole) > 1 else ''}{shown} beside it")
        give = "give it with the one that belongs to it: " if len(whole) > 1 else "give both: " if len(files) == 1 else \
            "give all of them: "
    others = " ".join(files[:1] if whole else files[:3]) if files and len(whole) < 2 else "OTHER.mod"
    finding = places.targets(
        "CS2011", "warning", f"{named} {verb(len(wanted), 'are')} not declared in this file{where}: "
        f"{counted(len(which), 'target', 'are')} not known and {'stays as it is' if len(which) == 1 else 'stay as they are'}",
        which.tolist(), f"{give}compstiff correct CELL {own} {others} --forces LOG -o FOLDER/ takes them as one job; for a "
        "folder of programs, or watch, compstiff post joins them as one file")
    return replace(finding, count=1)


def _looped(scan: Scan, rows: Rows, places: Places, block: NDArray[np.object_]) -> list[Finding]:
    """Targets that one move in a loop drives, whose element of the array must not change for something else."""
    if not scan.looped:
        return []
    looped = np.array(sorted(scan.looped))
    read = {scan.names.find(name, scope) for name, scope in scan.uses.read}
    shared = np.bincount(rows.row)[rows.row[looped]] > 1
    shared |= np.isin(rows.declaration[rows.row[looped]], sorted(read))
    findings = [places.targets(
        "CS2059", "note", f"{len(looped)} targets of moves that a loop drives: each turn has targets of its own", looped,
        "what is corrected is written into the array whose elements they are")]
    nowhere = looped[(rows.declaration[rows.row[looped]] < 0) & (block[looped] == "")]
    if len(nowhere):
        why = "one move in a loop drives to this place and to others, and no array holds them"
        block[nowhere] = why
        findings.append(places.targets("CS2059", "warning", f"the target is left as it is: {why}", nowhere,
                                       "write the moves one by one, or the targets into an array, if they are to be corrected"))
    which = looped[shared & (block[looped] == "")]
    if len(which):
        why = "a loop drives to this element of an array, and something else uses it too"
        block[which] = why
        findings.append(places.targets("CS2059", "warning", f"the target is left as it is: {why}", which,
                                       "give the loop an array of its own"))
    return findings


def _called(scan: Scan, places: Places, block: NDArray[np.object_]) -> list[Finding]:
    """Targets that calls hand over to the moves of a routine."""
    if not scan.handed:
        return []
    findings = [places.targets(
        "CS2060", "note", f"{counted(len(scan.handed), 'target')} of routines to which calls hand their target: each call "
        "counts as moves of its own, where it stands", sorted(scan.handed),
        "what is corrected is written into the call, or into the array whose elements a loop hands over")]
    for why in sorted({why for why in scan.handed.values() if why}):
        which = [target for target in sorted(scan.handed) if scan.handed[target] == why and not block[target]]
        block[which] = why
        if which:
            findings.append(places.targets("CS2060", "warning", f"the target is left as it is: {why}", which,
                                           "write moves for each call if they cut and are to be corrected"))
    return findings


def _places_of(numbers: Offsets) -> dict[int, Offsets]:
    """Where each of these numbers (n,) stands, ascending."""
    order = np.argsort(numbers, kind="stable")
    alike = np.split(order, np.flatnonzero(np.diff(numbers[order])) + 1) if len(order) else []
    return {int(numbers[which[0]]): which for which in alike}


def _quaternions(tails: Tails, places: Places, off: Array, block: NDArray[np.object_]) -> list[Finding]:
    findings = []
    unusable = np.flatnonzero((off > UNUSABLE) & (block == ""))
    for number in unusable.tolist():
        block[number] = f"the quaternion is not a unit quaternion (its sum of squares is off 1 by {off[number]:.3g})"
    if len(unusable):
        findings.append(places.targets(
            "CS2012", "warning", "the quaternion's sum of squares is off 1 by up to "
            f"{off[unusable].max():.3g}; above {UNUSABLE} the controller refuses it", unusable,
            "post the program again with unit quaternions w x y z"))
    slight = np.flatnonzero((off > SLIGHT) & (off <= UNUSABLE))
    if len(slight):
        findings.append(places.targets(
            "CS2013", "note", f"the quaternion's sum of squares is off 1 by up to {off[slight].max():.3g}; it was normalised",
            slight, "let the post-processor write at least 6 decimals"))
    if tails.slight:
        findings.append(places.offset(
            "CS2013", "note", "the quaternion of a tool or work object is slightly off the unit; it was normalised",
            list(tails.slight), "write it with more decimals"))
    return findings


def _shifted(
    scan: Scan, tails: Tails, places: Places, displaced: Mask, soft: Mask, axes_offset: Mask, block: NDArray[np.object_]
) -> list[Finding]:
    findings = []
    corrected = np.array([tail.corrected for tail in scan.tails] or [False])[tails.tail]
    for mask, code, why, hint in (
        (corrected, "CS2014", "the move has \\Corr: the controller adds path corrections at run time",
         "take \\Corr out if the program is to be corrected offline"),
        (displaced, "CS2015", "a program displacement (PDispOn, PDispSet) shifts the move at run time",
         "put the displacement into the work object, or switch it off with PDispOff before the cut"),
        (soft, "CS2019", "a soft servo or force control (SoftAct, CSSAct, FCAct) lets the robot give way by itself",
         "cut with a stiff robot: SoftDeact before the cut"),
        (axes_offset, "CS4501", "an offset of the external axes (EOffsOn, EOffsSet) shifts their values at run time",
         "put the offset into the values of the targets, or switch it off with EOffsOff before the cut"),
    ):
        which = np.flatnonzero(mask)
        if len(which):
            block[which[block[which] == ""]] = why
            findings.append(places.targets(code, "warning", f"the target is left as it is: {why}", which, hint))
    return findings


def _frames(
    frames: Sequence[ToolFrame | WorkObject], used: Offsets, what: str, unknown: str, unusable: str,
    places: Places,
) -> list[Finding]:
    findings = []
    places_of = _places_of(np.asarray(used))
    for number, frame in enumerate(frames):
        if not frame.problem and frame.position is not None:
            continue
        which = places_of.get(number, np.empty(0, dtype=np.intp))
        if frame.problem:
            findings.append(places.targets(unusable, "warning", f"targets with {what} {frame.name} cannot be corrected: "
                                           f"{frame.problem}", which, "declare it with numbers that stay as they are"))
        else:
            findings.append(places.targets(unknown, "note", f"{what} {frame.name} is not declared with numbers in this file",
                                           which, _CELL))
    return findings


def _as_written(source: Source, name: str) -> str:
    """A name in small letters as the text has it first."""
    found = re.search(rb"(?i)\b" + re.escape(name.encode(source.encoding)) + rb"\b", source.data)
    return source.text(found.start(), found.end()) if found else name


def _handed(scan: Scan, tails: Tails, places: Places) -> list[Finding]:
    """Tools and work objects that calls hand over, as they are taken."""
    declarations = scan.names.declarations
    findings = []
    if tails.handed:
        names = ", ".join(dict.fromkeys(declarations[number].name for number in tails.handed))
        findings.append(places.offset(
            "CS2057", "note", f"tool or work object {names}, a parameter: taken as what every call in this file hands over",
            [declarations[number].start for number in tails.handed],
            "right unless another file calls the routine with another one"))
    out = {number: routine for number, routine in handed_out(scan.names, scan.uses, scan.routines).items()
           if declarations[number].start in tails.declared}
    for number, routine in out.items():
        item = declarations[number]
        what = "tool" if item.type == "tooldata" else "work object"
        name = places.source.text(item.start, item.end).split(":=")[0].split()[-1]
        where = ("a routine whose name is made at run time" if routine == "%"
                 else f"{_as_written(places.source, routine)}, which is not in this file")
        findings.append(places.offset(
            "CS2058", "note", f"{what} {name} is handed to {where}: taken as it is declared here", [item.start],
            "where that changes it, such as by measuring the part, declare it with the values it has then"))
    return findings


def _forgotten_object(scan: Scan, tails: Tails, places: Places) -> list[Finding]:
    """Moves that name no work object, in a program that declares one no move uses."""
    without = np.array([tail.workobject is None for tail in scan.tails] or [False])[tails.tail]
    poses = np.flatnonzero(without & (np.frombuffer(bytes(scan.move), dtype=np.uint8) != Move.ABSOLUTE))
    used = {frame.name.lower() for frame in tails.workobjects}
    idle = [item for item in scan.names.declarations if item.type == "wobjdata" and item.storage != "parameter"
            and item.name not in used]
    if not len(poses) or not idle:
        return []
    text = ("moves without \\WObj stand in wobj0, the world; no move uses "
            f"{_as_written(places.source, idle[0].name)}, which the program declares")
    return [places.targets("CS2052", "warning", text, poses.tolist(), "add \\WObj to the moves if it is meant")]


def _unknown(scan: Scan, tails: Tails, places: Places) -> list[Finding]:
    """Speeds and zones the text does not give."""
    findings = []
    timed = np.array([tail.timed for tail in scan.tails] or [False])[tails.tail]
    for column, what, show in ((tails.feed, "speed", True), (tails.zone, "zone", False)):
        unknown = np.flatnonzero(np.isnan(column) & ~(timed & show))
        spelled: dict[str, list[Offsets]] = {}
        for tail, which in _places_of(tails.tail[unknown]).items():
            written = scan.tails[tail]
            expr = (written.velocity or written.speed) if show else (written.radius or written.zone)
            spelled.setdefault(places.source.text(expr.start, min(expr.end, expr.start + 40)), []).append(which)
        findings += [
            places.targets("CS2024", "note", f"the {what} {text} is not known from this file",
                           unknown[np.sort(np.concatenate(alike))].tolist(), "declare it with numbers in this file")
            for text, alike in spelled.items()
        ]
    return findings


def _overridden(scan: Scan, values: Values, tails: Tails, places: Places) -> list[Finding]:
    """VelSet and SpeedRefresh, where they make the robot drive at other speeds than the moves state."""
    fastest = 1e3 * float(np.nanmax(tails.feed, initial=0.0))
    found = []
    for step, scope in scan.overridden:
        if step.name in scan.routines:
            continue
        name = OVERRIDE[step.name]
        parts = [values.parse(part[0].start, part[-1].end) for part in arguments(places.source, step) if part]
        match [name, *(values.number(part, scope, name) for part in parts)]:
            case ["VelSet", float(share), float(most)] if share == 100 and most >= fastest:
                continue
            case ["SpeedRefresh", float(share)] if share == 100:
                continue
        found.append((step.start, f"{name} {','.join(values.spelled(part) for part in parts)}"))
    return [places.offset(
        "CS2061", "warning", f"{found[0][1]} changes the speed of moves, which is taken as they state it",
        [offset for offset, _ in found], "write the speeds that are driven into the moves: a log by time is placed by them, "
        "and the feed a tooth follows from them")] if found else []


def _others(scan: Scan, places: Places, elsewhere: Mapping[int, Elsewhere]) -> list[Finding]:
    offsets: dict[str, list[int]] = {}
    for name, offset in scan.others:
        if name not in scan.routines:               # a routine of the program may have such a name: its moves are read
            offsets.setdefault(name, []).append(offset)
    findings = [
        places.offset("CS2016", "warning", f"{places.source.text(at[0], at[0] + len(name))} moves along targets too, but they "
                      "are neither counted nor corrected", at, "cut with MoveL, MoveC or MoveJ if they are to be corrected")
        for name, at in offsets.items()
    ]
    given: dict[str, list[int]] = {}
    for offset, call in elsewhere.items():
        if call.target and not call.file:
            given.setdefault(call.name, []).append(offset)
    findings += [
        places.offset("CS2016", "warning", f"{name} is a routine of another file, and is given a target: where it drives "
                      "is not known, and nothing of it is counted or corrected", at, "put the routine into this file if it is "
                      "to be corrected; a log by path length cannot be followed behind it, one by target or positions can")
        for name, at in given.items()]
    beside = {offset: call for offset, call in elsewhere.items() if call.file}
    if beside:
        findings.append(_beside(places, beside))
    if len(scan.modules) > 1:
        findings.append(places.offset(
            "CS2051", "note" if JOINED in scan.source.data else "warning", f"the file holds {len(scan.modules)} modules: "
            "their targets are counted one module after the other, and their tools and work objects are all used",
            scan.modules[1:2], "a controller loads one module a file: " + (
                "a call of correct with all of them, or with --modules, writes each in a file of its own"
                if JOINED in scan.source.data else "correct with --modules writes each in a file of its own")))
    if scan.stray >= 0:
        findings.append(places.offset("CS2030", "warning", "the text from here to the end of the file is no RAPID statement "
                                      "and was skipped", [scan.stray], "check that the file is complete"))
    return findings


def _beside(places: Places, calls: Mapping[int, Elsewhere]) -> Finding:
    """What is said of calls of routines in which files beside this one drive."""
    names, files = (list(dict.fromkeys(parts)) for parts in zip(*((call.name, call.file) for call in calls.values()),
                                                               strict=True))
    shown = ", ".join(names[:3]) + (f" and {len(names) - 3} more" if len(names) > 3 else "")
    held = ", ".join(files[:3]) + (f" and {len(files) - 3} more" if len(files) > 3 else "")
    own = re.split(r"[\\/]", places.source.name)[-1]
    listed = " ".join([own, *files[:3], *(["..."] if len(files) > 3 else [])])
    return places.offset(
        "CS2016", "warning", f"{shown} in {held}, beside this file, {'drive' if len(names) > 1 else 'drives'}: "
        "nothing of that is counted or corrected here", sorted(calls),
        f"for a log of the whole job join its modules: compstiff post CELL {listed} -o job.mod; then correct job.mod with "
        "--modules, which writes them one by one again. A log of this file alone: as it is")

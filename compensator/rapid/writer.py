"""Writes corrected targets into the text of a program and leaves every other byte as it is."""

from __future__ import annotations

import itertools
from bisect import bisect_right
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property, partial

import numpy as np
from numpy.typing import ArrayLike, NDArray

from compensator.rapid.figures import CHUNK, renumbered_poses
from compensator.rapid.literals import Pose, Written, fresh, rewritten
from compensator.rapid.naming import NewNames, declared_name, place_for
from compensator.rapid.program import RapidProgram
from compensator.rapid.reports import Places
from compensator.toolpath import Move
from identification.common.files import with_room
from identification.common.findings import Finding

ROOM = 100              # so great a part of a text more may be what figures with more digits take
# source.data[start:end] becomes the bytes, or what the function gives when it is their turn: all of it need not be held twice.
Edit = tuple[int, int, bytes | Callable[[], bytes]]


@dataclass(frozen=True, slots=True)
class Rewritten:
    """content: the bytes of the corrected program. numbers: how many numbers differ; declarations: how many were added."""

    content: bytes
    findings: tuple[Finding, ...]
    numbers: int
    declarations: int


@dataclass(frozen=True, slots=True, eq=False)
class _Commanded:
    """The numbers (M, 7) [mm, quaternion] and the confdata (M, 4) to write, None to leave them; turned (M,): whose confdata
    differ from what is written. number (N,): which of the M each target of the program is, -1 where it is none of them."""

    numbers: NDArray[np.float64]
    confdata: NDArray[np.int32] | None
    turned: NDArray[np.bool_]
    number: NDArray[np.int32]

    def __contains__(self, target: int) -> bool:
        return bool(self.number[target] >= 0)

    def __getitem__(self, target: int) -> Pose:
        index = int(self.number[target])
        confdata = self.confdata[index].tolist() if self.confdata is not None and self.turned[index] else None
        return Pose(self.numbers[index].tolist(), confdata)


@dataclass(slots=True)
class _Job:
    """What is collected while the targets are gone through. The lists of targets are those of the findings."""

    program: RapidProgram
    poses: _Commanded
    shared: bool                                            # other modules must see what is declared
    edits: list[Edit] = field(default_factory=list)
    numbers: int = 0
    declarations: int = 0
    replaced: list[int] = field(default_factory=list)       # an expression became a robtarget in numbers
    added: list[int] = field(default_factory=list)          # a declaration was added
    symbols: list[int] = field(default_factory=list)        # a symbol in a robtarget became numbers
    visible: list[int] = field(default_factory=list)        # a declaration that other modules see too was changed in place


def rewrite(
    program: RapidProgram, targets: ArrayLike, position: ArrayLike, quaternion: ArrayLike, confdata: ArrayLike | None = None, *,
    shared: bool = False
) -> Rewritten:
    """The program with other numbers for the given targets.

    targets (M,): numbers of targets, each once. position (M, 3) [m], quaternion (M, 4) w x y z, unit: commanded, in the
    work object. confdata (M, 4): cf1 cf4 cf6 cfx, None to leave them.
    Positions are written with 4 decimals of a millimetre, quaternions with 8, or with as many as the number had before if
    that is more; a number that is the same to those decimals stays as it is spelled. The quaternion's sign is the one
    nearest to the original. shared: the text is to be split into modules, all of which must see what is declared, so nothing
    of that is LOCAL. Raises ValueError for a target that cannot be corrected (`toolpath.block`, MoveAbsJ).
    """
    which = np.asarray(targets, dtype=np.int64).reshape(-1)
    poses = _commanded(program, which, position, quaternion, confdata)
    if not len(which):
        return Rewritten(program.source.data, (), 0, 0)
    job = _Job(program, poses, shared)
    rows = program.rows
    row = rows.row[which]
    in_move = rows.declaration[row] < 0
    plain = in_move & _plain(program, which) & ~poses.turned
    _write_moves(job, which[in_move & ~plain].tolist())
    users = np.argsort(rows.row, kind="stable")
    sorted_rows = rows.row[users]
    elsewhere = {program.scan.names.find(name, scope) for name, scope in program.scan.uses.read}
    names = NewNames(program.source)
    for number in np.unique(row[~in_move]).tolist():
        first, last = np.searchsorted(sorted_rows, [number, number + 1])
        _write_declared(job, number, users[first:last].tolist(), elsewhere, names)
    _write_figures(job, np.sort(which[plain]))
    content = apply(program.source.data, job.edits)         # only then all numbers are counted
    return Rewritten(content, _findings(job, which[poses.turned]), job.numbers, job.declarations)


def _commanded(
    program: RapidProgram, targets: np.ndarray, position: ArrayLike, quaternion: ArrayLike, confdata: ArrayLike | None
) -> _Commanded:
    toolpath, count = program.toolpath, len(targets)
    place = np.asarray(position, dtype=np.float64).reshape(-1, 3)
    turn = np.asarray(quaternion, dtype=np.float64).reshape(-1, 4)
    once = bool((np.diff(targets) > 0).all()) or len(np.unique(targets)) == count
    if len(place) != count or len(turn) != count or not once:
        raise ValueError(f"{count} targets, each once, need as many positions and quaternions; "
                         f"received {len(place)} and {len(turn)}")
    if not (np.isfinite(place).all() and np.isfinite(turn).all()):
        raise ValueError("positions and quaternions to write must be finite")
    for target in targets[(toolpath.block[targets] != "") | (toolpath.move[targets] == Move.ABSOLUTE)].tolist():
        raise ValueError(f"target {target} cannot be rewritten: {toolpath.block[target] or 'joint angles'}")
    quadrants = None if confdata is None else np.asarray(confdata, dtype=np.int32).reshape(-1, 4)
    written, numbers, turned = program.rows.numbers, np.empty((count, 7)), np.zeros(count, dtype=bool)
    for at in range(0, count, CHUNK):
        part = slice(at, at + CHUNK)
        row = program.rows.row[targets[part]]
        other = np.einsum("ni,ni->n", written.pose[row, 3:], turn[part])[:, None] < 0
        numbers[part, :3], numbers[part, 3:] = place[part] * 1e3, np.where(other, -turn[part], turn[part])
        if quadrants is not None:
            turned[part] = (quadrants[part] != written.settings[:, :4][written.setting[row]]).any(axis=1)
    number = np.full(len(toolpath), -1, dtype=np.int32)
    number[targets] = np.arange(count)
    return _Commanded(numbers, quadrants, turned, number)


def _plain(program: RapidProgram, targets: np.ndarray) -> NDArray[np.bool_]:
    """Which targets (M,) are written in the move in figures alone: their rows come first (rows.py)."""
    inline = np.frombuffer(program.scan.rest, dtype=np.int64) >= 0
    return np.asarray(inline[targets] & (program.rows.row[targets] < np.count_nonzero(inline)))


def _write_figures(job: _Job, targets: np.ndarray) -> None:
    """Targets, ascending, whose value stands in the move in figures alone: those between which nothing else is written in one
    edit."""
    columns = [np.frombuffer(column, dtype=np.int64)[targets] for column in (job.program.scan.start, job.program.scan.rest)]
    breaks = np.unique(np.searchsorted(columns[0], [start for start, _, _ in job.edits]))
    for at in range(0, len(targets), CHUNK):
        block = _Figures(job, targets[at:at + CHUNK], *(column[at:at + CHUNK] for column in columns))
        inside = breaks[(breaks > at) & (breaks < at + len(block.targets))] - at
        for low, high in itertools.pairwise([0, *inside.tolist(), len(block.targets)]):
            job.edits.append((int(block.start[low]), int(block.rest[high - 1]), partial(block.text, low, high)))


@dataclass(frozen=True, eq=False)
class _Figures:
    """Some targets (K,) whose value stands in the move in figures alone, and where (K,): worked out when they are written."""

    job: _Job
    targets: NDArray[np.int64]
    start: NDArray[np.int64]
    rest: NDArray[np.int64]

    @cached_property
    def poses(self) -> list[bytes]:
        """Their texts (K); counts the numbers that differ."""
        program, commanded = self.job.program, self.job.poses
        poses = renumbered_poses(program.source.data, self.start, self.rest,
                                 program.rows.numbers.pose[program.rows.row[self.targets]],
                                 commanded.numbers[commanded.number[self.targets]])
        self.job.numbers += int(poses.changed.sum())
        return poses.texts

    def text(self, low: int, high: int) -> bytes:
        """From the first of these targets to the last, and what stands between them."""
        data, first, last = self.job.program.source.data, self.start.tolist(), self.rest.tolist()
        pieces = [b""] * (2 * (high - low) - 1)
        pieces[::2] = self.poses[low:high]
        pieces[1::2] = [data[a:b] for a, b in zip(last[low:high - 1], first[low + 1:high], strict=True)]
        return b"".join(pieces)


def _write_moves(job: _Job, targets: list[int]) -> None:
    """Targets whose value stands in the move itself."""
    rows, scan, values = job.program.rows, job.program.scan, job.program.values
    for target in targets:
        row = rows.row[target]
        start, end = scan.start[target], scan.end[target]
        if rows.literal[row]:
            written = rewritten(values, start, end, rows.numbers[row], job.poses[target])
            _note(job, written, target)
            if written.changed:
                job.edits.append((start, end, written.text))
        else:
            job.edits.append((start, end, fresh(rows.numbers[row], job.poses[target])))
            job.numbers += 7
            job.replaced.append(target)


def _write_declared(job: _Job, row: int, users: list[int], elsewhere: set[int], names: NewNames) -> None:
    """Targets whose value is that of a declaration, `users` being all targets that name it."""
    program, rows = job.program, job.program.rows
    number = int(rows.declaration[row])
    start, end = int(rows.start[row]), int(rows.end[row])
    old = program.source.data[start:end]
    texts: dict[int, Written] = {}
    for target in users:
        if target in job.poses and rows.literal[row]:
            texts[target] = rewritten(program.values, start, end, rows.numbers[row], job.poses[target])
        elif target in job.poses:
            texts[target] = Written(fresh(rows.numbers[row], job.poses[target]), 7)
    spelled = {written.text for written in texts.values()}
    if len(texts) == len(users) and len(spelled) == 1 and number not in elsewhere:
        first = next(iter(texts))
        if texts[first].text != old:
            job.edits.append((start, end, texts[first].text))
            _note(job, texts[first], first)
            declaration = program.scan.names.declarations[number]
            if declaration.scope.routine < 0 and declaration.reach != "local":
                job.visible.append(first)
            if not rows.literal[row]:
                job.replaced.append(first)
        return
    _add_declarations(job, row, {target: written for target, written in texts.items() if written.text != old}, names)


def _add_declarations(job: _Job, row: int, texts: dict[int, Written], names: NewNames) -> None:
    program, rows = job.program, job.program.rows
    scan, source = program.scan, program.source
    declaration = scan.names.declarations[int(rows.declaration[row])]
    offset, before = place_for(source, declaration)
    groups: dict[bytes, list[int]] = {}
    for target, written in texts.items():
        # A copy keeps the layout; with symbols in it it might not be constant, so then numbers alone are written.
        plain = rows.literal[row] and not _has_symbols(program, row)
        groups.setdefault(written.text if plain else fresh(rows.numbers[row], job.poses[target]), []).append(target)
    firsts = [first for first, _ in scan.scopes]
    for text, targets in groups.items():
        name = names.make(declared_name(source, declaration))
        modules = {scan.scopes[int(np.searchsorted(firsts, target, side="right")) - 1][1].module for target in targets}
        # A target that a call hands over stands with the call, which may be in another module than the routine.
        where = {bisect_right(scan.modules, scan.start[target]) for target in targets}
        apart = where != {bisect_right(scan.modules, declaration.start)}
        # A reference refers to data of the same kind.
        storage = declaration.storage.upper() if scan.referred.intersection(targets) else "CONST"
        alone = declaration.scope.routine < 0 and modules == {declaration.scope.module} and not (apart or job.shared)
        local = b"LOCAL " if alone else b""
        spelled = name.encode(source.encoding)
        job.edits.append((offset, offset, before + local + storage.encode() + b" robtarget " + spelled + b":=" + text + b";"))
        job.edits += [(scan.start[target], scan.end[target], spelled) for target in targets]
        job.declarations += 1
        job.numbers += texts[targets[0]].changed
        job.added += targets


def _has_symbols(program: RapidProgram, row: int) -> bool:
    expr = program.values.parse(int(program.rows.start[row]), int(program.rows.end[row]))
    return any(part.kind not in ("number", "aggregate") for part in expr.walk())


def _note(job: _Job, written: Written, target: int) -> None:
    job.numbers += written.changed
    if written.symbols:
        job.symbols.append(target)


def apply(data: bytes, edits: list[Edit]) -> bytes:
    """The text with all edits made; those at one place in the order they were entered. Takes the edits out of their list: what
    is written need not be held twice."""
    longer = sum(len(text) - (end - start) for start, end, text in edits if isinstance(text, bytes))
    stream = with_room(len(data) + longer + len(data) // ROOM)
    at = 0
    edits.sort(key=lambda edit: edit[:2])
    edits.reverse()
    while edits:
        start, end, text = edits.pop()
        stream.write(data[at:start])
        stream.write(text if isinstance(text, bytes) else text())
        at = end
    stream.write(data[at:])
    stream.truncate()
    return stream.getvalue()


def _findings(job: _Job, turned: np.ndarray) -> tuple[Finding, ...]:
    """turned: the targets whose confdata were written."""
    toolpath = job.program.toolpath
    places = Places(job.program.source, toolpath.line, toolpath.column)
    findings = []
    for which, code, message, hint in (
        (job.replaced, "CS2040", "Offs, RelTool or another expression was replaced by a robtarget in numbers",
         "the target no longer follows its base when that is taught again"),
        (job.added, "CS2041", "a target needs several corrections, or is used uncorrected too: declarations were added",
         "they are not LOCAL, so that the parts see them: no other module may have their names" if job.shared else ""),
        (job.symbols, "CS2043", "a symbol inside a robtarget was replaced by numbers", ""),
        (job.visible, "CS3270", "a declaration that is not LOCAL was corrected in place: modules beside this file "
         "that name it go to the corrected place too", "declare it LOCAL where none does; else give it another name there"),
    ):
        if which:
            findings.append(places.targets(code, "note", message, sorted(which), hint))
    if len(turned):
        findings.insert(0, places.targets("CS2042", "warning", "the correction moves an axis into another quadrant: confdata "
                                          "changed", sorted(turned.tolist()), "step through these moves at low speed first"))
    return tuple(findings)

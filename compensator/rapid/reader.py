"""From the bytes of a RAPID program to its toolpath."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from compensator.rapid.blocks import end_routines
from compensator.rapid.calls import runs_of
from compensator.rapid.handed import Beside, Declares, Elsewhere, called_elsewhere
from compensator.rapid.handed_targets import follow_calls
from compensator.rapid.namesakes import tell_apart
from compensator.rapid.program import RapidProgram
from compensator.rapid.quaternions import UNUSABLE
from compensator.rapid.reports import Places, report
from compensator.rapid.rows import Rows, collect
from compensator.rapid.runs import Runs, Taken
from compensator.rapid.runtime import changing
from compensator.rapid.scan import Scan
from compensator.rapid.scanner import scan
from compensator.rapid.tails import resolve_tails
from compensator.rapid.text import Offsets, Source, decode, locate
from compensator.rapid.unrolled import unroll
from compensator.rapid.values import UNUSED, Values
from compensator.toolpath import Move, OtherFiles, Toolpath, Way
from identification.common.arrays import held_once, nothing_or, read_only
from identification.common.findings import counted

_LARGEST_CONFDATA = 1e6         # anything beyond is no quadrant; it also keeps the conversion to integers defined


def read_rapid(
    data: bytes, name: str = "program.mod", beside: Beside | None = None, declares: Declares | None = None
) -> RapidProgram:
    """Reads a RAPID program; `name` stands in findings as the file. beside: of routines that it calls and does not hold those
    in which a file beside it drives, and that file. declares: of names of targets that it does not declare, which each of the
    files beside it does.

    Targets count in the order of the text: one for MoveL, MoveJ, MoveAbsJ, two for MoveC (circle point, destination).
    Raises CompstiffError for text no controller would load (CS2001 ... CS2005). What the text does not settle is NaN
    with a reason in `toolpath.block` and a finding.
    """
    source = decode(data, name)
    scanned = scan(source)
    values = Values(source, scanned.names, changing(scanned.names, scanned.uses, scanned.routines))
    end_routines(scanned.bodies, len(scanned.move))
    unroll(scanned, values)
    tell_apart(scanned)
    follow_calls(scanned, values)
    scanned.read_expressions()
    count = len(scanned.move)
    elsewhere = called_elsewhere(scanned, beside)
    runs = runs_of(scanned.bodies, count, values, scanned.routines, {at for at, call in elsewhere.items() if call.drives})
    scope_of = _held(scanned.scopes, count)
    rows = collect(scanned, values, scope_of)
    _check_size(source, rows)
    tails = resolve_tails(scanned, values, scope_of)
    pose, settings = rows.numbers.pose, rows.numbers.settings
    setting = rows.numbers.setting[rows.row]
    if not np.array_equal(rows.row, np.arange(len(pose))):
        pose = pose[rows.row]
    move = np.frombuffer(bytes(scanned.move), dtype=np.uint8)
    absolute = move == Move.ABSOLUTE
    position, quaternion = pose[:, 0:3] / 1e3, pose[:, 3:7].copy()
    joints = np.broadcast_to(np.nan, (count, 6))
    if absolute.any():
        joints = np.full((count, 6), np.nan)
        joints[absolute] = np.radians(pose[absolute, :6])
    position[absolute] = quaternion[absolute] = np.nan
    squares = np.einsum("ni,ni->n", quaternion, quaternion)
    quaternion /= np.sqrt(np.where(squares > 0, squares, 1.0))[:, None]
    off = np.abs(np.subtract(squares, 1.0, out=squares), out=squares)
    quaternion[off > UNUSABLE] = np.nan
    told = np.asarray(~np.isnan(settings[:, :4]).any(axis=1))
    has_confdata = ~absolute & told[setting]
    confdata = np.where(told[:, None], settings[:, :4], 0.0).astype(np.int32)[setting]
    confdata[absolute] = 0
    external = np.where(np.abs(settings[:, 4:]) >= UNUSED, np.nan, settings[:, 4:])
    external = external[setting] if not np.isnan(external).all() else np.broadcast_to(np.nan, (count, 6))
    line, column = locate(source, np.asarray(scanned.start, dtype=np.int64))
    column = held_once(column)              # a post-processor begins all lines alike
    displaced = np.array([shift for _, shift in scanned.shifts])[_held(scanned.shifts, count)] | runs.under("displaced")
    displaced = displaced & ~absolute
    soft = np.array([on for _, on in scanned.softened])[_held(scanned.softened, count)] | runs.under("soft")
    offset = np.array([on for _, on in scanned.offsets])[_held(scanned.offsets, count)] | runs.under("offset")
    offset = offset & ~np.isnan(external).all(axis=1)
    together = np.array([tail.together for tail in scanned.tails] or [False])[tails.tail]
    places = Places(source, line, column)
    undeclared = {problem.name.lower() for problem in rows.problems if problem.name}
    held = {} if declares is None or not undeclared else declares(undeclared)
    block, findings = report(scanned, values, rows, tails, places, off, displaced, soft, offset, elsewhere, held)
    block = held_once(block)
    toolpath = Toolpath(
        source=name, move=move, line=line, column=column, position=position, quaternion=quaternion,
        confdata=confdata, has_confdata=has_confdata,
        external=nothing_or(external), joints=nothing_or(joints), tool=tails.tool, workobject=tails.workobject,
        feed=tails.feed, zone=tails.zone, block=block, tools=tails.tools, workobjects=tails.workobjects, findings=findings,
        switched=tuple((first, unit, on) for first, unit, on, _ in scanned.units),
        together=together if together.any() else None, driven=runs.order,
        ways=_ways(source, runs), uncounted=runs.uncounted, others=_others(
            scanned, elsewhere, tuple(held) if held and undeclared == frozenset().union(*held.values()) else ()),
        monitored=not scanned.unmonitored,
    )
    read_only(position, quaternion, toolpath.external, toolpath.joints, line, column, block, toolpath.confdata, has_confdata)
    return RapidProgram(toolpath, source, scanned, values, rows, runs)


def _held(changes: Sequence[tuple[int, object]], count: int) -> Offsets:
    """Which of the changes (first target, value) each of `count` targets falls under (count,)."""
    if len(changes) == 1:
        return np.broadcast_to(np.int64(0), count)
    first = np.array([target for target, _ in changes], dtype=np.int64)
    return (np.searchsorted(first, np.arange(count), side="right") - 1).astype(np.int64)


def _ways(source: Source, runs: Runs) -> tuple[Way, ...]:
    """The ways that a program may go, where there are several."""
    if runs.open:
        return (Way(np.arange(runs.count), (), stated=False),)
    return () if len(runs.ways) < 2 else tuple(
        Way(way.order, tuple(_taken(source, branch) for branch in way.taken), way.stated,
            tuple(branch.turns for branch in way.taken)) for way in runs.ways)


def _others(scanned: Scan, elsewhere: Mapping[int, Elsewhere], targets: tuple[str, ...]) -> OtherFiles:
    """What of the program stands in other files, as far as this one shows it; targets: the files that declare its targets."""
    lines = locate(scanned.source, list(elsewhere))[0].tolist() if elsewhere else []
    known = dict[str, int]()
    for line, call in zip(lines, elsewhere.values(), strict=True):
        if not call.drives:
            known.setdefault(call.name, line)
    return OtherFiles(any(routine.name == "main" for routine in scanned.bodies) or not scanned.bodies,
                      tuple(f"{name} (line {line})" for name, line in known.items()), targets)


def _taken(source: Source, branch: Taken) -> str:
    line = int(locate(source, np.array([branch.start]))[0][0])
    shown = " ".join(source.text(branch.start, branch.start + 60).split("\n")[0].split())
    if branch.turns is not None:
        return f"{counted(branch.turns, 'turn')} of '{shown}' in line {line}"
    return f"{'no branch of ' if branch.none else ''}'{shown}' in line {line}"


def _check_size(source: Source, rows: Rows) -> None:
    """Raises CS2005 for numbers no target can have: 1E999 is infinite."""
    with np.errstate(invalid="ignore"):
        numbers = rows.numbers
        unsound = np.asarray(np.isinf(numbers.settings).any(axis=1)
                             | (np.abs(numbers.settings[:, :4]) > _LARGEST_CONFDATA).any(axis=1))
        wrong = np.isinf(numbers.pose).any(axis=1) | unsound[numbers.setting]
    if wrong.any():
        at = int(rows.start[np.flatnonzero(wrong)[0]])
        raise source.fail("CS2005", "found a number in this target that is out of range, expected finite numbers and "
                          "quadrants as confdata", max(at, 0))

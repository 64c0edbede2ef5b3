"""Further moves in the text of a program: intermediate targets of a long MoveL, an arc in several parts, a smaller zone.

Only moves that stand by themselves are touched: the instruction, its targets and its tail, with nothing but blanks and comments
between them and the move before, so that they are driven one after the other whenever the second is driven. A call that hands
its target to a routine of a single MoveL is such a move, too, and so is each turn of a loop over an array that may grow.
"""

from __future__ import annotations

import re
from bisect import bisect_right
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from compensator.rapid.expressions import Cursor
from compensator.rapid.growing import size_of
from compensator.rapid.lexer import TRIVIA, tokens
from compensator.rapid.literals import Pose, fresh
from compensator.rapid.moves import OF_ONE_MOVE, parse_tail
from compensator.rapid.program import RapidProgram
from compensator.rapid.scan import Round
from compensator.rapid.writer import Edit, apply
from compensator.toolpath import Move

_HEAD = re.compile(rb"(?i)(?<![\w\x80-\xff])Move[LC](?:DO)?\s*(?:\s(?:ToPoint|CirPoint)\s*:=\s*)?\Z")
_TAIL = re.compile(rb"[^;!\"]*+;")
_BETWEEN = re.compile(TRIVIA)
_LINE_END = re.compile(rb"(?:\r*\n|\r)\Z")
_LONGEST_HEAD = 80
_FLYBY, _FLYBY_RADIUS = b"z0", 0.3e-3


@dataclass(frozen=True, slots=True)
class MoveText:
    """Offsets of one MoveL or MoveC: the instruction, the end of its last target, the zone argument with its \\Z or \\Inpos,
    the comma before the output it sets (else the semicolon), behind the semicolon. bare: without options that no move with an
    output takes."""

    start: int
    targets_end: int
    zone_start: int
    zone_end: int
    tail_end: int
    end: int
    bare: bool
    stops: bool


def move_text(program: RapidProgram, first: int) -> MoveText | None:
    """The text of the move whose first target is `first`; None where it is not one that can be repeated."""
    source, last, span = program.source, _last(program, first), _span(program, first)
    if span is None or first in program.scan.looped or first in program.scan.handed:
        return None
    start, end = span
    targets_end = program.scan.end[last]
    comma = source.data.index(b",", targets_end) + 1
    parsed = parse_tail(Cursor(source, tokens(source, comma, end)))
    zone_end = source.data.rindex(b",", parsed.zone.end, parsed.tool.start)
    tail_end = end - 1 if parsed.signal is None else source.data.rindex(b",", parsed.tool.end, parsed.signal.start)
    bare = parsed.velocity is None and parsed.radius is None and not parsed.stops
    return MoveText(start, targets_end, parsed.zone.start, zone_end, tail_end, end, bare, program.toolpath.zone[last] == 0)


def _last(program: RapidProgram, first: int) -> int:
    return first + int(program.toolpath.move[first] == Move.ARC_VIA)


def _span(program: RapidProgram, first: int) -> tuple[int, int] | None:
    """Where the move begins whose first target is `first`, and behind its semicolon; None where it cannot be repeated."""
    data, begin = program.source.data, program.scan.start[first]
    low = max(begin - _LONGEST_HEAD, 0)
    head, tail = _HEAD.search(data[low:begin]), _TAIL.match(data, program.scan.end[_last(program, first)])
    if head is None or tail is None or OF_ONE_MOVE.search(tail.group()):
        return None
    return low + head.start(), tail.end()


def marked(program: RapidProgram, targets: Sequence[int], signal: str, values: Sequence[int]) -> bytes:
    """The program with these moves setting an output: MoveL -> MoveLDO ..., signal, value."""
    edits: list[Edit] = []
    for target, value in zip(targets, values, strict=True):
        text = move_text(program, target - int(program.toolpath.move[target] == Move.ARC_END))
        assert text is not None
        edits += [(text.start + 5, text.start + 5, b"DO"), (text.end - 1, text.end - 1, f",{signal},{value}".encode("ascii"))]
    return apply(program.source.data, edits)


def follows_directly(program: RapidProgram, first: int) -> bool:
    """Whether further targets can stand between the target before `first` and the move to it: that can be repeated, and nothing
    but blanks and comments stands between the two."""
    if first == 0:
        return False
    here, before = _again(program, first), _behind(program, first - 1)
    if here is None or before is None:
        return here is not None and _round(program, first) is _round(program, first - 1) is not None
    return _BETWEEN.fullmatch(program.source.data, before, here[0]) is not None


def _again(program: RapidProgram, first: int) -> tuple[int, int] | None:
    """The span of the statement in which the move to `first` can be repeated: itself, the call that leads to it, or the loop
    whose array grows; None where it cannot. The last two would stop at each further target where it stops."""
    scan, one = program.scan, _round(program, first)
    if one is None and first not in scan.handed:
        return _span(program, first)
    if scan.tails[scan.tail[first]].stops or not program.toolpath.zone[first] > 0:
        return None
    if one is None:
        return scan.alone.get(first)
    declared, others = scan.names.declarations[one.array], program.toolpath.others
    seen = declared.reach != "local" and declared.scope.routine < 0         # by modules of other files
    return None if seen and (not others.started or others.called or program.toolpath.uncounted) else (one.start, one.end)


def _behind(program: RapidProgram, target: int) -> int | None:
    """Where the statement ends with which a target is driven, and nothing else; None where it is not seen."""
    scan, one = program.scan, _round(program, target)
    if one is not None:
        return one.end if target == one.stop - 1 else None
    if target in scan.handed:
        return scan.alone[target][1] if target in scan.alone else None
    tail = None if target in scan.looped else _TAIL.match(program.source.data, scan.end[target])
    return None if tail is None else tail.end()


def _round(program: RapidProgram, target: int) -> Round | None:
    """The loop over an array that may grow which drives to a target."""
    rounds = program.scan.rounds
    at = bisect_right(rounds, target, key=lambda one: one.first) - 1
    return rounds[at] if at >= 0 and target < rounds[at].stop else None


@dataclass(frozen=True, slots=True)
class MoreMoves:
    """What one move becomes: the poses of further linear targets before it, or, of an arc, those of both its halves: circle
    points and ends in turn, each half with one pose fewer than targets, for its last target is the program's own."""

    first: int
    linear: Sequence[Pose] = ()
    halves: tuple[Sequence[Pose], Sequence[Pose]] = ((), ())


def with_more_moves(program: RapidProgram, more: Sequence[MoreMoves]) -> bytes:
    """The program with these moves added; whoever asks has made sure by `move_text` that they can be."""
    edits: list[Edit] = []
    for move in more:
        if move.first in program.scan.alone:
            edits.append(_calls(program, move))
            continue
        if _round(program, move.first) is not None:
            edits.append(_elements(program, move))
            continue
        text = move_text(program, move.first)
        assert text is not None
        edits += _arc(program, move, text) if move.halves[0] else _line(program, move, text)
    return apply(program.source.data, edits + _grown(program, {move.first: len(move.linear) for move in more}))


def _calls(program: RapidProgram, move: MoreMoves) -> Edit:
    data, scan = program.source.data, program.scan
    start, end = scan.alone[move.first]
    head, tail = data[start:scan.start[move.first]], data[scan.end[move.first]:end]
    row, gap = program.rows.numbers[program.rows.row[move.first]], _gap(data, start)
    return start, start, b"".join(head + fresh(row, pose) + tail + gap for pose in move.linear)


def _elements(program: RapidProgram, move: MoreMoves) -> Edit:
    """Further elements before that of a target."""
    place = program.rows.row[move.first]
    row, start = program.rows.numbers[place], int(program.rows.start[place])
    gap = _gap(program.source.data, start)
    behind = b"," if gap == b" " else b"," + gap
    return start, start, b"".join(fresh(row, pose) + behind for pose in move.linear)


def _grown(program: RapidProgram, more: Mapping[int, int]) -> list[Edit]:
    """The sizes of arrays, and the bounds of their loops, with so many elements more before those of some targets."""
    data, edits = program.source.data, list[Edit]()
    for array in dict.fromkeys(one.array for one in program.scan.rounds):
        rounds = [one for one in program.scan.rounds if one.array == array]
        size = size_of(program.scan, array)
        assert size is not None
        count = int(data[slice(*size)])
        added = np.zeros(count + 1, dtype=np.intp)              # up to and with each element
        for one in rounds:
            elements = one.elements(data, count)
            added[elements.start:elements.stop] = [more.get(target, 0) for target in range(one.first, one.stop)]
        added = np.cumsum(added)
        if not added[-1]:
            continue
        edits.append((*size, b"%d" % (count + added[-1])))
        for one in rounds:
            elements = one.elements(data, count)
            now = (elements.start + added[elements.start - 1], elements[-1] + added[elements[-1]])
            edits += [(*span, b"%d" % number) for span, number in zip(one.bounds, now, strict=False)]
    return edits


def _line(program: RapidProgram, move: MoreMoves, text: MoveText) -> list[Edit]:
    row = program.rows.numbers[program.rows.row[move.first]]
    tail, gap = _repeated_tail(program, text), _gap(program.source.data, text.start)
    return [(text.start, text.start, b"".join(b"MoveL " + fresh(row, pose) + tail + gap for pose in move.linear))]


def _arc(program: RapidProgram, move: MoreMoves, text: MoveText) -> list[Edit]:
    data, scan, rows = program.source.data, program.scan, program.rows
    via, end = move.first, move.first + 1
    tail, gap = _repeated_tail(program, text), _gap(data, text.start)
    if not program.toolpath.zone[end] <= _FLYBY_RADIUS:     # a larger zone would cut the arc itself at each end
        tail = _with_flyby(data, text)
    row_of = [rows.numbers[rows.row[target]] for target in (via, end)]
    spelled = [[fresh(row, pose) for pose in half] for row, half in zip(row_of, move.halves, strict=True)]
    first, second = spelled
    own = data[scan.start[via]:scan.end[via]]
    before = [*zip(first[0::2], [*first[1::2], own], strict=True), *zip(second[0:-1:2], second[1:-1:2], strict=True)]
    added = b"".join(b"MoveC " + a + b"," + b + tail + gap for a, b in before)
    return [(text.start, text.start, added), (scan.start[via], scan.end[via], second[-1])]


def _repeated_tail(program: RapidProgram, text: MoveText) -> bytes:
    """Everything behind the targets but an output: that is set at the last target of the move, where alone it stops too."""
    data = program.source.data
    if text.stops:
        return _with_flyby(data, text)
    return data[text.targets_end:text.tail_end] + data[text.end - 1:text.end]


def _with_flyby(data: bytes, text: MoveText) -> bytes:
    """The same with the smallest zone there is a name for."""
    end = data[text.end - 1:text.end]
    return data[text.targets_end:text.zone_start] + _FLYBY + data[text.zone_end:text.tail_end] + end


def _gap(data: bytes, start: int) -> bytes:
    """What separates a move from the next: line end and indent where it stands on a line of its own, else a blank."""
    line = max(data.rfind(b"\n", 0, start), data.rfind(b"\r", 0, start)) + 1
    indent = data[line:start]
    if indent.strip() or line == 0:
        return b" "
    newline = _LINE_END.search(data, max(line - 3, 0), line)
    assert newline is not None
    return newline.group() + indent


def with_zones(program: RapidProgram, targets: Sequence[int], radius_mm: Sequence[float]) -> bytes:
    """The program with \\Z of the given radius in the moves to these targets, in place of an earlier \\Z."""
    edits: list[Edit] = []
    for target, radius in zip(targets, radius_mm, strict=True):
        text = move_text(program, target - int(program.toolpath.move[target] == Move.ARC_END))
        assert text is not None
        zone = program.source.data[text.zone_start:text.zone_end]
        name = re.split(rb"\s*\\", zone)[0].rstrip()
        edits.append((text.zone_start, text.zone_end, name + b"\\Z:=" + (b"%.3f" % radius).rstrip(b"0").rstrip(b".")))
    return apply(program.source.data, edits)

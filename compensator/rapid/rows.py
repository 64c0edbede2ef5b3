"""Where each target takes its value from: one row for each place in the text that holds a target."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from compensator.rapid.expressions import Expr
from compensator.rapid.numbers import Numbers, convert
from compensator.rapid.scan import Scan
from compensator.rapid.scopes import Scope
from compensator.rapid.statements import LITERAL
from compensator.rapid.targets import NOTHING, POSE, WIDTH, Target, read_joint_target, read_site, read_target
from compensator.rapid.text import Offsets
from compensator.rapid.values import Site, Unsettled, Values
from compensator.toolpath import Move

_Item = TypeVar("_Item", bound=np.generic)


@dataclass(frozen=True, slots=True)
class Rows:
    """R places. row (N,): the place of each target.

    numbers (R) as written. start, end (R,): span of the text there, -1 where it is not in this file.
    declaration (R,): number of the declaration it is the value of, -1 where it stands in the move itself.
    literal (R,): the numbers themselves stand there. problem (R,): number in `problems`, 0 for none.
    """

    row: Offsets
    numbers: Numbers
    start: Offsets
    end: Offsets
    declaration: Offsets
    literal: NDArray[np.bool_]
    problem: Offsets
    problems: tuple[Unsettled, ...]


@dataclass(slots=True)
class _Late:
    """Rows behind those of the inline targets."""

    first: int
    values: list[list[float]] = field(default_factory=list)
    spans: list[tuple[int, int, int, bool]] = field(default_factory=list)
    problem: list[int] = field(default_factory=list)
    problems: dict[Unsettled, int] = field(default_factory=lambda: {Unsettled("", ""): 0})
    numbers: list[tuple[int, int, int, int]] = field(default_factory=list)      # late row, and a literal still to convert

    def add(self, target: Target) -> int:
        place = target.place
        span = (-1, -1, -1, False) if place is None else (
            place.expr.start, place.expr.end, place.declaration, target.literal)
        self.spans.append(span)
        self.values.append(target.numbers)
        self.problem.append(0 if target.problem is None else self.problems.setdefault(target.problem, len(self.problems)))
        return self.first + len(self.spans) - 1

    def add_literal(self, start: int, rest: int, end: int, declaration: int) -> int:
        self.numbers.append((len(self.spans), start, rest, end))
        self.spans.append((start, end, declaration, True))
        self.values.append(NOTHING)
        self.problem.append(0)
        return self.first + len(self.spans) - 1


def collect(scan: Scan, values: Values, scope_of: Offsets) -> Rows:
    """The rows of all targets. scope_of (N,): number of each target's scope in scan.scopes.

    Raises CS2003, CS2004, CS2005 for a target no controller would load.
    """
    start, rest, end = (np.asarray(column, dtype=np.int64) for column in (scan.start, scan.rest, scan.end))
    inline = np.flatnonzero(rest >= 0)
    spans = (start, rest, end)
    if len(inline) < len(start):        # else they are held once
        spans = (start[inline], rest[inline], end[inline])
    row = np.full(len(start), -1, dtype=np.int64)
    row[inline] = np.arange(len(inline))
    numbers, bad = convert(scan.source.data, *spans)
    late = _Late(len(inline))
    known: dict[tuple[object, ...], int] = {}
    scopes = [scope for _, scope in scan.scopes]
    for index in bad:
        target = int(inline[index])
        expr = values.parse(int(start[target]), int(end[target]))
        row[target] = late.add(read_target(values, expr, scopes[scope_of[target]]))
    _add_named(scan, values, scope_of, row, late, known, scopes)
    for target, expr in scan.expressions.items():
        row[target] = _row(scan, values, target, expr, scopes[scope_of[target]], late, known)
    return _rows(values, row, numbers, (spans[0], spans[2]), late)


def _add_named(
    scan: Scan, values: Values, scope_of: Offsets, row: Offsets, late: _Late, known: dict[tuple[object, ...], int],
    scopes: list[Scope],
) -> None:
    """Rows of the targets that are just a name: each name is looked up once a scope."""
    name = np.array(scan.name, dtype=np.int64)
    named = np.flatnonzero(name >= 0)
    joint = np.frombuffer(bytes(scan.move), dtype=np.uint8)[named] == Move.ABSOLUTE
    pair = (name[named] * len(scopes) + scope_of[named]) * 2 + joint
    _, first, inverse = np.unique(pair, return_index=True, return_inverse=True)
    spellings = list(scan.spellings)
    row_of = np.empty(len(first), dtype=np.int64)
    for number, target in enumerate(named[first].tolist()):
        expr = Expr("name", scan.start[target], scan.end[target], spellings[scan.name[target]])
        row_of[number] = _row(scan, values, target, expr, scopes[scope_of[target]], late, known)
    row[named] = row_of[inverse]


def _row(
    scan: Scan, values: Values, target: int, expr: Expr, scope: Scope, late: _Late, known: dict[tuple[object, ...], int]
) -> int:
    joint = scan.move[target] == Move.ABSOLUTE
    if expr.kind not in ("name", "element"):
        return late.add((read_joint_target if joint else read_target)(values, expr, scope))
    number = values.names.find(expr.name, scope)
    key = (joint, number, expr.name if number < 0 else "", *(index.value for index in expr.items))
    if number >= 0 and all(index.kind == "number" for index in expr.items) and key in known:
        return known[key]
    place = None if joint or expr.kind == "element" else _plain(values, expr, scope, number)
    row = late.add_literal(*place) if place else late.add((read_joint_target if joint else read_target)(values, expr, scope))
    known[key] = row
    return row


def _plain(values: Values, expr: Expr, scope: Scope, number: int) -> tuple[int, int, int, int] | None:
    """Offsets and declaration of a named target that is declared in plain figures and never changes."""
    if number < 0 or number in values.changing or number in values.names.doubled:
        return None
    declaration = values.names.declarations[number]
    if declaration.type != "robtarget" or declaration.storage == "parameter" or declaration.dimensions:
        return None
    match = LITERAL.fullmatch(values.source.data, declaration.value_start, declaration.value_end) \
        if declaration.value_start >= 0 else None
    return (declaration.value_start, match.start("rest"), declaration.value_end, number) if match else None


def _rows(values: Values, row: Offsets, inline: Numbers, spans: tuple[Offsets, Offsets], late: _Late) -> Rows:
    later = Numbers.of(np.array(late.values, dtype=np.float64).reshape(-1, WIDTH))
    if late.numbers:
        which, start, rest, end = np.array(late.numbers, dtype=np.int64).T
        figures, bad = convert(values.source.data, start, rest, end)
        later.pose[which] = figures.pose
        later.settings[which] = figures.settings[figures.setting]
        for index in bad:                               # a symbol that looks like a figure, or an error
            at = int(which[index])
            number = late.spans[at][2]
            site = Site(values.initial(number), values.names.declarations[number].scope, number)
            target = read_site(values, site)
            later.pose[at], later.settings[at] = target.numbers[:POSE], target.numbers[POSE:]
            if target.problem is not None:
                late.problem[at] = late.problems.setdefault(target.problem, len(late.problems))
    late_spans = np.array([span[:3] for span in late.spans], dtype=np.int64).reshape(-1, 3)
    nowhere, unproblematic, literal = (np.broadcast_to(value, len(inline.pose)) for value in (np.int64(-1), np.int64(0), True))
    return Rows(
        row=row,
        numbers=inline.and_then(later),
        start=_and_then(spans[0], late_spans[:, 0]),
        end=_and_then(spans[1], late_spans[:, 1]),
        declaration=_and_then(nowhere, late_spans[:, 2]),
        literal=_and_then(literal, np.array([span[3] for span in late.spans], dtype=bool)),
        problem=_and_then(unproblematic, np.array(late.problem, dtype=np.int64)),
        problems=tuple(late.problems),
    )


def _and_then(column: NDArray[_Item], late: NDArray[_Item]) -> NDArray[_Item]:
    """The column with that of the late rows behind it; itself where there are none, as mostly."""
    return np.concatenate([column, late]) if len(late) else column


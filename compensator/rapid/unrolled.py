"""Loops over arrays of targets, `FOR i FROM 1 TO 9 DO MoveL aPath{i},... ENDFOR`, as the moves that they drive.

Only where nothing but such moves, or moves to Offs and RelTool, stands in the loop, and numbers and constants settle its turns.
What is corrected is written into the array: the move itself stays as it is, and so do the places of Offs and RelTool.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

from compensator.rapid.arithmetic import arithmetic
from compensator.rapid.blocks import Loop, words_of
from compensator.rapid.conditions import split
from compensator.rapid.expressions import Expr
from compensator.rapid.growing import growing, round_of
from compensator.rapid.lexer import Token, tokens
from compensator.rapid.repeated import Time, repeat
from compensator.rapid.scan import Round, Scan
from compensator.rapid.scopes import Scope
from compensator.rapid.values import Unsettled, Values

# A loop of more targets stays one move; of an array that grows it is still fewer (growing.py).
MOST = 400_000


@dataclass(frozen=True, slots=True)
class _Turned:
    """A loop of targets, and these at each turn."""

    loop: Loop
    turns: list[Time]
    round: Round | None


def unroll(scan: Scan, values: Values) -> None:
    """Gives each turn of such loops targets of its own, and says which these are in `scan.looped`."""
    loops = [turned for routine in scan.bodies for loop in routine.body.loops()
             if (turned := _turned(scan, values, loop, routine.scope)) is not None]
    if not loops:
        return
    loops.sort(key=lambda turned: turned.loop.body.first)
    times = [turn for turned in loops for turn in turned.turns]
    place = repeat(scan, times)
    number = 0
    rounds = []
    for turned in loops:
        if turned.round is not None:
            first = place.of_time(number).start
            rounds.append(replace(turned.round, first=first, stop=first + len(turned.turns)))
        number += len(turned.turns)
    scan.rounds = growing(scan, values, rounds)
    scan.looped.update(target for number in range(len(times)) for target in place.of_time(number))
    gone = {step for turned in loops for step in (turned.loop.head, turned.loop.end)}
    for routine in scan.bodies:
        routine.first, routine.stop = place(routine.first), place(routine.stop)
        routine.steps = [step._replace(at=place(step.at)) for step in routine.steps if step not in gone]
        routine.forget()


def _turned(scan: Scan, values: Values, loop: Loop, scope: Scope) -> _Turned | None:
    """A loop as it is driven; None where it is another one, or its turns are not known."""
    first, stop = loop.body.first, loop.body.stop
    exprs = [scan.expressions.get(target) for target in range(first, stop)]
    if loop.head.kind != "for" or loop.end is None or loop.end.kind != "endfor" or loop.body.items or not exprs:
        return None
    known = turns_of(scan, values, loop, scope)
    if known is None or not known[1] or len(known[1]) * len(exprs) > MOST:
        return None
    name, turns = known
    found = []
    for turn in turns:
        at_turn = [None if expr is None else target_at(values, expr, scope, {name: turn}) for expr in exprs]
        if None in at_turn:
            return None
        found.append(Time(first, stop, [expr for expr in at_turn if expr is not None], first, loop.head.start))
    return _Turned(loop, found, round_of(scan, values, loop, scope))


def turns_of(scan: Scan, values: Values, loop: Loop, scope: Scope) -> tuple[str, list[float]] | None:
    """The variable of a FOR and its values."""
    words = words_of(scan.source, loop.head)
    marks = [next((k for k, word in enumerate(words) if word.word == mark), -1) for mark in ("from", "to", "step", "do")]
    start, to, step, end = marks
    if min(start, to, end) < 0:
        return None
    bounds = [words[start + 1:to], words[to + 1:step if step > 0 else end], *([words[step + 1:end]] if step > 0 else [])]
    numbers = [_number(values, part, scope, {}) for part in bounds]
    if any(number is None for number in numbers):
        return None
    low, high, *by = (float(number or 0.0) for number in numbers)
    stride = by[0] if by else (1.0 if high >= low else -1.0)
    if not stride or (high - low) * stride < 0 or abs((high - low) / stride) > MOST:
        return None
    return words[1].word, [low + k * stride for k in range(int((high - low) / stride + 1e-9) + 1)]


def _number(values: Values, words: list[Token], scope: Scope, held: Mapping[str, float]) -> float | None:
    """The value of numbers, constants, variables that are held and `Dim(array,1)`."""
    if len(words) > 3 and words[0].word == "dim" and words[1].word == "(":
        parts = split(words[2:-1], ",")
        number = values.names.find(parts[0][0].word, scope) if len(parts) == 2 and len(parts[0]) == 1 else -1
        if number < 0 or parts[1][0].word != "1" or values.names.declarations[number].value_start < 0:
            return None
        declared = values.initial(number)
        return float(len(declared.items)) if declared.kind == "aggregate" else None

    def named(word: Token) -> float | None:
        if word.word in held:
            return held[word.word]
        known = values.number(Expr("name", word.start, word.end, word.word), scope, word.word)
        return None if isinstance(known, Unsettled) else known

    return arithmetic([*words, Token("end", -1, -1, b"", "")], named) if words else None


def target_at(values: Values, expr: Expr, scope: Scope, held: Mapping[str, float]) -> Expr | None:
    """What a target is at one turn, at which the variables of loops are held: an element of an array, or Offs and RelTool by
    numbers that the turn settles; None where it is something else."""
    if expr.kind != "call" or expr.name not in ("offs", "reltool") or len(expr.items) != 4:
        return _element(values, expr, scope, held)
    base, *shift = expr.items
    if base.kind in ("call", "element"):
        inner = target_at(values, base, scope, held)
        base = base if inner is None else inner
    found = []
    for item in shift:
        number = _number(values, tokens(values.source, item.start, item.end)[:-1], scope, held)
        if number is None:
            return None
        found.append(Expr("number", item.start, item.end, value=number))
    return replace(expr, items=(base, *found))


def _element(values: Values, expr: Expr, scope: Scope, held: Mapping[str, float]) -> Expr | None:
    """The element that an expression with the loop's variable in its index is at one turn; None where it is something else."""
    if expr.kind != "element" or not any(part.name in held for index in expr.items for part in index.walk()):
        return None
    items = []
    for index in expr.items:
        at = _number(values, tokens(values.source, index.start, index.end)[:-1], scope, held)
        if at is None or not at.is_integer():
            return None
        items.append(Expr("number", index.start, index.end, value=at))
    return replace(expr, items=tuple(items))

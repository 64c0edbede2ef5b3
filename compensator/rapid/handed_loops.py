"""Loops whose turns hand elements of an array to a routine, `FOR i FROM 1 TO 9 DO cut aPath{i}; ENDFOR`, as a call each turn.

Only where nothing but calls stands in the loop, and numbers and constants settle its turns.
"""

from __future__ import annotations

import re
from collections.abc import Mapping

from compensator.rapid.blocks import Loop, Routine, Step, arguments
from compensator.rapid.scan import Scan
from compensator.rapid.scopes import Scope
from compensator.rapid.unrolled import turns_of
from compensator.rapid.values import Values

# The variables of loops at each turn, by the number of the turn.
Turns = Mapping[int, Mapping[str, float]]
# So many calls are looked at turn by turn.
MOST = 100_000
_APART = re.compile(rb'"[^"\r\n]*+"|![^\r\n]*+')


def turn_by_turn(scan: Scan, values: Values) -> Turns:
    """Puts the calls of such loops in their place, each turn its own (`Step.turn`), and tells the variables at each."""
    held: dict[int, Mapping[str, float]] = {}
    spans: dict[str, set[int]] = {}
    for routine in scan.bodies:
        while (found := _loop(scan, values, routine)) is not None:
            loop, name, turns = found
            if len(held) + len(turns) * len(loop.body.items) > MOST:
                break
            _put(routine, loop, name, turns, held)
        for step in routine.steps:
            if step.turn >= 0:
                for array, start in _arrays(scan, step, routine.scope):
                    spans.setdefault(array, set()).add(start)
    _not_elsewhere(scan, spans)
    return held


def _loop(scan: Scan, values: Values, routine: Routine) -> tuple[Loop, str, list[float]] | None:
    """An innermost loop of such calls, its variable and the values of that."""
    for loop in routine.body.loops():
        steps = [item for item in loop.body.items
                 if isinstance(item, Step) and item.kind == "call" and item.name in scan.routines]
        if (loop.head.kind != "for" or loop.end is None or loop.end.kind != "endfor" or loop.body.stop > loop.body.first
                or not steps or len(steps) < len(loop.body.items) or not any(_hands_over(scan, step) for step in steps)):
            continue
        known = turns_of(scan, values, loop, routine.scope)
        # Data of the name of the variable would be taken for it elsewhere in the calls.
        if known is not None and known[1] and scan.names.find(known[0], routine.scope) < 0:
            return loop, *known
    return None


def _hands_over(scan: Scan, step: Step) -> bool:
    """Whether a call hands over an element of an array."""
    types = {scan.names.declarations[one.declaration].type for one in scan.routines[step.name]}
    return "robtarget" in types and any(word.word == "{" for part in arguments(scan.source, step) for word in part)


def _put(routine: Routine, loop: Loop, name: str, turns: list[float], held: dict[int, Mapping[str, float]]) -> None:
    first = next(k for k, step in enumerate(routine.steps) if step is loop.head)
    last = next(k for k, step in enumerate(routine.steps) if step is loop.end)
    steps = []
    for value in turns:
        for step in routine.steps[first + 1:last]:
            number = len(held)
            held[number] = {**held.get(step.turn, {}), name: value}
            steps.append(step._replace(turn=number))
    routine.steps[first:last + 1] = steps
    routine.forget()


def _arrays(scan: Scan, step: Step, scope: Scope) -> set[tuple[str, int]]:
    """The arrays of which a call hands over an element, and where they are named."""
    return {(part[0].word, part[0].start) for part in arguments(scan.source, step)
            if len(part) > 1 and part[1].word == "{" and scan.names.find(part[0].word, scope) >= 0}


def _not_elsewhere(scan: Scan, spans: Mapping[str, set[int]]) -> None:
    """Forgets that the loops themselves read their arrays, where nothing but they and the declaration name these."""
    if not spans:
        return
    text = _APART.sub(b"", scan.source.data[scan.source.start:])
    for array, starts in spans.items():
        # Moves that name one element are told from others by that.
        starts = starts | {expr.start for expr in scan.expressions.values() if expr.kind == "element" and expr.name == array}
        word = rb"(?i)(?<![\w])" + re.escape(array.encode(scan.source.encoding)) + rb"(?![\w])"
        named = len(re.findall(word, text)) - len(re.findall(rb"(?i)\bdim\s*\(\s*" + word[4:] + rb"\s*,", text))
        if named == 1 + len(starts):
            scan.uses.read = {(name, scope) for name, scope in scan.uses.read if name != array}

"""Arrays of targets that may grow: loops of one MoveL each go over their elements, and nothing else names them.

An intermediate target of such a loop is a further element, with which the size of the array and the bounds of its loops grow.
"""

from __future__ import annotations

import re
from collections.abc import Sequence

from compensator.rapid.blocks import Loop, words_of
from compensator.rapid.lexer import COMMENT, STRING, TRIVIA, tokens
from compensator.rapid.moves import OF_ONE_MOVE
from compensator.rapid.scan import Round, Scan
from compensator.rapid.scopes import Scope
from compensator.rapid.values import Values

# A longer array stays as it is: with what is added it is still unrolled (unrolled.py).
LARGEST = 100_000
_HEAD = re.compile(rb"(?i)" + TRIVIA + rb"MoveL\s+(?:ToPoint\s*:=\s*)?")
_TAIL = re.compile(rb"([^;!\"]*+);" + TRIVIA)
_SIZE = re.compile(rb"\{\s*(\d+)\s*\}")
_APART = re.compile(STRING + rb"|" + COMMENT)


def round_of(scan: Scan, values: Values, loop: Loop, scope: Scope) -> Round | None:
    """A loop over elements of an array, each by the one MoveL that stands in it; None where it is another one."""
    first, stop = loop.body.first, loop.body.stop
    expr = scan.expressions.get(first)
    words = words_of(scan.source, loop.head)
    spelled = [word.word for word in words]
    if (stop - first != 1 or loop.end is None or expr is None or expr.kind != "element" or len(words) not in (7, 12)
            or [item.name for item in expr.items if item.kind == "name"] != [spelled[1]] or len(expr.items) > 1):
        return None
    counted = len(words) == 12 and spelled[5:-1] == ["dim", "(", expr.name, ",", "1", ")"]
    bounds = words[3:4] if counted else [words[3], words[5]]
    data = scan.source.data
    tail = _TAIL.fullmatch(data, expr.end, loop.end.start)
    if ((len(words) == 12) != counted or not all(word.text.isdigit() for word in bounds) or tail is None
            or _HEAD.fullmatch(data, loop.head.end, expr.start) is None or OF_ONE_MOVE.search(tail[1])
            or spelled[1] in (word.word for word in tokens(scan.source, *tail.span(1)))):
        return None
    return Round(first, stop, values.names.find(expr.name, scope), loop.head.start, loop.end.end,
                 tuple((word.start, word.end) for word in bounds))


def growing(scan: Scan, values: Values, rounds: Sequence[Round]) -> list[Round]:
    """Those rounds whose array may grow: its size and values are written in it, each element is driven by one of them at most,
    and nothing else names it."""
    arrays: dict[int, list[Round]] = {}
    for one in rounds:
        if one.array >= 0 and one.array not in values.names.doubled:
            arrays.setdefault(one.array, []).append(one)
    text = _APART.sub(b"", scan.source.data[scan.source.start:]) if arrays else b""
    found = [one for array, own in arrays.items() if _grows(scan, values, array, own, text) for one in own]
    return sorted(found, key=lambda one: one.first)


def _grows(scan: Scan, values: Values, array: int, rounds: Sequence[Round], text: bytes) -> bool:
    declared = values.names.declarations[array]
    if declared.dimensions != 1 or declared.storage == "parameter" or declared.value_start < 0:
        return False
    size = size_of(scan, array)
    value = values.initial(array)
    if size is None or value.kind != "aggregate" or not len(value.items) == int(scan.source.data[slice(*size)]) <= LARGEST:
        return False
    elements = [one.elements(scan.source.data, len(value.items)) for one in rounds]
    once = sum(len(own) for own in elements) == len(set().union(*elements))
    within = all(own and own[0] >= 1 and own[-1] <= len(value.items) for own in elements)
    named = rb"(?i)(?<![\w\x80-\xff])" + re.escape(declared.name.encode(scan.source.encoding)) + rb"(?![\w\x80-\xff])"
    # In its declaration, in each loop, and where that asks for its size.
    return once and within and len(re.findall(named, text)) == 1 + sum(3 - len(one.bounds) for one in rounds)


def size_of(scan: Scan, array: int) -> tuple[int, int] | None:
    """The span of the size in the declaration of an array; None where it is no plain number."""
    declared = scan.names.declarations[array]
    match = _SIZE.search(scan.source.data, declared.start, declared.value_start)
    return match.span(1) if match else None

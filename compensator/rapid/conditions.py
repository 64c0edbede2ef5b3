"""Conditions of branches and loops, as far as known values settle them: comparisons, AND, OR, XOR, NOT, TRUE and FALSE."""

from __future__ import annotations

import operator
from collections.abc import Callable

from compensator.rapid.arithmetic import arithmetic
from compensator.rapid.lexer import Token

# A number or a logical value; None where it is not known.
Value = float | bool | None
_COMPARES: dict[str, Callable[[float, float], bool]] = {
    "=": operator.eq, "<>": operator.ne, "<": operator.lt, ">": operator.gt, "<=": operator.le, ">=": operator.ge}
_OPEN, _CLOSE = ("(", "[", "{"), (")", "]", "}")
# No condition of a program nests deeper.
DEEPEST = 40


def value_of(words: list[Token], named: Callable[[Token], Value], depth: int = 0) -> Value:
    """The value of an expression, tokens without one of kind "end". named: the value of a name, of "present x" for Present(x).

    NOT binds less than AND by the controller's table of priorities, more by its grammar: where that matters nothing is known.
    """
    if not words or depth > DEEPEST:
        return None
    for operators in (("or", "xor"), ("and",)):
        parts, signs = _parts(words, operators)
        if signs:
            if words[0].word == "not" and operators == ("and",):
                return None
            return _joined([value_of(part, named, depth + 1) for part in parts], signs)
    if words[0].word == "not":
        inner = value_of(words[1:], named, depth + 1)
        return not inner if isinstance(inner, bool) else None
    parts, signs = _parts(words, tuple(_COMPARES))
    if signs:
        a, b = value_of(parts[0], named, depth + 1), value_of(parts[1], named, depth + 1)
        if len(signs) > 1 or a is None or b is None or isinstance(a, bool) != isinstance(b, bool):
            return None
        return _COMPARES[signs[0]](a, b)
    if words[0].word == "(" and words[-1].word == ")" and _closes_last(words):
        return value_of(words[1:-1], named, depth + 1)
    if len(words) == 4 and words[0].word == "present" and words[1].word == "(":
        return named(words[2]._replace(word=f"present {words[2].word}"))
    if len(words) == 1 and words[0].kind == "name":
        return words[0].word == "true" if words[0].word in ("true", "false") else named(words[0])
    return arithmetic([*words, Token("end", words[-1].end, words[-1].end, b"", "")], lambda token: _number(named(token)))


def _number(value: Value) -> float | None:
    return None if isinstance(value, bool) else value


def _parts(words: list[Token], at: tuple[str, ...]) -> tuple[list[list[Token]], list[str]]:
    """The parts of an expression between some of its outermost operators, and these."""
    parts: list[list[Token]] = [[]]
    signs: list[str] = []
    depth = 0
    for word in words:
        depth += (word.word in _OPEN) - (word.word in _CLOSE)
        if not depth and word.word in at and word.kind in ("name", "mark"):
            parts.append([])
            signs.append(word.word)
        else:
            parts[-1].append(word)
    return parts, signs


def split(words: list[Token], at: str) -> list[list[Token]]:
    """The parts of a list between its outermost marks."""
    return _parts(words, (at,))[0]


def _closes_last(words: list[Token]) -> bool:
    """Whether the parenthesis that begins the expression is the one that ends it."""
    depth = 0
    for word in words[:-1]:
        depth += (word.word in _OPEN) - (word.word in _CLOSE)
        if not depth:
            return False
    return True


def _joined(values: list[Value], signs: list[str]) -> Value:
    """Logical values, from left to right; FALSE AND what is not known is FALSE, TRUE OR that is TRUE."""
    result = values[0]
    for sign, value in zip(signs, values[1:], strict=True):
        pair = (result, value)
        decided = {"and": False, "or": True}.get(sign)
        if decided is not None and decided in [part for part in pair if isinstance(part, bool)]:
            result = decided
        elif not all(isinstance(part, bool) for part in pair):
            result = None
        else:
            result = pair[0] != pair[1] if sign == "xor" else not decided
    return result

"""Expressions of RAPID as a small tree, as far as targets and the data they use need it."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

from compensator.rapid.lexer import OPERATORS, Token
from compensator.rapid.text import Source
from identification.common.findings import CompstiffError

Kind = Literal["number", "name", "string", "aggregate", "call", "element", "star", "other"]

_DEEPEST = 40           # no data type nests deeper; keeps hostile input from exhausting the stack
_INFIX = frozenset("+-*/=<>&") | {"<=", ">=", "<>"}
# Names of the required parameters of the functions that are worked out.
_PARAMETERS = {"offs": ("point", "xoffset", "yoffset", "zoffset"), "reltool": ("point", "dx", "dy", "dz")}


@dataclass(frozen=True, slots=True)
class Expr:
    """One expression at source.data[start:end].

    name: identifier in lower case (name, call, element). value: of a number. items: parts of an aggregate, arguments
    of a call, indices of an element, operands of anything else. options: the `\\Name:=value` arguments of a call.
    """

    kind: Kind
    start: int
    end: int
    name: str = ""
    value: float = float("nan")
    items: tuple[Expr, ...] = ()
    options: tuple[tuple[str, Expr | None], ...] = ()

    def walk(self) -> Iterator[Expr]:
        """This expression and everything inside it."""
        yield self
        for item in self.items:
            yield from item.walk()
        for _, value in self.options:
            if value is not None:
                yield from value.walk()


@dataclass(slots=True)
class Cursor:
    """Walks over the tokens of one statement."""

    source: Source
    tokens: list[Token]
    at: int = 0
    depth: int = 0

    @property
    def token(self) -> Token:
        return self.tokens[self.at]

    def take(self) -> Token:
        token = self.tokens[self.at]
        if token.kind != "end":
            self.at += 1
        return token

    def accept(self, *words: str) -> bool:
        if self.token.kind in ("mark", "name") and self.token.word in words:
            self.at += 1
            return True
        return False

    def expect(self, word: str, what: str) -> None:
        if not self.accept(word):
            raise self.fail(what)

    def fail(self, expected: str) -> CompstiffError:
        token = self.token
        shown = self.source.text(token.start, min(token.end, token.start + 40))
        here = f"'{shown}'" if token.kind != "end" else "the end of the statement"
        return self.source.fail("CS2003", f"found {here}, expected {expected}", token.start,
                                "the statement is not RAPID as a controller would load it; compare it with its neighbours")


def expression(cursor: Cursor) -> Expr:
    """Parses one expression; what has an operator in it is kind "other"."""
    cursor.depth += 1
    if cursor.depth > _DEEPEST:
        raise cursor.fail("less deeply nested data")
    first = _operand(cursor)
    parts = [first]
    while (cursor.token.kind == "mark" and cursor.token.word in _INFIX) or (
        cursor.token.kind == "name" and cursor.token.word in OPERATORS
    ):
        cursor.take()
        parts.append(_operand(cursor))
    cursor.depth -= 1
    if len(parts) == 1:
        return first
    return Expr("other", first.start, parts[-1].end, items=tuple(parts))


def arguments(
    cursor: Cursor, close: str, names: tuple[str, ...] = ()
) -> tuple[tuple[Expr, ...], tuple[tuple[str, Expr | None], ...]]:
    """Arguments up to and including `close`: required ones, and `\\Name`, `\\Name:=value` ones (names in lower case).

    A comma may or may not stand before a backslash (post-processors write both); between two required arguments it
    must. A required one may have its parameter's name before it, `Tool:=tool0`, in the parameters' order all the same.
    names: of the required parameters, in lower case, where they are known. Raises CS2003, also for another name.
    """
    positional: list[Expr] = []
    options: list[tuple[str, Expr | None]] = []
    wants = False           # behind a comma: an argument has to follow
    free = True             # a positional argument may stand here
    while wants or not cursor.accept(close):
        if cursor.accept("\\"):
            name = cursor.take()
            if name.kind != "name":
                cursor.at -= name.kind != "end"
                raise cursor.fail("the name of an optional argument")
            value = expression(cursor) if cursor.accept(":=", "?") else None
            options.append((name.word, value))
            free = False
        elif free:
            _pass_name(cursor, names, len(positional))
            positional.append(expression(cursor))
            free = False
        else:
            raise cursor.fail(f"',' or '{close}'")
        wants = cursor.accept(",")
        free = free or wants
    return tuple(positional), tuple(options)


def _pass_name(cursor: Cursor, names: tuple[str, ...], index: int) -> None:
    """Passes over `Name:=` before required argument `index`."""
    token = cursor.token
    if token.kind != "name" or cursor.tokens[cursor.at + 1].word != ":=":
        return
    if index < len(names) and token.word != names[index]:
        raise cursor.fail(f"'{names[index]}:=' or the value alone: required arguments stand in the parameters' order")
    cursor.at += 2


def _operand(cursor: Cursor) -> Expr:
    token = cursor.take()
    if token.kind == "number":
        return Expr("number", token.start, token.end, value=float(token.text))
    if token.kind == "string":
        return Expr("string", token.start, token.end)
    if token.kind == "name" and token.word != "not":
        return _name(cursor, token)
    if token.word in ("+", "-"):
        inner = _nested(cursor)
        if inner.kind == "number" and re.match(rb"[\d.]", cursor.source.data[inner.start:inner.start + 1]):
            return Expr("number", token.start, inner.end, value=-inner.value if token.word == "-" else inner.value)
        return Expr("other", token.start, inner.end, items=(inner,))
    if token.word == "not":
        inner = _nested(cursor)
        return Expr("other", token.start, inner.end, items=(inner,))
    if token.word == "[":
        items = [expression(cursor)]
        while cursor.accept(","):
            items.append(expression(cursor))
        end = cursor.token.end
        cursor.expect("]", "',' or ']'")
        return Expr("aggregate", token.start, end, items=tuple(items))
    if token.word == "(":
        inner = expression(cursor)
        end = cursor.token.end
        cursor.expect(")", "')'")
        return Expr("other", token.start, end, items=(inner,))
    if token.word == "*":
        return Expr("star", token.start, token.end)
    if token.word == "<" and cursor.token.kind == "name":       # a placeholder the pendant left: <EXP>
        cursor.take()
        end = cursor.token.end
        cursor.expect(">", "'>'")
        return Expr("other", token.start, end)
    cursor.at -= token.kind != "end"
    raise cursor.fail("a value")


def _nested(cursor: Cursor) -> Expr:
    cursor.depth += 1
    if cursor.depth > _DEEPEST:
        raise cursor.fail("less deeply nested data")
    inner = _operand(cursor)
    cursor.depth -= 1
    return inner


def _name(cursor: Cursor, token: Token) -> Expr:
    start, end, name = token.start, token.end, token.word
    if cursor.accept("("):
        items, options = arguments(cursor, ")", _PARAMETERS.get(name, ()))
        result = Expr("call", start, cursor.tokens[cursor.at - 1].end, name, items=items, options=options)
    elif cursor.accept("{"):
        items, options = arguments(cursor, "}")
        result = Expr("element", start, cursor.tokens[cursor.at - 1].end, name, items=items, options=options)
    else:
        result = Expr("name", start, end, name)
    while cursor.accept("."):                               # a component: p10.trans.x
        part = cursor.take()
        if part.kind != "name":
            cursor.at -= part.kind != "end"
            raise cursor.fail("the name of a component")
        result = Expr("other", start, part.end, items=(result,))
    if cursor.accept("{"):                                  # an array inside a record: r.list{2}
        items, _ = arguments(cursor, "}")
        result = Expr("other", start, cursor.tokens[cursor.at - 1].end, items=(result, *items))
    return result

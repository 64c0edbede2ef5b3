"""Words of RAPID as regular expressions over bytes, and the tokens of one statement.

Possessive quantifiers everywhere: a text that does not match is given up in linear time.
"""

from __future__ import annotations

import re
from typing import NamedTuple

from compensator.rapid.text import Source

BLANK = rb"[\s\x1a]"                                        # \x1a: the end-of-file mark of old editors
COMMENT = rb"![^\r\n]*+"
TRIVIA = rb"(?:" + BLANK + rb"++|" + COMMENT + rb")*+"
SPACE = rb"(?:" + BLANK + rb"++|" + COMMENT + rb")++"       # at least one
NAME = rb"[A-Za-z_\x80-\xff][\w\x80-\xff]*+"                # bytes above 7F: accented letters, Latin-1 or UTF-8
STRING = rb'"(?:[^"\r\n]|"")*+"'
NUMBER = rb"(?:\d++(?:\.\d*+)?+|\.\d++)(?:[Ee][-+]?+\d++)?+"
WORD_END = rb"(?![\w\x80-\xff])"

OPERATORS = frozenset({"and", "or", "xor", "not", "div", "mod"})

_TOKEN = re.compile(
    TRIVIA + rb"(?:(?P<number>" + NUMBER + rb")|(?P<name>" + NAME + rb")|(?P<string>" + STRING
    + rb")|(?P<mark>:=|<=|>=|<>|[\s\S])|(?P<end>\Z))"
)


class Token(NamedTuple):
    """kind: "number", "name", "string", "mark" or "end"; text is the bytes as written, word them in lower case."""

    kind: str
    start: int
    end: int
    text: bytes
    word: str


def tokens(source: Source, start: int, end: int) -> list[Token]:
    """The tokens of source.data[start:end], the last one of kind "end"."""
    parsed = []
    for match in _TOKEN.finditer(source.data, start, end):
        kind = match.lastgroup or "end"
        text = match[kind]
        parsed.append(Token(kind, match.start(kind), match.end(kind), text, source.fold(text)))
        if kind == "end":
            break
    return parsed


def ends_operand(token: Token) -> bool:
    """Whether an operand of an expression can end with this token."""
    if token.kind == "name":
        return token.word not in OPERATORS
    return token.kind in ("number", "string") or token.word in (")", "]", "}")

"""Splits a program into units: one compiled pattern that every part of the text goes through exactly once.

A unit is a statement up to its semicolon, or one of the structure words that carry none (MODULE, PROC ..., IF ... THEN,
CASE ...:, a label). The three forms that make up large milling programs (a move to an inline target, a move to a
named target, the declaration of a robtarget) come first and leave their parts in groups; nothing else in them is
looked at here.
"""

from __future__ import annotations

import re

from compensator.rapid.lexer import COMMENT, NAME, SPACE, STRING, TRIVIA, WORD_END


def _words(*words: bytes) -> bytes:
    return rb"(?i:" + rb"|".join(words) + rb")" + WORD_END


def _body(*stops: bytes) -> bytes:
    """Text up to a semicolon or one of the stop words, over strings and comments."""
    ahead = rb"(?!" + _words(*stops) + rb")" if stops else b""
    return rb'(?:[^;!"A-Za-z_\x80-\xff]++|' + STRING + rb"|" + COMMENT + rb"|" + ahead + NAME + rb")*+"


# What may stand for a number; whether it is one is decided when it is converted, in bulk.
_TIGHT = rb"[-+.0-9eE]++"          # 0-9, not \d: a class within a set is looked up by itself
_FIGURE = rb"\s*+" + _TIGHT + rb"\s*+"


def _figures(count: int, figure: bytes) -> bytes:
    return rb"\[" + rb",".join([figure] * count) + rb"\]\s*+"


def _pose(figure: bytes = _FIGURE) -> bytes:
    return rb"\[\s*+" + _figures(3, figure) + rb",\s*+" + _figures(4, figure)


def _rest(figure: bytes = _FIGURE) -> bytes:
    return _figures(4, figure) + rb",\s*+" + _figures(6, figure) + rb"\]"


LITERAL = re.compile(rb"(?P<pose>" + _pose() + rb"),\s*+(?P<rest>" + _rest() + rb")")
"""A robtarget written in numbers without comments: position and orientation, then confdata and external axes."""

_PARAMETERS = rb"\((?:[^()!\"]++|" + COMMENT + rb"|\([^()]*+\))*+\)"
_ROUTINE = (
    rb"(?:(?i:LOCAL)" + SPACE + rb")?+(?:(?i:PROC)" + SPACE + NAME + rb"|(?i:FUNC)" + SPACE + NAME + SPACE + NAME
    + rb"|(?i:TRAP)" + SPACE + NAME + rb")(?:" + TRIVIA + _PARAMETERS + rb")?+"
)
_RECORD_STOPS = (rb"ENDRECORD", rb"RECORD", rb"PROC", rb"MODULE", rb"ENDMODULE")
_RECORD = (
    rb"(?:(?i:LOCAL)" + SPACE + rb")?+" + _words(rb"RECORD") + rb"(?:" + _body(*_RECORD_STOPS) + rb";)*+"
    + TRIVIA + _words(rb"ENDRECORD")
)


def _inline(figure: bytes = _FIGURE) -> bytes:
    return (rb"(?i:Move)(?P<way>[LJlj])\s*+(?P<pose>" + _pose(figure) + rb"),\s*+(?P<rest>" + _rest(figure)
            + rb")\s*+,(?P<tail>[^;!\"]*+);")


def _ungrouped(pattern: bytes) -> bytes:
    return re.sub(rb"\(\?P<\w+>", rb"(?:", pattern)


INLINE = re.compile(_inline())
"""One move to an inline target."""

_UNITS = {
    # Such moves one after the other, with blanks alone between them; figures mostly have none around them.
    "inline": rb"(?:(?:" + _ungrouped(_inline(_TIGHT)) + rb"|" + _ungrouped(_inline()) + rb")\s*+){1,20000}+",
    "named": rb"(?i:Move)(?P<way2>[LJlj])\s++(?P<target>" + NAME + rb")\s*+,(?P<tail2>[^;!\"]*+);",
    "target": rb"(?P<reach>(?i:LOCAL\s++|TASK\s++)?+)(?P<class>(?i:CONST|PERS|VAR))\s++(?i:robtarget)\s++"
              rb"(?P<name>" + NAME + rb")\s*+:=\s*+(?P<value>" + _pose() + rb",\s*+" + _rest() + rb")\s*+;",
    "header": rb"%%%[^%]{0,2000}+%%%",
    "module": _words(rb"MODULE") + SPACE + NAME + rb"(?:" + TRIVIA + rb"\([^()\";]*+\))?+",
    "endmodule": _words(rb"ENDMODULE"),
    "routine": _ROUTINE,
    "endroutine": _words(rb"ENDPROC", rb"ENDFUNC", rb"ENDTRAP"),
    "word": _words(rb"ENDIF", rb"ENDFOR", rb"ENDWHILE", rb"ENDTEST", rb"ELSE", rb"UNDO", rb"BACKWARD")
            + rb"|" + _words(rb"ERROR") + rb"(?:" + TRIVIA + rb"\([^();\"]*+\))?+",
    "record": _RECORD,
    "condition": rb"(?:" + _words(rb"IF", rb"ELSEIF") + _body(rb"THEN") + _words(rb"THEN")
                 + rb"|" + _words(rb"FOR", rb"WHILE") + _body(rb"DO") + _words(rb"DO")
                 + rb"|" + _words(rb"TEST") + _body(rb"CASE", rb"DEFAULT", rb"ENDTEST")
                 + rb"|" + _words(rb"CASE") + rb'(?:[^:;!"]++|' + STRING + rb"|" + COMMENT + rb")*+:)",
    "label": NAME + TRIVIA + rb":(?!=)",
    "placeholder": rb"<[A-Za-z]{2,3}>",
    "statement": _body() + rb";",
    "bad": rb"[\s\S]",
    "end": rb"\Z",
}

UNIT = re.compile(TRIVIA + rb"(?:" + b"|".join(rb"(?P<u_%b>%b)" % (k.encode(), v) for k, v in _UNITS.items()) + rb")")
"""Trivia, then one unit; `lastgroup` is "u_" and the name of its kind."""

BODY = re.compile(_body())

"""The pass over the text.

The three common forms (inline target, named target, declared robtarget) cost a few appends each and nothing is parsed
twice: tails and names are kept once per spelling. Everything else goes through `Statements`.
"""

from __future__ import annotations

import re

from compensator.rapid.expressions import Cursor
from compensator.rapid.inline_moves import inline_moves
from compensator.rapid.lexer import tokens
from compensator.rapid.moves import parse_tail
from compensator.rapid.scan import Scan
from compensator.rapid.scopes import Declaration
from compensator.rapid.statements import BODY, UNIT
from compensator.rapid.structure import Statements
from compensator.rapid.text import Source
from compensator.toolpath import Move

_WAY = {b"L": Move.LINEAR, b"l": Move.LINEAR, b"J": Move.JOINT, b"j": Move.JOINT}
_END_OF_MODULE = re.compile(rb"(?i)\bENDMODULE\b")
_MOTION_WORD = re.compile(rb"(?i)\bMove(?:[LJC](?:DO)?|AbsJ)\s")


def scan(source: Source) -> Scan:
    """Reads the text once. Raises CS2002 (a string or move that does not end), CS2003 (a malformed move), CS2050 (a module or
    routine that does not end)."""
    scanned = Scan(source)
    statements = Statements(scanned)
    stands: dict[bytes, int] = {}       # where the spelling of a tail stands first
    tails: dict[int, int] = {}          # the number of the tail there
    move, start, rest, end = scanned.move.append, scanned.start.append, scanned.rest.append, scanned.end.append
    name, tail = scanned.name.append, scanned.tail.append

    def read_tails(known: int) -> None:
        for text in list(stands)[known:]:
            at = stands[text]
            tails[at] = scanned.add_tail(parse_tail(Cursor(source, tokens(source, at, at + len(text) + 1))))

    for match in UNIT.finditer(source.data, source.start):
        kind = match.lastgroup
        if kind == "u_inline":
            found = inline_moves(source.data, *match.span(kind))
            known, data = len(stands), source.data
            first = [stands.setdefault(data[at:stop], at)
                     for at, stop in zip(found.tail.tolist(), found.stop.tolist(), strict=True)]
            read_tails(known)
            scanned.tail.extend(map(tails.__getitem__, first))
            scanned.add_inline(found)
        elif kind == "u_named":
            known = len(stands)
            at = stands.setdefault(match["tail2"], match.start("tail2"))
            if len(stands) > known:
                read_tails(known)
            tail(tails[at])
            move(_WAY[match["way2"]])
            start(match.start("target"))
            rest(-1)
            end(match.end("target"))
            name(scanned.spelling(match["target"]))
        elif kind == "u_target":
            value = match.span("value")
            scanned.names.add(Declaration(
                source.fold(match["name"]), "robtarget", match["class"].lower().decode(),
                match["reach"].strip().lower().decode(), scanned.scope, match.start(kind), match.end(kind), *value))
        elif kind == "u_end":
            break
        elif kind == "u_bad":
            scanned.stray = _stray(source, match.start(kind))
            break
        else:
            assert kind is not None
            statements.unit(kind[2:], match.start(kind), match.end(kind))
    if scanned.stray < 0 or not _END_OF_MODULE.search(source.data, scanned.stray):
        statements.module_ends()
    return scanned


def _stray(source: Source, at: int) -> int:
    """`at`, where text without a semicolon begins; raises when it holds a string or a move that does not end."""
    body = BODY.match(source.data, at)
    stop = body.end() if body else at
    if source.data[stop:stop + 1] == b'"':
        raise source.fail("CS2002", "the string that begins here does not end on its line, expected '\"'", stop,
                          "close the string; a quote inside a string is written twice")
    motion = _MOTION_WORD.search(source.data, at)
    if motion:
        raise source.fail("CS2002", "the statement that begins here does not end, expected ';'", motion.start(),
                          "the file may have been cut off; write it again from the CAM system")
    return at



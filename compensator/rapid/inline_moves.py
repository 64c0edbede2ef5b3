"""Where the parts of many moves to inline targets stand, found by the brackets and semicolons of all of them at once."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from compensator.rapid.statements import INLINE
from compensator.rapid.text import Offsets, where_is
from compensator.toolpath import Move

# Fewer bytes than this are gone through move by move, which is faster then.
_FEW = 4096
_WAY = bytearray(256)
for letter, move in (("L", Move.LINEAR), ("l", Move.LINEAR), ("J", Move.JOINT), ("j", Move.JOINT)):
    _WAY[ord(letter)] = move
_WAYS = np.frombuffer(bytes(_WAY), dtype=np.uint8)
_BLANK = np.zeros(256, dtype=bool)
_BLANK[list(b" \t\r\n\f\v")] = True


@dataclass(frozen=True, slots=True, eq=False)
class InlineMoves:
    """K moves in the order of the text: way (K,) as `Move`, offsets (K,) of the target, of its confdata, behind it, and of the
    tail, which ends before the semicolon `stop` (K,)."""

    way: bytes
    start: Offsets
    rest: Offsets
    end: Offsets
    tail: Offsets
    stop: Offsets


def inline_moves(data: bytes, first: int, behind: int) -> InlineMoves:
    """The moves in data[first:behind], which is one unit of the kind "inline" (statements.py)."""
    if behind - first < _FEW:
        found = list(INLINE.finditer(data, first, behind))
        columns = (np.array([match.start("pose") for match in found]), np.array([match.start("rest") for match in found]),
                   np.array([match.end("rest") for match in found]), np.array([match.start("tail") for match in found]),
                   np.array([match.end("tail") for match in found]))
        return InlineMoves(bytes(_WAY[match["way"][0]] for match in found), *columns)
    letters = np.frombuffer(data, dtype=np.uint8, count=behind - first, offset=first)
    stop, opening, closing = (where_is(letters, ord(letter)) for letter in ";[]")
    begin = np.append(0, stop[:-1] + 1)
    # [[x,y,z],[q1,q2,q3,q4],[cf1,cf4,cf6,cfx],[eax_a,...,eax_f]]: the tail may have brackets of its own.
    pose = np.searchsorted(opening, begin)
    start, rest = opening[pose], opening[pose + 3]
    end = closing[np.searchsorted(closing, begin) + 4] + 1
    # Blanks may stand before the bracket and before the comma.
    way = start - 1
    while (blank := _BLANK[letters[way]]).any():
        way = way - blank
    comma = end
    while (blank := _BLANK[letters[comma]]).any():
        comma = comma + blank
    return InlineMoves(_WAYS[letters[way]].tobytes(), first + start, first + rest, first + end, first + comma + 1, first + stop)

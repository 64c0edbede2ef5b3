"""What one pass over a program finds: its targets as columns, its declarations, and what else it does with names."""

from __future__ import annotations

from array import array
from bisect import bisect_right
from dataclasses import dataclass, field

import numpy as np

from compensator.rapid.blocks import Routine, Step
from compensator.rapid.expressions import Expr
from compensator.rapid.inline_moves import InlineMoves
from compensator.rapid.moves import Tail
from compensator.rapid.runtime import Parameter
from compensator.rapid.scopes import Names, Scope
from compensator.rapid.text import Source
from compensator.rapid.uses import Uses
from compensator.toolpath import Move


@dataclass(frozen=True, slots=True)
class Round:
    """A loop of one MoveL to an element of an array each turn: its targets first ... stop - 1, the number of the array's
    declaration, the span of the loop, and those of the numbers from and to which it counts by one; the second is missing where
    that is the size of the array."""

    first: int
    stop: int
    array: int
    start: int
    end: int
    bounds: tuple[tuple[int, int], ...]

    def elements(self, data: bytes, size: int) -> range:
        """The elements, from 1, of an array of such a size."""
        low, high = *(int(data[start:end]) for start, end in self.bounds), *(2 - len(self.bounds)) * [size]
        return range(low, high + 1)


@dataclass(slots=True)
class Scan:
    """What one pass found. Columns hold one entry a target, in the order of the text.

    start, end: span of the target's expression. rest: offset of its confdata where it is written in numbers, else -1.
    name: number in `spellings` where it is just a name, else -1. `expressions` holds the others by target.
    scopes, shifts, softened, offsets: (first target, value) from which on the scope holds, the program is displaced, its servo
    soft, or the external axes displaced. units: (first target, name of a mechanical unit, whether it is on, offset) of each
    switch. looped: targets to which a move in a loop drives, one each turn (unrolled.py). handed: targets that calls hand over,
    one each call, and why they cannot be corrected, "" where they can; referred: those that are handed over by reference;
    alone: those whose call is one move and nothing else, and the span of that call (handed_targets.py). rounds: the loops, in
    the order of the text, whose array may grow (growing.py).
    """

    source: Source
    names: Names = field(default_factory=Names)
    uses: Uses = field(default_factory=Uses)
    routines: dict[str, list[Parameter]] = field(default_factory=dict)
    bodies: list[Routine] = field(default_factory=list)
    move: bytearray = field(default_factory=bytearray)
    start: array[int] = field(default_factory=lambda: array("q"))
    rest: array[int] = field(default_factory=lambda: array("q"))
    end: array[int] = field(default_factory=lambda: array("q"))
    name: array[int] = field(default_factory=lambda: array("i"))
    tail: array[int] = field(default_factory=lambda: array("i"))
    tails: list[Tail] = field(default_factory=list)
    spellings: dict[str, int] = field(default_factory=dict)
    expressions: dict[int, Expr] = field(default_factory=dict)
    scopes: list[tuple[int, Scope]] = field(default_factory=lambda: [(0, Scope(0, -1))])
    shifts: list[tuple[int, bool]] = field(default_factory=lambda: [(0, False)])
    looped: set[int] = field(default_factory=set)
    handed: dict[int, str] = field(default_factory=dict)
    referred: set[int] = field(default_factory=set)
    alone: dict[int, tuple[int, int]] = field(default_factory=dict)
    rounds: list[Round] = field(default_factory=list)
    softened: list[tuple[int, bool]] = field(default_factory=lambda: [(0, False)])
    offsets: list[tuple[int, bool]] = field(default_factory=lambda: [(0, False)])
    units: list[tuple[int, str, bool, int]] = field(default_factory=list)
    others: list[tuple[str, int]] = field(default_factory=list)     # further motion instructions: name, offset
    overridden: list[tuple[Step, Scope]] = field(default_factory=list)      # each VelSet, SpeedRefresh
    modules: list[int] = field(default_factory=list)                # where each MODULE begins
    unmonitored: bool = False                                       # ConfL\\Off stands somewhere
    stray: int = -1                                                 # offset of text that is no statement
    _known_tails: dict[tuple[object, ...], int] = field(default_factory=dict)

    @property
    def scope(self) -> Scope:
        return self.scopes[-1][1]

    def enter(self, scope: Scope) -> None:
        self.scopes.append((len(self.move), scope))

    def read_expressions(self) -> None:
        """Logs every name that a target's expression reads, but for an array of which it names an element by its number."""
        firsts = [first for first, _ in self.scopes]
        for target, expr in self.expressions.items():
            if expr.kind != "element" or any(index.kind != "number" for index in expr.items):
                scope = self.scopes[bisect_right(firsts, target) - 1][1]
                self.uses.read.update((part.name, scope) for part in expr.walk() if part.name)

    def spelling(self, word: bytes) -> int:
        return self.spellings.setdefault(self.source.fold(word), len(self.spellings))

    def add_tail(self, tail: Tail) -> int:
        """The number of a tail; tails that are spelled alike share one."""
        data = self.source.data
        parts = (tail.speed, tail.zone, tail.tool, tail.workobject, tail.velocity, tail.radius, tail.signal, tail.value)
        key = (*(part and data[part.start:part.end] for part in parts), tail.timed, tail.stops, tail.corrected,
               tail.together)
        number = self._known_tails.setdefault(key, len(self.tails))
        if number == len(self.tails):
            self.tails.append(tail)
        return number

    def add_inline(self, moves: InlineMoves) -> None:
        """Targets of moves to inline targets, but for their tails."""
        self.move += moves.way
        for column, offsets in ((self.start, moves.start), (self.rest, moves.rest), (self.end, moves.end)):
            column.frombytes(offsets.astype(np.int64).tobytes())
        self.name.frombytes(np.full(len(moves.way), -1, dtype=np.intc).tobytes())

    def add_target(self, move: Move, expr: Expr, tail: int) -> None:
        """A target that did not come by one of the common forms."""
        if expr.kind == "name":
            name = self.spellings.setdefault(expr.name, len(self.spellings))
        else:
            name = -1
            self.expressions[len(self.move)] = expr
        self.move.append(move)
        self.start.append(expr.start)
        self.rest.append(-1)
        self.end.append(expr.end)
        self.name.append(name)
        self.tail.append(tail)

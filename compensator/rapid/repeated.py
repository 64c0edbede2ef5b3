"""Moves of the text that drive to other targets each time, as targets of their own: turns of a loop, calls of a routine."""

from __future__ import annotations

from array import array
from bisect import bisect_right
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import accumulate
from typing import TypeVar

import numpy as np

from compensator.rapid.expressions import Expr
from compensator.rapid.scan import Scan

_Entry = TypeVar("_Entry", bound=tuple[object, ...])


@dataclass(frozen=True, slots=True)
class Repeated:
    """Targets first ... stop - 1 of the text; turns: the expressions of these at each time."""

    first: int
    stop: int
    turns: list[list[Expr]]

    @property
    def more(self) -> int:
        return (len(self.turns) - 1) * (self.stop - self.first)


def repeat(scan: Scan, repeats: Sequence[Repeated]) -> list[range]:
    """Gives each time targets of its own, which stand where their expression does; the numbers of the targets of each of the
    repeated, which stand in the order of the text. The steps of routines stay as they are."""
    take, expressions, ranges = _targets(scan, repeats)
    for name in ("start", "rest", "end", "name", "tail"):
        column: array[int] = getattr(scan, name)
        setattr(scan, name, array(column.typecode, np.frombuffer(column, dtype=column.typecode)[take].tolist()))
    scan.move = bytearray(np.frombuffer(scan.move, dtype=np.uint8)[take].tobytes())
    for target in (target for targets in ranges for target in targets):
        expr = expressions[target]
        scan.start[target], scan.end[target], scan.name[target] = expr.start, expr.end, -1
    scan.expressions = expressions
    for name in ("scopes", "shifts", "softened", "offsets", "units"):
        setattr(scan, name, _moved(getattr(scan, name), places(repeats)))
    return ranges


def _targets(scan: Scan, repeats: Sequence[Repeated]) -> tuple[np.ndarray, dict[int, Expr], list[range]]:
    """Which target of the text each is, its expression where it has one, and those of the repeated."""
    take: list[np.ndarray] = []
    expressions: dict[int, Expr] = {}
    ranges = []
    at = number = 0
    for repeated in repeats:
        take.append(np.arange(at, repeated.first))
        number += repeated.first - at
        begin = number
        for turn in repeated.turns:
            take.append(np.arange(repeated.first, repeated.stop))
            expressions.update(enumerate(turn, number))
            number += len(turn)
        ranges.append(range(begin, number))
        at = repeated.stop
    take.append(np.arange(at, len(scan.move)))
    inside = {target for repeated in repeats for target in range(repeated.first, repeated.stop)}
    place = places(repeats)
    expressions.update((place(target), expr) for target, expr in scan.expressions.items() if target not in inside)
    return np.concatenate(take), expressions, ranges


def places(repeats: Sequence[Repeated]) -> Callable[[int], int]:
    """The place of a target, or of what stands before it, with all times."""
    stops = [repeated.stop for repeated in repeats]
    more = [0, *accumulate(repeated.more for repeated in repeats)]
    return lambda target: target + more[bisect_right(stops, target)]


def _moved(entries: list[_Entry], place: Callable[[int], int]) -> list[_Entry]:
    return [type(entry)((place(int(str(entry[0]))), *entry[1:])) for entry in entries]

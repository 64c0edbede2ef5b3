"""Moves of the text that drive to other targets each time, as targets of their own: turns of a loop, calls of a routine."""

from __future__ import annotations

from array import array
from bisect import bisect_left
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import accumulate
from typing import Any

import numpy as np
from numpy.typing import NDArray

from compensator.rapid.expressions import Expr
from compensator.rapid.scan import Scan

Indices = NDArray[np.intp]


@dataclass(frozen=True, slots=True)
class Time:
    """Targets first ... stop - 1 of the text as they are driven one time: their expressions; at: the target of the text before
    which they stand then; start: the offset of the loop or call that leads to them."""

    first: int
    stop: int
    exprs: list[Expr]
    at: int
    start: int


class Places:
    """Where what stands in a text of so many targets stands once each of these times, in their order, has targets of its own,
    which those in the text give way to."""

    def __init__(self, times: Sequence[Time], count: int) -> None:
        kept = np.ones(count, dtype=bool)
        for first, stop in {(time.first, time.stop) for time in times}:
            kept[first:stop] = False
        self._kept = np.insert(np.cumsum(kept), 0, 0)
        self._at = [time.at for time in times]
        self._more = [0, *accumulate(len(time.exprs) for time in times)]
        self.stay: Indices = np.flatnonzero(kept)

    def __call__(self, target: int, times: int | None = None) -> int:
        """That of what stands before a target of the text, and behind so many times: None, behind those that stand before an
        earlier target."""
        return int(self._kept[target]) + self._more[bisect_left(self._at, target) if times is None else times]

    @property
    def stayed(self) -> Indices:
        """The places of the targets `stay` of the text that stay (n,)."""
        behind = np.searchsorted(np.array(self._at, dtype=np.intp), self.stay, side="right")
        return np.asarray(self._kept[self.stay] + np.array(self._more)[behind], dtype=np.intp)

    def of_time(self, number: int) -> range:
        """The targets of one time."""
        begin = int(self._kept[self._at[number]]) + self._more[number]
        return range(begin, begin + self._more[number + 1] - self._more[number])


def repeat(scan: Scan, times: Sequence[Time]) -> Places:
    """Gives each time, in the order of the text, targets of its own, which stand where their expression does. The steps of
    routines stay as they are."""
    count = len(scan.move)
    places = Places(times, count)
    stayed = places.stayed
    take = np.empty(len(stayed) + sum(len(time.exprs) for time in times), dtype=np.intp)
    take[stayed] = places.stay
    for number, time in enumerate(times):
        take[places.of_time(number)] = np.arange(time.first, time.stop)
    for name in ("start", "rest", "end", "name", "tail"):
        column: array[int] = getattr(scan, name)
        setattr(scan, name, array(column.typecode, np.frombuffer(column, dtype=column.typecode)[take].tolist()))
    scan.move = bytearray(np.frombuffer(scan.move, dtype=np.uint8)[take].tobytes())
    for name in ("scopes", "shifts", "softened", "offsets"):
        setattr(scan, name, _still_in_force(getattr(scan, name), take, count))
    starts = [time.start for time in times]
    scan.units = [(places(first, bisect_left(starts, start)), name, on, start) for first, name, on, start in scan.units]
    now = dict(zip(places.stay.tolist(), stayed.tolist(), strict=True)) if scan.expressions or scan.looped else {}
    scan.rounds = [replace(one, first=now[one.first], stop=now[one.stop - 1] + 1) for one in scan.rounds]
    scan.looped = {now[target] for target in scan.looped if target in now}
    scan.expressions = {now[target]: expr for target, expr in scan.expressions.items() if target in now}
    for number, time in enumerate(times):
        for target, expr in zip(places.of_time(number), time.exprs, strict=True):
            scan.expressions[target] = expr
            scan.start[target], scan.end[target], scan.name[target] = expr.start, expr.end, -1
    return places


def _still_in_force(entries: list[tuple[int, Any]], take: Indices, count: int) -> list[tuple[int, Any]]:
    """What holds from which target on, so that what holds for target k now is what held for target take[k] of the text."""
    first = np.array([target for target, _ in entries])
    number = np.searchsorted(first, np.arange(count), side="right") - 1
    held = number[take]
    change = np.flatnonzero(np.diff(held, prepend=-1))
    return [(target, entries[held[target]][1]) for target in change.tolist()] if len(take) else entries

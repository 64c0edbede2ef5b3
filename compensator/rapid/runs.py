"""A run of a program: the targets as they are driven, and the ways that it may go."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Mask = NDArray[np.bool_]
Indices = NDArray[np.intp]


class Driven(NamedTuple):
    """Targets first ... stop - 1 as they are driven; switched: what is on then; start: offset of the call that led there, -1
    for none."""

    first: int
    stop: int
    switched: frozenset[str]
    start: int


class Taken(NamedTuple):
    """A branch of unknown condition, as it is taken on one way. start: offset of the word of the branch, or of the IF or TEST
    none of whose branches is; stated: by the values in the file; turns: of a loop, as often as it is driven."""

    start: int
    none: bool
    stated: bool
    turns: int | None = None


def covered(stretches: Iterable[tuple[int, int]]) -> int:
    """How many targets stand in stretches first ... stop - 1, which may lie on each other."""
    count = end = 0
    for first, stop in sorted(stretches):
        count += max(0, stop - max(first, end))
        end = max(end, stop)
    return count


@dataclass(frozen=True, slots=True)
class Way:
    """One way that the program may go: targets first ... stop - 1, then those of the next stretch; and the branches taken."""

    stretches: tuple[tuple[int, int], ...]
    taken: tuple[Taken, ...]

    @property
    def order(self) -> Indices:
        """The targets (D,) in the order in which they are driven."""
        return np.concatenate([np.arange(0), *(np.arange(first, stop) for first, stop in self.stretches)])

    @property
    def stated(self) -> bool:
        """Whether the values in the file lead along it."""
        return all(branch.stated for branch in self.taken)


@dataclass(frozen=True, slots=True)
class Runs:
    """One run of a program: its stretches in the order in which they are driven, of branches that are not known all of them.
    ways: those it may go, that of the file's values first; none where the text does not settle how often moves are driven.
    open: they are too many to follow; unsettled: offset of what they cannot be followed through, -1 for nothing. uncounted:
    targets one behind the other between which the program drives to others, which are not counted (TriggL, SearchL). besides:
    stretches of further turns or branches, which tell what may be switched on there."""

    driven: tuple[Driven, ...]
    count: int
    ways: tuple[Way, ...] = ()
    open: bool = False
    unsettled: int = -1
    uncounted: tuple[tuple[int, int], ...] = ()
    besides: frozenset[Driven] = frozenset()

    def under(self, what: str) -> Mask:
        """The targets (N,) that may be driven while this is on: "displaced", "soft", "offset" (moves.py: SWITCHES)."""
        within = np.zeros(self.count, dtype=bool)
        for stretch in (*self.driven, *self.besides):
            within[stretch.first:stretch.stop] |= what in stretch.switched
        return within

    @property
    def times(self) -> Indices:
        """How often each target (N,) is driven; two stand for several."""
        change = np.zeros(self.count + 1, dtype=np.intp)
        for stretch in self.driven:
            change[stretch.first] += 1
            change[stretch.stop] -= 1
        times = np.cumsum(change)[:-1]
        if len(self.ways) == 1:             # where the text settles it a WHILE may go round more often than `driven` shows
            times = np.maximum(times, np.minimum(np.bincount(self.ways[0].order, minlength=self.count), 2))
        return times

    @property
    def order(self) -> Indices | None:
        """The targets (D,) in the order in which they are driven; None where that is the order of the text, or is not sure."""
        if not self.ways or not (len(self.ways) == 1 or self.ways[0].stated):
            return None
        way = self.ways[0]
        return None if way.stretches in ((), ((0, self.count),)) else way.order

    def calls_of(self, which: Mask) -> list[int]:
        """Offsets of the calls that lead to some of the targets `which` (N,), each once, in the order of the run."""
        return list(dict.fromkeys(stretch.start for stretch in self.driven
                                  if stretch.start >= 0 and which[stretch.first:stretch.stop].any()))

    def first_back(self, which: Mask) -> Driven | None:
        """The first stretch with some of the targets `which` (N,) that stands in the text before one driven earlier."""
        furthest = 0
        for stretch in self.driven:
            if which[stretch.first:stretch.stop].any():
                if stretch.first < furthest:
                    return stretch
                furthest = stretch.stop
        return None

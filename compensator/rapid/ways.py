"""The ways that a program may go where its text does not settle it: each branch, and each number of a loop's turns, is one."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field

from compensator.rapid.runs import Driven, Taken, Way

# No more ways are gone.
MOST_WAYS = 64
# Loops of unknown turns are tried with so many, beside the number in the file, where there are so many of them.
TURNS = ((1, 2, 3, 4, 5, 6, 7, 8, 0), (1, 2, 3, 4, 0), (1, 2, 0))


class Open(Exception):
    """The text does not settle which moves are driven, or how often. many: since it leaves too many ways; start: offset of what
    cannot be followed."""

    def __init__(self, start: int = -1, *, many: bool = False) -> None:
        self.start = start
        self.many = many


@dataclass(slots=True)
class Choices:
    """What is chosen on one way, choice by choice. given: the first of them, by their numbers; behind them the way takes what
    the file's values lead to. options: how many there were; taken: of those that are branches or turns, which."""

    given: tuple[int, ...] = ()
    made: list[int] = field(default_factory=list)
    options: list[int] = field(default_factory=list)
    taken: list[Taken] = field(default_factory=list)

    def choose(self, options: int, usual: int) -> int:
        """Which of so many ways is gone on, the usual one where nothing is given. Raises Open: too many."""
        number = len(self.made)
        if number > MOST_WAYS:
            raise Open(many=True)
        choice = self.given[number] if number < len(self.given) else usual
        self.made.append(choice)
        self.options.append(options)
        return choice

    def turns(self, start: int, stated: int | None, open_loops: int) -> int:
        """How often a loop is driven that nobody counts. start: offset of its word; stated: so often by the file's values, None
        where they do not tell; open_loops: how many such loops the program has. Raises Open: too many ways."""
        tried: tuple[int, ...] = TURNS[min(open_loops, len(TURNS)) - 1]
        counts = tried if stated is None or stated in tried else (*tried, stated)
        count = counts[self.choose(len(counts), 0 if stated is None else counts.index(stated))]
        self.taken.append(Taken(start, False, count == stated, count))
        return count

    def others(self) -> list[tuple[int, ...]]:
        """What else could have been chosen behind what was given, one choice other and none behind it."""
        return [(*self.made[:at], other) for at in range(len(self.given), len(self.made))
                for other in range(self.options[at]) if other != self.made[at]]


def ways_of(drive: Callable[[Choices], Sequence[Driven]]) -> tuple[Way, ...]:
    """The ways that differ in what is driven, the file's own first. drive: the program, by its choices. Raises Open."""
    found: dict[tuple[tuple[int, int], ...], Way] = {}
    waiting: list[tuple[int, ...]] = [()]
    done = 0
    while waiting:
        choices = Choices(waiting.pop())
        done += 1
        stretches = _stretches(drive(choices))
        found.setdefault(stretches, Way(stretches, tuple(choices.taken)))
        waiting += choices.others()
        if done + len(waiting) > MOST_WAYS:
            raise Open(many=True)
    return tuple(sorted(found.values(), key=lambda way: not way.stated))


def _stretches(driven: Iterable[Driven]) -> tuple[tuple[int, int], ...]:
    """Targets first ... stop - 1 as they are driven, those that follow each other as one."""
    merged: list[tuple[int, int]] = []
    for stretch in driven:
        if merged and merged[-1][1] == stretch.first:
            merged[-1] = (merged[-1][0], stretch.stop)
        else:
            merged.append((stretch.first, stretch.stop))
    return tuple(merged)

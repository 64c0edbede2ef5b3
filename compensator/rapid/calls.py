"""The order in which a program drives its moves, by the calls of its routines: which moves are driven more than once, not at
all, in another order than they stand in the text, or under what a caller switched: a displacement, a soft servo.

Told by what the text shows: branches are taken as driven, WHILE as one turn (the cell that waits for the next part) unless it
counts, error handlers and trap routines as not driven; calls by a name that is made at run time are not followed.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from compensator.rapid.moves import DISPLACEMENT, SOFT_SERVO

Mask = NDArray[np.bool_]
# No more calls are followed: routines that call each other double with every level.
MOST = 20_000
# Nor are calls within calls beyond this; and of a loop's turn with more stretches than this each counts once: loops within
# loops double them with every level.
DEEPEST, LONGEST_TURN = 200, 1000
# What calls a routine by a name that is made at run time.
LATE = ("%", "callbyvar")


class Step(NamedTuple):
    """A statement that is no move: a call, the switch of a displacement or a soft servo, "for" or "endfor" (of a WHILE that
    counts, too), "handler" where those of errors begin. at: how many targets stand before it in the text; start: its offset;
    branch: whether it stands in an IF or TEST."""

    at: int
    name: str
    start: int
    branch: bool = False


@dataclass(slots=True)
class Routine:
    """One routine of the text: its first target and its steps. kind: "proc", "func" or "trap"."""

    name: str
    first: int
    kind: str = "proc"
    steps: list[Step] = field(default_factory=list)


class Driven(NamedTuple):
    """Targets first ... stop - 1 as they are driven; start: offset of the call that led there, -1 for none."""

    first: int
    stop: int
    displaced: bool
    soft: bool
    start: int


@dataclass(frozen=True, slots=True)
class Runs:
    """One run of a program: its stretches in the order in which they are driven. sure: the text settles which moves are
    driven from these routines on, and how often."""

    driven: tuple[Driven, ...]
    count: int
    sure: bool = False

    @property
    def displaced(self) -> Mask:
        """The targets (N,) that a displacement shifts when they are driven."""
        return self._within(stretch for stretch in self.driven if stretch.displaced)

    @property
    def soft(self) -> Mask:
        """The targets (N,) that are driven while the controller gives way."""
        return self._within(stretch for stretch in self.driven if stretch.soft)

    def _within(self, stretches: Iterable[Driven]) -> Mask:
        within = np.zeros(self.count, dtype=bool)
        for stretch in stretches:
            within[stretch.first:stretch.stop] = True
        return within

    @property
    def times(self) -> NDArray[np.intp]:
        """How often each target (N,) is driven; two stand for several."""
        change = np.zeros(self.count + 1, dtype=np.intp)
        for stretch in self.driven:
            change[stretch.first] += 1
            change[stretch.stop] -= 1
        return np.cumsum(change)[:-1]

    @property
    def order(self) -> NDArray[np.intp] | None:
        """The targets (D,) in the order in which they are driven; None where that is the order of the text, or is not sure."""
        if not self.sure or not self.driven:
            return None
        order = np.concatenate([np.arange(stretch.first, stretch.stop) for stretch in self.driven])
        return None if np.array_equal(order, np.arange(self.count)) else order

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


def runs_of(routines: list[Routine], count: int) -> Runs:
    """How the program drives its `count` targets: from its routine main, or from all routines that no other calls but those of
    traps."""
    numbers = {routine.name: number for number, routine in reversed(list(enumerate(routines)))}
    called = {numbers[step.name] for routine in routines for step in routine.steps if step.name in numbers}
    roots = [number for number, routine in enumerate(routines) if number not in called and routine.kind != "trap"]
    main = numbers.get("main", -1)
    run = _Run(routines, numbers, count)
    for root in [main] if main in roots else roots:
        run.drive(root, -1)
    # A function is called where its value is asked for, which is not looked at.
    moving = any(routine.kind == "func" and run.stop(number) > routine.first for number, routine in enumerate(routines))
    return Runs(tuple(run.driven), count, len(numbers) == len(routines) and run.sure and not moving)


@dataclass(slots=True)
class _Run:
    """The state of the program while it is followed."""

    routines: list[Routine]
    numbers: dict[str, int]
    count: int
    displaced: bool = False
    soft: bool = False
    sure: bool = True
    calls: int = 0
    driven: list[Driven] = field(default_factory=list)
    under_way: list[int] = field(default_factory=list)

    def stop(self, number: int) -> int:
        """The first target behind a routine."""
        return self.routines[number + 1].first if number + 1 < len(self.routines) else self.count

    def drive(self, number: int, start: int) -> None:
        if number in self.under_way or len(self.under_way) >= DEEPEST or self.calls > MOST:
            self.sure = False
            return
        self.calls += 1
        routine = self.routines[number]
        handler = next((k for k, step in enumerate(routine.steps) if step.name == "handler"), len(routine.steps))
        stop = routine.steps[handler].at if handler < len(routine.steps) else self.stop(number)
        self.under_way.append(number)
        self._body([*routine.steps[:handler], Step(stop, "endfor", -1)], routine.first, start)
        self.under_way.pop()

    def _body(self, steps: Iterable[Step], first: int, start: int) -> None:
        """Drives on from target `first` to the end of the routine."""
        in_branches: set[str] = set()
        loops: list[tuple[int, set[str]]] = []
        for step in steps:
            if step.at > first:
                self.driven.append(Driven(first, step.at, self.displaced, self.soft, start))
            first = step.at
            if step.name == "endfor" and not loops:
                break
            if step.name == "endfor":
                begin, in_branches = loops.pop()
                self._again(begin)
            elif step.name == "for":
                loops.append((len(self.driven), in_branches))
                in_branches = set()
            elif step.name in LATE:
                self.sure = False
            elif step.name in DISPLACEMENT:
                self.displaced = DISPLACEMENT[step.name]
            elif step.name in SOFT_SERVO:
                self.soft = SOFT_SERVO[step.name]
            elif step.name in self.numbers and not (step.branch and step.name in in_branches):
                # Of several branches that call the same routine one is taken.
                in_branches |= {step.name} if step.branch else set()
                self.drive(self.numbers[step.name], step.start)
        for begin, _ in reversed(loops):        # loops that the text does not close
            self._again(begin)

    def _again(self, begin: int) -> None:
        """Drives once more what was driven in a loop, from the stretch number `begin` on; two turns stand for several."""
        turn = self.driven[begin:]
        self.sure &= not turn
        if len(turn) > LONGEST_TURN:
            turn = list(dict.fromkeys(turn))
        self.driven[begin:] = 2 * turn

"""The order in which a program drives its moves, by the calls of its routines: which moves are driven more than once, not at
all, in another order than they stand in the text, or under what a caller switched: a displacement, a soft servo.

Told by what the text shows: error handlers and trap routines are not driven, calls by a name that is made at run time not
followed. Branches and loops are followed where their conditions are known. Where not, each branch and each number of turns is
a way of its own that the program may go; a WHILE that holds all moves and does not count is one turn: the cell that waits for
the next part.
"""

from __future__ import annotations

from collections.abc import Container, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace

from compensator.rapid.blocks import DEEPEST, Arm, Block, Fork, Loop, Routine, Step
from compensator.rapid.moves import SWITCHES
from compensator.rapid.runs import Driven, Runs, Taken, covered
from compensator.rapid.runtime import MOTION, Parameter
from compensator.rapid.scopes import Scope
from compensator.rapid.values import Values
from compensator.rapid.variables import MOST_TURNS, UNKNOWN, Known, State, Variables
from compensator.rapid.ways import Choices, Open, ways_of

# No more calls are followed: routines that call each other double with every level.
MOST = 20_000
# Nor one on which each move is driven so often, where there are more than so many.
OFTEN, MANY = 10, 100_000
# Nor blocks within blocks beyond DEEPEST, in calls or in loops, nor more blocks in all; and of a loop's turn with more
# stretches than this each counts once: loops within loops double them with every level.
MOST_BLOCKS, LONGEST_TURN = 100_000, 1000
# What calls a routine by a name that is made at run time.
LATE = ("%", "callbyvar")


def runs_of(
    routines: Sequence[Routine], count: int, values: Values, parameters: Mapping[str, Sequence[Parameter]],
    elsewhere: Container[int] = ()
) -> Runs:
    """How the program drives its `count` targets: from its routine main, or from all routines that no other calls but those of
    traps. elsewhere: offsets of calls of another file's routines that drive."""
    numbers = {routine.name: number for number, routine in reversed(list(enumerate(routines)))}
    called = {numbers[step.name] for routine in routines for step in routine.steps
              if step.kind == "call" and step.name in numbers}
    roots = [number for number, routine in enumerate(routines) if number not in called and routine.kind != "trap"]
    main = numbers.get("main", -1)
    roots = [main] if main in roots else roots
    variables = Variables(values, routines, parameters)
    moving = _moving(routines, numbers)
    run = _Run(routines, numbers, moving, variables, count, elsewhere)
    run.drive_all(roots)
    total = covered((stretch.first, stretch.stop) for stretch in run.driven)

    def drive(choices: Choices) -> list[Driven]:
        way = _Run(routines, numbers, moving, variables, count, elsewhere, choices, total, uncounted=run.uncounted)
        way.drive_all(roots)
        return way.driven

    # A function is called where its value is asked for, which is not looked at.
    asked = any(routine.kind == "func" and routine.stop > routine.first for routine in routines)
    runs = Runs(tuple(run.driven), count, besides=frozenset(run.besides))
    if len(numbers) == len(routines) and not asked:
        try:
            runs = replace(runs, ways=ways_of(drive))
        except Open as stopped:
            runs = replace(runs, open=stopped.many, unsettled=stopped.start)
    return replace(runs, uncounted=tuple(sorted(run.uncounted)))


def _moving(routines: Sequence[Routine], numbers: Mapping[str, int]) -> frozenset[int]:
    """The routines that move, or call one that does, or one that nobody knows."""
    moving = {number for number, routine in enumerate(routines)
              if routine.stop > routine.first or any(step.kind == "call" and step.name in LATE for step in routine.steps)}
    grown = True
    while grown:
        more = {number for number, routine in enumerate(routines)
                if any(step.kind == "call" and numbers.get(step.name) in moving for step in routine.steps)} - moving
        moving |= more
        grown = bool(more)
    return frozenset(moving)


@dataclass(slots=True)
class _Run:
    """The state of the program while it is followed. moving: the routines that move, or call what does. choices: those of its
    way; None: it takes all branches, and loops twice."""

    routines: Sequence[Routine]
    numbers: Mapping[str, int]
    moving: frozenset[int]
    variables: Variables
    count: int
    elsewhere: Container[int]
    choices: Choices | None = None
    total: int = 0                                                  # targets that are driven at all
    switched: frozenset[str] = frozenset()                          # what is on (moves.py: SWITCHES)
    calls: int = 0
    length: int = 0
    deep: int = 0
    blocks: int = 0
    driven: list[Driven] = field(default_factory=list)
    besides: set[Driven] = field(default_factory=set)               # further ones, which are not counted again
    under_way: list[int] = field(default_factory=list)
    start: int = -1                                                 # of the call that led to where the run stands
    in_branches: set[str] = field(default_factory=set)              # routines that branches of this routine call
    apart: bool = False         # a move that is not counted stands behind the last target
    uncounted: set[tuple[int, int]] = field(default_factory=set)    # targets between which such a move is driven

    def drive_all(self, roots: Iterable[int]) -> None:
        self.variables.begin()
        for root in roots:
            self._drive(root, Step(0, "call", "", -1, -1), self.routines[root].scope)

    def _drive(self, number: int, call: Step, scope: Scope) -> str:
        """Drives a routine; "exit" where the program ends in it."""
        if number in self.under_way or self.calls > MOST:
            self._not_followed(call.start)
            return ""
        self.calls += 1
        routine = self.routines[number]
        self.variables.call(call, scope, routine)
        self.under_way.append(number)
        before = self.start, self.in_branches
        self.start, self.in_branches = call.start, set()
        ended = self._block(routine.body, scope=routine.scope, branch=False)
        self.start, self.in_branches = before
        self.under_way.pop()
        self.variables.leave()
        return "exit" if ended == "exit" else ""

    def _not_followed(self, start: int = -1) -> None:
        if self.choices is not None:
            raise Open(start)

    def _block(self, block: Block, scope: Scope, branch: bool) -> str:
        """Drives a block; "return" or "exit" where its routine or the program ends in it."""
        self.blocks += 1
        if self.deep >= DEEPEST or self.blocks > MOST_BLOCKS:
            self._not_followed()
            self._move(block.first, block.stop)
            return ""
        self.deep += 1
        ended = self._items(block, scope, branch)
        self.deep -= 1
        return ended

    def _items(self, block: Block, scope: Scope, branch: bool) -> str:
        first = block.first
        for item in block.items:
            at = item.at if isinstance(item, Step) else item.head.at
            self._move(first, at)
            if isinstance(item, Step):
                ended, first = self._step(item, scope, branch), at + item.holds
            elif isinstance(item, Loop):
                ended, first = self._loop(item, scope, branch), item.body.stop
            else:
                ended, first = self._fork(item, scope, branch), item.stop
            if ended:
                return ended
        self._move(first, block.stop)
        return ""

    def _move(self, first: int, stop: int) -> None:
        if stop <= first:
            return
        if self.apart:
            self.uncounted.add((self.driven[-1].stop - 1 if self.driven else -1, first))
        self.apart = False
        self.driven.append(Driven(first, stop, self.switched, self.start))
        self.length += stop - first
        if self.length > max(OFTEN * self.count, MANY):
            self._not_followed()

    def _step(self, step: Step, scope: Scope, branch: bool) -> str:
        if step.kind == "jump":
            if step.name == "return":
                return "return"
            if step.name.startswith("exit"):
                return "exit"
            self._not_followed(step.start)
        elif step.kind == "set":
            self.variables.take(step, scope)
        elif step.kind == "call":
            return self._call(step, scope, branch)
        return ""

    def _call(self, step: Step, scope: Scope, branch: bool) -> str:
        ended = ""
        if step.name in LATE:
            self._not_followed(step.start)
        elif step.name in SWITCHES:
            what, on = SWITCHES[step.name]
            self.switched = self.switched | {what} if on else self.switched - {what}
        elif step.name in self.numbers:
            again = self.choices is None and branch and step.name in self.in_branches
            self.in_branches |= {step.name} if branch else set()
            begin = len(self.driven)
            ended = self._drive(self.numbers[step.name], step, scope)
            if again:           # of several branches that call the same routine one is taken
                self._only_may(begin)
        self.apart |= self._uncounted(step)
        self.variables.take(step, scope)
        return ended

    def _only_may(self, begin: int) -> None:
        """Counts what was driven from there on no further time: it tells what may be switched on then."""
        self.besides.update(self.driven[begin:])
        del self.driven[begin:]

    def _moves(self, block: Block) -> bool:
        """Whether it matters for the order of the moves that a block is done."""
        return block.stop > block.first or any(
            step.kind == "jump" or (step.kind == "call" and (step.name in LATE or self.numbers.get(step.name) in self.moving))
            for step in block.steps())

    def _loop(self, loop: Loop, scope: Scope, branch: bool) -> str:
        if self.choices is None:
            return self._twice(loop, scope, branch)
        return (self._for if loop.head.kind == "for" else self._while)(loop, scope, branch, self.choices)

    def _twice(self, loop: Loop, scope: Scope, branch: bool) -> str:
        """A loop for what it may drive: once, and again where it counts."""
        name = ""
        if loop.head.kind == "for":
            name, values, stated = self.variables.turns(loop.head, scope)
            sure = values is not None and not stated
            turns = 2 if values is None or stated else len(values)
        else:
            known = self._truth(loop.head, scope)
            sure = known == Known(True)
            turns = 0 if known == Known(False) else 1 + self.variables.changes(loop.body, loop.head)
        begin, switched = len(self.driven), self.switched
        before, self.in_branches = self.in_branches, set()
        with self.variables.loop(name):
            self.variables.hold(name, UNKNOWN)
            self.variables.skip(loop.body, scope)
            ended = self._block(loop.body, scope, branch) if turns else ""
            behind = len(self.driven)
            if self.switched != switched and not ended and (turns > 1 or loop.head.kind == "while"):
                self._block(loop.body, scope, branch)       # a further turn begins with what this one has switched
        self.in_branches = before
        self._only_may(behind)
        turn = self.driven[begin:]
        if len(turn) > LONGEST_TURN:
            turn = list(dict.fromkeys(turn))
        self.driven[begin:] = 2 * turn if turns > 1 else turn
        if not sure:                        # a loop of no turn goes on behind it
            self.switched |= switched
        return ended if sure else ""

    def _bodies(self, loop: Loop) -> list[Block]:
        """What a loop does: its body, and those of the routines that it calls."""
        bodies = [loop.body]
        called: set[int] = set()
        for body in bodies:
            more = {self.numbers[step.name] for step in body.steps() if step.kind == "call" and step.name in self.numbers}
            bodies += [self.routines[number].body for number in more - called]
            called |= more
        return bodies

    def _not_all(self, loop: Loop) -> bool:
        """Whether there are moves beside those of a loop: else it is the cell that waits for the next part."""
        return covered((body.first, body.stop) for body in self._bodies(loop)) < self.total

    def _may_end(self, loop: Loop) -> bool:
        """Whether something that a loop does may end it: it leaves, or assigns what the condition asks for."""
        return any(self.variables.assigns(step, loop.head) or (step.kind == "jump" and (
            step.name.startswith("exit") or (step.name == "return" and body is loop.body)))
            for body in self._bodies(loop) for step in body.steps())

    def _openly(
        self, loop: Loop, scope: Scope, branch: bool, choices: Choices, values: Sequence[float] | None = None, name: str = "",
        assumed: int | None = None
    ) -> str:
        """A loop whose turns are not known, each number of them a way of its own. values: of its variable, as stated; assumed:
        so many turns, where nothing is stated."""
        if not self._moves(loop.body):
            self._skip(loop.body, scope)
            return ""
        stated = assumed if values is None or len(values) > MOST_TURNS else len(values)
        for turn in range(choices.turns(loop.head.start, stated, self._open_loops())):
            if name:
                self.variables.hold(name, Known(values[turn]) if values is not None and turn < len(values) else UNKNOWN)
            ended = self._block(loop.body, scope, branch)
            if ended:
                return ended
        self._skip(loop.body, scope)
        return ""

    def _skip(self, block: Block, scope: Scope) -> None:
        """Passes over a block that may have been done or not, and drives no targets."""
        self.apart |= any(self._uncounted(step) for step in block.steps())
        self.variables.skip(block, scope)

    def _uncounted(self, step: Step) -> bool:
        """Whether a step drives along targets that are not counted, such as TriggL, or a routine of another file."""
        return step.kind == "call" and step.name not in self.numbers and (
            bool(MOTION.fullmatch(step.name)) or step.start in self.elsewhere)

    def _open_loops(self) -> int:
        """How many loops of the program may have such turns."""
        return sum(self._moves(loop.body) for routine in self.routines for loop in routine.body.loops())

    def _for(self, loop: Loop, scope: Scope, branch: bool, choices: Choices) -> str:
        name, values, stated = self.variables.turns(loop.head, scope)
        if values is None or stated or len(values) > MOST_TURNS:
            with self.variables.loop(name):
                return self._openly(loop, scope, branch, choices, values, name)
        with self.variables.loop(name):
            for value in values:
                self.variables.hold(name, Known(value))
                ended = self._block(loop.body, scope, branch)
                if ended:
                    return ended
        return ""

    def _while(self, loop: Loop, scope: Scope, branch: bool, choices: Choices) -> str:
        counts = self.variables.changes(loop.body, loop.head)
        ends = not counts and self._may_end(loop)
        before: list[Known] = []
        told: tuple[int, State | None] = (0, None)          # how many choices were made, and what is known
        for turn in range(MOST_TURNS):
            known, asked = self._truth(loop.head, scope), self.variables.asked(loop.head, scope)
            sure = known.value is not None and not known.stated
            if (sure and not known.value) or (turn and not counts and not sure):
                return ""
            now = len(choices.made), self.variables.state() if ends else None
            # A later turn may end it where all that this one did is settled, and has changed something.
            if turn and not counts and asked == before and (not ends or told[0] < now[0] or told == now):
                return ""
            before, told = asked, now
            if not sure and (counts or self._not_all(loop)):
                return self._openly(loop, scope, branch, choices, assumed=None if counts else 1)
            ended = self._block(loop.body, scope, branch)
            if ended:
                return ended
        raise Open

    def _truth(self, head: Step, scope: Scope) -> Known:
        """Whether the condition of a WHILE, IF or ELSEIF holds."""
        known = self.variables.condition(head, scope)
        return known if isinstance(known.value, bool) else UNKNOWN

    def _holds(self, fork: Fork, arm: Arm, scope: Scope) -> Known:
        """Whether a branch is taken where none before it is."""
        if arm.otherwise:
            return Known(True)
        return self._truth(arm.head, scope) if fork.head.kind == "if" else self.variables.case(fork.head, arm.head, scope)

    def _fork(self, fork: Fork, scope: Scope, branch: bool) -> str:
        """Takes the branch that is known to be taken, or one of those that may be."""
        if not any(arm.body.items or arm.body.stop > arm.body.first for arm in fork.arms):
            return ""       # outputs are switched
        possible, stated = self._possible(fork, scope)
        if len(possible) == 1:
            return "" if possible[0] is None else self._block(possible[0].body, scope, branch)
        if self.choices is None:
            before = self.switched
            behind = [before] if None in possible else []
            for arm in possible:
                if arm is not None:
                    self.switched = before
                    if not self._block(arm.body, scope, branch=True):
                        behind.append(self.switched)
                    self.variables.skip(arm.body, scope)
            self.switched = frozenset().union(*behind) if behind else before        # all that may be on
            return ""
        if not any(self._moves(arm.body) for arm in possible if arm is not None):
            for arm in possible:
                if arm is not None:
                    self._skip(arm.body, scope)
            return ""
        # A pass that ends in an error is none.
        possible = [arm for arm in possible if arm is None or not arm.body.fails] or possible
        by_file = next((k for k, arm in enumerate(possible) if stated and arm is stated[0]), -1)
        choice = self.choices.choose(len(possible), max(by_file, 0))
        arm = possible[choice]
        if len(possible) > 1:
            self.choices.taken.append(Taken((fork if arm is None else arm).head.start, arm is None, choice == by_file))
        self.variables.learn(fork, arm, scope)
        return "" if arm is None else self._block(arm.body, scope, branch)

    def _possible(self, fork: Fork, scope: Scope) -> tuple[list[Arm | None], list[Arm | None]]:
        """The branches that may be taken, None for none of them; and, if known, that which the file's values lead to."""
        possible: list[Arm | None] = []
        stated: list[Arm | None] = []
        told = True
        for arm in fork.arms:
            holds = self._holds(fork, arm, scope)
            if holds == Known(False):
                continue
            possible.append(arm)
            told &= holds.value is not None
            if holds.value and told and not stated:
                stated.append(arm)
            if holds == Known(True):
                return possible, stated
        possible.append(None)
        return possible, stated or ([None] if told else [])

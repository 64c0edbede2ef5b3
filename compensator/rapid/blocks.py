"""What a routine does beside its moves, as the text nests it: calls, assignments, loops, branches."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

from compensator.rapid.conditions import split
from compensator.rapid.lexer import Token, tokens
from compensator.rapid.scopes import Scope
from compensator.rapid.text import Source

# Instructions behind which the next statement is not the one that stands there.
JUMPS = ("return", "exit", "exitcycle", "raise", "goto")
# Instructions that count their first argument.
COUNTS = ("incr", "decr", "add")
# Blocks within blocks beyond this are not looked into.
DEEPEST = 150
_CLOSES = ("endif", "endtest", "endfor", "endwhile")
_ARMS = ("elseif", "else", "case", "default")


class Step(NamedTuple):
    """A statement that is no move. at: how many targets stand before it in the text; kind: "call" and "jump" (name: of the
    routine or instruction), "set" (of what is assigned to), "handler" where those of errors begin, "label", or the word of a
    loop or branch; start, end: its span, that of a branch without what is done in it."""

    at: int
    kind: str
    name: str
    start: int
    end: int
    turn: int = -1      # which turn of a loop a call is, of those that are looked at turn by turn (handed_loops.py)
    holds: int = 0      # how many targets stand in its place: those of a call that hands them over (handed_targets.py)


@dataclass(slots=True, eq=False)
class Block:
    """Statements one after the other; first, stop: the targets at its ends."""

    first: int
    items: list[Step | Loop | Fork] = field(default_factory=list)
    stop: int = 0

    @property
    def fails(self) -> bool:
        """Whether it ends in an error, where nothing in it decides that."""
        return any(isinstance(item, Step) and item.kind == "jump" and item.name == "raise" for item in self.items)

    def loops(self) -> Iterator[Loop]:
        """All loops in it, the inner ones, too."""
        for item in self.items:
            if isinstance(item, Loop):
                yield item
                yield from item.body.loops()
            elif isinstance(item, Fork):
                for arm in item.arms:
                    yield from arm.body.loops()

    def steps(self) -> Iterator[Step]:
        """All steps in it, those of loops and branches, too."""
        for item in self.items:
            if isinstance(item, Step):
                yield item
            elif isinstance(item, Loop):
                yield from item.body.steps()
            else:
                for arm in item.arms:
                    yield from arm.body.steps()


@dataclass(slots=True, eq=False)
class Loop:
    """FOR or WHILE; end: its last word, None where it is missing."""

    head: Step
    body: Block
    end: Step | None = None


@dataclass(slots=True, eq=False)
class Arm:
    """One branch; head: IF, ELSEIF, CASE with its condition, ELSE or DEFAULT."""

    head: Step
    body: Block

    @property
    def otherwise(self) -> bool:
        return self.head.kind in ("else", "default")


@dataclass(slots=True, eq=False)
class Fork:
    """IF or TEST with its branches."""

    head: Step
    arms: list[Arm]
    stop: int = 0


@dataclass(eq=False)
class Routine:
    """One routine of the text: its first target and its steps. kind: "proc", "func" or "trap"; local: its module alone may call
    it."""

    name: str
    first: int
    kind: str
    scope: Scope
    steps: list[Step] = field(default_factory=list)
    stop: int = 0       # the first target behind it
    local: bool = False

    @cached_property
    def handler(self) -> int:
        """The number of the step with which its handlers of errors begin, or of all steps."""
        return next((k for k, step in enumerate(self.steps) if step.kind == "handler"), len(self.steps))

    @cached_property
    def body(self) -> Block:
        """What is done in it as long as nothing goes wrong."""
        stop = self.steps[self.handler].at if self.handler < len(self.steps) else self.stop
        steps = iter(self.steps[:self.handler])
        block, closed = Block(self.first), True
        while closed:       # a word that closes nothing is passed over
            closed = _fill(block, steps, stop) is not None
        return block

    def forget(self) -> None:
        """What was told of its steps, where these are others now."""
        for known in ("body", "handler"):
            vars(self).pop(known, None)


def end_routines(routines: Sequence[Routine], count: int) -> None:
    """Says where each routine ends, of a text with so many targets."""
    for number, routine in enumerate(routines):
        routine.stop = routines[number + 1].first if number + 1 < len(routines) else count


def words_of(source: Source, step: Step) -> list[Token]:
    """The words of a step without a semicolon."""
    found = tokens(source, step.start, step.end)[:-1]
    return found[:-1] if found and found[-1].word == ";" else found


def arguments(source: Source, call: Step) -> list[list[Token]]:
    """The required arguments of a call, up to the first optional one."""
    words = words_of(source, call)
    words = words[3 if words and words[0].word == "%" else 1:]
    stop = next((k for k, word in enumerate(words) if word.word == "\\"), len(words))
    return [part[2:] if len(part) > 2 and part[1].word == ":=" else part for part in split(words[:stop], ",")]


def options(source: Source, call: Step) -> dict[str, bool]:
    """The optional arguments of a call by their names, and whether they are surely handed over: not `\\x?y`."""
    words = words_of(source, call)
    return {name.word: not (behind and behind[0].word == "?")
            for mark, name, *behind in (words[k:k + 3] for k in range(len(words) - 1)) if mark.word == "\\"}


def _fill(block: Block, steps: Iterator[Step], stop: int, deep: int = 0) -> Step | None:
    """Takes the steps of a block up to that which ends it, which is returned; None at the end of the routine. deep: within how
    many others it stands."""
    for step in steps:
        if step.kind in _CLOSES or step.kind in _ARMS:
            block.stop = step.at
            return step
        if step.kind in ("for", "while", "if", "test") and deep >= DEEPEST:
            block.items.append(step._replace(kind="jump", name="goto"))
            _pass_over(steps)
        elif step.kind in ("for", "while"):
            body = Block(step.at)
            end = _fill(body, steps, stop, deep + 1)
            block.items.append(Loop(step, body, end))
        elif step.kind in ("if", "test"):
            block.items.append(_fork(step, steps, stop, deep + 1))
        else:
            block.items.append(step)
    block.stop = stop
    return None


def _pass_over(steps: Iterator[Step]) -> None:
    """Goes behind the end of a loop or branch that has begun, whatever is within: nobody can tell in which order that is."""
    opened = 1
    while opened and (step := next(steps, None)) is not None:
        opened += (step.kind in ("for", "while", "if", "test")) - (step.kind in _CLOSES)


def _fork(head: Step, steps: Iterator[Step], stop: int, deep: int) -> Fork:
    fork, arm = Fork(head, []), Block(head.at)
    last: Step | None = head
    while last is not None and (last is head or last.kind in _ARMS):
        if not (last is head and head.kind == "test"):
            fork.arms.append(Arm(last, arm))
        last = _fill(arm, steps, stop, deep)
        fork.stop, arm = (stop, arm) if last is None else (last.at, Block(last.at))
    return fork

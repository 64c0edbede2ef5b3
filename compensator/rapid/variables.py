"""What numbers and logical values of a program are while it is followed, as far as its text says."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from itertools import pairwise
from typing import NamedTuple

from compensator.rapid.blocks import COUNTS, Arm, Block, Fork, Routine, Step, arguments, options, words_of
from compensator.rapid.conditions import Value, split, value_of
from compensator.rapid.lexer import Token
from compensator.rapid.runtime import Parameter
from compensator.rapid.scopes import Scope
from compensator.rapid.values import Unsettled, Values
from identification.common.findings import CompstiffError

# Instructions that change data by a name in a string.
_BY_NAME = ("setdataval", "setalldataval")
# A loop of more turns is not followed.
MOST_TURNS = 20_000


def _by_name(step: Step) -> bool:
    return step.kind == "call" and step.name in _BY_NAME


class Known(NamedTuple):
    """A value; stated: it is the one in the file, which somebody may have changed before the run."""

    value: Value
    stated: bool = False


UNKNOWN = Known(None)
# What is known of declared data by their numbers, of others by their names, and of what the routine itself has.
State = tuple[dict[int, Known], dict[str, Known], dict[str, Known]]


class Turns(NamedTuple):
    """The variable of a FOR, its values, None where they are not known, and whether these are only stated."""

    name: str
    values: list[float] | None
    stated: bool = False


@dataclass(slots=True)
class Variables:
    """The variables at one moment of a run. parameters: of the routines of each name.

    Constants, and what the program itself assigns step by step, are known; PERS data and variables of a module that nothing in
    the file assigns are as stated; what handlers and traps assign, and PERS data before their first assignment, is not known.
    """

    values: Values
    routines: Sequence[Routine]
    parameters: Mapping[str, Sequence[Parameter]]
    _now: dict[int, Known] = field(default_factory=dict)
    _elsewhere: dict[str, Known] = field(default_factory=dict)     # of names that this file does not declare
    _frames: list[dict[str, Known]] = field(default_factory=lambda: [{}])
    _own: set[int] = field(default_factory=set)         # what is assigned on the way
    _wild: set[int] = field(default_factory=set)        # what is assigned at any time
    _initial: dict[int, Known] = field(default_factory=dict)
    _asked: bool = False

    def __post_init__(self) -> None:
        if not any(step.kind in ("if", "test", "for", "while") for routine in self.routines for step in routine.steps):
            return      # nothing asks for them
        self._asked = True
        for routine in self.routines:
            for number, step in enumerate(routine.steps):
                wild = routine.kind != "proc" or number > routine.handler
                (self._wild if wild else self._own).update(self._find(name, routine.scope) for name in self._changed(step))
                if _by_name(step):
                    (self._wild if wild else self._own).update(
                        k for k, declared in enumerate(self.values.names.declarations) if declared.storage in ("var", "pers"))
        self._own.discard(-1)       # names that this file does not declare
        self._wild.discard(-1)

    def begin(self) -> None:
        """The state before a run."""
        self._now.clear()
        self._elsewhere.clear()
        self._frames = [{}]

    def condition(self, head: Step, scope: Scope) -> Known:
        """The value of the condition of IF, ELSEIF or WHILE."""
        words = words_of(self.values.source, head)[1:]
        return self._of(words[:-1] if words and words[-1].word in ("then", "do") else words, scope)

    def case(self, test: Step, case: Step, scope: Scope) -> Known:
        """Whether what TEST asks for is one of the values of a CASE."""
        asked = self._of(words_of(self.values.source, test)[1:], scope)
        cases = [self._of(words, scope) for words in split(words_of(self.values.source, case)[1:-1], ",")]
        stated = asked.stated or any(known.stated for known in cases)
        values = [known.value for known in cases]
        if asked.value is None:
            return UNKNOWN
        return Known(True if asked.value in values else None if None in values else False, stated)

    def learn(self, fork: Fork, arm: Arm | None, scope: Scope) -> None:
        """What a branch that was taken tells of the logical variable that it asks for by its name alone."""
        words = words_of(self.values.source, fork.head)[1:]
        words = words[:-1] if words and words[-1].word == "then" else words
        opposite = bool(words) and words[0].word == "not"
        if fork.head.kind == "if" and len(words) == 1 + opposite and words[-1].kind == "name":
            self._assign(words[-1].word, scope, Known((arm is fork.arms[0]) != opposite))

    def _of(self, words: list[Token], scope: Scope) -> Known:
        stated = False

        def named(word: Token) -> Value:
            nonlocal stated
            known = self._named(word.word, scope)
            stated |= known.stated
            return known.value

        value = value_of(words, named)
        return Known(value, stated)

    def turns(self, step: Step, scope: Scope) -> Turns:
        """The turns of a FOR."""
        words = words_of(self.values.source, step)
        marks = {word.word: k for k, word in enumerate(words) if word.word in ("from", "to", "step", "do")}
        if len(words) < 2 or not {"from", "to", "do"} <= set(marks):
            return Turns("", None)
        ends = (marks["from"], marks["to"], marks.get("step", marks["do"]), marks["do"])
        parts = [self._of(words[a + 1:b], scope) for a, b in pairwise(ends) if b > a]
        if any(part.value is None or isinstance(part.value, bool) for part in parts):
            return Turns(words[1].word, None)
        first, last, *by = (float(part.value or 0.0) for part in parts)
        stride = by[0] if by else (1.0 if last >= first else -1.0)
        if not stride:
            return Turns(words[1].word, None)
        count = max(int((last - first) / stride + 1e-9) + 1, 0) if (last - first) * stride >= 0 else 0
        return Turns(words[1].word, [first + k * stride for k in range(min(count, MOST_TURNS + 1))],
                     any(part.stated for part in parts))

    def hold(self, name: str, known: Known) -> None:
        """The variable of a loop."""
        self._frames[-1][name] = known

    @contextmanager
    def loop(self, name: str) -> Iterator[None]:
        """A loop whose variable hides what has its name, an outer loop's or a parameter, too."""
        before = self._frames[-1].get(name)
        yield
        if before is None:
            self._frames[-1].pop(name, None)
        else:
            self._frames[-1][name] = before

    def call(self, step: Step, scope: Scope, routine: Routine) -> None:
        """Enters a routine: its parameters have the values of the arguments, its own variables those they begin with."""
        if not self._asked:
            self._frames.append({})
            return
        frame = {self.values.names.declarations[parameter.declaration].name: UNKNOWN
                 for parameter in self.parameters.get(routine.name, ())}
        given = arguments(self.values.source, step) if step.start >= 0 else []
        optional = options(self.values.source, step) if step.start >= 0 else {}
        for parameter in self.parameters.get(routine.name, ()):
            if isinstance(parameter.slot, int) and parameter.slot < len(given) and parameter.mode == "in":
                name = self.values.names.declarations[parameter.declaration].name
                frame[name] = self._of(given[parameter.slot], scope)
            elif isinstance(parameter.slot, str) and step.start >= 0:
                frame[f"present {parameter.slot}"] = Known(optional[parameter.slot] or None) if (
                    parameter.slot in optional) else Known(False)
        declarations = self.values.names.declarations
        for number in [number for number in self._now if declarations[number].scope == routine.scope]:
            if declarations[number].storage == "var":
                del self._now[number]
        self._frames.append(frame)

    def leave(self) -> None:
        self._frames.pop()

    def take(self, step: Step, scope: Scope) -> None:
        """What a step that is no jump assigns; a call of a routine of the file after it has returned."""
        if not self._asked:
            return
        if step.kind == "set":
            words = words_of(self.values.source, step)
            plain = len(words) > 2 and words[1].word == ":="
            self._assign(step.name, scope, self._of(words[2:], scope) if plain else UNKNOWN)
        elif step.name in (*COUNTS, "clear") and step.kind == "call":
            self._count(step, scope)
        elif step.kind == "call":
            if _by_name(step):
                self._forget()
            for name in self._changed(step):
                self._assign(name, scope, UNKNOWN)
            self._elsewhere_called(step)

    def skip(self, block: Block, scope: Scope) -> None:
        """What a block assigns that may have been done or not."""
        steps = list(block.steps())
        if any(_by_name(step) or (step.kind == "call" and step.name in self.parameters) for step in steps):
            self._forget()
        for step in steps:
            self._elsewhere_called(step)
            for name in self._changed(step):
                self._assign(name, scope, UNKNOWN)

    def changes(self, block: Block, condition: Step) -> bool:
        """Whether what a block does counts on what its condition asks for: `n:=n+1`, `Incr n`."""
        asked = {word.word for word in words_of(self.values.source, condition)[1:] if word.kind == "name"}
        for step in block.steps():
            words = words_of(self.values.source, step)
            if step.kind == "set" and step.name in asked and step.name in {word.word for word in words[2:]}:
                return True
            if step.kind == "call" and step.name in COUNTS and len(words) > 1 and words[1].word in asked:
                return True
        return False

    def assigns(self, step: Step, condition: Step) -> bool:
        """Whether a step may assign what a condition asks for."""
        return not self._changed(step).isdisjoint(word.word for word in words_of(self.values.source, condition)[1:])

    def state(self) -> State:
        """All that is known at this moment."""
        declared = {number: self._now[number] if number in self._now else self._at_start(number) for number in self._own}
        return declared, self._elsewhere.copy(), self._frames[-1].copy()

    def asked(self, head: Step, scope: Scope) -> list[Known]:
        """The values of the names in the condition of a WHILE."""
        return [self._named(word.word, scope) for word in words_of(self.values.source, head)[1:] if word.kind == "name"]

    def _elsewhere_called(self, step: Step) -> None:
        """A routine of another file may know the data of this one."""
        if step.kind == "call" and step.name not in self.parameters and step.name not in (*COUNTS, "clear"):
            declarations = self.values.names.declarations
            self._elsewhere.clear()
            self._now.update({number: Known(known.value, True) for number, known in self._now.items()
                              if declarations[number].scope.routine < 0 and declarations[number].reach != "local"})

    def _forget(self) -> None:
        self._now.update(dict.fromkeys(self._own, UNKNOWN))
        self._elsewhere.clear()

    def _find(self, name: str, scope: Scope) -> int:
        return self.values.names.find(name, scope)

    def _named(self, name: str, scope: Scope) -> Known:
        if name in self._frames[-1]:
            return self._frames[-1][name]
        number = self._find(name, scope)
        if number < 0:
            return self._elsewhere.get(name, UNKNOWN)
        if number in self._wild or number in self.values.names.doubled:
            return UNKNOWN
        return self._now[number] if number in self._now else self._at_start(number)

    def _at_start(self, number: int) -> Known:
        known = self._initial.get(number)
        if known is None:
            known = self._initial[number] = self._read(number)
        return known

    def _read(self, number: int) -> Known:
        """The value a run begins with."""
        declared = self.values.names.declarations[number]
        if declared.type not in ("num", "dnum", "bool") or declared.dimensions or declared.storage == "parameter":
            return UNKNOWN
        own = number in self._own
        if declared.storage == "pers" and own:
            return UNKNOWN              # what the last run has left
        value: Value | Unsettled = False if declared.type == "bool" else 0.0
        if declared.value_start >= 0:
            try:
                parsed = self.values.initial(number)
                value = (self.values.flag(parsed, declared.scope, declared.name) if declared.type == "bool"
                         else self.values.number(parsed, declared.scope, declared.name))
            except CompstiffError:      # data that no controller would load
                return UNKNOWN
        elif declared.storage != "var":
            return UNKNOWN
        seen = declared.storage == "const" or own or declared.scope.routine >= 0 or declared.reach == "local"
        return UNKNOWN if isinstance(value, Unsettled) else Known(value, declared.storage == "pers" or not seen)

    def _assign(self, name: str, scope: Scope, known: Known) -> None:
        if name in self._frames[-1]:
            self._frames[-1][name] = known
            return
        number = self._find(name, scope)
        if number >= 0:
            self._now[number] = known
        else:
            self._elsewhere[name] = known

    def _count(self, step: Step, scope: Scope) -> None:
        """Incr, Decr, Add, Clear."""
        given = arguments(self.values.source, step)
        if not given or len(given[0]) != 1:
            return
        word = given[0][0]
        before = self._named(word.word, scope)
        by = Known({"incr": 1.0, "decr": -1.0}.get(step.name))
        if step.name == "add" and len(given) > 1:
            by = self._of(given[1], scope)
        after = UNKNOWN
        if step.name == "clear":
            after = Known(0.0)
        elif isinstance(before.value, float) and isinstance(by.value, float):
            after = Known(before.value + by.value, before.stated or by.stated)
        self._assign(word.word, scope, after)

    def _changed(self, step: Step) -> set[str]:
        """The names that a step may assign to."""
        if step.kind == "set":
            return {step.name}
        if step.kind != "call":
            return set()
        known = self.parameters.get(step.name)
        if known is not None and all(parameter.mode == "in" for parameter in known):
            return set()
        return {word.word for word in words_of(self.values.source, step)[1:] if word.kind == "name"}

"""Tools and work objects that calls hand over: to a routine of this file, whose moves then name a parameter, or to one of
another file, which may change them; and calls of routines of another file, which may drive there."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import NamedTuple

from compensator.rapid.blocks import arguments
from compensator.rapid.calls import LATE
from compensator.rapid.expressions import Expr
from compensator.rapid.instructions import INSTRUCTIONS
from compensator.rapid.lexer import Token
from compensator.rapid.moves import AXIS_OFFSET, DISPLACEMENT
from compensator.rapid.runtime import HARMLESS, MOTION, Parameter
from compensator.rapid.scan import Scan
from compensator.rapid.scopes import Names, Scope
from compensator.rapid.uses import Uses

Beside = Callable[[Iterable[str]], Mapping[str, str]]
Declares = Callable[[Iterable[str]], Mapping[str, frozenset[str]]]
FRAMES = ("tooldata", "wobjdata")
# Those of a robtarget: round all of it, its place, turn, configuration and external axes.
TARGET_BRACKETS = 5
# What switches a displacement is given the place of it.
_SWITCHES = frozenset((*DISPLACEMENT, *AXIS_OFFSET))
# Instructions and functions of the controller that use a tool or work object as it is.
_USES = HARMLESS | {"crobt", "cpos", "calcrobt", "setsysdata", "egmactpose", "wzboxdef", "pathrecmovebwd", "pathrecmovefwd"}


def handed_in(scan: Scan) -> dict[int, tuple[Expr, Scope]]:
    """What each parameter for a tool or work object stands for, where all calls of this file hand over the same declared data.

    By the number of the parameter's declaration: the name that is handed over, and the scope of the call."""
    wanted = {name: [parameter for parameter in parameters if isinstance(parameter.slot, int)
                     and scan.names.declarations[parameter.declaration].type in FRAMES]
              for name, parameters in scan.routines.items()}
    calls = [(step, routine.scope) for routine in scan.bodies for step in routine.steps if step.kind == "call"]
    if not any(wanted.values()) or any(step.name in LATE for step, _ in calls):
        return {}
    given: dict[int, set[int]] = {}
    first: dict[int, tuple[Expr, Scope]] = {}
    for step, scope in calls:
        if not wanted.get(step.name):
            continue
        parts = arguments(scan.source, step)
        for parameter in wanted[step.name]:
            slot = parameter.slot
            part = parts[slot] if isinstance(slot, int) and slot < len(parts) else []
            name = part[0] if len(part) == 1 and part[0].kind == "name" else None
            given.setdefault(parameter.declaration, set()).add(-1 if name is None else scan.names.find(name.word, scope))
            if name is not None:
                first.setdefault(parameter.declaration, (Expr("name", name.start, name.end, name.word), scope))
    return {number: first[number] for number, data in given.items() if len(data) == 1 and -1 not in data}


class Elsewhere(NamedTuple):
    """A call of a routine that this file does not hold. name: as the text has it; target: whether it is given one, so that it
    drives; file: the one beside this that holds it and in which it drives, "" where none was found."""

    name: str
    target: bool
    file: str

    @property
    def drives(self) -> bool:
        return self.target or bool(self.file)


def called_elsewhere(scan: Scan, beside: Beside | None = None) -> dict[int, Elsewhere]:
    """Calls of routines that this file does not hold and that are not the controller's own, by the offset of the call. beside:
    the file that holds each of some routines (in lower case), and in which they drive."""
    source, found = scan.source, dict[int, Elsewhere]()
    for routine in scan.bodies:
        for step in routine.steps:
            if step.kind != "call" or step.name in scan.routines or step.name in _USES or step.name in _SWITCHES or (
                    step.name in LATE or MOTION.fullmatch(step.name)):
                continue
            target = any(_is_target(scan, part, routine.scope) for part in arguments(source, step))
            if target or step.name not in INSTRUCTIONS:
                written = source.data[step.start:step.end].lstrip(b'%"')[:len(step.name.encode(source.encoding, "replace"))]
                found[step.start] = Elsewhere(written.decode(source.encoding, errors="replace"), target, "")
    if beside is None or not found:
        return found
    holds = beside({call.name.lower() for call in found.values()})
    return {offset: call._replace(file=holds.get(call.name.lower(), "")) for offset, call in found.items()}


def _is_target(scan: Scan, part: list[Token], scope: Scope) -> bool:
    """Whether an argument is a target: declared as one, shifted from one, or four brackets."""
    words = [word.word for word in part]
    if words[:2] == ["[", "["]:
        return sum(word == "[" for word in words) == TARGET_BRACKETS
    number = scan.names.find(words[0], scope) if words else -1
    return words[:1] in (["offs"], ["reltool"]) or (number >= 0 and scan.names.declarations[number].type == "robtarget"
                                                   and (len(words) == 1 or words[1] == "{"))


def handed_out(names: Names, uses: Uses, routines: Mapping[str, Iterable[Parameter]]) -> dict[int, str]:
    """The routine of another file that each tool or work object is handed to, by the number of its declaration; "%": one called
    by a name that is made at run time."""
    out: dict[int, str] = {}
    passed: list[tuple[int, int]] = []          # declaration handed in, declaration of the parameter
    for argument in sorted(uses.handed, key=lambda argument: (argument.routine, argument.name, argument.scope)):
        number = names.find(argument.name, argument.scope)
        if number < 0 or names.declarations[number].type not in FRAMES or names.declarations[number].storage == "const":
            continue
        if argument.routine in routines:
            passed += [(number, parameter.declaration) for parameter in routines[argument.routine]
                       if parameter.slot == argument.slot]
        elif argument.routine not in _USES and not MOTION.fullmatch(argument.routine):
            out.setdefault(number, argument.routine)
    for _ in range(len(passed)):
        more = {number: out[parameter] for number, parameter in passed if parameter in out and number not in out}
        out |= more
        if not more:
            break
    return out

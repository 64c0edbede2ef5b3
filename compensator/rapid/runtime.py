"""Which declared data change while the program runs, as far as this file can tell."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from compensator.rapid.scopes import Names
from compensator.rapid.uses import Argument, Uses

MOTION = re.compile(
    r"(?:move|trigg|search|arc|spot|spotm|disp|paint|cap|fcpress|fcpress1|egmmove|laser|cut)(?:abs)?(?:l|j|c)"
    r"(?:sync|do|ao|go|ios|start|end|\d)?"
)
"""Instructions that move along targets; which of them are counted is decided where they are read."""

# Instructions and functions of the controller that take positions without changing them. Any other routine that is not
# in this file is taken to change the robtargets handed to it by reference; tools and work objects it is taken to use.
HARMLESS = frozenset((
    "pdispon", "pdispset", "pdispadd", "eoffson", "eoffsset", "gripload", "return", "raise", "goto", "exit", "retry",
    "trynext", "tpwrite", "write", "connect", "waittime", "waituntil", "waitsynctask", "stop", "set", "reset",
    "setdo", "setao", "setgo", "pulsedo", "moveextj", "confl", "confj", "velset", "speedrefresh", "accset", "offs", "reltool",
    "calcjointt", "distance", "poseinv", "posemult", "posevect", "orobt", "mirpos", "norient", "eulerzyx", "abs",
    "sqrt", "valtostr", "dim", "present", "ispers", "isvar", "numtostr", "vectmagn", "dotprod", "crossprod",
))
_POSITIONS = ("robtarget", "jointtarget")


@dataclass(frozen=True, slots=True)
class Parameter:
    """One parameter of a routine: slot as in `Argument`; declaration is its number among the program's `Names`."""

    slot: int | str
    mode: str
    declaration: int


def changing(names: Names, uses: Uses, routines: Mapping[str, Iterable[Parameter]]) -> frozenset[int]:
    """Numbers of the declarations assigned somewhere, directly or through a routine that gets them by reference.

    routines: folded routine name -> its parameters (those of all routines of that name).
    """
    changed = {names.find(name, scope) for name, scope in uses.assigned}
    by_reference: list[tuple[int, int]] = []            # declaration handed in, declaration of the parameter
    for argument in uses.handed:
        handed = names.find(argument.name, argument.scope)
        if handed < 0 or names.declarations[handed].storage == "const":
            continue
        if argument.routine in routines:
            by_reference += [
                (handed, parameter.declaration)
                for parameter in routines[argument.routine]
                if parameter.slot == argument.slot and parameter.mode in ("var", "pers", "inout")
            ]
        elif names.declarations[handed].type in _POSITIONS and _may_change(argument):
            changed.add(handed)
    grown = True
    while grown:
        more = {handed for handed, parameter in by_reference if parameter in changed} - changed
        changed |= more
        grown = bool(more)
    return frozenset(changed - {-1})


def _may_change(argument: Argument) -> bool:
    if argument.routine.startswith("search"):
        return argument.slot == 1                       # the point found is written to the second argument
    return argument.routine not in HARMLESS and not MOTION.fullmatch(argument.routine)

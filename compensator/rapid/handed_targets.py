"""Targets that calls hand over, `PROC cut(robtarget p) MoveL p,... ENDPROC`, as the moves that each call drives.

Only where all targets of the routine are parameters, or Offs and RelTool of such. What is corrected is written into the call:
the move itself stays as it is. Parameters by reference (VAR, PERS, INOUT) are what is handed over as long as the routine does
not change them; a routine of another module of the file is given data that both modules see.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Container, Mapping
from dataclasses import dataclass, replace

from compensator.rapid.blocks import Routine, Step, arguments
from compensator.rapid.expressions import Expr
from compensator.rapid.handed_loops import Turns, turn_by_turn
from compensator.rapid.lexer import TRIVIA
from compensator.rapid.moves import OF_ONE_MOVE
from compensator.rapid.repeated import Places, Time, repeat
from compensator.rapid.runtime import MOTION
from compensator.rapid.scan import Scan
from compensator.rapid.scopes import Scope
from compensator.rapid.unrolled import target_at
from compensator.rapid.values import Values

# A routine that calls drive to more targets keeps one for each of its moves; of more than FEW calls none is repeated.
MOST, FEW = 400_000, 100_000
# What stands before and behind the target of a routine that is one MoveL: the end of its head, and its own.
_BEFORE = re.compile(rb"(?i)\s*(?:\{[^}]*\}\s*)?\)" + TRIVIA + rb"MoveL\s+(?:ToPoint\s*:=\s*)?")
_BEHIND = re.compile(rb"(?i)[^;!\"]*+;" + TRIVIA + rb"ENDPROC")
_REASON = "the move serves every call of its routine, which goes to more places beside the target that is handed over"


@dataclass(frozen=True, slots=True)
class _Called:
    """A routine of targets that calls hand over, and these at each call, in the order of the text. own: those, counted from its
    first one, that alone make use of their parameter. referred: those whose parameter is a reference. alone: it is one MoveL
    and nothing else."""

    times: list[Time]
    own: frozenset[int]
    referred: frozenset[int]
    alone: bool


def follow_calls(scan: Scan, values: Values) -> None:
    """Gives each call of such a routine a routine of its own, with its targets, which stand where the call does, and says which
    these are in `scan.handed`."""
    turns = turn_by_turn(scan, values)
    twice = {name for name, count in Counter(routine.name for routine in scan.bodies).items() if count > 1}
    followed = {routine.name: called for routine in scan.bodies if routine.name not in twice
                and (called := _called(scan, values, routine, turns)) is not None}
    if not followed:
        return
    calls = [step for routine in scan.bodies for step in routine.steps if _leads(step, routine, followed)]
    led: dict[str, list[int]] = {name: [] for name in followed}
    times = []
    for number, step in enumerate(calls):
        times.append(followed[step.name].times[len(led[step.name])])
        led[step.name].append(number)
    place = repeat(scan, times)
    for number, step in enumerate(calls):
        _tell(scan, followed[step.name], step, place.of_time(number))
    for name, numbers in led.items():
        scan.routines |= {_numbered(name, number): scan.routines[name] for number in numbers}
    scan.bodies = _bodies(scan, followed, led, place)


def _leads(step: Step, routine: Routine, followed: Container[str]) -> bool:
    """Whether a step of a routine is the call of another one that is followed."""
    return step.kind == "call" and step.name in followed and step.name != routine.name


def _numbered(name: str, call: int) -> str:
    return f"{name} {call}"


def _tell(scan: Scan, called: _Called, step: Step, targets: range) -> None:
    """Says in the scan what the targets of a call are."""
    for at, target in enumerate(targets):
        scan.handed[target] = "" if at in called.own else _REASON
        if at in called.referred:
            scan.referred.add(target)
    if step.turn >= 0:
        scan.looped.update(targets)
    elif called.alone:
        scan.alone[targets.start] = step.start, step.end


def _bodies(scan: Scan, followed: Container[str], led: Mapping[str, list[int]], place: Places) -> list[Routine]:
    """The routines in the order of the text, with what stands in them where it stands now; of those that are followed one for
    each of the calls `led`."""
    bodies: list[Routine] = []
    behind = 0
    for routine in scan.bodies:
        first = place(routine.first, behind)
        within, moved = list[Step](), list[Step]()
        for step in routine.steps:
            at, holds = place(step.at, behind), 0
            if _leads(step, routine, followed):
                holds = len(place.of_time(behind))
                step, behind = step._replace(name=_numbered(step.name, behind)), behind + 1
            within.append(step._replace(at=step.at - routine.first))
            moved.append(step._replace(at=at, holds=holds))
        if routine.name not in followed:
            bodies.append(Routine(routine.name, first, routine.kind, routine.scope, moved, place(routine.stop, behind),
                                  routine.local))
        for number in led.get(routine.name, ()):
            targets = place.of_time(number)
            bodies.append(Routine(_numbered(routine.name, number), targets.start, routine.kind, routine.scope,
                                  [step._replace(at=targets.start + step.at) for step in within], targets.stop, routine.local))
    return bodies


def _called(scan: Scan, values: Values, routine: Routine, looped: Turns) -> _Called | None:
    """A routine as its calls drive it; None where it is another one, or no call is known."""
    slots = _slots(scan, values, routine)
    if not slots:
        return None
    exprs = [_expression(scan, target) for target in range(routine.first, routine.stop)]
    named = [_parameter(expr, slots) for expr in exprs]
    if "" in named or _switched(scan, routine):
        return None
    calls = [(step, body.scope) for body in scan.bodies if body is not routine for step in body.steps
             if step.kind == "call" and step.name == routine.name]
    if routine.local and any(scope.module != routine.scope.module for _, scope in calls):
        return None
    if not 0 < len(calls) * len(exprs) <= MOST:
        return None
    times = []
    for step, scope in calls:
        given = _given(scan, values, step, scope, routine.scope, looped)
        if any(slots[name] >= len(given) or given[slots[name]] is None for name in named):
            return None
        handed = {name: one for name in named if (one := given[slots[name]]) is not None}
        times.append(Time(routine.first, routine.stop, [_put(expr, handed) for expr in exprs], step.at, step.start))
    count = Counter(named)
    own = frozenset(at for at, (expr, name) in enumerate(zip(exprs, named, strict=True))
                    if expr.kind == "name" and count[name] == 1 and (name, routine.scope) not in scan.uses.read)
    modes = {scan.names.declarations[one.declaration].name: one.mode for one in scan.routines[routine.name]}
    referred = frozenset(at for at, name in enumerate(named) if modes[name] != "in")
    return _Called(times, own, referred, own == {0} and not referred and len(calls) <= FEW and _alone(scan, routine))


def _alone(scan: Scan, routine: Routine) -> bool:
    """Whether a MoveL that several may follow each other of is all that stands in a routine of one target."""
    data, start = scan.source.data, scan.start[routine.first]
    header = max(scan.names.declarations[one.declaration].end for one in scan.routines[routine.name])
    tail = _BEHIND.match(data, scan.end[routine.first])
    return (len(scan.tails) > 0 and _BEFORE.fullmatch(data, header, start) is not None and tail is not None
            and not OF_ONE_MOVE.search(tail.group()) and scan.tails[scan.tail[routine.first]].signal is None)


def _slots(scan: Scan, values: Values, routine: Routine) -> dict[str, int]:
    """The required parameters for targets that a routine leaves as they are, and which arguments they are."""
    if routine.kind != "proc" or routine.stop == routine.first:
        return {}
    declarations = scan.names.declarations
    return {declarations[one.declaration].name: one.slot for one in scan.routines.get(routine.name, ())
            if isinstance(one.slot, int) and one.declaration not in values.changing
            and declarations[one.declaration].type == "robtarget" and not declarations[one.declaration].dimensions}


def _expression(scan: Scan, target: int) -> Expr:
    """The expression of a target; one of kind "other" where it stands in the move in figures."""
    start, end = scan.start[target], scan.end[target]
    spelled = scan.source.fold(scan.source.data[start:end].strip()) if scan.name[target] >= 0 else ""
    return scan.expressions.get(target) or Expr("name" if spelled else "other", start, end, spelled)


def _parameter(expr: Expr, slots: dict[str, int]) -> str:
    """The parameter that a target is, or is shifted from; "" for none."""
    while expr.kind == "call" and expr.name in ("offs", "reltool") and expr.items:
        expr = expr.items[0]
    return expr.name if expr.kind == "name" and expr.name in slots else ""


def _switched(scan: Scan, routine: Routine) -> bool:
    """Whether something that holds for the moves behind it is switched between the moves of a routine, or it has moves that are
    not counted."""
    called = {step.name for step in routine.steps if step.kind == "call"} - scan.routines.keys()
    return any(MOTION.fullmatch(name) for name in called) or any(routine.first < int(entry[0]) < routine.stop
               for entries in (scan.shifts, scan.softened, scan.offsets, scan.units) for entry in entries)


def _given(scan: Scan, values: Values, step: Step, scope: Scope, within: Scope, looped: Turns) -> list[Expr | None]:
    """The required arguments of a call; None for those whose names mean something else within the routine."""
    found: list[Expr | None] = []
    held = looped.get(step.turn, {})
    for part in arguments(scan.source, step):
        expr = values.parse(part[0].start, part[-1].end) if part else None
        if expr is not None and any(one.name in held for one in expr.walk()):
            expr = target_at(values, expr, scope, held)
        names = [] if expr is None else [one.name for one in expr.walk() if one.name and one.kind != "call"]
        found.append(expr if all(_same(scan, name, scope, within) for name in names) else None)
    return found


def _same(scan: Scan, name: str, scope: Scope, within: Scope) -> bool:
    """Whether a name means the same data, no parameter, in two routines."""
    number = scan.names.find(name, scope)
    if number != scan.names.find(name, within):
        return False
    return number < 0 or scan.names.declarations[number].storage != "parameter"


def _put(expr: Expr, given: dict[str, Expr]) -> Expr:
    """An expression with what is handed over in place of the parameters."""
    if expr.kind == "name" and expr.name in given:
        return given[expr.name]
    return replace(expr, items=(_put(expr.items[0], given), *expr.items[1:])) if expr.kind == "call" else expr


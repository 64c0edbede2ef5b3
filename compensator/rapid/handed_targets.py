"""Targets that calls hand over, `PROC cut(robtarget p) MoveL p,... ENDPROC`, as the moves that each call drives.

Only where all targets of the routine are parameters, or Offs and RelTool of such. What is corrected is written into the call:
the move itself stays as it is. Parameters by reference (VAR, PERS, INOUT) are what is handed over as long as the routine does
not change them; a routine of another module of the file is given data that both modules see.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, replace

from compensator.rapid.blocks import Routine, Step, arguments, end_routines
from compensator.rapid.expressions import Expr
from compensator.rapid.handed_loops import Turns, turn_by_turn
from compensator.rapid.repeated import Repeated, places, repeat
from compensator.rapid.runtime import MOTION
from compensator.rapid.scan import Scan
from compensator.rapid.scopes import Scope
from compensator.rapid.unrolled import target_at
from compensator.rapid.values import Values

# A routine that calls drive to more targets keeps one for each of its moves.
MOST = 100_000
_REASON = "the move serves every call of its routine, which goes to more places beside the target that is handed over"


@dataclass(frozen=True, slots=True)
class _Called:
    """A routine of targets that calls hand over, its calls in the order of the text, and its targets at each. own: those,
    counted from its first one, that alone make use of their parameter. referred: those whose parameter is a reference."""

    number: int
    calls: list[Step]
    targets: Repeated
    own: frozenset[int]
    referred: frozenset[int]


def follow_calls(scan: Scan, values: Values) -> None:
    """Gives each call of such a routine a routine of its own, with its targets, and says which these are in `scan.handed`."""
    end_routines(scan.bodies, len(scan.move))
    turns = turn_by_turn(scan, values)
    twice = {name for name, count in Counter(routine.name for routine in scan.bodies).items() if count > 1}
    followed = [called for number, routine in enumerate(scan.bodies) if routine.name not in twice
                and (called := _called(scan, values, number, routine, turns)) is not None]
    if not followed:
        return
    repeats = [called.targets for called in followed]
    names: dict[Step, str] = {}
    for called, targets in zip(followed, repeat(scan, repeats), strict=True):
        count = called.targets.stop - called.targets.first
        scan.handed.update({target: "" if at % count in called.own else _REASON for at, target in enumerate(targets)})
        scan.referred.update(target for at, target in enumerate(targets) if at % count in called.referred)
        scan.looped.update(targets[turn * count + at] for turn, step in enumerate(called.calls) if step.turn >= 0
                           for at in range(count))
        names |= {step: f"{step.name} {turn}" for turn, step in enumerate(called.calls)}
        routine = scan.bodies[called.number]
        scan.routines |= {f"{routine.name} {turn}": scan.routines[routine.name] for turn in range(len(called.calls))}
    by_number = {called.number: called for called in followed}
    bodies: list[Routine] = []
    place = places(repeats)
    for number, routine in enumerate(scan.bodies):
        own = by_number.get(number)
        before = place(routine.first)
        steps = [step._replace(name=names.get(step, step.name)) for step in routine.steps]
        for turn in range(len(own.calls) if own else 1):
            more = turn * (routine.stop - routine.first)
            moved = [step._replace(at=before + more + step.at - routine.first if own else place(step.at))
                     for step in steps]
            name = f"{routine.name} {turn}" if own else routine.name
            bodies.append(Routine(name, before + more, routine.kind, routine.scope, moved, local=routine.local))
    scan.bodies = bodies


def _called(scan: Scan, values: Values, number: int, routine: Routine, looped: Turns) -> _Called | None:
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
    turns = []
    for step, scope in calls:
        given = _given(scan, values, step, scope, routine.scope, looped)
        if any(slots[name] >= len(given) or given[slots[name]] is None for name in named):
            return None
        handed = {name: one for name in named if (one := given[slots[name]]) is not None}
        turns.append([_put(expr, handed) for expr in exprs])
    times = Counter(named)
    own = frozenset(at for at, (expr, name) in enumerate(zip(exprs, named, strict=True))
                    if expr.kind == "name" and times[name] == 1 and (name, routine.scope) not in scan.uses.read)
    modes = {scan.names.declarations[one.declaration].name: one.mode for one in scan.routines[routine.name]}
    referred = frozenset(at for at, name in enumerate(named) if modes[name] != "in")
    return _Called(number, [step for step, _ in calls], Repeated(routine.first, routine.stop, turns), own, referred)


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


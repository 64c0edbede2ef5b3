"""Routines of one name in several modules of a file: a call means that of its own module, as LOCAL has it."""

from __future__ import annotations

from collections import Counter

from compensator.rapid.scan import Scan


def tell_apart(scan: Scan) -> None:
    """Gives such routines, and the calls that mean them, names of their own; leaves those that are called from a module which
    has none of them, or of which one module has several."""
    count = Counter(routine.name for routine in scan.bodies)
    own = Counter((routine.name, routine.scope.module) for routine in scan.bodies)
    called = {(step.name, routine.scope.module) for routine in scan.bodies for step in routine.steps if step.kind == "call"}
    names = {name for name, number in count.items() if number > 1}
    names -= {name for (name, _), number in own.items() if number > 1}
    names -= {name for name, module in called if not own[name, module]}
    for name in sorted(names):
        for parameter in scan.routines.get(name, ()):
            module = scan.names.declarations[parameter.declaration].scope.module
            scan.routines.setdefault(f"{name} of {module}", []).append(parameter)
    for routine in scan.bodies:
        module = routine.scope.module
        if routine.name in names:
            scan.routines.setdefault(f"{routine.name} of {module}", [])
            routine.name = f"{routine.name} of {module}"
        steps = [step for step in routine.steps if step.kind == "call" and step.name in names]
        if steps:
            renamed = {step: step._replace(name=f"{step.name} of {module}") for step in steps}
            routine.steps = [renamed.get(step, step) for step in routine.steps]
            routine.forget()

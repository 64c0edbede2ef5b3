"""Values of the targets that are not plain numbers in the move: named ones, array elements, Offs, RelTool, joints."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import cast

from compensator.rapid.expressions import Expr
from compensator.rapid.quaternions import UNUSABLE, Quaternion, Vector, about, misfit, multiply, rotate, unit
from compensator.rapid.scopes import Scope
from compensator.rapid.values import Site, Unsettled, Values

WIDTH = 17
"""Numbers of a robtarget: x y z [mm], q1..q4, cf1 cf4 cf6 cfx, eax_a..eax_f."""
POSE = 7
"""So many of them are position and orientation."""

_POSITION, _ORIENTATION = ("x", "y", "z"), ("q1", "q2", "q3", "q4")
_CONFDATA = ("cf1", "cf4", "cf6", "cfx")
_EXTERNAL = tuple(f"eax_{letter}" for letter in "abcdef")
_AXES = tuple(f"rax_{axis}" for axis in range(1, 7))
NOTHING = [math.nan] * WIDTH


@dataclass(frozen=True, slots=True)
class Target:
    """What the text says of one target.

    numbers: `WIDTH` of them as written (of a joint target: six angles [deg] first), NaN where not settled.
    problem: why it cannot be corrected. place: where its value stands; None where that is not in this file.
    literal: the numbers themselves stand at `place`, so they can be changed there.
    """

    numbers: list[float]
    problem: Unsettled | None
    place: Site | None
    literal: bool


def read_target(values: Values, expr: Expr, scope: Scope) -> Target:
    """The robtarget that `expr` means in `scope`. Raises CS2004, CS2005 for data no controller would load."""
    if expr.kind not in ("name", "element"):
        return read_site(values, Site(expr, scope))
    place = values.declared(expr, scope, "robtarget")
    return Target(NOTHING, place, None, False) if isinstance(place, Unsettled) else read_site(values, place)


def read_site(values: Values, place: Site) -> Target:
    """The robtarget that stands at `place`. Raises as `read_target`."""
    numbers, problem = _robtarget(values, place.expr, place.scope, 0)
    return Target(numbers, problem, place, place.expr.kind == "aggregate")


def read_joint_target(values: Values, expr: Expr, scope: Scope) -> Target:
    """The jointtarget that `expr` means in `scope`. Raises as `read_target`."""
    site = values.follow(expr, scope, "jointtarget")
    what = "joint target"
    parts = values.parts(site, what, ("rax_1..rax_6", "eax_a..eax_f")) if isinstance(site, Site) else site
    if isinstance(site, Unsettled) or isinstance(parts, Unsettled):
        return Target(NOTHING, site if isinstance(site, Unsettled) else cast(Unsettled, parts), None, False)
    axes = values.numbers(parts[0], site.scope, "robot axes", _AXES, "robjoint")
    external = values.numbers(parts[1], site.scope, "external axes", _EXTERNAL, "extjoint")
    numbers = list(NOTHING)
    problem = None
    if isinstance(axes, Unsettled):
        problem = axes
    else:
        numbers[:6] = axes
    if isinstance(external, Unsettled):
        problem = problem or external
    else:
        numbers[11:] = external
    return Target(numbers, problem, site, False)


def _robtarget(values: Values, expr: Expr, scope: Scope, depth: int) -> tuple[list[float], Unsettled | None]:
    site = values.follow(expr, scope, "robtarget")
    if isinstance(site, Unsettled):
        return NOTHING, site
    if site.expr.kind == "call" and site.expr.name in ("offs", "reltool") and depth < 20:
        return _shifted(values, site.expr, site.scope, depth)
    parts = values.parts(site, "robtarget", ("position", "orientation", "confdata", "external axes"))
    if isinstance(parts, Unsettled):
        return NOTHING, parts
    numbers: list[float] = []
    problem: Unsettled | None = None
    kinds = (("position", _POSITION, "pos"), ("orientation", _ORIENTATION, "orient"),
             ("confdata", _CONFDATA, "confdata"), ("external axes", _EXTERNAL, "extjoint"))
    for part, (what, names, data_type) in zip(parts, kinds, strict=True):
        components = values.numbers(part, site.scope, what, names, data_type)
        if isinstance(components, Unsettled):
            problem = problem or components
            components = (math.nan,) * len(names)
        numbers += components
    return numbers, problem


def _shifted(values: Values, call: Expr, scope: Scope, depth: int) -> tuple[list[float], Unsettled | None]:
    """`Offs(target, x, y, z)` moves along the axes of the object frame; `RelTool(target, dx, dy, dz \\Rx \\Ry \\Rz)` along
    those of the tool at the target, then turns about its x, its new y and its new z axis."""
    spelling, names = ("Offs", ("x", "y", "z")) if call.name == "offs" else ("RelTool", ("dx", "dy", "dz"))
    if len(call.items) != 4:
        raise values.source.fail("CS2004", f"{spelling} has {len(call.items)} arguments, expected 4: target, "
                                 + ", ".join(names), call.start)
    base, problem = _robtarget(values, call.items[0], scope, depth + 1)
    shift: list[float] = []
    for item, name in zip(call.items[1:], names, strict=True):
        value = values.number(item, scope, f"{name} of {spelling}")
        if isinstance(value, Unsettled):
            return NOTHING, value
        shift.append(value)
    numbers = list(base)
    offset = cast(Vector, tuple(shift))
    if call.name == "reltool":
        q = cast(Quaternion, tuple(base[3:7]))
        if not misfit(q) <= UNUSABLE:           # also where q is not known
            numbers[:3] = NOTHING[:3]
            return numbers, problem
        q = unit(q)
        offset = rotate(q, offset)
        turns = dict(call.options)
        for axis, option in enumerate(("rx", "ry", "rz")):
            turn = turns.get(option)
            if turn is None:
                continue
            angle = values.number(turn, scope, f"\\{option.capitalize()} of RelTool")
            if isinstance(angle, Unsettled):
                return NOTHING, angle
            q = multiply(q, about(axis, angle))
        numbers[3:7] = q
    for axis in range(3):
        numbers[axis] += offset[axis]
    return numbers, problem

"""Tools and work objects of the moves, as `ToolFrame` and `WorkObject`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import cast

import numpy as np

from compensator.rapid.expressions import Expr
from compensator.rapid.quaternions import SLIGHT, UNUSABLE, Quaternion, Vector, misfit, multiply, rotate, unit
from compensator.rapid.scopes import Scope
from compensator.rapid.values import Site, Unsettled, Values
from compensator.toolpath import ToolFrame, WorkObject

Pose = tuple[Vector, Quaternion]        # position [mm], unit quaternion
Key = tuple[object, ...]
# A frame of so small numbers is none.
NO_FRAME = 1e-9
IDENTITY: Pose = ((0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0))

_TOOL = ("robhold", "tframe", "tload")
_WORKOBJECT = ("robhold", "ufprog", "ufmec", "uframe", "oframe")


@dataclass(slots=True)
class Frames:
    """One frame for each distinct declared data that moves name, in the order of their first use.

    handed: what parameters of routines stand for (`handed_in`), by their numbers; taken: those that a move named.
    offsets: of the declaration of each tool and work object, -1 where there is none. slight: offsets of the frames whose
    quaternion had to be normalised.
    """

    values: Values
    handed: Mapping[int, tuple[Expr, Scope]] = field(default_factory=dict)
    tools: list[ToolFrame] = field(default_factory=list)
    workobjects: list[WorkObject] = field(default_factory=list)
    tool_offsets: list[int] = field(default_factory=list)
    workobject_offsets: list[int] = field(default_factory=list)
    slight: list[int] = field(default_factory=list)
    taken: set[int] = field(default_factory=set)
    _tool_keys: dict[Key, int] = field(default_factory=dict)
    _workobject_keys: dict[Key, int] = field(default_factory=dict)

    def tool(self, expr: Expr, scope: Scope) -> int:
        """Number of the tool that `expr` means in `scope`."""
        expr, scope = self._meant(expr, scope)
        key, offset = self._key(expr, scope)
        number = self._tool_keys.setdefault(key, len(self.tools))
        if number == len(self.tools):
            pose, problem = self._read_tool(expr, scope)
            position, quaternion = _arrays(pose)
            self.tools.append(ToolFrame(self.values.spelled(expr), position, quaternion, problem=problem))
            self.tool_offsets.append(offset)
        return number

    def workobject(self, expr: Expr | None, scope: Scope) -> int:
        """Number of the work object that `expr` means in `scope`; a move that names none uses wobj0."""
        if expr is not None:
            expr, scope = self._meant(expr, scope)
        key, offset = (("", "wobj0"), -1) if expr is None else self._key(expr, scope)
        number = self._workobject_keys.setdefault(key, len(self.workobjects))
        if number == len(self.workobjects):
            pose, problem, unit = (IDENTITY, "", "") if expr is None else self._read_workobject(expr, scope)
            position, quaternion = _arrays(pose)
            name = "wobj0" if expr is None else self.values.spelled(expr)
            self.workobjects.append(WorkObject(name, position, quaternion, problem=problem, unit=unit))
            self.workobject_offsets.append(offset)
        return number

    def _meant(self, expr: Expr, scope: Scope) -> tuple[Expr, Scope]:
        """What a name stands for, where it is that of a parameter, and the scope it is looked up in."""
        for _ in range(20):
            number = self.values.names.find(expr.name, scope) if expr.kind == "name" else -1
            if number not in self.handed:
                break
            self.taken.add(number)
            expr, scope = self.handed[number]
        return expr, scope

    def _key(self, expr: Expr, scope: Scope) -> tuple[Key, int]:
        number = self.values.names.find(expr.name, scope) if expr.kind in ("name", "element") else -1
        if number < 0:
            return ("", expr.name if expr.kind == "name" else self.values.spelled(expr)), -1
        offset = self.values.names.declarations[number].start
        if expr.kind == "element":
            return (number, self.values.spelled(expr)), offset
        return (number,), offset

    def _read_tool(self, expr: Expr, scope: Scope) -> tuple[Pose | None, str]:
        site = self._site(expr, scope, "tooldata", "tool0")
        if not isinstance(site, Site):
            return site
        parts = self.values.parts(site, "tooldata", _TOOL)
        if isinstance(parts, Unsettled):
            return None, parts.why
        held = self.values.flag(parts[0], site.scope, "robhold of the tool")
        if held is not True:
            return None, held.why if isinstance(held, Unsettled) else "it is stationary (robhold is FALSE)"
        return self._pose(parts[1], site.scope, "tframe")

    def _read_workobject(self, expr: Expr, scope: Scope) -> tuple[Pose | None, str, str]:
        """Pose, problem, and the mechanical unit that moves it."""
        site = self._site(expr, scope, "wobjdata", "wobj0")
        if not isinstance(site, Site):
            return *site, ""
        parts = self.values.parts(site, "wobjdata", _WORKOBJECT)
        if isinstance(parts, Unsettled):
            return None, parts.why, ""
        held = self.values.flag(parts[0], site.scope, "robhold of the work object")
        if held is not False:
            return None, held.why if isinstance(held, Unsettled) else "the robot holds it (robhold is TRUE)", ""
        fixed = self.values.flag(parts[1], site.scope, "ufprog of the work object")
        if isinstance(fixed, Unsettled):
            return None, fixed.why, ""
        unit = ""
        if not fixed:
            named = self.values.follow(parts[2], site.scope, "string")
            unit = self.values.spelled(named.expr).strip('"') if isinstance(named, Site) and named.expr.kind == "string" else ""
            if not unit:
                return None, "a mechanical unit moves its user frame (ufprog is FALSE), and ufmec names none", ""
        user, problem = self._pose(parts[3], site.scope, "uframe")
        inner, inner_problem = self._pose(parts[4], site.scope, "oframe")
        if user is None or inner is None:
            return None, problem or inner_problem, unit
        (p, q), (inner_p, inner_q) = user, inner
        if unit:
            # The controller takes the user frame of a unit from its configuration; what stands here must not say otherwise.
            if max(map(abs, (*p, *q[1:]))) > NO_FRAME:
                return None, (f"ufprog is FALSE, so the controller takes the user frame from the unit {unit}, and its uframe "
                              "is not [[0,0,0],[1,0,0,0]]: put the offset into oframe"), unit
            return inner, "", unit
        shifted = rotate(q, inner_p)
        return ((p[0] + shifted[0], p[1] + shifted[1], p[2] + shifted[2]), multiply(q, inner_q)), "", ""

    def _site(self, expr: Expr, scope: Scope, data_type: str, predefined: str) -> Site | tuple[Pose | None, str]:
        """The declared value; or pose and problem where there is none."""
        site = self.values.follow(expr, scope, data_type)
        if isinstance(site, Site):
            return site
        if expr.kind == "name" and self.values.names.find(expr.name, scope) < 0:
            return (IDENTITY if expr.name == predefined else None), ""
        return None, "" if site.why.endswith("no initial value") else site.why

    def _pose(self, expr: Expr, scope: Scope, what: str) -> tuple[Pose | None, str]:
        site = self.values.follow(expr, scope, "pose")
        parts = self.values.parts(site, what, ("position", "orientation")) if isinstance(site, Site) else site
        if isinstance(site, Unsettled) or isinstance(parts, Unsettled):
            return None, f"{what}: {site.why if isinstance(site, Unsettled) else cast(Unsettled, parts).why}"
        p = self.values.numbers(parts[0], site.scope, f"position of {what}", ("x", "y", "z"), "pos")
        q = self.values.numbers(parts[1], site.scope, f"orientation of {what}", ("q1", "q2", "q3", "q4"), "orient")
        for part in (p, q):
            if isinstance(part, Unsettled):
                return None, part.why
        position, quaternion = cast(Vector, p), cast(Quaternion, q)
        off = misfit(quaternion)
        if off > UNUSABLE:
            return None, f"the quaternion of {what} is not a unit quaternion (its sum of squares is off 1 by {off:.3g})"
        if off > SLIGHT:
            self.slight.append(parts[1].start)
        return (position, unit(quaternion)), ""


def _arrays(pose: Pose | None) -> tuple[np.ndarray, np.ndarray] | tuple[None, None]:
    if pose is None:
        return None, None
    return np.array(pose[0]) / 1e3, np.array(pose[1])

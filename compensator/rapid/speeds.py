"""Programmed speed and zone of a move."""

from __future__ import annotations

import math

from compensator.rapid.expressions import Expr
from compensator.rapid.moves import Tail
from compensator.rapid.scopes import Scope
from compensator.rapid.values import Site, Unsettled, Values

_PREDEFINED = (5, 10, 20, 30, 40, 50, 60, 80, 100, 150, 200, 300, 400, 500, 600, 800, 1000, 1500, 2000, 2500, 3000, 4000,
               5000, 6000, 7000)
SPEEDS = {f"v{speed}": float(speed) for speed in _PREDEFINED}
"""TCP speed [mm/s] of the controller's own speeddata; vmax depends on the robot."""

ZONES = {"fine": 0.0, "z0": 0.3} | {f"z{r}": float(r) for r in (1, 5, 10, 15, 20, 30, 40, 50, 60, 80, 100, 150, 200)}
"""Radius [mm] of the controller's own zonedata."""

_SPEED = ("v_tcp", "v_ori", "v_leax", "v_reax")
_ZONE = ("finep", "pzone_tcp", "pzone_ori", "pzone_eax", "zone_ori", "zone_leax", "zone_reax")


def feed(values: Values, tail: Tail, scope: Scope) -> float:
    """TCP speed [m/s]; NaN where the text does not give it (a speed set at run time, vmax, or a time by \\T)."""
    if tail.timed:
        return math.nan
    if tail.velocity is not None:
        return _metre(values.number(tail.velocity, scope, "\\V"))
    part = _parts(values, tail.speed, scope, "speeddata", _SPEED, SPEEDS)
    if isinstance(part, float):
        return part / 1e3
    return _metre(values.number(part[0][0], part[1], "v_tcp of speeddata")) if part else math.nan


def zone(values: Values, tail: Tail, scope: Scope) -> float:
    """Radius [m] of the fly-by zone, 0 for a stop point; NaN where the text does not give it."""
    if tail.stops:
        return 0.0
    if tail.radius is not None:
        return _metre(values.number(tail.radius, scope, "\\Z"))
    part = _parts(values, tail.zone, scope, "zonedata", _ZONE, ZONES)
    if isinstance(part, float):
        return part / 1e3
    if not part:
        return math.nan
    stops = values.flag(part[0][0], part[1], "finep of zonedata")
    if isinstance(stops, Unsettled):
        return math.nan
    return 0.0 if stops else _metre(values.number(part[0][1], part[1], "pzone_tcp of zonedata"))


def _parts(
    values: Values, expr: Expr, scope: Scope, data_type: str, names: tuple[str, ...], predefined: dict[str, float]
) -> tuple[tuple[Expr, ...], Scope] | float | None:
    """The parts of declared or inline data with their scope; [mm] or [mm/s] where it is declared as predefined data."""
    site: Site | Unsettled = Site(expr, scope)
    for _ in range(20):
        if isinstance(site, Unsettled) or site.expr.kind not in ("name", "element"):
            break
        if site.expr.kind == "name" and values.names.find(site.expr.name, site.scope) < 0:
            return predefined.get(site.expr.name)
        site = values.declared(site.expr, site.scope, data_type)
    if isinstance(site, Unsettled):
        return None
    parts = values.parts(site, data_type, names)
    return None if isinstance(parts, Unsettled) else (parts, site.scope)


def _metre(value: float | Unsettled) -> float:
    return value / 1e3 if isinstance(value, float) else math.nan

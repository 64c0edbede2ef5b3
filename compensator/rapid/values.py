"""Values of declared data and of the expressions in moves, as far as the text settles them.

A value that the text does not settle is an `Unsettled` that says why; data that no controller would load is an error.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

from compensator.rapid.arithmetic import arithmetic
from compensator.rapid.expressions import Cursor, Expr, expression
from compensator.rapid.lexer import Token, tokens
from compensator.rapid.scopes import Names, Scope
from compensator.rapid.text import Source

UNUSED = 8.9e9          # an external axis at 9E9 is not used


@dataclass(frozen=True, slots=True)
class Unsettled:
    """Why a value is not known from the text. code: the finding it leads to when it is a target's; name: not declared."""

    code: str
    why: str
    name: str = ""


@dataclass(frozen=True, slots=True)
class Site:
    """An expression that is not just a name, the scope it stands in, and the declaration it is the value of.

    declaration: its number, -1 for an expression that stands in the move itself; indices: of the array element.
    """

    expr: Expr
    scope: Scope
    declaration: int = -1
    indices: tuple[int, ...] = ()


@dataclass(slots=True)
class Values:
    """Looks up declared values; each declaration is parsed once."""

    source: Source
    names: Names
    changing: frozenset[int]
    _parsed: dict[int, Expr] = field(default_factory=dict)
    _under_way: set[tuple[str, Scope]] = field(default_factory=set)

    def follow(self, expr: Expr, scope: Scope, *types: str) -> Site | Unsettled:
        """From a name or array element to what it is declared as, through aliases; anything else as it stands.

        types: the data types the declarations may have.
        """
        site = Site(expr, scope)
        for _ in range(20):
            if site.expr.kind not in ("name", "element"):
                return site
            declared = self.declared(site.expr, site.scope, *types)
            if isinstance(declared, Unsettled):
                return declared
            site = declared
        return Unsettled("CS2010", f"{self.spelled(expr)} is declared by itself")

    def declared(self, expr: Expr, scope: Scope, *types: str) -> Site | Unsettled:
        """The declared value that a name or element stands for, aliases not followed."""
        name = self.source.text(expr.start, expr.start + len(expr.name.encode(self.source.encoding)))
        number = self.names.find(expr.name, scope)
        if number < 0:
            return Unsettled("CS2011", f"{name} is not declared in this file", name)
        declaration = self.names.declarations[number]
        if declaration.storage == "parameter":
            if "robtarget" in types:
                return Unsettled("CS2056", f"{name} is a parameter of the routine, another position at each call")
            return Unsettled("CS2010", f"{name} is a parameter of the routine")
        if number in self.names.doubled:
            return Unsettled("CS2018", f"{name} is declared more than once")
        if number in self.changing:
            return Unsettled("CS2010", f"{name} is assigned at run time")
        if declaration.type not in types:
            return Unsettled("CS2010", f"{name} is declared as {declaration.type}, not {types[0]}")
        if declaration.value_start < 0:
            return Unsettled("CS2010", f"{name} has no initial value")
        value = self.initial(number)
        indices: list[int] = []
        if expr.kind == "element":
            for index in expr.items:
                at = self._index(index, scope)
                if at is None:
                    return Unsettled("CS2056", f"the index of {name} is known only at run time: one move for several positions")
                if not at.is_integer():
                    return Unsettled("CS2010", f"{name} has no element {{{at:g}}}: an index is a whole number")
                indices.append(int(at))
        if len(indices) != declaration.dimensions:
            return Unsettled("CS2010", f"{name} has {declaration.dimensions} dimensions, {len(indices)} indices stand here")
        for at in indices:
            if value.kind != "aggregate" or not 1 <= at <= len(value.items):
                return Unsettled("CS2010", f"{name} has no element {{{at}}} in its declaration")
            value = value.items[at - 1]
        return Site(value, declaration.scope, number, tuple(indices))

    def _index(self, expr: Expr, scope: Scope) -> float | None:
        """The index of an element: a number, or arithmetic of CONST num; None where the text does not settle it."""
        return expr.value if expr.kind == "number" else arithmetic(
            tokens(self.source, expr.start, expr.end), lambda token: self._constant(token, scope))

    def initial(self, number: int) -> Expr:
        """The parsed initial value of a declaration that has one."""
        parsed = self._parsed.get(number)
        if parsed is None:
            declaration = self.names.declarations[number]
            parsed = self._parsed[number] = self.parse(declaration.value_start, declaration.value_end)
        return parsed

    def parse(self, start: int, end: int) -> Expr:
        """The expression that fills source.data[start:end]. Raises CS2003."""
        cursor = Cursor(self.source, tokens(self.source, start, end))
        parsed = expression(cursor)
        if cursor.token.kind != "end":
            raise cursor.fail("';'")
        return parsed

    def parts(self, site: Site, what: str, names: tuple[str, ...]) -> tuple[Expr, ...] | Unsettled:
        """The parts of an aggregate. Raises CS2004 when their number is not that of `names`."""
        expr = site.expr
        if expr.kind in ("number", "string"):
            raise self.source.fail("CS2005", f"found {self.spelled(expr)}, expected {what} [{', '.join(names)}]", expr.start)
        if expr.kind != "aggregate":
            return Unsettled("CS2010", describe(expr, self.source))
        if len(expr.items) != len(names):
            raise self.source.fail("CS2004", f"{what} has {len(expr.items)} components, expected {len(names)}: "
                                   f"[{', '.join(names)}]", expr.start, "look for a missing or additional comma or bracket")
        return expr.items

    def numbers(
        self, expr: Expr, scope: Scope, what: str, names: tuple[str, ...], *types: str
    ) -> tuple[float, ...] | Unsettled:
        """The components of an aggregate of numbers, or of the named data it stands for."""
        site = self.follow(expr, scope, *types)
        items = self.parts(site, what, names) if isinstance(site, Site) else site
        if isinstance(site, Unsettled) or isinstance(items, Unsettled):
            why = site.why if isinstance(site, Unsettled) else describe(site.expr, self.source)
            return Unsettled("CS2017", f"{what}: {why}")
        components: list[float] = []
        for item, name in zip(items, names, strict=True):
            value = self.number(item, site.scope, f"{name} of {what}")
            if isinstance(value, Unsettled):
                return value
            components.append(value)
        return tuple(components)

    def number(self, expr: Expr, scope: Scope, what: str) -> float | Unsettled:
        """A number, a CONST num, or arithmetic of such: only a constant cannot have changed by the time the move runs."""
        if expr.kind == "name":
            site = self.follow(expr, scope, "num")
            if isinstance(site, Unsettled):
                return Unsettled("CS2017", f"{what}: {site.why}")
            if self.names.declarations[site.declaration].storage != "const":
                return Unsettled("CS2017", f"{what}: {expr.name} is not a constant")
            expr, scope = site.expr, site.scope         # its names are those of where it is declared
        if expr.kind in ("string", "aggregate", "star"):
            raise self.source.fail("CS2005", f"found {self.spelled(expr)}, expected a number: {what}", expr.start)
        if expr.kind == "other":
            value = arithmetic(tokens(self.source, expr.start, expr.end), lambda token: self._constant(token, scope))
            return Unsettled("CS2017", f"{what}: {describe(expr, self.source)}") if value is None else value
        if expr.kind != "number":
            return Unsettled("CS2017", f"{what}: {describe(expr, self.source)}")
        if abs(expr.value) == float("inf"):
            raise self.source.fail("CS2005", f"found {self.spelled(expr)}, expected a finite number: {what}", expr.start)
        return expr.value

    def _constant(self, token: Token, scope: Scope) -> float | None:
        """The value of a CONST num by its name; None where it is none, or is declared by itself."""
        asked = token.word, scope
        if asked in self._under_way:
            return None
        self._under_way.add(asked)
        value = self.number(Expr("name", token.start, token.end, token.word), scope, token.word)
        self._under_way.remove(asked)
        return None if isinstance(value, Unsettled) else value

    def flag(self, expr: Expr, scope: Scope, what: str) -> bool | Unsettled:
        """TRUE or FALSE, or a constant of type bool."""
        later = Unsettled("CS2017", f"{what} is known only at run time")
        for _ in range(20):
            if expr.kind == "name" and expr.name in ("true", "false"):
                return expr.name == "true"
            if expr.kind in ("number", "string", "aggregate"):
                raise self.source.fail("CS2005", f"found {self.spelled(expr)}, expected TRUE or FALSE: {what}", expr.start)
            site = self.declared(expr, scope, "bool") if expr.kind in ("name", "element") else None
            if not isinstance(site, Site) or self.names.declarations[site.declaration].storage != "const":
                return later
            expr, scope = site.expr, site.scope
        return later

    def spelled(self, expr: Expr) -> str:
        return self.source.text(expr.start, min(expr.end, expr.start + 40))


def describe(expr: Expr, source: Source) -> str:
    """Why an expression has no value in the text, in a few words."""
    shown: dict[str, Callable[[], str]] = {
        "call": lambda: f"function {source.text(expr.start, expr.start + len(expr.name))} is evaluated at run time",
        "star": lambda: "the position is stored in the controller (*)",
    }
    return shown.get(expr.kind, lambda: "an expression evaluated at run time")()

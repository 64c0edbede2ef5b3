"""Declared data and who sees it: routine data hides module data, LOCAL stays in its module."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple


class Scope(NamedTuple):
    """Where a statement stands: number of the module and of the routine, -1 outside any routine."""

    module: int
    routine: int


class Declaration(NamedTuple):
    """One declared name. Offsets into the source; value_start is -1 where no value is given.

    storage: "const", "pers", "var", or "parameter" of a routine (reach: its access mode then).
    name, type and reach ("local", "task", "") are in lower case; dimensions: 0 for a scalar.
    """

    name: str
    type: str
    storage: str
    reach: str
    scope: Scope
    start: int
    end: int
    value_start: int = -1
    value_end: int = -1
    dimensions: int = 0


@dataclass(slots=True)
class Names:
    """All declarations of a program by number, and how a name is looked up from a scope."""

    declarations: list[Declaration] = field(default_factory=list)
    doubled: set[int] = field(default_factory=set)
    _own: dict[tuple[str, int, int], int] = field(default_factory=dict)
    _everywhere: dict[str, int] = field(default_factory=dict)

    def add(self, declaration: Declaration) -> int:
        number = len(self.declarations)
        self.declarations.append(declaration)
        scope = declaration.scope
        first = self._own.setdefault((declaration.name, scope.module, scope.routine), number)
        if first != number:
            self.doubled.add(first)
        elif scope.routine < 0 and declaration.reach != "local":
            first = self._everywhere.setdefault(declaration.name, number)
            if first != number:
                self.doubled.add(first)
                self.doubled.add(number)
        return number

    def find(self, name: str, scope: Scope) -> int:
        """The number of the declaration that `name` means in `scope`; -1 if this file has none."""
        number = self._own.get((name, scope.module, scope.routine), -1)
        if number < 0 and scope.routine >= 0:
            number = self._own.get((name, scope.module, -1), -1)
        return number if number >= 0 else self._everywhere.get(name, -1)

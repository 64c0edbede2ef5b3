"""The tool and the coordinate system of a file: a program is posted for one of each.

A second coordinate system is refused; of several tools the one that was asked for is posted.
"""

from __future__ import annotations

import math
import re

from compensator.posting.apt.placement import is_identity
from compensator.posting.apt.statements import Statement
from identification.common.findings import CompstiffError, error

_CREO_CSYS = re.compile(r"->\s*CSYS\s*/(.*)", re.IGNORECASE | re.DOTALL)


class Setup:
    """What the file has named so far. chosen: number or name of the tool to post, None: there may be only one.
    trouble: raised when the next motion comes, None where all is well."""

    def __init__(self, chosen: str | None) -> None:
        self.trouble: CompstiffError | None = None
        self.chosen = chosen.strip().upper() if chosen is not None else None
        self._current: dict[str, str] = {}                  # number and name of the tool in the spindle
        self._seen: dict[tuple[str, str], None] = {}        # kind and name of every tool so far, in order
        self._frames: dict[str, tuple[float, ...]] = {}
        self._matrix: list[float] | None = None             # of a $$*CATIA0 block that is being read

    @property
    def elsewhere(self) -> bool:
        """Whether another tool than the one that was asked for is in the spindle."""
        return self.chosen is not None and self.chosen not in self._current.values()

    def tool(self, statement: Statement) -> None:
        """LOADTL, LOAD/TOOL, TOOLNO, TURRET by number, TOOL PATH by name."""
        arguments = statement.arguments
        if statement.word == "TOOL PATH":
            kind, name = "tool name", arguments[2] if arguments[1:2] == ["TOOL"] and len(arguments) > 2 else ""
        else:
            numeric = [argument for argument in arguments if argument[:1].isdigit()]
            kind, name = "tool", numeric[0] if numeric else ""
        if not name:
            return
        self._current[kind] = name
        self._seen[kind, name] = None
        before = next(one for its_kind, one in self._seen if its_kind == kind)
        self.trouble = None if before == name or self.chosen is not None else statement.fail(
            "CS2110", f"found {kind} {name} behind {kind} {before}: a program is posted for the one tool of cell.yaml",
            hint=f"post one program a tool, --tool {before} and --tool {name}, each with the tool in its cell.yaml; or let the "
            "CAM system write one file a tool")

    def check_chosen(self, file: str) -> None:
        """Raises CompstiffError (CS2110) where the tool that was asked for is not in the file."""
        seen = [name for _, name in self._seen]
        if self.chosen is not None and self.chosen not in seen:
            raise error("CS2110", f"tool {self.chosen} is not in this file, which has "
                        f"{', '.join(seen) or 'none by number or name'}", file=file, line=1,
                        hint="name one of them with --tool, or leave --tool out where there is one")

    def coordinates(self, statement: Statement) -> None:
        """MSYS, MCS, OFSTNO. Raises CompstiffError (CS2110) for another one than the first."""
        self._frame(tuple(statement.numbers()), statement)

    def _frame(self, values: tuple[float, ...], statement: Statement) -> None:
        before = self._frames.setdefault(statement.word, values)
        if len(values) != len(before) or math.dist(values, before) > 1e-6:
            raise statement.fail("CS2110", "found a second coordinate system; a program is posted in one work object",
                                 hint="let the CAM system write all operations in one coordinate system, or one file each")

    def comment(self, statement: Statement) -> None:
        """A comment, which may belong to a coordinate system: CATIA's *CATIA0, a name, three rows of four numbers; Creo's
        CSYS. Raises CompstiffError (CS2110, CS2182)."""
        creo = _CREO_CSYS.fullmatch(statement.text)
        if creo is not None:
            self._creo(creo[1], statement)
        if statement.text.upper().startswith("*CATIA0"):
            self._matrix = []
            return
        if self._matrix is None:
            return
        try:
            self._matrix += [float(word) for word in statement.text.split()]
        except ValueError:
            if self._matrix:
                self._matrix = None
        if self._matrix is not None and len(self._matrix) >= 12:
            self._frame(tuple(self._matrix), statement)
            self._matrix = None

    def _creo(self, text: str, statement: Statement) -> None:
        """Raises CompstiffError (CS2182) where Creo's coordinate system is not that of the machine."""
        try:
            values = [float(word) for word in text.replace(",", " ").split()]
        except ValueError:
            values = []
        if not is_identity(values):
            raise statement.fail("CS2182", "found a CSYS that is not the identity: Creo does not say in which of the two "
                                 "systems the points stand",
                                 hint="choose the machine's coordinate system (program zero) for the sequence")

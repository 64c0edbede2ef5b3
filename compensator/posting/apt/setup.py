"""The tool and the coordinate system of a file: a program is posted for one of each, a second one is refused."""

from __future__ import annotations

import math

from compensator.posting.apt.statements import Statement
from identification.common.findings import CompstiffError


class Setup:
    """What the file has named so far. trouble: raised when the next motion comes, None where all is well."""

    def __init__(self) -> None:
        self.trouble: CompstiffError | None = None
        self._tools: dict[str, str] = {}
        self._frames: dict[str, tuple[float, ...]] = {}
        self._matrix: list[float] | None = None             # of a $$*CATIA0 block that is being read

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
        before = self._tools.setdefault(kind, name)
        self.trouble = None if before == name else statement.fail(
            "CS2110", f"found {kind} {name} behind {kind} {before}: a program is posted for the one tool of cell.yaml",
            hint="let the CAM system write one file a tool")

    def coordinates(self, statement: Statement) -> None:
        """MSYS, MCS, OFSTNO. Raises CompstiffError (CS2110) for another one than the first."""
        self._frame(tuple(statement.numbers()), statement)

    def _frame(self, values: tuple[float, ...], statement: Statement) -> None:
        before = self._frames.setdefault(statement.word, values)
        if len(values) != len(before) or math.dist(values, before) > 1e-6:
            raise statement.fail("CS2110", "found a second coordinate system; a program is posted in one work object",
                                 hint="let the CAM system write all operations in one coordinate system, or one file each")

    def comment(self, statement: Statement) -> bool:
        """Whether a comment line belongs to CATIA's axis system: *CATIA0, a name, three rows of four numbers."""
        if statement.text.upper().startswith("*CATIA0"):
            self._matrix = []
            return True
        if self._matrix is None:
            return False
        try:
            self._matrix += [float(word) for word in statement.text.split()]
        except ValueError:
            if self._matrix:
                self._matrix = None
        if self._matrix is not None and len(self._matrix) >= 12:
            self._frame(tuple(self._matrix), statement)
            self._matrix = None
        return True

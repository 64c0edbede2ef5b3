"""CUTTER, NX's TLDATA and Creo's remark of a CUTTER: the shape of the tool that a file says it was made for.

CUTTER/d,r,e,f,a,b,h (APT, ISO 4343): diameter; corner radius; distance of the corner's centre from the axis and from the tip;
angle of the floor to the horizontal and of the flank to the axis [deg]; height. Two numbers are an end mill, one a flat one.
TLDATA/MILL,d,r,h,taper,tip of NX: diameter, corner radius, length, both angles. The heights are not those of the edges alone,
and are not taken. No point of the path depends on these words: what cannot be read of them is said where a cutter is needed.
"""

from __future__ import annotations

import re

from compensator.posting.apt.statements import Statement
from compensator.toolpath import StatedCutter
from identification.common.findings import CompstiffError

_CREO = re.compile(r"->\s*CUTTER\s*/\s*([-+.\dEe]+)\s*", re.IGNORECASE)
# Numbers are rounded in the file: lengths [of the file's unit] and angles [deg] that are one.
SAME, STRAIGHT = 2e-3, 0.05


class Cutters:
    """The cutter in force, and every one that moved."""

    def __init__(self) -> None:
        self._last: Statement | None = None
        self._met: dict[tuple[Statement, float], StatedCutter] = {}

    def take(self, statement: Statement) -> None:
        """CUTTER or TLDATA."""
        self._last = statement

    def comment(self, statement: Statement) -> None:
        """A comment, which may be Creo's cutter."""
        if _CREO.fullmatch(statement.text.strip()) is not None:
            self._last = statement

    def moves(self, scale: float) -> None:
        """A motion with the cutter in force. scale: metres in one unit of the file."""
        if self._last is not None and (self._last, scale) not in self._met:
            self._met[self._last, scale] = _stated(self._last, scale)

    def stated(self) -> tuple[StatedCutter, ...]:
        """Those that moved, without repetitions, in order."""
        seen = {(cutter.diameter, cutter.corner, cutter.beyond): cutter for cutter in reversed(self._met.values())}
        return tuple(reversed(seen.values()))


def _stated(statement: Statement, scale: float) -> StatedCutter:
    line, column = statement.place()
    try:
        diameter, corner, beyond = _shape(statement)
    except CompstiffError as reason:
        diameter, corner, beyond = 0.0, None, f"it cannot be read: {reason.findings[0].message}"
    return StatedCutter(scale * diameter, None if corner is None else scale * corner, statement.spelled(), statement.file, line,
                        column, beyond)


def _shape(statement: Statement) -> tuple[float, float | None, str]:
    """Diameter and corner radius [units of the file] (None: not said), and what of it no end mill with upright flank and
    level floor has. Raises CompstiffError (CS2101)."""
    creo = _CREO.fullmatch(statement.text.strip()) if statement.word not in ("CUTTER", "TLDATA") else None
    if creo is not None:
        try:
            values = [float(creo[1])]
        except ValueError:
            return 0.0, None, "it cannot be read"
    elif statement.word == "TLDATA":
        if statement.arguments[:1] != ["MILL"]:
            return 0.0, None, "it is no end mill"
        given = statement.numbers(1, 6)
        values = given[:2]
        if len(given) == 5:     # its angles in CUTTER's order: floor, then flank
            values += [given[0] / 2 - given[1], given[1], given[4], given[3]]
    else:
        values = statement.numbers(0, 7)
    if not values or values[0] <= 0:
        return 0.0, None, "its diameter is not above zero"
    if len(values) == 1:
        return values[0], None, ""
    diameter, corner = values[:2]
    if not 0 <= corner <= diameter / 2 + SAME:
        return diameter, corner, "its corner radius is not between zero and half the diameter"
    away, up = (values[2:4] if len(values) >= 4 else (diameter / 2 - corner, corner))
    floor, flank = (values[4:6] if len(values) >= 6 else (0.0, 0.0))
    beyond = []
    if abs(flank) > STRAIGHT:
        beyond.append(f"its flank leans by {flank:g} degrees")
    if abs(floor) > STRAIGHT:
        beyond.append(f"its floor leans by {floor:g} degrees")
    if not beyond and (abs(away - (diameter / 2 - corner)) > SAME or abs(up - corner) > SAME):
        beyond.append("its rounding does not go from the floor to the flank")
    return diameter, min(corner, diameter / 2), ", ".join(beyond)

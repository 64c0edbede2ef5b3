"""CIRCLE, MOVARC and TLON,GOFWD: the statements that announce an arc, each with its own rule for the direction of turning."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from compensator.posting.apt.circles import Arc, sweep_between
from compensator.posting.apt.statements import Statement

Array = NDArray[np.float64]

# Numbers in the file are rounded; start and end may be off the circle by so much [m].
OFF_CIRCLE = 2e-5
# A helix of more turns, or an arc of more chords, is no toolpath.
MOST_TURNS, MOST_CHORDS = 1000, 1_000_000
# Of numbers in brackets [units of the file].
LARGEST = 1e5
_NUMBERS = r"\s*([^()/]*?)\s*"
_TLON = re.compile(r"\(\s*(CIRCLE|CYLNDR)\s*/" + _NUMBERS + r"\)\s*,\s*ON\s*((?:,\s*2\s*,\s*INTOF\s*)?),\s*\(\s*LINE\s*/"
                   + _NUMBERS + r"\)\s*")


@dataclass(frozen=True, eq=False)
class Announced:
    """An arc without its start. centre (3,) [m]. axis (3,): the motion turns positively about it, unless `heading` (3,), the
    direction in which it starts, says otherwise. radius [m], None: that of its start. end (3,) [m]: None where the next GOTO
    gives it. turns: of a helix. sweep [rad]: as stated, else None. far: the end is the second point in which the motion meets
    the line, None: not said.
    """

    statement: Statement
    centre: Array
    axis: Array
    radius: float | None
    heading: Array | None = None
    end: Array | None = None
    turns: int = 1
    sweep: float | None = None
    far: bool | None = None

    def arc(self, start: Array, end: Array) -> Arc:
        """The arc from start to end (3,) [m]. Raises CompstiffError (CS2108) where they do not fit the statement."""
        radius = self._from_axis(start) if self.radius is None else self.radius
        if not radius > OFF_CIRCLE:
            raise self.fail(f"the radius is {1e3 * radius:g} mm, more than {1e3 * OFF_CIRCLE:.2f} mm is expected")
        for what, point in (("start", start), ("end", end)):
            off = self._from_axis(point) - radius
            if abs(off) > OFF_CIRCLE:
                raise self.fail(f"the {what} is {1e3 * off:+.4f} mm off the circle of radius {1e3 * radius:.4f} mm, at "
                                f"most {1e3 * OFF_CIRCLE:.2f} mm is expected")
        axis = self.axis
        if self.heading is not None:
            forwards = float(np.cross(axis, start - self.centre) @ self.heading) / radius
            if abs(forwards) < 0.5:
                raise self.fail("the direction of INDIRV is not along the circle at its start "
                                f"({np.degrees(np.arccos(abs(forwards))):.0f} degrees off), so the sense of turning is not "
                                "known")
            axis = axis if forwards > 0 else -axis
        sweep = sweep_between(start, end, self.centre, axis)
        if self.far is not None and abs(sweep - np.pi) > 0.02 and self.far != (sweep > np.pi):
            raise self.fail(f"the arc turns by {np.degrees(sweep):.1f} degrees to the end of the line, which is its "
                            f"{'first' if sweep < np.pi else 'second'} point on it; the statement says the "
                            f"{'second' if self.far else 'first'}")
        if self.sweep is not None:
            if abs(np.sin((self.sweep - sweep) / 2)) * 2 * radius > 5 * OFF_CIRCLE:
                raise self.fail(f"the arc is stated to turn by {np.degrees(self.sweep):.4f} degrees, its end is at "
                                f"{np.degrees(sweep):.4f}")
            sweep += 2 * np.pi * round((self.sweep - sweep) / (2 * np.pi))
        arc = Arc(start, end, self.centre, axis, sweep + 2 * np.pi * (self.turns - 1))
        if arc.sweep > 2 * np.pi * MOST_TURNS or arc.chords() > MOST_CHORDS:
            raise self.fail(f"the arc makes {arc.sweep / (2 * np.pi):.6g} turns in {arc.chords():.6g} chords, at most "
                            f"{MOST_TURNS} and {MOST_CHORDS} are expected")
        return arc

    def _from_axis(self, point: Array) -> float:
        """Distance of a point from the axis [m]."""
        out = point - self.centre
        return float(np.linalg.norm(out - (out @ self.axis) * self.axis))

    def moved(self, rotation: Array, shift: Array) -> Announced:
        """The arc turned by rotation (3, 3), then shifted (3,) [m]; its heading is where it is to be already."""
        end = None if self.end is None else rotation @ self.end + shift
        return replace(self, centre=rotation @ self.centre + shift, axis=rotation @ self.axis, end=end)

    def fail(self, message: str) -> ValueError:
        """CS2108 at the statement, to be raised."""
        return self.statement.fail("CS2108", message, hint="check the arc output of the CAM system (format, plane, decimals), "
                                   "or write straight moves in place of arcs")


def circle(statement: Statement, scale: float, heading: Array | None) -> Announced:
    """`CIRCLE/x,y,z,i,j,k,r`: right-hand rule (Creo, ICAM); without r, from where the tool is (CAMWorks). With t,f,d,e behind
    it (11 numbers, and TIMES,n) it is NX, whose vector is that of a clockwise motion. scale: metres in one unit. Raises
    CompstiffError (CS2101, CS2108)."""
    arguments = statement.arguments
    turns = 1
    count = len(arguments)
    if count > 2 and arguments[-2] == "TIMES":
        times = statement.numbers(count - 1)[0]
        turns = int(times) if 1 <= times <= MOST_TURNS else 0
        count -= 2
    if count not in (6, 7, 11) or turns < 1:
        raise statement.fail("CS2108", f"CIRCLE: found {count} numbers, expected 6 or 7 (centre, axis, and the radius) or the "
                             f"11 of NX, and TIMES,n with n from 1 to {MOST_TURNS} behind them",
                             hint="let the CAM system write CIRCLE with axis vector, or straight moves")
    values = statement.numbers(0, count)
    axis = _unit(statement, values[3:6], 3)
    clockwise = count == 11
    radius = statement.lengths(scale, 6, 7)[0] if count > 6 else None
    return Announced(statement, np.array(statement.lengths(scale, 0, 3)), -axis if clockwise else axis, radius, heading,
                     turns=turns)


def movarc(statement: Statement, scale: float) -> Announced:
    """`MOVARC/x,y,z,i,j,k,r,ANGLE,a`: right-hand rule (ISO 4343, Autodesk). Raises CompstiffError (CS2101, CS2108)."""
    arguments = statement.arguments
    if len(arguments) != 9 or arguments[7] != "ANGLE":
        raise statement.fail("CS2108", f"MOVARC: found {len(arguments)} arguments, expected 9: centre, axis, radius, ANGLE, "
                             "degrees")
    values = statement.numbers(0, 7)
    degrees = statement.numbers(8)[0]
    if not 0 < degrees <= 360 * MOST_TURNS:
        raise statement.fail("CS2108", f"MOVARC: found an angle of {degrees:g} degrees, expected one above zero and up to "
                             f"{360 * MOST_TURNS}", 8)
    sweep = float(np.radians(degrees))
    return Announced(statement, np.array(statement.lengths(scale, 0, 3)), _unit(statement, values[3:6], 3),
                     statement.lengths(scale, 6, 7)[0], sweep=sweep)


def along_circle(statement: Statement, scale: float, heading: Array | None) -> Announced:
    """`TLON,GOFWD/ (CIRCLE/x,y,z,r),ON[,2,INTOF],(LINE/x1,y1,z1,x2,y2,z2)` (CATIA, Mastercam, Creo): the tool starts as INDIRV
    said and stops where it meets the line from the centre to the second point. CYLNDR has its axis before the radius.
    Raises CompstiffError (CS2108)."""
    match = _TLON.fullmatch(statement.text.strip().upper())
    if match is None:
        raise statement.fail("CS2108", f"{statement.word}: found '{statement.text.strip()[:60]}', expected (CIRCLE/x,y,z,r),ON,"
                             "(LINE/...) or (CYLNDR/x,y,z,i,j,k,r),ON,(LINE/...)",
                             hint="let the CAM system write straight moves in place of arcs")
    kind, numbers, second, line = match.groups()
    values, ends = _numbers(statement, numbers), _numbers(statement, line)
    wanted = 4 if kind == "CIRCLE" else 7
    if len(values) != wanted or len(ends) != 6:
        raise statement.fail("CS2108", f"{kind}: found {len(values)} numbers and {len(ends)} of LINE, expected {wanted} and 6")
    if heading is None:
        raise statement.fail("CS2108", "no INDIRV before this arc says which way it starts",
                             hint="let the CAM system write INDIRV before TLON,GOFWD, or straight moves")
    centre, end = scale * np.array(values[:3]), scale * np.array(ends[3:])
    axis = np.array([0.0, 0.0, 1.0]) if kind == "CIRCLE" else _unit(statement, values[3:6], None)
    off = scale * np.array(ends[:3]) - centre
    if np.linalg.norm(off - (off @ axis) * axis) > OFF_CIRCLE:
        raise statement.fail("CS2108", "the line of the arc does not start at its centre, so its end is not known",
                             hint="let the CAM system write CIRCLE with axis vector, or straight moves")
    return Announced(statement, centre, axis, scale * values[-1], heading, end, far=bool(second.strip()))


def _numbers(statement: Statement, text: str) -> list[float]:
    try:
        values = [float(word) for word in text.split(",")]
    except ValueError:
        values = [math.nan]
    if not all(abs(value) <= LARGEST for value in values):
        raise statement.fail("CS2101", f"{statement.word}: found '{text.strip()}', expected numbers up to {LARGEST:g}")
    return values


def _unit(statement: Statement, values: list[float], argument: int | None) -> Array:
    vector = np.array(values)
    length = math.hypot(*values)
    if abs(length - 1) > 1e-3:
        raise statement.fail("CS2108", f"{statement.word}: the axis {values} has length {length:.4g}, expected 1", argument)
    return vector / length

"""From the text of an APT cutter location file to its moves: one pass, statement by statement."""

from __future__ import annotations

import math
import re
from collections import Counter
from pathlib import Path

import numpy as np

from compensator.posting.apt import words
from compensator.posting.apt.arc_words import Announced, along_circle, circle, movarc
from compensator.posting.apt.moves import Moves, Point
from compensator.posting.apt.setup import Setup
from compensator.posting.apt.statements import COMMENT, Statement, read_text, statements
from compensator.posting.campath import CamPath
from identification.common.arrays import Array
from identification.common.findings import CompstiffError, Finding, counted, error

UPRIGHT = (0.0, 0.0, 1.0)
_INCH_FEED, _MM_FEED = re.compile(r"(?im)^\s*FEDRAT\b.*\b(IPM|IPR)\b"), re.compile(r"(?im)^\s*FEDRAT\b.*\b(MMPM|MMPR)\b")
_UNITS = re.compile(r"(?im)^\s*UNITS\s*/")


def read_apt(file: Path) -> CamPath:
    """Reads an APT-CL file. Raises CompstiffError (CS0005, CS2100 to CS2113), each with file, line and column."""
    text = read_text(file)
    reader = _Reader(str(file), text)
    for statement in statements(text, str(file)):
        if reader.finished:
            reader.behind += 1
            continue
        reader.take(statement)
    return reader.cam_path()


class _Reader:
    """What holds from one statement to the next, and the moves so far (lengths in metres)."""

    def __init__(self, file: str, text: str) -> None:
        self.file = file
        self.stated_units = bool(_UNITS.search(text))
        inch, metric = bool(_INCH_FEED.search(text)), bool(_MM_FEED.search(text))
        if inch and metric and not self.stated_units:
            raise error("CS2105", "FEDRAT is in inches and in millimetres, and no UNITS says what the coordinates are in",
                        file=file, line=1, hint="let the CAM system write UNITS/MM or UNITS/INCHES")
        self.metric = metric
        self.unit = words.INCH if inch and not self.stated_units else 1.0
        self.feed: tuple[float, str] | None = None          # [m], per "minute" or "turn"
        self.feed_assumed = False
        self.turns_per_minute: float | None = None
        self.rapid = self.finished = False
        self.multax: bool | None = None
        self.axis = UPRIGHT
        self.here: Point | None = None
        self.start: Point | None = None                     # of FROM
        self.arc: Announced | None = None
        self.heading: Array | None = None                   # of INDIRV
        self.compensated: Statement | None = None           # CUTCOM in force
        self.homeless: CompstiffError | None = None         # of a GOHOME to nowhere: raised when a motion follows
        self.setup = Setup()
        self.behind = 0
        self.moves = Moves()
        self.remarks: dict[int, list[str]] = {}
        self.unknown: Counter[str] = Counter()
        self.first: dict[str, Statement] = {}               # where a word of a finding stood first
        self.commands = 0
        self.findings: list[Finding] = []

    def take(self, statement: Statement) -> None:
        """One statement. Words are looked up by their name; what has no rule is kept, ignored, refused or counted."""
        word = statement.word
        if word == "GOTO":
            self._goto(statement)
            return
        rule = _RULES.get(word)
        if rule is not None:
            rule(self, statement)
        if word in words.KEPT:
            self._keep(statement)
        elif rule is None and word not in words.IGNORED:
            arguments = statement.arguments
            if words.moves_the_tool(word):
                if not words.without_effect(word, arguments):
                    raise statement.fail("CS2102", f"found {word}, which moves the tool or what it moves in; it is not read",
                                         hint="let the CAM system write the finished path: GOTO, CIRCLE and FEDRAT, no macros, "
                                         "copies, transformations or cycles")
            else:
                self.unknown[word] += 1
                self.first.setdefault(word, statement)

    # Motion

    def _goto(self, statement: Statement) -> None:
        values = statement.numbers()
        many = len(values) > 6 and len(values) % 3 == 0 and self.arc is not None
        if len(values) not in (3, 6) and not many:
            raise statement.fail("CS2101", f"GOTO: found {len(values)} numbers, expected 3 (x, y, z) or 6 (and the tool axis)",
                                 min(len(values), 6))
        if len(values) == 6 and not (self.arc is not None and abs(math.hypot(*values[3:]) - 1) > 1e-3):
            self._turn(statement, values[3:])
            values = values[:3]
        points = [self._metres(values[at:at + 3]) for at in range(0, len(values), 3)]
        if self.arc is None:
            self._move(statement, points[0])
            return
        self._drive(statement, self.arc, points[-1], points[:-1])
        self.arc = None

    def _metres(self, values: list[float]) -> Point:
        scale = 1e-3 * self.unit
        return scale * values[0], scale * values[1], scale * values[2]

    def _turn(self, statement: Statement, values: list[float], first: int = 3) -> None:
        """Sets the tool axis, which holds until another one is given."""
        length = math.hypot(*values)
        if abs(length - 1) > 1e-3:
            raise statement.fail("CS2112", f"the tool axis {values} has length {length:.4g}, expected 1", first,
                                 "the CAM system writes the axis i,j,k as a unit vector from the tip to the spindle")
        axis = (values[0] / length, values[1] / length, values[2] / length)
        if self.multax is False and math.dist(axis, self.axis) > 1e-6:
            raise statement.fail("CS2112", f"found the tool axis {values} while MULTAX is off, where it would stay "
                                 f"{list(self.axis)}", first, "let the CAM system write MULTAX/ON before tilted moves")
        self.axis = axis

    def _begin(self, statement: Statement) -> tuple[bool, float]:
        """What every motion needs: nothing against it, and its speed. Returns rapid and the feed [m/s]."""
        for trouble in (self.homeless, self.setup.trouble):
            if trouble is not None:
                raise trouble
        if self.compensated is not None:
            raise statement.fail("CS2103", f"found a motion while {_spelled(self.compensated)} (line {self.compensated.line}) "
                                 "is in force: the tool centre then runs beside the points written here",
                                 hint="let the CAM system write the path of the tool centre, uncompensated")
        rapid, self.rapid = self.rapid, False
        if rapid:
            return True, math.nan
        if self.feed is None:
            raise statement.fail("CS2107", "found a cutting move before any FEDRAT",
                                 hint="let the CAM system write FEDRAT before the first cut, or RAPID before moves in the air")
        length, per = self.feed
        if per == "minute":
            return False, length / 60.0
        if self.turns_per_minute is None:
            raise statement.fail("CS2107", "the feed is per turn, and no SPINDL says the speed",
                                 hint="write the feed per minute")
        return False, length * self.turns_per_minute / 60.0

    def _move(self, statement: Statement, point: Point) -> None:
        rapid, feed = self._begin(statement)
        self.moves.add(statement.line, point, self.axis, rapid, feed)
        self.here = point

    def _drive(self, statement: Statement, announced: Announced, point: Point, between: list[Point]) -> None:
        """An arc to `point`; between: points on it that the file gives beside its end."""
        start = np.array(self.moves.start(announced, self.here))
        rapid, feed = self._begin(statement)
        arc = announced.arc(start, np.array(point))
        angles = [announced.arc(start, np.array(passed)).sweep for passed in between]
        if np.any(np.diff([0.0, *angles, arc.sweep]) <= -1e-6):
            raise announced.fail("the points of the arc do not follow one another in its sense of turning")
        self.moves.compare(arc, announced.statement.line)
        self.moves.drive(statement.line, arc, self.axis, rapid, feed)
        self.here = point

    def circle(self, statement: Statement) -> None:
        self.arc = circle(statement, 1e-3 * self.unit, self.heading)
        self.heading = None

    def movarc(self, statement: Statement) -> None:
        self.arc = movarc(statement, 1e-3 * self.unit)

    def tlon(self, statement: Statement) -> None:
        announced = along_circle(statement, 1e-3 * self.unit, self.heading)
        self.heading = None
        assert announced.end is not None
        self._drive(statement, announced, tuple(announced.end.tolist()), [])

    def indirv(self, statement: Statement) -> None:
        values = _count(statement, 3)
        length = math.hypot(*values)
        if not length > 0:
            raise statement.fail("CS2108", "INDIRV: the direction has no length", 0)
        self.heading = np.array(values) / length

    def godlta(self, statement: Statement) -> None:
        step = self._metres(_count(statement, 3))
        if self.here is None:
            raise statement.fail("CS2102", "GODLTA: no GOTO or FROM before it says where it starts")
        self._move(statement, (self.here[0] + step[0], self.here[1] + step[1], self.here[2] + step[2]))

    def from_point(self, statement: Statement) -> None:
        values = statement.numbers()
        if len(values) not in (3, 6):
            raise statement.fail("CS2101", f"FROM: found {len(values)} numbers, expected 3 or 6", 0)
        if len(values) == 6:
            self._turn(statement, values[3:])
        self.here = self.start = self._metres(values)

    def gohome(self, statement: Statement) -> None:
        if statement.arguments:
            values = statement.numbers()
            if len(values) not in (3, 6):
                raise statement.fail("CS2101", f"GOHOME: found {len(values)} numbers, expected 3 or 6", 0)
            self.rapid = True
            if len(values) == 6:
                self._turn(statement, values[3:])
            self._move(statement, self._metres(values))
        elif self.start is not None:
            self.rapid = True
            self._move(statement, self.start)
        else:
            self.findings.append(Finding(
                "CS2114", "warning", "GOHOME is left out: the file does not say where home is", self.file, *statement.place(),
                hint="drive the robot away from the part with your own program behind this one"))
            self.homeless = statement.fail("CS2102", "found a motion behind GOHOME, and the file does not say where home is",
                                          hint="let the CAM system write GOHOME/x,y,z or FROM, or a GOTO in its place")

    # State

    def rapid_on(self, statement: Statement) -> None:
        if statement.arguments:
            raise statement.fail("CS2102", f"RAPID: found '{statement.text.strip()}', expected RAPID alone, which holds for "
                                 "the next motion", 0)
        self.rapid = True

    def units(self, statement: Statement) -> None:
        name = statement.arguments[0] if statement.arguments else "nothing"
        if name not in words.UNITS:
            raise statement.fail("CS2105", f"UNITS: found {name}, expected one of {', '.join(words.UNITS)}", 0)
        self.unit = words.UNITS[name]

    def fedrat(self, statement: Statement) -> None:
        """The value before or after the unit word; without one, the file's unit a minute."""
        value: float | None = None
        unit, per = None, "minute"
        for index, argument in enumerate(statement.arguments):
            if argument in words.FEED_UNITS:
                unit, per = words.FEED_UNITS[argument]
            elif value is None:
                value = statement.numbers(index, index + 1)[0]
            else:
                raise statement.fail("CS2101", f"FEDRAT: found '{argument}', expected a value and one of "
                                     f"{', '.join(words.FEED_UNITS)}", index)
        if value is None or value <= 0:
            raise statement.fail("CS2107", f"FEDRAT: found {value}, expected a feed above zero", 0)
        self.feed_assumed |= not any(argument in words.FEED_UNITS for argument in statement.arguments)
        self.feed = (1e-3 * value * (unit or self.unit), per)

    def spindl(self, statement: Statement) -> None:
        """Only the turns a minute are wanted, for feeds per turn."""
        arguments = statement.arguments
        numeric = [index for index, argument in enumerate(arguments) if argument[:1] in "+-.0123456789" and argument]
        if numeric and not {"SFM", "SMM"} & set(arguments):
            self.turns_per_minute = statement.numbers(numeric[0], numeric[0] + 1)[0]

    def multax_on(self, statement: Statement) -> None:
        self.multax = statement.arguments != ["OFF"]
        if not self.multax:
            self.axis = UPRIGHT

    def tlaxis(self, statement: Statement) -> None:
        self._turn(statement, _count(statement, 3), 0)

    def cutcom(self, statement: Statement) -> None:
        first = (statement.arguments or ["ON"])[0]
        if first == "OFF":
            self.compensated = None
        elif first not in ("LENGTH", "ADJUST"):             # of the length: the robot's TCP has it
            self.compensated = statement

    def cycle(self, statement: Statement) -> None:
        if statement.arguments not in (["OFF"], ["NOMORE"]):
            raise statement.fail("CS2102", f"found {_spelled(statement)}: a drilling cycle, which every control drives in its "
                                 "own way", hint="let the CAM system write the cycle as single moves (GOTO)")

    def tool(self, statement: Statement) -> None:
        self.setup.tool(statement)

    def coordinates(self, statement: Statement) -> None:
        self.setup.coordinates(statement)

    def comment(self, statement: Statement) -> None:
        """The name of an operation is kept."""
        if not self.setup.comment(statement) and statement.text.upper().startswith("OPERATION NAME"):
            self._remark(statement.text)

    def fini(self, statement: Statement) -> None:
        self.finished = True

    # Words

    def _keep(self, statement: Statement) -> None:
        if statement.word in words.SAID:
            self._remark(statement.text.strip().strip("'\"") if statement.word != "TOOL PATH" else _spelled(statement))
        else:
            self.commands += 1
            self.first.setdefault("commands", statement)
            self._remark(_spelled(statement))

    def _remark(self, text: str) -> None:
        if text:
            self.remarks.setdefault(len(self.moves), []).append(text)

    # The end

    def cam_path(self) -> CamPath:
        """Everything read, with what there is to say about it."""
        if self.arc is not None:
            raise self.arc.fail("no GOTO behind this arc says where it ends")
        return self.moves.cam_path(self.file, self.remarks, [*self.findings, *self._assumed(), *self._left_out()])

    def _assumed(self) -> list[Finding]:
        findings = []
        if not self.stated_units:
            read = "inches, as FEDRAT is" if self.unit == words.INCH else "millimetres" + ", as FEDRAT is" * self.metric
            findings.append(Finding("CS2106", "note" if "FEDRAT" in read else "warning",
                                    f"no UNITS statement: coordinates are read as {read}", self.file, 1,
                                    hint="" if "FEDRAT" in read else "compare the size of the path with the part"))
        if self.feed_assumed:
            findings.append(Finding("CS2106", "note", "FEDRAT without a unit is read as the file's unit of length a minute",
                                    self.file))
        return findings

    def _left_out(self) -> list[Finding]:
        findings = []
        if self.commands:
            first = self.first["commands"]
            findings.append(Finding(
                "CS2111", "warning", f"{counted(self.commands, 'machine command')} (from {_spelled(first)} on) are comments in "
                "the program: your outputs are not known here", self.file, *first.place(),
                hint="switch spindle and coolant in your own program round this one"))
        for word, number in self.unknown.items():
            findings.append(Finding("CS2104", "warning", f"{word} is not known and was left out", self.file,
                                    *self.first[word].place(), count=number))
        if self.behind:
            findings.append(Finding("CS2114", "warning", f"{counted(self.behind, 'statement')} behind FINI left out",
                                    self.file))
        return findings


def _spelled(statement: Statement) -> str:
    return f"{statement.word}/{statement.text.strip()}" if statement.text.strip() else statement.word


def _count(statement: Statement, wanted: int) -> list[float]:
    values = statement.numbers()
    if len(values) != wanted:
        raise statement.fail("CS2101", f"{statement.word}: found {len(values)} numbers, expected {wanted}", 0)
    return values


_RULES = {
    "GODLTA": _Reader.godlta, "FROM": _Reader.from_point, "GOHOME": _Reader.gohome, "CIRCLE": _Reader.circle,
    "MOVARC": _Reader.movarc, "TLON,GOFWD": _Reader.tlon, "INDIRV": _Reader.indirv, "RAPID": _Reader.rapid_on,
    "UNITS": _Reader.units, "FEDRAT": _Reader.fedrat, "SPINDL": _Reader.spindl, "MULTAX": _Reader.multax_on,
    "TLAXIS": _Reader.tlaxis, "CUTCOM": _Reader.cutcom, "CYCLE": _Reader.cycle, "LOADTL": _Reader.tool, "LOAD": _Reader.tool,
    "TOOLNO": _Reader.tool, "TURRET": _Reader.tool, "TOOL PATH": _Reader.tool, "MSYS": _Reader.coordinates,
    "MCS": _Reader.coordinates, "OFSTNO": _Reader.coordinates, COMMENT: _Reader.comment, "FINI": _Reader.fini,
}

"""From the text of an APT cutter location file to its moves: one pass, statement by statement."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np

from compensator.posting.apt import words
from compensator.posting.apt.arc_words import Announced, along_circle, circle, movarc
from compensator.posting.apt.cutter_words import Cutters
from compensator.posting.apt.drilling import ABOVE_REACHED, Drilling, drilling
from compensator.posting.apt.left_out import LeftOut
from compensator.posting.apt.measures import Measures
from compensator.posting.apt.moves import Moves, Point
from compensator.posting.apt.placement import Placement
from compensator.posting.apt.setup import Setup
from compensator.posting.apt.statements import COMMENT, FARTHEST, Statement, read_text, statements
from compensator.posting.campath import CamPath
from identification.common.arrays import Array
from identification.common.findings import CompstiffError, Finding, counted

UPRIGHT = (0.0, 0.0, 1.0)


def read_apt(file: Path, tool: str | None = None) -> CamPath:
    """Reads an APT-CL file. tool: the one to read of a file with several, by number or name.

    Raises CompstiffError (CS0005, CS2100 to CS2113, CS2182), each with file, line and column.
    """
    text = read_text(file)
    reader = _Reader(str(file), text, tool)
    for statement in statements(text, str(file)):
        if reader.finished:
            reader.left_out.behind += not statement.word.startswith(COMMENT)
            continue
        reader.take(statement)
    return reader.cam_path()


class _Reader:
    """What holds from one statement to the next, and the moves so far (lengths in metres)."""

    def __init__(self, file: str, text: str, tool: str | None) -> None:
        self.file = file
        self.measures = Measures(file, text)
        self.rapid = self.finished = False
        self.multax: bool | None = None
        self.axis = UPRIGHT                                 # as written; TRACUT turns it
        self.axis_stated = False
        self.here: Point | None = None                      # in the work object
        self.start: Point | None = None                     # of FROM
        self.arc: Announced | None = None
        self.heading: Array | None = None                   # of INDIRV
        self.compensated: Statement | None = None           # CUTCOM in force
        self.homeless: CompstiffError | None = None         # of a GOHOME to nowhere: raised when a motion follows
        self.placement = Placement()
        self.setup = Setup(tool)
        self.drilling: Drilling | None = None               # CYCLE in force
        self.holes: list[Drilling] = []                     # the cycle of each hole
        self.cutters = Cutters()
        self.left_out = LeftOut(file)
        self.moves = Moves()
        self.remarks: dict[int, list[str]] = {}
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
        elif rule is None:
            self._pass_over(statement)

    def _pass_over(self, statement: Statement) -> None:
        """A word without a rule."""
        word, arguments = statement.word, statement.arguments
        if words.ignored(word) or words.without_effect(word, arguments):
            self.left_out.ignored(statement)
        elif words.moves_the_tool(word):
            raise statement.fail("CS2102", f"found {word}, which moves the tool, what it moves in or what words mean; it is "
                                 "not read", hint="let the CAM system write the finished path: GOTO, CIRCLE and FEDRAT, no "
                                 "macros, subroutines, copies or machine kinematics")
        elif words.looks_like_a_unit(word, arguments):
            raise statement.fail("CS2105", f"found {statement.spelled()}, which may be the unit of length; it is not read",
                                 hint="let the CAM system write UNITS/MM or UNITS/INCHES")
        else:
            self.left_out.unknown(statement)

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
        if self.arc is None and self.drilling is None:
            self._move(statement, self._point(statement, values))
            return
        points = [self._point(statement, values[at:at + 3]) for at in range(0, len(values), 3)]
        if self.arc is not None:
            self._drive(statement, self.arc, points[-1], points[:-1])
            self.arc = None
        elif self.drilling is not None:
            self._drill(statement, self.drilling, points[0])

    def _point(self, statement: Statement, values: list[float]) -> Point:
        """A written point in the work object."""
        return self.placement.point(self._metres(statement, values))

    def _metres(self, statement: Statement, values: list[float]) -> Point:
        x, y, z = values
        scale = self.measures.scale
        x, y, z = scale * x, scale * y, scale * z
        if abs(x) > FARTHEST or abs(y) > FARTHEST or abs(z) > FARTHEST:
            statement.lengths(scale)                        # raises, with the place
        return x, y, z

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
        self.axis, self.placement.tilted, self.axis_stated = axis, None, True

    def _check(self, statement: Statement) -> None:
        """Raises what is against a motion here."""
        for trouble in (self.homeless, self.setup.trouble):
            if trouble is not None:
                raise trouble
        if self.placement.tilted is not None:
            raise statement.fail("CS2112", "found a motion without tool axis behind a CSYS that is turned (line "
                                 f"{self.placement.tilted.line})", hint="let the CAM system write i,j,k in GOTO")
        if self.compensated is not None:
            raise statement.fail("CS2103", f"found a motion while {self.compensated.spelled()} (line {self.compensated.line}) "
                                 "is in force: the tool centre then runs beside the points written here",
                                 hint="let the CAM system write the path of the tool centre, uncompensated")
        self.cutters.moves(self.measures.scale)

    def _begin(self, statement: Statement) -> tuple[bool, float]:
        """What every motion but the drilling of a hole needs: nothing against it, and its speed. Returns rapid and the feed
        [m/s]."""
        self._check(statement)
        if self.drilling is not None:
            raise statement.fail("CS2102", f"found a motion other than GOTO while {self.drilling.statement.spelled()} (line "
                                 f"{self.drilling.statement.line}) is in force",
                                 hint="let the CAM system write CYCLE/OFF before it")
        rapid, self.rapid = self.rapid, False
        return (True, math.nan) if rapid else (False, self.measures.speed(statement, self.measures.feed))

    def _move(self, statement: Statement, point: Point) -> None:
        if self._skipped(point):
            return
        rapid, feed = self._begin(statement)
        self.moves.add(statement.line, point, self.placement.direction(self.axis), rapid, feed)
        self.here = point

    def _skipped(self, point: Point) -> bool:
        """Whether a motion to `point` is that of a tool that was not asked for."""
        if self.setup.chosen is None or not self.setup.elsewhere:
            return False
        self.left_out.other_tools += 1
        self.here, self.rapid = point, False
        return True

    def _drill(self, statement: Statement, cycle: Drilling, point: Point) -> None:
        self._check(statement)
        if self.rapid:
            raise statement.fail("CS2102", "found RAPID before a GOTO while a drilling cycle is in force: it is not known "
                                 "whether a hole is drilled here", hint="let the CAM system write CYCLE/OFF before it")
        feed, axis = self.measures.speed(statement, cycle.feed or self.measures.feed), self.placement.direction(self.axis)
        for step in cycle.steps(point, axis, self.here):
            if step.rapid and self.here is not None and math.dist(step.point, self.here) < 1e-9:
                continue
            self.moves.add(statement.line, step.point, axis, step.rapid, math.nan if step.rapid else feed)
            if step.stop:
                self.moves.stops.append(len(self.moves) - 1)
            self.here = step.point
        self.holes.append(cycle)
        if cycle.dwell:
            self._remark(f"DWELL {cycle.dwell} at the bottom of the hole is not driven")

    def _drive(self, statement: Statement, announced: Announced, point: Point, between: list[Point]) -> None:
        """An arc to `point`; between: points on it that the file gives beside its end."""
        if self._skipped(point):
            return
        start = np.array(self.moves.start(announced, self.here))
        rapid, feed = self._begin(statement)
        arc = announced.arc(start, np.array(point))
        angles = [announced.arc(start, np.array(passed)).sweep for passed in between]
        if np.any(np.diff([0.0, *angles, arc.sweep]) <= -1e-6):
            raise announced.fail("the points of the arc do not follow one another in its sense of turning")
        self.moves.compare(arc, announced.statement.line)
        self.moves.drive(statement.line, arc, self.placement.direction(self.axis), rapid, feed)
        self.here = point

    def circle(self, statement: Statement) -> None:
        self.arc = self.placement.arc(circle(statement, self.measures.scale, self.heading))
        self.heading = None

    def movarc(self, statement: Statement) -> None:
        self.arc = self.placement.arc(movarc(statement, self.measures.scale))

    def tlon(self, statement: Statement) -> None:
        announced = self.placement.arc(along_circle(statement, self.measures.scale, self.heading))
        self.heading = None
        assert announced.end is not None
        self._drive(statement, announced, tuple(announced.end.tolist()), [])

    def indirv(self, statement: Statement) -> None:
        values = _count(statement, 3)
        length = math.hypot(*values)
        if not length > 0:
            raise statement.fail("CS2108", "INDIRV: the direction has no length", 0)
        x, y, z = values
        self.heading = np.array(self.placement.direction((x / length, y / length, z / length)))

    def godlta(self, statement: Statement) -> None:
        step = self.placement.direction(self._metres(statement, _count(statement, 3)))
        if self.here is None:
            raise statement.fail("CS2102", "GODLTA: no GOTO or FROM before it says where it starts")
        self._move(statement, (self.here[0] + step[0], self.here[1] + step[1], self.here[2] + step[2]))

    def _stated(self, statement: Statement) -> Point:
        """The place behind FROM or GOHOME, with the tool axis where there is one."""
        values = statement.numbers()
        if len(values) not in (3, 6):
            raise statement.fail("CS2101", f"{statement.word}: found {len(values)} numbers, expected 3 or 6", 0)
        if len(values) == 6:
            self._turn(statement, values[3:])
        return self._point(statement, values[:3])

    def from_point(self, statement: Statement) -> None:
        self.here = self.start = self._stated(statement)

    def gohome(self, statement: Statement) -> None:
        home = self._stated(statement) if statement.arguments else self.start
        if home is not None:
            self.rapid = True
            self._move(statement, home)
        elif not self.setup.elsewhere:
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

    def measure(self, statement: Statement) -> None:
        {"FEDRAT": self.measures.fedrat, "SPINDL": self.measures.spindl}.get(statement.word, self.measures.units)(statement)

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
        """INIT of CAMWorks announces a cycle; OFF and NOMORE end it."""
        if statement.arguments in (["OFF"], ["NOMORE"]):
            self.drilling = None
        elif statement.arguments != ["INIT"] and not self.setup.elsewhere:
            self.drilling = drilling(statement, self.measures.scale, self.here)

    def tracut(self, statement: Statement) -> None:
        self.placement.tracut(statement, self.measures.scale)

    def trntyp(self, statement: Statement) -> None:
        self.placement.trntyp(statement)

    def csys(self, statement: Statement) -> None:
        self.placement.csys(statement, self.measures.scale)
        self.axis = UPRIGHT

    def tool(self, statement: Statement) -> None:
        """Where the tool that was asked for comes in, it is not where the one before it was."""
        elsewhere = self.setup.elsewhere
        self.setup.tool(statement)
        if elsewhere != self.setup.elsewhere:
            self.here, self.rapid, self.homeless, self.drilling = None, False, None, None

    def cutter(self, statement: Statement) -> None:
        """Its shape is kept; of the path it says nothing, and that is counted."""
        self.cutters.take(statement)
        self.left_out.ignored(statement)

    def coordinates(self, statement: Statement) -> None:
        self.setup.coordinates(statement)

    def comment(self, statement: Statement) -> None:
        """The name of an operation is kept."""
        self.cutters.comment(statement)
        self.setup.comment(statement)
        if statement.text.upper().startswith("OPERATION NAME"):
            self._remark(statement.text)

    def fini(self, statement: Statement) -> None:
        self.finished = True

    # Words

    def _keep(self, statement: Statement) -> None:
        if statement.word in words.SAID:
            self._remark(statement.text.strip().strip("'\"") if statement.word != "TOOL PATH" else statement.spelled())
        elif not self.setup.elsewhere:
            self.left_out.command(statement)
            self._remark(statement.spelled())

    def _remark(self, text: str) -> None:
        if text:
            self.remarks.setdefault(len(self.moves), []).append(text)

    # The end

    def cam_path(self) -> CamPath:
        """Everything read, with what there is to say about it."""
        if self.arc is not None:
            raise self.arc.fail("no GOTO behind this arc says where it ends")
        self.setup.check_chosen(self.file)
        path = self.moves.cam_path(self.file, self.remarks, [
            *self.findings, *self.measures.findings(), *self._upright(), *self._drilled(),
            *self.left_out.findings(self.setup.chosen)])
        return replace(path, cutters=self.cutters.stated(), spindle_rpm=tuple(self.measures.cut_at_rpm))

    def _upright(self) -> list[Finding]:
        if self.axis_stated or self.multax is False:
            return []
        return [Finding("CS2184", "note", "no tool axis in this file: the tool stands upright, 0,0,1, as in three axes",
                        file=self.file, hint="let the CAM system write i,j,k in GOTO where it does not")]

    def _drilled(self) -> list[Finding]:
        if not self.holes:
            return []
        told = [f"{counted(len(self.holes), 'hole')} of drilling cycles (from {self.holes[0].statement.spelled()} on) became "
                "single moves, with a stop at the bottom"]
        if any(hole.pecks for hole in self.holes):
            told.append("chips are cleared up to the clearance, and the tool comes back in the air to "
                        f"{1e3 * ABOVE_REACHED:g} mm above the depth it had reached")
        if any(hole.back is None for hole in self.holes):
            told.append("the tool goes back to the height it had before the cycle, for no RETURN or RTRCTO says how far")
        if any(hole.dwell for hole in self.holes):
            told.append("DWELL is not driven")
        return [Finding("CS2183", "note", "; ".join(told), self.file, *self.holes[0].statement.place())]


def _count(statement: Statement, wanted: int) -> list[float]:
    values = statement.numbers()
    if len(values) != wanted:
        raise statement.fail("CS2101", f"{statement.word}: found {len(values)} numbers, expected {wanted}", 0)
    return values


_RULES = {
    "GODLTA": _Reader.godlta, "FROM": _Reader.from_point, "GOHOME": _Reader.gohome, "CIRCLE": _Reader.circle,
    "MOVARC": _Reader.movarc, "TLON,GOFWD": _Reader.tlon, "INDIRV": _Reader.indirv, "RAPID": _Reader.rapid_on,
    "UNITS": _Reader.measure, "UNIT": _Reader.measure, "FEDRAT": _Reader.measure, "SPINDL": _Reader.measure,
    "MULTAX": _Reader.multax_on, "TRACUT": _Reader.tracut, "TRNTYP": _Reader.trntyp, "CSYS": _Reader.csys,
    "TLAXIS": _Reader.tlaxis, "CUTCOM": _Reader.cutcom, "CYCLE": _Reader.cycle, "LOADTL": _Reader.tool, "LOAD": _Reader.tool,
    "TOOLNO": _Reader.tool, "TURRET": _Reader.tool, "TOOL PATH": _Reader.tool, "MSYS": _Reader.coordinates,
    "MCS": _Reader.coordinates, "OFSTNO": _Reader.coordinates, "CUTTER": _Reader.cutter,
    "TLDATA": _Reader.cutter, COMMENT: _Reader.comment, "FINI": _Reader.fini,
}

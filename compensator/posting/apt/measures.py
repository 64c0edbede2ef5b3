"""What the numbers of an APT file are measured in: the unit of length, and the feed."""

from __future__ import annotations

import itertools
import re

from compensator.posting.apt import words
from compensator.posting.apt.statements import Statement
from identification.common.findings import Finding, error

_INCH_FEED, _MM_FEED = re.compile(r"(?im)^\s*FEDRAT\b.*\b(IPM|IPR)\b"), re.compile(r"(?im)^\s*FEDRAT\b.*\b(MMPM|MMPR)\b")
_UNITS = re.compile(r"(?im)^\s*(?:N?\d+\s+)?UNITS?\s*/")
# No feed of a robot is beyond these [m/s].
SLOWEST, FASTEST = 1e-9, 100.0
Feed = tuple[float, str]                # metres, per "minute" or "turn"


class Measures:
    """Unit, feed and spindle speed in force. unit: millimetres in one unit of the file."""

    def __init__(self, file: str, text: str) -> None:
        """Raises CompstiffError (CS2105) where the unit is not stated and the feeds contradict each other."""
        self.file = file
        self.stated = bool(_UNITS.search(text))
        inch, metric = bool(_INCH_FEED.search(text)), bool(_MM_FEED.search(text))
        if inch and metric and not self.stated:
            raise error("CS2105", "FEDRAT is in inches and in millimetres, and no UNITS says what the coordinates are in",
                        file=file, line=1, hint="let the CAM system write UNITS/MM or UNITS/INCHES")
        self.metric = metric
        self.unit = words.INCH if inch and not self.stated else 1.0
        self.feed: Feed | None = None
        self._feed_assumed = False
        self._turns_per_minute: float | None = None
        self.cut_at_rpm: dict[float, None] = {}             # at which moves cut, as far as stated, in their order
        self._counterclockwise: Statement | None = None     # the SPINDL in force that says so
        self._cut_so: Statement | None = None               # the first of them under which a move cuts

    @property
    def scale(self) -> float:
        """Metres in one unit of the file."""
        return 1e-3 * self.unit

    def units(self, statement: Statement) -> None:
        """UNITS, and UNIT of CAMWorks."""
        name = statement.arguments[0] if statement.arguments else "nothing"
        if name not in words.UNITS:
            raise statement.fail("CS2105", f"{statement.word}: found {name}, expected one of {', '.join(words.UNITS)}", 0)
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
        self._feed_assumed |= not any(argument in words.FEED_UNITS for argument in statement.arguments)
        self.feed = (1e-3 * value * (unit or self.unit), per)

    def spindl(self, statement: Statement) -> None:
        """The turns a minute, for feeds per turn, and the sense, which decides to which side the force points."""
        arguments = statement.arguments
        if "CCLW" in arguments:
            self._counterclockwise = statement
        elif "CLW" in arguments:
            self._counterclockwise = None
        numeric = [index for index, (before, argument) in enumerate(itertools.pairwise(["RPM", *arguments]))
                   if argument[:1] in "+-.0123456789" and argument and before in words.OF_SPEED]
        if numeric:
            of_surface = {"SFM", "SMM"} & set(arguments)
            self._turns_per_minute = None if of_surface else statement.numbers(numeric[0], numeric[0] + 1)[0]

    def speed(self, statement: Statement, feed: Feed | None) -> float:
        """A feed as metres a second. Raises CompstiffError (CS2107) at the motion that has none, or one that no robot has."""
        if feed is None:
            raise statement.fail("CS2107", "found a cutting move before any FEDRAT",
                                 hint="let the CAM system write FEDRAT before the first cut, or RAPID before moves in the air")
        length, per = feed
        self._cut_so = self._cut_so or self._counterclockwise
        if self._turns_per_minute:
            self.cut_at_rpm[self._turns_per_minute] = None
        if per == "turn" and self._turns_per_minute is None:
            raise statement.fail("CS2107", "the feed is per turn, and no SPINDL says the speed",
                                 hint="write the feed per minute")
        speed = length * (1.0 if per == "minute" else self._turns_per_minute or 0.0) / 60.0
        if not SLOWEST <= speed <= FASTEST:
            raise statement.fail("CS2107", f"found a feed of {1e3 * speed:g} mm/s, expected {1e3 * SLOWEST:g} to "
                                 f"{1e3 * FASTEST:g}", hint="check FEDRAT and its unit, and SPINDL where the feed is per turn")
        return speed

    def findings(self) -> list[Finding]:
        """What had to be assumed."""
        findings = []
        if not self.stated:
            read = "inches, as FEDRAT is" if self.unit == words.INCH else "millimetres" + ", as FEDRAT is" * self.metric
            findings.append(Finding("CS2106", "note" if "FEDRAT" in read else "warning",
                                    f"no UNITS statement: coordinates are read as {read}", self.file, 1,
                                    hint="" if "FEDRAT" in read else "compare the size of the path with the part"))
        if self._feed_assumed:
            findings.append(Finding("CS2106", "note", "FEDRAT without a unit is read as the file's unit of length a minute",
                                    self.file))
        if self._cut_so is not None:
            findings.append(Finding(
                "CS2116", "warning", f"{self._cut_so.spelled()} turns the spindle counterclockwise: its force is the mirror "
                "image of the clockwise one that is taken here for every cutter", self.file, *self._cut_so.place(),
                hint="a left-hand tool, or a slip in the CAM system? A log is used as it is, and CS3068 or CS3074 may be said "
                "of it; forces from the stock are refused"))
        return findings

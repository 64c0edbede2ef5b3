"""The moves of a file while it is read: straight ones, and arcs as MoveC or as chords."""

from __future__ import annotations

import math

import numpy as np

from compensator.posting.apt.arc_words import Announced
from compensator.posting.apt.circles import Arc
from compensator.posting.campath import CamPath
from compensator.toolpath import Move
from identification.common.findings import Finding, counted, error

Point = tuple[float, float, float]
# Cosine between an arc's start and the move before it, below which the arc turns back: 120 degrees, no corner that CAM rounds.
BACKWARDS = -0.5


class Moves:
    """Columns of a `CamPath` that grow; lengths in metres, feeds in m/s."""

    def __init__(self) -> None:
        self.move, self.line = bytearray(), list[int]()
        self.position, self.axis = list[Point](), list[Point]()
        self.rapid, self.feed = list[bool](), list[float]()
        self.stops = list[int]()                # targets with a stop point
        self.arcs = self.chords = 0             # how many arcs became MoveC, and how many chords
        self.longest = 0.0                      # of a MoveC
        self.ahead = self.backwards = 0         # arcs that go on as the straight move before them, and that turn back
        self.back_at = 0                        # line of the first that turns back

    def __len__(self) -> int:
        return len(self.move)

    def add(self, line: int, point: Point, axis: Point, rapid: bool, feed: float, move: Move = Move.LINEAR) -> None:
        """One target."""
        self.move.append(move)
        self.line.append(line)
        self.position.append(point)
        self.axis.append(axis)
        self.rapid.append(rapid)
        self.feed.append(feed)

    def drive(self, line: int, arc: Arc, axis: Point, rapid: bool, feed: float) -> None:
        """An arc from where the tool is; the tool axis turns evenly from what it was to `axis`."""
        before = self.axis[-1]
        count = arc.pieces() if math.dist(before, axis) < 1e-9 else 0
        if count:
            self.arcs += 1
            self.longest = max(self.longest, arc.radius * arc.sweep / count)
            for number, (x, y, z) in enumerate(arc.points(2 * count).tolist()):
                self.add(line, (x, y, z), axis, rapid, feed, Move.ARC_END if number % 2 else Move.ARC_VIA)
            return
        self.chords += 1
        steps = arc.chords()
        turned = np.linspace(before, axis, steps + 1)[1:]
        turned /= np.linalg.norm(turned, axis=1, keepdims=True)
        for (x, y, z), (i, j, k) in zip(arc.points(steps).tolist(), turned.tolist(), strict=True):
            self.add(line, (x, y, z), (i, j, k), rapid, feed)

    def compare(self, arc: Arc, line: int) -> None:
        """Whether the arc goes on as the straight move before it went, as nearly every arc of a CAM system does."""
        if len(self.move) < 2 or self.move[-1] != Move.LINEAR:
            return
        step = np.subtract(self.position[-1], self.position[-2])
        length = float(np.linalg.norm(step))
        along = float(step @ arc.tangent()) / length if length > 1e-7 else 0.0
        self.ahead += along > -BACKWARDS
        if along < BACKWARDS:
            self.backwards += 1
            self.back_at = self.back_at or line

    def start(self, announced: Announced, here: Point | None) -> Point:
        """Where an arc starts. Raises CompstiffError (CS2108) where no target says so."""
        if here is None or not self.move:
            raise announced.fail("no GOTO before this arc says where it starts")
        return here

    def cam_path(self, file: str, remarks: dict[int, list[str]], findings: list[Finding]) -> CamPath:
        """Everything as arrays. Raises CompstiffError: CS2113 (no move), CS2109 (most arcs turn back)."""
        if not self.move:
            raise error("CS2113", "no GOTO in this file moves the tool", file=file, line=1,
                        hint="name the cutter location file that the CAM system wrote (APT, CLS); G-code is not read")
        if self.backwards > self.ahead:
            raise error("CS2109", f"{self.backwards} of {self.backwards + self.ahead} arcs start against the move before them: "
                        "the file means the other sense of turning", file=file, line=self.back_at,
                        hint="CIRCLE with 7 numbers is read by the right-hand rule, with the 11 of NX as clockwise; let the "
                        "CAM system write straight moves")
        return CamPath(
            source=file, form="APT", move=np.frombuffer(bytes(self.move), dtype=np.uint8), line=np.array(self.line),
            position=np.array(self.position), axis=np.array(self.axis), quaternion=None, rapid=np.array(self.rapid),
            feed=np.array(self.feed), stop=np.isin(np.arange(len(self.move)), self.stops), confdata=None, joints=None,
            remarks={at: tuple(lines) for at, lines in remarks.items()}, findings=(*findings, *self._of_arcs(file)))

    def _of_arcs(self, file: str) -> list[Finding]:
        findings = []
        if self.backwards:
            findings.append(Finding(
                "CS2109", "warning", f"{counted(self.backwards, 'arc')} of {self.arcs + self.chords} start against the move "
                "before them", file, self.back_at, hint="look at these arcs before cutting"))
        if self.arcs:
            findings.append(Finding(
                "CS2115", "note", f"{counted(self.arcs, 'arc')} became MoveC of up to 120 degrees, at most "
                f"{1e3 * self.longest:.1f} mm long; each has a target in its middle and at its end", file))
        if self.chords:
            findings.append(Finding(
                "CS2115", "note", f"{counted(self.chords, 'arc')} became chords within 0.002 mm: a helix, a turning tool axis, "
                "or too small for MoveC", file))
        return findings

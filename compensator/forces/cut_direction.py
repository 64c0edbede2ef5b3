"""What the direction of the cutting force against the travel says of the sign and the frame that cell.yaml states for a log.

Seen along the spindle, from its motor to its tip, a cutter turns clockwise; stock stands before it. With T the mean tangential
force on the tool, against the edges' motion, and R the radial one, away from the stock, the mean force on the tool is along the
feed and to its left

    full slot                     -R,  T        backwards by a little and to the left
    climb, little engagement       T,  R        forwards: the cutter pulls itself along
    conventional, little          -T, -R        backwards and away from the stock on the left

and between these for engagements between (Altintas, Manufacturing Automation, ch. 2). So it lies from some degrees to the left
of the feed over the left to somewhat right of backwards, and never forwards to the right. Turned over by a wrong sign it mostly
does; only climb milling of little engagement looks then like conventional milling, and the other way round. Which of the two
it is the order of the passes tells where several lie side by side (stock_side.py): then a thin cut tells the sign too, and a
sensor turned by a quarter about the tool's axis shows. In a wrong frame the force does not follow the feed as the path turns.
Along the axis a helix pulls the tool out of the spindle by less than it is pushed across; a ball, a ramp or a plunge push it
in. Exceptions: a spindle that turns the other way, a tool that rubs.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from compensator.forces.program_time import moves_in_air
from compensator.forces.stock_side import stock_side
from compensator.path.robot_path import RobotPath
from identification.common.arrays import Array
from identification.common.findings import Finding

Indices = NDArray[np.intp]
# From where to where the mean force on the tool is never [rad], to the left of the feed: R is at most 1.7 times T (60 degrees
# beyond backwards, a worn edge) and never negative (engineering judgement beside the formulas above).
NEVER = (np.radians(-120.0), 0.0)
# The mean force out of the spindle is at most this share of that across the axis: the tangent of a helix of 45 degrees
# (engineering judgement; Kac over Ktc is 0.3 for 30 degrees).
MOST_OUT = 1.0
# The same where the tool climbs (1) and where it is conventional (-1): from (T, R) to (-R, T), and from there to (-T, -R), with
# some degrees of margin.
NEVER_ON_SIDE = {1: (np.radians(160.0), np.radians(350.0)), -1: (np.radians(-110.0), np.radians(80.0))}
KIND = {1: "climbs", -1: "mills conventionally"}
# The kinds of cut by the angle of the force to the left of the feed, up to so many degrees: half way between those of cutters
# with the coefficients of docs/cutting.md, 79 degrees with half of the diameter in a climb cut, 116 in a slot, 156 and 190.
LIKE = ((66.0, "climb milling of little engagement"), (97.0, "climb milling of half the diameter"), (136.0, "a slot"),
        (170.0, "conventional milling of half the diameter"), (360.0, "conventional milling of little engagement"))
# So many targets with force are needed; the mean force across the axis is at least this share of its RMS; for the frame the
# feed must turn (1 less the length of the mean of its doubled angle's unit vector), and another frame must keep at least this
# share of the force, TOLD times what the stated one does.
FEWEST, STEADY, TURNS, FOLLOWS, TOLD = 10, 0.2, 0.3, 0.4, 2.0
# Another frame in which the force keeps its direction by less than this of what it does in the stated one is no better.
LOOSE = 0.8


@dataclass(frozen=True)
class CutDirection:
    """Means over the cuts of a log. along, left, up [N]: of the force on the tool, along the feed, to its left, towards the
    spindle. share: of the RMS across the axis that is in the mean. follows: share of the force's energy that keeps its
    direction against the feed. turns: how far the feed turns, 0 (to and fro on a line) to 1. targets: how many."""

    along: float
    left: float
    up: float
    share: float
    follows: float
    turns: float
    targets: int

    @property
    def angle(self) -> float:
        """Of the force to the left of the feed [rad]."""
        return float(np.arctan2(self.left, self.along))

    @property
    def impossible(self) -> str:
        """Why no cutter that turns clockwise feels such a force; empty where one may."""
        if NEVER[0] < self.angle < NEVER[1]:
            return "forwards and to the right"
        if -self.up > MOST_OUT * np.hypot(self.along, self.left):
            return "out of the spindle by more than it is pushed aside"
        return ""

    def impossible_on(self, side: int) -> bool:
        """No cutter that turns clockwise feels such a force with the stock on that side (stock_side.py)."""
        first, last = NEVER_ON_SIDE[side]
        return bool((self.angle - first) % (2 * np.pi) < last - first)

    @property
    def words(self) -> str:
        """The mean force, for people."""
        return f"{self.along:+.0f} N along the feed and {self.left:+.0f} N to its left, {self.up:+.0f} N towards the spindle"

    @property
    def looks(self) -> str:
        """The kind of cut that the force is most like, of a cutter that turns clockwise; "" where it is none, or not steady."""
        if self.share < STEADY or self.impossible:
            return ""
        turned = np.degrees(self.angle) % 360
        return next(words for end, words in LIKE if turned <= end)

    @property
    def turned_over(self) -> CutDirection:
        """Of the force with the other sign."""
        return replace(self, along=-self.along, left=-self.left, up=-self.up)


@dataclass(frozen=True, eq=False)
class Travel:
    """The moves that cut, n of N targets: which (n,), unit vectors (n, 3) along the feed, to its left and towards the spindle,
    base frame, and the way across the spindle (n,) [m] that each of them is. side (n,): where the stock is (stock_side.py)."""

    which: Indices
    feed: Array
    left: Array
    up: Array
    weight: Array
    side: Indices

    @cached_property
    def turns(self) -> float:
        """How far the feed turns, 0 (to and fro on a line) to 1."""
        # Across one fixed axis: the feed's angle.
        up = self.up[0]
        reference = np.cross(up, np.eye(3)[int(np.argmin(np.abs(up)))])
        reference /= np.linalg.norm(reference)
        angle = np.arctan2(self.feed @ np.cross(up, reference), self.feed @ reference)
        return float(1 - abs(np.average(np.exp(2j * angle), weights=self.weight)))

    def against(self, force: Array) -> CutDirection:
        """The force (N, 3) [N] on the tool, base frame, against it."""
        mean, square = np.empty((2, 3))
        for axis, to in enumerate((self.feed, self.left, self.up)):
            local = np.einsum("ni,ni->n", force[self.which], to)
            mean[axis], square[axis] = np.average(local, weights=self.weight), np.average(local**2, weights=self.weight)
        along, sideways, upward = mean.tolist()
        return CutDirection(
            along, sideways, upward, share=float(np.linalg.norm(mean[:2]) / max(np.sqrt(square[:2].sum()), 1e-12)),
            follows=float(mean @ mean / max(square.sum(), 1e-12)), turns=self.turns, targets=len(self.which))

    def by_side(self, force: Array) -> dict[int, CutDirection]:
        """The same where the stock is on the right (1) and on the left (-1), each where enough of a steady force is known."""
        seen = {}
        for side in KIND:
            some = self.side == side
            if some.sum() >= FEWEST:
                there = Travel(self.which[some], self.feed[some], self.left[some], self.up[some], self.weight[some],
                               self.side[some]).against(force)
                if there.share >= STEADY:
                    seen[side] = there
        return seen


def travel(path: RobotPath, forced: NDArray[np.bool_], *, sides: bool = True) -> Travel | None:
    """The moves that cut among the targets that show a force, `forced` (N,); None where there are too few of them. sides: on
    which side the stock is takes a while."""
    step, axis = path.steps, path.base_from_tcp.rotation[:, :, 2]
    # Towards the spindle, whichever way the tool's z points.
    up = axis * np.where(np.einsum("ni,ni->n", axis, path.to_flange) < 0, -1.0, 1.0)[:, None]
    across = step - up * np.einsum("ni,ni->n", step, up)[:, None]
    length = np.linalg.norm(across, axis=1)
    with np.errstate(invalid="ignore"):
        used = forced & ~moves_in_air(path.toolpath) & (length > 0.5 * np.linalg.norm(step, axis=1)) & (length > 1e-6)
    which = np.flatnonzero(used)
    if len(which) < FEWEST:
        return None
    feed, up = across[which] / length[which, None], up[which]
    left = np.cross(up, feed)
    side = stock_side(path.base_from_tcp.position[which], path.length[which], feed, left, up) if sides else (
        np.zeros(len(which), dtype=np.intp))
    return Travel(which, feed, left, up, length[which], side)


def cut_direction(path: RobotPath, force: Array, forced: NDArray[np.bool_]) -> CutDirection | None:
    """The force (N, 3) [N] on the tool, base frame, against the travel; forced (N,): targets that show one. None where there
    are too few of them on moves that cut."""
    # Absurd numbers overflow in targets without force.
    with np.errstate(over="ignore", invalid="ignore"):
        cuts = travel(path, forced, sides=False)
    return None if cuts is None else cuts.against(force)


def said_of_direction(
    cuts: Travel | None, forces: Mapping[str, Array], stated: str, source: str, *, sign_stated: bool = True
) -> list[Finding]:
    """Findings on sign and frame of a log with force. cuts: the moves that cut, None where they are too few; forces: the mean
    force (N, 3) [N] on the tool, base frame, as each frame of force_log would have it; stated: which of them cell.yaml names.
    sign_stated: it states force_log.sign, so that somebody answers for it."""
    if cuts is None:
        return [_untold(f"fewer than {FEWEST} targets cut across the spindle's axis", source, sign_stated)]
    here = cuts.against(forces[stated])
    others = {kind: cuts.against(force) for kind, force in forces.items() if kind != stated}
    best = max(others, key=lambda kind: others[kind].follows, default=None)
    findings = []
    if (best is not None and here.turns > TURNS and others[best].follows > FOLLOWS
            and others[best].follows > TOLD * here.follows):
        findings.append(Finding(
            "CS3069", "warning", f"as the path turns, {100 * here.follows:.0f} % of the force keeps its direction against the "
            f"feed; read in the frame {best} it would be {100 * others[best].follows:.0f} %", file=source,
            hint=f"is force_log.frame {stated} in cell.yaml right? An axis turned over, or the program or log of a mirrored "
            "part, may look alike. Known directions of push, by hand, tell"))
    steady = here.share >= STEADY
    fitting = _fitting(cuts, forces, stated, here)
    if steady and here.impossible:
        elsewhere = "".join(f"; read in the frame {kind} it would be {others[kind].words}, as a cutter may feel it"
                            for kind in fitting)
        return [*findings, Finding(
            "CS3068", "warning", f"over {here.targets} targets that cut the force on the tool is on average {here.words}: no "
            f"cutter that turns clockwise is pulled {here.impossible}{elsewhere}", file=source,
            hint=(f"is force_log.frame {stated} in cell.yaml right? Else, " if fitting else "")
            + "is force_log.sign wrong (on_tool, by_tool), are the axes of its frame (a quaternion is w x y z), or do the "
            "force columns stand in another order? Right only for a spindle that turns the other way")]
    sides = cuts.by_side(forces[stated])
    wrong = [side for side, seen in sides.items() if seen.impossible_on(side)]
    if wrong:
        side = max(wrong, key=lambda side: sides[side].targets)
        return [*findings, Finding(
            "CS3074", "warning", f"by the order of the passes the tool {KIND[side]} at {sides[side].targets} places; "
            f"there the force on it is on average {sides[side].words}: no cutter turning clockwise is pushed so", file=source,
            hint="is force_log.sign wrong (on_tool, by_tool), the sensor turned or mirrored about the tool's axis, or do the "
            "force columns stand in another order? Known directions of push, by hand, tell. Right only for a spindle that "
            "turns the other way")]
    if any(seen.turned_over.impossible_on(side) for side, seen in sides.items()):
        return findings
    if not steady:
        return [*findings, _untold("against the feed it points all ways", source, sign_stated)]
    frame = "" if not fitting else f"; nor does it tell the frame {stated} from {' or '.join(fitting)}"
    if here.turned_over.impossible:
        return findings
    kind, other = ("climb", "conventional") if here.along > 0 else ("conventional", "climb")
    return [*findings, _untold(f"over {here.targets} targets that cut the force on the tool is on average {here.words}, as in "
                               f"{kind} milling of little engagement; with the other sign as in {other}{frame}", source,
                               sign_stated)]


def _fitting(cuts: Travel, forces: Mapping[str, Array], stated: str, here: CutDirection) -> list[str]:
    """The other frames in which the force is one that a cutter may feel, the one it follows the path best in first."""
    found = {}
    for kind, force in forces.items():
        there = cuts.against(force)
        alike = np.allclose(force, forces[stated], atol=1e-6 * max(1.0, float(np.abs(force).max(initial=0.0))))
        if kind == stated or alike or there.share < STEADY or there.impossible or there.follows < LOOSE * here.follows:
            continue
        if not any(seen.impossible_on(side) for side, seen in cuts.by_side(force).items()):
            found[kind] = there.follows
    return sorted(found, key=lambda kind: -found[kind])


def _untold(why: str, source: str, stated: bool) -> Finding:
    """These forces fit either sign (CS3071). Nobody answers for one that cell.yaml does not state."""
    more = "" if stated else "; then state force_log.sign in cell.yaml"
    what = ("force_log.sign is taken as cell.yaml states it, this log does not tell: " if stated else
            "this log does not tell whether force_log.sign is right: ")
    return Finding(
        "CS3071", "note" if stated else "warning", f"{what}{why}",
        file=source, hint="with the wrong sign the correction doubles the error: once for a cell, push the tool by hand in a "
        f"known direction and look at the log{more}")

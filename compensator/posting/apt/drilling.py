"""Drilling cycles as single moves: what a control does at each GOTO while CYCLE is in force."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

from compensator.posting.apt import words
from compensator.posting.apt.moves import Point
from compensator.posting.apt.statements import Statement

# Of a hole drilled in pecks: after clearing the chips the tool comes back in the air to so far above the depth reached [m].
ABOVE_REACHED = 1e-3
MOST_PECKS = 1000
# DRILL and FACE go down at the feed and out in the air; DEEP clears the chips after each peck. Others (tapping, reaming,
# boring, chip breaking) need the spindle, or a path that every control chooses for itself.
_KINDS = {"DRILL": False, "FACE": False, "DEEP": True, "DEEP2": True}
_LENGTHS = {"DEPTH": "depth", "FEDTO": "depth", "CLEAR": "clearance", "RAPTO": "clearance", "RETURN": "back", "RTRCTO": "back",
            "STEP": "first", "1STPECK": "first", "SUBPECK": "further"}
_HINT = "let the CAM system write the cycle as single moves (GOTO)"
Feed = tuple[float, str]


@dataclass(frozen=True)
class Step:
    """One move of a hole: to `point` [m], in the air or at the feed, with a stop there or not."""

    point: Point
    rapid: bool
    stop: bool = False


@dataclass(frozen=True)
class Drilling:
    """A cycle in force. Lengths [m] along the tool axis from the point of GOTO: `depth` down to the bottom, `clearance` up to
    where the feed begins, `back` up to where the tool goes after the hole (None: to the height it came from). pecks: depth of
    the first and of each further one, None where the hole is drilled in one. feed: [m] a "minute" or "turn", None: FEDRAT's.
    dwell: seconds, or "n turns", "" for none. came_from (3,): where the tool was before the cycle, None where that is not
    known."""

    statement: Statement
    depth: float
    clearance: float
    back: float | None
    pecks: tuple[float, float] | None
    feed: Feed | None
    dwell: str
    came_from: Point | None

    def steps(self, point: Point, axis: Point, here: Point | None) -> Iterator[Step]:
        """The moves of a hole at `point` (3,) [m], axis (3,) from the tip to the spindle; here: where the tool is.

        The tool crosses to the hole at the greater of both clearances, feeds down, and comes back in the air.
        """
        entry = _above(point, axis, self.clearance)
        if here is not None:
            height = _height(here, point, axis)
            if height < self.clearance:
                yield Step(_above(here, axis, self.clearance - height), rapid=True)
            elif height > self.clearance:
                yield Step(_above(point, axis, height), rapid=True)
        yield Step(entry, rapid=True)
        reached = 0.0
        for depth in self._depths():
            if reached:
                yield Step(entry, rapid=True)
                if self.clearance + reached > ABOVE_REACHED:
                    yield Step(_above(point, axis, ABOVE_REACHED - reached), rapid=True)
            yield Step(_above(point, axis, -depth), rapid=False, stop=True)
            reached = depth
        up = self.back
        if up is None:
            up = self.clearance if self.came_from is None else max(_height(self.came_from, point, axis), self.clearance)
        yield Step(_above(point, axis, up), rapid=True)

    def _depths(self) -> list[float]:
        if self.pecks is None:
            return [self.depth]
        first, further = self.pecks
        count = max(math.ceil((self.depth - first) / further - 1e-9), 0)
        return [*(first + number * further for number in range(count)), self.depth]


def drilling(statement: Statement, scale: float, came_from: Point | None) -> Drilling:
    """Reads CYCLE/ with named values. scale: metres in one unit of the file. Raises CompstiffError: CS2101 (no number), CS2102
    (a cycle that is not driven, a word that is not read, or one that is missing)."""
    arguments = statement.arguments
    kind = arguments[0] if arguments else ""
    at = 1
    if kind == "DRILL" and arguments[1:2] == ["DEEP"]:      # NX
        kind, at = "DEEP", 2
    if kind not in _KINDS:
        raise statement.fail("CS2102", f"found {statement.spelled()}: of the drilling cycles {', '.join(_KINDS)} are driven, "
                             "any other one needs the spindle or is driven by every control in its own way", hint=_HINT)
    lengths: dict[str, float] = {}
    feed: Feed | None = None
    dwell = ""
    while at < len(arguments):
        word = arguments[at]
        if word in ("RTRCTO", "RETURN") and arguments[at + 1:at + 2] == ["AUTO"]:
            pass
        elif word in _LENGTHS and _LENGTHS[word] not in lengths:
            # NX counts FEDTO along the tool axis, so it is negative; CAMWorks counts it as a depth.
            value = statement.lengths(scale, at + 1, at + 2)[:1] or [math.nan]
            lengths[_LENGTHS[word]] = abs(value[0]) if word == "FEDTO" else value[0]
        elif word in words.FEED_UNITS and feed is None:
            unit, per = words.FEED_UNITS[word]
            feed = 1e-3 * (statement.numbers(at + 1, at + 2) or [math.nan])[0] * (unit or 1e3 * scale), per
        elif word == "DWELL":
            turns = arguments[at + 1:at + 2] == ["REV"]
            dwell = f"{(statement.numbers(at + 1 + turns, at + 2 + turns) or [0.0])[0]:g}{' turns' if turns else ''}"
            at += turns
        else:
            raise statement.fail("CS2102", f"{statement.word}: found '{word}', expected one of {', '.join(_LENGTHS)}, "
                                 f"{', '.join(words.FEED_UNITS)}, DWELL, each once and with its value behind it", at, _HINT)
        at += 2
    wanted = {"depth": "DEPTH or FEDTO", "clearance": "CLEAR or RAPTO"}
    if _KINDS[kind]:
        wanted["first"] = "STEP or 1STPECK"
    missing = [told for name, told in wanted.items() if not lengths.get(name, math.nan) >= 0]
    if missing:
        raise statement.fail("CS2102", f"{statement.spelled()}: without {', '.join(missing)} (zero or above) the hole is "
                             "not known", hint=_HINT)
    return _checked(statement, Drilling(
        statement, lengths["depth"], lengths["clearance"], lengths.get("back"),
        (lengths["first"], lengths.get("further", lengths["first"])) if "first" in lengths else None, feed,
        "" if dwell in ("0", "0 turns") else dwell, came_from))


def _checked(statement: Statement, cycle: Drilling) -> Drilling:
    pecks = cycle.pecks
    downwards = (cycle.depth, *(pecks or ()))
    if not all(length > 0 for length in downwards) or (cycle.back is not None and not cycle.back >= 0):
        raise statement.fail("CS2102", f"{statement.spelled()}: depth and pecks have to be above zero, and no height below "
                             "the point of GOTO", hint=_HINT)
    if pecks is not None and (cycle.depth - pecks[0]) / pecks[1] > MOST_PECKS:
        raise statement.fail("CS2102", f"{statement.spelled()}: over {MOST_PECKS} pecks a hole", hint=_HINT)
    if cycle.feed is not None and not cycle.feed[0] > 0:
        raise statement.fail("CS2107", f"{statement.spelled()}: expected a feed above zero", hint=_HINT)
    return cycle


def _above(point: Point, axis: Point, height: float) -> Point:
    return point[0] + height * axis[0], point[1] + height * axis[1], point[2] + height * axis[2]


def _height(point: Point, over: Point, axis: Point) -> float:
    return sum((a - b) * c for a, b, c in zip(point, over, axis, strict=True))

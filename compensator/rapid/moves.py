"""Move instructions: their arguments, and what stands behind the target."""

from __future__ import annotations

import re
from dataclasses import dataclass

from compensator.rapid.expressions import Cursor, Expr, arguments

ARGUMENTS = {
    "movel": ("MoveL", ("target", "speed", "zone", "tool")),
    "movej": ("MoveJ", ("target", "speed", "zone", "tool")),
    "movec": ("MoveC", ("circle point", "target", "speed", "zone", "tool")),
    "moveabsj": ("MoveAbsJ", ("joint target", "speed", "zone", "tool")),
    "moveldo": ("MoveLDO", ("target", "speed", "zone", "tool", "signal", "value")),
    "movejdo": ("MoveJDO", ("target", "speed", "zone", "tool", "signal", "value")),
    "movecdo": ("MoveCDO", ("circle point", "target", "speed", "zone", "tool", "signal", "value")),
}
"""The instructions whose targets are counted: spelling and arguments. Those with DO set an output at their target."""

# The names under which ABB's reference has the arguments, for a call that writes them: MoveL ToPoint:=p1, Speed:=v100, ...
_PARAMETERS = {"circle point": "cirpoint", "target": "topoint", "joint target": "tojointpos"}
_BEHIND_TARGETS = ("speed", "zone", "tool", "signal", "value")

OF_ONE_MOVE = re.compile(rb"(?i)\\\s*(?:T|ID|Corr|Conc)(?![\w\x80-\xff])")
"""Arguments with which a further move would not be the same: a time for the whole, synchronised robots, path corrections."""
DISPLACEMENT = {"pdispon": True, "pdispset": True, "pdispadd": True, "pdispoff": False}
"""Instructions that switch a program displacement on or off."""
SOFT_SERVO = {"softact": True, "softdeact": False, "cssact": True, "cssdeactmovel": False, "fcact": True, "fcdeact": False}
"""Instructions that let the controller give way under load, or hold again: soft servo, its Cartesian kind, force control."""
AXIS_OFFSET = {"eoffson": True, "eoffsset": True, "eoffsoff": False}
"""Instructions that switch an offset of the external axes on or off."""
SWITCHES = {name: (what, on) for what, names in (("displaced", DISPLACEMENT), ("soft", SOFT_SERVO), ("offset", AXIS_OFFSET))
            for name, on in names.items()}
"""What these switch, and whether on: it holds for all moves behind them, in called routines too."""
OVERRIDE = {"velset": "VelSet", "speedrefresh": "SpeedRefresh"}
"""Instructions that change the speed of all moves behind them, as they are written."""
UNIT_SWITCH = {"actunit": True, "deactunit": False}
"""Instructions that switch a mechanical unit on or off."""


@dataclass(frozen=True, slots=True)
class Tail:
    """Speed, zone, tool and work object of a move as written; None where the argument is absent.

    velocity: of \\V [mm/s]; timed: \\T stands; radius: of \\Z [mm]; stops: \\Inpos stands (a stop point replaces the zone);
    corrected: \\Corr stands; together: \\ID stands, the move is synchronised with those of other robots. start: offset of the
    speed argument, for messages. signal, value: of a move that sets an output.
    """

    speed: Expr
    zone: Expr
    tool: Expr
    workobject: Expr | None
    velocity: Expr | None
    radius: Expr | None
    timed: bool
    stops: bool
    corrected: bool
    start: int
    signal: Expr | None = None
    value: Expr | None = None
    together: bool = False


def parse_move(cursor: Cursor, instruction: str) -> tuple[tuple[Expr, ...], Tail]:
    """Targets and tail of one of `ARGUMENTS`; the cursor stands behind the instruction's name.

    Raises CS2003 when the number of arguments is not the instruction's.
    """
    spelling, wanted = ARGUMENTS[instruction]
    start = cursor.token.start
    positional, options = arguments(cursor, ";", tuple(_PARAMETERS.get(what, what) for what in wanted))
    if len(positional) != len(wanted):
        raise cursor.source.fail("CS2003", f"{spelling} has {len(positional)} arguments, expected {len(wanted)}: "
                                 + ", ".join(wanted), start, "look for a missing comma, bracket or semicolon")
    first = wanted.index("speed")
    return positional[:first], _tail(positional[first:], options)


def parse_tail(cursor: Cursor) -> Tail:
    """The tail alone, cursor behind the comma that follows the target. Raises CS2003."""
    start = cursor.token.start
    positional, options = arguments(cursor, ";", _BEHIND_TARGETS)
    if len(positional) not in (3, 5):
        raise cursor.source.fail("CS2003", f"found {len(positional)} arguments behind the target, expected 3: speed, "
                                 "zone, tool", start, "look for a missing comma, bracket or semicolon")
    return _tail(positional, options)


def _tail(positional: tuple[Expr, ...], options: tuple[tuple[str, Expr | None], ...]) -> Tail:
    given = dict(options)
    speed, zone, tool, *output = positional
    return Tail(
        speed, zone, tool,
        workobject=given.get("wobj"),
        velocity=given.get("v"),
        radius=given.get("z"),
        timed="t" in given,
        stops="inpos" in given,
        corrected="corr" in given,
        start=positional[0].start,
        signal=output[0] if output else None,
        value=output[1] if output else None,
        together="id" in given,
    )

"""Toolpath: the targets of a milling program as arrays, and where each came from in the source text."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import IntEnum
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from identification.common.findings import Finding

Array = NDArray[np.float64]
Indices = NDArray[np.intp]


class Move(IntEnum):
    """How the robot gets to a target."""

    JOINT = 0           # MoveJ
    LINEAR = 1          # MoveL
    ARC_VIA = 2         # MoveC, the circle point
    ARC_END = 3         # MoveC, the destination
    ABSOLUTE = 4        # MoveAbsJ: joint angles, no pose


@dataclass(frozen=True, slots=True)
class ToolFrame:
    """The TCP in the flange frame, as a program names it.

    position (3,) [m], quaternion (4,) w x y z, unit; None: the program does not say (then cell.yaml does).
    problem: why no target that uses it can be corrected ("" if it can), for instance `tool.tframe` assigned at run time.
    """

    name: str
    position: Array | None
    quaternion: Array | None
    line: int | None = None
    problem: str = ""


@dataclass(frozen=True, slots=True)
class WorkObject:
    """World-from-object frame: the user frame times the object frame. Fields as in `ToolFrame`. unit: the mechanical unit that
    moves it (ufprog FALSE, ufmec), "" for none: then the frame is that of the object in the unit's user frame."""

    name: str
    position: Array | None
    quaternion: Array | None
    line: int | None = None
    problem: str = ""
    unit: str = ""


@dataclass(frozen=True, slots=True)
class StatedCutter:
    """The tool as a toolpath's file states it: diameter [m], corner [m] (None: not said), its words and where they stand.
    beyond: what of its shape is not that of an end mill with upright flank and level floor, or why it cannot be read; "":
    nothing."""

    diameter: float
    corner: float | None
    words: str
    file: str
    line: int
    column: int
    beyond: str = ""


@dataclass(frozen=True, slots=True)
class Way:
    """One way that a program may go through branches and loops of unknown condition: its targets (D,) in the order in which
    they are driven, what it takes, in words, whether the values in the file lead along it, and how often it takes each loop."""

    order: Indices
    taken: tuple[str, ...]
    stated: bool
    turns: tuple[int | None, ...] = ()


@dataclass(frozen=True, slots=True)
class OtherFiles:
    """What of a program stands in other files. started: it has the routine that the robot starts; called: routines that it
    calls, that no file at hand holds, and that may drive, each with its line; targets: the files beside it that declare all the
    targets which it names and does not declare; none where one of these is nowhere."""

    started: bool = True
    called: tuple[str, ...] = ()
    targets: tuple[str, ...] = ()


@dataclass(frozen=True)
class Toolpath:
    """N targets in the order of the text (docs/formats.md#force-logs: `target`).

    move       (N,) `Move`
    line, column (N,) of the target's expression in the source, from 1
    position   (N, 3) [m] in the work object; NaN where the text does not give it
    quaternion (N, 4) w x y z, unit, in the work object; NaN likewise
    confdata   (N, 4) cf1 cf4 cf6 cfx; `has_confdata` (N,) is False where the source has none
    external   (N, 6) eax_a ... eax_f as written [mm or deg]; NaN where the axis is not used (9E9)
    joints     (N, 6) [rad] controller angles of MoveAbsJ; NaN elsewhere
    tool, workobject (N,) index into `tools`, `workobjects`
    feed       (N,) [m/s] programmed TCP speed; NaN where unknown
    zone       (N,) [m] radius of the fly-by zone, 0 for a fine point; NaN where unknown
    block      (N,) "" or the reason why this target cannot be corrected (a target computed at run time, \\Corr ...)
    switched   (first target, name of the unit in lower case, on) of each ActUnit and DeactUnit, in the order of the text
    together   (N,) the move is synchronised with those of other robots (\\ID); None: none is
    given      (N,) number of each target in the program as it was given, None where none was added since; `line` and `column`
               are always those of that program
    driven     (D,) the targets in the order in which the program drives them, some twice, some not at all; None: each once, in
               the order of the text, or the text does not say
    ways       the several ways the program may go, the likeliest first; a single one that takes no branch: they are too many
    uncounted  (target, next one) between which the program drives to others, which are not counted; -1: before the first
    others     what of the program stands in other files
    monitored  the controller stops where a linear move arrives in another configuration than the text names (no ConfL\\Off)
    cutters    those that the file states for these targets; RAPID and tables state none
    """

    source: str
    move: NDArray[np.uint8]
    line: Indices
    column: Indices
    position: Array
    quaternion: Array
    confdata: NDArray[np.int32]
    has_confdata: NDArray[np.bool_]
    external: Array
    joints: Array
    tool: Indices
    workobject: Indices
    feed: Array
    zone: Array
    block: NDArray[np.object_]
    tools: tuple[ToolFrame, ...]
    workobjects: tuple[WorkObject, ...]
    findings: tuple[Finding, ...] = ()
    given: Indices | None = None
    switched: tuple[tuple[int, str, bool], ...] = ()
    together: NDArray[np.bool_] | None = None
    driven: Indices | None = None
    ways: tuple[Way, ...] = ()
    uncounted: tuple[tuple[int, int], ...] = ()
    others: OtherFiles = OtherFiles()
    cutters: tuple[StatedCutter, ...] = ()
    monitored: bool = False

    @property
    def number(self) -> Indices:
        """What people are told of a target (N,): its number in the program as given, that of its move where it was added."""
        return np.arange(len(self)) if self.given is None else self.given

    @property
    def by_joints(self) -> NDArray[np.bool_]:
        """The moves (N,) on which the joints lead and the tool's way is not a line or an arc."""
        return np.asarray(np.isin(self.move, (Move.JOINT, Move.ABSOLUTE)))

    def taken(self, order: Indices) -> Toolpath:
        """Some of its targets (D,), in another order, as a path of their own."""
        rows: dict[str, Any] = {name: value[order] for name, value in vars(self).items()
                if isinstance(value, np.ndarray) and name not in ("driven", "given")}
        between = set(self.uncounted)
        uncounted = tuple((k, k + 1) for k, pair in enumerate(pairwise([-1, *order.tolist()]), -1)
                          if pair in between) if between else ()
        return replace(self, **rows, findings=(), given=None, switched=(), driven=None, ways=(), uncounted=uncounted)

    def __len__(self) -> int:
        return len(self.move)

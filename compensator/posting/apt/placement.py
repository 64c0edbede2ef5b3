"""Where the numbers of an APT file stand: TRACUT turns and shifts what follows; CSYS and TRNTYP say that nothing need be."""

from __future__ import annotations

import numpy as np

from compensator.posting.apt.arc_words import Announced
from compensator.posting.apt.moves import Point
from compensator.posting.apt.statements import Statement
from identification.common.arrays import Array

# The numbers of a rotation are written with six decimals or more.
OFF_ROTATION = 1e-5
_WORLD = "let the CAM system write the points in the coordinate system of the machine or the part, or CSYS as the identity"


class Placement:
    """From the coordinates as written to those of the work object, as the statements so far say.

    tilted: a CSYS that is turned, with points in the world (TRNTYP/WORLD): the numbers stay, and the tool axis has to be
    written.
    """

    def __init__(self) -> None:
        self._rotation: Array | None = None                 # (3, 3) of TRACUT; None: as written
        self._shift = np.zeros(3)                           # [m]
        self._world = False
        self.tilted: Statement | None = None

    def tracut(self, statement: Statement, scale: float) -> None:
        """TRACUT/ with the three rows a, b, c, d of x' = a x + b y + c z + d, and TRACUT/NOMORE. scale: metres in a unit.
        Raises CompstiffError (CS2101, CS2182) for anything but a turn and a shift."""
        if statement.arguments == ["NOMORE"]:
            self._rotation = None
            return
        self._rotation, self._shift = _matrix(statement, scale)

    def trntyp(self, statement: Statement) -> None:
        """TRNTYP/WORLD,0,0,0 of CAMWorks: the points behind it are in the world. Raises CompstiffError (CS2182) for another."""
        first, *rest = statement.arguments or [""]
        if first != "WORLD" or any(statement.numbers(1)[:len(rest)] if rest else ()):
            raise statement.fail("CS2182", f"found {statement.spelled()}, expected TRNTYP/WORLD,0,0,0: with another one it is "
                                 "not known where the points stand", hint=_WORLD)
        self._world = True

    def csys(self, statement: Statement, scale: float) -> None:
        """CSYS/ with three rows of four numbers: no change where it is the identity; where the points are in the world it only
        says which way the table is turned. Raises CompstiffError (CS2101, CS2182) for any other."""
        rotation, shift = _matrix(statement, scale)
        identity = np.allclose(rotation, np.eye(3), atol=OFF_ROTATION)
        if not self._world and not (identity and np.abs(shift).max() <= 1e-9):
            raise statement.fail("CS2182", "found a CSYS that is not the identity, and no TRNTYP/WORLD before it says that the "
                                 "points are in the world", 0, _WORLD)
        self.tilted = None if identity else statement

    def point(self, point: Point) -> Point:
        """A point [m] of the file in the work object."""
        if self._rotation is None:
            return point
        x, y, z = (self._rotation @ point + self._shift).tolist()
        return x, y, z

    def direction(self, direction: Point) -> Point:
        """A direction of the file in the work object."""
        if self._rotation is None:
            return direction
        x, y, z = (self._rotation @ direction).tolist()
        return x, y, z

    def arc(self, arc: Announced) -> Announced:
        """An arc of the file in the work object."""
        return arc if self._rotation is None else arc.moved(self._rotation, self._shift)


def is_identity(values: list[float]) -> bool:
    """Whether twelve numbers, three rows of four, change nothing."""
    return len(values) == 12 and np.allclose(values, np.eye(3, 4).ravel(), rtol=0, atol=1e-9)


def _matrix(statement: Statement, scale: float) -> tuple[Array, Array]:
    """Rotation (3, 3) and shift (3,) [m] of twelve numbers."""
    count = len(statement.arguments)
    if count != 12:
        raise statement.fail("CS2101", f"{statement.word}: found {count} arguments, expected 12 numbers: three rows of a "
                             "rotation, each with its shift behind it", min(count, 12) - 1 if count else None)
    rows = np.array(statement.numbers()).reshape(3, 4)
    rotation = rows[:, :3]
    with np.errstate(over="ignore"):
        turned = np.abs(rotation).max() < 2 and np.allclose(rotation @ rotation.T, np.eye(3), rtol=0, atol=OFF_ROTATION)
    if not turned or np.linalg.det(rotation) < 0:
        raise statement.fail("CS2182", f"{statement.word}: the first three numbers of its rows are no rotation (they scale, "
                             "skew or mirror)", 0, "let the CAM system write the points where they are to be cut")
    return rotation, np.array([statement.lengths(scale, row, row + 1)[0] for row in (3, 7, 11)])

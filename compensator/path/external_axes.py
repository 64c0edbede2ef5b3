"""Where the external axes stand at the targets of a program, and how they move the robot's base or its work objects.

A track moves the base, a positioner the work object; the arm meets a target where the one stands seen from the other. The path
itself is a path in the work object. The resting frame is the robot's base as it stands at the program's first values: in it a
target is where it would be if no axis ever left these values, lines are lines and lengths are lengths of the cut;
`base_from_rest` brings it to where the arm meets it. In a program whose axes stand still the two are one.

The controller drives all axes of a move so that they arrive together (ABB, RAPID instructions: MoveL, program execution); on
the way they are taken to be in proportion to the TCP's way. What a circle point says of external axes is not used (MoveC). An
axis at 9E9 belongs to a unit that is not active: it stays where it is (RAPID data types: extjoint).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from compensator.path.arc_length import circle, turned_angle
from compensator.toolpath import Move, Toolpath
from identification.common.arrays import held_once, read_only
from identification.model.cell import Cell
from identification.model.mechanical_units import ExternalAxis, MechanicalUnit
from identification.model.rotations import Frame

Array = NDArray[np.float64]
Indices = NDArray[np.intp]
Flags = NDArray[np.bool_]
# Values nearer to each other than this [mm or deg] are one: RAPID numbers have seven digits.
SAME_VALUE = 1e-4


@dataclass(frozen=True, eq=False)
class ExternalAxes:
    """The external axes of a program of N targets.

    values (N, 6) [mm or deg]: where each axis of the cell's units stands, as the controller takes it. carrier (N,): number in
    cell.units of the unit that moves the target's work object, -1 for none. rest (6,): values of the resting frame.
    world_from_base: the robot's base there. base_from_rest (N): None where all is still. driven: the axes that move during the
    program and whose speed and acceleration are known; unjudged: those that move and are not. problem (N,): why it is not known
    where the target lies, "" where it is.
    """

    cell: Cell
    values: Array
    carrier: Indices
    rest: Array
    world_from_base: Frame
    base_from_rest: Frame | None
    driven: tuple[ExternalAxis, ...]
    unjudged: tuple[ExternalAxis, ...]
    problem: NDArray[np.object_]

    @property
    def moves(self) -> bool:
        """Whether the robot's base or a work object moves during the program."""
        return self.base_from_rest is not None

    @property
    def base_moves(self) -> bool:
        """Whether the robot's base does."""
        unit = carries_robot(self.cell)
        return unit is not None and bool(_varies(self.values[:, unit.columns]).any())

    @property
    def turns(self) -> Flags:
        """The ways (N - 1,) from one target to the next on which a driven axis moves."""
        with np.errstate(invalid="ignore", over="ignore"):
            return np.asarray((np.abs(np.diff(self.driven_values(), axis=0)) > 1e-9).any(axis=1))

    def frames(self, values: Array, carrier: Indices) -> Frame:
        """base_from_rest (n) where the axes stand at values (n, 6), for work objects on these carriers (n,)."""
        return _base_from_rest(self.cell, values, carrier, self.rest, self.world_from_base)

    def to_rest(self, base_from_tcp: Frame, rows: Indices | None = None) -> Frame:
        """rest_from_tcp of frames (N), or of those of the targets `rows`."""
        if self.base_from_rest is None:
            return base_from_tcp
        return (self.base_from_rest if rows is None else self.base_from_rest[rows]).inverse() @ base_from_tcp

    def to_base(self, rest_from_tcp: Frame, rows: Indices | None = None) -> Frame:
        """The reverse."""
        if self.base_from_rest is None:
            return rest_from_tcp
        return (self.base_from_rest if rows is None else self.base_from_rest[rows]) @ rest_from_tcp

    def turned_to_base(self, vectors: Array, rows: Indices | None = None) -> Array:
        """Directions (N, 3), or (n, 3) of the targets `rows`, of the resting frame in the base frame."""
        if self.base_from_rest is None:
            return vectors
        return (self.base_from_rest if rows is None else self.base_from_rest[rows]).turn(vectors)

    def turned_to_rest(self, vectors: Array, rows: Indices | None = None) -> Array:
        """The reverse."""
        if self.base_from_rest is None:
            return vectors
        frame = self.base_from_rest if rows is None else self.base_from_rest[rows]
        return np.asarray(np.einsum("nji,nj->ni", frame.rotation, vectors))

    def driven_values(self, rows: Indices | slice = slice(None)) -> Array:
        """Values (n, D) [m or rad] of the driven axes."""
        return si_values(self.driven, self.values[rows])


def si_values(axes: tuple[ExternalAxis, ...], values: Array) -> Array:
    """Values (n, D) [m or rad] of some axes out of all six (n, 6) [mm or deg]."""
    return np.asarray(values[:, [axis.column for axis in axes]] * np.array([axis.factor for axis in axes]))


def external_axes(toolpath: Toolpath, cell: Cell) -> ExternalAxes:
    """The axes of a program in this cell. A value that is not known is taken as the first one known, and named in `problem`."""
    count = len(toolpath)
    units = cell.units or ()
    problem = np.full(count, "", dtype=object)
    carrier = np.full(count, -1, dtype=np.intp)
    for number, item in enumerate(toolpath.workobjects):
        if not item.unit:
            continue
        which = toolpath.workobject == number
        found, why = _carrier_of(item.unit, cell)
        carrier[which] = found
        problem[which] = why
    moving = [unit for unit in units if unit.carries == "robot" or units.index(unit) in carrier]
    driving = not np.isnan(toolpath.external).all()
    if not moving and not driving:
        carrier, problem = held_once(carrier), held_once(problem)
        read_only(problem, carrier)
        return ExternalAxes(cell, toolpath.external, carrier, np.zeros(6), cell.world_from_base, None, (), (), problem)
    values = standing_values(toolpath, cell)
    for unit in moving:
        concerned = np.ones(count, dtype=bool) if unit.carries == "robot" else carrier == units.index(unit)
        for axis in unit.axes:
            _doubts(unit, axis, values[:, axis.column], concerned, problem)
    known = values.copy()
    for unit in units:
        for axis in unit.axes:
            told = values[~np.isnan(values[:, axis.column]), axis.column]
            known[np.isnan(values[:, axis.column]), axis.column] = told[0] if len(told) else axis.zero
    rest = np.nan_to_num(known[0]) if count else np.zeros(6)
    robot = carries_robot(cell)
    world_from_base = cell.world_from_base if robot is None else robot.displacement(rest[None])[0] @ cell.world_from_base
    columns = sorted({axis.column for unit in moving for axis in unit.axes})
    base_from_rest = None
    if columns and bool(_varies(known[:, columns]).any()):
        base_from_rest = _base_from_rest(cell, known, carrier, rest, world_from_base)
        read_only(base_from_rest.rotation, base_from_rest.position)
    travelling = [axis for unit in units for axis in unit.axes if _varies(known[:, axis.column:axis.column + 1])[0]]
    read_only(known, carrier, rest, problem)
    return ExternalAxes(cell, known, carrier, rest, world_from_base, base_from_rest,
                        tuple(axis for axis in travelling if axis.speed is not None),
                        tuple(axis for axis in travelling if axis.speed is None), problem)


def carries_robot(cell: Cell) -> MechanicalUnit | None:
    """The unit that the robot stands on."""
    return next((unit for unit in cell.units or () if unit.carries == "robot"), None)


def _carrier_of(name: str, cell: Cell) -> tuple[int, str]:
    """Number of the unit of this name that carries work objects; or -1 and why there is none."""
    for number, unit in enumerate(cell.units or ()):
        if unit.name.lower() == name.lower():
            if unit.carries == "workobject":
                return number, ""
            what = "the robot" if unit.carries == "robot" else "nothing"
            return -1, f"the unit {name} moves its work object (ufmec), and cell.yaml says that {name} carries {what}"
    return -1, (f"the unit {name} moves its work object (ufprog is FALSE), and cell.yaml does not describe {name} under "
                "mechanical_units; another robot cannot be described")


def _doubts(unit: MechanicalUnit, axis: ExternalAxis, values: Array, concerned: Flags, problem: NDArray[np.object_]) -> None:
    """Writes why targets (N,) are not where anybody knows, for one axis at values (N,)."""
    what = "the robot" if unit.carries == "robot" else "its work object"
    unknown = concerned & np.isnan(values) & (problem == "")
    problem[unknown] = (f"{unit.name} carries {what}, and nothing tells where {axis.name} stands: neither the program before "
                        "it nor parked_mm or parked_deg in cell.yaml")
    if axis.direction is None:
        with np.errstate(invalid="ignore"):
            away = concerned & (np.abs(values - axis.zero) > SAME_VALUE) & (problem == "")
        for i in np.flatnonzero(away):
            problem[i] = (f"{unit.name} carries {what}; {axis.name} stands at {values[i]:g} {axis.unit}, and cell.yaml says "
                          f"neither its direction nor that this is its zero ({axis.zero:g} {axis.unit})")


def _varies(values: Array) -> Flags:
    """Which columns of values (N, n) do not stay where they are at first known."""
    if not len(values):
        return np.zeros(values.shape[1], dtype=bool)
    with np.errstate(invalid="ignore", over="ignore"):
        low, high = np.fmin.reduce(values, axis=0), np.fmax.reduce(values, axis=0)
        return np.asarray(high - low > SAME_VALUE)


def standing_values(toolpath: Toolpath, cell: Cell) -> Array:
    """Where each axis of the cell's units stands at the targets (N, 6) [mm or deg]; NaN where neither the program nor `parked`
    tells. Axes of no unit are as written."""
    values = toolpath.external.copy()
    count = len(values)
    arc = np.zeros(count, dtype=bool)
    arc[:-1] = (toolpath.move[:-1] == Move.ARC_VIA) & (toolpath.move[1:] == Move.ARC_END)
    for unit in cell.units or ():
        columns = unit.columns
        for number, (first, name, on) in enumerate(toolpath.switched):
            if not on and name == unit.name.lower():
                again = [later for later, other, back in toolpath.switched[number + 1:] if back and other == name]
                values[first:again[0] if again else count, columns] = np.nan
        for axis in unit.axes:
            values[:, axis.column] = _held(values[:, axis.column], arc, np.nan if axis.parked is None else axis.parked)
    via = np.flatnonzero(arc[1:]) + 1
    if len(via):
        start, end = values[via - 1], values[via + 1]
        share = _share_of_arc(toolpath.position, via)[:, None]
        with np.errstate(invalid="ignore", over="ignore"):
            between = np.where(np.abs(end - start) <= SAME_VALUE, end, start + share * (end - start))
        own = [axis.column for unit in cell.units or () for axis in unit.axes]
        values[via[:, None], np.array(own, dtype=np.intp)] = between[:, own]
    return values


def _held(values: Array, skipped: Flags, parked: float) -> Array:
    """Each value (N,), where there is none or it is skipped the last one before; `parked` before the first."""
    count = len(values)
    known = ~np.isnan(values) & ~skipped
    last = np.maximum.accumulate(np.where(known, np.arange(count), -1)) if count else np.empty(0, dtype=np.intp)
    return np.asarray(np.where(last >= 0, values[np.maximum(last, 0)], parked))


def _share_of_arc(position: Array, via: Indices) -> Array:
    """Which share (n,) of its arc stands before each circle point; half where the positions are not known."""
    start, middle, end = (np.nan_to_num(position[via + k]) for k in (-1, 0, 1))
    straight, centre, axis = circle(start, middle, end)
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        first, whole = (turned_angle(axis, start - centre, point - centre) for point in (middle, end))
        chords = np.linalg.norm(middle - start, axis=1), np.linalg.norm(end - middle, axis=1)
        share = np.where(straight, chords[0] / (chords[0] + chords[1]), first / whole)
    known = np.isfinite(share) & np.isfinite(position[via - 1] + position[via] + position[via + 1]).all(axis=1)
    return np.asarray(np.where(known, share, 0.5))


def _base_from_rest(cell: Cell, values: Array, carrier: Indices, rest: Array, world_from_base: Frame) -> Frame:
    """base_from_rest (n): values (n, 6), number of the unit that moves the work object (n,), values (6,) of the resting frame,
    where the base stands then."""
    count = len(values)
    rotation, position = np.tile(np.eye(3), (count, 1, 1)), np.zeros((count, 3))
    for number in np.unique(carrier):
        if number >= 0:
            unit = (cell.units or ())[number]
            which = np.flatnonzero(carrier == number)
            moved = unit.displacement(values[which]) @ unit.displacement(rest[None])[0].inverse()
            rotation[which], position[which] = moved.rotation, moved.position
    moved = Frame(rotation, position)
    robot = carries_robot(cell)
    if robot is not None:
        moved = (robot.displacement(values) @ robot.displacement(rest[None])[0].inverse()).inverse() @ moved
    return world_from_base.inverse() @ moved @ world_from_base


def resting_object(toolpath: Toolpath, number: int, frame: Frame, axes: ExternalAxes) -> Frame:
    """world_from_object with all axes at the resting values, of a work object whose own frame is `frame`: in the world, or in
    the user frame of the unit that moves it."""
    item = toolpath.workobjects[number]
    if not item.unit:
        return frame
    found, _ = _carrier_of(item.unit, axes.cell)
    return frame if found < 0 else (axes.cell.units or ())[found].world_from_user(axes.rest[None])[0] @ frame

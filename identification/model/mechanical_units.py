"""Mechanical units beside the arm: tracks that carry the robot, axes and positioners that carry the work object.

An axis is where it stands by its value in a program: millimetres of a linear axis, degrees of a rotary one (ABB, RAPID data
types: extjoint). Frames and directions in cell.yaml hold where all axes of the unit stand at their zero. From there unit U with
the axes i at values q_i moves what it carries by a product of exponentials, the first axis carrying the second,

    D(q) = W exp(s_1 (q_1 - z_1)) exp(s_2 (q_2 - z_2)) ... W^-1 ,   W = world_from_unit ,

s_i a translation along the axis' direction, or a turn about the line with that direction through a point. A track that stands
at q moves the robot's base: world_from_base(q) = D(q) world_from_base. A work object whose ufmec names the unit stands in the
unit's user frame: world_from_user(q) = D(q) W unit_from_user, and the program's oframe in that (ABB, RAPID data types:
wobjdata).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from identification.common.findings import CompstiffError, error
from identification.common.yaml_source import Number, Positive, Strict, Triple
from identification.model.frame_file import FrameFile
from identification.model.rotations import Frame, rotation_matrix

Array = NDArray[np.float64]
Carries = Literal["robot", "workobject", "nothing"]
LETTERS = "abcdef"
"""eax_a ... eax_f of a RAPID target, in this order."""
# What is carried may not tilt against gravity by more than this [rad]: the weight of the arm would act from elsewhere.
UPRIGHT = 1e-4


class ExternalAxisFile(Strict):
    """One axis of a unit, in the unit's base frame with all of its axes at zero."""

    eax: Literal["a", "b", "c", "d", "e", "f"]
    kind: Literal["linear", "rotary"] = "linear"
    direction: Triple | None = None
    through_mm: Triple = (0.0, 0.0, 0.0)
    zero_mm: Number | None = None
    zero_deg: Number | None = None
    parked_mm: Number | None = None
    parked_deg: Number | None = None
    speed_mm_s: Positive | None = None
    speed_deg_s: Positive | None = None
    acceleration_mm_s2: Positive | None = None
    acceleration_deg_s2: Positive | None = None


class MechanicalUnitFile(Strict):
    """One unit of the controller's configuration."""

    name: str
    carries: Carries
    base_frame: FrameFile = FrameFile()
    axes: tuple[ExternalAxisFile, ...]
    user_frame: FrameFile = FrameFile()


@dataclass(frozen=True, eq=False)
class ExternalAxis:
    """column: 0 for eax_a ... 5. factor: from what a program writes [mm or deg] to SI [m or rad]. direction (3,) unit vector,
    None where the file does not tell how it moves: then it may only stand at its zero. point (3,) [m] on the line a rotary axis
    turns about. zero, parked: values as a program writes them, parked None where not stated. speed, acceleration: SI, both or
    none."""

    column: int
    rotary: bool
    direction: Array | None
    point: Array
    zero: float
    parked: float | None
    speed: float | None
    acceleration: float | None

    @property
    def name(self) -> str:
        """As RAPID has it."""
        return f"eax_{LETTERS[self.column]}"

    @property
    def factor(self) -> float:
        """From the numbers of a program to SI."""
        return float(np.radians(1.0)) if self.rotary else 1e-3

    @property
    def unit(self) -> str:
        """Of the numbers in a program."""
        return "deg" if self.rotary else "mm"

    def motion(self, values: Array) -> Frame:
        """How it moves what it carries, from zero to values (N,) [mm or deg], in the unit's base frame; nothing for an axis of
        unknown direction."""
        along = np.zeros(3) if self.direction is None else self.direction
        shift = (self.factor * (values - self.zero))[:, None] * along
        if not self.rotary:
            return Frame(np.broadcast_to(np.eye(3), (len(values), 3, 3)), shift)
        turn = rotation_matrix(shift)
        return Frame(turn, self.point - turn @ self.point)


@dataclass(frozen=True, eq=False)
class MechanicalUnit:
    """name: as the controller's configuration and ufmec have it. world_from_unit: its base frame; user_frame: unit_from_user,
    what a work object stands in, with all axes at zero."""

    name: str
    carries: Carries
    world_from_unit: Frame
    axes: tuple[ExternalAxis, ...]
    user_frame: Frame

    @property
    def columns(self) -> list[int]:
        """The columns of its axes."""
        return [axis.column for axis in self.axes]

    def displacement(self, values: Array) -> Frame:
        """D (N): how what it carries stands, against all axes at zero, world frame; values (N, 6) [mm or deg] of eax_a ...
        eax_f."""
        moved = self.world_from_unit
        for axis in self.axes:
            moved = moved @ axis.motion(values[:, axis.column])
        return moved @ self.world_from_unit.inverse()

    def world_from_user(self, values: Array) -> Frame:
        """The frame (N) that its work objects stand in; values (N, 6) as for `displacement`."""
        return self.displacement(values) @ self.world_from_unit @ self.user_frame


def mechanical_units(described: tuple[MechanicalUnitFile, ...] | None, file: str) -> tuple[MechanicalUnit, ...] | None:
    """The units of a cell file; None where it says nothing of them. Raises CompstiffError (CS4506): two units of one name, an
    axis of two units, two units that carry the robot, a value in the unit of another kind, a direction without length, a robot
    that would be tilted."""
    if described is None:
        return None

    def wrong(what: str, hint: str = "docs/formats.md has the keys: mechanical_units") -> CompstiffError:
        return error("CS4506", f"mechanical_units: {what}", file=file, hint=hint)

    names = [unit.name.lower() for unit in described]
    letters: list[str] = [axis.eax for unit in described for axis in unit.axes]
    for what, seen in (("the name", names), ("eax", letters)):
        double = next((item for item in seen if seen.count(item) > 1), None)
        if double is not None:
            raise wrong(f"{what} '{double}' stands twice")
    carriers = [unit.name for unit in described if unit.carries == "robot"]
    if len(carriers) > 1:
        raise wrong(f"{' and '.join(carriers)} both carry the robot", "write all axes that move its base as axes of one unit, "
                    "the first of which carries the second")
    units = []
    for unit in described:
        axes = []
        for axis in unit.axes:
            where = f"{unit.name}, eax {axis.eax}: "
            foreign = [key for key in ExternalAxisFile.model_fields if getattr(axis, key) is not None
                       and (("_deg" in key and axis.kind == "linear") or ("_mm" in key and axis.kind == "rotary"
                                                                         and key != "through_mm"))]
            if foreign:
                raise wrong(f"{where}found {foreign[0]} of a {axis.kind} axis, expected millimetres of a linear and degrees of "
                            "a rotary one")
            axes.append(_axis(axis))
            if axis.direction is not None and not np.linalg.norm(axis.direction) > 1e-6:
                raise wrong(f"{where}the direction has no length")
            if (axes[-1].speed is None) != (axes[-1].acceleration is None):
                raise wrong(f"{where}speed and acceleration belong together: found one of them")
        world_from_unit = unit.base_frame.frame()
        tilting = [axis.name for axis in axes if unit.carries == "robot" and axis.rotary and axis.direction is not None
                   and np.linalg.norm((world_from_unit.rotation @ axis.direction)[:2]) > UPRIGHT]
        if tilting:
            raise wrong(f"{unit.name} carries the robot, and {tilting[0]} would tilt it: a rotary axis under the robot must be "
                        "vertical", "a robot that tilts carries its own weight otherwise at each value; this is not supported")
        units.append(MechanicalUnit(unit.name, unit.carries, world_from_unit, tuple(axes), unit.user_frame.frame()))
    return tuple(units)


def travel(units: tuple[MechanicalUnit, ...] | None, world_from_base: Frame) -> Array | None:
    """The direction (3,) in which a track carries the robot, base frame; None where no unit does, or not along one line."""
    unit = next((unit for unit in units or () if unit.carries == "robot"), None)
    if unit is None or len(unit.axes) != 1 or unit.axes[0].rotary or unit.axes[0].direction is None:
        return None
    return np.asarray(world_from_base.rotation.T @ unit.world_from_unit.rotation @ unit.axes[0].direction)


def _axis(axis: ExternalAxisFile) -> ExternalAxis:
    rotary = axis.kind == "rotary"
    factor = float(np.radians(1.0)) if rotary else 1e-3
    zero, parked, speed, acceleration = (
        (axis.zero_deg, axis.parked_deg, axis.speed_deg_s, axis.acceleration_deg_s2) if rotary
        else (axis.zero_mm, axis.parked_mm, axis.speed_mm_s, axis.acceleration_mm_s2))
    direction = None if axis.direction is None else np.array(axis.direction) / (np.linalg.norm(axis.direction) or 1.0)
    return ExternalAxis(LETTERS.index(axis.eax), rotary, direction,
                        1e-3 * np.array(axis.through_mm), zero or 0.0, parked, None if speed is None else factor * speed,
                        None if acceleration is None else factor * acceleration)

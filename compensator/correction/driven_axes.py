"""What moves with force need to know of the external axes they drive or hold (CS4104), and what was assumed of these.

The correction stays in the six joints of the arm, and the values of the external axes stay as they are. What counts is where
the arm meets the target: it is known where nothing that moves carries the robot's base, or the target's work object, unknown to
cell.yaml.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from compensator.path.external_axes import SAME_VALUE
from compensator.path.robot_path import RobotPath
from identification.common.findings import Finding, Level, counted, verb
from identification.model.mechanical_units import LETTERS, ExternalAxis, MechanicalUnit

Array = NDArray[np.float64]
Indices = NDArray[np.intp]
Unit = tuple[MechanicalUnit, ExternalAxis]


@dataclass(frozen=True, eq=False)
class _Written:
    """An axis that targets (n,) with force write: letter, its unit in cell.yaml or None, and the values (n,) [mm or deg]."""

    letter: str
    unit: Unit | None
    targets: Indices
    values: Array

    @property
    def held(self) -> bool:
        """It is the same for all of them."""
        with np.errstate(over="ignore"):
            return bool(np.ptp(self.values) <= SAME_VALUE)

    @property
    def at(self) -> str:
        """For people."""
        unit = f" {self.unit[1].unit}" if self.unit else ""
        if self.held:
            return f"at {self.values[0]:g}{unit}"
        return f"from {self.values.min():g} to {self.values.max():g}{unit}"

    @property
    def subject(self) -> str:
        """Who does what with it."""
        count = len(self.targets)
        does = verb(count, "hold" if self.held else "drive")
        return f"{counted(count, 'move')} with force {does} the external axis eax_{self.letter}"


def unknown_axes(path: RobotPath, targets: Indices) -> list[Finding]:
    """CS4104: of the targets with force, those that drive or hold an axis of which cell.yaml says too little; one finding an
    axis or a reason. CS4505: those that are synchronised with other robots."""
    together = path.toolpath.together
    if together is not None and together[targets].any():
        return [_all(path, targets[together[targets]], "CS4505", "error", "a move with force is synchronised with those of "
                     "other robots (\\ID, MultiMove): what moves under the tool is not in this program",
                     "correct the cut in a program of its own, or move the part with a positioner that this program drives")]
    findings = [_all(path, targets[path.axes.problem[targets] == why], "CS4104", "error", f"a move with force: {why}",
                     "docs/formats.md has mechanical_units of cell.yaml")
                for why in dict.fromkeys(path.axes.problem[targets]) if why]
    for axis in _written(path, targets):
        problem = _why_unknown(path, axis)
        if problem is not None:
            why, hint = problem
            findings.append(_all(path, axis.targets, "CS4104", "error", f"{axis.subject} ({axis.at}), {why}", hint))
    return findings


def _why_unknown(path: RobotPath, axis: _Written) -> tuple[str, str] | None:
    """Why an axis that moves with force write is not understood, and a hint; None where it is."""
    if axis.unit is not None:
        unit, described = axis.unit
        if unit.carries != "workobject" or described.direction is not None or axis.held:
            return None
        return (f"which carries the work object, and cell.yaml does not say how {unit.name} moves it",
                "state direction, and through_mm of a rotary axis")
    if path.cell.units is None:
        return ("and cell.yaml does not say what it carries", "state it under mechanical_units: [] where the controller has "
                f"none, else [{{name: UNIT, carries: workobject, axes: [{{eax: {axis.letter}}}]}}], or carries: robot, or "
                "nothing; an axis that moves what it carries needs its direction too")
    if axis.held and axis.values[0] == 0:
        return None
    return "and no unit of mechanical_units in cell.yaml has it", "describe its unit, or write 9E9 where there is none"


def said_of_axes(path: RobotPath, targets: Indices) -> list[Finding]:
    """What was taken for granted of the axes of targets with force, of which `unknown_axes` says nothing."""
    findings, units = [], path.cell.units or ()
    for axis in _written(path, targets):
        if axis.unit is None:
            findings.append(_all(path, axis.targets, "CS4502", "warning", f"{axis.subject} ({axis.at}), and by cell.yaml no "
                                 "unit has it: the controller does not use the value", "write 9E9"))
        elif axis.unit[0].carries == "workobject":
            unit = axis.unit[0]
            still = path.axes.carrier[axis.targets] != units.index(unit)
            fixed = replace(axis, targets=axis.targets[still], values=axis.values[still])
            if still.any() and fixed.held:
                findings.append(_all(path, fixed.targets, "CS4503", "note", f"{fixed.subject} of {unit.name} ({fixed.at}), and "
                                     "the work object is fixed (ufprog TRUE): it is corrected in that as it is declared",
                                     "declare the work object as it lies at that value"))
            elif still.any():
                findings.append(_all(path, fixed.targets, "CS4504", "warning", f"{fixed.subject} of {unit.name} ({fixed.at}), "
                                     "and the work object is fixed (ufprog TRUE): the path over the part is not the program's",
                                     f'a work object that goes with the unit has ufprog FALSE and ufmec "{unit.name}"'))
    external = path.toolpath.external[targets]
    return findings + [_left_there(path, targets, unit) for unit in units
                       if _counts(path, targets, unit) and np.isnan(external[:, unit.columns]).any()]


def _left_there(path: RobotPath, targets: Indices, unit: MechanicalUnit) -> Finding:
    """CS4507: a unit whose axes targets with force do not write."""
    which = targets[np.isnan(path.toolpath.external[targets][:, unit.columns]).any(axis=1)]
    places = ", ".join(f"{axis.name} at {path.axes.values[which[0], axis.column]:g} {axis.unit}" for axis in unit.axes)
    return _all(path, which, "CS4507", "note", f"{counted(len(which), 'move')} with force {verb(len(which), 'do')} not drive "
                f"{unit.name}: taken to stand where it was left, or is parked ({places})",
                "is that where it stands? 9E9 is for a unit that is not active")


def _counts(path: RobotPath, targets: Indices, unit: MechanicalUnit) -> bool:
    """Whether the unit carries the robot, or a work object of these targets."""
    units = path.cell.units or ()
    return unit.carries == "robot" or bool((path.axes.carrier[targets] == units.index(unit)).any())


def _written(path: RobotPath, targets: Indices) -> list[_Written]:
    """The axes that targets with force write."""
    external = path.toolpath.external[targets]
    axes = []
    for column in np.flatnonzero(~np.isnan(external).all(axis=0)).tolist():
        which = ~np.isnan(external[:, column])
        unit = next(((unit, axis) for unit in path.cell.units or () for axis in unit.axes if axis.column == column), None)
        axes.append(_Written(LETTERS[column], unit, targets[which], external[which, column]))
    return axes


def _all(path: RobotPath, which: Indices, code: str, level: Level, message: str, hint: str) -> Finding:
    """One finding for targets (n,), at the first."""
    return replace(path.finding(int(which[0]), code, level, message, hint), count=len(which))

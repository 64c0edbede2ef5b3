"""Where the external axes stand while a posted program runs: where cell.yaml parks them, from the first move to the last."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from identification.common.arrays import Array
from identification.common.findings import Finding, error
from identification.model.cell import Cell


def parked_values(cell: Cell) -> Array:
    """Values (6,) [mm or deg] of eax_a ... eax_f that a posted program writes; NaN, 9E9, for an axis that is not parked.

    Raises CompstiffError (CS4510): an axis under the robot is not.
    """
    values = np.full(6, np.nan)
    for unit in cell.units or ():
        for axis in unit.axes:
            if axis.parked is not None:
                values[axis.column] = axis.parked
            elif unit.carries == "robot":
                key = "parked_deg" if axis.rotary else "parked_mm"
                raise error("CS4510", f"{unit.name} carries the robot, and cell.yaml does not say where {axis.name} stands "
                            "while a posted program runs", file=str(cell.source), hint=f"state {key} of eax {axis.name[-1]}: "
                            "posted programs hold it there")
    return values


def as_parked(cell: Cell, values: Array) -> Cell:
    """The cell with the robot's base where it stands at these values (6,)."""
    robot = next((unit for unit in cell.units or () if unit.carries == "robot"), None)
    return cell if robot is None else replace(
        cell, world_from_base=robot.displacement(values[None])[0] @ cell.world_from_base)


def said_of_parked(cell: Cell, values: Array, source: str) -> list[Finding]:
    """CS4511: what a posted program holds."""
    held = [f"{axis.name} of {unit.name} at {values[axis.column]:g} {axis.unit}" for unit in cell.units or ()
            for axis in unit.axes if not np.isnan(values[axis.column])]
    if not held:
        return []
    return [Finding("CS4511", "note", f"the program holds {', '.join(held)}, as parked in cell.yaml; workobject stays where "
                    "it is stated", file=source, hint="a posted program moves no external axis")]

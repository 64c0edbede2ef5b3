"""The deviation that `predict` or `correct` wrote, at the places where it was measured."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from compensator.verification.readings import DEVIATION, POSITION, Readings, nearest
from identification.common.arrays import Array
from identification.common.findings import Finding, counted, error
from identification.common.tables import read_table
from identification.model.cell import Cell


def predicted_at(readings: Readings, file: Path, cell: Cell, within: float, *, in_object: bool) -> tuple[Array, list[Finding]]:
    """The predicted deviation (N, C) [m] at the readings, in their frame and components; NaN where the file has none.

    path: deviation.csv or offsets.csv. within [m]: how far the nearest target may be from a reading that is placed by x_mm y_mm
    z_mm. in_object: the readings are in the cell's work object, else in the base frame. Raises CompstiffError: CS0201 to
    CS0203, CS6028 the readings cannot be joined with targets, CS6051 no work object is stated, CS4513 it may turn
    against the base. A target without a place (a joint move has none) is near no reading.
    """
    table = read_table(file, required=("target", *DEVIATION), optional=POSITION, may_be_empty=(*DEVIATION, *POSITION),
                       together=(POSITION,))
    if not len(table):
        raise error("CS6028", "has no row below its header", file=table.source, line=table.header_line)
    if readings.key == "path_mm":
        raise error("CS6028", f"is placed by path_mm, {file} by targets and their places", file=readings.source,
                    hint="measure at targets (column target), or give x_mm y_mm z_mm")
    if readings.key == "target":
        mine, rows = nearest(readings.place, table.numbers["target"][:, None], 0.0)
    elif POSITION[0] in table.numbers:
        # Several readings may lie about one target, so the nearest is taken one way only.
        from scipy.spatial import cKDTree

        place = 1e-3 * table.stack(*POSITION)
        placed = np.flatnonzero(~np.isnan(place).any(axis=1))
        if not len(placed):
            raise error("CS6028", f"has no place in any row, and {readings.source} is placed by them", file=str(file))
        distance, closest = map(np.asarray, cKDTree(place[placed]).query(readings.place))
        mine = np.flatnonzero(distance <= within)
        if not len(mine):
            raise error("CS6028", f"no reading has a target within {1e3 * within:g} mm, the nearest is "
                        f"{1e3 * float(np.median(distance)):.3g} mm away in the middle", file=readings.source,
                        hint="is it of the program that was measured, in its work object, in millimetres? Places on the "
                        "surface need normals and --tool-radius-mm; else --within-mm")
        rows = placed[closest[mine]]
    else:
        raise error("CS6028", f"has no x_mm y_mm z_mm, and {readings.source} is placed by them", file=str(file))
    predicted = np.full((len(readings), 3), np.nan)
    predicted[mine] = 1e-6 * table.stack(*DEVIATION)[rows]
    if in_object:
        predicted = predicted @ _base_from_object(cell, readings, file, in_object=True)
    findings = []
    if len(mine) < len(readings):
        findings.append(Finding("CS6022", "warning", f"{counted(len(readings) - len(mine), 'reading')} of {len(readings)} "
                                f"without a target in {file}; left out of the scale", file=readings.source,
                                hint="" if readings.key == "target" else f"the nearest may be {1e3 * within:g} mm away: "
                                "--within-mm sets it"))
    if readings.deviation.shape[1] == 3:
        return predicted, findings
    if readings.normal is None:
        raise error("CS6028", "has the deviation along the normal, but not the normal", file=readings.source,
                    hint="add nx ny nz, the unit normal at each reading, or leave --predicted out")
    return np.sum(predicted * readings.normal, axis=1, keepdims=True), findings


def of_tool(readings: Readings, radius: float, file: Path, cell: Cell, *, in_object: bool) -> Readings:
    """With the places where the tool stood, radius [m] beside the surface along the normal. Raises CompstiffError (CS5304)
    without normals or places, and what `_base_from_object` raises: places are in the work object, normals where in_object."""
    if readings.key != "x_mm y_mm z_mm" or readings.normal is None:
        raise error("CS5304", "a tool radius says how far beside the surface the path is, and no normal on which side, or no "
                    "place", file=readings.source, hint="give x_mm y_mm z_mm and nx ny nz, out of the material")
    normal = readings.normal
    if not in_object:
        normal = normal @ _base_from_object(cell, readings, file, in_object=False)
    return replace(readings, place=readings.place + radius * normal)


def _base_from_object(cell: Cell, readings: Readings, file: Path, *, in_object: bool) -> Array:
    """How the cell's work object is turned against the base (3, 3). in_object: the readings are along its axes; else their
    places are in it, and their normals in the base frame. Raises CompstiffError: CS6051 it is not stated, CS4513 it may turn.
    """
    turning = [unit.name for unit in cell.units or () if unit.carries != "nothing"
               and any(axis.rotary and axis.direction is not None for axis in unit.axes)]
    if cell.object_stated and not turning:
        return (cell.world_from_base.inverse() @ cell.world_from_object).rotation
    ways = "give the readings in the base frame (--frame base)" if in_object else (
        "give the places of the tool's centre, without --tool-radius-mm")
    if not cell.object_stated:
        where = "is in the work object" if in_object else "has places in the work object and normals in the base frame"
        raise error("CS6051", f"{where}, and {cell.source.name} states no workobject: how it is turned against the base, in "
                    f"which {file} is, is not known", file=readings.source,
                    hint=f"write the workobject (position_mm, quaternion) that the program declares into cell.yaml, or {ways}")
    raise error("CS4513", f"has the deviation in the base frame, and the cell's {turning[0]} may turn the work object against "
                "the base", file=str(file), hint=f"{ways}, or leave --predicted out")

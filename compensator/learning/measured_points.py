"""Measured points of a machined part: where in the work object, how far off, how sure (docs/formats.md#learn)."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from identification.common.arrays import Array, read_only
from identification.common.findings import Finding, counted, error
from identification.common.predicted_tables import check_measured
from identification.common.sizes import FINEST_READING
from identification.common.tables import Table, read_table
from identification.common.typed_zeros import said_of_zeros
from identification.model.cell import Cell

Indices = NDArray[np.intp]
POSITION, DEVIATION, NORMAL = ("x_mm", "y_mm", "z_mm"), ("dx_um", "dy_um", "dz_um"), ("nx", "ny", "nz")
ALONG = ("dn_um", "d_um")
# A part that is so far off [m] was not measured against this program, or not in micrometres.
LARGEST = 20e-3
# Points that stand in the table before are copies where there are so many, and so large a share of all.
COPIES, SHARE = 3, 0.1


@dataclass(frozen=True, eq=False)
class MeasuredPoints:
    """N points and the n numbers measured at them, in the work object. position (N, 3) [m]; target (N,) that the file names, -1
    where it names none; line (N,) in the file; normal (N, 3), NaN where it is not given. point (n,): of each number; direction
    (n, 3) unit vector along which it was measured; value, sigma (n,) [m]: measured minus planned, and its 1 sigma.
    along_normals: whether these are the normals."""

    source: str
    position: Array
    target: Indices
    line: Indices
    normal: Array
    point: Indices
    direction: Array
    value: Array
    sigma: Array
    findings: tuple[Finding, ...] = ()
    along_normals: bool = False

    def __post_init__(self) -> None:
        read_only(self.position, self.target, self.normal, self.point, self.direction, self.value, self.sigma)

    def __len__(self) -> int:
        return len(self.position)


def read_points(file: str | Path, cell: Cell) -> MeasuredPoints:
    """Reads the measured points of a part: x_mm y_mm z_mm, and any of dx_um dy_um dz_um, or nx ny nz and dn_um (also called
    d_um); std_um and target where they are known.

    Raises CompstiffError: CS0201 to CS0203 the table, CS5300 nothing measured, or both kinds, CS5301 numbers that
    no part has, CS6039 what `predict` or `correct` wrote.
    """
    table = read_table(file, required=POSITION, optional=("target", *DEVIATION, *ALONG, *NORMAL, "std_um"),
                       may_be_empty=(*DEVIATION, *ALONG, "target"), together=(NORMAL,))
    check_measured(table, "as the offsets of the pass it goes to --logged-with")
    named = [name for name in ALONG if name in table.numbers]
    components = [name for name in DEVIATION if name in table.numbers]
    if len(named) + bool(components) != 1:
        found = " and ".join([*named, *([" ".join(components)] if components else [])]) or "neither"
        raise error("CS5300", f"found {found}, expected dx_um dy_um dz_um or nx ny nz dn_um", file=table.source,
                    line=table.header_line, hint="give the components of the deviation, or the deviation along the stated "
                    "normal")
    normal = np.full((len(table), 3), np.nan)
    if NORMAL[0] in table.numbers:
        normal = _unit(table)
    if named:
        if NORMAL[0] not in table.numbers:
            raise error("CS5300", f"has {named[0]} and no nx ny nz", file=table.source, line=table.header_line,
                        hint="a deviation along the normal needs the normal: out of the material, towards the tool")
        values, directions = table.numbers[named[0]][:, None], normal[:, None, :]
    else:
        missing = np.full(len(table), np.nan)
        values = np.column_stack([table.numbers.get(name, missing) for name in DEVIATION])
        directions = np.broadcast_to(np.eye(3), (len(table), 3, 3))
    sigma, findings = _sigma(table, cell)
    point, component = np.nonzero(~np.isnan(values))
    if not len(point):
        raise error("CS5300", "no row has a measured deviation", file=table.source, hint="is it still to be filled in?")
    value = 1e-6 * values[point, component]
    if np.abs(value).max() > LARGEST:
        row = int(point[np.argmax(np.abs(value))])
        raise error("CS5301", f"a deviation of {1e3 * np.abs(value).max():.4g} mm, expected under {1e3 * LARGEST:g} mm",
                    file=table.source, line=int(table.line[row]), hint="deviations are in micrometres")
    return MeasuredPoints(table.source, 1e-3 * table.stack(*POSITION), _targets(table), table.line, normal,
                          point.astype(np.intp), directions[point, component].copy(),
                          value, sigma[point], (*table.findings, *findings, *_copied(table, values), *said_of_zeros(
                              table, 1e-6 * values, np.broadcast_to(sigma[:, None], values.shape))), bool(named))


def _copied(table: Table, values: Array) -> list[Finding]:
    """Points with the very same place and deviation (N, 1 or 3) as one before: they would count as measured again."""
    rows = np.column_stack([table.stack(*POSITION), np.nan_to_num(values)])
    _, first, same_as = np.unique(rows, axis=0, return_index=True, return_inverse=True)
    again = np.flatnonzero(first[np.ravel(same_as)] != np.arange(len(rows)))
    if len(again) < max(COPIES, SHARE * len(rows)):
        return []
    return [Finding("CS0012", "warning", f"{len(again)} of {len(rows)} points stand in the table before, to the last digit: "
                    "they count as measured again, and what is learned is stated too sure", file=table.source,
                    line=int(table.line[again[0]]), hint="delete what was copied; a point measured again differs by its noise")]


def _unit(table: Table) -> Array:
    normal = table.stack(*NORMAL)
    with np.errstate(over="ignore"):
        length = np.linalg.norm(normal, axis=1, keepdims=True)
    wrong = ~(np.abs(length[:, 0] - 1) <= 1e-2)
    if wrong.any():
        row = int(np.argmax(wrong))
        raise error("CS0203", f"nx ny nz has the length {length[row, 0]:.4g}, expected 1", file=table.source,
                    line=int(table.line[row]))
    return np.asarray(normal / length)


def _sigma(table: Table, cell: Cell) -> tuple[Array, list[Finding]]:
    """1 sigma (N,) [m] of each number."""
    if "std_um" in table.numbers:
        sigma = 1e-6 * table.numbers["std_um"]
        if not (sigma > 0).all():
            row = int(np.argmax(~(sigma > 0)))
            raise error("CS0203", f"std_um is {1e6 * sigma[row]:g}, must be larger than 0", file=table.source,
                        line=int(table.line[row]), column=table.column("std_um"))
        if (sigma < FINEST_READING).any():
            row = int(np.argmax(sigma < FINEST_READING))
            raise error("CS6036", f"std_um is {1e6 * sigma[row]:.2g}, which no probe has: in millimetres?", file=table.source,
                        line=int(table.line[row]), column=table.column("std_um"), hint="deviations and their 1 sigma are in "
                        "micrometres")
        return sigma, []
    stated = float(np.sqrt(np.mean(cell.noise.deflection**2)))
    return np.full(len(table), stated), [Finding(
        "CS5302", "note", "no column std_um: 1 sigma of a measured number taken from the cell's "
        f"measurement.deflection_std_um, {1e6 * stated:g} um", file=table.source,
        hint="state what your probe does; the real scatter is estimated beside it")]


def _targets(table: Table) -> Indices:
    """The target (N,) that a row names, -1 where it names none."""
    if "target" not in table.numbers:
        return np.full(len(table), -1, dtype=np.intp)
    target = table.numbers["target"]
    given = ~np.isnan(target)
    wrong = given & ((target != np.round(target)) | (target < 0) | (target > 1e9))
    if wrong.any():
        row = int(np.argmax(wrong))
        raise error("CS3004", f"target {target[row]:g} is not a target number, expected 0, 1, 2 ...", file=table.source,
                    line=int(table.line[row]), column=table.column("target"))
    return np.where(given, np.nan_to_num(target), -1).astype(np.intp)


def left_out(points: MeasuredPoints, rows: NDArray[np.bool_], code: str, why: str, hint: str) -> list[Finding]:
    """A warning for points (N,) that are not used, with the line of the first; none: nothing."""
    if not rows.any():
        return []
    return [Finding(code, "warning", f"{counted(int(rows.sum()), 'point')} of {len(points)} {why}: left out",
                    file=points.source, line=int(points.line[np.argmax(rows)]), hint=hint)]

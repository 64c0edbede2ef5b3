"""Measured deviations along a path, before or after a correction: read, and paired with each other or with a prediction."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from identification.common.added_targets import AddedTargets
from identification.common.arrays import Array, read_only, rms
from identification.common.findings import Finding, counted, error
from identification.common.predicted_tables import check_measured
from identification.common.sizes import FINEST_READING
from identification.common.tables import Table, read_table
from identification.common.typed_zeros import said_of_zeros
from identification.model.cell import Cell

Indices = NDArray[np.intp]
Key = Literal["target", "path_mm", "x_mm y_mm z_mm"]
POSITION = ("x_mm", "y_mm", "z_mm")
DEVIATION, SIGMA = ("dx_um", "dy_um", "dz_um"), ("sx_um", "sy_um", "sz_um")
NORMAL = ("nx", "ny", "nz")
# So many components whose RMS is under this share of their 1 sigma are in another unit, or typed zeros: chance makes three such
# files in 1e9.
ENOUGH, TOO_QUIET = 10, 0.1
# No part that was milled is off by so much, RMS [m] (engineering judgement).
FARTHEST = 1e-2

# Readings of one target are averaged where their normals are no farther apart than this [degrees].
APART_DEG = 30.0

# At one place readings are told apart by their normals as if they stood at least so far from each other [m]; no place is so far
# from another [m].
SAME_PLACE, FARTHEST_PLACE = 1e-4, 1e3

# Two passes over one part share at least this part of the smaller one's places: with fewer it is another part, or mirrored.
FEWEST_PAIRS = 0.1


@dataclass(frozen=True, eq=False)
class Readings:
    """N places in the order of the path. key: what places them; place (N, 1) target number or path length [m], or (N, 3) [m].

    deviation (N, C) [m], sigma (N, C) [m]: measured minus planned and its 1 sigma; NaN where a component was not measured. C is
    3 (x y z) or 1 (along the surface's normal). normal (N, 3): unit vector, None where it is not given. rows: each reading by
    itself and as the file has it, where those of a target were averaged or some left out.
    """

    source: str
    key: Key
    place: Array
    deviation: Array
    sigma: Array
    normal: Array | None
    findings: tuple[Finding, ...] = ()
    rows: Readings | None = None

    def __post_init__(self) -> None:
        read_only(self.place, self.deviation, self.sigma, *([] if self.normal is None else [self.normal]))

    def __len__(self) -> int:
        return len(self.place)

    @property
    def axes(self) -> tuple[str, ...]:
        """Names of the components."""
        return ("x", "y", "z") if self.deviation.shape[1] == 3 else ("normal",)

    @property
    def size(self) -> Array:
        """Size (N,) [m] of the measured part of the deviation."""
        return np.asarray(np.sqrt(np.nansum(self.deviation**2, axis=1)))

    @property
    def each(self) -> Readings:
        """Every reading of the file, of which a tolerance is asked."""
        return self if self.rows is None else self.rows

    def as_given(self, added: AddedTargets) -> Readings:
        """With the numbers that the program as given has for its targets, where these are the corrected program's: rows at
        targets that were added are left out. Where they may be either's they are taken for the former."""
        highest = int(self.place.max())
        which = added.numbered(highest)
        if self.key != "target" or which is False:
            return self
        if which is None:
            return replace(self, findings=(*self.findings, Finding(
                "CS6038", "warning", f"names targets up to {highest}: taken as the planned program numbers them; the corrected "
                f"one has {len(added.given) - len(added.number)} more and numbers them otherwise from target {added.first} on",
                file=self.source, hint="if they are the corrected program's, place the rows by x_mm y_mm z_mm (planned)")))
        own = np.isin(self.place[:, 0], added.number)
        kept = self.select(np.flatnonzero(own))
        note = Finding("CS6037", "note", "names targets of the corrected program: taken as those of the planned one that they "
                       f"are ({counted(int((~own).sum()), 'row')} at targets that were added left out)", file=self.source)
        place: Array = added.given[kept.place[:, 0].astype(np.intp)][:, None].astype(np.float64)
        return replace(kept, place=place, findings=(*self.findings, note), rows=self.each)

    def select(self, rows: Indices) -> Readings:
        """The places of these rows, in this order."""
        return Readings(self.source, self.key, self.place[rows], self.deviation[rows], self.sigma[rows],
                        None if self.normal is None else self.normal[rows], self.findings)


def read_readings(file: Path, cell: Cell) -> Readings:
    """Reads a measured pass (docs/formats.md, verify). Raises CompstiffError: CS0201 to CS0203, CS6020 nothing measured,
    both kinds, or one target along several normals, CS6021 no column places the rows, CS6035 smaller than their own scatter,
    CS6036 in another unit, CS6039 what `predict` or `correct` wrote."""
    table = read_table(file, required=(), optional=("target", "path_mm", *POSITION, *DEVIATION, *SIGMA, "dn_um", "sn_um",
                                                    *NORMAL, "std_um"),
                       may_be_empty=(*DEVIATION, "dn_um", *POSITION), together=(POSITION, SIGMA, NORMAL))
    check_measured(table, "it goes to --predicted")
    if not len(table):
        raise error("CS6020", "has no row below its header", file=table.source, line=table.header_line)
    key, place = _placed(table)
    along_normal = "dn_um" in table.numbers
    if along_normal == any(name in table.numbers for name in DEVIATION):
        raise error("CS6020", f"found {'both dn_um and' if along_normal else 'neither dn_um nor one of'} dx_um dy_um dz_um",
                    file=table.source, line=table.header_line, hint="give the components x y z, as many as were measured, or "
                    "the deviation along the normal")
    names, sigmas = (("dn_um",), ("sn_um",)) if along_normal else (DEVIATION, SIGMA)
    deviation, findings = _columns(table, names), list(table.findings)
    nowhere = np.flatnonzero(np.isnan(place).any(axis=1) & ~np.isnan(deviation).all(axis=1))
    if len(nowhere):
        raise error("CS0203", "a measured deviation without its x_mm y_mm z_mm", file=table.source,
                    line=int(table.line[nowhere[0]]), hint="give the planned place, or delete the row")
    if sigmas[0] in table.numbers:
        sigma = _columns(table, sigmas)
    elif "std_um" in table.numbers:         # of each number, as `learn` has it
        sigma = np.tile(1e-6 * table.numbers["std_um"][:, None], (1, len(names)))
    else:
        stated = cell.noise.deflection
        sigma = np.tile(np.sqrt(np.mean(stated**2)) if along_normal else stated, (len(table), 1))
        shown = sigma[0] if len(set(sigma[0])) > 1 else sigma[0, :1]
        findings.append(Finding("CS6025", "note", f"no column {' '.join(sigmas)}: 1 sigma of a reading taken from the cell's "
                                f"measurement.deflection_std_um, {', '.join(f'{1e6 * x:.3g}' for x in shown)} um",
                                file=table.source, hint="state what your probe does"))
    if not (sigma > 0).all():
        row = int(np.flatnonzero(~(sigma > 0).all(axis=1))[0])
        raise error("CS0203", "a 1 sigma must be larger than 0", file=table.source, line=int(table.line[row]))
    normal = None
    if NORMAL[0] in table.numbers:
        normal = table.stack(*NORMAL)
        length = np.linalg.norm(normal, axis=1, keepdims=True)
        if (np.abs(length - 1) > 1e-2).any():
            row = int(np.argmax(np.abs(length - 1)))
            raise error("CS0203", f"nx ny nz has the length {length[row, 0]:.4g}, expected 1", file=table.source,
                        line=int(table.line[row]))
        normal = normal / length
    readings = Readings(table.source, key, place, deviation, np.where(np.isnan(deviation), np.nan, sigma), normal)
    _check_scatter(readings, table.line)
    _check_normals(readings, table.line)
    return _in_order(readings, [*findings, *said_of_zeros(table, deviation, sigma)])


def _check_scatter(readings: Readings, line: Indices) -> None:
    """Refuses readings that are smaller than what they scatter by: they would pass for a perfect part (CS6035). And those of
    another unit, their scatter with them (CS6036)."""
    measured = ~np.isnan(readings.deviation)
    hint = "deviations and their 1 sigma are in micrometres"
    fine = np.flatnonzero((readings.sigma < FINEST_READING).any(axis=1))
    if len(fine):
        raise error("CS6036", f"a 1 sigma of {1e6 * np.nanmin(readings.sigma[fine[0]]):.2g} um that no probe has: in "
                    "millimetres?", file=readings.source, line=int(line[fine[0]]), hint=hint)
    size = rms(readings.deviation[measured]) if measured.any() else 0.0
    if size > FARTHEST:
        raise error("CS6036", f"deviations of {1e6 * size:.3g} um, RMS: in nanometres, or places in their columns?",
                    file=readings.source, hint=hint)
    relative = rms((readings.deviation / readings.sigma)[measured]) if measured.sum() >= ENOUGH else 1.0
    if relative < TOO_QUIET:
        raise error("CS6035", f"all {int(measured.sum())} deviations together are {relative:.2g} times their own 1 sigma, RMS: "
                    "a perfect part would show 1", file=readings.source, hint="deviations are in micrometres: in millimetres? "
                    "Were they measured? If the probe is so good, state its sx_um sy_um sz_um (sn_um)")


def _check_normals(readings: Readings, line: Indices) -> None:
    """Refuses readings of one target along other normals (CS6020), as of both walls of a corner: their mean is of neither."""
    if readings.key != "target" or readings.axes != ("normal",) or readings.normal is None:
        return
    measured = np.flatnonzero(~np.isnan(readings.deviation[:, 0]))
    target, normal = readings.place[measured, 0], readings.normal[measured]
    _, first, member = np.unique(target, return_index=True, return_inverse=True)
    alike = np.einsum("ni,ni->n", normal, normal[first[member.ravel()]])
    apart = np.flatnonzero(alike < np.cos(np.radians(APART_DEG)))
    if len(apart):
        row = int(apart[0])
        raise error("CS6020", f"target {target[row]:.0f} has readings along normals that are "
                    f"{np.degrees(np.arccos(np.clip(alike[row], -1, 1))):.0f} degrees apart, expected up to {APART_DEG:g}: one "
                    "deviation cannot be made of them", file=readings.source, line=int(line[measured[row]]),
                    hint="place them by x_mm y_mm z_mm (planned)")


def _placed(table: Table) -> tuple[Key, Array]:
    if "target" in table.numbers:
        target = table.numbers["target"]
        if ((target != np.round(target)) | (target < 0)).any():
            row = int(np.flatnonzero((target != np.round(target)) | (target < 0))[0])
            raise error("CS3004", f"target {target[row]:g} is not a target number, expected 0, 1, 2 ...", file=table.source,
                        line=int(table.line[row]), column=table.column("target"))
        return "target", target[:, None]
    if "path_mm" in table.numbers:
        return "path_mm", 1e-3 * table.numbers["path_mm"][:, None]
    if POSITION[0] in table.numbers:
        return "x_mm y_mm z_mm", 1e-3 * table.stack(*POSITION)
    raise error("CS6021", f"no column says where a row was measured: found {', '.join(table.columns)}", file=table.source,
                line=table.header_line, hint="give one of: target, path_mm, x_mm y_mm z_mm (planned place in the work object)")


def _columns(table: Table, names: tuple[str, ...]) -> Array:
    missing = np.full(len(table), np.nan)
    return 1e-6 * np.column_stack([table.numbers.get(name, missing) for name in names])


def _in_order(readings: Readings, findings: list[Finding]) -> Readings:
    """Without rows in which nothing was measured, sorted along the path, several readings of one target averaged."""
    measured = np.flatnonzero(~np.isnan(readings.deviation).all(axis=1))
    if len(measured) < len(readings):
        findings.append(Finding("CS6032", "note", f"{counted(len(readings) - len(measured), 'row')} without a measured "
                                "component left out", file=readings.source))
    if not len(measured):
        raise error("CS6020", "no row has a measured deviation", file=readings.source, hint="is it still to be filled in?")
    kept, rows = readings.select(measured), None
    if kept.key == "path_mm":
        kept = kept.select(np.argsort(kept.place[:, 0], kind="stable"))
    if kept.key == "target":
        _, first, member = np.unique(kept.place[:, 0], return_index=True, return_inverse=True)
        if len(first) < len(kept):
            rows = kept
            findings.append(Finding("CS6033", "note", f"{counted(len(kept) - len(first), 'further reading')} of a "
                                    "target that has one: averaged with it", file=kept.source))
        known = ~np.isnan(kept.deviation)
        number, total, variance = (np.zeros((len(first), known.shape[1])) for _ in range(3))
        np.add.at(number, member, known)
        np.add.at(total, member, np.nan_to_num(kept.deviation))
        np.add.at(variance, member, np.nan_to_num(kept.sigma) ** 2)
        with np.errstate(invalid="ignore", divide="ignore"):
            deviation, sigma = total / number, np.sqrt(variance) / number
        kept = Readings(kept.source, kept.key, kept.place[first], deviation, sigma,
                        None if kept.normal is None else kept.normal[first])
    return replace(kept, findings=tuple(findings), rows=rows)


def pair(first: Readings, second: Readings, within: float) -> tuple[Indices, Indices]:
    """Rows of both that belong together, in the order of the first: the same target, or places that are each other's nearest
    and at most `within` [m] apart, of several at one place those along the same normal, and of these the first with the first.
    Raises CompstiffError: CS6020 other components, CS6021 placed by other columns, CS6023 next to no pair."""
    if first.key != second.key:
        raise error("CS6021", f"is placed by {second.key}, {first.source} by {first.key}", file=second.source,
                    hint="place both by the same columns")
    if first.axes != second.axes:
        raise error("CS6020", f"has the deviation along {' '.join(second.axes)}, {first.source} along {' '.join(first.axes)}",
                    file=second.source, hint="measure both passes alike")
    by_target = first.key == "target"
    normals = None if by_target or first.normal is None or second.normal is None else (first.normal, second.normal)
    one, two = normals or (None, None)
    mine, other = nearest(_apart(first.place, one, within), _apart(second.place, two, within), np.inf)
    fits = np.linalg.norm(first.place[mine] - second.place[other], axis=1) <= (0.0 if by_target else within)
    if normals:
        fits &= np.einsum("ni,ni->n", normals[0][mine], normals[1][other]) >= np.cos(np.radians(APART_DEG))
    mine, other = mine[fits], other[fits]
    count = min(len(first), len(second))
    if len(mine) < FEWEST_PAIRS * count:
        few = "no row belongs" if not len(mine) else f"only {len(mine)} of {count} rows belong"
        alike = f", along normals at most {APART_DEG:g} degrees apart" if normals else ""
        raise error("CS6023", f"{few} to a row of {first.source}" + (
            "" if by_target else f" (nearest places, at most {1e3 * within:g} mm apart{alike})"), file=second.source,
            hint="are both from the same program?" + ("" if by_target else " --within-mm sets the distance") + (
                "; are the normals of both out of the material?" if normals else ""))
    return mine, other


def _apart(place: Array, normal: Array | None, within: float) -> Array:
    """Places (N, d), with further columns by which several readings at one are apart: their normals, as far as `within` [m] at
    APART_DEG, and how many of the same came before."""
    if normal is not None:
        place = np.column_stack([place, max(within, SAME_PLACE) / (2 * np.sin(np.radians(APART_DEG / 2))) * normal])
    return np.column_stack([place, FARTHEST_PLACE * _came_before(place)])


def _came_before(rows: Array) -> Indices:
    """How many rows before it each of (N, k) equals."""
    _, member = np.unique(rows, axis=0, return_inverse=True)
    order = np.argsort(member.ravel(), kind="stable")
    _, first, length = np.unique(member.ravel()[order], return_index=True, return_counts=True)
    before = np.empty(len(rows), dtype=np.intp)
    before[order] = np.arange(len(rows)) - np.repeat(first, length)
    return before


def nearest(first: Array, second: Array, within: float) -> tuple[Indices, Indices]:
    """Rows of places (n, d) and (m, d) that are each other's nearest and at most `within` apart."""
    from scipy.spatial import cKDTree

    distance, there = map(np.asarray, cKDTree(second).query(first))
    back = np.asarray(cKDTree(first).query(second)[1])
    mine = np.flatnonzero((back[there] == np.arange(len(first))) & (distance <= within))
    return mine, there[mine].astype(np.intp)

"""Measurements: loads and deflections, read and checked (docs/formats.md#measurementscsv)."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from identification.common.cells import MOST_COMPLAINTS
from identification.common.columns import DEFLECTIONS, FORCES, JOINTS, MASS, MOMENTS, SIGMAS
from identification.common.files import sha256
from identification.common.findings import CompstiffError, Finding, error, fold
from identification.common.tables import Table, read_table
from identification.model.cell import Cell
from identification.model.gravity import FREE_FALL, fall_in_base
from identification.model.robot import RobotModel

Array = NDArray[np.float64]
PURPOSES = ("identify", "validate")
# A deflection beyond this is taken for a mistaken unit: every laser of such a rig ends at some millimetres.
LARGEST_DEFLECTION_M = 0.05
# No robot carries more than half of this: a larger mass is in grams or newtons.
LARGEST_MASS_KG = 5000.0
# In whatever unit a table was written by mistake, a load is below this [N, N m], and a sigma above that [m].
LARGEST_LOAD, SMALLEST_SIGMA = 1e9, 1e-15
# The step of a gauge [um] from which on two readings of one load are often alike; engineering judgement: readings scatter by
# about one.
COARSE = 0.5
# Nobody waits so long [s] for each row of a load test: seconds were taken for milliseconds (engineering judgement).
LONGEST_ROW_S = 1800.0
# Nobody brings more weights to a load test: more masses are the same ones, each weighed with its hook.
MOST_WEIGHTS = 6


@dataclass(frozen=True, eq=False)
class Measurements:
    """N rows in the order they were taken.

    theta (N, 6) controller angles [rad]; wrench (N, 6) on the tool at the TCP, base frame [N, N m];
    deflection (N, 3) loaded minus unloaded TCP, base frame [m], NaN where a component was not measured;
    sigma (N, 3) the row's own 1 sigma [m], NaN where the file gives none; time, dwell (N,) [s], NaN where not given;
    visit (N,) number of the pose visit, from 0; reference (N,) number of the unloaded reference, from 0;
    validate (N,) True for rows that are never fitted; machined_pass, pose (N,) labels, "" where none;
    row (N,) from 1, and line (N,) in the file; hung (N,) True where the load was given as a mass, which is as heavy at every
    pose, None where none was; sha256 of its bytes, "" where the rows are of no file; began: time [s] of the
    file's first row that has one, whichever rows these are.
    """

    source: str
    theta: Array
    wrench: Array
    deflection: Array
    sigma: Array
    time: Array
    dwell: Array
    visit: NDArray[np.intp]
    reference: NDArray[np.intp]
    validate: NDArray[np.bool_]
    machined_pass: NDArray[np.object_]
    pose: NDArray[np.object_]
    row: NDArray[np.intp]
    line: NDArray[np.intp]
    findings: tuple[Finding, ...]
    sha256: str = ""
    began: float = 0.0
    hung: NDArray[np.bool_] | None = None

    def __len__(self) -> int:
        return len(self.line)

    @property
    def made_from(self) -> tuple[dict[str, str], ...]:
        """The file they stand in, by name and SHA-256, as a stiffness file has it; nothing where they are of none."""
        return ({"file": Path(self.source).name, "sha256": self.sha256},) if self.sha256 else ()

    @property
    def weights(self) -> tuple[str, ...]:
        """`design --dead-weight` with the weights of these rows, each alone; nothing where any load was none, or over six
        were."""
        loaded = np.any(self.wrench != 0, axis=1)
        if self.hung is None or not self.hung[loaded].all():
            return ()
        masses = np.unique(np.round(np.linalg.norm(self.wrench[loaded, :3], axis=1) / FREE_FALL, 2))
        return ("--dead-weight", ",".join(f"{mass:g}" for mass in masses)) if 0 < len(masses) <= MOST_WEIGHTS else ()

    def select(self, rows: NDArray[np.bool_]) -> Measurements:
        """The rows where `rows` (N,) is True."""
        arrays: dict[str, Any] = {name: getattr(self, name)[rows] for name in (
            "theta", "wrench", "deflection", "sigma", "time", "dwell", "visit", "reference", "validate",
            "machined_pass", "pose", "row", "line")}
        return replace(self, hung=None if self.hung is None else self.hung[rows], **arrays)

    def followed_by(self, other: Measurements) -> Measurements:
        """These rows and then those of `other`, whose visits, references, row numbers and times go on from these."""
        after = {"visit": self.visit.max() + 1, "reference": self.reference.max() + 1, "row": self.row.max(),
                 "line": self.line.max(), "time": np.nanmax(self.time, initial=0.0)}
        arrays: dict[str, Any] = {
            name: np.concatenate([getattr(self, name), getattr(other, name) + after.get(name, 0)]) for name in (
                "theta", "wrench", "deflection", "sigma", "time", "dwell", "visit", "reference", "row", "line")}
        labels: dict[str, Any] = {name: np.concatenate([getattr(self, name), getattr(other, name)]) for name in (
            "validate", "machined_pass", "pose")}
        each = [np.zeros(len(rows), dtype=bool) if rows.hung is None else rows.hung for rows in (self, other)]
        hung = None if self.hung is None and other.hung is None else np.concatenate(each)
        return Measurements(source=self.source, findings=self.findings, began=self.began, hung=hung, **arrays, **labels)


def read_measurements(file: str | Path, robot: RobotModel | Cell, *, planned: bool = False) -> Measurements:
    """Reads measurements.csv (or Parquet) for this robot; planned: a plan, whose deflections may all be empty.

    robot: the cell itself where loads are masses, since its base frame says which way they pull.

    Raises CompstiffError with line and column: CS0201 to CS0203 (not a table, columns, numbers), CS1001 unknown purpose,
    CS1002 joint outside its limits, CS1003 sigma not positive, CS1004 loaded row without any deflection, CS1005 no load,
    CS1006 deflections whose unit cannot be right, CS1080 a load beyond all bounds, CS1508 to CS1510 masses beside forces,
    without a cell, too large.

    >>> cell = compstiff.read_cell("cell.yaml")
    >>> measurements = compstiff.read_measurements("measurements.csv", cell.robot)
    >>> measurements.theta.shape, int(measurements.validate.sum())
    ((112, 6), 28)
    """
    table = read_table(
        file, required=(*JOINTS, *FORCES, *DEFLECTIONS), optional=(MASS, *MOMENTS, *SIGMAS, "time_s", "dwell_s"),
        texts=("pose", "purpose", "reference", "pass"), may_be_empty=(*DEFLECTIONS, MASS, *SIGMAS, "dwell_s"),
        together=(MOMENTS, SIGMAS), instead={MASS: FORCES})
    cell, robot = (robot, robot.robot) if isinstance(robot, Cell) else (None, robot)
    count = len(table)
    nothing = np.full(count, np.nan)
    reference = run_numbers(table.texts.get("reference", np.full(count, "", dtype=object)))
    time = _running(table.numbers.get("time_s", nothing), reference)
    theta = np.radians(table.stack(*JOINTS))
    moment = np.column_stack([table.numbers.get(name, np.zeros(count)) for name in MOMENTS])
    wrench = np.concatenate([_forces(table, cell), moment], axis=1)
    deflection = 1e-6 * table.stack(*DEFLECTIONS)
    sigma = 1e-6 * np.column_stack([table.numbers.get(name, nothing) for name in SIGMAS])
    purpose = table.texts.get("purpose", np.full(count, "", dtype=object))
    problems = [
        *_purposes(table, purpose), *_limits(table, robot, theta), *_sigmas(table, sigma),
        *([] if planned else _rows_without_deflection(table, wrench, deflection)),
    ]
    if problems:
        raise CompstiffError(*sorted(problems, key=lambda finding: finding.line or 0)[:MOST_COMPLAINTS])
    _check_sizes(table, wrench, deflection)
    return Measurements(
        source=table.source, theta=theta, wrench=wrench, deflection=deflection, sigma=sigma,
        time=time, dwell=table.numbers.get("dwell_s", nothing),
        visit=_visits(table, theta), reference=reference,
        validate=purpose == "validate", machined_pass=table.texts.get("pass", np.full(count, "", dtype=object)),
        pose=table.texts.get("pose", np.full(count, "", dtype=object)), row=np.arange(1, count + 1), line=table.line,
        findings=fold([*table.findings, *([] if planned else _not_measured(table, deflection)), *_backwards(table, reference),
                       *_slow(table), *([] if planned else _repeated(table, wrench, deflection, _visits(table, theta))),
                       *_not_moved(table, wrench, deflection)]),
        sha256=sha256(file), began=_began(time), hung=~np.isnan(table.numbers[MASS]) if MASS in table.numbers else None)


def _began(time: Array) -> float:
    """The first time (N,) [s] that there is, 0 where there is none."""
    known = time[~np.isnan(time)]
    return float(known[0]) if len(known) else 0.0


def _forces(table: Table, cell: Cell | None) -> Array:
    """Forces (N, 3) [N] in the base frame: as given, or the weight of the mass that a row gives in their place."""
    if MASS not in table.numbers:
        return table.stack(*FORCES)
    mass = table.numbers[MASS]
    force = table.stack(*FORCES) if FORCES[0] in table.numbers else np.full((len(table), 3), np.nan)
    hung = ~np.isnan(mass)
    problems = [
        Finding("CS1508", "error", text, file=table.source, line=int(table.line[row]), column=table.column(MASS), hint=hint)
        for rows, text, hint in (
            (hung & ~np.isnan(force).all(axis=1), "a mass and a force: which of them acted?",
             "give mass_kg for a hung weight or fx_n fy_n fz_n for any other load, and leave the other cells empty"),
            (~hung & np.isnan(force).any(axis=1), "neither a mass nor all three of fx_n fy_n fz_n",
             "give mass_kg = 0 where nothing hung")) for row in np.flatnonzero(rows)]
    problems += [
        Finding("CS1510", "error", f"a mass of {mass[row]:g} kg, the limit is {LARGEST_MASS_KG:g}", file=table.source,
                line=int(table.line[row]), column=table.column(MASS), hint="mass_kg is in kilograms: grams? newtons?")
        for row in np.flatnonzero(np.abs(np.nan_to_num(mass)) > LARGEST_MASS_KG)]
    if problems:
        raise CompstiffError(*sorted(problems, key=lambda finding: finding.line or 0)[:MOST_COMPLAINTS])
    if not hung.any():
        return force
    if cell is None:
        raise error("CS1509", "the loads are masses, and which way they pull in the base frame is not known", file=table.source,
                    hint="read the file with the cell in place of its robot: read_measurements(file, cell)")
    return np.where(hung[:, None], np.nan_to_num(mass)[:, None] * fall_in_base(cell.world_from_base), force)


def _check_sizes(table: Table, wrench: Array, deflection: Array) -> None:
    """Refuses a file without any load (CS1005), loads beyond all bounds (CS1080) and deflections whose unit cannot be right
    (CS1006)."""
    if not np.any(wrench != 0):
        raise error("CS1005", f"none of the {len(table)} rows has a load: there is nothing to identify", file=table.source,
                    hint="fx_n fy_n fz_n are the forces on the tool in newton, mass_kg what hangs at it in kilograms"
                    if len(table) else "the sheet is empty: write a row a reading, or save the filled-in plan under this name")
    if np.abs(wrench).max() > LARGEST_LOAD:
        row, axis = (int(index) for index in np.argwhere(np.abs(wrench) > LARGEST_LOAD)[0])
        name = (*FORCES, *MOMENTS)[axis]
        raise error("CS1080", f"column '{name}': found {wrench[row, axis]:g}, the limit is {LARGEST_LOAD:g}", file=table.source,
                    line=int(table.line[row]), column=table.column(name) if name in table.columns else None,
                    hint="forces are in newton, moments in newton metre")
    if np.nanmax(np.abs(deflection), initial=0.0) > LARGEST_DEFLECTION_M:
        row = int(np.nanargmax(np.nanmax(np.abs(np.nan_to_num(deflection)), axis=1)))
        raise error("CS1006", f"a deflection of {1e3 * np.nanmax(np.abs(deflection[row])):.4g} mm, the limit is "
                    f"{1e3 * LARGEST_DEFLECTION_M:g} mm", file=table.source, line=int(table.line[row]),
                    hint="deflections are in micrometres, loaded minus unloaded, not positions")


def _not_measured(table: Table, deflection: Array) -> list[Finding]:
    empty = int(np.isnan(deflection).sum())
    return [Finding("CS1007", "note", f"{empty} of {deflection.size} deflection components empty, taken as not "
                    "measured", file=table.source)] if empty else []


def _running(time: Array, reference: NDArray[np.intp]) -> Array:
    """Times (N,) [s] that run on from row to row. Where the clock stands earlier at the first row of a reference (N,) than at
    the last one of the reference before, it began anew with the zero reading, right after that row."""
    first = np.flatnonzero(_anew(time, reference))
    later = np.zeros(len(time))
    later[first] = time[first - 1]
    return np.asarray(time + np.cumsum(later))


def _anew(time: Array, reference: NDArray[np.intp]) -> NDArray[np.bool_]:
    """The rows (N,) at which the clock begins anew, with a reference. Where it stands as the row before did it does so only if
    that one, too, is alone with a clock of its own: of a clock that runs on two rows have the same minute."""
    anew, first, own = np.zeros(len(time), dtype=bool), 0, True
    for row in (np.flatnonzero(np.diff(reference)) + 1).tolist():
        anew[row] = time[row] < time[row - 1] or (own and time[row] == time[row - 1] == time[first])
        first, own = row, anew[row]
    return anew


def _backwards(table: Table, reference: NDArray[np.intp]) -> list[Finding]:
    """Time that runs backwards within one reference (N,), or begins anew with a new one."""
    if "time_s" not in table.numbers:
        return []
    time = table.numbers["time_s"]
    back, anew = np.append(False, (np.diff(time) < 0) & (np.diff(reference) == 0))[:len(time)], _anew(time, reference)
    found = []
    if back.any():
        found.append(Finding(
            "CS1008", "warning", "time_s runs backwards although rows stand in the order they were taken", file=table.source,
            line=int(table.line[int(np.argmax(back))]), column=table.column("time_s"),
            hint="a new reading of the unloaded reference needs a new id in the column 'reference'"))
    if anew.any():
        found.append(Finding(
            "CS1028", "note", f"time_s begins anew at {np.count_nonzero(anew)} of {reference.max()} later references: each was "
            "taken to follow right after the reading before it", file=table.source, line=int(table.line[int(np.argmax(anew))]),
            column=table.column("time_s"), hint="let time_s run on over the whole measurement: what warms up or drifts from "
            "one visit to the next is told by it"))
    return found


def _slow(table: Table) -> list[Finding]:
    """Rows or dwells that take hours each: times in milliseconds, or times of day as hours."""
    found = []
    for name, values in (("time_s", np.diff(table.numbers.get("time_s", np.zeros(0)))),
                         ("dwell_s", table.numbers.get("dwell_s", np.zeros(0)))):
        middle = float(np.median(np.abs(values[np.isfinite(values)]))) if np.isfinite(values).any() else 0.0
        if middle > LONGEST_ROW_S:
            found.append(Finding(
                "CS1026", "warning", f"by {name} a row takes {middle / 3600:.3g} hours, in the middle: in milliseconds?",
                file=table.source, line=int(table.line[0]), column=table.column(name),
                hint=f"{name} is in seconds; creep, warming and drift are told by it"))
    return found


def _repeated(table: Table, wrench: Array, deflection: Array, visit: NDArray[np.intp]) -> list[Finding]:
    """Loaded rows that stand in the table before, to the last digit: copied, they would count as measured again.

    A few may be so by chance where readings have few digits. Gauges that show no less than COARSE give the same reading on the
    way up and down: of those only rows that stand in another visit (N,) count, to which the robot came anew.
    """
    loaded = np.flatnonzero(np.any(wrench != 0, axis=1) & np.any(np.nan_to_num(deflection) != 0, axis=1))
    rows = np.nan_to_num(np.column_stack([table.stack(*JOINTS), wrench, table.stack(*DEFLECTIONS)])[loaded])
    readings = np.unique(np.round(rows[:, -len(DEFLECTIONS):], 6))
    coarse = len(readings) > 1 and np.diff(readings).min() >= COARSE
    _, first, same_as = np.unique(rows, axis=0, return_index=True, return_inverse=True)
    before = first[np.ravel(same_as)]
    again = loaded[(before != np.arange(len(loaded))) & (not coarse or visit[loaded] != visit[loaded[before]])]
    if len(again) < 3 or len(again) < 0.1 * len(loaded):
        return []
    return [Finding("CS0012", "warning", f"{len(again)} of {len(loaded)} loaded rows stand in the table before, to the last "
                    "digit: they count as measured again, and the stated intervals come out too narrow", file=table.source,
                    line=int(table.line[again[0]]), hint="delete what was copied; a load measured again differs by its noise")]


def _not_moved(table: Table, wrench: Array, deflection: Array) -> list[Finding]:
    """Loaded rows in which nothing moved at all."""
    loaded = np.any(wrench != 0, axis=1)
    still = np.flatnonzero(loaded & (deflection == 0).all(axis=1))
    if len(still) < 3 or len(still) < 0.1 * loaded.sum():
        return []
    return [Finding("CS1025", "warning", f"in {len(still)} of {int(loaded.sum())} rows with a load all three deflections are "
                    "exactly 0: no robot stands so still", file=table.source, line=int(table.line[still[0]]),
                    hint="were they measured? Leave the cells empty, or delete the rows, where not")]


def run_numbers(label: NDArray[np.object_] | Array) -> NDArray[np.intp]:
    """Number of the run of equal consecutive labels (N,) each row is in."""
    changed = np.any(np.atleast_2d(np.asarray(label).T)[:, 1:] != np.atleast_2d(np.asarray(label).T)[:, :-1], axis=0)
    return np.concatenate([[0], np.cumsum(changed)]).astype(np.intp)[: len(label)]


def _visits(table: Table, theta: Array) -> NDArray[np.intp]:
    """Pose visits: runs of one label, or of equal joint angles where the file has no labels; a machined pass is one."""
    visit = run_numbers(table.texts["pose"]) if "pose" in table.texts else run_numbers(theta)
    label = table.texts.get("pass")
    if label is None:
        return visit
    on_path = label != ""
    return run_numbers(np.column_stack([on_path, np.where(on_path, run_numbers(label), visit)]))


def _purposes(table: Table, purpose: NDArray[np.object_]) -> list[Finding]:
    known = (purpose == "") | np.isin(purpose.astype(str), PURPOSES)
    return [
        Finding("CS1001", "error", f"unknown purpose '{purpose[row]}', expected identify or validate",
                file=table.source, line=int(table.line[row]), column=table.column("purpose"))
        for row in np.flatnonzero(~known)
    ]


def _limits(table: Table, robot: RobotModel, theta: Array) -> list[Finding]:
    excess = robot.limit_excess(theta)
    findings = []
    for row, joint in np.argwhere(excess > np.radians(1e-6))[:MOST_COMPLAINTS]:
        hint = "angles are the controller's, in degrees, as the pendant shows them"
        if joint < 6 or robot.window is None:
            low, high = np.degrees(robot.limits[joint])
            message = (f"joint {joint + 1} at {np.degrees(theta[row, joint]):.6g} deg is outside its limits {low:g} to "
                       f"{high:g} deg")
            column = JOINTS[joint]
        else:
            index, low, high = robot.window
            value = np.degrees(theta[row] @ robot.coupling[index])
            message = (f"the parallel rod's angle {value:.6g} deg (joint {index + 1} with its driver) is outside its window "
                       f"{np.degrees(low):g} to {np.degrees(high):g} deg")
            column = JOINTS[index]
        findings.append(Finding("CS1002", "error", message, file=table.source, line=int(table.line[row]),
                                column=table.column(column), hint=hint))
    return findings


def _sigmas(table: Table, sigma: Array) -> list[Finding]:
    return [
        Finding("CS1003", "error", f"a sigma of {1e6 * sigma[row, axis]:g} um, must be greater than zero"
                + (f", at least {1e6 * SMALLEST_SIGMA:g}" if sigma[row, axis] > 0 else ""),
                file=table.source, line=int(table.line[row]), column=table.column(SIGMAS[axis]))
        for row, axis in np.argwhere(sigma < SMALLEST_SIGMA)[:MOST_COMPLAINTS]
    ]


def _rows_without_deflection(table: Table, wrench: Array, deflection: Array) -> list[Finding]:
    empty = np.any(wrench != 0, axis=1) & np.isnan(deflection).all(axis=1)
    return [
        Finding("CS1004", "error", "a load, but no deflection: dx_um, dy_um and dz_um are all empty", file=table.source,
                line=int(table.line[row]), column=table.column("dx_um"),
                hint="fill in what the sensors showed, or delete the row")
        for row in np.flatnonzero(empty)[:MOST_COMPLAINTS]
    ]

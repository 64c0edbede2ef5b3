"""`compstiff check`: every file of a cell read as its own command would read it, and held against its neighbours."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from compensator.correction.settings import DEFAULTS, Settings
from compensator.posting.suffixes import toolpath_stem, toolpath_suffix
from compstiff.file_kinds import SUFFIXES, Kind, kind_of
from compstiff.program_checks import program_check
from identification.common.findings import CompstiffError, Finding, Refused, counted
from identification.common.made_from import said_of_tables
from identification.model.cell import Cell, read_cell
from identification.model.cell_file import ForceLogFile
from identification.model.cell_sizes import odd_sizes
from identification.model.quaternion_order import in_words, said_of_order

if TYPE_CHECKING:
    from compensator.forces.target_forces import TargetForces
    from compensator.path.robot_path import RobotPath

# The distance between TCP and edge for which `push` states what the turn that is not sent costs; here nothing is sent.
REACH_MM = 10.0


@dataclass(frozen=True)
class FileCheck:
    """One file: its kind ("" where it was not told), what is in it in a few words, what is to be said of it. refused: the
    reader's answer was no, not that the file is wrong."""

    file: Path
    kind: Kind | str
    found: str
    findings: tuple[Finding, ...] = ()
    refused: bool = False

    @property
    def verdict(self) -> str:
        """"ok", or the worst level among its findings."""
        levels = {finding.level for finding in self.findings}
        return next((level for level in ("error", "warning", "note") if level in levels), "ok")


@dataclass(frozen=True)
class Checked:
    """Every file that was looked at, the cell first. passed_over: files of folders whose suffix no command reads."""

    files: tuple[FileCheck, ...]
    passed_over: int = 0

    @property
    def findings(self) -> tuple[Finding, ...]:
        """Of all files."""
        return tuple(finding for file in self.files for finding in file.findings)

    @property
    def exit_code(self) -> int:
        """0 where no file has an error, 3 where every error is a refusal, else 1."""
        wrong = [file for file in self.files if file.verdict == "error"]
        return 0 if not wrong else 3 if all(file.refused for file in wrong) else 1

    def as_dict(self) -> dict[str, Any]:
        """JSON values."""
        return {"files": [{"file": str(one.file), "kind": one.kind, "verdict": one.verdict, "found": one.found,
                           "codes": sorted({finding.code for finding in one.findings})} for one in self.files],
                "passed_over": self.passed_over, "sound": self.exit_code == 0}

    def lines(self) -> list[str]:
        """A line a file."""
        wide = max(len(str(one.file)) for one in self.files)
        lines = [f"{one.verdict:<8} {one.file!s:<{wide}}  {one.kind}{': ' if one.kind and one.found else ''}{one.found}"
                 for one in self.files]
        wrong = sum(one.verdict == "error" for one in self.files)
        lines.append(f"{counted(len(self.files), 'file')}, {wrong} with errors" + (
            f"; {self.passed_over} of kinds that no command reads were passed over" if self.passed_over else ""))
        return lines


def check_files(cell_file: str | Path, files: Sequence[str | Path] = (), settings: Settings = DEFAULTS) -> Checked:
    """Reads the cell with its robot and every file, each as its kind, and says all that is wrong in one go.

    files: of any kind that a command reads, or folders of such. settings: how logs are read and toolpaths posted. A log and a
    program that share their stem (`part.mod`, `part.forces.csv`) are held against each other, too. Nothing is raised for what
    is wrong with a file: it is among the findings. Where the cell itself cannot be read, files that need it are not judged
    (CS0111).

    >>> checked = compstiff.check_files("cell.yaml", ["measurements.csv", "insert.mod", "stiffness.json"])
    >>> [(file.kind, file.verdict) for file in checked.files]
    [('cell', 'ok'), ('measurements', 'ok'), ('toolpath', 'ok'), ('stiffness', 'ok')]
    """
    named, passed_over = _files([Path(file) for file in files])
    cell: Cell | None = None

    def of_cell() -> tuple[str, tuple[Finding, ...]]:
        nonlocal cell
        cell = read_cell(cell_file)
        return _of_cell(cell)

    checks = [_attempt(Path(cell_file), "cell", of_cell)]
    checks += [_checked(file, cell, settings) for file in named if file.resolve() != Path(cell_file).resolve()]
    return Checked(tuple(_with_pairs(_without_plans(checks), cell, settings)), passed_over)


def _without_plans(checks: list[FileCheck]) -> list[FileCheck]:
    """That a sheet is not filled in is no news beside one that is: it is the plan of that."""
    filled = any(one.kind == "measurements" and one.verdict != "error" and not _blank(one) for one in checks)
    return [replace(one, findings=tuple(finding for finding in one.findings if finding.code != "CS0112"))
            if filled and _blank(one) else one for one in checks]


def _blank(check: FileCheck) -> bool:
    return any(finding.code == "CS0112" for finding in check.findings)


def _files(named: list[Path]) -> tuple[list[Path], int]:
    """The files, those of folders in their place, and how many of these were passed over."""
    found: dict[Path, None] = {}
    passed_over = 0
    for path in named:
        inside = sorted(item for item in path.iterdir() if item.is_file()) if path.is_dir() else [path]
        taken = [item for item in inside if not path.is_dir()
                 or (toolpath_suffix(item) in SUFFIXES and not item.name.startswith("."))]
        passed_over += len(inside) - len(taken)
        found |= dict.fromkeys(taken)
    return list(found), passed_over


def _attempt(file: Path, kind: Kind | str, read: Callable[[], tuple[str, tuple[Finding, ...]]]) -> FileCheck:
    """A file read: in words, with what was said of it; or why it could not be."""
    try:
        found, findings = read()
    except CompstiffError as stopped:
        return FileCheck(file, kind, "", stopped.findings, isinstance(stopped, Refused))
    except OSError as reason:
        unread = Finding("CS0005", "error", f"cannot be read: {reason.strerror}", file=str(file))
        return FileCheck(file, kind, "", (unread,))
    return FileCheck(file, kind, found, findings)


def _checked(file: Path, cell: Cell | None, settings: Settings) -> FileCheck:
    try:
        kind = kind_of(file, cell.force_log.form if cell else ForceLogFile(), settings.log.log_format)
    except CompstiffError as stopped:
        return FileCheck(file, "", "", stopped.findings)
    if kind == "robot":
        return _attempt(file, kind, lambda: _robot(file))
    if kind == "joint log":
        return _attempt(file, kind, lambda: _joint_log(file))
    if kind in ("record", "result"):
        return FileCheck(file, kind, {"record": "what a program was made from", "result": "what a command said"}[kind])
    if kind == "cell":
        return _attempt(file, kind, lambda: _of_cell(read_cell(file)))
    if cell is None:
        return FileCheck(file, kind, "", (Finding(
            "CS0111", "warning", f"not judged: a {kind} is read for a cell, and cell.yaml could not be read", file=str(file),
            hint="mend cell.yaml and check again"),))
    known = cell
    return _attempt(file, kind, lambda: READERS[kind](file, known, settings))


def _of_cell(cell: Cell) -> tuple[str, tuple[Finding, ...]]:
    proved = cell.pendant is not None and cell.pendant.turn is not None
    orders = (finding for name, frame in cell.frames.items() if not (proved and name == "tool.")
              for finding in said_of_order(f"{name}quaternion", frame.rotation, str(cell.source)))
    return _cell_in_words(cell), (*odd_sizes(cell), *orders)


def _cell_in_words(cell: Cell) -> str:
    """With every turn as degrees about an axis: a quaternion in another order is one of length one, too."""
    place = ", ".join(f"{1e3 * x:g}" for x in cell.flange_from_tcp.position)
    proof = "unproved: no pendant_poses" if cell.pendant is None else cell.pendant.words()
    turned = [f"{name.rstrip('._')} turned {words}" for name, frame in cell.frames.items()
              if (words := in_words(frame.rotation))]
    return "; ".join([f"{cell.robot.name}, TCP at [{place}] mm, {proof}", *turned,
                      f"forces in the frame {cell.force_log.kind}"])


def _robot(file: Path) -> tuple[str, tuple[Finding, ...]]:
    from identification.model.robot_check import check_robot

    check = check_robot(file)
    return check.name, check.findings


def _joint_log(file: Path) -> tuple[str, tuple[Finding, ...]]:
    from identification.motion.log_file import read_motion_log

    log = read_motion_log(file)
    return f"joints {', '.join(map(str, log.joints))}, {len(log.time)} samples at {log.rate:.4g} Hz", log.findings


def _measurements(file: Path, cell: Cell, settings: Settings) -> tuple[str, tuple[Finding, ...]]:
    """Rows with a deflection; a plan that is not filled in, or a blank sheet, is told apart from one that is wrong."""
    from identification.common.tables import read_table
    from identification.fit.load_test import LoadTest
    from identification.fit.mistakes.first_look import first_look
    from identification.measurements import read_measurements

    count = len(read_table(file, required=()))
    try:
        plan = read_measurements(file, cell, planned=True)
    except CompstiffError as stopped:
        if count or stopped.findings[0].code != "CS1005":
            raise
        plan = None
    if plan is None or np.isnan(plan.deflection).all():
        return f"{counted(count, 'row')}, none filled in", (*(plan.findings if plan else ()), Finding(
            "CS0112", "note", "no deflection is filled in yet" if plan else "no row is filled in yet", file=str(file),
            hint="measure, then write dx_um dy_um dz_um into every row, the zero readings too"))
    rows = read_measurements(file, cell)
    implausible = first_look(LoadTest.of(cell, rows))
    loaded, poses = int(np.any(rows.wrench != 0, axis=1).sum()), len(np.unique(rows.visit))
    kept_back = counted(int(rows.validate.sum()), "row")
    return f"{counted(count, 'row')}, {loaded} with a load, {counted(poses, 'pose')}, {kept_back} kept back", (
        *rows.findings, *((implausible,) if implausible else ()))


def _force_log(file: Path, cell: Cell, settings: Settings) -> tuple[str, tuple[Finding, ...]]:
    from compensator.forces.log import read_force_log

    log = read_force_log(file, cell.force_log.form, log_format=settings.log.log_format, spindle_rpm=settings.log.spindle_rpm)
    with np.errstate(over="ignore", invalid="ignore"):
        largest = float(np.linalg.norm(log.force, axis=1).max())
    return f"{counted(int(log.weight.sum()), 'sample')} placed by {log.key}, largest {largest:.3g} N", log.findings


def _stiffness(file: Path, cell: Cell, settings: Settings) -> tuple[str, tuple[Finding, ...]]:
    from identification.model.stiffness_file import read_stiffness

    model = read_stiffness(file, cell)
    words = "k [N m/rad] " + ", ".join(f"{k:.3g}" for k in model.stiffness)
    effects = ", ".join(term.label for term in model.effects)
    findings = said_of_tables(model.source, model.made_from)
    findings += () if not model.rejected else (Finding(
        "CS0113", "warning", f"its own measurements reject it ({model.rejected}): correct will refuse it", file=str(file),
        hint="compstiff diagnose says what else is at work, and writes the file that has it (--extended)"),)
    return words + (f"; {effects}" if effects else ""), findings


def _learned(file: Path, cell: Cell, settings: Settings) -> tuple[str, tuple[Finding, ...]]:
    from compensator.learned.learned_file import read_learned

    read_learned(file, cell)
    return "of this robot", ()


def _cutting(file: Path, cell: Cell, settings: Settings) -> tuple[str, tuple[Finding, ...]]:
    """Held against the cutter of cell.yaml, where that states one."""
    from compensator.cutting.coefficients import check_same, read_coefficients
    from compensator.cutting.cutter import cutter_of

    coefficients = read_coefficients(file)
    if cell.cutting.tool_diameter_mm and cell.cutting.teeth:
        check_same(coefficients, cutter_of(cell), cell.cutting.material, str(cell.source))
    of = f" in {coefficients.material.replace('_', ' ')}" if coefficients.material else ""
    doubt = () if not coefficients.rejected else (
        Finding("CS4752", "warning", coefficients.rejection, file=str(file),
                hint="predict and correct refuse them: fit them again"),)
    return f"{coefficients.cutter.words()}{of}, Ktc {1e-6 * coefficients.mean[0]:.0f} N/mm^2", doubt


def _stock(file: Path, cell: Cell, settings: Settings) -> tuple[str, tuple[Finding, ...]]:
    from compensator.cutting.stock_file import read_stock

    low, high = 1e3 * read_stock(file).bounds
    return "; ".join(f"{name} {a:g} to {b:g}" for name, a, b in zip("xyz", low, high, strict=True)) + " mm", ()


def _diagnosis(file: Path, cell: Cell, settings: Settings) -> tuple[str, tuple[Finding, ...]]:
    import json

    from identification.design.discrimination import read_diagnosis

    verdict = json.loads(file.read_bytes()).get("verdict")
    if verdict is None:
        return "of a plan", ()
    read_diagnosis(file, cell, for_loads=False)
    return f"verdict {verdict}", ()


def _offsets(file: Path, cell: Cell, settings: Settings) -> tuple[str, tuple[Finding, ...]]:
    from compensator.modbus.offset_file import read_offsets

    offsets = read_offsets(file, REACH_MM)
    largest = float(np.abs(offsets.offset).max(initial=0.0))
    rows = counted(len(offsets.offset), "row")
    return f"{rows} from target {offsets.first}, largest component {1e3 * largest:.3g} mm", offsets.findings


def _measured_part(file: Path, cell: Cell, settings: Settings) -> tuple[str, tuple[Finding, ...]]:
    """As `verify` reads it, or, with the columns that only `learn` has, as that does."""
    from compensator.learning.measured_points import read_points
    from compensator.verification.readings import read_readings
    from compstiff.file_kinds import columns_of

    if {"std_um", "d_um"} & set(columns_of(file)):
        points = read_points(file, cell)
        return counted(len(points), "point"), points.findings
    readings = read_readings(file, cell)
    return counted(len(readings), "row"), readings.findings


Reader = Callable[[Path, Cell, Settings], tuple[str, tuple[Finding, ...]]]
READERS: dict[str, Reader] = {
    "measurements": _measurements, "toolpath": program_check, "force log": _force_log, "stiffness": _stiffness,
    "learned": _learned, "diagnosis": _diagnosis, "offsets": _offsets, "measured part": _measured_part,
    "cutting": _cutting, "stock": _stock,
}


def _with_pairs(checks: list[FileCheck], cell: Cell | None, settings: Settings) -> list[FileCheck]:
    """Each log beside a program of its stem, held against that program: what is wrong between the two is said of the log, and
    what `correct` refuses of the moves with force is said of the program."""
    if cell is None:
        return checks
    programs = {toolpath_stem(one.file): one for one in checks if one.kind == "toolpath" and one.verdict != "error"}
    result: list[FileCheck] = []
    forces: dict[Path, tuple[RobotPath, TargetForces]] = {}

    def held(log_file: Path, program: Path) -> tuple[str, tuple[Finding, ...]]:
        placed = _placed(log_file, program, cell, settings)
        if placed is None:
            return "", ()
        forces[program] = placed
        return "", placed[1].findings

    for one in checks:
        stem = re.split(r"(?i)\.forces\.", one.file.name)[0]
        program = programs.get(stem) or programs.get(stem.lower())
        if one.kind == "force log" and one.verdict != "error" and program is not None:
            paired = _attempt(one.file, one.kind, partial(held, one.file, program.file))
            more = tuple(finding for finding in paired.findings if finding.level != "note" and finding not in one.findings)
            found = f"{one.found}; of {program.file.name}" if paired.verdict != "error" else one.found
            one = replace(one, found=found, findings=(*one.findings, *more), refused=paired.refused)
        result.append(one)
    return [_under_forces(one, *forces[one.file]) if one.file in forces else one for one in result]


def _under_forces(check: FileCheck, path: RobotPath, forces: TargetForces) -> FileCheck:
    """A program with what `correct` refuses of its moves with force, in place of what was said of all that may cut."""
    from compensator.correction.correctable import OF_PLACES, targets_to_correct

    others = tuple(finding for finding in check.findings if finding.code not in OF_PLACES)
    try:
        targets_to_correct(path, forces)
    except CompstiffError as stopped:
        return replace(check, findings=(*others, *stopped.findings), refused=isinstance(stopped, Refused))
    return replace(check, findings=others)


def _placed(log_file: Path, program: Path, cell: Cell, settings: Settings) -> tuple[RobotPath, TargetForces] | None:
    """A log on its program; None where it lies on that and the modules which it names."""
    from compensator.forces.log import read_force_log
    from compensator.forces.placement import place_forces
    from compensator.path.robot_path import robot_path
    from compensator.posting.read_toolpath import read_toolpath

    log = read_force_log(log_file, cell.force_log.form, log_format=settings.log.log_format,
                         spindle_rpm=settings.log.spindle_rpm)
    toolpath = read_toolpath(program, cell, settings.posting).toolpath
    if toolpath.others.targets:
        return None
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        path = robot_path(toolpath, cell)
        return path, place_forces(log, path, cell, tare=settings.log.tare, trust_tare=settings.log.trust_tare)

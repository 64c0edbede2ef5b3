"""The files a new cell begins with: cell.yaml, a sheet for the measurements, the chain for make and PowerShell."""

from __future__ import annotations

import math
import shlex
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import jinja2

from compstiff.outcome import call
from identification.common.columns import DEFLECTIONS, FORCES, JOINTS, MASS
from identification.common.files import check_writable, write_whole
from identification.common.findings import CompstiffError, Finding, error
from identification.model.cell import Cell, read_cell
from identification.model.cell_file import FrameKind
from identification.model.cell_sizes import odd_sizes
from identification.model.controller import RAPID_MAKERS
from identification.model.quaternion_order import said_of_order
from identification.model.robot import built_in_robots

TEMPLATES = Path(__file__).parent / "templates"
Triple = Sequence[float]
# A lever about axis 6 by which no load test tells k6: 300 N move the tool by about a tenth of a micrometre.
ON_AXIS_6_MM = 5.0


@dataclass(frozen=True)
class CellAnswers:
    """What is asked of a new cell. Millimetres, kilograms, micrometres (1 sigma), as in cell.yaml; None: not known yet.

    robot: a built-in name, or the path of a robot file, which is copied into the folder. weights: of a load test by hung
    weights, as `design --dead-weight` takes them; "": the loads come from a cylinder or a jack. serial_number: of the robot,
    "": not known. material: that is milled; contact: how long the edge is in the cut, along the tool's axis.

    >>> compstiff.CellAnswers("irb6660-205-1.90", (120, 0, 250)).force_frame
    'base'
    """

    robot: str
    tool_tcp: Triple
    tool_quaternion: Triple = (1.0, 0.0, 0.0, 0.0)
    tool_mass: float | None = None
    tool_centre: Triple | None = None
    serial_number: str = ""
    deflection_std: float = 2.0
    weights: str = ""
    force_frame: FrameKind = "base"
    sensor_position: Triple | None = None
    sensor_quaternion: Triple | None = None
    force_sign: str = "on_tool"
    spindle_rpm: float | None = None
    material: str | None = None
    cutter_diameter: float | None = None
    contact: float | None = None


@dataclass(frozen=True)
class NewCell:
    """The files of a new cell and what to do next. rapid: whether the robot's controller runs the programs `correct` writes."""

    folder: Path
    files: tuple[Path, ...]
    robot: str
    rapid: bool
    findings: tuple[Finding, ...]
    steps: tuple[str, ...]

    def as_dict(self) -> dict[str, Any]:
        """JSON values."""
        return {"folder": str(self.folder), "files": [path.name for path in self.files], "robot": self.robot,
                "rapid": self.rapid, "next_steps": list(self.steps)}

    def lines(self) -> list[str]:
        """What was written, and the next steps."""
        return [f"written in {self.folder}: {', '.join(path.name for path in self.files)}", "", "next steps:",
                *(f"{number}. {step}" for number, step in enumerate(self.steps, 1))]


def new_cell(folder: str | Path, answers: CellAnswers, *, overwrite: bool = False) -> NewCell:
    """Writes the files of a new cell, all or none; the folder is made. What is written was read back as `identify` reads it.

    Raises CompstiffError: CS0003 a file is there already (and not `overwrite`), CS0104 unknown robot, CS0100 an answer that
    cell.yaml cannot hold, and what reading the robot file raises.

    >>> made = compstiff.new_cell("cell_7", compstiff.CellAnswers("irb6660-205-1.90", (120, 0, 250), tool_mass=80))
    >>> [file.name for file in made.files]
    ['cell.yaml', 'measurements.csv', 'Makefile', 'chain.ps1']
    """
    folder = Path(folder)
    robot_file = _robot_file(answers.robot)
    named = robot_file.name if robot_file else answers.robot
    values = {name: getattr(answers, name) for name in CellAnswers.__dataclass_fields__} | {
        "robot": named, "joints": JOINTS, "loads": (MASS,) if answers.weights else FORCES, "deflections": DEFLECTIONS}
    contents = {folder / "cell.yaml": _rendered("cell.yaml", **values)}
    if robot_file:
        contents[folder / named] = robot_file.read_bytes()
    maker, robot, odd = _accepted(contents, folder)
    rapid = maker.strip().upper() in RAPID_MAKERS
    values["rapid"] = rapid
    for name in ("measurements.csv", "Makefile", "chain.ps1"):
        contents[folder / name] = _rendered(name, **values)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        check_writable(contents, overwrite=overwrite)
        (folder / "programs").mkdir(exist_ok=True)
    except OSError as reason:
        raise error("CS0004", f"cannot be made: {reason.strerror}", file=str(folder)) from reason
    write_whole(contents, overwrite=overwrite)
    return NewCell(folder, tuple(contents), robot, rapid, (*odd, *_left_open(answers, folder, rapid, robot)),
                   tuple(_steps(folder, rapid, answers.weights)))


def _robot_file(robot: str) -> Path | None:
    """The robot file that is named by its path; None for a built-in robot. Raises CompstiffError (CS0104)."""
    if robot in built_in_robots():
        return None
    path = Path(robot)
    if not path.is_file():
        import difflib

        near = difflib.get_close_matches(robot.lower(), built_in_robots(), n=3, cutoff=0.3)
        raise error("CS0104", f"unknown robot '{robot}', and no such file",
                    hint=(f"near it: {', '.join(near)}; " if near else "") + "compstiff robots lists the built-in ones; how to "
                    "write a robot file: docs/robots.md of the project")
    if path.name == "cell.yaml":
        raise error("CS0104", "is to be copied beside the new cell.yaml, and has its name", file=robot,
                    hint="rename the robot file")
    return path


def _rendered(name: str, **values: Any) -> bytes:
    environment = jinja2.Environment(loader=jinja2.FileSystemLoader(TEMPLATES), keep_trailing_newline=True, trim_blocks=True,
                                     undefined=jinja2.StrictUndefined)
    environment.filters["numbers"] = lambda row: ", ".join(f"{value:.12g}" for value in row)
    return environment.get_template(f"{name}.j2").render(**values).encode()


def _accepted(contents: dict[Path, bytes], folder: Path) -> tuple[str, str, list[Finding]]:
    """Maker and name of the robot, and what is odd about the cell. Raises CompstiffError (CS0100) where it would not be
    read."""
    with tempfile.TemporaryDirectory() as place:
        for path, content in contents.items():
            (Path(place) / path.name).write_bytes(content)
        try:
            cell = read_cell(Path(place) / "cell.yaml")
            odd = [_of_answers(one, folder) for one in (*odd_sizes(cell), *_orders(cell))]
        except CompstiffError as stopped:
            raise CompstiffError(*(_of_answers(finding, folder) for finding in stopped.findings)) from stopped
    return cell.robot.manufacturer, cell.robot.name, odd


def _orders(cell: Cell) -> list[Finding]:
    """Quaternions that look like x y z w."""
    return [finding for name, frame in cell.frames.items()
            for finding in said_of_order(f"{name}quaternion", frame.rotation, str(cell.source))]


def _of_answers(finding: Finding, folder: Path) -> Finding:
    """A complaint of the cell's reader, about the file as it would have been."""
    code = "CS0100" if finding.code == "CS0102" else finding.code
    return replace(finding, code=code, line=None, column=None, file=str(folder / Path(finding.file or "cell.yaml").name))


def _left_open(answers: CellAnswers, folder: Path, rapid: bool, robot: str) -> list[Finding]:
    """What a later command will ask for, or cannot do."""
    cell = str(folder / "cell.yaml")
    found = []
    if answers.force_frame != "base" and answers.tool_mass is None:
        found.append(Finding("CS0103", "note", f"logs in the frame {answers.force_frame} hold the weight of what hangs on the "
                             "sensor, and its mass is not stated", file=cell, hint="compstiff tare finds mass, centre and bias "
                             "from readings taken still; or state force_log.weight: removed"))
    beside = math.hypot(*answers.tool_tcp[:2])
    if beside <= ON_AXIS_6_MM:
        where, turns = (f"{beside:.2g} mm from", "pure forces hardly turn") if beside else ("on", "no pure force turns")
        found.append(Finding("CS0106", "warning", f"the TCP stands {where} axis 6: {turns} that joint, and k6 cannot be seen",
                             file=cell, hint="for the load tests take a point beside axis 6, such as a bar on the "
                             "flange, in a cell file of its own"))
    if not rapid:
        found.append(Finding("CS0107", "note", f"{robot} does not run RAPID: the chain has no corrected program",
                             file=cell, hint="identify, diagnose and predict (of APT files and tables) work: docs/robots.md of "
                             "the project"))
    return found


def _steps(folder: Path, rapid: bool, weights: str) -> list[str]:
    """The chain, as calls to copy."""
    cell, sheet, extended = folder / "cell.yaml", folder / "measurements.csv", folder / "stiffness_extended.json"
    load = ("--dead-weight", weights) if weights else ()
    program = ("--rapid", folder / "plan.mod") if rapid else ()
    steps = [
        f"read {cell} once and put in what was left open, then: {call('check', cell)}",
        f"plan the load tests: {call('design', cell, *load, '-o', folder / 'plan.csv', *program)}",
        f"measure; save the plan with its deflections as {sheet}, or write your own poses there",
        call("identify", cell, sheet, "-o", folder / "stiffness.json", "--report", folder / "identify.html"),
        call("diagnose", cell, sheet, "-o", folder / "diagnosis.json", "--extended", extended),
    ]
    if rapid:
        corrected = call("correct", cell, folder / "programs", "--stiffness", extended, "-o", f"{folder / 'corrected'}/")
        steps.append(f"mill once; put part.mod and its log part.forces.csv into {folder / 'programs'}, then: {corrected}")
    make = shlex.join(["make", "-C", str(folder)])
    return [*steps, f"or let make do each step: {make} lists them (on Windows {folder / 'chain.ps1'})"]

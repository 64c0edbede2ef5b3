"""The main job on one program: read, place the forces, predict, correct, write, and read back what was written."""

from __future__ import annotations

import json
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from compensator.correction import Correction, Prediction, correct_path, predict_path, targets_to_correct
from compensator.feasibility import FeedCheck, check_feed
from compensator.feasibility import figures as feed_figures
from compensator.forces import TargetForces, place_forces, read_force_log
from compensator.loading import loaded_path, segment_times
from compensator.planning import Plan, plan_path
from compensator.rapid import RapidProgram, read_rapid, rewrite
from compensator.route import Poses
from compensator.settings import DEFAULTS, Settings
from identification.cell import Cell, read_cell
from identification.files import sha256
from identification.findings import CompstiffError, Finding, Refused, error, fold
from identification.model.inverse import inverse, nearest_solution
from identification.model.rotations import Frame
from identification.model.stiffness import IdentifiedModel
from identification.model.stiffness_file import read_stiffness

Array = NDArray[np.float64]
RECORD = "compstiff-correction"
RAPID_SUFFIXES = (".mod", ".modx", ".prg", ".sys")
# Half a unit of the last written decimal, in each coordinate [m], and what 8 decimals of a quaternion leave [rad].
WRITTEN_POSITION = 1e-7
WRITTEN_ROTATION = 1e-7


@dataclass(frozen=True)
class Inputs:
    """The files of one job."""

    cell: Path
    toolpath: Path
    stiffness: Path
    forces: Path


@dataclass(frozen=True, eq=False)
class Predicted:
    """One program with the deviation predicted for its targets with force."""

    inputs: Inputs
    settings: Settings
    cell: Cell
    model: IdentifiedModel
    program: RapidProgram
    plan: Plan
    forces: TargetForces
    prediction: Prediction
    findings: tuple[Finding, ...]


@dataclass(frozen=True, eq=False)
class Corrected:
    """One program, corrected. content: the bytes to write. residual (M,) [m]: distance of the loaded tool from the plan
    with the numbers as written; feed: the feed check, None where it was not asked for."""

    predicted: Predicted
    correction: Correction
    content: bytes
    residual: Array
    feed: FeedCheck | None
    findings: tuple[Finding, ...]


def read_toolpath(path: Path) -> RapidProgram:
    """Reads a toolpath by its suffix. Raises CompstiffError (CS4201) for formats that are not read."""
    if path.suffix.lower() not in RAPID_SUFFIXES:
        raise error("CS4201", f"toolpath format '{path.suffix}' is not read, expected one of {', '.join(RAPID_SUFFIXES)}",
                    file=str(path), hint="post the toolpath as RAPID; APT and CSV are not supported yet")
    try:
        return read_rapid(path.read_bytes(), str(path))
    except OSError as reason:
        raise error("CS0005", f"cannot be read: {reason.strerror}", file=str(path)) from reason


def predict_program(inputs: Inputs, settings: Settings = DEFAULTS) -> Predicted:
    """Deviation of every target with force. Raises what the readers, `place_forces` and `targets_to_correct` raise."""
    cell = read_cell(inputs.cell)
    model = read_stiffness(inputs.stiffness, cell)
    program = read_toolpath(inputs.toolpath)
    log = read_force_log(inputs.forces)
    if not len(program.toolpath):
        raise error("CS4202", "the program has no move, so its force log belongs to no target", file=str(inputs.toolpath),
                    hint="name the module that holds the moves")
    said: tuple[Finding, ...] = (*program.toolpath.findings, *log.findings)
    try:
        # Absurd numbers overflow on their way to a refusal; the refusal says so, NumPy need not.
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            plan = plan_path(program.toolpath, cell)
            forces = place_forces(log, plan, cell, tare=settings.tare)
            said = (*program.toolpath.findings, *(plan.findings if forces.forced.any() else ()), *forces.findings)
            targets, left = targets_to_correct(plan, forces)
            prediction = predict_path(plan, forces, model, targets)
    except CompstiffError as stopped:
        # What was noticed before may be the reason: a work object taken from cell.yaml, a guessed configuration.
        raise type(stopped)(*stopped.findings, *said) from stopped
    return Predicted(inputs, settings, cell, model, program, plan, forces, prediction, (*said, *left, *prediction.findings))


def correct_program(predicted: Predicted) -> Corrected:
    """The corrected program. Raises what `correct_path` and, if asked for, `check_feed` raise, and CS4203 where the written
    text does not read back."""
    targets = predicted.prediction.targets
    correction = correct_path(predicted.plan, predicted.forces, predicted.model, targets)
    written = rewrite(predicted.program, targets, correction.object_from_tcp.position,
                      correction.object_from_tcp.quaternion, correction.confdata)
    residual, poses = _read_back(predicted, correction, written.content)
    settings = predicted.settings
    feed = None
    if settings.check_feed or settings.strict_feed:
        feed = check_feed(predicted.plan, predicted.forces, poses, strict=settings.strict_feed)
    findings = (*predicted.findings, *correction.findings, *written.findings, *(feed.findings if feed else ()))
    return Corrected(predicted, correction, written.content, residual, feed, findings)


def _read_back(predicted: Predicted, correction: Correction, content: bytes) -> tuple[Array, Poses]:
    """Reads the written program again: every corrected number there, every other target as it was. Returns the residual
    (M,) [m] of the loaded tool with the numbers as written, and the poses (N) they command."""
    before, targets = predicted.program.toolpath, correction.targets
    after = read_rapid(content, before.source).toolpath
    intact = len(after) == len(before)
    if intact:
        others = np.ones(len(before), dtype=bool)
        others[targets] = False
        intact = all(np.array_equal(getattr(after, name)[others], getattr(before, name)[others], equal_nan=True)
                     for name in ("position", "quaternion", "confdata", "external", "joints"))
        intact &= bool(np.array_equal(after.move, before.move) and np.array_equal(after.feed, before.feed, equal_nan=True))
        written, wanted = after.position[targets], correction.object_from_tcp
        alike = np.abs(np.einsum("ni,ni->n", after.quaternion[targets], wanted.quaternion))
        intact &= bool(np.all(np.abs(written - wanted.position) <= WRITTEN_POSITION)
                       and np.all(alike > 1 - WRITTEN_ROTATION**2 - 1e-15))
    if not intact:
        raise error("CS4203", "the corrected program does not read back as it was meant; nothing was written",
                    file=before.source, hint="a defect in compstiff: please report it with this program")
    plan = predicted.plan
    object_from_tcp = Frame.from_quaternion(after.position[targets], after.quaternion[targets])
    base_from_object = Frame(plan.base_from_object.rotation[targets], plan.base_from_object.position[targets])
    flange_from_tcp = Frame(plan.flange_from_tcp.rotation[targets], plan.flange_from_tcp.position[targets])
    base_from_tcp = base_from_object @ object_from_tcp
    base_from_flange = base_from_tcp @ flange_from_tcp.inverse()
    theta, _ = nearest_solution(predicted.cell.robot, inverse(predicted.cell.robot, base_from_flange, correction.theta),
                                correction.theta)
    loaded = loaded_path(plan, predicted.forces, predicted.model, targets, theta)
    commanded, joints = Frame(plan.base_from_tcp.rotation.copy(), plan.base_from_tcp.position.copy()), plan.theta.copy()
    commanded.rotation[targets], commanded.position[targets] = base_from_tcp.rotation, base_from_tcp.position
    joints[targets] = theta
    return np.asarray(np.linalg.norm(loaded.position - plan.base_from_tcp.position[targets], axis=1)), Poses(commanded, joints)


def check_not_corrected(toolpath: Path) -> None:
    """Refused (CS4204) where a record in the toolpath's folder names this file, or its content, as an output."""
    digest = sha256(toolpath)
    for path in sorted(toolpath.parent.glob("*.json")):
        names = _recorded(path)
        if names is None:
            continue
        (source, source_digest), (output, output_digest) = names
        # A record of a program that came out as it went in forbids nothing.
        if source_digest != output_digest and (output_digest == digest or output == toolpath.name):
            raise Refused(Finding("CS4204", "error", f"is the output of an earlier correction (record {path.name}); nothing is "
                                  "corrected twice", file=str(toolpath),
                                  hint=f"correct the CAM system's program {source}; --force if this really is one"))


def _recorded(path: Path) -> tuple[tuple[str, str], tuple[str, str]] | None:
    """Name and SHA-256 of input and output of a correction record; None where the file is no such record."""
    try:
        if path.stat().st_size > 64 << 20:
            return None
        record = json.loads(path.read_bytes())
    except (OSError, ValueError, RecursionError):
        return None
    if not isinstance(record, dict) or record.get("format") != RECORD:
        return None
    source, output = record.get("input"), record.get("output")
    if not (isinstance(source, dict) and isinstance(output, dict)):
        return None
    return (str(source.get("file", "")), str(source.get("sha256", ""))), (str(output.get("file", "")),
                                                                          str(output.get("sha256", "")))


def planned_time(predicted: Predicted) -> Array:
    """Time (N,) [s] at which each target is reached with the programmed feed; NaN from the first unknown feed on."""
    with np.errstate(over="ignore", invalid="ignore"):
        return np.asarray(np.cumsum(segment_times(predicted.plan)))


def summary(predicted: Predicted, corrected: Corrected | None = None) -> dict[str, Any]:
    """The figures of one job, JSON values."""
    size = np.linalg.norm(predicted.prediction.position, axis=1)
    std = np.sqrt(np.trace(predicted.prediction.covariance, axis1=1, axis2=2))
    figures: dict[str, Any] = {
        "targets": len(predicted.plan.toolpath),
        "with_force": int(predicted.forces.forced.sum()),
        "without_sample": int((predicted.forces.samples == 0).sum()),
        "predicted": len(size),
        "deviation_um": _figures(1e6 * size),
        "deviation_std_um": _figures(1e6 * std),
    }
    if corrected is not None:
        figures |= {
            "corrected": len(size),
            "offset_mm": _figures(1e3 * np.linalg.norm(corrected.correction.offset, axis=1)),
            "turn_deg": _figures(np.degrees(np.linalg.norm(corrected.correction.turn, axis=1))),
            "residual_um": _figures(1e6 * corrected.residual),
            "feed_check": feed_figures(corrected.feed) if corrected.feed else None,
        }
    return figures


def _figures(values: Array) -> dict[str, float]:
    if not len(values):
        return {"largest": 0.0, "rms": 0.0}
    return {"largest": float(values.max()), "rms": float(np.sqrt(np.mean(values**2)))}


def record(corrected: Corrected, output: Path) -> dict[str, Any]:
    """OUT.mod.json: what was made from what (FORMATS.md, correct)."""
    import hashlib

    inputs = corrected.predicted.inputs
    return {
        "format": RECORD, "version": 1, "compstiff": version("compstiff"), "numpy": np.__version__,
        "input": {"file": inputs.toolpath.name, "sha256": sha256(inputs.toolpath)},
        "output": {"file": output.name, "sha256": hashlib.sha256(corrected.content).hexdigest()},
        **{name: {"file": path.name, "sha256": sha256(path)} for name, path in (
            ("stiffness", inputs.stiffness), ("cell", inputs.cell), ("forces", inputs.forces))},
        "robot": {"name": corrected.predicted.cell.robot.name, "sha256": corrected.predicted.cell.robot.sha256},
        "summary": summary(corrected.predicted, corrected),
        "findings": [finding.as_dict() | {"file": Path(finding.file).name if finding.file else None}
                     for finding in fold(corrected.findings)],
    }


def check_distinct(inputs: Inputs, outputs: list[Path]) -> None:
    """Raises CompstiffError (CS0006) where an output is one of the inputs, or two outputs are one file."""
    seen = {path.resolve(): "input" for path in (inputs.cell, inputs.toolpath, inputs.stiffness, inputs.forces)}
    for path in outputs:
        if path.resolve() in seen:
            raise CompstiffError(Finding("CS0006", "error", f"would overwrite an {seen[path.resolve()]} of this command",
                                         file=str(path), hint="give the output another name"))
        seen[path.resolve()] = "output"

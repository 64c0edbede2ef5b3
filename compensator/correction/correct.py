"""The main job on one program: read, place the forces, predict, correct, write, and read back what was written."""

from __future__ import annotations

import json
from dataclasses import dataclass, replace
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from compensator.correction.corners import corners, with_tighter_zones
from compensator.correction.correct import Correction, Restraint, correct_path, targets_to_correct
from compensator.correction.engagement import engaged, left_as_logged, read_offsets, two_passes
from compensator.correction.forward import loaded_path, segment_times
from compensator.correction.intermediate_targets import densified
from compensator.correction.posture import Advice, advise
from compensator.correction.prediction import Prediction, predict_path
from compensator.correction.settings import DEFAULTS, EXACTLY_ONE, SLOPE, Estimate, Settings
from compensator.forces.log_path import on_path
from compensator.forces.placement import ForceLog, TargetForces, place_forces, read_force_log
from compensator.path.arc_length import borders
from compensator.path.feasibility import FeedCheck, check_feed
from compensator.path.feasibility import figures as feed_figures
from compensator.path.robot_path import RobotPath, robot_path
from compensator.path.route import Poses
from compensator.posting.post import APT_SUFFIXES, TABLE_SUFFIXES, post, read_cam_path
from compensator.rapid import RapidProgram, read_rapid, rewrite
from identification.common.files import sha256
from identification.common.findings import CompstiffError, Finding, Refused, error, fold
from identification.model.cell import Cell, read_cell
from identification.model.inverse import nearest_angles
from identification.model.rotations import Frame
from identification.model.stiffness import IdentifiedModel
from identification.model.stiffness_file import read_stiffness

Array = NDArray[np.float64]
Indices = NDArray[np.intp]
RECORD = "compstiff-correction"
RAPID_SUFFIXES = (".mod", ".modx", ".prg", ".sys")
# What is taken for a toolpath in a folder; a table is one only where it is named.
TOOLPATH_SUFFIXES = (*RAPID_SUFFIXES, *APT_SUFFIXES)
# Half a unit of the last written decimal, in each coordinate [m], and what 8 decimals of a quaternion leave [rad].
WRITTEN_POSITION = 1e-7
WRITTEN_ROTATION = 1e-7
# What is left for this cutting stiffness [N/m] is told where none is known.
ASSUMED_CUTTING = 1e4


@dataclass(frozen=True)
class Inputs:
    """The files of one job."""

    cell: Path
    toolpath: Path
    stiffness: Path
    forces: Path


@dataclass(frozen=True, eq=False)
class Predicted:
    """One program with the deviation predicted for its targets with force.

    model: scaled as the settings say. log: as read. rapid (N,): known to be reached in the air.
    """

    inputs: Inputs
    settings: Settings
    cell: Cell
    model: IdentifiedModel
    program: RapidProgram
    path: RobotPath
    log: ForceLog
    forces: TargetForces
    prediction: Prediction
    findings: tuple[Finding, ...]
    rapid: NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Corrected:
    """One program, corrected. planned: the program as it was given; predicted: with the intermediate targets that were added to
    it, kept (N,) the places of the given targets among them. content: the bytes to write. residual (M,) [m]: distance of the
    loaded tool from the plan with the numbers as written. cutting (M,) [m]: how far off a cutting stiffness of 10 N/mm
    leaves the tool, None where the force was made to follow the cut. advice: on the posture, and feed: the feed check, where
    they were asked for.
    """

    planned: Predicted
    predicted: Predicted
    kept: Indices
    correction: Correction
    content: bytes
    residual: Array
    findings: tuple[Finding, ...]
    cutting: Array | None = None
    advice: Advice | None = None
    feed: FeedCheck | None = None


def read_toolpath(
    path: Path, cell: Cell, settings: Settings = DEFAULTS
) -> tuple[RapidProgram, NDArray[np.bool_]]:
    """Reads a toolpath by its suffix; APT and CSV are posted first (compensator/posting.py). Also returns which targets (N,)
    are known to be reached in the air. Raises CompstiffError: CS4201 for formats that are not read, and what the readers and
    `post` raise."""
    suffix = path.suffix.lower()
    if suffix in (*APT_SUFFIXES, *TABLE_SUFFIXES):
        posted = post(read_cam_path(path, settings.posting), cell, settings.posting, f"{path} (posted)")
        return posted.program, posted.rapid
    if suffix not in RAPID_SUFFIXES:
        raise error("CS4201", f"toolpath format '{path.suffix}' is not read, expected one of "
                    f"{', '.join((*RAPID_SUFFIXES, *APT_SUFFIXES, *TABLE_SUFFIXES))}",
                    file=str(path), hint="write the toolpath as RAPID, as an APT cutter location file, or as a table")
    try:
        program = read_rapid(path.read_bytes(), str(path))
    except OSError as reason:
        raise error("CS0005", f"cannot be read: {reason.strerror}", file=str(path)) from reason
    return program, np.zeros(len(program.toolpath), dtype=bool)


def predict_program(inputs: Inputs, settings: Settings = DEFAULTS) -> Predicted:
    """Deviation of every target with force. Raises what the readers, `place_forces` and `targets_to_correct` raise."""
    cell = read_cell(inputs.cell)
    model = read_stiffness(inputs.stiffness, cell)
    if settings.correction.scale != EXACTLY_ONE:
        model = model.scaled(*settings.correction.scale)
    program, rapid = read_toolpath(inputs.toolpath, cell, settings)
    if not len(program.toolpath):
        raise error("CS4202", "the program has no move, so its force log belongs to no target", file=str(inputs.toolpath),
                    hint="name the module that holds the moves")
    # Absurd numbers overflow on their way to a refusal; the refusal says so, NumPy need not.
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        path = robot_path(program.toolpath, cell)
        return _predicted(inputs, settings, cell, model, program, path, rapid)


def _predicted(
    inputs: Inputs, settings: Settings, cell: Cell, model: IdentifiedModel, program: RapidProgram, path: RobotPath,
    rapid: NDArray[np.bool_],
) -> Predicted:
    """The program with the forces of one log."""
    source = program.toolpath
    said: tuple[Finding, ...] = source.findings
    try:
        log = read_force_log(inputs.forces, cell.force_log.form, log_format=settings.log.log_format,
                             spindle_rpm=settings.log.spindle_rpm, borders=borders(path.world_position, path.toolpath.move))
        said = (*said, *log.findings)
        log = on_path(log, path)
        forces = place_forces(log, path, cell, tare=settings.log.tare)
        said = (*source.findings, *(path.findings if forces.forced.any() else ()), *forces.findings)
        targets, left = targets_to_correct(path, forces)
        prediction = predict_path(path, forces, model, targets)
    except CompstiffError as stopped:
        # What was noticed before may be the reason: a work object taken from cell.yaml, a guessed configuration.
        raise type(stopped)(*stopped.findings, *said) from stopped
    return Predicted(inputs, settings, cell, model, program, path, log, forces, prediction,
                     (*said, *left, *prediction.findings), rapid)


def correct_program(planned: Predicted) -> Corrected:
    """The corrected program. Raises what `correct_path` and, if asked for, `check_feed` raise, and CS4203 where the written
    text does not read back."""
    settings = planned.settings
    offsets = read_offsets(settings.correction.logged_with, planned.path) if settings.correction.logged_with else None
    stiffness, told = _cutting_stiffness(planned, offsets)
    given = planned
    planned, cut_off = _cornered(planned)
    predicted, kept = _densified(planned)
    told = (*told, *cut_off)
    forces, prediction, targets = predicted.forces, predicted.prediction, predicted.prediction.targets
    cutting = None
    if offsets is not None:
        offsets = np.column_stack([np.interp(np.arange(len(predicted.path.toolpath)), kept, axis) for axis in offsets.T])
    if stiffness is not None:
        forces, more = engaged(predicted.path, forces, prediction, stiffness, offsets)
        prediction = predict_path(predicted.path, forces, predicted.model, targets)
        told = (*told, *more)
    else:
        with np.errstate(over="ignore", invalid="ignore"):      # absurd numbers in targets without force
            cutting = left_as_logged(predicted.path, forces, prediction, ASSUMED_CUTTING, offsets)
    slope = settings.correction.slope or (np.inf if forces.named else SLOPE)
    restraint = Restraint(prediction, settings.correction.confidence, slope)
    correction = correct_path(predicted.path, forces, predicted.model, targets, restraint)
    written = rewrite(predicted.program, targets, correction.object_from_tcp.position,
                      correction.object_from_tcp.quaternion, correction.confdata)
    residual, poses = _read_back(predicted, forces, correction, written.content)
    feed = None
    if settings.feed.check_feed or settings.feed.strict_feed:
        feed = check_feed(given.path, given.forces.forced, (predicted.path, forces.forced, poses),
                          strict=settings.feed.strict_feed)
    findings = (*predicted.findings, *told, *correction.findings, *written.findings, *(feed.findings if feed else ()))
    advice = advise(given.path, given.forces, given.model, given.prediction.targets) if settings.correction.advise else None
    return Corrected(given, predicted, kept, correction, written.content, residual, findings, cutting, advice, feed)


def _cornered(planned: Predicted) -> tuple[Predicted, list[Finding]]:
    """The program with smaller zones where they were asked for, and what zones cut off the corners."""
    settings, targets = planned.settings, planned.prediction.targets
    told: list[Finding] = []
    if settings.correction.tighten_zones:
        content, told = with_tighter_zones(planned.program, planned.path, targets, settings.correction.tolerance)
        program = read_rapid(content, planned.program.source.name)
        planned = replace(planned, program=program, path=replace(planned.path, toolpath=program.toolpath))
    return planned, [*told, *corners(planned.path, targets, settings.correction.tolerance,
                                     tightened=settings.correction.tighten_zones)]


def _densified(planned: Predicted) -> tuple[Predicted, Indices]:
    """The program with the intermediate targets it needs, and where the given targets stand in it."""
    same = np.arange(len(planned.path.toolpath))
    if planned.settings.correction.keep_targets or not len(planned.prediction.targets):
        return planned, same
    with np.errstate(over="ignore", invalid="ignore"):      # absurd numbers in targets without force
        dense = densified(planned.program, planned.path, planned.log, planned.forces, planned.model, planned.settings)
        if dense is None:
            return planned, same
    targets, _ = targets_to_correct(dense.path, dense.forces)
    prediction = predict_path(dense.path, dense.forces, planned.model, targets)
    rapid = np.zeros(len(dense.path.toolpath), dtype=bool)
    rapid[dense.kept] = planned.rapid
    return replace(planned, program=dense.program, path=dense.path, forces=dense.forces, prediction=prediction, rapid=rapid,
                   findings=(*planned.findings, *dense.findings)), dense.kept


def _cutting_stiffness(predicted: Predicted, offsets: Array | None) -> tuple[Estimate | None, tuple[Finding, ...]]:
    """The stated cutting stiffness, or that of two passes; None where neither is known: then the forces are taken as logged."""
    settings = predicted.settings
    if settings.correction.cutting_stiffness is not None or settings.correction.first_forces is None or offsets is None:
        return settings.correction.cutting_stiffness, ()
    first = _predicted(replace(predicted.inputs, forces=settings.correction.first_forces), settings, predicted.cell,
                       predicted.model,
                       predicted.program, predicted.path, predicted.rapid)
    found = two_passes(predicted.path, first.forces, first.prediction, predicted.forces, predicted.prediction, offsets)
    return found, (Finding("CS4124", "note", f"cutting stiffness from the two passes: {1e-3 * found.value:.3g} N/mm, standard "
                           f"error {1e-3 * found.std:.2g}", file=str(predicted.inputs.forces)),)


def _read_back(predicted: Predicted, forces: TargetForces, correction: Correction, content: bytes) -> tuple[Array, Poses]:
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
    path = predicted.path
    object_from_tcp = Frame.from_quaternion(after.position[targets], after.quaternion[targets])
    base_from_object = Frame(path.base_from_object.rotation[targets], path.base_from_object.position[targets])
    flange_from_tcp = Frame(path.flange_from_tcp.rotation[targets], path.flange_from_tcp.position[targets])
    base_from_tcp = base_from_object @ object_from_tcp
    base_from_flange = base_from_tcp @ flange_from_tcp.inverse()
    theta = nearest_angles(predicted.cell.robot, base_from_flange, correction.theta)
    loaded = loaded_path(path, forces, predicted.model, targets, theta)
    commanded, joints = Frame(path.base_from_tcp.rotation.copy(), path.base_from_tcp.position.copy()), path.theta.copy()
    commanded.rotation[targets], commanded.position[targets] = base_from_tcp.rotation, base_from_tcp.position
    joints[targets] = theta
    return np.asarray(np.linalg.norm(loaded.position - path.base_from_tcp.position[targets], axis=1)), Poses(commanded, joints)


def check_not_corrected(toolpath: Path, *folders: Path) -> None:
    """Refused (CS4204) where a record in the toolpath's folder names this file, or its content, as an output, or where one in
    `folders` names its content."""
    digest = sha256(toolpath)
    for path in (record for folder in (toolpath.parent, *folders) for record in sorted(folder.glob("*.json"))):
        names = _recorded(path)
        if names is None:
            continue
        (source, source_digest), *outputs = names
        beside = path.parent == toolpath.parent
        # A record of a program that came out as it went in forbids nothing.
        if any(source_digest != output_digest and (output_digest == digest or (beside and output == toolpath.name))
               for output, output_digest in outputs):
            raise Refused(Finding("CS4204", "error", f"is the output of an earlier correction (record {path.name}); nothing is "
                                  "corrected twice", file=str(toolpath),
                                  hint=f"correct the CAM system's program {source}; --force if this really is one"))


def _recorded(path: Path) -> list[tuple[str, str]] | None:
    """Name and SHA-256 of the input, the output and its parts of a correction record; None where the file is no such record."""
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
    parts = record.get("parts")
    items = [source, output, *(part for part in (parts if isinstance(parts, list) else []) if isinstance(part, dict))]
    return [(str(item.get("file", "")), str(item.get("sha256", ""))) for item in items]


def planned_time(predicted: Predicted) -> Array:
    """Time (N,) [s] at which each target is reached with the programmed feed; NaN from the first unknown feed on."""
    with np.errstate(over="ignore", invalid="ignore"):
        return np.asarray(np.cumsum(segment_times(predicted.path)))


def summary(predicted: Predicted, corrected: Corrected | None = None) -> dict[str, Any]:
    """The figures of one job, JSON values; those of a corrected program count its intermediate targets too."""
    size = np.linalg.norm(predicted.prediction.position, axis=1)
    std = np.sqrt(np.trace(predicted.prediction.covariance, axis1=1, axis2=2))
    figures: dict[str, Any] = {
        "targets": len(predicted.path.toolpath if corrected is None else corrected.kept),
        "with_force": int(predicted.forces.forced.sum()),
        "without_sample": int((predicted.forces.samples == 0).sum()),
        "predicted": len(size),
        "deviation_um": _figures(1e6 * size),
        "deviation_std_um": _figures(1e6 * std),
    }
    if corrected is not None:
        figures |= {
            "added_targets": len(predicted.path.toolpath) - len(corrected.kept),
            "corrected": len(size),
            "offset_mm": _figures(1e3 * np.linalg.norm(corrected.correction.offset, axis=1)),
            "turn_deg": _figures(np.degrees(np.linalg.norm(corrected.correction.turn, axis=1))),
            "residual_um": _figures(1e6 * corrected.residual),
            "held_back": int((np.abs(corrected.correction.share - 1) > 0.01).sum()),
            "expected_worse": round(float(corrected.correction.harm.sum()), 2),
            "left_at_10_n_per_mm_um": None if corrected.cutting is None else _figures(1e6 * corrected.cutting),
            "feed_check": feed_figures(corrected.feed) if corrected.feed else None,
        }
        if corrected.advice is not None:
            figures["posture"] = corrected.advice.as_dict()
    return figures


def as_logged(figures: dict[str, Any]) -> str:
    """What an unknown cutting stiffness leaves, for people."""
    left = figures["left_at_10_n_per_mm_um"]
    return (f"a cutting stiffness of 10 N/mm leaves {left['rms']:.1f} um RMS, {left['largest']:.1f} um at most "
            "(--cutting-stiffness, or correct the log of the corrected pass)")


def _figures(values: Array) -> dict[str, float]:
    if not len(values):
        return {"largest": 0.0, "rms": 0.0}
    return {"largest": float(values.max()), "rms": float(np.sqrt(np.mean(values**2)))}


def rapid_suffix(toolpath: Path) -> str:
    """The suffix of the RAPID program made from a toolpath."""
    return toolpath.suffix if toolpath.suffix.lower() in RAPID_SUFFIXES else ".mod"


def record(corrected: Corrected, files: dict[Path, bytes]) -> dict[str, Any]:
    """OUT.mod.json: what was made from what (FORMATS.md, correct). files: the program, and its parts where it was split."""
    import hashlib

    inputs, settings = corrected.predicted.inputs, corrected.predicted.settings
    outputs = [{"file": path.name, "sha256": hashlib.sha256(content).hexdigest()} for path, content in files.items()]
    return {
        "format": RECORD, "version": 1, "compstiff": version("compstiff"), "numpy": np.__version__,
        "input": {"file": inputs.toolpath.name, "sha256": sha256(inputs.toolpath)},
        "output": outputs[0],
        "parts": outputs[1:],
        **{name: {"file": path.name, "sha256": sha256(path)} for name, path in (
            ("stiffness", inputs.stiffness), ("cell", inputs.cell), ("forces", inputs.forces), *settings.files())},
        "settings": settings.as_dict(),
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

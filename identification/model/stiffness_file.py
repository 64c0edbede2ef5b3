"""Reads stiffness.json for a cell (docs/formats.md#stiffnessjson)."""

from __future__ import annotations

import json
from collections.abc import Sequence
from difflib import get_close_matches
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, FiniteFloat, StrictInt, ValidationError

from identification.common.findings import CompstiffError, error
from identification.common.sizes import LARGEST_VARIANCE, SOFTEST, STIFFEST
from identification.model.cell import Cell
from identification.model.effects import effects
from identification.model.effects_in_force import EFFECTS, SPRINGS
from identification.model.gravity import fall_in_base
from identification.model.law_of import known as law_or_effect
from identification.model.rotations import Frame, rotation_vector
from identification.model.stiffness import FORMAT, JOINT_NAMES, EffectInForce, IdentifiedModel

Array = NDArray[np.float64]
# ln k in parameters and log_compliance may differ by rounding, not by more; an effect's parameter by this share of its typical
# size or of itself.
DISAGREEMENT = 0.01
# Of ln k: the prior of a stiffness that is known to a factor of e^10.
LARGEST_LN_VARIANCE = 100.0
# Of the load, of how forces differ from one set-up to the next.
LARGEST_SHARE = 10.0
# Tools whose TCP differs by less are the same tool, calibrated again [m], [rad].
SAME_TOOL_POSITION, SAME_TOOL_ROTATION = 5e-4, np.radians(0.1)


class _File(BaseModel):
    model_config = ConfigDict(extra="ignore")


class _Parameter(_File):
    name: str
    estimate: FiniteFloat
    unit: str | None = None
    grade: str = ""


class _LogCompliance(_File):
    mean: list[FiniteFloat]
    covariance: list[list[FiniteFloat]]


class _Tool(_File):
    position_mm: tuple[FiniteFloat, FiniteFloat, FiniteFloat]
    quaternion: tuple[FiniteFloat, FiniteFloat, FiniteFloat, FiniteFloat] = (1.0, 0.0, 0.0, 0.0)


class NamedEffect(_File):
    """An effect in force as files name it."""

    effect: str
    joint: StrictInt | None = None


class _Table(_File):
    file: str
    sha256: str


class StiffnessFile(_File):
    """stiffness.json."""

    format: str
    version: int
    robot: str
    load_path: str | None = None
    robot_sha256: str | None = None
    geometry_sha256: str | None = None
    serial_number: str | None = None
    made_from: list[_Table] = []
    tool: Any = None
    parameters: list[_Parameter] = Field(min_length=6)
    covariance: list[list[FiniteFloat]]
    log_compliance: _LogCompliance | None = None
    effects: list[NamedEffect] = []
    fit: dict[str, Any] = {}


def read_stiffness(file: str | Path, cell: Cell) -> IdentifiedModel:
    """Reads stiffness.json for this cell.

    Raises CompstiffError: CS1201 not such a file, CS1202 another robot or load path than the cell's, or another tool where an
    effect depends on it, CS1203 numbers that are no covariance or outside physical bounds, CS1204 effects that cannot be used.

    >>> cell = compstiff.read_cell("cell.yaml")
    >>> model = compstiff.read_stiffness("stiffness.json", cell)
    >>> [f"{k:.2e}" for k in model.stiffness[:2]]
    ['1.55e+06', '4.00e+06']
    """
    name = str(file)
    content = _parse(file, name)
    _check_robot(content, cell, name)
    in_force = effects_named(content.effects, name)
    _check_parameters(content, in_force, name)
    _check_tool(content, cell, in_force, name)
    check_track(cell, in_force, name)
    mean, covariance = _posterior(content, in_force, name)
    return IdentifiedModel(
        cell.robot, cell.flange_from_tcp, mean, covariance, tuple(parameter.grade for parameter in content.parameters[SPRINGS]),
        content.fit, in_force, fall_in_base(cell.world_from_base), cell.tool_mass, cell.tool_centre,
        differs=_differs(content, name), source=Path(file),
        made_from=tuple(table.model_dump() for table in content.made_from))


def _differs(file: StiffnessFile, name: str) -> float:
    """How the compliance differed from pose to pose, as a share; 0 where the file says nothing of it (CS1203: no share)."""
    noise = file.fit.get("noise")
    share = noise.get("setup_relative", 0.0) if isinstance(noise, dict) else 0.0
    if isinstance(share, bool) or not isinstance(share, int | float) or not 0 <= share < LARGEST_SHARE:
        raise error("CS1203", f"fit.noise.setup_relative is {share!r}, a share from 0 to {LARGEST_SHARE:g} is expected",
                    file=name, hint="edit no stiffness file by hand")
    return float(share)


def same_tool(tool: Frame, other: Frame) -> bool:
    """Whether two flange_from_tcp are one tool: effects that depend on the tool hold for both."""
    off = float(np.linalg.norm(tool.position - other.position))
    turned = float(np.linalg.norm(rotation_vector(tool.rotation @ other.rotation.T)))
    return off <= SAME_TOOL_POSITION and turned <= SAME_TOOL_ROTATION


def _parse(file: str | Path, name: str) -> StiffnessFile:
    try:
        content = json.loads(Path(file).read_bytes())
    except OSError as reason:
        raise error("CS0005", f"cannot be read: {reason.strerror}", file=name) from reason
    except json.JSONDecodeError as reason:
        raise error("CS1201", f"is not JSON: {reason.msg}", file=name, line=reason.lineno, column=reason.colno,
                    hint="name the stiffness file that compstiff identify wrote (-o)") from reason
    except (ValueError, RecursionError) as reason:
        raise error("CS1201", f"is not JSON: {reason}", file=name) from reason
    if not isinstance(content, dict) or content.get("format") != FORMAT:
        written = content.get("format") if isinstance(content, dict) else type(content).__name__
        raise error("CS1201", f"is not a stiffness file: format is {written!r}, expected {FORMAT!r}", file=name,
                    hint="compstiff identify writes it")
    if content.get("version") != 1:
        raise error("CS1201", f"has version {content.get('version')!r}, this program reads version 1", file=name,
                    hint="update compstiff, or make the file anew with this one")
    try:
        return StiffnessFile.model_validate(content)
    except ValidationError as reason:
        first = reason.errors()[0]
        raise error("CS1201", f"{'.'.join(map(str, first['loc']))}: {first['msg']}", file=name) from reason


def _check_robot(file: StiffnessFile, cell: Cell, name: str) -> None:
    robot = cell.robot
    hint = "use the stiffness file that was identified on this robot, or identify again"
    if file.robot != robot.name:
        raise error("CS1202", f"was identified on robot '{file.robot}', the cell's is '{robot.name}'", file=name, hint=hint)
    if file.load_path is not None and file.load_path != robot.load_path:
        raise error("CS1202", f"was identified with load_path '{file.load_path}', the cell's robot has "
                    f"'{robot.load_path}'", file=name, hint=hint)
    if file.serial_number and robot.serial_number and file.serial_number != robot.serial_number:
        raise error("CS1202", f"was identified on the robot of serial number {file.serial_number}, the cell's is "
                    f"{robot.serial_number}", file=name, hint=hint)
    same = file.robot_sha256 in (None, robot.sha256) or file.geometry_sha256 == robot.geometry_sha256
    if not same:
        raise error("CS1202", f"was identified with another robot file of the name '{robot.name}': SHA-256 "
                    f"{str(file.robot_sha256)[:12]}..., the cell's is {robot.sha256[:12]}...", file=name, hint=hint)


def _check_tool(file: StiffnessFile, cell: Cell, in_force: tuple[EffectInForce, ...], name: str) -> None:
    of_tool = [term.label for term in in_force if term.effect.of_tool]
    if not of_tool or file.tool is None:
        return
    try:
        tool = _Tool.model_validate(file.tool)
        identified = Frame.from_quaternion(1e-3 * np.array(tool.position_mm), tool.quaternion)
    except ValidationError as reason:
        first = reason.errors()[0]
        raise error("CS1201", f"tool.{'.'.join(map(str, first['loc']))}: {first['msg']}", file=name) from reason
    if not same_tool(identified, cell.flange_from_tcp):
        place = ", ".join(f"{1e3 * x:g}" for x in cell.flange_from_tcp.position)
        raise error("CS1202", f"{', '.join(of_tool)} was identified with the tool at "
                    f"[{', '.join(f'{x:g}' for x in tool.position_mm)}] mm, the cell's is at [{place}] mm, or turned",
                    file=name, hint="use the tool it was identified with, or identify again with this one")


def check_track(cell: Cell, in_force: tuple[EffectInForce, ...], name: str) -> None:
    """Raises CompstiffError (CS4512) for an effect of the track where the cell has none."""
    of_track = [term.label for term in in_force if term.effect.of_track]
    if of_track and cell.robot.track is None:
        raise error("CS4512", f"{', '.join(of_track)} is an effect of the track under the robot, and the cell has none along "
                    "one line", file=name, hint="describe it under mechanical_units in cell.yaml, as it was when the "
                    "stiffnesses were identified")


def effects_named(items: Sequence[NamedEffect], name: str) -> tuple[EffectInForce, ...]:
    """The effects that the entries of `effects` of a file name. Raises CompstiffError (CS1204) where one cannot be used."""
    return tuple(_effect(item, name) for item in items)


def _effect(item: NamedEffect, name: str) -> EffectInForce:
    """The effect an entry of `effects` names."""
    known = effects()
    effect = law_or_effect(item.effect)
    if effect is None:
        nearest = get_close_matches(item.effect, known, 1, cutoff=0.0)
        raise error("CS1204", f"the model is extended by an effect '{item.effect}', which this version does not know; the "
                    f"nearest known one is '{nearest[0]}'", file=name,
                    hint="update compstiff, install the package that brings it, or use a stiffness file of the plain model")
    if not effect.of_robot:
        raise error("CS1204", f"'{item.effect}' is an effect of the measurement ({effect.family}) and never carried on to "
                    "a correction", file=name, hint="write the file with compstiff diagnose --extended")
    if item.joint not in effect.places:
        allowed = f"sits at joint {', '.join(map(str, effect.joints))}" if effect.joints else "belongs to no joint"
        raise error("CS1204", f"'{item.effect}' {allowed}; the file has joint {json.dumps(item.joint)}", file=name,
                    hint="edit no stiffness file by hand")
    return EffectInForce(effect, item.joint)


def _check_parameters(file: StiffnessFile, in_force: tuple[EffectInForce, ...], name: str) -> None:
    """Names, order and units of the parameters."""
    names = [parameter.name for parameter in file.parameters]
    if names[SPRINGS] != list(JOINT_NAMES):
        raise error("CS1201", f"parameters are {names}, expected {list(JOINT_NAMES)} in this order", file=name)
    labels = [term.label for term in in_force]
    double = [label for index, label in enumerate(labels) if label in labels[:index]]
    if double:
        raise error("CS1204", f"effects names {double[0]} twice", file=name)
    expected = [text for term in in_force for text in term.names]
    if names[EFFECTS] != expected:
        raise error("CS1204", f"parameters beyond k1 ... k6 are {names[EFFECTS]}; by its effects {expected} are expected, in "
                    "this order", file=name, hint="effects and parameters belong together: edit neither by hand")
    units = ["N*m/rad"] * 6 + [parameter.unit for term in in_force for parameter in term.effect.parameters]
    for parameter, unit in zip(file.parameters, units, strict=True):
        if parameter.unit not in (None, unit):
            raise error("CS1201", f"{parameter.name} is in {parameter.unit}, expected {unit}", file=name)


def _posterior(file: StiffnessFile, in_force: tuple[EffectInForce, ...], name: str) -> tuple[Array, Array]:
    """Mean and covariance of (ln c, parameters): the file's own, or from the covariance in k (log-normal moments inverted)."""
    estimate = np.array([parameter.estimate for parameter in file.parameters])
    median = estimate[SPRINGS]
    wrong = np.flatnonzero(~((median >= SOFTEST) & (median <= STIFFEST)))
    if len(wrong):
        raise error("CS1203", f"k{wrong[0] + 1}: a stiffness of {median[wrong[0]]:g} N m/rad, must be greater than zero, "
                    f"{SOFTEST:g} to {STIFFEST:g}", file=name, hint="edit no stiffness file by hand")
    in_k = _square(file.covariance, "covariance", len(estimate), name)
    if file.log_compliance is not None:
        mean = np.array(file.log_compliance.mean)
        covariance = _square(file.log_compliance.covariance, "log_compliance.covariance", len(estimate), name)
        if mean.shape != estimate.shape:
            raise error("CS1203", f"log_compliance.mean has {len(mean)} values, expected {len(estimate)}", file=name)
        differs = np.abs(np.log(median) + mean[SPRINGS])
        if differs.max() > DISAGREEMENT:
            worst = int(np.argmax(differs))
            raise _disagree(f"k{worst + 1}", median[worst], np.exp(np.clip(-mean[worst], -700, 700)), "N m/rad", name)
        widest = float(np.diag(covariance)[SPRINGS].max())
        if widest > LARGEST_LN_VARIANCE:
            raise error("CS1203", f"log_compliance.covariance: a variance of {widest:g}, at most {LARGEST_LN_VARIANCE:g}",
                        file=name, hint="edit no stiffness file by hand")
        _check_values(estimate[EFFECTS], in_force, name, mean[EFFECTS])
        return mean, covariance
    _check_values(estimate[EFFECTS], in_force, name)
    # Log-normal with median m and variance v of k: e^s (e^s - 1) = v / m^2 for s the variance of ln k.
    growth = 0.5 * (1 + np.sqrt(1 + 4 * np.diag(in_k)[SPRINGS] / median**2))
    average = median * np.sqrt(growth)
    ratio = in_k[SPRINGS, SPRINGS] / np.outer(average, average)
    if np.any(ratio <= -1):
        raise error("CS1203", "covariance: a correlation no positive stiffnesses can have", file=name)
    covariance = in_k.copy()
    covariance[SPRINGS, SPRINGS] = np.log1p(ratio)
    covariance[SPRINGS, EFFECTS] = -in_k[SPRINGS, EFFECTS] / average[:, None]
    covariance[EFFECTS, SPRINGS] = covariance[SPRINGS, EFFECTS].T
    return np.concatenate([-np.log(median), estimate[EFFECTS]]), _semidefinite(covariance, "covariance", name)


def _check_values(estimate: Array, in_force: tuple[EffectInForce, ...], name: str, mean: Array | None = None) -> None:
    """Refuses (CS1203) parameters (P,) outside their physical bounds, or other in log_compliance (mean) than in parameters."""
    parameters = [(label, parameter) for term in in_force
                  for label, parameter in zip(term.names, term.effect.parameters, strict=True)]
    for index, (label, parameter) in enumerate(parameters):
        for value in (estimate[index], *(() if mean is None else (mean[index],))):
            if not parameter.low <= value <= parameter.high:
                raise error("CS1203", f"{label} is {value:g} {parameter.unit}, outside its physical bounds {parameter.low:g} "
                            f"to {parameter.high:g}", file=name, hint="check its unit, or diagnose again")
        if mean is not None and abs(mean[index] - estimate[index]) > DISAGREEMENT * max(abs(mean[index]), parameter.typical):
            raise _disagree(label, estimate[index], mean[index], parameter.unit, name)


def _disagree(label: str, value: float, other: float, unit: str, name: str) -> CompstiffError:
    return error("CS1203", f"{label} is {value:.6g} {unit} in parameters, {other:.6g} in log_compliance", file=name,
                 hint="edit neither by hand, or remove log_compliance")


def _square(rows: list[list[float]], what: str, size: int, name: str) -> Array:
    if len(rows) != size or any(len(row) != size for row in rows):
        raise error("CS1203", f"{what} has {len(rows)} rows of {sorted({len(row) for row in rows})} values, expected "
                    f"{size} of {size}", file=name)
    return _semidefinite(np.array(rows), what, name)


def _semidefinite(matrix: Array, what: str, name: str) -> Array:
    """The symmetrised matrix; refuses what is not symmetric or has a negative variance in any direction."""
    if np.abs(matrix).max() > LARGEST_VARIANCE:
        raise error("CS1203", f"{what} holds {np.abs(matrix).max():g}, at most {LARGEST_VARIANCE:g} is expected", file=name,
                    hint="edit no stiffness file by hand")
    scale = np.sqrt(np.abs(np.diag(matrix)))
    product = np.outer(scale, scale)
    if np.any(np.abs(matrix) > np.where(product > 0, 1.001 * product, 1.0)):
        raise error("CS1203", f"{what} is not positive semidefinite: a covariance is larger than its variances allow",
                    file=name)
    scaled = matrix / np.where(product > 0, product, 1.0)
    if np.max(np.abs(scaled - scaled.T)) > 1e-6:
        raise error("CS1203", f"{what} is not symmetric", file=name)
    if np.any(np.diag(matrix) < 0) or np.linalg.eigvalsh(0.5 * (scaled + scaled.T)).min() < -1e-6:
        raise error("CS1203", f"{what} is not positive semidefinite", file=name)
    return 0.5 * (matrix + matrix.T)

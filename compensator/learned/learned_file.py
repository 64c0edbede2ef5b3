"""Writes and reads learned.json (docs/formats.md#learnedjson)."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, FiniteFloat, ValidationError

from compensator.learned.learned import DRIFT, SETUP, JobFrame, Learned
from compensator.learned.remainder import Remainder
from identification.common.arrays import Array
from identification.common.findings import error
from identification.common.sizes import LARGEST_VARIANCE
from identification.model.cell import Cell
from identification.model.rotations import Frame
from identification.model.stiffness_file import NamedEffect, check_track, effects_named

FORMAT = "compstiff-learned"
MOST_PLACES, MOST_EFFECTS = 500, 20
Three = tuple[FiniteFloat, FiniteFloat, FiniteFloat]
Four = tuple[FiniteFloat, FiniteFloat, FiniteFloat, FiniteFloat]
Six = tuple[FiniteFloat, FiniteFloat, FiniteFloat, FiniteFloat, FiniteFloat, FiniteFloat]


class _Part(BaseModel):
    model_config = ConfigDict(extra="ignore")


class _Frame(_Part):
    position_mm: Three
    quaternion: Four
    centre_mm: Three
    radius_mm: FiniteFloat = Field(gt=0, le=1e5)
    duration_s: FiniteFloat = Field(ge=0, le=1e9)


class _Remainder(_Part):
    length_mm: FiniteFloat = Field(gt=0, le=1e6)
    amplitude_um: FiniteFloat = Field(ge=0, le=1e5)
    places_mm: list[Three] = Field(max_length=MOST_PLACES)
    posture_deg: list[Six] = Field(max_length=MOST_PLACES)


class LearnedFile(_Part):
    """learned.json."""

    format: str
    version: int
    robot: str
    robot_sha256: str
    geometry_sha256: str
    serial_number: str | None = None
    springs: int = Field(ge=6, le=200)
    prior: list[FiniteFloat]
    mean: list[FiniteFloat]
    covariance: list[list[FiniteFloat]]
    unshown: list[list[FiniteFloat]] | None = None
    job: _Frame
    remainder: _Remainder
    effects: list[NamedEffect] = Field(default=[], max_length=MOST_EFFECTS)
    told: dict[str, Any] = {}


def learned_json(learned: Learned, cell: Cell) -> dict[str, Any]:
    """JSON values. The covariance is its lower half, row by row; lengths of set-up, drift and weights are in metres there."""
    frame, remainder, robot = learned.frame, learned.remainder, cell.robot
    return {
        "format": FORMAT, "version": 1, "robot": robot.name, "robot_sha256": robot.sha256,
        "geometry_sha256": robot.geometry_sha256, **({"serial_number": robot.serial_number} if robot.serial_number else {}),
        "told": learned.told, "springs": learned.springs,
        "job": {"position_mm": (1e3 * frame.base_from_object.position).tolist(),
                "quaternion": frame.base_from_object.quaternion.tolist(), "centre_mm": (1e3 * frame.centre).tolist(),
                "radius_mm": 1e3 * frame.radius, "duration_s": frame.duration},
        "remainder": {"length_mm": 1e3 * remainder.length, "amplitude_um": 1e6 * remainder.amplitude,
                      "places_mm": (1e3 * remainder.places).round(4).tolist(),
                      "posture_deg": np.degrees(remainder.posture).round(6).tolist()},
        "effects": [{"effect": term.effect.stored, "joint": term.joint} for term in learned.effects],
        "prior": learned.prior.tolist(), "mean": learned.mean.tolist(),
        "covariance": _lower_half(learned.covariance), "unshown": _lower_half(learned.unshown),
    }


def read_learned(file: str | Path, cell: Cell) -> Learned:
    """Reads learned.json for this cell.

    Raises CompstiffError: CS0005 cannot be read, CS5320 not such a file or not whole, CS5321 of another robot, CS1204 and
    CS4512 effects that this version or this cell does not have.

    >>> try:
    ...     compstiff.read_learned("stiffness.json", compstiff.read_cell("cell.yaml"))
    ... except compstiff.CompstiffError as stopped:
    ...     print(stopped.findings[0].code)
    CS5320
    """
    name = str(file)
    try:
        content = json.loads(Path(file).read_bytes())
    except OSError as reason:
        raise error("CS0005", f"cannot be read: {reason.strerror}", file=name) from reason
    except (ValueError, RecursionError) as reason:
        raise error("CS5320", f"is not JSON: {reason}", file=name,
                    hint="name the file that compstiff learn wrote (-o)") from reason
    if not isinstance(content, dict) or content.get("format") != FORMAT or content.get("version") != 1:
        found = (content.get("format"), content.get("version")) if isinstance(content, dict) else type(content).__name__
        raise error("CS5320", f"is no learned file: format and version are {found}, expected ('{FORMAT}', 1)", file=name,
                    hint="compstiff learn writes it")
    try:
        part = LearnedFile.model_validate(content)
    except ValidationError as reason:
        first = reason.errors()[0]
        raise error("CS5320", f"{'.'.join(map(str, first['loc']))}: {first['msg']}", file=name) from reason
    if part.robot != cell.robot.name or (
            part.robot_sha256 != cell.robot.sha256 and part.geometry_sha256 != cell.robot.geometry_sha256):
        raise error("CS5321", f"was learned on robot '{part.robot}' (SHA-256 {part.robot_sha256[:12]}...), the cell's is "
                    f"'{cell.robot.name}' ({cell.robot.sha256[:12]}...)", file=name, hint="learn on this robot")
    if part.serial_number and cell.robot.serial_number and part.serial_number != cell.robot.serial_number:
        raise error("CS5321", f"was learned on the robot of serial number {part.serial_number}, the cell's is "
                    f"{cell.robot.serial_number}", file=name, hint="learn on this robot")
    in_force = effects_named(part.effects, name)
    check_track(cell, in_force, name)
    own = sum(len(term.effect.parameters) for term in in_force)
    count = part.springs + SETUP + DRIFT + 3 * len(part.remainder.places_mm)
    if (len(part.prior), len(part.mean), len(part.remainder.posture_deg)) != (
            part.springs - own, count, len(part.remainder.places_mm)):
        raise error("CS5320", f"has {len(part.mean)} parameters, by its springs and places {count} are expected", file=name,
                    hint="edit no learned file by hand")
    position = 1e-3 * np.array(part.remainder.places_mm).reshape(-1, 3)
    posture = np.radians(np.array(part.remainder.posture_deg)).reshape(-1, 6)
    job = part.job
    if not abs(math.hypot(*job.quaternion) - 1.0) < 1e-3:
        raise error("CS5320", f"job.quaternion must have norm 1, and has {math.hypot(*job.quaternion):.6g}", file=name,
                    hint="edit no learned file by hand")
    return Learned(
        np.array(part.prior), np.array(part.mean), _covariance(part.covariance, count, name),
        JobFrame(Frame.from_quaternion(1e-3 * np.array(job.position_mm), job.quaternion), 1e-3 * np.array(job.centre_mm),
                 1e-3 * job.radius_mm, job.duration_s),
        Remainder(position, posture, 1e-3 * part.remainder.length_mm, 1e-6 * part.remainder.amplitude_um), in_force,
        part.told, Path(file),
        np.zeros((SETUP + DRIFT, SETUP + DRIFT)) if part.unshown is None else _covariance(part.unshown, SETUP + DRIFT, name))


def _lower_half(matrix: Array) -> list[list[float]]:
    return [row[:number + 1] for number, row in enumerate(matrix.tolist())]


def _covariance(rows: list[list[float]], count: int, name: str) -> Array:
    """The whole matrix of its lower half; refuses (CS5320) what is no covariance."""
    if [len(row) for row in rows] != list(range(1, count + 1)):
        raise error("CS5320", f"covariance is not the lower half of {count} rows", file=name)
    matrix = np.zeros((count, count))
    for index, row in enumerate(rows):
        matrix[index, :index + 1] = matrix[:index + 1, index] = row
    scale = np.sqrt(np.abs(np.diag(matrix)))
    product = np.where(np.outer(scale, scale) > 0, np.outer(scale, scale), 1.0)
    if (np.abs(matrix).max() > LARGEST_VARIANCE or np.any(np.diag(matrix) < 0)
            or np.linalg.eigvalsh(matrix / product).min() < -1e-6 * count):
        raise error("CS5320", "covariance is not positive semidefinite", file=name, hint="edit no learned file by hand")
    return matrix

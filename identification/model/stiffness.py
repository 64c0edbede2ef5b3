"""IdentifiedModel: joint stiffnesses with their covariance; reads and writes stiffness.json (FORMATS.md)."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, FiniteFloat, ValidationError

from identification.cell import Cell
from identification.findings import error
from identification.model.compliance import deviation, signature
from identification.model.robot import RobotModel
from identification.model.rotations import Frame

Array = NDArray[np.float64]
FORMAT = "compstiff-stiffness"
JOINT_NAMES = tuple(f"k{i}" for i in range(1, 7))
NORMAL_97_5 = 1.959963984540054
# ln k in parameters and log_compliance may differ by rounding, not by more.
DISAGREEMENT = 0.01


@dataclass(frozen=True, eq=False)
class IdentifiedModel:
    """The posterior of the joint compliances: ln c ~ N(mean, covariance), c in rad/(N m).

    mean (6,), covariance (6, 6) of ln c. grades (6,): reliable, tentative or not identifiable, "" where not judged.
    fit: figures of the fit as stiffness.json carries them.
    """

    robot: RobotModel
    flange_from_tcp: Frame
    mean: Array
    covariance: Array
    grades: tuple[str, ...] = ("",) * 6
    fit: dict[str, Any] = field(default_factory=dict)

    @property
    def compliance(self) -> Array:
        """Posterior median of c (6,) [rad/(N m)]."""
        return np.exp(self.mean)

    @property
    def stiffness(self) -> Array:
        """Posterior median of k (6,) [N m/rad]."""
        return np.exp(-self.mean)

    @property
    def log_std(self) -> Array:
        """Standard deviation of ln k (6,)."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def interval_95(self) -> Array:
        """95 % intervals of k (6, 2) [N m/rad], by transformation from ln k."""
        half = NORMAL_97_5 * self.log_std
        return np.exp(np.column_stack([-self.mean - half, -self.mean + half]))

    @property
    def stiffness_covariance(self) -> Array:
        """Covariance of k (6, 6) [(N m/rad)^2], the exact moments of the log-normal posterior."""
        average = np.exp(-self.mean + 0.5 * np.diag(self.covariance))
        return np.asarray(np.outer(average, average) * np.expm1(self.covariance))

    def predict(self, theta: Array, wrench: Array, flange_from_tcp: Frame | None = None) -> tuple[Array, Array, Array]:
        """Predicted TCP deviation and its posterior covariance.

        theta (N, 6) [rad], wrench (N, 6) [N, N m] base frame. Returns position (N, 3) [m], rotation vector (N, 3) [rad],
        covariance (N, 6, 6) of both, first order in ln c: `sum over i, j of (J_i tau_i c_i) Sigma_ij (J_j tau_j c_j)`.
        """
        tool = self.flange_from_tcp if flange_from_tcp is None else flange_from_tcp
        position, rotation = deviation(self.robot, theta, tool, wrench, self.compliance)
        return position, rotation, self.deviation_covariance(theta, wrench, tool)

    def deviation_covariance(self, theta: Array, wrench: Array, flange_from_tcp: Frame) -> Array:
        """Posterior covariance (N, 6, 6) [m, rad] of the deviation; see `predict`."""
        by_log = signature(self.robot, theta, flange_from_tcp, wrench) * self.compliance
        return np.asarray(np.einsum("nri,ij,nsj->nrs", by_log, self.covariance, by_log, optimize=True))

    def as_dict(self) -> dict[str, Any]:
        """The content of stiffness.json."""
        covariance = self.stiffness_covariance
        deviations = np.sqrt(np.diag(covariance))
        parameters = [
            {"name": name, "unit": "N*m/rad", "estimate": float(k), "std": float(std),
             "interval_95": [float(low), float(high)], "grade": grade}
            for name, k, std, (low, high), grade in zip(
                JOINT_NAMES, self.stiffness, deviations, self.interval_95, self.grades, strict=True)
        ]
        tool = self.flange_from_tcp
        return {
            "format": FORMAT, "version": 1, "robot": self.robot.name, "load_path": self.robot.load_path,
            "robot_sha256": self.robot.sha256, "geometry_sha256": self.robot.geometry_sha256,
            "tool": {"position_mm": (1e3 * tool.position).tolist(), "quaternion": tool.quaternion.tolist()},
            "parameters": parameters,
            "covariance": covariance.tolist(),
            "log_compliance": {"mean": self.mean.tolist(), "covariance": self.covariance.tolist()},
            "effects": [],
            "fit": self.fit,
        }


class _File(BaseModel):
    model_config = ConfigDict(extra="ignore")


class _Parameter(_File):
    name: str
    estimate: FiniteFloat
    unit: str = "N*m/rad"
    grade: str = ""


class _LogCompliance(_File):
    mean: list[FiniteFloat]
    covariance: list[list[FiniteFloat]]


class _StiffnessFile(_File):
    format: str
    version: int
    robot: str
    load_path: str | None = None
    robot_sha256: str | None = None
    geometry_sha256: str | None = None
    parameters: list[_Parameter] = Field(min_length=6)
    covariance: list[list[FiniteFloat]]
    log_compliance: _LogCompliance | None = None
    effects: list[dict[str, Any]] = []
    fit: dict[str, Any] = {}


def read_stiffness(path: str | Path, cell: Cell) -> IdentifiedModel:
    """Reads stiffness.json for this cell.

    Raises CompstiffError: CS1201 not such a file, CS1202 another robot or load path than the cell's, CS1203 numbers that
    are no covariance, CS1204 an effect this version does not know.
    """
    name = str(path)
    file = _parse(path, name)
    _check_robot(file, cell, name)
    if file.effects or len(file.parameters) > 6:
        effects = ", ".join(str(item.get("effect")) for item in file.effects) or "parameters beyond k1 ... k6"
        raise error("CS1204", f"the model is extended by {effects}, which this version cannot apply", file=name,
                    hint="update compstiff, or use a stiffness file of the plain model")
    names = [parameter.name for parameter in file.parameters]
    if names != list(JOINT_NAMES):
        raise error("CS1201", f"parameters are {names}, expected {list(JOINT_NAMES)} in this order", file=name)
    units = {parameter.unit for parameter in file.parameters}
    if units != {"N*m/rad"}:
        raise error("CS1201", f"parameters are in {', '.join(sorted(units))}, expected N*m/rad", file=name)
    mean, covariance = _log_compliance(file, name)
    return IdentifiedModel(cell.robot, cell.flange_from_tcp, mean, covariance,
                           tuple(parameter.grade for parameter in file.parameters), file.fit)


def _parse(path: str | Path, name: str) -> _StiffnessFile:
    try:
        content = json.loads(Path(path).read_bytes())
    except OSError as reason:
        raise error("CS0005", f"cannot be read: {reason.strerror}", file=name) from reason
    except json.JSONDecodeError as reason:
        raise error("CS1201", f"is not JSON: {reason.msg}", file=name, line=reason.lineno, column=reason.colno) from reason
    except (ValueError, RecursionError) as reason:
        raise error("CS1201", f"is not JSON: {reason}", file=name) from reason
    if not isinstance(content, dict) or content.get("format") != FORMAT:
        found = content.get("format") if isinstance(content, dict) else type(content).__name__
        raise error("CS1201", f"is not a stiffness file: format is {found!r}, expected {FORMAT!r}", file=name,
                    hint="compstiff identify writes it")
    if content.get("version") != 1:
        raise error("CS1201", f"has version {content.get('version')!r}, this program reads version 1", file=name,
                    hint="update compstiff")
    try:
        return _StiffnessFile.model_validate(content)
    except ValidationError as reason:
        first = reason.errors()[0]
        raise error("CS1201", f"{'.'.join(map(str, first['loc']))}: {first['msg']}", file=name) from reason


def _check_robot(file: _StiffnessFile, cell: Cell, name: str) -> None:
    robot = cell.robot
    hint = "use the stiffness file that was identified on this robot, or identify again"
    if file.robot != robot.name:
        raise error("CS1202", f"was identified on robot '{file.robot}', the cell's is '{robot.name}'", file=name, hint=hint)
    if file.load_path is not None and file.load_path != robot.load_path:
        raise error("CS1202", f"was identified with load_path '{file.load_path}', the cell's robot has "
                    f"'{robot.load_path}'", file=name, hint=hint)
    same = file.robot_sha256 in (None, robot.sha256) or file.geometry_sha256 == robot.geometry_sha256
    if not same:
        raise error("CS1202", f"was identified with another robot file of the name '{robot.name}': SHA-256 "
                    f"{str(file.robot_sha256)[:12]}..., the cell's is {robot.sha256[:12]}...", file=name, hint=hint)


def _log_compliance(file: _StiffnessFile, name: str) -> tuple[Array, Array]:
    """Mean and covariance of ln c, from the file's own or from the covariance in k (log-normal moments inverted)."""
    median = np.array([parameter.estimate for parameter in file.parameters[:6]])
    if np.any(median <= 0):
        raise error("CS1203", f"a stiffness of {median.min():g} N m/rad, must be greater than zero", file=name)
    in_k = _square(file.covariance, name)
    if file.log_compliance is not None:
        mean = np.array(file.log_compliance.mean)
        covariance = _square(file.log_compliance.covariance, name)
        if mean.shape != (6,):
            raise error("CS1203", f"log_compliance.mean has {len(mean)} values, expected 6", file=name)
        differs = np.abs(np.log(median) + mean)
        if differs.max() > DISAGREEMENT:
            worst = int(np.argmax(differs))
            raise error("CS1203", f"k{worst + 1} is {median[worst]:.6g} N m/rad in parameters, {np.exp(-mean[worst]):.6g} in "
                        "log_compliance", file=name, hint="edit neither by hand, or remove log_compliance")
        return mean, covariance
    # Log-normal with median m and variance v of k: e^s (e^s - 1) = v / m^2 for s the variance of ln k.
    growth = 0.5 * (1 + np.sqrt(1 + 4 * np.diag(in_k) / median**2))
    average = median * np.sqrt(growth)
    ratio = in_k / np.outer(average, average)
    if np.any(ratio <= -1):
        raise error("CS1203", "covariance: a correlation no positive stiffnesses can have", file=name)
    return -np.log(median), _semidefinite(np.log1p(ratio), name)


def _square(rows: list[list[float]], name: str) -> Array:
    if len(rows) != 6 or any(len(row) != 6 for row in rows):
        raise error("CS1203", f"covariance has {len(rows)} rows of {sorted({len(row) for row in rows})} values, expected "
                    "6 of 6", file=name)
    return _semidefinite(np.array(rows), name)


def _semidefinite(matrix: Array, name: str) -> Array:
    """The symmetrised matrix; refuses what is not symmetric or has a negative variance in any direction."""
    scale = np.sqrt(np.abs(np.diag(matrix)))
    scaled = matrix / np.where(scale > 0, np.outer(scale, scale), 1.0)
    if np.max(np.abs(scaled - scaled.T)) > 1e-6:
        raise error("CS1203", "covariance is not symmetric", file=name)
    if np.any(np.diag(matrix) < 0) or np.linalg.eigvalsh(0.5 * (scaled + scaled.T)).min() < -1e-6:
        raise error("CS1203", "covariance is not positive semidefinite", file=name)
    return 0.5 * (matrix + matrix.T)

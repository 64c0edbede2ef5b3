"""RobotModel: modified Denavit-Hartenberg geometry, joint limits, coupling and prior; read from robots/*.yaml."""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from identification.common.files import sha256
from identification.common.findings import error
from identification.common.yaml_source import EachJoint, NotNegative, Number, Positive, Stiffness, Strict, Triple, read_yaml

Array = NDArray[np.float64]
LoadPath = Literal["drive", "serial"]
BUILT_IN = Path(__file__).parent / "robots"


class _Joint(Strict):
    alpha_deg: Number
    a_mm: Number
    d_mm: Number
    offset_deg: Number = 0.0
    limits_deg: tuple[Number, Number]
    speed_deg_s: Positive
    acceleration_deg_s2: Positive

    @model_validator(mode="after")
    def _ascending(self) -> _Joint:
        if self.limits_deg[0] >= self.limits_deg[1]:
            raise ValueError(f"limits_deg must be an ascending pair; received {list(self.limits_deg)}")
        return self


class _Coupling(Strict):
    joint: Annotated[int, Field(ge=1, le=6)]
    driven_by: Annotated[int, Field(ge=1, le=6)]
    ratio: Number
    window_deg: tuple[Number, Number] | None = None

    @model_validator(mode="after")
    def _ascending(self) -> _Coupling:
        if self.window_deg is not None and self.window_deg[0] >= self.window_deg[1]:
            raise ValueError(f"window_deg must be an ascending pair; received {list(self.window_deg)}")
        if self.joint == self.driven_by:
            raise ValueError(f"joint {self.joint} is driven by itself")
        return self


class PriorFile(Strict):
    """The `prior` block of a robot file and of cell.yaml."""

    stiffness_nm_per_rad: tuple[Stiffness, Stiffness, Stiffness, Stiffness, Stiffness, Stiffness]
    relative_std: EachJoint = (2.0,) * 6


class _Link(Strict):
    mass_kg: NotNegative
    centre_of_mass_mm: Triple


class RobotFile(Strict):
    """robot.yaml (docs/formats.md#robotyaml)."""

    name: str
    manufacturer: str = ""
    load_path: LoadPath | None = None
    joints: Annotated[list[_Joint], Field(min_length=6, max_length=6)] | None = None
    coupling: _Coupling | None = None
    prior: PriorFile
    links: Annotated[list[_Link], Field(min_length=6, max_length=6)] | None = None

    @model_validator(mode="after")
    def _whole(self) -> RobotFile:
        if self.joints is not None and self.load_path is None:
            raise ValueError("load_path must be drive or serial where joints are given; received none")
        if self.joints is None and (self.coupling is not None or self.links is not None):
            raise ValueError("coupling and links need joints; received none")
        return self


@dataclass(frozen=True)
class Prior:
    """Log-normal prior of the joint stiffnesses: median (6,) [N m/rad] and std / mean (6,) of k."""

    stiffness: Array
    relative_std: Array

    @property
    def log_std(self) -> Array:
        """Standard deviation (6,) of log k, and so of log c."""
        return np.sqrt(np.log1p(self.relative_std**2))


@dataclass(frozen=True, eq=False)
class RobotModel:
    """A six-axis robot with elastic joints (paper eq. 1, 7).

    alpha, a, d, offset (6,) [rad, m, m, rad]: `T_i = RotX(alpha_i) TransX(a_i) RotZ(theta~_i) TransZ(d_i)`.
    limits (6, 2) [rad], speed (6,) [rad/s], acceleration (6,) [rad/s^2] of the controller's joint angles.
    coupling (6, 6): `theta~ = coupling @ theta + offset`. window: (coupled joint's index, its row's [low, high] rad)
    bounds `(coupling @ theta)` of the parallel rod, None for a serial robot.
    load_path: "drive" (springs at the drives) or "serial" (springs at the serial axes, as published).
    link_mass (6,) [kg] and link_centre (6, 3) [m] in the link's joint frame, None where the file has none.
    track (3,): the direction in which the cell's track carries the base, base frame; None where it stands on no single one.
    has_geometry: False where the file has no joints; then alpha to acceleration are placeholders and mean nothing.
    """

    name: str
    manufacturer: str
    load_path: LoadPath
    alpha: Array
    a: Array
    d: Array
    offset: Array
    limits: Array
    speed: Array
    acceleration: Array
    coupling: Array
    window: tuple[int, float, float] | None
    prior: Prior
    link_mass: Array | None
    link_centre: Array | None
    source: Path
    sha256: str
    has_geometry: bool = True
    track: Array | None = None

    @cached_property
    def load_matrix(self) -> Array:
        """L (6, 6): how the springs' deflections turn the serial axes, `dtheta~ = L dq`; torques `L^T J~^T w`.

        The coupling matrix where the springs sit at the drives, the identity where each serial axis has its own.
        """
        return self.coupling if self.load_path == "drive" else np.eye(6)

    @cached_property
    def uncoupling(self) -> Array:
        """Inverse of the coupling matrix (6, 6)."""
        return np.asarray(np.linalg.inv(self.coupling), dtype=float)

    @cached_property
    def geometry_sha256(self) -> str:
        """Digest of what a stiffness depends on (geometry, coupling, load path), whatever the file's comments say."""
        numbers = [self.alpha, self.a, self.d, self.offset, self.coupling]
        text = json.dumps([self.load_path, *(np.round(x, 12).ravel().tolist() for x in numbers)])
        return hashlib.sha256(text.encode()).hexdigest()

    def serial_angles(self, theta: Array) -> Array:
        """`theta~` (N, 6) [rad] of controller angles (N, 6) [rad] (paper eq. 7)."""
        return np.asarray(theta @ self.coupling.T + self.offset)

    def controller_angles(self, serial: Array) -> Array:
        """Controller angles (N, 6) [rad] of serial angles (N, 6) [rad] (paper eq. 7)."""
        return np.asarray((serial - self.offset) @ self.uncoupling.T)

    def limit_excess(self, theta: Array) -> Array:
        """How far each joint is outside its limits (N, 7) [rad], 0 inside; the 7th is the parallel rod's window."""
        excess = np.zeros((*theta.shape[:-1], 7))
        excess[..., :6] = np.maximum(self.limits[:, 0] - theta, theta - self.limits[:, 1])
        if self.window is not None:
            joint, low, high = self.window
            difference = theta @ self.coupling[joint]
            excess[..., 6] = np.maximum(low - difference, difference - high)
        return np.maximum(excess, 0.0, out=excess)


def built_in_robots() -> dict[str, Path]:
    """Names of the robots that come with the program, and their files.

    >>> list(compstiff.built_in_robots())
    ['irb4400-60', 'irb6640-235-2.55', 'irb6660-205-1.90', 'irb6700-200-2.60']
    """
    return {path.stem: path for path in sorted(BUILT_IN.glob("*.yaml"))}


def read_robot(file: str | Path, *, geometry: bool = True) -> RobotModel:
    """Reads a robot file; geometry: whether it must have joints. Raises CompstiffError (CS0005, CS0101, CS0102) with line and
    column, CS0105 where it has no joints and must have them."""
    described = read_yaml(file, RobotFile)
    if geometry and described.joints is None:
        raise error("CS0105", "has no joints; only joint deflection logs can be judged without the arm's geometry",
                    file=str(file), hint="add joints (modified Denavit-Hartenberg), one a joint, as in docs/formats.md")
    coupling = np.eye(6)
    window = None
    if described.coupling is not None:
        row = described.coupling.joint - 1
        coupling[row, described.coupling.driven_by - 1] = described.coupling.ratio
        if described.coupling.window_deg is not None:
            low, high = np.radians(described.coupling.window_deg)
            window = (row, float(low), float(high))
    links = described.links
    joints = described.joints or [_Joint(alpha_deg=0, a_mm=0, d_mm=0, limits_deg=(-360, 360), speed_deg_s=1,
                                    acceleration_deg_s2=1)] * 6
    return RobotModel(
        name=described.name,
        manufacturer=described.manufacturer,
        load_path=described.load_path or "serial",
        alpha=np.radians([joint.alpha_deg for joint in joints]),
        a=1e-3 * np.array([joint.a_mm for joint in joints]),
        d=1e-3 * np.array([joint.d_mm for joint in joints]),
        offset=np.radians([joint.offset_deg for joint in joints]),
        limits=np.radians([joint.limits_deg for joint in joints]),
        speed=np.radians([joint.speed_deg_s for joint in joints]),
        acceleration=np.radians([joint.acceleration_deg_s2 for joint in joints]),
        coupling=coupling,
        window=window,
        prior=Prior(np.array(described.prior.stiffness_nm_per_rad), np.array(described.prior.relative_std)),
        link_mass=None if links is None else np.array([link.mass_kg for link in links]),
        link_centre=None if links is None else 1e-3 * np.array([link.centre_of_mass_mm for link in links]),
        source=Path(file),
        sha256=sha256(file),
        has_geometry=described.joints is not None,
    )

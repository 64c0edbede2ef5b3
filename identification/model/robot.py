"""RobotModel: modified Denavit-Hartenberg geometry, joint limits, coupling and prior; read from a robot file."""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from identification.common.files import sha256
from identification.common.findings import error
from identification.common.yaml_source import read_yaml
from identification.model.robot_file import JointFile, LoadPath, RobotFile

Array = NDArray[np.float64]
BUILT_IN = Path(__file__).parent / "robots"


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
    coupling (6, 6): `theta~ = coupling @ theta + offset`; -1 on its diagonal where the controller counts against the z axis.
    rod: (index of the axis that a parallel rod drives, index of the axis that drives it), None for a serial arm.
    window: (coupled joint's index, its row's [low, high] rad) bounds `(coupling @ theta)`, None where nothing does.
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
    rod: tuple[int, int] | None
    window: tuple[int, float, float] | None
    prior: Prior
    link_mass: Array | None
    link_centre: Array | None
    source: Path
    sha256: str
    has_geometry: bool = True
    track: Array | None = None
    serial_number: str = ""

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

    @property
    def sense(self) -> Array:
        """+1 or -1 a joint (6,): whether the controller counts its angle along the z axis of its frame, or against it."""
        return np.asarray(np.diag(self.coupling))

    @cached_property
    def geometry_sha256(self) -> str:
        """Digest of what a stiffness depends on (geometry, coupling, load path), whatever the file's comments say."""
        numbers = [self.alpha, self.a, self.d, self.offset, self.coupling]
        text = json.dumps([self.load_path, *(np.round(x, 12).ravel().tolist() for x in numbers)])
        return hashlib.sha256(text.encode()).hexdigest()

    def serial_angles(self, theta: Array) -> Array:
        """`theta~` (N, 6) [rad] of controller angles (N, 6) [rad] (paper eq. 7)."""
        return np.asarray(theta @ self.coupling.T + self.offset)

    def limit_excess(self, theta: Array) -> Array:
        """How far each joint is outside its limits (N, 7) [rad], 0 inside; the 7th is the parallel rod's window."""
        excess = np.zeros((*theta.shape[:-1], 7))
        excess[..., :6] = np.maximum(self.limits[:, 0] - theta, theta - self.limits[:, 1])
        if self.window is not None:
            joint, low, high = self.window
            difference = theta @ self.coupling[joint]
            excess[..., 6] = np.maximum(low - difference, difference - high)
        return np.maximum(excess, 0.0, out=excess)

    def within_limits(self, theta: Array, slack: float) -> NDArray[np.bool_]:
        """Which angles (N, 6) [rad] exceed no limit by more than `slack` [rad] (N,)."""
        ends = [(theta[:, joint], low, high) for joint, (low, high) in enumerate(self.limits.tolist())]
        if self.window is not None:
            joint, low, high = self.window
            ends.append((theta @ self.coupling[joint], low, high))
        return np.asarray(np.all([(low - angle <= slack) & (angle - high <= slack) for angle, low, high in ends], axis=0))


def built_in_robots() -> dict[str, Path]:
    """Names of the robots that come with the program, and their files.

    >>> robots = compstiff.built_in_robots()
    >>> len(robots), list(robots)[:3]
    (18, ['irb4400-60', 'irb4600-40-2.55', 'irb4600-60-2.05'])
    """
    return {path.stem: path for path in sorted(BUILT_IN.glob("*.yaml"))}


def read_robot(file: str | Path, *, geometry: bool = True) -> RobotModel:
    """Reads a robot file; geometry: whether it must have joints. Raises CompstiffError (CS0005, CS0101, CS0102) with line and
    column, CS0105 where it has no joints and must have them."""
    described = read_yaml(file, RobotFile)
    if geometry and described.joints is None:
        raise error("CS0105", "has no joints; only joint deflection logs can be judged without the arm's geometry",
                    file=str(file), hint="add joints (modified Denavit-Hartenberg), one a joint, as in docs/formats.md")
    joints = described.joints or [JointFile(alpha_deg=0, a_mm=0, d_mm=0, limits_deg=(-360, 360), speed_deg_s=1,
                                            acceleration_deg_s2=1)] * 6
    coupling = np.diag([float(joint.sense) for joint in joints])
    rod, window = None, None
    if described.coupling is not None:
        row, driver = described.coupling.joint - 1, described.coupling.driven_by - 1
        coupling[row, driver] = described.coupling.ratio
        rod = (row, driver) if described.coupling.rod else None
        if described.coupling.window_deg is not None:
            low, high = np.radians(described.coupling.window_deg)
            window = (row, float(low), float(high))
    links = described.links
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
        rod=rod,
        window=window,
        prior=Prior(np.array(described.prior.stiffness_nm_per_rad), np.array(described.prior.relative_std)),
        link_mass=None if links is None else np.array([link.mass_kg for link in links]),
        link_centre=None if links is None else 1e-3 * np.array([link.centre_of_mass_mm for link in links]),
        source=Path(file),
        sha256=sha256(file),
        has_geometry=described.joints is not None,
    )

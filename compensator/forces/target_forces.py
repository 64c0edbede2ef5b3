"""TargetForces: one wrench a target, and how findings name targets."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from compensator.forces.log import ForceLog
from compensator.path.robot_path import RobotPath
from identification.common.arrays import Array, read_only
from identification.common.findings import Finding

Indices = NDArray[np.intp]
# So many stretches of targets are listed in a finding.
MOST_LISTED = 6


@dataclass(frozen=True, eq=False)
class TargetForces:
    """One wrench a target: wrench (N, 6) [N, N m] on the tool at the TCP, base frame; samples (N,) behind each.

    standard_error (N, 3) [N] of the mean force, base frame, by the samples' scatter (scatter.py); NaN under two samples.
    forced (N,): the force is told apart from zero. tare (6,): the bias that was subtracted, log frame, None: none is known.
    log: by path length; where it names targets without its rows, which nobody asks for again. unknown (N, 3, 3) [N^2], base
    frame: covariance of forces that were predicted; follows (N, 3, 3) [N/m]: what those change by where the tool stands off
    its plan. None where they were logged. held (k,): targets all of whose samples stood still (health.py), of which no force
    is known. zero_std [N]: 1 sigma of each axis of the sensor's zero, as its tare and moves in the air beside
    that show it. weight_std (N, 3) [N], base frame: how much more it is by the weight at the target's orientation, None where
    the tare did not tell the payload.
    """

    wrench: Array
    samples: Indices
    standard_error: Array
    forced: NDArray[np.bool_]
    tare: Array | None
    findings: tuple[Finding, ...]
    log: ForceLog
    unknown: Array | None = None
    follows: Array | None = None
    held: Indices = field(default_factory=lambda: np.empty(0, dtype=np.intp))
    zero_std: float = 0.0
    weight_std: Array | None = None

    @property
    def of_zero(self) -> Array:
        """Variance (N, 3) [N^2] of the zero at the targets, base frame."""
        square = np.full(self.wrench[:, :3].shape, self.zero_std**2)
        return square if self.weight_std is None else square + self.weight_std**2

    @property
    def named(self) -> bool:
        """Whether the log gave the target of each sample."""
        return self.log.key == "target"

    def __post_init__(self) -> None:
        read_only(self.wrench, self.samples, self.standard_error, self.forced)
        if self.weight_std is not None:
            read_only(self.weight_std)


def at_target(path: RobotPath, target: int) -> dict[str, Any]:
    """Where a target stands, for a finding."""
    return {"file": path.toolpath.source, "line": int(path.toolpath.line[target]), "target": int(target)}


def listed(targets: Indices) -> str:
    """Targets (n,), ascending, as stretches."""
    starts = targets[np.flatnonzero(np.diff(targets, prepend=-2) > 1)]
    ends = targets[np.flatnonzero(np.diff(targets, append=targets[-1] + 2) > 1)]
    runs = [f"{first} to {last}" if last > first else f"{first}" for first, last in zip(starts, ends, strict=True)]
    more = f" and {len(runs) - MOST_LISTED} more" if len(runs) > MOST_LISTED else ""
    return f"{', '.join(runs[:MOST_LISTED])}{more}"

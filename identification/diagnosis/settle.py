"""What to measure next: the loads that separate what is left, and the checks that are no loads (EFFECTS.md, procedure 8).

Box and Hill's criterion for rival models: the expected difference of two fitted models' readings, in units of their own and
the sensors' uncertainty, weighted by their probabilities. Each candidate is a pose with one load cycle along one base axis.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from identification.cell import Cell
from identification.extension import response
from identification.inference import Posterior
from identification.measurements import Measurements

Array = NDArray[np.float64]
CANDIDATES = 120
# The cycle of one candidate, shares of the largest load: both signs, three magnitudes, back to zero.
CYCLE = (0.0, 0.33, 0.67, 1.0, 0.0, -0.5, -1.0, 0.0)
DWELL_S = (10.0, 60.0)
AXIS_NAMES = "xyz"


@dataclass(frozen=True, eq=False)
class NextLoad:
    """A load cycle worth measuring: theta (6,) [rad], base axis, forces (m,) [N]; distance: by how many sigmas the two
    likeliest rivals would differ; separates: their labels."""

    theta: Array
    axis: int
    forces: Array
    distance: float
    separates: tuple[str, str]

    def as_dict(self) -> dict[str, Any]:
        """JSON values."""
        return {"kind": "load", "q_deg": np.degrees(self.theta).round(3).tolist(), "axis": AXIS_NAMES[self.axis],
                "forces_n": self.forces.tolist(), "separates": list(self.separates), "expected_sigmas": self.distance}


def next_loads(
    cell: Cell, rows: Measurements, rivals: dict[str, tuple[Posterior, float]], rng: np.random.Generator, count: int = 3
) -> tuple[NextLoad, ...]:
    """The best load cycles, each at a pose of its own. rivals: fitted models and probabilities by label."""
    names = list(rivals)
    if len(names) < 2:
        return ()
    force = float(np.abs(rows.wrench[:, :3]).max())
    poses, axes = _candidates(cell, rng)
    trial = candidate_rows(poses, axes, force)
    size = len(CYCLE)
    readings, spreads = [], []
    for model, _ in rivals.values():
        position, slope = response(cell, trial, model.map, model.terms)
        by_candidate = slope.reshape(len(poses), 3 * size, -1)
        readings.append(position.reshape(len(poses), 3 * size))
        spreads.append(by_candidate @ model.covariance @ np.swapaxes(by_candidate, 1, 2))
    likeliest = rivals[names[0]][0]
    noise = _noise(cell, likeliest, size)
    value = np.zeros(len(poses))
    distance: dict[tuple[int, int], Array] = {}
    for a in range(len(names)):
        for b in range(a + 1, len(names)):
            off = readings[a] - readings[b]
            squared = np.einsum("ci,cij,cj->c", off, np.linalg.inv(spreads[a] + spreads[b] + noise), off)
            distance[a, b] = np.sqrt(squared)
            value += rivals[names[a]][1] * rivals[names[b]][1] * squared
    chosen: list[NextLoad] = []
    for k in np.argsort(-value):
        if any(np.allclose(poses[k], one.theta) for one in chosen):
            continue
        pair = max(distance, key=lambda pair: rivals[names[pair[0]]][1] * rivals[names[pair[1]]][1] * distance[pair][k] ** 2)
        chosen.append(NextLoad(poses[k], int(axes[k]), force * np.array(CYCLE), float(distance[pair][k]),
                               (names[pair[0]], names[pair[1]])))
        if len(chosen) == count:
            break
    return tuple(chosen)


def _candidates(cell: Cell, rng: np.random.Generator) -> tuple[Array, NDArray[np.intp]]:
    """Random poses well inside the limits, each with all three base axes."""
    robot = cell.robot
    middle = np.clip(0.0, *robot.limits.T)
    theta = middle + 0.6 * rng.uniform(robot.limits[:, 0] - middle, robot.limits[:, 1] - middle, (6 * CANDIDATES, 6))
    theta = theta[(robot.limit_excess(theta) == 0).all(axis=1)][: CANDIDATES // 3]
    return np.repeat(theta, 3, axis=0), np.tile(np.arange(3), len(theta)).astype(np.intp)


def candidate_rows(poses: Array, axes: NDArray[np.intp], force: float) -> Measurements:
    """The rows of one load cycle at each pose (c, 6) along its base axis (c,); c * len(CYCLE) rows, nothing measured yet."""
    size = len(CYCLE)
    count = len(poses) * size
    wrench = np.zeros((count, 6))
    wrench[np.arange(count), np.repeat(axes, size)] = force * np.tile(CYCLE, len(poses))
    empty, nothing = np.full(count, "", dtype=object), np.full((count, 3), np.nan)
    return Measurements(
        source="candidates", theta=np.repeat(poses, size, axis=0), wrench=wrench, deflection=nothing, sigma=nothing,
        time=60.0 * np.arange(count, dtype=float), dwell=np.resize(np.array(DWELL_S), count),
        visit=np.repeat(np.arange(len(poses)), size).astype(np.intp), reference=np.zeros(count, dtype=np.intp),
        validate=np.zeros(count, dtype=bool), machined_pass=empty, pose=empty, row=np.arange(1, count + 1),
        line=np.arange(2, count + 2), findings=())


def _noise(cell: Cell, model: Posterior, size: int) -> Array:
    """Covariance (3m, 3m) of the readings of one cycle: sensor, and the offset they share."""
    sensor = np.tile((model.size.sensor * cell.noise.deflection) ** 2, size)
    shared = np.diag((model.size.offset * model.at_map.noise.offset) ** 2)
    return np.asarray(np.diag(sensor) + np.kron(np.ones((size, size)), shared))

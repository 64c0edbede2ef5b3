"""Effects that are there at some poses only, or at each in its own way, and mistakes in the table of poses: a diagnosis should
name the poses.

All sizes are made up for tests. `poses`: numbers of the poses from 1; drawn where they are not given.
"""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np

from tests.virtual_cell.effects_measurement import STEP
from tests.virtual_cell.hidden import Draw, Parameters, effect
from tests.virtual_cell.laws import Law, Row
from tests.virtual_cell.plant import Plant


def _poses(draw: Draw, count: int = 1) -> list[int]:
    fitted = np.unique(draw.design.pose[~draw.design.validate])
    return sorted(int(pose) for pose in draw.rng.choice(fitted, count, replace=False))


@effect("hose_drags", lambda draw: {"share": min(draw.factor * 0.25, 1.0), "poses": _poses(draw),
                                    **dict(zip("xyz", draw.direction().tolist(), strict=True))})
def hose_drags(plant: Plant, joint: None, parameters: Parameters) -> None:
    """A hose is taut at these poses and takes its share of the force along its own direction."""
    along = np.array([parameters[axis] for axis in "xyz"])

    def held(force: np.ndarray, row: Row) -> np.ndarray:
        return force - parameters["share"] * (force @ along) * along if row.pose in parameters["poses"] else force

    plant.force_faults.append(held)


class Sticking(Law):
    """A gear that does not move before the load's torque breaks it away [N m], at some poses."""

    def __init__(self, joint: int, compliance: float, breakaway: float, poses: list[int]) -> None:
        self.joint, self.compliance, self.breakaway, self.poses = joint, compliance, breakaway, poses

    def add(self, x: np.ndarray, torque: np.ndarray, rest: np.ndarray | None, row: Row) -> None:
        if rest is not None and row.pose in self.poses:
            load = torque[self.joint] - rest[self.joint]
            x[self.joint] -= self.compliance * np.clip(load, -self.breakaway, self.breakaway)


@effect("axis_sticks", lambda draw: {"torque_nm": draw.factor * {1: 150.0, 2: 150.0, 3: 150.0, 4: 60.0, 5: 60.0, 6: 30.0}[
    draw.joint], "poses": _poses(draw)}, (1, 2, 3, 4, 5, 6))
def axis_sticks(plant: Plant, joint: int, parameters: Parameters) -> None:
    compliance = 1 / plant.stiffness[joint - 1]
    plant.laws.append(Sticking(plant.drive(joint), compliance, parameters["torque_nm"], parameters["poses"]))


@effect("unsettled_zero", lambda draw: {"rest_m": draw.factor * 3e-6, "seed": int(draw.rng.integers(2**31))})
def unsettled_zero(plant: Plant, joint: None, parameters: Parameters) -> None:
    """The target hangs loosely: any load seats it, and without load it rests elsewhere, at each pose in its own way."""
    def aside(seen: np.ndarray, row: Row, force: np.ndarray) -> np.ndarray:
        if row.force.any():
            return seen
        return seen + np.random.default_rng([parameters["seed"], row.pose]).normal(0.0, parameters["rest_m"], 3)

    plant.reading_faults.append((STEP, aside))


def mistaken_pose(text: str, rng: np.random.Generator) -> tuple[str, str]:
    """An angle written by mistake, off by 3 degrees at least, and the mistake: digit, exchanged, sign, lost."""
    while True:
        kind = ("digit", "exchanged", "sign", "lost")[int(rng.integers(4))]
        sign, digits = ("-", text[1:]) if text.startswith("-") else ("", text)
        whole = digits.split(".")[0]
        if kind == "sign":
            new = digits if sign else "-" + digits
        elif kind == "digit":
            place = int(rng.integers(len(whole)))
            new = sign + digits[:place] + str(rng.integers(10)) + digits[place + 1:]
        elif len(whole) < 2:
            continue
        elif kind == "lost":
            place = int(rng.integers(len(whole)))
            new = sign + digits[:place] + digits[place + 1:]
        else:
            place = int(rng.integers(len(whole) - 1))
            new = sign + digits[:place] + digits[place + 1] + digits[place] + digits[place + 2:]
        if abs(float(new) - float(text)) >= 3.0:
            return new, kind


def table(file: Path) -> list[dict[str, str]]:
    """The rows of a table as they are written; comments are left out."""
    return list(csv.DictReader(line for line in file.read_text().splitlines() if not line.startswith("#")))


def rewrite(file: Path, pose: str, change: dict[str, str]) -> None:
    """Writes other texts into some columns of all rows of one pose."""
    rows = [row | change if row["pose"] == pose else row for row in table(file)]
    with file.open("w", newline="") as stream:
        writer = csv.DictWriter(stream, list(rows[0]))
        writer.writeheader()
        writer.writerows(rows)

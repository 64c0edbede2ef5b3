"""The second cell: load tests of a simulated robot that share neither code nor laws with the packages or the virtual cell.

    python -m tests.second_cell.cell SEED PLAN STRATUM FOLDER

writes the files that a user would have: cell.yaml, measurements.csv.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from tests.second_cell.arm import Arm
from tests.second_cell.noise import Noise, draw_noise, reading, real_force
from tests.second_cell.plans import PLANS, Plan
from tests.second_cell.robots import ROBOTS, Robot, robot

LOG_STD = 0.45      # of the true stiffnesses about the published ones


@dataclass(frozen=True)
class Case:
    """One load test. stiffness (6,) [N m/rad]: the truth of the plain springs; reading (n, 3) [um]: as in the table."""

    seed: int
    robot: Robot
    tool: np.ndarray
    stiffness: np.ndarray
    noise: Noise
    plan: Plan
    reading: np.ndarray
    arm: Arm = field(repr=False)

    def write(self, folder: Path) -> tuple[Path, Path]:
        """cell.yaml and measurements.csv in the folder."""
        cell, table = folder / "cell.yaml", folder / "measurements.csv"
        cell.write_text(self._cell(), encoding="utf-8")
        table.write_text(self._table(), encoding="utf-8")
        return cell, table

    def _cell(self) -> str:
        lines = [f"robot: {self.robot.name}", "tool:", f"  position_mm: {(1e3 * self.tool).round(3).tolist()}",
                 "  quaternion: [1, 0, 0, 0]"]
        if self.noise.stated:
            said = self.noise.stated
            lines += ["measurement:", f"  deflection_std_um: {[round(said.sensor, 3)] * 3}",
                      f"  pose_offset_std_um: {[round(said.seating, 3)] * 3}", f"  force_relative_std: {said.relative:.5f}"]
            lines += [f"  force_std_n: {[said.force] * 3}"] if said.force else []
        return "\n".join(lines) + "\n"

    def _table(self) -> str:
        p = self.plan
        head = [*(f"q{i}_deg" for i in range(1, 7)), *(f"f{axis}_n" for axis in "xyz"), *(f"d{axis}_um" for axis in "xyz"),
                "time_s", "dwell_s", "pose"]
        rows = np.column_stack([np.degrees(p.q), p.load, self.reading, p.time, p.dwell])
        return "\n".join([",".join(head), *(",".join([*(f"{x + 0.0:.8g}" for x in row), f"V{visit + 1}"])
                                            for row, visit in zip(rows, p.visit, strict=True))]) + "\n"


def simulate(seed: int, plan: str = "cycles", stratum: str = "near", name: str | None = None) -> Case:
    """The load test of a seed. Robot, tool, stiffnesses and poses depend on the seed and the plan alone."""
    rng = np.random.default_rng([seed, list(PLANS).index(plan), 2])
    arm = robot(name or ROBOTS[int(rng.integers(len(ROBOTS)))])
    tool = np.array([rng.uniform(0.06, 0.16), 0.0, rng.uniform(0.15, 0.32)]).round(4)
    stiffness = arm.stiffness * np.exp(LOG_STD * rng.standard_normal(6))
    planned = PLANS[plan](arm, tool, rng)
    loaded = Arm(arm, tool, stiffness)
    chance = np.random.default_rng([seed, 3])
    noise = draw_noise(stratum, chance)
    seen = 1e6 * loaded.displacement(planned, real_force(noise, planned, chance))
    return Case(seed, arm, tool, stiffness, noise, planned, reading(noise, planned, seen, chance), loaded)


if __name__ == "__main__":
    target = Path(sys.argv[4])
    target.mkdir(parents=True, exist_ok=True)
    print(*simulate(int(sys.argv[1]), sys.argv[2], sys.argv[3]).write(target))

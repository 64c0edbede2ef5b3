"""`--max-slope` on a turning table: the offset's slope is the one over the part, not the one the robot's base sees."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.runs.command_line import user_files as kit
from tests.runs.milling.carried_job import CarriedJob

PATH = "J 0,0 " + " ".join(f"L {x},0" for x in range(2, 32, 2))
TURNING = np.array([[950.0, 12.0, -20.0], [950.0, 4.0, 15.0]])        # 35 degrees over 30 mm
FORCE = np.array([160.0, 90.0, -120.0])
OFFSET_UM = np.array([-110.0, 30.0, 120.0])


class Job:
    """A program on the table, its targets' forces (n, 3) [N] in the base as the log."""

    def __init__(self, folder: Path) -> None:
        folder.mkdir(exist_ok=True)
        self.carried = CarriedJob(folder, PATH, on="table", ends=TURNING)
        self.turned = self.carried.stands(self.carried.values)[1]

    def corrected(self, force: np.ndarray, *options: object) -> tuple[np.ndarray, np.ndarray, list[str]]:
        """Offsets over the part and in the robot's base (n, 3) [um], and the codes."""
        rows = "".join(f"{number},{x:.6f},{y:.6f},{z:.6f}\n" for number, (x, y, z) in enumerate(force))
        ready = self.carried.job("target,fx_n,fy_n,fz_n\n" + rows)
        ready.program = self.carried.program
        done = ready.correct("--json", "--force", "--keep-targets", "--confidence", 0.5, *options)
        assert done.code == 0, done.out
        over_part = 1e3 * kit.column(ready.offsets(), "ox_mm", "oy_mm", "oz_mm")
        return over_part, self.turned.apply(over_part), [finding["code"] for finding in done.json["findings"]]

    def force_for(self, over_part: np.ndarray) -> np.ndarray:
        """The forces (n, 3) whose correction is one offset [um] over the part everywhere, by the offsets of three others."""
        count = len(self.carried.xy)
        columns = [self.corrected(np.tile(each, (count, 1)), "--max-slope", 1e6)[1] / 200 for each in 200 * np.eye(3)]
        wanted = self.turned.apply(np.tile(over_part, (count, 1)))
        return np.linalg.solve(np.stack(columns, axis=2), wanted[:, :, None])[:, :, 0]

    def steepest(self, offsets: np.ndarray) -> float:
        """[um/mm]"""
        return float(np.max(np.linalg.norm(np.diff(offsets, axis=0), axis=1) / np.diff(self.carried.target_lengths)))


@pytest.mark.parametrize("over_the_part", [True, False], ids=["the same over the part", "the same in the base"])
def test_the_slope_is_that_over_the_part(tmp_path: Path, over_the_part: bool) -> None:
    """A limit between the two slopes bites only where the one over the part exceeds it."""
    job = Job(tmp_path)
    force = job.force_for(OFFSET_UM) if over_the_part else np.tile(FORCE, (len(job.carried.xy), 1))
    free = job.corrected(force, "--max-slope", 1e6)
    over_part, in_base = job.steepest(free[0]), job.steepest(free[1])
    assert "CS4113" not in free[2]
    # The two differ enough to tell which one is held against the limit.
    assert (in_base > 1.5 * over_part) if over_the_part else (over_part > 1.2 * in_base), (over_part, in_base)
    held = job.corrected(force, "--max-slope", 0.5 * (over_part + in_base))
    if over_the_part:
        assert "CS4113" not in held[2]
        np.testing.assert_allclose(held[0], free[0], atol=0.02)
    else:
        assert "CS4113" in held[2]
        assert np.abs(held[0] - free[0]).max() > 1

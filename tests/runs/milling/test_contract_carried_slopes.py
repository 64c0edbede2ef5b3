"""`--max-slope` on a turning table: the offset's slope is the one over the part, not the one the robot's base sees."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.runs.command_line import user_files as kit
from tests.runs.milling.carried_job import CarriedJob

PATH = "J 0,0 " + " ".join(f"L {x},0" for x in range(2, 32, 2))
TURNING = np.array([[950.0, 12.0, -20.0], [950.0, 8.0, 25.0]])         # a turn of 45 degrees over 30 mm
FORCE = np.array([160.0, 90.0, -120.0])


def corrected(folder: Path, with_part: bool, *options: object) -> tuple[np.ndarray, np.ndarray, np.ndarray, list[str]]:
    """Offsets over the part and in the robot's base (n, 3) [um], the targets' places along the part [mm], and the codes."""
    folder.mkdir(exist_ok=True)
    job = CarriedJob(folder, PATH, on="table", ends=TURNING)
    turned = job.stands(job.values)[1]
    force = (turned * turned[0].inv()).apply(FORCE) if with_part else np.tile(FORCE, (len(job.xy), 1))
    rows = "".join(f"{number},{x:.6f},{y:.6f},{z:.6f}\n" for number, (x, y, z) in enumerate(force))
    ready = job.job("target,fx_n,fy_n,fz_n\n" + rows)
    ready.program = job.program
    done = ready.correct("--json", "--keep-targets", "--confidence", 0.5, *options)
    assert done.code == 0, done
    over_part = 1e3 * kit.column(ready.offsets(), "ox_mm", "oy_mm", "oz_mm")
    return over_part, turned.apply(over_part), job.target_lengths, [finding["code"] for finding in done.json["findings"]]


def steepest(offsets: np.ndarray, length: np.ndarray) -> float:
    """[um/mm]"""
    return float(np.max(np.linalg.norm(np.diff(offsets, axis=0), axis=1) / np.diff(length)))


@pytest.mark.parametrize("with_part", [True, False], ids=["the force turns with the part", "the force stands still"])
def test_the_slope_is_that_over_the_part(tmp_path: Path, with_part: bool) -> None:
    free = corrected(tmp_path / "free", with_part, "--max-slope", 1e6)
    over_part, in_base = (steepest(offsets, free[2]) for offsets in free[:2])
    assert "CS4113" not in free[3]
    # The two differ enough to tell which one is held against the limit.
    assert max(over_part, in_base) > 1.3 * min(over_part, in_base)
    assert (over_part < in_base) == with_part
    limit = float(np.sqrt(over_part * in_base))
    held = corrected(tmp_path / "held", with_part, "--max-slope", limit)
    if with_part:
        assert "CS4113" not in held[3]
        np.testing.assert_allclose(held[0], free[0], atol=0.02)
    else:
        assert "CS4113" in held[3]
        assert steepest(held[0], held[2]) < 1.01 * limit + 0.01
        assert np.abs(held[0] - free[0]).max() > 5

"""Time and peak memory of the feed check (`compensator/path/timing.py`) over the number of grid points, one process each.

    python benchmarks/timing.py [--largest 1000000]

A zigzag of 25 mm rows over a slightly curved surface, targets 0.5 mm apart, zone z1, and the same with its numbers rounded to
0.1 um as RAPID holds them. Memory: what the process holds when the
program is read and TOPPRA imported, and the peak above that.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import time
from pathlib import Path

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[variable] = "1"
sys.path.insert(0, str(Path(__file__).parent.parent))

import numpy as np

from compensator.path.robot_path import RobotPath, robot_path
from compensator.path.timing import drive
from compensator.toolpath import ToolFrame, Toolpath, WorkObject
from identification.model.cell import read_cell

HERE = Path(__file__).parent


def program(count: int, digits: int | None) -> RobotPath:
    """Targets of a zigzag, tool pointing down."""
    number = np.arange(count)
    row, column = np.divmod(number, 50)
    x = 0.5 * np.where(row % 2, 49 - column, column)
    y = 0.02 * row * 50 / max(count / 2000, 1.0)
    position = np.column_stack([1150 + x, y - 20, 700 + 0.002 * (x - 12) ** 2])
    if digits is not None:
        position = np.round(position, digits)
    block = np.full(count, "", dtype=object)
    ones = np.ones(count, dtype=np.intp)
    toolpath = Toolpath(
        "zigzag", np.where(number == 0, 0, 1).astype(np.uint8), number + 1, ones, 1e-3 * position,
        np.broadcast_to([0.02522428, -0.00054983, -0.99944426, 0.02178562], (count, 4)),
        np.broadcast_to(np.array([-1, -1, -1, 0]), (count, 4)), np.ones(count, dtype=bool), np.full((count, 6), np.nan),
        np.full((count, 6), np.nan), 0 * ones, 0 * ones, np.full(count, 0.045), np.full(count, 0.001), block,
        (ToolFrame("t", None, None),), (WorkObject("w", None, None),))
    return robot_path(toolpath, read_cell(HERE.parent / "samples" / "cell.yaml"))


def one(count: int, digits: int | None) -> None:
    plan = program(count, digits)
    import toppra  # noqa: F401 (its import is a second of its own)

    before = _memory("VmRSS")
    Path("/proc/self/clear_refs").write_text("5")       # the peak starts again
    clock = time.process_time()
    result = drive(plan)
    seconds = time.process_time() - clock
    each, kind = 1e6 * seconds / len(result.speed), "exact" if digits is None else "rounded"
    print(f"{count:9d} targets {len(result.speed):9d} grid points {seconds:8.2f} s of CPU, {each:6.1f} us a point, "
          f"{before:.0f} MB before, {_memory('VmHWM') - before:.0f} MB more at the peak, {kind}, {result.time[-1]:.1f} s of "
          "machining", flush=True)


def _memory(field: str) -> float:
    """A figure of this process [MB]."""
    lines = Path("/proc/self/status").read_text().splitlines()
    return float(next(line for line in lines if line.startswith(field)).split()[1]) / 1024


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("--largest", type=int, default=1_000_000)
    parser.add_argument("--one", type=int)
    parser.add_argument("--digits", type=int)
    chosen = parser.parse_args()
    if chosen.one:
        one(chosen.one, chosen.digits)
    else:
        for points in (10_000, 100_000, 1_000_000):
            for rounding in ([], ["--digits", "4"]):
                if points <= chosen.largest:
                    # Rows of 50 targets have about 72 grid points.
                    subprocess.run([sys.executable, __file__, "--one", str(int(points / 1.43)), *rounding], check=True)

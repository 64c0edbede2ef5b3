"""CPU seconds and peak memory of `diagnose` on long load tests: by how many rows a pose has, and by what is hidden in them.

    OPENBLAS_NUM_THREADS=1 python benchmarks/diagnose_time.py [ROWS] [--seed SEED] [--only CASE,...]

Springs 0.7 to 1.5 times the catalogue's, random poses and loads, readings of 2 um (sensor) and 3 um (re-seating), poses
labelled and timed. usual: 21 rows a pose; play, plays: of one gear, of two; single: one row a pose; long: 1000; hung: dead
weights, which turn no vertical axis, so that nobody knows on which side of its play that gear rests; kept: a quarter of the
poses is kept for validation. Prints what `diagnose` answers beside what it took; a case over ten minutes is ended, and said.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import threading
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from identification.fit.load_test import LoadTest
from identification.measurements import read_measurements
from identification.model.cell import read_cell
from identification.model.effects import effects
from tests.support import measurement_text, random_poses

ROOT = Path(__file__).resolve().parents[1]
CELL = """\
robot: irb6660-205-1.90
tool: {position_mm: [120, 0, 250]}
measurement: {deflection_std_um: [2, 2, 2], force_relative_std: 0.005, pose_offset_std_um: [3, 3, 3]}
"""
USUAL_LOADS, LONG = 21, 1000
LONGEST_S = 600


@dataclass(frozen=True)
class Case:
    """loads: rows a pose; half_gaps: half gap [rad] of each gear with play; hung: loads are weights; kept: for validation."""

    loads: int = USUAL_LOADS
    half_gaps: dict[int, float] = field(default_factory=dict)
    hung: bool = False
    kept: bool = False


ONE, TWO = {1: 1e-4}, {1: 1e-4, 2: 1e-4}
CASES = {
    "usual": Case(), "play": Case(half_gaps=ONE), "plays": Case(half_gaps=TWO), "single": Case(1), "single-play": Case(1, ONE),
    "long": Case(LONG), "long-play": Case(LONG, ONE), "hung": Case(half_gaps={4: 1e-4}, hung=True),
    "single-hung": Case(1, {4: 1e-4}, hung=True), "kept": Case(half_gaps=ONE, kept=True),
    "single-kept": Case(1, ONE, kept=True),
}


def write_rows(folder: Path, count: int, case: Case, seed: int) -> None:
    """cell.yaml and m.csv of such a load test."""
    (folder / "cell.yaml").write_text(CELL)
    cell = read_cell(folder / "cell.yaml")
    rng, visits = np.random.default_rng(seed), -(-count // case.loads)
    number = np.arange(count) // case.loads
    theta = random_poses(cell.robot, visits, rng, share=0.6)[number]
    wrench = np.concatenate([rng.uniform(-300, 300, (count, 3)), np.zeros((count, 3))], axis=1)
    if case.hung:
        wrench[:, :2], wrench[:, 2] = 0.0, -np.abs(wrench[:, 2])
    columns: dict[str, list[object]] = {
        "pose": [f"P{k + 1}" for k in number], "time_s": list(range(0, 30 * count, 30)), "dwell_s": [10] * count}
    if case.kept:
        columns["purpose"] = ["validate" if k % 4 == 3 else "identify" for k in number]
    (folder / "m.csv").write_text(measurement_text(theta, wrench, np.zeros((count, 3)), **columns))
    state = LoadTest.of(cell, read_measurements(folder / "m.csv", cell.robot)).load_state(
        1 / (cell.prior.stiffness * [0.7, 0.8, 0.9, 1.2, 1.1, 1.5]))
    moved = state.elastic + state.of_weight
    for joint, half_gap in case.half_gaps.items():
        moved = moved + effects()["backlash"].contribution(state, joint, np.array([half_gap, 0.7]))
    noise = 2 * rng.standard_normal((count, 3)) + 3 * rng.standard_normal((visits, 3))[number]
    (folder / "m.csv").write_text(measurement_text(theta, wrench, np.round(1e6 * moved[:, :3] + noise, 1), **columns))


def measured(folder: Path) -> tuple[str, float, float]:
    """What `diagnose` answers, its CPU seconds and its peak [MB]."""
    command = [sys.executable, "-m", "compstiff", "diagnose", "cell.yaml", "m.csv", "--json", "-o", "d.json"]
    with (folder / "said.json").open("w") as said:
        process = subprocess.Popen(command, cwd=folder, stdout=said, env={**os.environ, "PYTHONPATH": str(ROOT)})
        late = threading.Timer(LONGEST_S, process.kill)
        late.start()
        _, status, used = os.wait4(process.pid, 0)
        late.cancel()
    answer = f"not ended in {LONGEST_S} s" if status else answered(json.loads((folder / "d.json").read_text()))
    return answer, used.ru_utime + used.ru_stime, used.ru_maxrss / 1024


def answered(record: dict[str, Any]) -> str:
    """The verdict with its names."""
    names = (f"{cause['effect']}[{cause['joint']}]" if cause["joint"] else cause["effect"] for cause in record["causes"])
    return " ".join([record["verdict"], *names])


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("rows", nargs="?", type=int, default=100_000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", default=",".join(CASES))
    given = parser.parse_args()
    print(f"{given.rows} rows, seed {given.seed}\n{'case':<14}{'CPU [s]':>9}{'peak [MB]':>11}  answer")
    for name in given.only.split(","):
        with tempfile.TemporaryDirectory() as folder:
            write_rows(Path(folder), given.rows, CASES[name], given.seed)
            answer, seconds, peak = measured(Path(folder))
        print(f"{name:<14}{seconds:>9.1f}{peak:>11.0f}  {answer}", flush=True)


if __name__ == "__main__":
    main()

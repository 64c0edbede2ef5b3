"""Seconds of `identify` (fit alone, and the whole command) for few and many rows.

    python benchmarks/identify_time.py [ROWS ...]
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from identification.fit.fit import fit_stiffness
from identification.measurements import read_measurements
from identification.model.cell import read_cell
from identification.model.compliance import equilibrium
from tests.support import measurement_text, random_poses

CELL = """\
robot: irb6660-205-1.90
tool: {position_mm: [120, 0, 250]}
measurement: {deflection_std_um: [2, 2, 2], force_relative_std: 0.005, pose_offset_std_um: [3, 3, 3]}
"""


def main() -> None:
    print(f"{'rows':>8}{'fit [ms]':>12}{'command [s]':>14}")
    for count in [int(argument) for argument in sys.argv[1:]] or [15, 252, 100_000]:
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            (folder / "cell.yaml").write_text(CELL)
            cell = read_cell(folder / "cell.yaml")
            rng = np.random.default_rng(1)
            loads = 3 if count < 100 else 21
            theta = np.repeat(random_poses(cell.robot, -(-count // loads), rng, share=0.6), loads, axis=0)[:count]
            wrench = np.concatenate([rng.uniform(-300, 300, (count, 3)), np.zeros((count, 3))], axis=1)
            truth = cell.prior.stiffness * [0.7, 0.8, 0.9, 1.2, 1.1, 1.5]
            deflection = equilibrium(cell.robot, theta, cell.flange_from_tcp, wrench, 1 / truth).position
            noise = 2 * rng.standard_normal((count, 3)) + np.repeat(3 * rng.standard_normal((-(-count // loads), 3)), loads,
                                                                    axis=0)[:count]
            (folder / "m.csv").write_text(measurement_text(theta, wrench, 1e6 * deflection + noise))
            rows = read_measurements(folder / "m.csv", cell.robot)
            times = []
            for _ in range(5 if count < 10_000 else 1):
                start = time.perf_counter()
                fit_stiffness(cell, rows)
                times.append(time.perf_counter() - start)
            start = time.perf_counter()
            subprocess.run([sys.executable, "-m", "compstiff", "identify", "cell.yaml", "m.csv", "-o", "s.json", "-q"],
                           cwd=folder, check=True, capture_output=True)
            print(f"{count:>8}{1e3 * float(np.median(times)):>12.0f}{time.perf_counter() - start:>14.2f}")


if __name__ == "__main__":
    main()

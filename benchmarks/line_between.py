"""How far is the tool off between the targets of a corrected program?

    OMP_NUM_THREADS=1 python benchmarks/line_between.py [--robots NAME,NAME] [--noise N]

A path of 130 to 230 mm under a force of up to 260 N that rises over 12 mm, varies, and falls again, written as long MoveL,
short MoveL (3 mm), targets every millimetre, and MoveC; logged every 0.1 mm by path length, position and joint angles, and by
target. The program that `correct` writes is driven by tests/virtual_cell/controller.py, which shares no code with the
packages: straight lines, arcs, even turning, zones as parabolas, springs at the drives. Distance of the loaded tool across the
planned curve every half millimetre, largest / RMS [um]; in brackets the targets that were added; `said`: the largest that
`correct` prints.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from tests.runs.milling.line_job import ARCS, DENSE, LINES, SHORT, LineJob

ROBOTS = ("irb6660-205-1.90", "irb6700-200-2.60", "irb6640-235-2.55")
FORMS = {"long MoveL": LINES, "MoveL, 3 mm": SHORT, "MoveL, 1 mm": DENSE, "MoveC": ARCS}
LOGS = ("path_mm", "position", "joints", "target")
TOLERANCES = (2.0, 5.0, 20.0)


def cell(job: LineJob, by: str, tolerance: float) -> str:
    """One cell of the table."""
    off, result, _ = job.correct(by, "--tolerance", tolerance)
    figures = result["result"]
    said = "-" if figures["between_um"] is None else f"{figures['between_um']['largest']:.1f}"
    return f"{off.max():.1f} / {np.sqrt(np.mean(off**2)):.1f} (+{figures['added_targets']}), said {said}"


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--robots", default=",".join(ROBOTS))
    parser.add_argument("--noise", type=float, default=0.0, help="Scatter of the logged force [N].")
    options = parser.parse_args()
    for robot in options.robots.split(","):
        print(f"\n{robot}\n| form | not corrected | log | "
              + " | ".join(f"tolerance {value:g}" for value in TOLERANCES) + " | 5, --keep-targets |\n" + 7 * "|---" + "|")
        for form, path in FORMS.items():
            with tempfile.TemporaryDirectory() as folder:
                job = LineJob(Path(folder), path, robot, zone="z0", noise_n=options.noise)
                plain = f"{job.off_um(job.program).max():.0f}"
                for by in LOGS:
                    cells = [cell(job, by, value) for value in TOLERANCES]
                    kept, _, _ = job.correct(by, "--keep-targets")
                    print(f"| {form} | {plain} | {by} | {' | '.join(cells)} | {kept.max():.1f} |", flush=True)


if __name__ == "__main__":
    main()

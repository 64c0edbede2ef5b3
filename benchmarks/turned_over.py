"""One force axis turned over, or a mirrored part: how often it is told, by the other findings and by CS3125 and CS3126, and how
often right logs are doubted.

    python benchmarks/turned_over.py [--jobs 60] [--seed 0]

The jobs are those of columns.py (rasters and spirals; a slot, the wall of a pocket), with 5 N of noise and the cutter's own
axial force, times a factor between 0.3 and 1.5 (the shares of handbooks). The cell states a flat end mill.
"""

from __future__ import annotations

import argparse
import sys
from collections import Counter, defaultdict
from dataclasses import replace
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

import numpy as np

from benchmarks import cut_direction, passes
from benchmarks.columns import logs, warned
from compensator.forces.turned_over import said_of_axial, said_of_mirror
from compensator.path.robot_path import RobotPath
from identification.common.arrays import Array
from identification.model.cell_file import CuttingFile

FLIPS = {"right": (1, 1, 1), "x": (-1, 1, 1), "y": (1, -1, 1), "z": (1, 1, -1)}


def drawn(kind: str, rng: np.random.Generator, folder: Path) -> tuple[RobotPath, Array]:
    """A path and the force (N, 3) [N] on the tool, base frame."""
    if kind == "rasters and spirals":
        job = passes.drawn(rng)
        path, force = passes.written(job, folder, rng)[0], job.force() * rng.uniform(0.8, 1.2, (len(job.points), 1))
    else:
        path, force, _ = cut_direction.drawn(rng, folder)
    force[:, 2] *= rng.uniform(0.3, 1.5)
    path = replace(path, cell=replace(path.cell, cutting=CuttingFile(tool_diameter_mm=16, corner_radius_mm=0)))
    return path, force + np.any(force != 0, axis=1)[:, None] * rng.normal(0, 5, force.shape)


def main(jobs: int, seed: int) -> None:
    said: dict[str, Counter[str]] = defaultdict(Counter)
    flips = {name: lambda logged, signs=signs: logged * signs for name, signs in FLIPS.items()}
    for log in logs(jobs, seed, drawn, flips):
        codes = warned(log.said) or warned([*said_of_mirror(log.cuts, log.force, "log"),
                                            *said_of_axial(log.cuts, log.path, log.force, "log")])
        said[f"{log.kind}, {log.changed}"]["+".join(codes) or "silent"] += 1
        if log.changed == "right" and codes:
            print(f"right, {log.kind} {log.number}, {log.frame}: {codes}")
    for row, counts in said.items():
        print(f"{row}: {dict(counts)}")


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("--jobs", type=int, default=60)
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    main(arguments.jobs, arguments.seed)

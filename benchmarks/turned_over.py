"""One force axis turned over, or a mirrored part: how often it is told, by the other findings and by CS3125 and CS3126, and how
often right logs are doubted.

    python benchmarks/turned_over.py [--jobs 60] [--seed 0]

The jobs are those of columns.py (rasters and spirals; a slot, the wall of a pocket), with 5 N of noise and the cutter's own
axial force, times a factor between 0.3 and 1.5 (the shares of handbooks). The cell states a flat end mill.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections import Counter, defaultdict
from dataclasses import replace
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

import numpy as np

from benchmarks import cut_direction, passes
from compensator.forces.cut_direction import said_of_direction, travel
from compensator.forces.swapped_columns import swapped_columns
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
    with tempfile.TemporaryDirectory() as folder:
        for kind in ("rasters and spirals", "slot and pocket"):
            said: dict[str, Counter[str]] = defaultdict(Counter)
            for number in range(jobs):
                path, force = drawn(kind, np.random.default_rng((seed, number)), Path(folder))
                cuts = travel(path, np.any(force != 0, axis=1))
                if cuts is None:
                    continue
                axes = {"base": np.broadcast_to(np.eye(3), (len(force), 3, 3)), "tool": path.base_from_tcp.rotation}
                for frame, turned in axes.items():
                    for flip, signs in FLIPS.items():
                        logged = np.einsum("nji,nj->ni", turned, force) * signs
                        forces = {name: np.einsum("nij,nj->ni", one, logged) for name, one in axes.items()}
                        found = [*said_of_direction(cuts, forces, frame, "log"),
                                 *swapped_columns(cuts, forces[frame], turned, "log")]
                        before = [one.code for one in found if one.level == "warning"]
                        if not before:
                            found += [*said_of_mirror(cuts, forces[frame], "log"),
                                      *said_of_axial(cuts, path, forces[frame], "log")]
                        codes = sorted(one.code for one in found if one.level == "warning")
                        said[flip]["+".join(codes) or "silent"] += 1
                        if flip == "right" and codes:
                            print(f"right, {kind} {number}, {frame}: {codes}")
            for flip, counts in said.items():
                print(f"{kind}, {flip}: {dict(counts)}")


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("--jobs", type=int, default=60)
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    main(arguments.jobs, arguments.seed)

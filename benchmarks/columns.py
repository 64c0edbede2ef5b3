"""Force columns in another order: how often they are told, by which finding, and how often right ones are doubted.

    python benchmarks/columns.py [--jobs 100] [--seed 0]

The jobs are those of passes.py (rasters, spirals) and of cut_direction.py (a slot, the wall of a pocket), with an axial force
of either sign up to three times the cutter's and 5 N of noise; logged in the robot's axes and in the tool's.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections import Counter, defaultdict
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

import numpy as np

from benchmarks import cut_direction, passes
from compensator.forces.cut_direction import Travel, said_of_direction, travel
from compensator.forces.swapped_columns import swapped_columns
from compensator.path.robot_path import RobotPath
from identification.common.arrays import Array
from identification.common.findings import Finding

ORDERS = {"right": (0, 1, 2),
          "y x z": (1, 0, 2), "z y x": (2, 1, 0), "x z y": (0, 2, 1), "y z x": (1, 2, 0), "z x y": (2, 0, 1)}
Draw = Callable[[str, np.random.Generator, Path], tuple[RobotPath, Array]]


@dataclass(frozen=True, eq=False)
class Log:
    """The forces (N, 3) of a job as logged in one frame, with one thing changed, and what is said of their directions."""

    kind: str
    number: int
    frame: str
    changed: str
    path: RobotPath
    cuts: Travel
    force: Array
    said: list[Finding]


def logs(jobs: int, seed: int, drawn: Draw, changes: Mapping[str, Callable[[Array], Array]]) -> Iterator[Log]:
    """Of each kind of job so many, in the robot's axes and in the tool's, changed in each way before they are read."""
    with tempfile.TemporaryDirectory() as folder:
        for kind in ("rasters and spirals", "slot and pocket"):
            for number in range(jobs):
                path, force = drawn(kind, np.random.default_rng((seed, number)), Path(folder))
                cuts = travel(path, np.any(force != 0, axis=1))
                if cuts is None:
                    continue
                axes = {"base": np.broadcast_to(np.eye(3), (len(force), 3, 3)), "tool": path.base_from_tcp.rotation}
                for frame, turned in axes.items():
                    for changed, change in changes.items():
                        logged = change(np.einsum("nji,nj->ni", turned, force))
                        forces = {name: np.einsum("nij,nj->ni", one, logged) for name, one in axes.items()}
                        said = [*said_of_direction(cuts, forces, frame, "log"),
                                *swapped_columns(cuts, forces[frame], turned, "log")]
                        yield Log(kind, number, frame, changed, path, cuts, forces[frame], said)


def warned(findings: list[Finding]) -> list[str]:
    """The codes of the warnings among them."""
    return sorted(one.code for one in findings if one.level == "warning")


def drawn(kind: str, rng: np.random.Generator, folder: Path) -> tuple[RobotPath, Array]:
    """A path and the force (N, 3) [N] on the tool, base frame."""
    if kind == "rasters and spirals":
        job = passes.drawn(rng)
        path, force = passes.written(job, folder, rng)[0], job.force() * rng.uniform(0.8, 1.2, (len(job.points), 1))
        force[:, 2] *= rng.uniform(-1, 3)
    else:
        path, force, _ = cut_direction.drawn(rng, folder)
    return path, force + np.any(force != 0, axis=1)[:, None] * rng.normal(0, 5, force.shape)


def main(jobs: int, seed: int) -> None:
    said: dict[str, Counter[str]] = defaultdict(Counter)
    orders = {name: lambda logged, order=order: logged[:, order] for name, order in ORDERS.items()}
    for log in logs(jobs, seed, drawn, orders):
        codes = warned(log.said)
        said[f"{log.kind}, {log.changed}"]["+".join(codes) or "silent"] += 1
        if log.changed == "right" and codes:
            print(f"{log.kind} {log.number} in {log.frame}, right: {codes}")
    for row, counts in said.items():
        of, here = sum(counts.values()), sum(count for codes, count in counts.items() if "CS3078" in codes)
        print(f"{row}: told {of - counts['silent']} of {of}, CS3078 {here}: {dict(counts.most_common())}")


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("--jobs", type=int, default=100)
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    print(f"seed {arguments.seed}")
    main(arguments.jobs, arguments.seed)

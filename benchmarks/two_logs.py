"""Two logged passes of one job, one of them read wrongly: what is refused, what is said, and whether the right ones pass.

    python benchmarks/two_logs.py [--jobs 40] [--seed 31]

The jobs are those of benchmarks/cut_direction.py (the virtual cell's end mill in a slot and on the wall of a pocket). The
second pass has up to 15 % other forces throughout, 5 % from target to target, and noise; then one mistake.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections import Counter
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

import numpy as np

from benchmarks.cut_direction import drawn
from compensator.forces.log import ForceLog
from compensator.forces.target_forces import TargetForces
from compensator.forces.two_logs import compared
from identification.common.findings import CompstiffError


def forces(shown: np.ndarray, name: str) -> TargetForces:
    """Forces (N, 3) [N] as those of a log with 40 samples a target."""
    one, count = np.zeros(1), len(shown)
    log = ForceLog(name, np.zeros((1, 3)), np.zeros((1, 3)), False, "target", one, one.astype(np.intp), np.ones(1), None, None,
                   None, np.zeros((1, 6)), one.astype(bool))
    return TargetForces(np.column_stack([shown, np.zeros((count, 3))]), np.full(count, 40), np.full((count, 3), 1.0),
                        np.linalg.norm(shown, axis=1) > 5, None, (), log)


def main(jobs: int, seed: int) -> None:
    answers: dict[str, Counter[str]] = {}
    with tempfile.TemporaryDirectory() as folder:
        for number in range(jobs):
            rng = np.random.default_rng((seed, number))
            path, force, _ = drawn(rng, Path(folder))
            cuts = (np.linalg.norm(np.nan_to_num(force), axis=1) > 0)[:, None]
            force = np.nan_to_num(force)
            first = force + cuts * rng.normal(0, 1.5, force.shape)
            again = force * rng.uniform(0.9, 1.15) * (1 + 0.05 * rng.standard_normal(cuts.shape))
            again += cuts * rng.normal(0, 1.5, force.shape)
            for name, second in {
                    "the same cut": again, "sign": -again, "x and y swapped": again[:, [1, 0, 2]],
                    "turned by 90 deg": again[:, [1, 0, 2]] * [-1, 1, 1], "sign of z": again * [1, 1, -1],
                    "three targets further": np.roll(again, 3, axis=0), "100 N more": again + cuts * [0, 100, 0]}.items():
                try:
                    said = compared(forces(first, "one"), forces(second, "two"), path)
                    answer = "+".join(finding.code for finding in said if finding.level == "warning") or "agree"
                except CompstiffError as refused:
                    answer = f"refused {refused.findings[0].code}"
                answers.setdefault(name, Counter())[answer] += 1
    for name, count in answers.items():
        print(f"{name}: " + ", ".join(f"{number} {answer}" for answer, number in count.most_common()))


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("--jobs", type=int, default=40)
    parser.add_argument("--seed", type=int, default=31)
    arguments = parser.parse_args()
    main(arguments.jobs, arguments.seed)

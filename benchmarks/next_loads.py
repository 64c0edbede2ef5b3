"""How many further load cycles until the true name is certain? The loads `diagnose` asks for, beside D-optimal and random ones.

    OMP_NUM_THREADS=1 python benchmarks/next_loads.py [CASES] [FIRST_SEED] [--design DESIGN]

Cases: of the seeds FIRST_SEED … FIRST_SEED + CASES - 1 of benchmarks/hidden_effects.py (one effect of the dictionary, realistic
noise) those in which the answer is a set with the truth in it. To each, one cycle at one new pose is added at a time and all
is diagnosed again, until the truth is named or has more than 95 %, five times at most. `asked`: next_measurements' first;
`D-optimal`: of 120 random cycles the one that determines the six stiffnesses best; `random`: any of these.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from identification.diagnosis.diagnose import Diagnosis, diagnose
from identification.diagnosis.discrimination import CYCLE, candidate_rows
from identification.fit.fitted_model import response
from identification.measurements import read_measurements
from identification.model.cell import Cell, read_cell
from tests.runs.hidden_effects.cases import hidden_in
from tests.runs.hidden_effects.judge import label, truth_names
from tests.runs.hidden_effects.more_rows import measured_further
from tests.support import random_poses
from tests.virtual_cell.cell import Case, simulate

CERTAIN, MOST, CANDIDATES, FORCE_N = 0.95, 5, 40, 300.0
POLICIES = ("asked", "D-optimal", "random")


def diagnosed(case: Case) -> tuple[Cell, Diagnosis]:
    with tempfile.TemporaryDirectory() as folder:
        cell_file, file = case.write(folder)
        cell = read_cell(cell_file)
        return cell, diagnose(cell, read_measurements(file, cell.robot))


def certainty(case: Case, found: Diagnosis) -> float:
    """Probability of the hidden effect, 0 where the verdict names nothing."""
    (truth,) = truth_names(case.truth)
    if found.verdict not in ("named", "ambiguous"):
        return 0.0
    listed = {label(cause.effect.name, cause.joint): cause.probability for cause in (*found.alternatives, *found.causes)}
    return listed.get(truth, 0.0)


def chosen(policy: str, cell: Cell, found: Diagnosis, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Pose (6,) and loads (m, 3) of the next cycle. Where nothing is asked for, a random one."""
    poses = np.repeat(random_poses(cell.robot, CANDIDATES, rng, share=0.6), 3, axis=0)
    axes = np.tile(np.arange(3), CANDIDATES)
    which, forces = int(rng.integers(len(poses))), FORCE_N * np.array(CYCLE)
    if policy == "asked" and found.judgement.next_loads:
        asked = found.judgement.next_loads[0]
        return asked.theta, np.outer(asked.forces, np.eye(3)[asked.axis])
    if policy == "D-optimal":
        at = found.judgement.plain
        trial = at.data.with_rows(candidate_rows(poses, axes, FORCE_N))
        slope = response(trial, at.map)[1].reshape(len(poses), -1, 6)
        scaled = slope / (at.components.sensor * float(np.mean(cell.noise.deflection)))
        now = np.linalg.inv(at.laplace)
        which = int(np.argmax(np.linalg.slogdet(now + np.swapaxes(scaled, 1, 2) @ scaled)[1]))
    return poses[which], np.outer(forces, np.eye(3)[axes[which]])


def one(arguments: tuple[str, int]) -> tuple[str, dict[str, int | None]] | None:
    """The hidden label, and after how many cycles each policy is certain; None where the first answer is no set with it."""
    design, seed = arguments
    start = simulate(seed, design, hidden_in(seed, "single"))
    cell, first = diagnosed(start)
    if first.verdict != "ambiguous" or certainty(start, first) == 0.0:
        return None
    needed: dict[str, int | None] = {}
    for policy in POLICIES:
        rng = np.random.default_rng([seed, 7])
        case, found = start, first
        needed[policy] = None
        for count in range(1, MOST + 1):
            case = measured_further(case, *chosen(policy, cell, found, rng), rng)
            found = diagnosed(case)[1]
            if certainty(case, found) > CERTAIN:
                needed[policy] = count
                break
    return next(iter(truth_names(start.truth))), needed


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("cases", nargs="?", type=int, default=100, metavar="CASES")
    parser.add_argument("first", nargs="?", type=int, default=0, metavar="FIRST_SEED")
    parser.add_argument("--design", default="poses20", choices=("paper5", "poses20", "ladder12"))
    options = parser.parse_args()
    jobs = [(options.design, seed) for seed in range(options.first, options.first + options.cases)]
    with ProcessPoolExecutor(2) as pool:
        hard = [(seed, answer) for (_, seed), answer in zip(jobs, pool.map(one, jobs), strict=True) if answer is not None]
    for seed, (name, needed) in hard:
        print(f"  seed {seed} {name:<28}" + "  ".join(f"{policy} {needed[policy] or '-'}" for policy in POLICIES))
    print(f"{options.design}: {len(hard)} hard cases of {options.cases}")
    for policy in POLICIES:
        reached = [needed[policy] for _, (_, needed) in hard if needed[policy] is not None]
        within = "  ".join(f"{count}: {sum(r <= count for r in reached)}" for count in range(1, MOST + 1))
        print(f"  {policy:<10} certain within cycles  {within}  of {len(hard)}")


if __name__ == "__main__":
    main()

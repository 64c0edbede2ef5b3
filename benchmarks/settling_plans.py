"""Do the runs that `design --add N --diagnosis` plans settle a case more often than D-optimal or random ones?

    OMP_NUM_THREADS=1 python benchmarks/settling_plans.py [CASES] [FIRST_SEED] [--design DESIGN] [--runs N]

Cases: of the seeds FIRST_SEED … FIRST_SEED + CASES - 1 of benchmarks/hidden_effects.py (one effect of the dictionary, realistic
noise) those in which the answer is a set with the truth in it. Each policy plans N further runs at once, from the same random
pool of admissible ones (TCP in the box about the measured poses, load cycles of 300 N along one base axis); they are measured
in the virtual cell and all is diagnosed again. Settled: the truth is named, or has more than 95 %.
"""

from __future__ import annotations

import argparse
import sys
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from benchmarks.next_loads import CERTAIN, FORCE_N, certainty, diagnosed
from identification.design.criteria import d_criterion
from identification.design.discrimination import Diagnosed, discriminating_runs, rival_models
from identification.design.domain import Domain, Pool, random_pool
from identification.design.exchange import many_exchanges
from identification.design.information import instrument
from identification.design.loads import slot
from identification.design.request import measured_place
from identification.design.task import Task, free_demand
from identification.diagnosis.diagnose import Diagnosis
from identification.model.cell import Cell
from identification.model.kinematics import forward
from tests.runs.hidden_effects.cases import hidden_in
from tests.runs.hidden_effects.judge import truth_names
from tests.runs.hidden_effects.more_rows import measured_further
from tests.virtual_cell.cell import Case, simulate

POLICIES = ("settling", "D-optimal", "random")
POSES = 1000


def task_after(cell: Cell, found: Diagnosis, runs: int) -> Task:
    """D-optimal runs given what was measured, as `design --add` sets it up."""
    model = found.judgement.plain
    rig = instrument(cell, np.exp(model.mean))
    slots = tuple(slot(axis, "cycle", FORCE_N) for axis in "xyz")
    tcp = forward(cell.robot, found.judgement.rows.theta, cell.flange_from_tcp).position
    domain = Domain(rig, slots, *measured_place(tcp))
    return Task(domain, d_criterion(), np.linalg.inv(model.covariance), free_demand(3, runs))


def planned(policy: str, cell: Cell, found: Diagnosis, runs: int, rng: np.random.Generator) -> Pool:
    """The runs of a policy; where a few settle all that settling looks at, the others are D-optimal."""
    task = task_after(cell, found, runs)
    pool = random_pool(task.domain, POSES, rng)
    if policy == "random":
        return pool.take(rng.choice(len(pool), runs, replace=False))
    settling = pool.take(np.zeros(0, dtype=np.intp))
    if policy == "settling":
        told = Diagnosed(found.verdict, tuple((one.effect.name, one.joint) for one in found.alternatives),
                         tuple(bad.row for bad in found.judgement.bad_rows), "")
        rivals = rival_models(cell, found.judgement.rows, told)
        if len(rivals) > 1:
            settling = discriminating_runs(task, rivals, pool, rng)[0]
    left = runs - len(settling)
    if not left:
        return settling
    best = many_exchanges(replace(task, prior=task.information(settling), demand=free_demand(3, left)), pool, rng, 8)[0][0]
    return settling.joined(pool.take(best))


def settled_by(policy: str, case: Case, cell: Cell, found: Diagnosis, runs: int, seed: int) -> bool:
    """Whether the truth is certain once the policy's runs are measured."""
    rng = np.random.default_rng([seed, 8])
    plan = planned(policy, cell, found, runs, rng)
    loads = [slot(axis, "cycle", FORCE_N).forces for axis in "xyz"]
    for theta, kind in zip(plan.theta, plan.slot, strict=True):
        case = measured_further(case, theta, loads[kind], rng, (5.0, 20.0))
    return certainty(case, diagnosed(case)[1]) > CERTAIN


def one(arguments: tuple[str, int, int]) -> tuple[str, dict[str, bool]] | None:
    """The hidden label and which policies settle it; None where the first answer is no set with the truth in it."""
    design, seed, runs = arguments
    case = simulate(seed, design, hidden_in(seed, "single"))
    cell, found = diagnosed(case)
    if found.verdict != "ambiguous" or certainty(case, found) == 0.0:
        return None
    (truth,) = truth_names(case.truth)
    return truth, {policy: settled_by(policy, case, cell, found, runs, seed) for policy in POLICIES}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("cases", nargs="?", type=int, default=300, metavar="CASES")
    parser.add_argument("first", nargs="?", type=int, default=700000, metavar="FIRST_SEED")
    parser.add_argument("--design", default="poses20", choices=("paper5", "poses20", "ladder12"))
    parser.add_argument("--runs", type=int, default=1)
    options = parser.parse_args()
    jobs = [(options.design, seed, options.runs) for seed in range(options.first, options.first + options.cases)]
    hard = []
    with ProcessPoolExecutor(2) as pool:
        for (_, seed, _), answer in zip(jobs, pool.map(one, jobs), strict=True):
            if answer is not None:
                hard.append(answer[1])
                print(f"  seed {seed} {answer[0]:<28}" + "  ".join(f"{policy} {'yes' if answer[1][policy] else '-'}"
                                                                  for policy in POLICIES), flush=True)
    print(f"{options.design}, {options.runs} further runs: {len(hard)} hard cases of {options.cases}")
    for policy in POLICIES:
        print(f"  {policy:<10} settled {sum(answer[policy] for answer in hard)} of {len(hard)}")


if __name__ == "__main__":
    main()

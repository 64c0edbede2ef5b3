"""Commissioning with dead weights: what a plan is worth against random poses and against loads in three directions, and what
comes of it on the virtual cell.

    python benchmarks/dead_weights.py plans [--seed 0]
    python benchmarks/dead_weights.py cases [--first 9000] [--count 40]

plans: 1 sigma of ln k of each joint after 8 runs. cases: per kind `count` simulated commissionings of one plan
(`--dead-weight 20,40`, 3 poses never fitted): coverage of identify's 95 % intervals, and what diagnose says.
"""

from __future__ import annotations

import argparse
import sys
from collections import Counter
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from identification.design.domain import random_pool
from identification.design.plan import DesignPlan
from identification.design.procedure import design_plan
from identification.design.request import Request
from identification.design.sheet import as_measurements
from identification.diagnosis.diagnose import diagnose
from identification.fit.fit import fit_stiffness
from identification.measurements import read_measurements
from identification.model.cell import Cell, read_cell
from tests.virtual_cell.cell import Hidden, simulate
from tests.virtual_cell.designs import Design

RANDOM_PLANS = 200


def virtual_cell(seed: int) -> Cell:
    """A cell of the simulation."""
    with TemporaryDirectory() as folder:
        return read_cell(simulate(seed, "hung12").write(folder)[0])


def known(plan: DesignPlan) -> np.ndarray:
    return np.sqrt(np.diag(plan.design.covariance))


def in_words(std: np.ndarray) -> str:
    return " ".join(f"{100 * value:8.2f}" for value in std)


def plans(seed: int) -> None:
    cell = virtual_cell(seed)
    print(f"{'1 sigma of ln k [%]':<44}" + " ".join(f"{f'k{i}':>8}" for i in range(1, 7)))
    weights = {text: design_plan(cell, Request(dead_weight=text), seed=seed) for text in ("20,40", "20,20+20", "20,40,20+40")}
    for text, plan in weights.items():
        print(f"{f'--dead-weight {text}, {len(plan.sheet.visit)} rows':<44}{in_words(known(plan))}   efficiency at least "
              f"{100 * plan.design.certificate.efficiency:.1f} %")
    task, rng = weights["20,40"].design.task, np.random.default_rng([seed, 1])
    pool = random_pool(task.domain, 4000, rng)
    values, stds = [], []
    for _ in range(RANDOM_PLANS):
        drawn = pool.take(rng.choice(len(pool), len(task.demand), replace=False))
        values.append(task.value(drawn))
        stds.append(np.sqrt(np.diag(np.linalg.inv(task.information(drawn)))))
    ratio = task.value(weights["20,40"].design.runs) / np.array(values)
    print(f"{f'20,40 at random poses, median of {RANDOM_PLANS}':<44}{in_words(np.median(stds, axis=0))}   criterion of the plan "
          f"over theirs: median {np.median(ratio):.2f}, over the best of them {ratio.min():.2f}")
    for force in (300.0, 392.0):
        plan = design_plan(cell, Request(force_n=force), seed=seed)
        print(f"{f'three directions, +-{force:g} N, {len(plan.sheet.visit)} rows':<44}{in_words(known(plan))}")
    for one, label in weights["20,40"].unseen:
        print(f"k{one.joint}: one load of {np.linalg.norm(one.force):.0f} N over a pulley at {label}: "
              f"{100 * one.before:.0f} % -> {100 * one.after:.2f} %")


def cases(first: int, count: int) -> None:
    plan = design_plan(virtual_cell(first), Request(dead_weight="20,40", kept_back=3), seed=first)
    rows = as_measurements(plan.sheet)
    design = Design(rows.theta, rows.wrench[:, :3], rows.time, rows.dwell, rows.visit + 1, rows.validate)
    kinds = {"nothing hidden": (), "hook_offset": (Hidden("hook_offset"),), "swinging_weight": (Hidden("swinging_weight"),),
             "swinging_weight, twice": (Hidden("swinging_weight", None, 2.0),),
             "tool_point, twice": (Hidden("tool_point", None, 2.0),)}
    for kind, hidden in kinds.items():
        inside, said, unseen, off = np.zeros(6), Counter[str](), 0, []
        for seed in range(first, first + count):
            case = simulate(seed, design, hidden)
            with TemporaryDirectory() as folder:
                cell_file, file = case.write(folder)
                cell = read_cell(cell_file)
                measured = read_measurements(file, cell)
            fit, found = fit_stiffness(cell, measured), diagnose(cell, measured)
            interval = np.array(fit.model.interval_95)
            inside += (interval[:, 0] <= case.stiffness) & (case.stiffness <= interval[:, 1])
            off.append(np.abs(np.log(fit.model.stiffness / case.stiffness)))
            unseen += fit.model.grades[0] == "not identifiable"
            names = [cause["effect"] for cause in found.as_dict()["causes"] if "single_row" not in cause["parameters"]]
            said["+".join(names) if names else "a bad row" if found.verdict == "named" else found.verdict] += 1
        print(f"{kind}: {dict(said)}")
        print(f"  intervals that hold, k1 ... k6: {' '.join(f'{value:.0f}' for value in inside)} of {count}; k1 not "
              f"identifiable {unseen}; median error of k2 ... k6 {' '.join(f'{100 * x:.2f}' for x in np.median(off, axis=0)[1:])} %")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=["plans", "cases"])
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--first", type=int, default=9000)
    parser.add_argument("--count", type=int, default=40)
    options = parser.parse_args()
    if options.what == "plans":
        plans(options.seed)
    else:
        cases(options.first, options.count)


if __name__ == "__main__":
    main()

"""What a design is worth: efficiency and feasibility of plans against simpler ways to choose them, and seconds.

    python benchmarks/design.py [RUNS ...]

Efficiency is Phi of the plan over the certified bound on any plan with as many runs (D: (det M / det M*)^(1/6)), on the
IRB 6660 of the samples, load cycles of 300 N along one base axis a pose, one TCP position, with the prior; so each figure is a
lower limit. Medians over three seeds. exchange: one start on 300 sampled poses; one SQP: from one random plan.
"""

from __future__ import annotations

import os
import sys
import time
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")
ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

import numpy as np

from compensator.milling_poses import milling_poses
from identification.cell import read_cell
from identification.design.criteria import a_criterion, d_criterion, e_criterion, i_criterion
from identification.design.domain import Domain, random_pool
from identification.design.exchange import exchange, free_demand
from identification.design.information import instrument
from identification.design.loads import slot
from identification.design.milling import prediction_weight
from identification.design.procedure import Task, design
from identification.design.refine import refine
from identification.design.request import default_position

SEEDS = 3


def main(lengths: list[int]) -> None:
    """Prints the table."""
    cell = read_cell(ROOT / "samples" / "cell.yaml")
    rig = instrument(cell)
    slots = tuple(slot(axis, "cycle", 300.0) for axis in "xyz")
    domain = Domain(rig, slots, np.round(default_position(cell.robot)[None], 2))
    prior = np.eye(6) / cell.prior.log_std**2
    milling, _ = milling_poses(cell, ROOT / "samples" / "insert.mod", None)
    criteria = [d_criterion(), i_criterion(prediction_weight(rig, milling)), a_criterion(), e_criterion()]
    print(f"{'criterion':<10}{'runs':>5}{'random':>9}{'exchange':>10}{'one SQP':>9}{'feasible':>10}{'certified':>10}"
          f"{'by pool':>9}{'start [s]':>11}{'all [s]':>9}", flush=True)
    for count in lengths:
        for criterion in criteria:
            rows = np.array([_row(domain, criterion, prior, count, seed) for seed in range(SEEDS)])
            row = np.median(rows, axis=0)
            print(f"{criterion.name:<10}{count:>5}{row[0]:>9.3f}{row[1]:>10.3f}{row[2]:>9.3f}{row[3]:>9.0%} {row[4]:>9.3f}"
                  f"{row[5]:>9.3f}{row[6]:>11.2f}{row[7]:>9.1f}", flush=True)


def _row(domain, criterion, prior, count, seed):
    demand = free_demand(len(domain.slots), count)
    rng = np.random.default_rng(seed)
    begin = time.perf_counter()
    found = design(Task(domain, criterion, prior, demand), rng)
    seconds = time.perf_counter() - begin
    bound = found.certificate.bound
    pool = random_pool(domain, 300, rng)

    def value(runs):
        return float(criterion.value(prior + runs.information.sum(axis=0)))

    random = np.median([value(pool.take(rng.choice(len(pool), count))) for _ in range(300)])
    sampled = value(pool.take(exchange(pool, criterion, prior, demand, rng)[0]))
    begin = time.perf_counter()
    starts = [refine(domain, criterion, prior, pool.take(rng.choice(len(pool), count))) for _ in range(8)]
    each = (time.perf_counter() - begin) / 8
    feasible = [one.value for one in starts if one.feasible]
    return (random / bound, sampled / bound, np.median(feasible or [0.0]) / bound, len(feasible) / 8,
            found.certificate.efficiency, found.certificate.pool_efficiency, each, seconds)


if __name__ == "__main__":
    main([int(argument) for argument in sys.argv[1:]] or [5, 8, 12])

"""What a design is worth: efficiency and feasibility of plans against simpler ways to choose them, and seconds.

    python benchmarks/design.py [RUNS ...] [--seeds N] [--figaroh PYTHON] [--only efficiency|small|cordes|free]

Efficiency is Phi of the plan over the certified bound on any plan with as many runs (D: (det M / det M*)^(1/6)), on the
IRB 6660 of the samples, load cycles of 300 N along one base axis a pose, one TCP position, with the prior ("D no prior": with a
billionth of it); so each figure is a lower limit. Medians over the seeds. exchange: one start on 300 sampled poses; SOCP,
DetMax: figaroh's on the same poses (D only), where --figaroh names an interpreter that has it, nan where it did not end within
five minutes; one SQP: from one random plan.

small: the exchange against all plans of 3 runs out of 25. free: loads along any line against base axes. cordes: runs until
trace C_post of ln k is that of twelve full-pose measurements (position 2 um and rotation 10 urad, no re-seating error, one load
of 300 N along x, y or z in turn at twelve random poses in a box of 0.8 m about the place; median of 200 draws).
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from dataclasses import replace
from itertools import combinations_with_replacement
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")
ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))
LONGEST_S = 300

import numpy as np

from compstiff.poses_of_program import milling_poses
from identification.design.constraints import Margins
from identification.design.criteria import a_criterion, d_criterion, e_criterion, i_criterion
from identification.design.domain import TOLERANCE, Domain, random_pool
from identification.design.exchange import exchange, many_exchanges
from identification.design.information import instrument
from identification.design.loads import slot
from identification.design.milling import prediction_weight
from identification.design.refine import refine
from identification.design.request import default_position
from identification.design.search import QUICK, optimal_design
from identification.design.task import Task, free_demand
from identification.model.cell import read_cell
from identification.model.kinematics import jacobian


def main() -> None:
    """Prints the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("runs", nargs="*", type=int, default=[5, 8, 12])
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--figaroh", default=None)
    parser.add_argument("--only", choices=("efficiency", "small", "cordes", "free"), default=None)
    options = parser.parse_args()
    cell = read_cell(ROOT / "samples" / "cell.yaml")
    rig = instrument(cell)
    domain = Domain(rig, tuple(slot(axis, "cycle", 300.0) for axis in "xyz"), np.round(default_position(cell.robot)[None], 2))
    prior = np.eye(6) / cell.prior.log_std**2
    if options.only in (None, "efficiency"):
        efficiency(cell, domain, prior, options.runs, options.seeds, options.figaroh)
    if options.only in (None, "small"):
        small(domain, prior)
    if options.only in (None, "cordes"):
        cordes(domain, prior)
    if options.only in (None, "free"):
        free(domain, prior, options.runs[0])


def efficiency(cell, domain, prior, lengths, seeds, figaroh) -> None:
    milling = milling_poses(cell, ROOT / "samples" / "insert.mod", None)
    kinds = [("D", d_criterion(), prior), ("D no prior", d_criterion(), 1e-9 * prior),
             ("I", i_criterion(prediction_weight(domain.rig, milling)), prior), ("A", a_criterion(), prior),
             ("E", e_criterion(), prior)]
    names = ["random", "exchange", "SOCP", "DetMax", "one SQP", "feasible", "certified", "fractions", "by pool", "start [s]",
             "SOCP [s]", "DetM [s]", "all [s]"]
    print(f"{'criterion':<11}{'runs':>5}" + "".join(f"{name:>10}" for name in names), flush=True)
    for count in lengths:
        for name, criterion, before in kinds:
            rows = [_row(domain, criterion, before, count, seed, figaroh) for seed in range(seeds)]
            table = np.array(rows)
            ended = ~np.isnan(table).all(axis=0)
            row = np.full(len(names), np.nan)
            row[ended] = np.nanmedian(table[:, ended], axis=0)
            print(f"{name:<11}{count:>5}" + "".join(f"{value:>10.3f}" for value in row), flush=True)


def _row(domain, criterion, prior, count, seed, figaroh):
    task = Task(domain, criterion, prior, free_demand(len(domain.slots), count))
    rng = np.random.default_rng(seed)
    begin = time.perf_counter()
    found = optimal_design(task, rng)
    seconds = time.perf_counter() - begin
    bound = found.certificate.bound
    assert domain.excess(found.runs).max() <= TOLERANCE
    pool = random_pool(domain, 300, rng)

    random = np.median([task.value(pool.take(rng.choice(len(pool), count))) for _ in range(300)])
    sampled = task.value(pool.take(exchange(task, pool, rng)[0]))
    begin = time.perf_counter()
    starts = [refine(task, pool.take(rng.choice(len(pool), count))) for _ in range(8)]
    each = (time.perf_counter() - begin) / 8
    feasible = [one.value for one in starts if one.feasible]
    picked = _figaroh(figaroh, pool, prior, count) if figaroh and criterion.kind == "D" else {}
    theirs, took = [np.nan, np.nan], [np.nan, np.nan]
    if "SOCP" in picked:
        theirs[0], took[0] = task.value(pool.take(np.array(picked["SOCP"][0]))) / bound, picked["SOCP"][1]
    if "DetMax" in picked:
        theirs[1], took[1] = picked["DetMax"][0] / bound, picked["DetMax"][1]
    return (random / bound, sampled / bound, *theirs, np.median(feasible or [0.0]) / bound, len(feasible) / 8,
            found.certificate.efficiency, found.certificate.value / found.certificate.relaxed,
            found.certificate.pool_efficiency, each, *took, seconds)


def _figaroh(python, pool, prior, count):
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "pool.npz"
        np.savez(file, information=pool.information, prior=prior, count=count)
        call = [python, ROOT / "benchmarks" / "figaroh_pick.py", file]
        try:
            said = subprocess.run(call, capture_output=True, text=True, timeout=LONGEST_S, check=True).stdout
        except subprocess.TimeoutExpired as late:
            said = (late.stdout or b"").decode()
    found = {}
    for line in said.splitlines():
        if line.startswith("{"):
            found |= json.loads(line)
    return found


def small(domain, prior) -> None:
    """Exchange against all multisets of 3 of 25 runs."""
    rng = np.random.default_rng(5)
    pool = random_pool(domain, 1000, rng)
    for criterion in (d_criterion(), a_criterion(), e_criterion()):
        ratio = []
        for _ in range(5):
            few = pool.take(rng.choice(len(pool), 25, replace=False))
            every = np.array(list(combinations_with_replacement(range(25), 3)))
            best = criterion.value(prior + few.information[every].sum(axis=1)).max()
            rows = [one for one, _ in many_exchanges(Task(domain, criterion, prior, free_demand(3, 3)), few, rng, 20)]
            ratio.append(max(float(criterion.value(prior + few.information[one].sum(axis=0))) for one in rows) / best)
        print(f"small pools, {criterion.name}: exchange reaches {min(ratio):.4f} of the best of all {len(every)} plans")


def cordes(domain, prior) -> None:
    """Runs with one load each until the trace is that of twelve full-pose measurements."""
    rig, place = domain.rig, domain.positions[0]
    rng = np.random.default_rng(0)
    around = Domain(rig, tuple(slot(axis, "single", 300.0) for axis in "xyz"), None, np.stack([place - 0.4, place + 0.4]),
                    Margins(phi=None))
    pool = random_pool(around, 1500, rng)
    full = jacobian(rig.cell.robot, pool.theta, rig.cell.flange_from_tcp)
    force = 300.0 * np.eye(3)[pool.slot]
    told = full * (rig.compliance * np.einsum("nai,na->ni", full[:, :3], force))[:, None, :]
    carried = np.einsum("nai,i,nbi->nab", full, rig.compliance, full[:, :3])
    variance = rig.force**2 + (rig.relative * force) ** 2
    noise = np.diag(np.concatenate([rig.sensor, np.full(3, 1e-5)]) ** 2)
    noise = noise + np.einsum("nab,nb,ncb->nac", carried, variance, carried)
    pieces = np.swapaxes(told, 1, 2) @ np.linalg.solve(noise, told)
    by_slot = [np.flatnonzero(pool.slot == s) for s in range(3)]
    draws = [np.concatenate([rng.choice(mine, 4, replace=False) for mine in by_slot]) for _ in range(200)]
    traces = [np.trace(np.linalg.inv(prior + pieces[one].sum(axis=0))) for one in draws]
    print(f"cordes: twelve full-pose measurements, trace of C_post of ln k {np.median(traces):.3g} "
          f"({np.quantile(traces, 0.1):.3g} ... {np.quantile(traces, 0.9):.3g})")
    for protocol in ("single", "cycle"):
        here = replace(domain, slots=tuple(slot(axis, protocol, 300.0) for axis in "xyz"))
        for count in range(2, 13):
            found = optimal_design(Task(here, a_criterion(), prior, free_demand(3, count)), np.random.default_rng(1), QUICK)
            trace = float(np.trace(found.covariance))
            print(f"  {count} runs ({protocol}): trace {trace:.3g}", flush=True)
            if trace <= np.median(traces):
                break


def free(domain, prior, count) -> None:
    """Loads along any line."""
    for criterion in (d_criterion(), a_criterion(), e_criterion()):
        axis = optimal_design(Task(domain, criterion, prior, free_demand(3, count)), np.random.default_rng(0), QUICK)
        other = replace(domain, slots=(slot("free", "cycle", 300.0),))
        any_line = optimal_design(Task(other, criterion, prior, free_demand(1, count)), np.random.default_rng(0), QUICK)
        ratio = any_line.certificate.value / axis.certificate.value
        print(f"free lines, {criterion.name}, {count} runs: {ratio:.2f} times the criterion of base axes, "
              f"certified {any_line.certificate.efficiency:.3f}", flush=True)


if __name__ == "__main__":
    main()

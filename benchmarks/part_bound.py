"""What could any correction take away whose targets stand no nearer to each other than a controller takes them?

    OMP_NUM_THREADS=1 python benchmarks/part_bound.py [ROBOTS] [FIRST_SEED] [--jobs NAME ...]

Nothing of compstiff is asked. The force on a tool that stands on the plan, and how far the virtual cell's arm yields to it, say
what offset each place of the path wants, every 0.05 mm. Straight lines between targets follow that as well as they can by least
squares: between the targets of the program, and with further ones as near to each other as the rows say; none is moved beside
which nothing is cut. Such a correction needs all that no log tells; what a real one leaves more is its own.

Gone: of the RMS off plan without correction, of all, without the sharp corner, and there alone. Unlike milling_loop.py's, which
takes one place every half millimetre, the figures are of the whole path, between the targets too.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.sparse import csr_matrix, identity
from scipy.sparse.linalg import spsolve

sys.path.insert(0, str(Path(__file__).parents[1]))

from benchmarks.part_jobs import JOBS
from tests.runs.milling.milling_job import MillingJob
from tests.virtual_cell.milled_part import AIR, PLACES, Part, Steps
from tests.virtual_cell.milling import engagement, mill, planned

NAMES = ("1.5 mm", "0.5 mm", "0.5 mm, thin")
STEP_MM = 0.05
NEAREST_MM = (np.inf, 0.25, 0.125, 0.05)
SHARP = PLACES.index("sharp corner")
STILL = 1e-9        # of a target that no place asks for


@dataclass(frozen=True)
class Wanted:
    """At the steps of a path: the offset (S, 3) [um] that puts the tool on the plan, before (S, 3) [um] how far it is off
    without, and cut (S,): in either pass there is a force."""

    steps: Steps
    offset: np.ndarray
    before: np.ndarray
    cut: np.ndarray


def wanted(job: MillingJob) -> Wanted:
    first = mill(job.case.plant, job.part, job.planned, job.cutter, step_mm=STEP_MM)
    steps, on_plan = first.steps, np.zeros_like(first.force_n)
    plan = steps.between(job.part.target_mm)
    for i in np.flatnonzero(steps.feature != AIR):
        local = job.cutter.mean_force(*engagement(job.part, steps, job.cutter, int(i), plan[i]))
        (x, y), left = steps.feed[i], steps.left[i, :2]
        on_plan[i] = [*(local[0] * np.array([x, y]) + local[1] * left), local[2]]
    held = mill(job.case.plant, job.part, planned(job.part), job.cutter, on_plan, step_mm=STEP_MM)
    return Wanted(steps, -held.off_um, first.off_um, first.cutting | on_plan.any(axis=1))


def targets(part: Part, one: Wanted, nearest_mm: float) -> tuple[np.ndarray, np.ndarray]:
    """Path lengths (K,) [mm] of the targets with those that are added, and which may move (K,)."""
    own = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(part.target_mm, axis=0), axis=1)))
    cuts = np.bincount(one.steps.segment, one.cut, minlength=len(own)) > 0
    place, moves = [own[:1]], [cuts[1:2]]
    for i in range(1, len(own)):
        pieces = max(int((own[i] - own[i - 1]) / nearest_mm + 1e-6), 1) if cuts[i] else 1
        place.append(np.linspace(own[i - 1], own[i], pieces + 1)[1:])
        moves.append(np.append(np.ones(pieces - 1, dtype=bool), cuts[i] or cuts[min(i + 1, len(own) - 1)]))
    return np.concatenate(place), np.concatenate(moves)


def left(one: Wanted, place: np.ndarray, moves: np.ndarray) -> np.ndarray:
    """Off the plan (S, 3) [um] with the best offsets of targets at these path lengths (K,) [mm]."""
    at = np.cumsum(one.steps.length_mm) - 0.5 * one.steps.length_mm
    before = np.clip(np.searchsorted(place, at) - 1, 0, len(place) - 2)
    share = (at - place[before]) / np.diff(place)[before]
    rows = np.arange(len(at))
    lines = csr_matrix((np.concatenate([1 - share, share]), (np.tile(rows, 2), np.concatenate([before, before + 1]))),
                       shape=(len(at), len(place)))[:, np.flatnonzero(moves)]
    weighted = lines.multiply((np.sqrt(one.steps.length_mm) * one.cut)[:, None]).tocsr()
    square = (weighted.T @ weighted + STILL * identity(weighted.shape[1])).tocsc()
    best = [spsolve(square, weighted.T @ (np.sqrt(one.steps.length_mm) * axis)) for axis in one.offset.T]
    return np.asarray(lines @ np.column_stack(best) - one.offset)


def gone(one: Wanted, off: np.ndarray, where: np.ndarray) -> float:
    here = one.cut & where
    after, before = (np.sum(values[here] ** 2 * one.steps.length_mm[here, None]) for values in (off, one.before))
    return 100 - 100 * float(np.sqrt(after / before))


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("robots", type=int, nargs="?", default=1)
    parser.add_argument("first_seed", type=int, nargs="?", default=400)
    parser.add_argument("--jobs", nargs="*", default=list(NAMES), choices=list(JOBS))
    options = parser.parse_args()
    print("Gone at most: all / without the sharp corner / there\n| job, robot | "
          + " | ".join("own targets" if np.isinf(mm) else f"every {mm:g} mm" for mm in NEAREST_MM) + " |\n" + 5 * "|---" + "|")
    for name in options.jobs:
        for seed in range(options.first_seed, options.first_seed + options.robots):
            with tempfile.TemporaryDirectory() as folder:
                job = MillingJob(Path(folder), seed, part=JOBS[name].part, cutter=JOBS[name].cutter)
                one = wanted(job)
            sharp = one.steps.place == SHARP
            cells = []
            for mm in NEAREST_MM:
                off = left(one, *targets(job.part, one, mm))
                cells.append(" / ".join(f"{gone(one, off, where):.1f}" for where in (np.ones_like(sharp), ~sharp, sharp)))
            print(f"| {name}, {seed} | {' | '.join(cells)} |", flush=True)


if __name__ == "__main__":
    main()

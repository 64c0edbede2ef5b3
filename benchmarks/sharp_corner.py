"""What can a correction take away at a sharp corner, where one target serves two forces? Chip by chip, zones driven.

    OMP_NUM_THREADS=1 python benchmarks/sharp_corner.py [ROBOTS] [FIRST_SEED] [--workers N] [--best]

The corner of the pocket's wall in the virtual cell, driven by its own controller (straight lines, zones as parabolas, at the
feed) and milled by tests/virtual_cell/corner_cut.py, in which a chip needs its time; the log of the corner is that of the same
pass without correction, the springs are the true ones. Rows: as `correct` writes it, with --tighten-zones, and either with a
second target at the corner in place of the one: the offset asked for before it, then that behind it, with the program's zone
and with stop points; and the third pass, by the log of the second. --best: the most that the targets of the second pass could
do, their offsets about the corner found by least squares on the milled walls, which no log shows. Walls over 10 mm before and
behind the corner: gone of the RMS error, cut too deep and left at most.
"""

from __future__ import annotations

import argparse
import re
import sys
import tempfile
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from benchmarks.part_jobs import JOBS, PartJob
from tests.runs.milling.milling_job import Correction, MillingJob, rms, settings
from tests.virtual_cell.controller import drive, legs_of
from tests.virtual_cell.corner_cut import AT, INSTANTS, CornerPass, mill_corner
from tests.virtual_cell.milling import BASE_FROM_OBJECT, Commands, angles, planned

NAMES = ("1.5 mm", "0.5 mm", "0.5 mm, thin")
AROUND_MM, LOGGED_MM = 13.0, 11.0
FREE_MM, SMALL_STEP_MM = 4.2, 0.01


def compliance(job: MillingJob) -> np.ndarray:
    """(3, 3) [mm/N] of the arm at the corner, work object."""
    at = Commands(np.tile([*AT, job.part.target_mm[:, 2].min()], (4, 1)), planned(job.part).turn[:4])
    force = 100 * np.vstack([np.zeros(3), np.eye(3)])
    off, _ = job.case.plant.pushed(angles(at, job.case.plant), np.arange(4.0), lambda i, moved: force[i])
    moved = BASE_FROM_OBJECT.apply(off[1:] - off[0], inverse=True)
    return np.asarray(10 * moved.T @ BASE_FROM_OBJECT.as_matrix())


def way(rapid: str) -> np.ndarray:
    """Where a program commands the tool about the corner (m, 2) [mm], z left out."""
    flat = drive(legs_of(rapid), 0.02).position[:, :2]
    near = np.flatnonzero(np.abs(flat - AT).max(axis=1) < AROUND_MM)
    return flat[near[0]:near[-1] + 1]


def log_of(job: MillingJob, done: CornerPass) -> Path:
    """The log of the whole pass, base frame, of the corner that of the pass chip by chip: means over a revolution."""
    head, *rows = job.perfect_log("mean.csv").read_text().splitlines()
    body = np.array([row.split(",") for row in rows], dtype=float)
    turn = INSTANTS * job.cutter.teeth
    mean = np.column_stack([np.convolve(axis, np.ones(turn) / turn, mode="valid") for axis in done.force_n.T])
    first = turn // 2
    place = done.commanded_mm[first:first + len(mean)]
    z = job.part.target_mm[:, 2].min()
    mine = np.column_stack([place, np.full(len(place), z), BASE_FROM_OBJECT.apply(mean)])
    mine = mine[np.abs(place - AT).max(axis=1) < LOGGED_MM]
    there = np.flatnonzero((np.abs(body[:, :2] - AT).max(axis=1) < LOGGED_MM) & (np.abs(body[:, 2] - z) < 1e-6))
    both = np.concatenate([body[:there[0]], mine, body[there[-1] + 1:]])
    log = job.folder / "chips.csv"
    log.write_text("\n".join([head, *(",".join(f"{value:.9g}" for value in row) for row in both)]) + "\n")
    return log


def with_two_targets(found: Correction, stop: bool) -> str:
    """The program with two targets at the corner, one for each force."""
    plan, offset = found.part.target_mm, found.commands.position_mm - found.part.target_mm
    corner = int(np.argmin(np.linalg.norm(plan[:, :2] - AT, axis=1)))
    lines = found.job.content.decode().splitlines()
    row = [number for number, line in enumerate(lines) if line.strip().startswith("Move")][corner]
    line = re.sub(r",z0(\\Z:=[0-9.]+)?,", ",fine,", lines[row]) if stop else lines[row]
    places = (",".join(f"{value:.4f}" for value in plan[corner] + offset[beside]) for beside in (corner - 1, corner + 1))
    both = [re.sub(r"\[\[[^\]]*\]", f"[[{place}]", line, count=1) for place in places]
    return "\n".join([*lines[:row], *both, *lines[row + 1:]])


def corrected(job: MillingJob, log: Path, **chosen: Any) -> Correction:
    """By the true springs and a log without error."""
    return job.correct(log, job.springs("true.json", job.case.stiffness), settings(tare=(), **chosen), job.cell_in_base())


def programs(job: MillingJob, wanted: PartJob, log: Path) -> Iterator[tuple[str, str]]:
    """The rows of the second pass."""
    for name, tighten in (("corrected", False), ("--tighten-zones", True)):
        found = corrected(job, log, depth_of_cut=1e-3 * wanted.depth_mm, tighten_zones=tighten)
        yield name, found.job.content.decode()
        yield f"{name}, two targets", with_two_targets(found, stop=False)
        yield f"{name}, two stop points", with_two_targets(found, stop=True)


def best(found: Correction, walls: Callable[[str], np.ndarray], rounds: int = 3) -> np.ndarray:
    """What the walls (n,) [um] have left with the best offsets in x and y of the targets about the corner: Levenberg and
    Marquardt, slopes by small steps."""
    near = np.flatnonzero((np.abs(found.part.target_mm[:, :2] - AT) < FREE_MM).all(axis=1) & (found.part.target_mm[:, 2] < 0))
    lines, place = found.job.content.decode().splitlines(), found.commands.position_mm
    rows = np.array([number for number, line in enumerate(lines) if line.strip().startswith("Move")])

    def left(more: np.ndarray) -> np.ndarray:
        written = list(lines)
        for target, offset in zip(near, more.reshape(-1, 2), strict=True):
            pose = ",".join(f"{value:.4f}" for value in place[target] + [*offset, 0.0])
            written[rows[target]] = re.sub(r"\[\[[^\]]*\]", f"[[{pose}]", written[rows[target]], count=1)
        return walls("\n".join(written))

    offsets, damping = np.zeros(2 * len(near)), 1.0
    off = left(offsets)
    for _ in range(rounds):
        slopes = np.column_stack([(left(offsets + SMALL_STEP_MM * one) - off) / SMALL_STEP_MM for one in np.eye(len(offsets))])
        square = slopes.T @ slopes
        for _ in range(4):
            scale = damping * np.diag(np.diag(square) + 1e-2 * np.trace(square) / len(square))
            tried = offsets - np.linalg.solve(square + scale, slopes.T @ off)
            if rms(now := left(tried)) < rms(off):
                offsets, off, damping = tried, now, 0.2 * damping
                break
            damping *= 5
    return off


def robot(arguments: tuple[str, int, bool]) -> list[tuple[str, float, float, float]]:
    """Gone [%], cut too deep and left at most [um], by row."""
    name, seed, and_best = arguments
    wanted = replace(JOBS[name], cutter=replace(JOBS[name].cutter, runout_mm=(0.0, 0.0, 0.0)))
    with tempfile.TemporaryDirectory() as folder:
        job = MillingJob(Path(folder), seed, part=wanted.part, cutter=wanted.cutter)
        soft = compliance(job)

        def walls(rapid: str) -> tuple[CornerPass, np.ndarray]:
            done = mill_corner(way(rapid), job.part, job.cutter, soft)
            return done, done.walls_um

        first, before = walls(job.program.read_text())

        def row(words: str, left: np.ndarray) -> tuple[str, float, float, float]:
            return words, 100 - 100 * rms(left) / rms(before), float(left.max()), float(-left.min())

        log = log_of(job, first)
        rows = [row("as planned", before), *(row(words, walls(rapid)[1]) for words, rapid in programs(job, wanted, log))]
        found = corrected(job, log, depth_of_cut=1e-3 * wanted.depth_mm)
        second, _ = walls(found.job.content.decode())
        again = corrected(job, log_of(job, second), logged_with=job.offsets(found, "offsets1.csv"))
        rows.append(row("third pass, --logged-with", walls(again.job.content.decode())[1]))
        if and_best:
            rows.append(row("the second pass's targets, best offsets", best(found, lambda rapid: walls(rapid)[1])))
        return rows


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("robots", type=int, nargs="?", default=3)
    parser.add_argument("first_seed", type=int, nargs="?", default=18600)
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--best", action="store_true", help="Also what the best offsets leave; a minute a robot and job.")
    parser.add_argument("--jobs", nargs="*", default=list(NAMES), choices=list(JOBS))
    options = parser.parse_args()
    seeds = range(options.first_seed, options.first_seed + options.robots)
    with ProcessPoolExecutor(options.workers) as pool:
        for name in options.jobs:
            every = list(pool.map(robot, [(name, seed, options.best) for seed in seeds]))
            print(f"\n{name}; robots {seeds[0]} to {seeds[-1]}\n| | gone of the walls, RMS | cut too deep at most [um] | "
                  "left at most |\n|---|---|---|---|")
            for rows in zip(*every, strict=True):
                gone, deep, left = (", ".join(f"{row[k]:.{1 if k == 1 else 0}f}" for row in rows) for k in (1, 2, 3))
                print(f"| {rows[0][0]} | {gone} | {deep} | {left} |", flush=True)


if __name__ == "__main__":
    main()

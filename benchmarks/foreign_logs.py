"""Logs of other jobs with time alone, tried on programs they do not belong to: how many are believed; and how many right ones.

    python benchmarks/foreign_logs.py [--runs 40] [--right 10] [--seed 0] [--job JOB ...]

Turning, drilling, pocketing, face milling, rasters of other parts and a log of one long cut; besides the sample's own log
played backwards or with its passes shuffled. Each is stretched to between a third of the program's time and three times
that, perhaps cut, scaled to 20 to 900 N, and given bias, drift and noise. Programs: the sample's, a raster of equal passes,
a pocket, and one straight cut. Then the sample's log on revisions of its program: passes over air, other feeds, other
lengths; and logs of the very program, driven not quite as planned, some from the middle, with passes that cut by up to 30 %
more or less.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent.parent))

import numpy as np

from benchmarks.time_placement import clock, raster, sample, words
from compensator.forces.program_time import ProgramTime, program_time
from compensator.forces.time_alignment import align

RATE = 100.0
Log = tuple[np.ndarray, np.ndarray]


def played(parts: list[tuple[float, np.ndarray]]) -> Log:
    """Time (M,) [s] and force (M, 3) of parts, each so many seconds of a force (3,) or, from start to end, (2, 3)."""
    forces = []
    for seconds, force in parts:
        count = max(int(seconds * RATE), 1)
        ends = np.broadcast_to(np.atleast_2d(force), (2, 3)) if np.ndim(force) == 1 else force
        share = np.linspace(0, 1, count)[:, None]
        forces.append((1 - share) * ends[0] + share * ends[1])
    joined = np.concatenate(forces)
    return np.arange(len(joined)) / RATE, joined


def _unit(rng: np.random.Generator) -> np.ndarray:
    vector = rng.standard_normal(3)
    return np.asarray(vector / np.linalg.norm(vector))


def turning(rng: np.random.Generator) -> Log:
    """Cuts along and across a shaft, each of a steady force that grows a little, returns in air between them."""
    parts = [(rng.uniform(1, 10), np.zeros(3))]
    along, across, equal = _unit(rng), _unit(rng), rng.uniform(2, 20)
    for number in range(int(rng.integers(1, 30))):
        force = along if number % 3 else across
        parts += [(equal * rng.uniform(0.7, 1.0), np.array([force, rng.uniform(1, 1.2) * force])),
                  (rng.uniform(0.3, 3), np.zeros(3))]
    return played(parts)


def drilling(rng: np.random.Generator) -> Log:
    """Holes: equal pulses of thrust, evenly spaced."""
    cut, air = rng.uniform(0.5, 8), rng.uniform(0.5, 4)
    thrust = _unit(rng)
    return played([(rng.uniform(1, 8), np.zeros(3))] + int(rng.integers(5, 80)) * [(cut, thrust), (air, np.zeros(3))])


def facing(rng: np.random.Generator) -> Log:
    """Passes to and fro that grow or shrink by a little from one to the next."""
    there, back, grows = _unit(rng), _unit(rng), rng.uniform(0.97, 1.03)
    cut, air = rng.uniform(1, 10), rng.uniform(0.3, 2)
    parts = [(rng.uniform(1, 8), np.zeros(3))]
    for number in range(int(rng.integers(5, 70))):
        parts += [(cut * grows**number, there if number % 2 else back), (air, np.zeros(3))]
    return played(parts)


def pocketing(rng: np.random.Generator) -> Log:
    """Rings, four sides each, the force turning with the feed, level by level."""
    parts = [(rng.uniform(1, 8), np.zeros(3))]
    lag, rings = rng.uniform(0, 2 * np.pi), int(rng.integers(2, 8))
    for _ in range(int(rng.integers(1, 6))):
        for ring in range(rings):
            for side in range(4):
                angle = 0.5 * np.pi * side + lag
                parts.append(((1 + side % 2) * (1 + ring) * 0.5, np.array([np.cos(angle), np.sin(angle), -0.2])))
        parts.append((rng.uniform(1, 4), np.zeros(3)))
    return played(parts)


def another_raster(rng: np.random.Generator) -> Log:
    """A raster of another part: other numbers and lengths of passes, leads and ways back, as a log of it would have them."""
    passes = int(rng.integers(6, 40))
    cut, lead, back = rng.uniform(1, 6), rng.uniform(0.1, 1.5), rng.uniform(0.3, 4)
    there = _unit(rng)
    other = -there if rng.random() < 0.5 else there
    parts = [(rng.uniform(1, 6), np.zeros(3))]
    for number in range(passes):
        longer = 1 + 0.02 * rng.standard_normal()
        parts += [(lead, np.zeros(3)), (cut * longer, there if number % 2 else other), (lead + back, np.zeros(3))]
    return played(parts)


def one_cut(rng: np.random.Generator) -> Log:
    """One long cut of a steady or unsteady force."""
    count = int(rng.integers(20, 200))
    level = _unit(rng) + rng.choice([0.0, 0.1, 0.3]) * rng.standard_normal((count, 3))
    return played([(rng.uniform(1, 8), np.zeros(3)), *((0.5, force) for force in level), (rng.uniform(1, 8), np.zeros(3))])


def of_the_sample(change: Callable[[np.ndarray, np.random.Generator], np.ndarray]) -> Callable[[np.random.Generator], Log]:
    """The sample's own log, its rows changed."""
    def log(rng: np.random.Generator) -> Log:
        force = sample()[1][::15]
        return np.arange(len(force)) / RATE, change(force, rng)
    return log


def _shuffled(force: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    pieces = np.array_split(force, int(rng.integers(8, 40)))
    return np.concatenate([pieces[i] for i in rng.permutation(len(pieces))])


JOBS: dict[str, Callable[[np.random.Generator], Log]] = {
    "turning": turning, "drilling": drilling, "facing": facing, "pocketing": pocketing, "one cut": one_cut,
    "another raster": another_raster,
    "the sample's backwards": of_the_sample(lambda force, _: force[::-1]), "the sample's shuffled": of_the_sample(_shuffled)}


def foreign(job: str, duration: float, rng: np.random.Generator) -> Log:
    """A log of a job, stretched to a third of `duration` [s] to three times that, perhaps cut, scaled, with a sensor's bias,
    drift and noise."""
    logged, force = JOBS[job](rng)
    logged = logged * duration * np.exp(rng.uniform(-np.log(3), np.log(3))) / logged[-1]
    if rng.random() < 0.4:
        first, last = (rng.uniform([0, 0.6], [0.4, 1]) * len(logged)).astype(int)
        logged, force = logged[first:last], force[first:last]
    force = force * np.exp(rng.uniform(np.log(20), np.log(900))) / np.quantile(np.linalg.norm(force, axis=1), 0.95)
    scatter = np.exp(rng.uniform(np.log(0.5), np.log(10)))
    force = force + rng.normal(0, 5, 3) + np.linspace(0, 1, len(force))[:, None] * rng.normal(0, 3, 3)
    return logged + rng.uniform(0, 100), force + scatter * rng.standard_normal(force.shape)


def pocket() -> ProgramTime:
    """Rings of a pocket, two levels, entered and left once a level."""
    points, air = [[0.0, 0, 0.05]], [True]
    for level in range(2):
        points.append([0.0, 0.0, -2e-3 * level])
        air.append(True)
        for ring in range(1, 6):
            for x, y in ((1, -1), (1, 1), (-1, 1), (-1, -1)):
                points.append([0.012 * ring * x, 0.008 * ring * y, -2e-3 * level])
                air.append(False)
        points.append([0.0, 0.0, 0.05])
        air.append(True)
    return _program(np.array(points), np.array(air))


def one_line() -> ProgramTime:
    """One straight cut of half a metre."""
    return _program(np.array([[0, 0, 0.05], [0, 0, 0], [0.5, 0, 0], [0.5, 0, 0.05]]), np.array([True, True, False, True]))


def _program(points: np.ndarray, air: np.ndarray) -> ProgramTime:
    step = np.diff(points, axis=0)
    size = np.linalg.norm(step, axis=1)
    direction = np.concatenate([np.zeros((1, 3)), step / size[:, None]])
    return ProgramTime(np.append(0, np.cumsum(size / np.where(air[1:], 0.25, 0.03))), np.append(0, np.cumsum(size)), air,
                       np.zeros(len(points), dtype=np.intp), direction)


def own(program: ProgramTime, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Time, force and true path length of a log of the program: its moves up to 5 % slow, the force a constant and a linear
    function of the direction, by up to 30 % other from cut to cut, behind lead-ins; a quarter of the logs lacks a part."""
    duration = np.diff(program.time, prepend=0.0) * (1 + 0.05 * rng.random(len(program.time))) / rng.uniform(0.6, 1.1)
    reached = np.cumsum(duration)
    logged = np.arange(-rng.uniform(0.5, 8), reached[-1] + rng.uniform(0.5, 8), 1 / RATE)
    place = np.interp(logged, reached, program.length)
    move = np.clip(np.searchsorted(reached, logged), 1, len(reached) - 1)
    law, lead = rng.standard_normal((4, 3)) * [[1.0], [0.7], [0.7], [0.7]], rng.uniform(0, 0.012)
    force = np.zeros((len(logged), 3))
    for first, last in program.stretches:
        cut = (place > program.length[first] + lead) & (place < program.length[last] - lead)
        cut &= (logged > 0) & (logged < reached[-1])
        felt = law[0] + program.direction[move[cut]] @ law[1:]
        force[cut] = rng.uniform(0.7, 1.3) * felt
    force *= np.exp(rng.uniform(np.log(50), np.log(600))) / np.quantile(np.linalg.norm(force, axis=1), 0.95)
    force += rng.normal(0, 5, 3) + np.linspace(0, 1, len(force))[:, None] * rng.normal(0, 3, 3)
    force += 0.02 * np.linalg.norm(force, axis=1).max() * rng.standard_normal(force.shape)
    part = slice(None)
    if rng.random() < 0.25:
        part = slice(*(rng.uniform([0, 0.7], [0.2, 1]) * len(logged)).astype(int))
    return logged[part] + rng.uniform(0, 100), force[part], place[part]


def revisions(program: ProgramTime, rng: np.random.Generator) -> dict[str, ProgramTime]:
    """Programs of the same part that were not the one that ran."""
    number = np.cumsum(np.append(0, np.diff(program.air.astype(int)) != 0))
    step, length = np.diff(program.time, prepend=0.0), np.diff(program.length, prepend=0.0)

    def changed(factor: np.ndarray, of_length: np.ndarray) -> ProgramTime:
        return replace(program, time=np.cumsum(step * factor), length=np.cumsum(length * of_length))

    cuts = np.unique(number[~program.air])
    gone = np.isin(number, rng.choice(cuts, 4, replace=False))
    slower = np.where(program.kind == rng.integers(0, 3), rng.choice([0.6, 1.5]), 1.0)
    lengths = np.where(program.air, 1.0, rng.uniform(0.85, 1.15, number.max() + 1)[number])
    half = np.where(program.time > rng.uniform(0.3, 0.7) * program.time[-1], rng.choice([0.75, 1.3]), 1.0)
    return {"four passes over air": replace(program, air=program.air | gone),
            "feeds changed": changed(slower, np.ones(len(number))),
            "passes 15 % longer or shorter": changed(lengths, lengths),
            "second part at another feed": changed(half, np.ones(len(number)))}


def main(runs: int, right: int, seed: int, jobs: list[str]) -> None:
    plan, force, place = sample()
    programs = {"sample": program_time(plan), "raster": raster(), "pocket": pocket(), "one line": one_line()}
    believed: dict[str, list[bool]] = {}
    for number in range(runs):
        rng = np.random.default_rng((seed, number))
        job = jobs[number % len(jobs)]
        name = ("sample", "raster", "pocket", "one line")[int(rng.choice(4, p=[0.4, 0.2, 0.2, 0.2]))]
        before = time.process_time()
        alignment = align(programs[name], *foreign(job, programs[name].duration, rng))
        believed.setdefault(job, []).append(alignment.believed)
        print(f"{job} on {name}: {words(alignment)}; {time.process_time() - before:.1f} s of CPU", flush=True)
    for job, yes in believed.items():
        print(f"{job}: {sum(yes)} of {len(yes)} placed")
    print(f"foreign logs placed: {sum(map(sum, believed.values()))} of {runs}")
    rng = np.random.default_rng((seed, 10_000))
    logged = clock(plan, place, 0.9, 10, 0.3)[::10]
    for _ in range(max(runs // 40, 1)):
        for name, program in revisions(programs["sample"], rng).items():
            alignment = align(program, logged, force[::10])
            print(f"the sample's log on a revision, {name}: {words(alignment)}", flush=True)
    for name, program in programs.items():
        placed = []
        for number in range(right):
            rng = np.random.default_rng((seed, 20_000, number))
            logged, force, place = own(program, rng)
            alignment = align(program, logged, force)
            placed.append(alignment.believed)
            off = 1e3 * np.abs(alignment.length - place)
            print(f"right log, {name}: {words(alignment)}; error median {np.nanmedian(off):.1f} mm, "
                  f"95 % {np.nanquantile(off, 0.95):.1f} mm; {'; '.join(alignment.against)}", flush=True)
        print(f"right logs of {name} placed: {sum(placed)} of {right}")


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("--runs", type=int, default=40)
    parser.add_argument("--right", type=int, default=10)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--job", action="append", choices=list(JOBS), help="These alone.")
    arguments = parser.parse_args()
    main(arguments.runs, arguments.right, arguments.seed, arguments.job or list(JOBS))

"""Placing a force log by time alone: error, coverage of the stated sigma, and what is refused.

    python benchmarks/time_placement.py [--runs 12]
    python benchmarks/time_placement.py --passes 40 100 300 1000 [--targets 98] [--seed 0]

The sample's force log (a milling model's, samples/cutting.py) loses its positions; its clock is shifted by seconds, the
override set between 60 and 110 %, the robot slows down by up to 70 % within 6 mm of corners over 20 degrees (not what the
package assumes of corners), and noise is added. The truth is the place in the sample's own log. Wrong programs: the sample's
passes with other lengths, and a raster of 20 passes that are alike, logged whole and in part.

--passes: programs of so many passes to and fro, 40 to 160 mm long, every seventh across, with so many targets each; every pass
and every air move is driven 2 % (1 sigma) faster or slower than planned. Their logs, and each on the program of another seed.
"""

from __future__ import annotations

import argparse
import sys
import time
from dataclasses import replace
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent.parent))

import numpy as np
import pyarrow.parquet as pq

from compensator.forces.program_time import ProgramTime, program_time
from compensator.forces.time_alignment import TimeAlignment, align
from compensator.path.robot_path import RobotPath, robot_path
from compensator.rapid import read_rapid
from identification.model.cell import read_cell

SAMPLES = Path(__file__).parent.parent / "samples"


def sample() -> tuple[RobotPath, np.ndarray, np.ndarray]:
    """RobotPath; force (M, 3) [N] and true path length (M,) [m] of the sample's log."""
    program = SAMPLES / "insert.mod"
    plan = robot_path(read_rapid(program.read_bytes(), program.name).toolpath, read_cell(SAMPLES / "cell.yaml"))
    table = pq.read_table(SAMPLES / "insert.forces.parquet")
    force = np.column_stack([table[f"f{axis}_n"].to_numpy() for axis in "xyz"]).astype(float)
    length = plan.length
    feed_time = np.cumsum(np.diff(length, prepend=0.0) / plan.toolpath.feed)
    return plan, force, np.interp(table["time_s"].to_numpy(), feed_time, length)


def clock(plan: RobotPath, place: np.ndarray, override: float, shift: float, slowing: float) -> np.ndarray:
    """Time (M,) [s] at the places (M,) [m]."""
    length = plan.length
    step = np.diff(plan.base_from_tcp.position, axis=0)
    step /= np.linalg.norm(step, axis=1)[:, None]
    corner = np.degrees(np.arccos(np.clip(np.sum(step[1:] * step[:-1], axis=1), -1, 1)))
    grid = np.linspace(0, length[-1], 200_000)
    share = np.ones(len(grid))
    for target in np.flatnonzero(corner > 20) + 1:
        near = slice(*np.searchsorted(grid, length[target] + np.array([-0.05, 0.05])))      # beyond it is less than a rounding
        dip = slowing * min(corner[target - 1] / 90, 1) * np.exp(-(((grid[near] - length[target]) / 6e-3) ** 2))
        share[near] = np.minimum(share[near], 1 - dip)
    feed_time = np.interp(grid, length, np.cumsum(np.diff(length, prepend=0.0) / plan.toolpath.feed))
    taken = np.diff(feed_time) / (0.5 * (share[1:] + share[:-1])) / override
    return shift + np.interp(place, grid, np.concatenate([[0.0], np.cumsum(taken)]))


def other_lengths(program: ProgramTime, rng: np.random.Generator) -> ProgramTime:
    """Each stretch and each air move longer or shorter by up to a half."""
    number = np.cumsum(np.append(0, np.diff(program.air.astype(int)) != 0))
    factor = rng.uniform(0.5, 1.5, number.max() + 1)[number]
    return replace(program, time=np.cumsum(np.diff(program.time, prepend=0.0) * factor),
                   length=np.cumsum(np.diff(program.length, prepend=0.0) * factor))


def raster(passes: int = 20) -> ProgramTime:
    """Straight passes of 100 mm that are alike, all in one direction, 10 mm of lead in and out."""
    points, air = [], []
    for row in range(passes):
        points += [[x, 5e-3 * row, z] for x, z in ((-0.01, 0.05), (-0.01, 0.0), (0.11, 0.0), (0.11, 0.05))]
        air += [True, True, False, True]
    step = np.diff(np.array(points), axis=0)
    size = np.linalg.norm(step, axis=1)
    speed = np.where(air[1:], 0.25, 0.03)
    direction = np.concatenate([np.zeros((1, 3)), step / size[:, None]])
    return ProgramTime(np.append(0, np.cumsum(size / speed)), np.append(0, np.cumsum(size)), np.array(air),
                   np.zeros(len(points), dtype=np.intp), direction)


def passes(count: int, targets: int, rng: np.random.Generator) -> ProgramTime:
    """Passes to and fro of 40 to 160 mm, 5 mm apart, every seventh across, with so many targets each."""
    points, air = [], []
    for row in range(count):
        along = np.linspace(-0.5, 0.5, targets) * rng.uniform(0.04, 0.16) * (-1) ** row
        cut = np.zeros((targets, 3))
        cut[:, 1] = 5e-3 * row
        cut[:, int(row % 7 == 6)] += along
        lifted = cut + np.array([0, 0, 0.05])
        points += [lifted[:1], cut, lifted[-1:]]
        air += [True, True, *[False] * (targets - 1), True]
    step = np.diff(np.concatenate(points), axis=0, prepend=points[0])
    size = np.linalg.norm(step, axis=1)
    return ProgramTime(np.cumsum(size / np.where(air, 0.25, 0.03)), np.cumsum(size), np.array(air),
                       np.zeros(len(size), dtype=np.intp), step / np.maximum(size, 1e-9)[:, None])


def passes_log(program: ProgramTime, rng: np.random.Generator, override: float = 0.9) -> tuple[np.ndarray, ...]:
    """Time, force and true path length of a log of such a program, 50 Hz."""
    number = np.cumsum(np.append(0, np.diff(program.air.astype(int)) != 0))
    driven = (1 + 0.02 * rng.standard_normal(number.max() + 1))[number]
    reached = np.cumsum(np.diff(program.time, prepend=0.0) * driven) / override
    time = np.arange(0, reached[-1], 1 / 50)
    leg = np.clip(np.searchsorted(reached, time), 1, len(reached) - 1)
    force = [-60.0, 70, -15] + program.direction[leg] @ np.array([[40.0, 30, 0], [-30, 40, 0], [0, 0, 10]])
    force *= ~program.air[leg][:, None] * (1 + 0.1 * rng.standard_normal((len(time), 1)))
    return (time + rng.uniform(0, 50), force + [2, -3, 4] + 5 * rng.standard_normal(force.shape),
            np.interp(time, reached, program.length))


def raster_log(program: ProgramTime, rng: np.random.Generator, first: float, last: float) -> tuple[np.ndarray, ...]:
    """Time, force and true path length of a log of the raster from `first` to `last` share of its time; 3 s of air behind."""
    rate, override = 200, 0.9
    end = program.time[-1] + 3 if last == 1 else last * program.time[-1]
    planned = np.arange(first * program.time[-1], end, override / rate)
    leg = np.clip(np.searchsorted(program.time, planned), 1, len(program.time) - 1)
    place = np.interp(planned, program.time, program.length)
    engaged = ~program.air[leg] & (place - program.length[leg - 1] > 0.011) & (program.length[leg] - place > 0.009)
    engaged &= planned < program.time[-1]
    force = engaged[:, None] * (np.array([-60.0, 70, -15]) * (1 + 0.1 * rng.standard_normal((len(planned), 1))))
    return (planned / override + rng.uniform(0, 50), force + [2, -3, 4] + 3 * rng.standard_normal(force.shape),
            np.where(planned <= program.time[-1], place, np.nan))


def stood_still(
    program: ProgramTime, time: np.ndarray, force: np.ndarray, place: np.ndarray, share: float, seconds: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The log with `seconds` of standstill in the first air move behind `share` of it: time, force, true path length."""
    leg = np.clip(np.searchsorted(program.length, place), 0, len(program.air) - 1)
    first = int(np.flatnonzero(program.air[leg] & (np.arange(len(place)) > share * len(place)))[0])
    count = int(seconds * 1500)
    rest = time[first] + (np.arange(count) + 1) / 1500
    return (np.concatenate([time[:first + 1], rest, time[first + 1:] + seconds]),
            np.concatenate([force[:first + 1], np.tile(force[:first + 1][:500].mean(axis=0), (count, 1)), force[first + 1:]]),
            np.concatenate([place[:first + 1], np.full(count, place[first]), place[first + 1:]]))


def words(alignment: TimeAlignment) -> str:
    verdict = "placed" if alignment.believed else "refused"
    return (f"share {alignment.share:.2f}, score {alignment.score:7.1f}, {len(alignment.odd)} odd, {verdict}; "
            f"override {100 * alignment.override:.1f} %, 1 sigma {1e3 * np.median(alignment.std):.0f} ms, "
            f"{1e3 * alignment.spread_on_cuts:.1f} mm on cuts; {100 * alignment.beyond_plateau:.0f} % beyond a plateau, in air "
            f"{100 * alignment.in_air:.0f} %")


def main(runs: int) -> None:
    plan, force, place = sample()
    program = program_time(plan)
    errors, within = [], []
    for seed in range(runs):
        rng = np.random.default_rng(seed)
        override, shift, slowing = rng.uniform(0.6, 1.1), rng.uniform(-5, 60), rng.uniform(0, 0.7)
        logged = clock(plan, place, override, shift, slowing)
        first, last = (0, len(logged)) if seed % 3 else sorted((rng.uniform([0, 0.6], [0.3, 1]) * len(logged)).astype(int))
        part = slice(first, last)
        before = time.process_time()
        alignment = align(program, logged[part], force[part] + 5 * rng.standard_normal(force[part].shape))
        spent = time.process_time() - before
        good = ~np.isnan(alignment.length)
        off = 1e3 * np.abs(alignment.length - place[part])[good]
        taken, true = (np.interp(where, program.length, program.time) for where in (alignment.length, place[part]))
        late = np.abs(taken - true)
        if alignment.believed:
            errors.append(off)
            within.append(np.mean(late[good] <= 1.96 * alignment.std[good]))
        print(f"override {100 * override:5.1f} %, corners slowed by {100 * slowing:2.0f} %, "
              f"{'part' if seed % 3 == 0 else 'whole'}: {words(alignment)}; error [mm] median {np.median(off):.2f}, "
              f"95 % {np.quantile(off, 0.95):.2f}, {100 * np.mean(late[good] <= 1.96 * alignment.std[good]):.0f} % within "
              f"1.96 sigma; {spent:.1f} s of CPU", flush=True)
    every = np.concatenate(errors)
    print(f"placed {len(errors)} of {runs}: error median {np.median(every):.2f} mm, 95 % {np.quantile(every, 0.95):.2f} mm, "
          f"largest {every.max():.1f} mm; {100 * np.mean(within):.1f} % within 1.96 sigma")
    rng = np.random.default_rng(99)
    logged = clock(plan, place, 0.9, 10, 0.5)
    for _ in range(4):
        print("another program (other lengths):", words(align(other_lengths(program, rng), logged, force)), flush=True)
    print("another program (raster):", words(align(raster(), logged, force)), flush=True)
    logged = clock(plan, place, 0.9, 5, 0.3)
    for share, seconds in ((0.05, 6), (0.1, 6), (0.3, 20), (0.5, 8), (0.8, 5), (0.5, 2)):
        times, values, truth = stood_still(program, logged, force, place, share, seconds)
        alignment = align(program, times, values)
        print(f"stood still for {seconds} s at {100 * share:.0f} %: {words(alignment)}; error 95 % "
              f"{1e3 * np.nanquantile(np.abs(alignment.length - truth), 0.95):.1f} mm", flush=True)
    for first, last in ((0.0, 1.0), (0.1, 1.0), (0.2, 0.7)):
        times, values, truth = raster_log(raster(), rng, first, last)
        alignment = align(raster(), times, values)
        off = 1e3 * np.abs(alignment.length - truth)
        print(f"raster of equal passes, {first:g} to {last:g} of it logged: {words(alignment)}; error median "
              f"{np.nanmedian(off):.2f} mm", flush=True)


def many_passes(counts: list[int], targets: int, seed: int) -> None:
    """Long programs, each with its own log and with that of another."""
    for count in counts:
        program, other = (passes(count, targets, np.random.default_rng((seed, count, k))) for k in (0, 1))
        for name, driven in (("its own log", program), ("the log of another", other)):
            logged, force, place = passes_log(driven, np.random.default_rng((seed, count, 2)))
            before = time.process_time()
            alignment = align(program, logged, force)
            off = f"; error [mm] median {1e3 * np.nanmedian(np.abs(alignment.length - place)):.2f}, 95 % " \
                  f"{1e3 * np.nanquantile(np.abs(alignment.length - place), 0.95):.2f}" if driven is program else ""
            print(f"{len(program.time)} targets in {count} passes, {name} of {len(logged)} samples: {words(alignment)}{off}; "
                  f"{time.process_time() - before:.1f} s of CPU; {'; '.join(alignment.against)}", flush=True)


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("--runs", type=int, default=12)
    parser.add_argument("--passes", type=int, nargs="*", default=[])
    parser.add_argument("--targets", type=int, default=98)
    parser.add_argument("--seed", type=int, default=0)
    chosen = parser.parse_args()
    if chosen.passes:
        many_passes(chosen.passes, chosen.targets, chosen.seed)
    else:
        main(chosen.runs)

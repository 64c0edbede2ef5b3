"""Does `left_um` say how far the tool is off the plan on the part? By job, pass, place and cause, in the virtual cell.

    OMP_NUM_THREADS=1 python benchmarks/left_on_part.py [ROBOTS] [FIRST_SEED] [--workers N] [--jobs NAME ...]
                                                        [--arms NAME ...]

What cell.yaml states as unknown of a cell is drawn at that size, a cell each: the sensor's gain (force_log.gain_std, 1 %) and
how much more or less the moving robot gives way than at rest (motion.compliance_std, 2 %), evenly over their distribution
(`cells`), so that few robots stand for all. All else is as in benchmarks/milling_loop.py: robots drawn, load-tested and
identified, a part milled, logged, corrected, milled again, and the third pass by the log of the second. --arms: robots of the
second cell instead, in turn (tests/runs/milling/another_arm.py), a line for each.

within: share of the steps of half a millimetre that cut, within 2 sigma of `left_um`: plateau (slot, walls, arcs), entries
(ends of the slot, roll in and out), corners (rolled and sharp); worst and best robot. By cause: root mean square [um] stated,
and what is really left of that cause, the others switched off: the force of the first pass held (cut), the robot as at rest and
the sensor's gain 1 (sensor, motion), the true springs and a log without error (model, scatter); the rest is between targets.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
from scipy.stats import norm

sys.path.insert(0, str(Path(__file__).parents[1]))

from benchmarks.part_jobs import JOBS
from compensator.correction.expected_left import CAUSES
from tests.runs.milling.another_arm import PLACES as ARMS
from tests.runs.milling.another_arm import AnotherArmJob
from tests.runs.milling.learning_job import ErringJob
from tests.runs.milling.milling_job import Correction, rms, settings
from tests.virtual_cell.milled_part import PLACES
from tests.virtual_cell.milling import Pass, Sensor

GAIN_STD, MOTION_STD = 0.01, 0.02  # as cell.yaml has them where it says nothing
EVERY = 4  # robot is looked at by cause
GROUPS = {
    "plateau": ("slot", "straight wall", "arc"),
    "entry": ("slot ends", "roll in and out"),
    "corner": ("rolled corner", "sharp corner"),
}


@dataclass(frozen=True)
class Seen:
    """One program milled: off, std (S,) [um] at the steps that cut, stated (C, S) by cause, group (S,)."""

    name: str
    off: np.ndarray
    std: np.ndarray
    stated: np.ndarray
    group: np.ndarray


@dataclass(frozen=True)
class Result:
    seen: list[Seen]
    real: dict[str, np.ndarray]  # what the pass of the first row truly leaves (S,) [um], by cause
    before: float
    arm: str | None


def group_of(place: np.ndarray) -> np.ndarray:
    found = np.full(len(place), -1)
    for number, places in enumerate(GROUPS.values()):
        found[np.isin(place, [PLACES.index(name) for name in places])] = number
    return found


def seen(name: str, job: ErringJob, made: Correction, done: Pass) -> Seen:
    first = job.first_with(made.part)
    cut = first.cutting | done.cutting
    stated = np.zeros((len(CAUSES), len(made.part.target_mm)))
    stated[:, made.job.correction.targets] = [1e6 * getattr(made.job.left, cause) for cause in CAUSES]
    return Seen(
        name,
        np.linalg.norm(done.off_um, axis=1)[cut],
        first.steps.between(made.left_um)[cut],
        np.array([first.steps.between(each)[cut] for each in stated]),
        group_of(first.steps.place)[cut],
    )


def left_by_cause(
    job: ErringJob, made: Correction, done: Pass, calm: ErringJob, calm_made: Correction, perfect: Correction
) -> dict[str, np.ndarray]:
    """What each cause truly leaves at the steps of the pass `done` that cut."""
    first = job.first_with(made.part)
    cut = first.cutting | done.cutting

    def held(cell: ErringJob, one: Correction) -> np.ndarray:
        # The steps of the same path in the same places, whatever targets were added.
        force = cell.first_with(one.part)
        off = cell.mill(one.commands, force.force_n, part=one.part)
        along = np.cumsum(off.steps.length_mm)
        wanted = np.cumsum(first.steps.length_mm)
        return np.column_stack([np.interp(wanted, along, axis) for axis in off.off_um.T])

    mine, without, exact = held(job, made), held(calm, calm_made), held(calm, perfect)
    return {
        name: np.linalg.norm(each, axis=1)[cut]
        for name, each in (
            ("cut", done.off_um - mine),
            ("sensor, motion", mine - without),
            ("model, scatter", without - exact),
            ("between", exact),
        )
    }


def robot(arguments: tuple[str, str | None, int, float, float, bool]) -> Result | None:
    """One cell; None: its arm is so soft that the simulated cut finds no balance with it."""
    try:
        return milled(*arguments)
    except RuntimeError:
        return None


def milled(name: str, arm: str | None, seed: int, gain: float, motion: float, causes: bool) -> Result:
    wanted = JOBS[name]
    job_of = ErringJob if arm is None else partial(AnotherArmJob, arm=arm)
    with tempfile.TemporaryDirectory() as folder:
        part, cutter = wanted.part, wanted.cutter
        job = job_of(Path(folder), seed, part=part, cutter=cutter, motion=motion, sensor=Sensor(gain=gain))
        stiffness = job.identify()
        log = job.log(job.first, job.planned, "pass1.csv")
        cell = job.cell_with("cell_cut.yaml", wanted.cut_yaml)
        found = job.correct(log, stiffness)
        second = job.mill(found.commands, part=found.part)
        pass2 = job.log(second, found.commands, "pass2.csv", part=found.part)
        offsets = job.offsets(found, "offsets1.csv")
        rows = [seen("pass 2, nothing stated", job, found, second)]
        for words, made in (
            ("pass 2, depth stated", job.correct(log, stiffness, settings(depth_of_cut=1e-3 * wanted.depth_mm))),
            ("pass 2, material stated", job.correct(log, stiffness, cell=cell)),
            ("pass 3, --logged-with", job.correct(pass2, stiffness, settings(logged_with=offsets))),
            ("pass 3, both passes", job.correct(pass2, stiffness, settings(logged_with=offsets, first_forces=log))),
        ):
            rows.append(seen(words, job, made, job.mill(made.commands, part=made.part)))
        before, real = rms(np.linalg.norm(job.first.off_um, axis=1)[job.first.cutting]), {}
        if not causes:
            return Result(rows, real, before, arm)
        with tempfile.TemporaryDirectory() as other:
            calm = job_of(Path(other), seed, part=part, cutter=cutter, motion=1.0, sensor=Sensor(gain=1.0))
            calm_made = calm.correct(calm.log(calm.first, calm.planned, "pass1.csv"), stiffness)
            perfect = calm.correct(
                calm.perfect_log("perfect.csv"),
                calm.springs("true.json", calm.case.stiffness),
                settings(tare=()),
                calm.cell_in_base(),
            )
            real = left_by_cause(job, found, second, calm, calm_made, perfect)
        return Result(rows, real, before, arm)


def cells(count: int, seed: int) -> list[tuple[float, float]]:
    """Gain and factor in motion of so many cells. A softer robot and a sensor that shows too little act alike: what they do
    together stands at the middles of equal shares of its distribution, what they do against each other too, in other order."""
    levels = norm.ppf((np.arange(count) + 0.5) / count)
    size = np.hypot(GAIN_STD, MOTION_STD)
    along, across = levels, levels[np.random.default_rng(seed).permutation(count)]
    gain = (-GAIN_STD * along + MOTION_STD * across) / size
    motion = (MOTION_STD * along + GAIN_STD * across) / size
    return [(1 + GAIN_STD * one, 1 + MOTION_STD * other) for one, other in zip(gain, motion, strict=True)]


def within(one: Seen, group: int | None = None) -> float:
    where = slice(None) if group is None else one.group == group
    return 100 * float(np.mean(one.off[where] <= 2 * one.std[where]))


def print_job(name: str, every: list[Result | None]) -> None:
    results = [result for result in every if result is not None]
    before = np.mean([result.before for result in results])
    print(
        f"\n{name}, {len(results)} of {len(every)} robots; off before {before:.0f} um RMS\n"
        "| | within 2 sigma: all (worst, best robot) | "
        f"{' | '.join(GROUPS)} | median off, stated [um] | RMS off, stated [um] | gone |\n"
        + 8 * "|---" + "|"
    )
    for number, row in enumerate(results[0].seen):
        each = [result.seen[number] for result in results]
        shares = [within(one) for one in each]
        gone = [100 - 100 * rms(one.off) / result.before for one, result in zip(each, results, strict=True)]
        groups = [f"{np.mean([within(one, group) for one in each]):.1f}" for group in range(len(GROUPS))]
        print(
            f"| {row.name} | {np.mean(shares):.1f} ({min(shares):.0f}, {max(shares):.0f}) | {' | '.join(groups)} | "
            f"{np.mean([np.median(one.off) for one in each]):.1f}, {np.mean([np.median(one.std) for one in each]):.1f} | "
            f"{np.mean([rms(one.off) for one in each]):.1f}, {np.mean([rms(one.std) for one in each]):.1f} | "
            f"{np.mean(gone):.1f} % |"
        )
    for arm in dict.fromkeys(result.arm for result in results if result.arm):
        mine = [result for result in results if result.arm == arm]
        shares = [np.mean([within(result.seen[number]) for result in mine]) for number in range(len(mine[0].seen))]
        gone = [100 - 100 * np.mean([rms(result.seen[number].off) / result.before for result in mine]) for number in (2, 4)]
        print(f"{arm}, {len(mine)}: within 2 sigma {', '.join(f'{share:.1f}' for share in shares)} %; gone in pass 2 with the "
              f"material {gone[0]:.1f} %, in pass 3 {gone[1]:.1f} %")
    results = [result for result in results if result.real]
    if not results:
        print("by cause: none of these robots", flush=True)
        return
    print(
        f"by cause, pass 2 with nothing stated, {len(results)} of them: root mean square [um] really left / stated\n| | "
        + " | ".join(results[0].real)
        + " |\n"
        + 5 * "|---"
        + "|"
    )
    names = list(CAUSES)
    for group, words in enumerate(GROUPS):
        cells = []
        for cause in results[0].real:
            real = rms(np.concatenate([result.real[cause][result.seen[0].group == group] for result in results]))
            rows = [names.index(one) for one in cause.split(", ")]
            stated = rms(
                np.concatenate(
                    [np.linalg.norm(result.seen[0].stated[rows], axis=0)[result.seen[0].group == group] for result in results]
                )
            )
            cells.append(f"{real:.2f} / {stated:.2f}")
        print(f"| {words} | {' | '.join(cells)} |", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("robots", type=int, nargs="?", default=8)
    parser.add_argument("first_seed", type=int, nargs="?", default=7900)
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--jobs", nargs="*", default=list(JOBS), choices=list(JOBS))
    parser.add_argument("--arms", nargs="*", default=[], choices=list(ARMS))
    options = parser.parse_args()
    arms = options.arms or [None]
    drawn = [
        (arms[k % len(arms)], options.first_seed + k, gain, motion, k % EVERY == 0)
        for k, (gain, motion) in enumerate(cells(options.robots, options.first_seed))
    ]
    with ProcessPoolExecutor(options.workers) as pool:
        for name in options.jobs:
            print_job(name, list(pool.map(robot, [(name, *one) for one in drawn])))


if __name__ == "__main__":
    main()

"""Does `left_um` say how far the tool is off the plan on the part? By job, pass, place and cause, in the virtual cell.

    OMP_NUM_THREADS=1 python benchmarks/left_on_part.py [ROBOTS] [FIRST_SEED] [--workers N] [--jobs NAME ...]
                                                        [--arms NAME ...]

What cell.yaml states as unknown of a cell is really unknown, at that size: the sensor's gain (force_log.gain_std, 1 %) and how
much more or less the moving robot gives way than at rest (motion.compliance_std, 2 %). A softer robot and a sensor that shows
too little act alike, on all of a part at once: a robot drawn with either is off by more than 2 sigma nearly everywhere or
nearly nowhere, and few robots show nothing of the tails. So each robot is milled twice, as it is and softer in motion
(SOFTER), and what is left is taken as straight in that: every figure is one over the whole distribution. The depth of cut,
where it is stated, is off as stocks are from what was planned (DEEPER, SLOT_DEEPER): corrected for a depth that much larger
too, and as straight in that. All else is as in
benchmarks/milling_loop.py: robots drawn, load-tested and identified, a part milled, logged, corrected, milled again, and the
third pass by the log of the second. --arms: robots of the second cell instead, in turn (tests/runs/milling/another_arm.py), a
line for each.

within: probability that a step of half a millimetre that cuts is within 2 sigma of `left_um`, mean over the steps: plateau
(slot, walls, arcs), entries (ends of the slot, roll in and out), corners (rolled and sharp); worst and best robot. By cause:
root mean square [um] stated, and what is really left of that cause, the others switched off: the force of the first pass held
(cut), the softer robot by itself (sensor, motion), the true springs and a log without error (model, scatter); the rest is
between targets.
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

from benchmarks.part_jobs import JOBS, PartJob
from compensator.correction.expected_left import CAUSES
from tests.runs.milling.another_arm import PLACES as ARMS
from tests.runs.milling.another_arm import AnotherArmJob
from tests.runs.milling.learning_job import ErringJob
from tests.runs.milling.milling_job import Correction, rms, settings
from tests.virtual_cell.milled_part import PLACES, SLOT_DEPTH, Steps
from tests.virtual_cell.milling import Pass, Sensor

UNKNOWN = float(np.hypot(0.01, 0.02))  # of gain and motion together, as cell.yaml has them where it says nothing
SOFTER = 0.03
DEEPER = 0.25   # 1 sigma of ln of the depth stated, as compensator/correction/cutting_prior.py has the stock
LEVELS = norm.ppf((np.arange(100) + 0.5) / 100)
SHUFFLED = LEVELS[np.random.default_rng(1).permutation(len(LEVELS))]    # of the depth, beside those of gain and motion
EVERY = 4  # robot is looked at by cause
SLOT_DEEPER = 0.15  # the same of the slot's depth
SECOND, DEPTH_STATED, SLOT_STATED = "pass 2, nothing stated", "pass 2, depth stated", "pass 2, and the slot's"
GROUPS = {
    "plateau": ("slot", "straight wall", "arc"),
    "entry": ("slot ends", "roll in and out"),
    "corner": ("rolled corner", "sharp corner"),
}


@dataclass(frozen=True)
class Seen:
    """One program milled, at the steps that cut: off (S, 3) [um], slope (S, 3) [um] by how much more where gain and motion are
    off by 1 sigma; deeper (S, 3) [um] the same of the depth stated; std (S,) [um], stated (C, S) by cause, group (S,).
    Steps beside which the program says nothing, since its log shows no force there, are not among them: `silent` many."""

    name: str
    off: np.ndarray
    slope: np.ndarray
    std: np.ndarray
    stated: np.ndarray
    group: np.ndarray
    deeper: np.ndarray
    silent: int

    @property
    def size(self) -> np.ndarray:
        """How far off (L, S) [um] at the LEVELS of gain and motion, and of the depth."""
        off = self.off + LEVELS[:, None, None] * self.slope + SHUFFLED[:, None, None] * self.deeper
        return np.linalg.norm(off, axis=2)


@dataclass(frozen=True)
class Result:
    seen: list[Seen]
    real: dict[str, np.ndarray]  # what the pass of the first row truly leaves (S,) [um], by cause
    before: float
    arm: str | None


@dataclass(frozen=True)
class Milled:
    """One cell: its job, and by row what was corrected and milled; deeper: the same with the depth stated 1 sigma larger."""

    job: ErringJob
    rows: dict[str, tuple[Correction, Pass]]
    deeper: dict[str, tuple[Correction, Pass]]


def group_of(place: np.ndarray) -> np.ndarray:
    found = np.full(len(place), -1)
    for number, places in enumerate(GROUPS.values()):
        found[np.isin(place, [PLACES.index(name) for name in places])] = number
    return found


def at_steps(steps: Steps, other: Steps, values: np.ndarray) -> np.ndarray:
    """Values (T, 3) at the steps of the same path in other pieces, at the steps of this one (S, 3)."""
    wanted, along = (np.cumsum(each.length_mm) - 0.5 * each.length_mm for each in (steps, other))
    return np.column_stack([np.interp(wanted, along, axis) for axis in values.T])


def seen(name: str, stiff: Milled, soft: Milled) -> Seen:
    (made, done), (other, other_done) = stiff.rows[name], soft.rows[name]
    first = stiff.job.first_with(made.part)
    cut = first.cutting | done.cutting
    stated = np.zeros((len(CAUSES), len(made.part.target_mm)))
    stated[:, made.job.correction.targets] = [1e6 * getattr(made.job.left, cause) for cause in CAUSES]
    more = at_steps(first.steps, soft.job.first_with(other.part).steps, other_done.off_um) - done.off_um
    deeper = np.zeros_like(more)
    if name in stiff.deeper:
        again, again_done = stiff.deeper[name]
        deeper = at_steps(first.steps, stiff.job.first_with(again.part).steps, again_done.off_um) - done.off_um
    said = first.steps.between(made.left_um)
    silent = cut & ~(said > 0)
    cut &= said > 0
    return Seen(name, done.off_um[cut], UNKNOWN / SOFTER * more[cut], said[cut],
                np.array([first.steps.between(each)[cut] for each in stated]), group_of(first.steps.place)[cut], deeper[cut],
                int(silent.sum()))


def left_by_cause(stiff: Milled, slope: np.ndarray, perfect: Correction) -> dict[str, np.ndarray]:
    """What each cause truly leaves at the steps of the second pass that cut; slope (S, 3) [um] of gain and motion."""
    job, (made, done) = stiff.job, stiff.rows[SECOND]
    first = job.first_with(made.part)
    cut = (first.cutting | done.cutting) & (first.steps.between(made.left_um) > 0)

    def held(one: Correction) -> np.ndarray:
        force = job.first_with(one.part)
        off = job.mill(one.commands, force.force_n, part=one.part)
        return at_steps(first.steps, off.steps, off.off_um)

    mine, exact = held(made), held(perfect)
    parts = (("cut", (done.off_um - mine)[cut]), ("sensor, motion", slope), ("model, scatter", (mine - exact)[cut]),
             ("between", exact[cut]))
    return {name: np.linalg.norm(each, axis=1) for name, each in parts}


def robot(arguments: tuple[str, str | None, int, bool]) -> Result | None:
    """One robot; None: its arm is so soft that the simulated cut finds no balance with it."""
    try:
        return milled(*arguments)
    except RuntimeError:
        return None


def milled(name: str, arm: str | None, seed: int, causes: bool) -> Result:
    with tempfile.TemporaryDirectory() as one, tempfile.TemporaryDirectory() as other:
        stiff = cell(Path(one), JOBS[name], arm, seed, 1.0)
        soft = cell(Path(other), JOBS[name], arm, seed, 1.0 + SOFTER)
        rows, real, job = [seen(row, stiff, soft) for row in stiff.rows], {}, stiff.job
        if causes:
            springs = job.springs("true.json", job.case.stiffness)
            perfect = job.correct(job.perfect_log("perfect.csv"), springs, settings(tare=()), job.cell_in_base())
            real = left_by_cause(stiff, rows[0].slope, perfect)
        return Result(rows, real, rms(np.linalg.norm(job.first.off_um, axis=1)[job.first.cutting]), arm)


def cell(folder: Path, wanted: PartJob, arm: str | None, seed: int, motion: float) -> Milled:
    """One robot, corrected and milled in all ways; motion: how much softer it is than at rest."""
    job_of = ErringJob if arm is None else partial(AnotherArmJob, arm=arm)
    job = job_of(folder, seed, part=wanted.part, cutter=wanted.cutter, motion=motion, sensor=Sensor(gain=1.0))
    stiffness = job.identify()
    log = job.log(job.first, job.planned, "pass1.csv")
    stated = job.cell_with("cell_cut.yaml", wanted.cut_yaml)
    found = job.correct(log, stiffness)
    second = job.mill(found.commands, part=found.part)
    pass2 = job.log(second, found.commands, "pass2.csv", part=found.part)
    offsets = job.offsets(found, "offsets1.csv")
    depth, slot = 1e-3 * wanted.depth_mm, 1e-3 * SLOT_DEPTH
    made = {
        DEPTH_STATED: job.correct(log, stiffness, settings(depth_of_cut=depth)),
        SLOT_STATED: job.correct(log, stiffness, settings(depth_of_cut=depth, slot_depth=slot)),
        "pass 2, material stated": job.correct(log, stiffness, cell=stated),
        "pass 3, --logged-with": job.correct(pass2, stiffness, settings(logged_with=offsets)),
        "pass 3, both passes": job.correct(pass2, stiffness, settings(logged_with=offsets, first_forces=log)),
    }
    # What is unknown of the depth is asked of the cell as it is alone.
    off = {"depth_of_cut": depth * float(np.exp(DEEPER))}
    both = off | {"slot_depth": slot * float(np.exp(SLOT_DEEPER))}
    more = {name: job.correct(log, stiffness, settings(**given)) for name, given in (
        (DEPTH_STATED, off), (SLOT_STATED, both)) if motion == 1}

    def milled_with(programs: dict[str, Correction]) -> dict[str, tuple[Correction, Pass]]:
        return {words: (one, job.mill(one.commands, part=one.part)) for words, one in programs.items()}

    return Milled(job, {SECOND: (found, second)} | milled_with(made), milled_with(more))


def within(one: Seen, group: int | None = None) -> float:
    where = slice(None) if group is None else one.group == group
    return 100 * float(np.mean(one.size[:, where] <= 2 * one.std[where]))


def print_job(name: str, every: list[Result | None]) -> None:
    results = [result for result in every if result is not None]
    before = np.mean([result.before for result in results])
    print(
        f"\n{name}, {len(results)} of {len(every)} robots; off before {before:.0f} um RMS\n"
        "| | within 2 sigma: all (worst, best robot) | "
        f"{' | '.join(GROUPS)} | median off, stated [um] | RMS off, stated [um] | gone | steps without a figure |\n"
        + 9 * "|---" + "|"
    )
    for number, row in enumerate(results[0].seen):
        each = [result.seen[number] for result in results]
        shares = [within(one) for one in each]
        silent = np.mean([one.silent for one in each])
        gone = [100 - 100 * rms(one.size) / result.before for one, result in zip(each, results, strict=True)]
        groups = [f"{np.mean([within(one, group) for one in each]):.1f}" for group in range(len(GROUPS))]
        print(
            f"| {row.name} | {np.mean(shares):.1f} ({min(shares):.0f}, {max(shares):.0f}) | {' | '.join(groups)} | "
            f"{np.mean([np.median(one.size) for one in each]):.1f}, {np.mean([np.median(one.std) for one in each]):.1f} | "
            f"{np.mean([rms(one.size) for one in each]):.1f}, {np.mean([rms(one.std) for one in each]):.1f} | "
            f"{np.mean(gone):.1f} % | {silent:.0f} |"
        )
    for arm in dict.fromkeys(result.arm for result in results if result.arm):
        mine = [result for result in results if result.arm == arm]
        shares = [np.mean([within(result.seen[number]) for result in mine]) for number in range(len(mine[0].seen))]
        gone = [100 - 100 * np.mean([rms(result.seen[number].size) / result.before for result in mine]) for number in (3, 5)]
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
    drawn = [(arms[k % len(arms)], options.first_seed + k, k % EVERY == 0) for k in range(options.robots)]
    with ProcessPoolExecutor(options.workers) as pool:
        for name in options.jobs:
            print_job(name, list(pool.map(robot, [(name, *one) for one in drawn])))


if __name__ == "__main__":
    main()

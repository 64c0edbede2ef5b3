"""Does the correction make parts better? Milled, logged, corrected and milled again in the virtual cell.

    OMP_NUM_THREADS=1 python benchmarks/milling_loop.py [ROBOTS] [FIRST_SEED] [--only plain|spacing|hidden] [--workers N]
                                                        [--jobs NAME ...]
                                                        [--few] [--set NAME=VALUE ...]

The truth is tests/virtual_cell alone: rigid bodies with the closed rod, gravity, and an end mill whose force follows the
engagement that the yielding tool has (tests/virtual_cell/milling.py says what is left out). Each robot is drawn, load-tested
with realistic noise (design ladder12), identified by the command line; the planned program is milled and logged, corrected
with that log by `predict_files` and `correct`, the written numbers are read by another reader and milled on a second
blank.

Off: distance of the loaded tool from plan at every half millimetre that cuts; `faces`: across the wall, and for the slot's
floor upwards. Gone: of its RMS and of its largest. Worse: steps further off than without correction by more than 2 of the
sigmas that offsets.csv states. Farther: by any amount, beside how many the probabilities of `correct` (expected_worse) make of
the steps, each between those of its targets. --set: a further row with these fields of Settings (numbers).
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from collections import defaultdict
from collections.abc import Iterable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.optimize import least_squares

sys.path.insert(0, str(Path(__file__).parents[1]))

from benchmarks.part_jobs import JOBS
from compensator.correction.settings import DEFAULTS
from identification.common.findings import Refused
from identification.measurements import read_measurements
from identification.model.cell import read_cell
from identification.model.compliance import equilibrium
from tests.runs.milling.milling_job import Correction, MillingJob, grown, made_worse, rms, settings
from tests.virtual_cell.cell import parse
from tests.virtual_cell.files import PRIOR
from tests.virtual_cell.milled_part import PLACES, slot_and_pocket
from tests.virtual_cell.milling import Pass

FIVE = ("1.5 mm", "0.5 mm", "0.5 mm, thin", "steel", "titanium")
HIDDEN = ("backlash:1", "soft_zone:1", "gear_friction:1", "bearing_tilt:2", "base_rocking", "spindle_compliance")
HIDDEN_PART = "0.5 mm"
SPACINGS_MM = (1.5, 0.5, 0.25, 0.1)
SHARP = PLACES.index("sharp corner")
SECOND, THIRD = "corrected: pass 2", "pass 3, both passes"


@dataclass(frozen=True)
class Row:
    """One way to command a pass, on one robot and part: sums of squares, sizes and counts over the steps that cut.

    before, after (S,) [um] off plan; faces (2, S) [um] of the machined faces before and after; place (S,); worse (S,) by more
    than 2 stated sigma; grown (S,) [um] beyond before; within: share of the steps within 2 sigma of what is
    stated for the part; stated: its median [um].
    """

    name: str
    before: np.ndarray
    after: np.ndarray
    faces: np.ndarray
    place: np.ndarray
    worse: np.ndarray
    grown: np.ndarray
    within: float
    stated: float = 0.0
    expected: float = np.nan

    def worse_beside(self, place: int = -1) -> str:
        """How many steps are worse, how many of them not at that place, and by how much at most."""
        most = f", {self.grown[self.worse].max():.1f} um" if self.worse.any() else ""
        return f"{int(self.worse.sum())} ({int(self.worse[self.place != place].sum())}){most}"


@dataclass(frozen=True)
class Result:
    group: str
    seed: int
    rows: list[Row]
    said: str = ""
    seconds: float = 0.0
    cutting_stiffness: float = 0.0
    targets: tuple[int, int] = (0, 0)


def row(name: str, first: Pass, after: Pass, sigma_um: np.ndarray, left_um: np.ndarray | None = None,
        likely: np.ndarray | None = None) -> Row:
    cut = first.cutting | after.cutting
    before, behind = (np.linalg.norm(done.off_um, axis=1)[cut] for done in (first, after))
    stated = first.steps.between(sigma_um if left_um is None else left_um)[cut]
    return Row(name, before, behind, np.array([first.surface_um[cut], after.surface_um[cut]]), first.steps.place[cut],
               made_worse(first, after, sigma_um)[cut], grown(first, after)[cut], float(np.mean(behind <= 2 * stated)),
               float(np.median(stated)), np.nan if likely is None else float(first.steps.between(likely)[cut].sum()))


def plain(arguments: tuple[str, int, dict[str, float], bool]) -> Result | None:
    """One robot without hidden effects, one part; None: its arm is so soft that the simulated cut finds no balance with it, or
    that a correction is refused."""
    try:
        return milled(*arguments)
    except RuntimeError:
        return None
    except Refused as refused:
        print(f"{arguments[0]}, robot {arguments[1]}: {refused}")
        return None


def milled(part: str, seed: int, wanted: dict[str, float], few: bool) -> Result:
    started = time.perf_counter()
    with tempfile.TemporaryDirectory() as folder:
        job = MillingJob(Path(folder), seed, part=JOBS[part].part, cutter=JOBS[part].cutter)
        stiffness = job.identify()
        log = job.log(job.first, job.planned, "pass1.csv")
        found = job.correct(log, stiffness)
        second = again_milled(job, found)
        pass2 = job.log(second, found.commands, "pass2.csv", part=found.part)
        known_pass = job.offsets(found, "offsets1.csv")
        paired = job.correct(pass2, stiffness, settings(logged_with=known_pass, first_forces=log))
        by_material = job.correct(log, stiffness, cell=job.cell_with("cell_cut.yaml", JOBS[part].cut_yaml))
        stated_depth = job.correct(log, stiffness, settings(depth_of_cut=1e-3 * JOBS[part].depth_mm))
        literature = job.mirrored(log, job.springs("prior.json", np.array(PRIOR)))
        third = again_milled(job, paired)
        rows = [row("mirrored once, literature k", job.first, job.mill(literature), found.at_own),
                corrected_row(job, SECOND, found, second),
                corrected_row(job, "pass 2, depth of cut stated", stated_depth),
                corrected_row(job, "pass 2, material, diameter, contact, speed stated", by_material),
                corrected_row(job, THIRD, paired, third)]
        if wanted:
            words = ", ".join(f"{name} {value:g}" for name, value in wanted.items())
            rows.append(corrected_row(job, f"with {words}", job.correct(log, stiffness, settings(**wanted))))
        rows += [] if few else further(job, stiffness, log, found)
        found_k = paired.job.stiffness
        return Result(part, seed, rows, said="" if found_k is None else found_k.words(), seconds=time.perf_counter() - started,
                      cutting_stiffness=wall_stiffness(job.first_with(paired.part), third),
                      targets=(len(job.part.target_mm), len(found.part.target_mm)))


def further(job: MillingJob, stiffness: Path, log: Path, found: Correction) -> list[Row]:
    """What separates the causes, and ways that were given up; the second pass is in pass2.csv, with offsets1.csv."""
    truth, pass2 = job.springs("true.json", job.case.stiffness), job.folder / "pass2.csv"
    targets = job.log(job.first, job.planned, "targets.csv", by_target=True)
    known = job.correct(log, truth)
    perfect = job.correct(job.perfect_log("perfect.csv"), truth, settings(tare=()), job.cell_in_base())
    least = job.mirrored(log, job.springs("lsq.json", least_squares_k(job)))
    held = "identified k, force of pass 1 held"
    return [row("mirrored once, least squares k", job.first, job.mill(least), found.at_own),
            *(corrected_row(job, name, one) for name, one in (
                ("pass 3, its log alone", job.correct(pass2, stiffness)),
                ("pass 3, --logged-with", job.correct(pass2, stiffness, settings(logged_with=job.folder / "offsets1.csv"))),
                ("corrected with --keep-targets", job.correct(log, stiffness, settings(keep_targets=True))),
                ("log by the target moved to, taken for the nearest", job.correct(targets, stiffness)),
                ("log by the target moved to, and cell.yaml says so",
                 job.correct(targets, stiffness, cell=job.cell_ahead())),
                ("true k", known))),
            *(corrected_row(job, name, one, again_milled(job, one, held=True)) for name, one in (
                (held, found), ("true k, force held", known), ("true k, force held, perfect log", perfect)))]


def corrected_row(job: MillingJob, name: str, one: Correction, done: Pass | None = None) -> Row:
    """The row of a corrected program; done: its pass, if it was milled already."""
    return row(name, job.first_with(one.part), done or again_milled(job, one), one.sigma_um, one.left_um, one.worse)


def again_milled(job: MillingJob, found: Correction, *, held: bool = False) -> Pass:
    """The pass of a corrected program, the force held that its planned path meets or following the cut."""
    given = job.first_with(found.part).force_n if held else None
    return job.mill(found.commands, given, part=found.part)


def wall_stiffness(first: Pass, last: Pass) -> float:
    """How much the force grows a millimetre that the tool comes nearer to the straight wall [N/mm], between two passes."""
    wall = first.steps.place == PLACES.index("straight wall")
    moved = np.linalg.norm((first.off_um - last.off_um)[wall], axis=1)
    return float(1e3 * np.median(np.linalg.norm((first.force_n - last.force_n)[wall], axis=1) / moved))


def hidden(arguments: tuple[str, int, dict[str, float]]) -> Result:
    """One robot that hides an effect."""
    effect, seed, _ = arguments
    started = time.perf_counter()
    with tempfile.TemporaryDirectory() as folder:
        job = MillingJob(Path(folder), seed, parse(effect), part=JOBS[HIDDEN_PART].part)
        stiffness = job.identify()
        extended, diagnosis = job.diagnose()
        log = job.log(job.first, job.planned, "pass1.csv")
        # Plain springs are refused where a cause is hidden.
        all_the_same = settings(accept_rejected=True)
        ignored, named = job.correct(log, stiffness, all_the_same), job.correct(log, extended, all_the_same)
        truth = job.mill(job.with_the_truth(named.job.planned.forces.wrench))
        rows = [row("effect ignored", job.first_with(ignored.part), again_milled(job, ignored), ignored.sigma_um,
                    ignored.left_um),
                row("diagnosed first", job.first_with(named.part), again_milled(job, named), named.sigma_um, named.left_um),
                row("corrected with the cell itself", job.first, truth, named.at_own)]
        causes = ", ".join(f"{cause['effect']}{'' if cause['joint'] is None else ':' + str(cause['joint'])}"
                           for cause in diagnosis["causes"])
        return Result(effect, seed, rows, f"{diagnosis['verdict']} {causes}".strip(), time.perf_counter() - started)


def spaced(arguments: tuple[float, int, int, dict[str, float]]) -> str:
    """One robot, targets at one spacing: what is gone by place, and how rough the corrections are. The log is filtered over so
    many revolutions first."""
    spacing, revolutions, seed, wanted = arguments
    with tempfile.TemporaryDirectory() as folder:
        job = MillingJob(Path(folder), seed, part=slot_and_pocket(spacing_mm=spacing))
        log = job.log(job.first, job.planned, "pass1.csv", revolutions=revolutions)
        found = job.correct(log, job.identify(), settings(**wanted))
        first = job.first_with(found.part)
        done = row("", first, job.mill(found.commands, part=found.part), found.sigma_um)
        offset = 1e3 * (found.commands.position_mm - found.part.target_mm)
        wall = PLACES.index("straight wall")
        rough = rms(np.linalg.norm(np.diff(offset, 2, axis=0), axis=1)[found.part.place[1:-1] == wall] / np.sqrt(6))
        stated = rms(first.steps.between(found.sigma_um)[first.steps.place == wall])
        places = [PLACES.index(place) for place in ("slot", "straight wall", "sharp corner")]
        shares = [f"{gone(done, done.place == place):.1f} %" for place in places]
        cells = [f"{spacing:g} mm", revolutions or "as it is", f"{gone(done):.1f} %", *shares,
                 f"{rms(done.after[done.place == wall]):.1f}", f"{stated:.1f}", f"{rough:.1f}", int(done.worse.sum())]
        return f"| {' | '.join(map(str, cells))} |"


def least_squares_k(job: MillingJob) -> np.ndarray:
    """Stiffnesses (6,) [N m/rad] by unweighted least squares in k over the rows to identify."""
    cell = read_cell(job.cell)
    rows = read_measurements(job.measurements, cell.robot)
    used = ~job.case.validate
    theta, wrench, seen = job.case.theta[used], job.case.wrench[used], 1e-6 * job.case.deflection_um[used]
    assert len(rows.theta) == len(used)

    def residual(factors: np.ndarray) -> np.ndarray:
        state = equilibrium(cell.robot, theta, cell.flange_from_tcp, wrench, 1 / (factors * np.array(PRIOR)))
        return np.asarray(1e6 * (state.position - seen).ravel())

    return np.asarray(least_squares(residual, np.ones(6), bounds=(1e-2, 1e2)).x * np.array(PRIOR))


def gone(one: Row, where: np.ndarray | slice = slice(None)) -> float:
    return 100 * (1 - rms(one.after[where]) / rms(one.before[where]))


def pooled(rows: list[Row]) -> Row:
    """All robots as one."""
    def all_of(name: str) -> np.ndarray:
        return np.concatenate([getattr(one, name) for one in rows], axis=-1)

    return Row(rows[0].name, all_of("before"), all_of("after"), all_of("faces"), all_of("place"), all_of("worse"),
               all_of("grown"), float(np.mean([one.within for one in rows])),
               float(np.mean([one.stated for one in rows])), sum(one.expected for one in rows))


def by_name(results: Iterable[Result]) -> dict[str, list[Row]]:
    table: dict[str, list[Row]] = defaultdict(list)
    for result in results:
        for one in result.rows:
            table[one.name].append(one)
    return table


def print_plain(part: str, every: list[Result | None]) -> None:
    results = [result for result in every if result is not None]
    if not results:
        print(f"\n{part}; 0 of {len(every)} robots: the arms are too soft for this cut")
        return
    seconds = np.mean([result.seconds for result in results])
    follows = np.median([result.cutting_stiffness for result in results])
    print(f"\n{part}; {len(results)} of {len(every)} robots, {seconds:.0f} s a robot. Force follows the wall by {follows:.0f} "
          "N/mm. Mean (worst robot)")
    table = by_name(results)
    first = next(iter(table.values()))
    print(f"no correction: off {np.mean([rms(one.before) for one in first]):.1f} um RMS, "
          f"{max(one.before.max() for one in first):.0f} um at most; steps that cut {len(first[0].before)} a robot")
    print("cutting stiffness of the two passes: " + "; ".join(result.said for result in results))
    counts = np.mean([result.targets for result in results], axis=0)
    print(f"targets of the program: {counts[0]:.0f}, of the corrected one {counts[1]:.0f}")
    print("| | gone, RMS | largest | faces, RMS | without the sharp corner, RMS | left [um] RMS / largest | "
          "worse (beside the corner), by at most | within 2 sigma | median off, stated [um] | farther: expected, are |\n"
          + 10 * "|---" + "|")
    for name, rows in table.items():
        each = [gone(one) for one in rows]
        faces = [100 * (1 - rms(one.faces[1]) / rms(one.faces[0])) for one in rows]
        others = [gone(one, one.place != SHARP) for one in rows]
        largest = [100 * (1 - one.after.max() / one.before.max()) for one in rows]
        worse = pooled(rows).worse_beside(SHARP)
        print(f"| {name} | {np.mean(each):.1f} % ({min(each):.1f}) | {np.mean(largest):.0f} % ({min(largest):.0f}) | "
              f"{np.mean(faces):.1f} % ({min(faces):.1f}) | {np.mean(others):.1f} % ({min(others):.1f}) | "
              f"{np.mean([rms(one.after) for one in rows]):.1f} / {max(one.after.max() for one in rows):.0f} | "
              f"{worse} | {100 * np.mean([one.within for one in rows]):.1f} % | "
              f"{np.mean([np.median(one.after) for one in rows]):.1f}, {np.mean([one.stated for one in rows]):.1f} | "
              f"{pooled(rows).expected:.1f}, {int((pooled(rows).grown > 0).sum())} |")
    print("\n| place | off before [um] RMS | pass 2: left RMS / largest, gone | pass 3: left, gone | worse in pass 2 |")
    print("|---|---|---|---|---|")
    second, third = pooled(table[SECOND]), pooled(table[THIRD])
    for number, place in enumerate(PLACES):
        two, three = second.place == number, third.place == number
        if two.any():
            print(f"| {place} | {rms(second.before[two]):.1f} | {rms(second.after[two]):.1f} / {second.after[two].max():.0f}, "
                  f"{gone(second, two):.1f} % | {rms(third.after[three]):.1f}, {gone(third, three):.1f} % | "
                  f"{int(second.worse[two].sum())} |")
    if "true k, force held" not in table:
        return
    print("what remains after pass 2, mean square [um^2] a step, differences of rows:")
    square = {name: np.mean([np.mean(one.after**2) for one in rows]) for name, rows in table.items()}
    total, held = square[SECOND], square["identified k, force of pass 1 held"]
    known, perfect = square["true k, force held"], square["true k, force held, perfect log"]
    for words, value in (("force follows the cut", total - held), ("stiffness", held - known),
                         ("placing, averaging and noise of the log", known - perfect),
                         ("straight between targets, force jumps (true k, perfect log)", perfect), ("all", total)):
        print(f"  {words:<62}{value:9.2f}  {100 * value / total:5.1f} %")


def print_hidden(effect: str, results: list[Result]) -> None:
    for result in results:
        ignored, named, truth = result.rows
        shares = [f"{gone(one):.1f} %" for one in result.rows]
        cells = [effect, result.seed, result.said, f"{rms(named.before):.0f}", *shares,
                 f"{100 * gone(named) / gone(truth):.0f} %", ignored.worse_beside(SHARP), named.worse_beside(SHARP),
                 f"{100 * named.within:.0f} %"]
        print(f"| {' | '.join(map(str, cells))} |", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("robots", type=int, nargs="?", default=8)
    parser.add_argument("first_seed", type=int, nargs="?", default=7000)
    parser.add_argument("--only", choices=["plain", "spacing", "hidden"])
    parser.add_argument("--jobs", nargs="*", default=list(FIVE), choices=list(JOBS))
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--few", action="store_true", help="The rows of docs/benchmarks/parts.md alone.")
    parser.add_argument("--set", action="append", default=[], metavar="NAME=VALUE")
    options = parser.parse_args()
    wanted = {name: float(value) for name, _, value in (each.partition("=") for each in options.set)}
    missing = set(wanted) - set(DEFAULTS.values())
    if missing:
        parser.error(f"Settings has no field {', '.join(sorted(missing))}")
    seeds = range(options.first_seed, options.first_seed + options.robots)
    with ProcessPoolExecutor(options.workers) as pool:
        for part in options.jobs if options.only in (None, "plain") else ():
            print_plain(part, list(pool.map(plain, [(part, seed, wanted, options.few) for seed in seeds])))
            sys.stdout.flush()
        if options.only in (None, "spacing"):
            print("\nTargets closer and closer, first robot. Log: as it is, or a moving mean over so many revolutions. "
                  "Roughness: scatter of neighbouring corrections on the straight wall\n| targets every | log | gone | slot | "
                  "straight wall | sharp corner | wall: left [um] | stated sigma | roughness | worse |\n" + 10 * "|---" + "|")
            runs = [(spacing, revolutions, seeds[0], wanted) for revolutions in (0, 3) for spacing in SPACINGS_MM]
            for line in pool.map(spaced, runs):
                print(line, flush=True)
        if options.only in (None, "hidden"):
            print(f"\nOne hidden effect of typical size; targets every {HIDDEN_PART}")
            print("| hidden | seed | diagnose says | off before [um] | gone: ignored | diagnosed | with the cell itself | "
                  "of that | worse (beside the corner): ignored | diagnosed | within 2 sigma |\n" + 11 * "|---" + "|")
            for effect in HIDDEN:
                few = seeds[:(len(seeds) + 1) // 2]
                print_hidden(effect, list(pool.map(hidden, [(effect, seed, wanted) for seed in few])))


if __name__ == "__main__":
    main()

"""Does a second part get better by what was measured on the first? Milled, measured, learned and milled again in the virtual
cell.

    OMP_NUM_THREADS=1 python benchmarks/learning.py [ROBOTS] [FIRST_SEED] [--only parts|noise|causes] [--workers N]
                                                    [--arms NAME ...]

The truth is tests/virtual_cell alone: springs that give way 1.2 times as much in motion as in the load test, a smooth kinematic
error of up to 0.2 mm (a sum of plane waves of 0.3 to 1.5 m), and a spindle that grows by 40 um as it warms up; the model knows
none of it. Each robot is load-tested with realistic noise and identified; the planned program is milled, logged and measured on
a machine of 3 um. Mirroring, what shops do: the planned targets less the deviation measured there.

Off: distance of the loaded tool from plan at every half millimetre that cuts. Gone: of its RMS. Within 2 sigma: share of those
steps by left_um, mean and worst robot. Worse: robots whose RMS grew. Accuracy and motion stated: `accuracy.position_um` 120,
the RMS of such errors over half a metre, and `motion.compliance_std` 0.2.
noise: parts that are off by their deflection and white noise, or noise that neighbours share, alone: what is learned of them.
causes: an effect came to the robot after its load test: what `learn` says of it, what stretches left out and the second part
gain by it; and what it says of parts where nothing came, with and without the kinematic error and the warming. --arms: `parts`
by robots of the second cell in turn (tests/runs/milling/another_arm.py).
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections import Counter, defaultdict
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from functools import partial
from itertools import cycle, islice
from pathlib import Path
from unittest.mock import patch

import numpy as np
from scipy.spatial.transform import Rotation

sys.path.insert(0, str(Path(__file__).parents[1]))

import compstiff
from compensator.learning.causes import Asked, ask
from compensator.learning.chance import FALSE_RATE
from compensator.learning.learning import Learning
from tests.runs.milling.another_arm import PLACES as ARMS
from tests.runs.milling.another_arm import AnotherArmJob
from tests.runs.milling.learning_job import MOTION, Both, ErringJob, corrected, mirrored, off_um
from tests.runs.milling.milling_job import Correction, rms, settings
from tests.virtual_cell.astray import drawn
from tests.virtual_cell.cell import parse
from tests.virtual_cell.milled_part import PLACES, slot_and_pocket
from tests.virtual_cell.milling import Commands

PART, OTHER = {}, {"allowance_mm": 0.7, "wall_depth_mm": 5.0}
PROBE_UM = 3.0
CUT = "  spindle_rpm: 9000\ncutting: {{material: aluminium, tool_diameter_mm: 16, contact_mm: {depth:g}}}\n"
ERRS = "accuracy: {position_um: 120}\nmotion: {compliance_std: 0.2}\n"
NOISES_UM = (3.0, 10.0)
DRAWS = 12
# Of the typical size, or of a multiple of it.
TURNED, TURN_DEG = "force sensor turned", 3.0
CAUSES = ("backlash:1", "soft_zone:1", "gear_friction:1", "base_rocking::2", "spindle_compliance::2", "bearing_tilt:2:2",
          "link_bending:3:2", TURNED)


Gone = tuple[float, float, float, float]


def gone(job: ErringJob, commands: Commands | Correction) -> Gone:
    """RMS [um] off before and after, the share that is gone [%], and that of the steps that are within 2 sigma [%], NaN of
    programs that state none."""
    part = commands.part if isinstance(commands, Correction) else job.part
    given = commands.commands if isinstance(commands, Correction) else commands
    first = job.first_with(part)
    done = job.mill(given, part=part)
    before, after, within = rms(off_um(done, first)), rms(off_um(first, done)), np.nan
    if isinstance(commands, Correction):
        cut, stated = first.cutting | done.cutting, first.steps.between(commands.left_um)
        within = 100 * float(np.mean(off_um(first, done)[stated[cut] > 0] <= 2 * stated[cut & (stated > 0)]))
    return before, after, 100 * (1 - after / before), within


def at_corners(job: ErringJob, made: Correction) -> float:
    """Share of the mean square [%] that the rolled and the sharp corner have of what is left."""
    first, done = job.first_with(made.part), job.mill(made.commands, part=made.part)
    square = np.where(first.cutting | done.cutting, np.sum(done.off_um**2, axis=1), 0.0)
    corner = np.isin(first.steps.place, [PLACES.index(name) for name in ("rolled corner", "sharp corner")])
    return 100 * float(square[corner].sum() / square.sum())


def second_measured(job: ErringJob, log: Path, stiffness: Path) -> dict[str, Gone]:
    """The part measured is the one corrected already: its offsets are named, and the third is milled with what it taught."""
    found = corrected(job, log, stiffness)
    second, offsets = job.mill(found.commands, part=found.part), job.offsets(found, "offsets1.csv")
    pass2 = job.log(second, found.commands, "pass2.csv", part=found.part)
    points, cell = job.measure(second, "points2.csv", PROBE_UM, part=found.part), compstiff.read_cell(job.cell)
    program, model = compstiff.read_toolpath(job.program, cell), compstiff.read_stiffness(stiffness, cell)
    learning = compstiff.learn(cell, program, model, pass2, points, settings(logged_with=offsets))
    learned = job.folder / "learned2.json"
    compstiff.write({learned: learning.content()}, overwrite=True)
    made = job.correct(pass2, stiffness, settings(logged_with=offsets, learned=learned, repeats="job"))
    return {"first part a third time: learned from the second, --logged-with, --repeats job": gone(job, made)}


def robot(seed: int, arm: str | None = None) -> tuple[dict[str, Gone], list[str]]:
    """One robot: every way to command the second part, and another part."""
    with tempfile.TemporaryDirectory() as folder:
        job_of = ErringJob if arm is None else partial(AnotherArmJob, arm=arm)
        both = Both(Path(folder), seed, slot_and_pocket(**PART), slot_and_pocket(**OTHER), job_of=job_of)
        job, other = both.first, both.other
        stiffness = job.identify()
        log, log_of_other = job.log(job.first, job.planned, "log.csv"), other.log(other.first, other.planned, "log.csv")
        cut, cut_of_other = (CUT.format(depth=part.get("wall_depth_mm", 4.0)) for part in (PART, OTHER))
        rows = {"first part again: not learned": gone(job, corrected(job, log, stiffness)),
                "first part again: not learned, material stated": gone(job, corrected(job, log, stiffness, cut=cut)),
                "first part again: not learned, accuracy and motion stated": gone(
                    job, corrected(job, log, stiffness, cut=ERRS)),
                "mirrored, without noise": gone(job, mirrored(job, job.first, 0.0)),
                f"mirrored, noise {PROBE_UM:g} um": gone(job, mirrored(job, job.first, PROBE_UM)),
                "mirrored, noise 10 um": gone(job, mirrored(job, job.first, 10.0)),
                "another part: not learned": gone(other, corrected(other, log_of_other, stiffness)),
                "another part: not learned, material stated": gone(
                    other, corrected(other, log_of_other, stiffness, cut=cut_of_other))}
        said = []
        try:
            learning, learned = job.learn(stiffness, log, job.measure(job.first, "points.csv", PROBE_UM))
        except compstiff.CompstiffError as stopped:
            return rows, [f"{seed}: {stopped.findings[0].code} {stopped.findings[0].message}"]
        figures = learning.as_dict()
        remainder = figures["remainder"]
        said.append(f"{seed}: factor {figures['motion']['scale']:.3f} ({figures['motion']['std']:.3f}), remainder "
                    f"{figures['parts_um']['remainder']:.1f} um over {remainder['length_mm'] if remainder else 0:.0f} mm, left "
                    f"{figures['parts_um']['left']:.1f} um, held out {figures['held_out']['known_um']:.1f} -> "
                    f"{figures['held_out']['physical_um']:.1f} -> {figures['held_out']['learned_um']:.1f} um")
        for repeats in ("nothing", "setup", "job"):
            rows[f"first part again: learned, --repeats {repeats}"] = gone(
                job, corrected(job, log, stiffness, learned, repeats))
        for repeats in ("nothing", "setup"):
            rows[f"another part: learned, --repeats {repeats}"] = gone(
                other, corrected(other, log_of_other, stiffness, learned, repeats))
        rows["another part: learned, --repeats nothing, accuracy and motion stated"] = gone(
            other, corrected(other, log_of_other, stiffness, learned, "nothing", ERRS))
        rows["first part again: learned, --repeats job, material stated"] = gone(
            job, corrected(job, log, stiffness, learned, "job", cut))
        tightened = job.correct(log, stiffness, settings(learned=learned, repeats="job", tighten_zones=True),
                                job.cell_with("cell_cut.yaml", cut))
        rows["first part again: learned, --repeats job, material stated, --tighten-zones"] = gone(job, tightened)
        for words, made in (("not learned", corrected(job, log, stiffness, cut=cut)), ("learned, --tighten-zones", tightened)):
            said.append(f"{seed}: share of the square that is left at the corners, {words}: {at_corners(job, made):.0f} %")
        rows |= second_measured(job, log, stiffness)
        rows["another part: learned, --repeats setup, material stated"] = gone(
            other, corrected(other, log_of_other, stiffness, learned, "setup", cut_of_other))
        normal = job.measure(job.first, "normals.csv", PROBE_UM, along_normal=True)
        try:
            _, learned = job.learn(stiffness, log, normal, radius=1e-3 * job.cutter.radius_mm, within=2e-3)
            rows["first part again: learned along normals alone, --repeats job"] = gone(
                job, corrected(job, log, stiffness, learned, "job"))
        except compstiff.CompstiffError as stopped:
            said.append(f"{seed}, normals: {stopped.findings[0].code} {stopped.findings[0].message}")
        return rows, said


def noise(arguments: tuple[int, float, bool]) -> tuple[int, int, list[float], int]:
    """One robot, parts that are off by deflection and noise alone: of how many a remainder is learned, how many are refused,
    what the prediction of the program changes by [um], and how often set-up or drift are seen."""
    seed, std_um, shared = arguments
    with tempfile.TemporaryDirectory() as folder:
        job = ErringJob(Path(folder), seed, part=slot_and_pocket(**PART), motion=1.0)
        stiffness = job.identify()
        log = job.log(job.first, job.planned, "log.csv")
        cell = compstiff.read_cell(job.cell)
        program, model = compstiff.read_toolpath(job.program, cell), compstiff.read_stiffness(stiffness, cell)
        before = compstiff.predict(cell, program, model, log, settings()).prediction.position
        found, refused, changed, of_job = 0, 0, [], 0
        for draw in range(DRAWS):
            rng = np.random.default_rng([seed, 93, draw])
            off = job.first.off_um.copy()
            if shared:
                walk = rng.standard_normal(off.shape)
                for step in range(1, len(walk)):        # over 3 mm
                    walk[step] = 0.85 * walk[step - 1] + np.sqrt(1 - 0.85**2) * walk[step]
                off = off + std_um * walk
            try:
                points = job.measure(job.first, "points.csv", std_um, seed=draw, values_um=off)
                learning, learned = job.learn(stiffness, log, points)
            except compstiff.CompstiffError:
                refused += 1
                continue
            found += learning.as_dict()["remainder"] is not None
            of_job += learning.setup_on or learning.drift_on
            after = compstiff.predict(cell, program, model, log, settings(learned=learned)).prediction.position
            changed.append(1e6 * rms(np.linalg.norm(after - before, axis=1)))
        return found, refused, changed, of_job


def asked(job: ErringJob, stiffness: Path, log: Path, points: Path, *, cause: bool) -> tuple[Learning, Path]:
    """Learned with or without the question for causes."""
    with patch("compensator.learning.learn.ask", ask if cause else lambda fitted, _: Asked(None, fitted.terms.rows)):
        return job.learn(stiffness, log, points)


def caused(arguments: tuple[str, int, float, bool]) -> tuple[str, str, float, str]:
    """`said_of`, or that the robot is so soft, or the effect so steep, that the simulated cut finds no balance."""
    try:
        return said_of(arguments)
    except RuntimeError as stopped:
        return arguments[0], "not milled", 1.0, f"| {arguments[0]} | {arguments[1]} | {stopped} | | | | |"


def said_of(arguments: tuple[str, int, float, bool]) -> tuple[str, str, float, str]:
    """One robot, to which an effect came ("" none): the verdict, p, and a line of the table. erring: by a kinematic error and
    warming too."""
    effect, seed, motion, erring = arguments
    with tempfile.TemporaryDirectory() as folder:
        astray = drawn(seed, 0.2, 0.04) if erring else None
        came = () if effect == TURNED else parse(effect)
        job = ErringJob(Path(folder), seed, part=slot_and_pocket(**PART), motion=motion, astray=astray, since=came)
        if effect == TURNED:                # not as cell.yaml says
            job.sensor = replace(job.sensor, turn=Rotation.from_euler("z", TURN_DEG, degrees=True) * job.sensor.turn)
        stiffness = job.identify()
        log = job.log(job.first, job.planned, "log.csv")
        points = job.measure(job.first, "points.csv", PROBE_UM)
        try:
            learning, learned = asked(job, stiffness, log, points, cause=True)
        except compstiff.CompstiffError as stopped:
            return effect, stopped.findings[0].code, 0.0, f"| {effect} | {seed} | {stopped.findings[0].code} | | | | |"
        causes = learning.as_dict()["causes"]
        names = ", ".join(f"{each['effect']}{'' if each['joint'] is None else ':' + str(each['joint'])} "
                          f"{100 * each['probability']:.0f} %" for each in causes["causes"][:3])
        if not causes["carried"]:
            return effect, causes["verdict"], causes["p_value"], (
                f"| {effect or 'nothing'} | {seed} | {causes['verdict']} {names} | {causes['p_value']:.3f} | | | "
                f"{causes['withdrawn']} |")
        with_it = gone(job, corrected(job, log, stiffness, learned, "job"))
        _, learned = asked(job, stiffness, log, points, cause=False)
        without = gone(job, corrected(job, log, stiffness, learned, "job"))
        left_out = " -> ".join(f"{each:.1f}" for each in causes["left_out_um"])
        values = ", ".join(f"{each['estimate']:.3g} +- {each['std']:.2g}" for each in causes["parameters"])
        truth = ", ".join(f"{value:.3g}" for came in job.came for value in came["parameters"].values())
        return effect, causes["verdict"], causes["p_value"], (
            f"| {effect or 'nothing'} | {seed} | {causes['verdict']} {names} | {causes['p_value']:.3f} | {left_out} | "
            f"{without[2]:.1f} -> {with_it[2]:.1f} % | {values} ({truth}) |")


def print_causes(pool: ProcessPoolExecutor, seeds: range) -> None:
    """What `learn` names: nothing hidden on every robot, each effect on every seventh of them."""
    print("| came after the load test | seed | said | p | stretches left out [um] | gone of the second part | parameters "
          "(truth) |\n|---|---|---|---|---|---|---|")
    for words, motion, erring in (("nothing; noise alone", 1.0, False), (f"nothing; springs {MOTION:g} times as soft, "
                                                                        "kinematic error, warming", MOTION, True)):
        every = list(pool.map(caused, [("", seed, motion, erring) for seed in seeds]))
        said = Counter(verdict for _, verdict, _, _ in every)
        low = sum(p <= 0.05 for _, verdict, p, _ in every if verdict != "not milled")
        print(*(line for _, verdict, _, line in every if verdict not in ("adequate", "not milled")), sep="\n")
        print(f"| {words} | {len(every)} robots | {', '.join(f'{name}: {count}' for name, count in said.items())} | <= 0.05: "
              f"{low} | | | |", flush=True)
    for effect in CAUSES:
        for _, _, _, line in pool.map(caused, [(effect, seed, MOTION, True) for seed in seeds[::7]]):
            print(line, flush=True)


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("robots", type=int, nargs="?", default=6)
    parser.add_argument("first_seed", type=int, nargs="?", default=8100)
    parser.add_argument("--only", choices=["parts", "noise", "causes"])
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--arms", nargs="*", default=[], choices=list(ARMS))
    options = parser.parse_args()
    seeds = range(options.first_seed, options.first_seed + options.robots)
    with ProcessPoolExecutor(options.workers) as pool:
        if options.only in (None, "parts"):
            table: dict[str, list[Gone]] = defaultdict(list)
            for rows, said in pool.map(robot, seeds, islice(cycle(options.arms or [None]), len(seeds))):
                print(*said, sep="\n", flush=True)
                for name, values in rows.items():
                    table[name].append(values)
            print(f"\n{len(seeds)} robots from seed {seeds[0]}. Mean (worst robot)")
            print("| program | off before [um] RMS | after | gone | within 2 sigma | worse | robots |\n" + 7 * "|---" + "|")
            for name, values in sorted(table.items()):
                before, after, share, within = np.array(values).T
                print(f"| {name} | {before.mean():.0f} | {after.mean():.1f} ({after.max():.1f}) | {share.mean():.1f} % "
                      f"({share.min():.1f}) | {within.mean():.1f} % ({within.min():.0f}) | {int((share < 0).sum())} | "
                      f"{len(values)} |")
        if options.only in (None, "causes"):
            print_causes(pool, seeds)
        if options.only in (None, "noise"):
            print(f"\nDeflection and noise alone: {DRAWS} parts a robot. Limit of a remainder by chance: "
                  f"{100 * FALSE_RATE:g} %")
            print("| noise | remainder learned | set-up or drift seen | refused | prediction changed by [um] RMS, mean "
                  "(largest) |\n|---|---|---|---|---|")
            few = seeds[:(len(seeds) + 1) // 2]
            for std_um in NOISES_UM:
                for shared in (False, True):
                    done = list(pool.map(noise, [(seed, std_um, shared) for seed in few]))
                    number = DRAWS * len(few)
                    changed = np.concatenate([each[2] for each in done])
                    print(f"| {std_um:g} um{', shared over 3 mm besides' if shared else ''} | "
                          f"{sum(each[0] for each in done)} of {number} | {sum(each[3] for each in done)} | "
                          f"{sum(each[1] for each in done)} | {changed.mean():.2f} ({changed.max():.2f}) |", flush=True)


if __name__ == "__main__":
    main()

"""Does the program find poses at which something is wrong? The virtual cell hides it at one pose, the visits' test is judged.

    OMP_NUM_THREADS=1 python benchmarks/bad_poses.py [CASES] [FIRST_SEED] [--design DESIGN] [--kind KIND] [--diagnose]

Seeds FIRST_SEED ... FIRST_SEED + CASES - 1, none skipped, for every design and every kind of data. Nothing wrong: noise near
its sheet (`sheet`), with Student-4 readings (`tails`), with little of it (`quiet`), with a force error of 0.5 % that all of a
pose's readings share (`shared`). Wrong at one pose: an angle in the table with a digit changed, lost, two exchanged, or the
other sign (`table`), a hose that takes a quarter of the force along its direction (`hose`), an axis that sticks (`stick`).

alarms: of a family-wise p under 5 % and under 1 %, and of visits left out (0.5 % is promised). found: exactly that pose is left
out, by what the mistake makes of its readings in units of their noise; mended: the angle that was right is among the changes
that are told, first: it is the first of them. `--diagnose`: the verdicts of the whole procedure, some seconds a case.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections import Counter
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from identification.common.findings import CompstiffError
from identification.diagnosis.diagnose import diagnose
from identification.fit.bad_visits import bad_visits
from identification.fit.load_test import LoadTest
from identification.fit.mending import with_mends
from identification.fit.posterior import posterior
from identification.measurements import Measurements, read_measurements
from identification.model.cell import Cell, read_cell
from tests.virtual_cell.cell import Case, Hidden, simulate
from tests.virtual_cell.effects_at_poses import mistaken_pose, rewrite, table
from tests.virtual_cell.noise import Noise, force_errors, readings

DESIGNS = ("ladder12", "poses20")
NULLS, WRONG = ("sheet", "tails", "quiet", "shared"), ("table", "hose", "stick")
# What a mistake makes of the readings, in units of their noise: what cannot be seen, may be seen, must be seen.
SIZES = (1.0, 3.0)


@dataclass(frozen=True)
class Result:
    """One case. size: RMS of what is wrong over that of the noise, of the pose's readings; found: names of the visits left out;
    place: of the right angle among what would mend it, from 0, None where it is not told; refused: by the reader."""

    kind: str
    p_value: float = 1.0
    size: float = 0.0
    truth: str = ""
    found: tuple[str, ...] = ()
    told: int = 0
    place: int | None = None
    refused: bool = False
    verdict: str = ""


def noise_of(seed: int, kind: str) -> Noise:
    """Near its sheet, which is stated; heavy tails or next to none where the kind says so."""
    rng = np.random.default_rng([seed, 5])
    sensor = float(rng.uniform(1, 5))
    noise = Noise(
        sensor_um=sensor, force_relative=float(rng.uniform(0.003, 0.01)), force_n=float(rng.uniform(0.5, 1.0)),
        pose_offset_um=float(rng.uniform(0.5, 6.0)), quantum_um=0.1,
        stated_sensor_um=round(sensor * float(rng.uniform(0.7, 1.4)), 1), stated_force_n=0.7,
        stated_force_relative=0.005, stated_pose_offset_um=4.0)
    if kind == "tails":
        return replace(noise, degrees_of_freedom=4)
    if kind == "quiet":
        return replace(noise, sensor_um=1.0, stated_sensor_um=0.8, pose_offset_um=0.5)
    return noise


def hidden_in(seed: int, kind: str) -> tuple[Hidden, ...]:
    if kind == "hose":
        return (Hidden("hose_drags"),)
    if kind == "stick":
        return (Hidden("axis_sticks", int(np.random.default_rng([seed, 7]).integers(1, 7))),)
    return ()


def with_shared_force_error(case: Case, seed: int) -> Case:
    """The same case, measured with a force cell whose scale is another at each pose, by 0.5 %."""
    rng = np.random.default_rng([seed, 6])
    scale = 1 + 0.005 * rng.standard_normal(int(case.design.pose.max()) + 1)
    case.plant.force_faults.append(lambda force, row: scale[row.pose] * force)
    seen = case.plant.displacement(case.design, force_errors(case.noise, case.design, rng))[1]
    return replace(case, deflection_um=readings(case.noise, case.design, 1e6 * seen, rng))


def mistaken(case: Case, file: Path, seed: int) -> tuple[str, str, float]:
    """Writes a wrong angle at one pose; the pose, what would mend it, and the RMS [um] that it makes of the readings."""
    rng = np.random.default_rng([seed, 7])
    number, axis = int(rng.integers(1, int(case.design.pose[~case.validate].max()) + 1)), int(rng.integers(6))
    pose, column = f"P{number}", f"q{axis + 1}_deg"
    right = next(row for row in table(file) if row["pose"] == pose)[column]
    wrong, _ = mistaken_pose(right, rng)
    rewrite(file, pose, {column: wrong})
    mine = case.design.pose == number
    theta = case.theta[mine].copy()
    theta[:, axis] = np.radians(float(wrong))
    part = {name: getattr(case.design, name)[mine] for name in ("load", "time", "dwell", "pose", "validate")}
    there = case.plant.displacement(replace(case.design, theta=theta, **part))[0]
    return pose, f"axis {axis + 1} is {float(wrong):.9g} in the table; {right} would fit", float(
        np.sqrt(np.mean((1e6 * there - case.clean_um[mine]) ** 2)))


def one(design: str, kind: str, seed: int, whole: bool) -> Result:
    case = simulate(seed, design, hidden_in(seed, kind), noise=noise_of(seed, kind))
    if kind == "shared":
        case = with_shared_force_error(case, seed)
    truth, right, size = "", "", 0.0
    with tempfile.TemporaryDirectory() as folder:
        cell_file, file = case.write(folder)
        if kind == "table":
            truth, right, size = mistaken(case, file, seed)
        elif case.hidden:
            number, = case.truth[0]["parameters"]["poses"]
            truth, size = f"P{number}", float(np.sqrt(np.mean(case.effect_um[case.design.pose == number] ** 2)))
        size /= float(np.hypot(case.noise.sensor_um, case.noise.pose_offset_um))
        try:
            cell = read_cell(cell_file)
            measurements = read_measurements(file, cell.robot)
        except CompstiffError:
            return Result(kind, size=size, truth=truth, refused=True)
    fitted = posterior(LoadTest.of(cell, measurements))
    test = bad_visits(fitted)
    bad = with_mends(test, test.rest, measurements) if test.rest else ()
    told = [mend.what for visit in bad if visit.score.name == truth for mend in visit.mends]
    return Result(kind, test.p_value, size, truth, tuple(visit.score.name for visit in bad), len(told),
                  told.index(right) if right in told else None, verdict=_verdict(cell, measurements) if whole else "")


def _verdict(cell: Cell, measurements: Measurements) -> str:
    found = diagnose(cell, measurements).as_dict()
    names = "+".join(f"{cause['effect']}" for cause in found["causes"])
    return f"{found['verdict']} {names}".strip()


def summary(design: str, results: list[Result], whole: bool) -> None:
    kind, count = results[0].kind, len(results)
    if kind in NULLS:
        p_values = np.array([result.p_value for result in results])
        out = sum(bool(result.found) for result in results)
        print(f"{design:9} {kind:7} {count:4} cases: p <= 5 % in {100 * np.mean(p_values <= 0.05):4.1f} %, p <= 1 % in "
              f"{100 * np.mean(p_values <= 0.01):4.1f} %, visits left out in {out} ({100 * out / count:.1f} %)", flush=True)
    else:
        classes = np.digitize([result.size for result in results], SIZES)
        for number, name in enumerate(("under 1", "1 to 3", "over 3")):
            some = [result for result, mine in zip(results, classes, strict=True) if mine == number]
            exactly = [result for result in some if result.found == (result.truth,)]
            others = sum(bool(set(result.found) - {result.truth}) for result in some)
            line = (f"{design:9} {kind:7} {name:7} of the noise {len(some):4}: found {len(exactly):3}, another pose too or "
                    f"instead {others:2}, refused {sum(result.refused for result in some):2}")
            if kind == "table":
                places = [result.place for result in exactly]
                line += f"; mended {sum(place is not None for place in places):3}, first {places.count(0):3}"
            else:
                line += f"; a slip of the table told {sum(bool(result.told) for result in exactly):2}"
            print(line, flush=True)
    if whole:
        print("          ", dict(Counter(result.verdict for result in results).most_common(8)), flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("cases", nargs="?", type=int, default=20)
    parser.add_argument("first_seed", nargs="?", type=int, default=0)
    parser.add_argument("--design", choices=DESIGNS, action="append")
    parser.add_argument("--kind", choices=(*NULLS, *WRONG), action="append")
    parser.add_argument("--diagnose", action="store_true")
    given = parser.parse_args()
    for design in given.design or DESIGNS:
        for kind in given.kind or (*NULLS, *WRONG):
            seeds = range(given.first_seed, given.first_seed + given.cases)
            summary(design, [one(design, kind, seed, given.diagnose) for seed in seeds], given.diagnose)


if __name__ == "__main__":
    main()

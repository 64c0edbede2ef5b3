"""Are the mistakes that people make in the table or the cell file found, and is one named where there is none?

    OMP_NUM_THREADS=1 python benchmarks/mistakes.py planted [SEEDS] [FIRST_SEED]
    OMP_NUM_THREADS=1 python benchmarks/mistakes.py none [SEEDS] [FIRST_SEED]
    OMP_NUM_THREADS=1 python benchmarks/mistakes.py look [SEEDS] [FIRST_SEED]

`planted`: every mistake of tests/runs/mistakes/planted.py, SEEDS data sets each, in turn on the robots there (the virtual
cell, which shares no physics with the packages, and three built-in ones simulated with the packages' plain model), realistic
noise that the cell file states nominally; with --shop in load tests of the second cell, planned as a shop might. Mistakes that
are too small to be seen count as silent. `none`: the virtual cell with nothing hidden, with one effect of the dictionary, with
one outside it, on three designs: no mistake is there to be named. There `diagnose` runs only where the search finds a mistake
that physics might still beat, since without one it can name none.
`look`: what `check` says of both without a fit, and how near the sets without a mistake come to what it takes for implausible.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from identification.common.findings import CompstiffError
from identification.diagnosis.diagnose import diagnose
from identification.fit.load_test import LoadTest
from identification.fit.mistakes.first_look import first_look, times_smaller, unexplained, with_readings
from identification.fit.mistakes.judge import NamedMistake, beyond_the_fit, mistakes_in
from identification.fit.posterior import posterior
from identification.measurements import Measurements, read_measurements
from identification.model.cell import Cell, read_cell
from tests.runs.hidden_effects.cases import hidden_in
from tests.runs.mistakes.planted import MISTAKES, ROBOTS, SHOP, Files, right, two_robots

TWO = "two robots"
OUTCOMES = ("right", "ambiguous", "unknown", "physics", "WRONG", "silent", "refused")


def read(files: Files) -> tuple[Cell, Measurements]:
    with tempfile.TemporaryDirectory() as folder:
        cell_file, table = files.write(Path(folder))
        cell = read_cell(cell_file)
        return cell, read_measurements(table, cell.robot)


def with_mistake(name: str, seed: int, robot: str) -> tuple[Files, tuple[str, ...]]:
    if name == TWO:
        return two_robots(seed, robot), ("two_robots",)
    case, rng = right(seed, robot), np.random.default_rng([seed, 3])
    for _ in range(20):
        files, truth = MISTAKES[name](case, rng)
        if not np.allclose(numbers(files), numbers(case), equal_nan=True) or name.startswith("TCP"):
            break
    return files, truth


def numbers(rows: Files | Measurements) -> np.ndarray:
    """What the springs see of the loaded rows [deg, N, um, s]: a force and its deflection of the other sign are the same."""
    columns = (rows.theta, rows.force, rows.moved) if isinstance(rows, Files) else (
        np.degrees(rows.theta), rows.wrench[:, :3], 1e6 * rows.deflection)
    first = np.argmax(columns[1] != 0, axis=1)[:, None]
    sign = np.sign(np.take_along_axis(columns[1], first, axis=1))
    return np.column_stack([columns[0], sign * columns[1], sign * columns[2], rows.time, rows.dwell])


def same(mistake: NamedMistake, seed: int, robot: str, truth: tuple[str, ...]) -> bool:
    """Whether it is what was planted, or mends the rows all the same."""
    key, candidate = mistake.key, mistake.candidate
    unit = "unit" in truth and key in ("force_unit", "deflection_unit")
    mended = candidate.mistake.mended(candidate.data, candidate.rows).rows
    wanted = numbers(right(seed, robot))
    return key in truth or unit or (TWO not in truth and len(mended) == len(wanted) and np.allclose(
        numbers(mended), wanted, rtol=1e-6, atol=1e-3, equal_nan=True))


def planted(seed: int, name: str, robot: str) -> tuple[str, str, float]:
    """Outcome, what was said, seconds."""
    files, truth = with_mistake(name, seed, robot)
    before = time.process_time()
    try:
        found = diagnose(*read(files))
    except CompstiffError as refused:
        return "refused", refused.findings[0].code, time.process_time() - before
    seconds = time.process_time() - before
    mistakes = found.judgement.mistakes
    hit = [same(mistake, seed, robot, truth) for mistake in mistakes]
    causes = (*found.causes, *found.alternatives)
    said = " ".join([*(mistake.key for mistake in mistakes), *(cause.label for cause in causes[:2])])
    if found.verdict == "mistake":
        return ("right" if hit[0] else "WRONG"), said, seconds
    if found.verdict == "ambiguous":
        return ("ambiguous" if any(hit) else "WRONG" if mistakes else "physics"), said, seconds
    return {"adequate": "silent", "named": "physics"}.get(found.verdict, "unknown"), said, seconds


def table_of_planted(seeds: range, names: list[str], robots: tuple[str, ...]) -> None:
    total: Counter[str] = Counter()
    seconds = []
    print(f"{'mistake':24s}" + "".join(f"{outcome:>10s}" for outcome in OUTCOMES))
    for name in names:
        counts: Counter[str] = Counter()
        notes = []
        for number, seed in enumerate(seeds):
            robot = robots[number % len(robots)]
            outcome, said, took = planted(seed, name, robot)
            counts[outcome] += 1
            seconds.append(took)
            if outcome not in ("right", "refused"):
                notes.append(f"{seed} {robot}: {outcome}, {said}")
        total += counts
        print(f"{name:24s}" + "".join(f"{counts[outcome]:10d}" for outcome in OUTCOMES), *(f"\n    {note}" for note in notes),
              sep="", flush=True)
    print(f"{'all':24s}" + "".join(f"{total[outcome]:10d}" for outcome in OUTCOMES))
    print(f"CPU seconds of diagnose: median {np.median(seconds):.1f}, largest {max(seconds):.1f}")


def without(seed: int, kind: str, design: str) -> str:
    """What is said of a data set without a mistake, "" where no mistake is."""
    cell, rows = read(right(seed, design=design, hidden=hidden_in(seed, kind)))
    try:
        plain = posterior(LoadTest.of(cell, rows))
        if beyond_the_fit(plain) is None and not mistakes_in(plain).possible:
            return ""
        found = diagnose(cell, rows)
    except CompstiffError as refused:
        return f"refused {refused.findings[0].code}"
    keys = [mistake.key for mistake in found.judgement.mistakes]
    return f"{found.verdict} {' '.join(keys)}" if keys else ""


def table_of_none(seeds: range) -> None:
    total = named = beside = 0
    for kind in ("null", "single", "outside"):
        for design in ("ladder12", "poses20", "paper5"):
            said = [(seed, without(seed, kind, design)) for seed in seeds]
            mine = [f"{seed}: {text} (hidden {hidden_in(seed, kind)})" for seed, text in said if text]
            named += sum(text.startswith("mistake") for _, text in said)
            beside += sum(text.startswith("ambiguous") for _, text in said)
            total += len(said)
            print(f"{kind:10s} {design:10s} {len(said):5d} data sets, {len(mine)} with a mistake", *mine, sep="\n    ",
                  flush=True)
    print(f"of {total}: a mistake named in {named} ({100 * named / total:.2f} %), beside other names in {beside}")


def table_of_looks(seeds: range, names: list[str]) -> None:
    for name in names:
        said: Counter[str] = Counter()
        for number, seed in enumerate(seeds):
            files, _ = with_mistake(name, seed, ROBOTS[number % len(ROBOTS)])
            try:
                found = first_look(LoadTest.of(*read(files)))
            except CompstiffError:
                said["not read"] += 1
            else:
                said["said" if found else "silent"] += 1
        print(f"{name:24s} " + ", ".join(f"{count} {what}" for what, count in sorted(said.items())), flush=True)
    tests = [with_readings(LoadTest.of(*read(right(seed, design=design, hidden=hidden_in(seed, kind)))))
             for kind in ("null", "single", "double", "outside") for design in ("ladder12", "poses20", "paper5")
             for seed in seeds]
    sizes = [times_smaller(test) for test in tests]
    print(f"without a mistake: {len(tests)} data sets, {sum(first_look(test) is not None for test in tests)} alarms; "
          f"no springs explain up to {max(unexplained(test) for test in tests):.1%}; readings {min(sizes):.2f} to "
          f"{max(sizes):.2f} times smaller than the prior's")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=["planted", "none", "look"])
    parser.add_argument("seeds", nargs="?", type=int, default=8)
    parser.add_argument("first", nargs="?", type=int, default=5_100_000)
    parser.add_argument("--only", nargs="+", help="these mistakes")
    parser.add_argument("--shop", action="store_true", help="plans as a shop might make them")
    options = parser.parse_args()
    seeds = range(options.first, options.first + options.seeds)
    print(f"seeds {seeds.start} to {seeds.stop - 1}")
    names = options.only or [*MISTAKES, TWO]
    match options.what:
        case "planted":
            table_of_planted(seeds, names, (SHOP,) if options.shop else ROBOTS)
        case "none":
            table_of_none(seeds)
        case _:
            table_of_looks(seeds, names)


if __name__ == "__main__":
    main()

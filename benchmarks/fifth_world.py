"""The fifth judge's load tests, each with one hidden cause or none: `python benchmarks/fifth_world.py N SEED FOLDER
[CAUSE]`, which hides that cause, or `nothing`, in all of them.

Its author knew the files' formats and neither the program's effects nor what other judges hide. A case is a folder with
cell.yaml, measurements.csv and truth.json; a cause is sized to show by 4 to 30 sigma after six springs were fitted to it,
without noise; causes of one size only show by what they do.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[1]))

import numpy as np
import yaml

from benchmarks.fifth_arm import WEIGHT, Array
from benchmarks.fifth_causes import CAUSES, Cause
from benchmarks.fifth_trial import ARMS, INSTRUMENTS, Hidden, Trial, sheet_of, table_of, trial, visible

NOTHING = Cause("nothing", "nothing", 0.0, lambda rng, one, size: Hidden(), fixed=True)
LARGEST = 60.0                          # a cause that must be so many times its plausible size to be seen is drawn anew


def sized(cause: Cause, one: Trial, seed: int, target: float) -> float | None:
    """The size at which a cause shows by `target` sigmas; none where it does not within a sane size."""
    size = cause.size
    for _ in range(12):
        hidden = cause.make(np.random.default_rng(seed), one, size)
        seen = visible(one, table_of(one, hidden, np.random.default_rng(seed), False))
        if abs(np.log(seen / target)) < 0.1:
            return size
        size *= float(np.clip(target / seen, 0.2, 5))
        if not cause.size / LARGEST < size < cause.size * LARGEST:
            return None
    return None


def case(cause: Cause, rng: np.random.Generator) -> tuple[Trial, Hidden, float, float, int]:
    """A test in which this cause can be seen, what is hidden in it, its size, by how many sigmas it shows, and the seed that
    the cause was made with."""
    while True:
        one = trial(str(rng.choice(ARMS)), str(rng.choice(cause.designs)), INSTRUMENTS[rng.integers(len(INSTRUMENTS))], rng)
        target, seed = float(np.exp(rng.uniform(np.log(4), np.log(30)))), int(rng.integers(2**31))
        try:
            size = cause.size if cause.fixed else sized(cause, one, seed, target)
            if size is None:
                continue
            hidden = cause.make(np.random.default_rng(seed), one, size)
            return one, hidden, size, visible(one, table_of(one, hidden, np.random.default_rng(seed), False)), seed
        except ArithmeticError:
            continue


def deck(count: int, rng: np.random.Generator) -> Iterator[Cause]:
    """A fifth with nothing hidden; of the others each before any comes again."""
    waiting: list[Cause] = []
    for n in range(count):
        if n % 5 == 4:
            yield NOTHING
            continue
        if not waiting:
            waiting = [CAUSES[int(i)] for i in rng.permutation(len(CAUSES))]
        yield waiting.pop()


def written(one: Trial, table: dict[str, Array], sheet: dict[str, Any], truth: dict[str, Any], folder: Path) -> None:
    folder.mkdir(parents=True)
    (folder / "cell.yaml").write_text(yaml.safe_dump(sheet, sort_keys=False), encoding="utf-8")
    (folder / "truth.json").write_text(json.dumps(truth, indent=1), encoding="utf-8")
    hung = one.design == "dead weights"
    force = ["mass_kg"] if hung else ["fx_n", "fy_n", "fz_n"]
    lines = [",".join([*(f"q{j}_deg" for j in range(1, 7)), *force, "dx_um,dy_um,dz_um,time_s,dwell_s,reference,pose"])]
    for row, visit in enumerate(one.visit):
        load = [f"{-table['force'][row, 2] / WEIGHT:.2f}"] if hung else [f"{value:.1f}" for value in table["force"][row]]
        lines.append(",".join([*(f"{value:.4f}" for value in np.degrees(table["shown"][row])), *load,
                               *(f"{value * 1e6:.1f}" for value in table["moved"][row]), f"{table['time'][row]:.0f}", "20",
                               f"R{visit + 1}", f"P{visit + 1}"]))
    (folder / "measurements.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")


def made(count: int, seed: int, folder: Path, only: str = "") -> Iterator[dict[str, Any]]:
    """Write the cases, one after the other; each has a generator of its own."""
    wanted = [cause for cause in (*CAUSES, NOTHING) if cause.name == only]
    causes = wanted * count if only else deck(count, np.random.default_rng(seed))
    for n, cause in enumerate(causes):
        rng = np.random.default_rng([seed, n])
        one, hidden, size, sigmas, _ = case(cause, rng)
        truth = {"cause": cause.name, "of": cause.of, **hidden.told, "size": float(size), "sigmas": round(sigmas, 1),
                 "robot": one.robot, "design": one.design, "instrument": one.instrument.name, "seed": [seed, n],
                 "stiffness_nm_per_rad": [float(k) for k in one.stiffness]}
        written(one, table_of(one, hidden, rng), sheet_of(one, rng), truth, folder / f"{n:03d}")
        yield truth


def main(count: int, seed: int, folder: Path, only: str = "") -> None:
    print(f"seed {seed}")
    for n, truth in enumerate(made(count, seed, folder, only)):
        where = f"{truth['robot']:18} {truth['design']:12} {truth['instrument']:11}"
        print(f"{n:03d} {truth['cause']:17} {where} size {truth['size']:.3g}, {truth['sigmas']:.1f} sigma", flush=True)


if __name__ == "__main__":
    main(int(sys.argv[1]), int(sys.argv[2]), Path(sys.argv[3]), *sys.argv[4:])

"""A track that yields under the robot, hidden in load tests of the virtual cell: how often `diagnose` names it.

    python benchmarks/soft_track.py [--first 9900] [--count 10]

Per size `count` seeds, 20 poses with load cycles and realistic noise, in a cell whose file has the track; and as many with
nothing hidden. right: the track alone is named; ambiguous: it is among the rivals; other: another cause is named, or the track
with one; missed: unknown or adequate.
"""

from __future__ import annotations

import argparse
import sys
from collections import Counter
from pathlib import Path
from tempfile import TemporaryDirectory

sys.path.insert(0, str(Path(__file__).parents[1]))

from identification.diagnosis.diagnose import diagnose
from identification.measurements import read_measurements
from identification.model.cell import read_cell
from tests.virtual_cell.cell import Case, Hidden, simulate
from tests.virtual_cell.effects_track import UNITS

SIZES = (0.25, 0.5, 1.0, 2.0)


def judged(case: Case) -> tuple[str, str, float]:
    """Verdict, the names given, and the effect's RMS [um] in the readings."""
    with TemporaryDirectory() as folder:
        cell_file, table = case.write(Path(folder))
        cell_file.write_text(cell_file.read_text() + UNITS)
        cell = read_cell(cell_file)
        found = diagnose(cell, read_measurements(table, cell.robot)).as_dict()
    ambiguous = found["verdict"] == "ambiguous"
    names = ("|" if ambiguous else "+").join(cause["effect"] for cause in found["alternatives" if ambiguous else "causes"])
    return found["verdict"], names, float((case.effect_um**2).mean() ** 0.5)


def outcome(verdict: str, names: str) -> str:
    """What became of a hidden track."""
    if verdict == "named":
        return "right" if names == "soft_track" else "other"
    if verdict == "ambiguous":
        return "ambiguous" if "soft_track" in names else "other"
    return "missed"


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--first", type=int, default=9900)
    options.add_argument("--count", type=int, default=10)
    asked = options.parse_args()
    seeds = range(asked.first, asked.first + asked.count)
    for size in SIZES:
        counts: Counter[str] = Counter()
        for seed in seeds:
            verdict, names, rms = judged(simulate(seed, "poses20", [Hidden("soft_track", None, size)]))
            counts[outcome(verdict, names)] += 1
            print(f"size {size:g}, seed {seed}: effect {rms:5.1f} um RMS, {verdict} {names}", flush=True)
        print(f"size {size:g}: {dict(counts)}", flush=True)
    alarms: Counter[str] = Counter()
    for seed in seeds:
        verdict, names, _ = judged(simulate(seed + 50, "poses20"))
        alarms[f"{verdict} {names}".strip()] += 1
    print(f"nothing hidden: {dict(alarms)}", flush=True)


if __name__ == "__main__":
    main()

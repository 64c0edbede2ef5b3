"""Does a log tell that its cutter has another number of teeth, or its spindle another speed, than cell.yaml says?

    OMP_NUM_THREADS=1 python benchmarks/teeth.py [CUTS] [FIRST_SEED]

Programs of the virtual cell with cutters of 2, 3 and 4 teeth, an axis that is off by 0 to 10 um, 6000 to 12000 rpm, chips,
walls and material drawn, logged at 2000 Hz. Told: CS3094 (the ripple), or CS3035 (another period than the stated turn). What is
right is told in none.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections import Counter
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from compensator.forces.log import read_force_log
from compensator.forces.ripple import said_of_teeth
from tests.runs.milling.milling_job import MillingJob
from tests.virtual_cell.endmill import EndMill
from tests.virtual_cell.milled_part import slot_and_pocket

TEETH = (2, 3, 4)


def job(seed: int, folder: Path) -> MillingJob:
    rng, teeth = np.random.default_rng([seed, 5]), TEETH[seed % len(TEETH)]
    off, way, usual = rng.uniform(0, 0.010), rng.uniform(0, 2 * np.pi), EndMill()
    part = slot_and_pocket(spacing_mm=rng.uniform(1, 2), allowance_mm=rng.uniform(0.8, 2.5), wall_depth_mm=rng.uniform(3, 6))
    shear = np.array(usual.shear_n_mm2) * np.exp(rng.normal(0, 0.2) + rng.normal(0, 0.1, 3))
    edge = np.array(usual.edge_n_mm) * np.exp(rng.normal(0, 0.3) + rng.normal(0, 0.1, 3))
    rpm = float(rng.choice([6000, 9000, 12000]))
    return MillingJob(folder, seed, part=part, cutter=EndMill(
        teeth=teeth, spindle_rpm=rpm, feed_mm_s=round(0.08 * teeth * rpm / 60 * rng.uniform(0.7, 1.2), 1),
        runout_mm=tuple(float(off * np.cos(way + 2 * np.pi * tooth / teeth)) for tooth in range(teeth)),
        shear_n_mm2=tuple(shear), edge_n_mm=tuple(edge)))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("cuts", nargs="?", type=int, default=30)
    parser.add_argument("first_seed", nargs="?", type=int, default=100)
    chosen = parser.parse_args()
    told: Counter[str] = Counter()
    every: Counter[str] = Counter()
    for seed in range(chosen.first_seed, chosen.first_seed + chosen.cuts):
        with tempfile.TemporaryDirectory() as folder:
            milled = job(seed, Path(folder))
            true, rpm = milled.cutter.teeth, milled.cutter.spindle_rpm
            file = milled.log(milled.first, milled.planned, "log.csv")
            logs = {share: read_force_log(file, spindle_rpm=share * rpm) for share in (1.0, 0.5, 2.0)}
        cases = [("right", 1.0, true), (f"half the speed, {true} teeth", 0.5, true),
                 (f"twice the speed, {true} teeth", 2.0, true)]
        cases += [(f"{stated} teeth for {true}", 1.0, stated) for stated in (*TEETH, 6) if stated != true]
        for name, share, teeth in cases:
            log = logs[share]
            every[name] += 1
            told[name] += bool(said_of_teeth(log.ripple, teeth, "") or any(one.code == "CS3035" for one in log.findings))
    for name in sorted(every):
        print(f"{name:28s} told in {told[name]} of {every[name]}")


if __name__ == "__main__":
    main()

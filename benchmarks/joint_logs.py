"""Effects hidden in simulated joint deflection logs: what `diagnose` says of them; coverage of k; transmission errors.

    python benchmarks/joint_logs.py [LOGS]

10 s records with 20 urad of lasting and as much white noise, tested on a second record. Size 1: 3 ms link delay, 12 ms torque
delay, 300 N m Coulomb and 900 N m s/rad viscous friction, 700 kg m^2, 60 urad hysteresis, 80 urad soft zone, 50 urad half gap.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")
import sys
import tempfile
from collections import Counter
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))
import numpy as np

from identification.motion.log_file import MotionLog, read_motion_log
from identification.motion.procedure import diagnose_axes
from identification.motion.stiffness import axis_stiffness
from identification.motion.transmission import find_transmission
from tests.identification.motion.simulated_joint import FAULTS, STIFFNESS, columns, write
from tests.identification.motion.test_laws_transmission import record

NAMES = {"channel_delay": "channel_delay (link)", "torque_delay": "channel_delay (torque)"}
VERDICTS = ("named", "ambiguous, truth in the set", "wrong name", "ambiguous, truth not in it", "unknown", "adequate")
NOISE = 2e-5
IN_MOTION = {"channel_delay": 1.0, "joint_friction": 1.0, "motor_inertia": 1.0}


def main() -> None:
    """Prints both tables."""
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 10
    with tempfile.TemporaryDirectory() as folder:
        print("| hidden | size | " + " | ".join(VERDICTS) + " |\n" + "|---" * (len(VERDICTS) + 2) + "|")
        for size in (1.0, 0.4):
            for fault in (*FAULTS, "") if size == 1.0 else FAULTS:
                told = Counter(answer(Path(folder), fault, size, seed) for seed in range(count))
                counts = " | ".join(str(told[one]) for one in VERDICTS)
                print(f"| {fault or 'nothing'} | {size:g} | {counts} |", flush=True)
        print("\n| beside the spring | 95 % intervals of k that hold | median width / k |\n|---|---|---|")
        for beside in ({}, IN_MOTION, IN_MOTION | {"angle_error": 0.5}, IN_MOTION | {"hysteresis": 0.5}):
            hit, width = 0, []
            for seed in range(10 * count):
                low, high = axis_stiffness(2, [log(Path(folder), 500 + seed, beside)]).interval_95
                hit += low <= STIFFNESS <= high
                width.append((high - low) / STIFFNESS)
            print(f"| {', '.join(beside) or 'nothing'} | {hit} of {10 * count} | {np.median(width):.3f} |", flush=True)
        print("\n| transmission error hidden | a line is found | found again | at its frequency | a smooth part is found again "
              "|\n|---|---|---|---|---|")
        for name, size, ring in (("nothing", 0.0, 0.0), ("line of 5 urad", 5e-6, 0.0), ("line of 10 urad", 1e-5, 0.0),
                                 ("ring off by 0.2 mrad", 0.0, 2e-4), ("ring off by 0.5 mrad", 0.0, 5e-4)):
            told = np.sum([transmission(Path(folder), size, ring, seed) for seed in range(4 * count)], axis=0)
            print(f"| {name} | " + " | ".join(f"{one} of {4 * count}" for one in told) + " |", flush=True)


def transmission(folder: Path, size: float, ring: float, seed: int) -> tuple[bool, bool, bool, bool]:
    """What is said of a line at a number a turn that is drawn, its phase another in each record, or of an eccentric ring."""
    cycles, phase = np.random.default_rng(seed).uniform((150, 0), (1500, 6))
    pair = [record(folder, start + seed, IN_MOTION, lines={cycles: size}, phase=each, ring=ring)
            for start, each in ((6000, 0.0), (7000, phase))]
    found = find_transmission(2, [pair[0]], pair[1])
    right = any(abs(line.cycles - cycles) < 4 * line.std for line in found.confirmed)
    return bool(found.lines), bool(found.confirmed), size > 0 and right, found.smooth is not None


def log(folder: Path, seed: int, faults: dict[str, float]) -> MotionLog:
    """A simulated record."""
    return read_motion_log(write(folder / "log.csv", columns(seed, faults, seconds=10, noise=NOISE)))


def answer(folder: Path, fault: str, size: float, seed: int) -> str:
    """What the diagnosis says, against the truth."""
    faults = {fault: size} if fault else {}
    one = diagnose_axes([log(folder, 3000 + seed, faults)], log(folder, 4000 + seed, faults), replicates=49)[0]
    truth = NAMES.get(fault, fault)
    if one.verdict == "named":
        return "named" if [cause.shape.name for cause in one.causes] == [truth] else "wrong name"
    if one.verdict == "ambiguous":
        inside = truth in [cause.shape.name for cause in one.alternatives]
        return "ambiguous, truth in the set" if inside else "ambiguous, truth not in it"
    return one.verdict


if __name__ == "__main__":
    main()

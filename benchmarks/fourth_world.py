"""Load tests with one cause hidden in each, by a world of its own: another author's arm, laws and mistakes.

    python benchmarks/fourth_world.py CASES SEED FOLDER [--only CAUSE,...]

writes FOLDER/<nnn>/{cell.yaml,measurements.csv,truth.json}; every fifth case has nothing hidden but realistic
noise. Nothing is judged here. Sizes of causes are engineering judgement: what the best six springs leave of a cause is 3 to 10
times the noise of a reading with that of the force (one in six: up to 25 times). Mistakes of tables have the size they have.
"""

from __future__ import annotations

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import argparse
import json
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import yaml
from fourth_arm import Array, frame, read_arm
from fourth_bench import DESIGNS, ROBOTS, Bench, Random, draw_bench, robot_files
from fourth_gears import GEARS
from fourth_hidden import Hidden, left_over, run, write_table
from fourth_instruments import READING
from fourth_loads import LOADING
from fourth_people import PEOPLE, SIBLINGS
from fourth_structure import STRUCTURE

CAUSES: dict[str, Callable[[Random, Bench], Hidden]] = {**GEARS, **STRUCTURE, **READING, **LOADING, **PEOPLE}
PUSHED = ("cycle", "three", "wrench", "again")
CYCLES = ("cycle", "pulley")
WITH_FORCES = ("single", "cycle", "three", "wrench", "again", "pulley")
RIG = ("single", "cycle", "three", "again")
# where a cause can come up, or can be seen; all others: PUSHED and "mixed"
WHERE: dict[str, tuple[str, ...]] = {
    "bouc_wen": CYCLES,
    "friction_iwan": (*CYCLES, "weights"),
    "hysteresis_all": CYCLES,
    "free_play": ("cycle", "three", "again"),
    "lost_motion": ("cycle", "three", "again"),
    "gauge_sticky": CYCLES,
    "warming": ("again",),
    "crash": ("again", "three", "cycle"),
    "harmonic_three_slopes": ("cycle", "pulley", "three"),
    "power_law": ("cycle", "three", "pulley"),
    "brake_slip": ("cycle", "three", "again"),
    "pulley_friction": ("pulley",),
    "cable_askew": ("pulley",),
    "pan_forgotten": ("weights",),
    "second_disc_wrong": ("weights",),
    "base_not_level": ("weights", "mixed"),
    "payload_compensation": ("mixed",),
    "moment_at_flange": ("wrench",),
    "load_cell_offset": ("cycle", "three", "again"),
    "decanewton": WITH_FORCES,
    "force_sign_some": ("single", "wrench", "pulley"),
    "load_turned": RIG,
    "load_axis_gain": RIG,
    "load_curved": ("cycle", "three", "again"),
    "sensor_crosstalk": RIG,
    "cylinder_leaks": RIG,
    "off_the_tcp": RIG,
    "pose_typo": DESIGNS,
    "shifted_visits": WITH_FORCES,
    "copied_visit": ("three", "cycle", "wrench"),
    "rows_swapped": DESIGNS,
    "digit_slip": DESIGNS,
    "tool_beam": ("three", "wrench", "again"),
    "changer_play": ("cycle", "three", "again"),
    "loose_bolt": ("cycle", "three", "again"),
    "belt_one_way": ("cycle", "three", "again"),
    "millimetres": ("cycle", "three", "wrench"),
    "round_target": ("cycle", "three", "pulley"),
    "force_sensor_soft": ("three", "wrench", "again"),
    "spindle_radial": ("three", "again", "wrench"),
    "flange_bearing": ("three", "again", "wrench"),
    "someone_stands": ("three", "mixed", "weights"),
}
ON_ROBOTS: dict[str, tuple[str, ...]] = {
    "rod_elastic": ("irb6660-205-1.90",),
    "serial_angles": ("irb6660-205-1.90",),
    "wrong_robot": tuple(SIBLINGS),
}

KEEP: dict[str, Callable[[Array], bool]] = {  # poses [deg] that can be written down wrongly without being refused at once
    "serial_angles": lambda q: q[2] - q[1] > -19 and abs(q[2] - 2 * q[1]) < 69,
    "angle_sign": lambda q: bool(np.all(np.abs(q[[0, 3, 5]]) > 3)),
}


@dataclass
class Drawn:
    """A load test with what is hidden in it; what the best six springs leave, and the noise [um]."""

    bench: Bench
    hidden: Hidden | None
    size: float
    left: float
    noise: float


def scaled(rng: Random, bench: Bench, hidden: Hidden, noise: float) -> tuple[float, float]:
    """A size of the cause, and what of it the best six springs leave [um]."""
    target = noise * (rng.uniform(10, 25) if rng.random() < 1 / 6 else np.exp(rng.uniform(np.log(3), np.log(10))))
    size, found = float(np.sqrt(hidden.low * hidden.high)), 0.0
    for _ in range(6 if hidden.scaled else 1):
        table = write_table(bench, hidden, size, run(bench, hidden, size, None), None)
        found = left_over(bench, believed(bench, hidden, size), table)
        if not hidden.scaled or abs(np.log(max(found, 1e-9) / target)) < 0.12:
            break
        wanted = float(np.clip(size * np.clip(target / max(found, 1e-3), 0.1, 10), hidden.low, hidden.high))
        if wanted == size:
            break
        size = wanted
    return size, found


def noise_of(bench: Bench, rng: Random) -> float:
    """Noise of a reading with what the error of the force adds to it [um], without re-seating."""
    moved = [run(bench, None, 0, stream).moved for stream in (None, rng)]
    return float(np.hypot(bench.sigma, 1e6 * np.sqrt(np.mean((moved[1] - moved[0]) ** 2))))


def inside(bench: Bench, table: pd.DataFrame) -> bool:
    """Whether the angles of the table are inside the robot's limits: a table that is refused at once tests nothing."""
    robot = robot_files()[bench.robot]
    q = table[[f"q{i}_deg" for i in range(1, 7)]].to_numpy(float)
    limits = np.array([j["limits_deg"] for j in robot["joints"]])
    well = bool(np.all(q >= limits[:, 0]) and np.all(q <= limits[:, 1]))
    window = (robot.get("coupling") or {}).get("window_deg")
    return well and (window is None or bool(np.all(np.abs(q[:, 2] - q[:, 1] - np.mean(window)) <= np.ptp(window) / 2)))


def believed(bench: Bench, hidden: Hidden | None, size: float) -> Any:
    """The arm that cell.yaml describes."""
    cell = stated(bench, hidden, size)
    return read_arm(
        robot_files()[cell["robot"]], frame(np.array(cell["tool"]["position_mm"]) / 1e3), bench.arm.k, bench.arm.masses
    )


def stated(bench: Bench, hidden: Hidden | None, size: float) -> dict[str, Any]:
    return bench.cell if hidden is None or hidden.cell is None else hidden.cell(size, bench.cell)


def draw(rng: Random, cause: str | None) -> Drawn:
    """A bench with the cause in it, large enough to be seen."""
    best: Drawn | None = None
    for _ in range(12):
        designs = DESIGNS if cause is None else WHERE.get(cause, (*PUSHED, "mixed"))
        bench = draw_bench(rng, designs, ON_ROBOTS.get(cause or "", tuple(ROBOTS)), KEEP.get(cause or ""))
        noise = noise_of(bench, rng)
        if cause is None:
            bench = replace(bench, per_visit=bench.per_visit and rng.random() < 0.7)
            table = write_table(bench, None, 0, run(bench, None, 0, None), None)
            return Drawn(bench, None, 0.0, left_over(bench, bench.arm, table), noise)
        hidden = CAUSES[cause](rng, bench)
        if hidden.extra.get("one_zero"):
            bench = replace(bench, per_visit=False)
        drawn = Drawn(bench, hidden, *scaled(rng, bench, hidden, noise), noise)
        if not inside(bench, write_table(bench, hidden, drawn.size, run(bench, hidden, drawn.size, None), None)):
            continue
        if best is None or drawn.left / noise > best.left / best.noise:
            best = drawn
        if drawn.left > 2.8 * noise:
            break
    if best is None:
        raise SystemExit(f"no load test was found for {cause}")
    return best


def write_case(folder: Path, seed: int, index: int, cause: str | None) -> dict[str, Any]:
    """One case in a folder of its own; another random stream for each."""
    rng = np.random.default_rng(seed + index)
    drawn = draw(rng, cause)
    bench, hidden, size = drawn.bench, drawn.hidden, drawn.size
    table = write_table(bench, hidden, size, run(bench, hidden, size, rng), rng)
    if rng.random() < 0.4 and (hidden is None or hidden.scaled):
        kept = {int(v) for v in rng.choice(bench.rows[-1].visit + 1, 3, replace=False)}
        table["purpose"] = ["validate" if r.visit in kept else "identify" for r in bench.rows]
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "cell.yaml").write_text(yaml.safe_dump(stated(bench, hidden, size), sort_keys=False, default_flow_style=None))
    table.to_csv(folder / "measurements.csv", index=False)
    truth = {
        "name": cause or "nothing",
        "cause": hidden.words if hidden else "nothing but noise",
        "joint": hidden.joint if hidden else "",
        "size": size,
        "unit": hidden.unit if hidden else "",
        "visible": round(drawn.left / bench.sigma, 2),
        "visible_over_noise_with_force": round(drawn.left / drawn.noise, 2),
        "robot": bench.robot,
        "design": bench.design,
        "instrument": bench.instrument,
        "sigma_um": round(bench.sigma, 2),
        "heavy_tails": bench.tails,
        "reseating_um": bench.reseat,
        "force_share": bench.force_share,
        "force_noise_n": bench.force_noise,
        "rows": len(table),
        "visits": bench.rows[-1].visit + 1,
        "largest_load_n": bench.strength,
        "stiffness_nm_per_rad": [float(f"{k:.5g}") for k in bench.arm.k],
    }
    truth |= hidden.extra if hidden else {}
    (folder / "truth.json").write_text(json.dumps(truth, indent=1) + "\n")
    return truth


def order(seed: int, cases: int, only: list[str]) -> list[str | None]:
    """Which cause each case has: all of them in turn, every fifth case none."""
    names = only or list(CAUSES)
    result: list[str | None] = []
    pool: list[str] = []
    rng = np.random.default_rng(seed)
    for index in range(cases):
        if index % 5 == 4 and not only:
            result.append(None)
            continue
        if not pool:
            pool = list(names) if only else [names[i] for i in rng.permutation(len(names))]
        result.append(pool.pop(0))
    return result


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("cases", type=int)
    parser.add_argument("seed", type=int)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--only", default="", help="names of causes, with commas: " + ", ".join(CAUSES))
    args = parser.parse_args()
    only = [name for name in args.only.split(",") if name]
    if unknown := [name for name in only if name not in CAUSES]:
        parser.error(f"no such cause: {', '.join(unknown)}")
    for index, cause in enumerate(order(args.seed, args.cases, only)):
        truth = write_case(args.folder / f"{index:03d}", args.seed, index, cause)
        head = f"{index:03d} {truth['name']:22} {truth['design']:8} {truth['robot']:18} rows {truth['rows']:3}"
        seen = f"{truth['visible']} sigmas of {truth['sigma_um']} um, {truth['visible_over_noise_with_force']} of all noise"
        print(f"{head} size {truth['size']:.3g} {truth['unit']}: {seen}", flush=True)


if __name__ == "__main__":
    main()

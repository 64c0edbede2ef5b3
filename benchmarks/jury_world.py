"""A blind jury's load tests: what a reviewer would hide, written without a look at the dictionary of `diagnose`, then judged.

    python benchmarks/jury_world.py CASES SEED [FOLDER]

Each case is a folder with cell.yaml, robot.yaml, measurements.csv and truth.json, put through `compstiff diagnose` as a user
would: one thing hidden out of `EFFECTS`, two at once, a slip of the table out of `MISTAKES`, or nothing. The size is drawn by
what six springs leave of it: 10 to 160 sigma over all rows together (the first is barely visible), at most half of the
deflection. The numbers of noise are engineering judgement. An answer is `right`, `right in part` (one of two), a `set` that
holds the truth, `unknown`, `missed` (adequate; `not to be seen` under 8 sigma), a `wrong set`, `wrong`, or an `alarm` where
nothing is hidden.
"""

import csv
import json
import os
import subprocess
import sys
import tempfile
from collections import Counter
from pathlib import Path
from typing import Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).resolve().parent))
import numpy as np
from jury_arm import ROBOTS, Arm, Array, Gear, Robot, Row
from jury_hidden import EFFECTS, MISTAKES, REMEMBERS, Hidden, Load, Rng, Trial, levers, of_table

HERE = Path(__file__).resolve().parents[1]
CYCLE = (0, 1 / 3, 2 / 3, 1, 0.5, 0, -0.5, -1, -0.5, 0)


def pose(rng: Rng, robot: Robot) -> Array:
    """An ordinary posture in front of the robot, controller's angles [deg]."""
    lean, fore = rng.uniform(-15, 50), rng.uniform(-35, 40)
    wrist = [rng.uniform(-130, 130), rng.choice([-1, 1]) * rng.uniform(20, 105), rng.uniform(-170, 170)]
    return np.round(robot.controller(np.array([rng.uniform(-70, 70), lean - 90, fore - lean, *wrist])), 2)


def plan(rng: Rng, robot: Robot, design: str, most: float) -> list[Load]:
    """Poses and loads as an engineer writes them."""
    few, many = {
        "cycle1": (12, 24), "cycle3": (6, 14), "three": (14, 40), "one": (30, 41), "line": (10, 25), "weights": (10, 20),
    }[design]
    out: list[Load] = []
    t = 0.0
    for n in range(int(rng.integers(few, many))):
        q = pose(rng, robot)
        t += rng.uniform(100, 160)
        since = t
        way = rng.normal(size=3)
        way /= np.linalg.norm(way)
        axes = np.eye(3)
        loads = {
            "cycle1": [axes[n % 3] * x for x in CYCLE],
            "cycle3": [a * x for a in axes for x in CYCLE],
            "three": [np.zeros(3), *(a * rng.choice([-1, 1]) for a in axes)],
            "one": [way],
            "line": [way * x for x in (0, 0.5, 1, 0, -0.5, -1, 0)],
            "weights": [(axes[1] if n < 2 else -axes[2]) * x for x in (0, 0.25, 0.5, *([] if n < 2 else [1, 0.5, 0.25]), 0)],
        }[design]
        for load in loads:
            dwell = float(rng.choice([5, 20]))
            t += dwell + 10
            out.append(Load(f"P{n + 1:02d}", q, load * most, t, since, dwell))
    return out


def planned(rng: Rng, folder: Path, most: float, every: bool) -> list[Load]:
    """What `compstiff design` plans for the cell."""
    options = ["--quick", "--measurements", str(rng.integers(5, 11)), "--max-force", f"{most:.0f}"]
    options += ["--seed", str(rng.integers(999))]
    run(folder, "design", "cell.yaml", "-o", "plan.csv", *options, *(["--every-axis"] if every else []))
    rows = list(csv.DictReader(x for x in (folder / "plan.csv").read_text().splitlines() if not x.startswith("#")))
    out: list[Load] = []
    for row in rows:
        q = np.array([float(row[f"q{i}_deg"]) for i in range(1, 7)])
        f = np.array([float(row[f"f{x}_n"]) for x in "xyz"])
        t, dwell = float(row["time_s"]), float(row["dwell_s"])
        since = out[-1].since if out and out[-1].pose == row["pose"] else t - dwell - 1
        out.append(Load(row["pose"], q, f, t, since, dwell))
    return out


def run(folder: Path, *call: str) -> str:
    """The program as a user calls it."""
    env = {**os.environ, "PYTHONPATH": str(HERE)}
    command = [sys.executable, "-m", "compstiff", *call]
    done = subprocess.run(command, cwd=folder, env=env, capture_output=True, text=True, check=False)
    return done.stdout + done.stderr


def masses(trial: Trial) -> list[tuple[int, Array, float]]:
    """What hangs on the frames of the joints [m, kg]; engineering judgement."""
    r, s = trial.robot, 0.35 if trial.robot.name in ("rx160", "irb4400") else 1.0
    hand = np.array([0, 0, 0.1]) + trial.tool / 2
    at = [np.array([r.a3 / 2000, 0, 0]), np.array([r.a4 / 2000, 0.25, 0]), np.zeros(3), np.zeros(3), hand]
    return [(i + 2, p, m * s) for i, (p, m) in enumerate(zip(at, (250.0, 300.0, 60.0, 30.0, 80.0), strict=True))]


def simulate(trial: Trial, hidden: list[Hidden], sizes: list[float], fine: bool = True) -> tuple[Array, Array]:
    """True deflections as the sensors see them [m] and forces as they are written [N], (n, 3) each, without noise."""
    weights = masses(trial) if trial.weighed else []
    arm = Arm(trial.robot, [Gear(1 / k) for k in trial.stiffness], trial.tool, masses=weights, fine=fine)
    both = list(zip(hidden, sizes, strict=True))
    for h, s in both:
        if h.arm:
            h.arm(arm, s)
    span = trial.loads[-1].time
    moved, written, last, before, rest = [], [], "", np.zeros(3), np.eye(4)
    points = sum((h.point(s) for h, s in both if h.point), np.zeros((3, 3)))
    for load in trial.loads:
        row = Row(load.q, trial.robot.axes(load.q), load.force, load.time, load.since, load.dwell, span)
        if load.pose != last:
            rest, _ = arm.still(row)
            last, before = load.pose, np.zeros(3)
        said = load.force
        for h, s in both:
            row.force = h.force(row.force, s, load, before) if h.force else row.force
            said = h.record(said, s, load) if h.record else said
        tcp, torque = arm.solve(row)
        arm.settle(torque, row)
        way = tcp[:3, 3] - rest[:3, 3] + np.einsum("ij,ij->i", tcp[:3, :3] - rest[:3, :3], points)
        moved.append(way)
        written.append(said)
        before = load.force
    d = np.array(moved)
    for h, s in both:
        d = h.read(d, s, trial.loads) if h.read else d
    return d, np.array(written)


def visible(trial: Trial, d: Array, force: Array) -> float:
    """What six springs, and a re-seating at each pose, leave of readings, in sigma over all rows."""
    sigma = np.sqrt(trial.reading**2 + (trial.share * np.linalg.norm(d, axis=1)) ** 2)[:, None]
    poses = {load.pose: levers(trial, load.q) for load in trial.loads}
    a = np.array([(poses[x.pose].T * (poses[x.pose] @ f)) for x, f in zip(trial.loads, force, strict=True)]) / sigma[..., None]
    a = a.reshape(-1, 6) / np.linalg.norm(a.reshape(-1, 6), axis=0)
    y = (d / sigma).ravel()
    left = (y - a @ np.linalg.lstsq(a, y, rcond=None)[0]).reshape(-1, 3)
    for name in poses:
        at = [n for n, load in enumerate(trial.loads) if load.pose == name]
        gone = len(at) * (trial.seating / trial.reading) ** 2
        left[at] -= left[at].mean(0) * (1 - 1 / np.sqrt(1 + gone))
    return float(np.linalg.norm(left))


def size(trial: Trial, hidden: Hidden, with_others: list[Hidden], sizes: list[float], goal: float) -> tuple[float, float]:
    """The size at which `goal` sigma are seen, or half of the deflection is its own, and what is seen."""
    base, _ = simulate(trial, with_others, sizes, fine=False)

    def seen(s: float) -> tuple[float, bool]:
        d, force = simulate(trial, [*with_others, hidden], [*sizes, s], fine=False)
        sigmas = visible(trial, d, force)
        return sigmas, sigmas > goal or np.linalg.norm(d - base) > 0.5 * np.linalg.norm(base)

    low, high = hidden.span
    sigmas, much = seen(high)
    if not much:
        return high, sigmas
    while high / low > 1.25:
        middle = float(np.sqrt(low * high))
        sigmas, much = seen(middle)
        low, high = (low, middle) if much else (middle, high)
    return high, sigmas


def trial_of(rng: Rng, folder: Path, kinds: list[str]) -> Trial:
    """A robot, its cell and its plan."""
    robots = [r for r in ROBOTS if r.rod or "rod" not in kinds]
    robot = robots[int(rng.integers(len(robots)))]
    designs = ["planned", "every axis", "cycle1", "cycle3", "three", "one", "line", "weights"]
    design = str(rng.choice(designs, p=[0.15, 0.2, 0.1, 0.2, 0.1, 0.05, 0.1, 0.1]))
    if design in ("three", "one") and REMEMBERS & set(kinds):
        design = "cycle3"
    if "hook's weight" in kinds:
        design = "weights"
    gauges = str(rng.choice(["tracker", "dials", "lasers"]))
    reading = rng.uniform(*{"tracker": (4, 8), "dials": (1.5, 3), "lasers": (1, 3)}[gauges]) * 1e-6
    tool = np.round([rng.choice([60, 100, 120, 180]), rng.choice([0, 0, -80]), rng.uniform(150, 350)]) / 1000
    most = float(rng.choice([150, 250, 300] if robot.stiffness[0] < 1e6 else [300, 500, 800, 1200]))
    trial = Trial(robot, np.array(robot.stiffness) * np.exp(0.4 * rng.normal(size=6)), tool, design, most, reading,
                  rng.uniform(1, 4) * 1e-6, float(rng.choice([0.002, 0.005])), bool(rng.random() < 0.5),
                  1.0 if rng.random() < 0.8 else rng.uniform(1.5, 2.2), gauges == "dials", bool(rng.random() < 0.5))
    write_cell(trial, folder, trial.tool)
    every = design == "every axis"
    trial.loads = planned(rng, folder, most, every) if every or design == "planned" else plan(rng, robot, design, most)
    return trial


def write_cell(trial: Trial, folder: Path, tool: Array) -> None:
    """cell.yaml and robot.yaml."""
    r, um = trial.robot, [round(float(x) * 1e6, 2) for x in (trial.reading, trial.seating)]
    joints = [
        f"  - {{alpha_deg: {np.degrees(x):.0f}, a_mm: {a * 1000:g}, d_mm: {d * 1000:g}, offset_deg: {o}, sense: {s}, "
        f"limits_deg: [-{w}, {w}], speed_deg_s: 120, acceleration_deg_s2: 400}}"
        for (x, a, d), o, s, w in zip(r.table(), r.offset, r.sense, (185, 360, 360, 360, 185, 360), strict=True)
    ]
    coupling = [f"coupling: {{joint: 3, driven_by: 2, ratio: -1{'' if r.rod else ', rod: false'}}}"] if r.coupled else []
    head = [f"name: jury-{r.name}", f"manufacturer: {r.maker}", f"load_path: {'drive' if r.rod else 'serial'}", "joints:"]
    prior = f"prior: {{stiffness_nm_per_rad: [{', '.join(f'{k:.6e}' for k in r.stiffness)}], relative_std: 3.0}}"
    (folder / "robot.yaml").write_text("\n".join([*head, *joints, *coupling, prior, ""]))
    at = [round(float(x) * 1000, 3) for x in tool]
    cell = ["robot: robot.yaml", f"tool: {{position_mm: {at}, quaternion: [1, 0, 0, 0]}}"]
    cell += ["measurement:", f"  deflection_std_um: {[um[0]] * 3}"]
    if trial.stated:
        cell += [f"  pose_offset_std_um: {[um[1]] * 3}", f"  force_relative_std: {trial.share}"]
        cell += ["  force_std_n: [0.5, 0.5, 0.5]"]
    (folder / "cell.yaml").write_text("\n".join([*cell, ""]))


def write_table(rng: Rng, trial: Trial, hidden: list[Hidden], sizes: list[float], path: Path) -> None:
    """measurements.csv: the readings with their noise, and what a slip makes of them."""
    d, force = simulate(trial, hidden, sizes)
    seat = {load.pose: rng.normal(size=3) * trial.seating for load in trial.loads}
    d = d + rng.normal(size=d.shape) * trial.reading * trial.worse + np.array([seat[x.pose] for x in trial.loads])
    d = np.round(d * 1e6) if trial.rounded else d * 1e6
    force = force * (1 + trial.share * rng.normal(size=force.shape)) + (force != 0) * 0.5 * rng.normal(size=force.shape)
    table = []
    for load, way, f in zip(trial.loads, d, force, strict=True):
        row = {f"q{i + 1}_deg": f"{x:.3f}" for i, x in enumerate(load.q)}
        row |= {f"f{x}_n": f"{v:.2f}" for x, v in zip("xyz", f, strict=True)}
        row |= {f"d{x}_um": f"{v:.2f}" for x, v in zip("xyz", way, strict=True)}
        row |= {"time_s": f"{load.time:.0f}", "dwell_s": f"{load.dwell:.0f}", "reference": load.pose, "pose": load.pose}
        table.append(row)
    for h in hidden:
        if h.table:
            h.table(table)
    with path.open("w", newline="") as out:
        writer = csv.DictWriter(out, list(table[0]))
        writer.writeheader()
        writer.writerows(table)


def judged(said: dict[str, Any], hidden: list[Hidden], sigmas: float) -> str:
    """What an answer is worth to who knows the truth, and by how many sigma it shows."""

    def marks(found: list[dict[str, Any]]) -> list[str]:
        return [x["effect"] + (f"[{x['joint']}]" if x.get("joint") else "") for x in found]

    def is_of(name: str, allowed: tuple[str, ...]) -> bool:
        return any(name.startswith(x) for x in allowed)

    verdict, causes = said["verdict"], marks(said["causes"])
    slips = [x["mistake"] for x in said["mistakes"]]
    if not hidden:
        return "right" if verdict == "adequate" else "alarm"
    if verdict in ("named", "mistake") or causes:
        named = [*causes, *(slips if verdict == "mistake" else [])]
        if not all(any(is_of(x, h.names) for h in hidden) for x in named):
            return "wrong"
        if verdict != "ambiguous":
            return "right" if all(any(is_of(x, h.names) for x in named) for h in hidden) else "right in part"
    if verdict == "ambiguous":
        left = marks(said["alternatives"]) + slips
        return "set" if all(any(is_of(x, h.names) for x in left) for h in hidden) else "wrong set"
    if verdict == "adequate":
        return "missed" if sigmas > 8 else "not to be seen"
    return "unknown"


def case(rng: Rng, folder: Path, kinds: list[str]) -> str:
    """One case: made, diagnosed, judged."""
    folder.mkdir(parents=True)
    trial = trial_of(rng, folder, kinds)
    hidden: list[Hidden] = []
    sizes: list[float] = []
    truth: list[dict[str, Any]] = []
    goal = float(10 ** rng.uniform(1, 2.2))
    for kind in kinds:
        make = next((f for f, names in EFFECTS.items() if kind in names), of_table)
        one = make(kind, rng, trial)
        s, sigmas = (1.0, 1e3) if make is of_table else size(trial, one, hidden, sizes, goal)
        if one.cell is not None:
            write_cell(trial, folder, trial.tool + one.cell)
        hidden.append(one)
        sizes.append(s)
        truth.append({"kind": kind, "place": one.place, "names": one.names, "size": s, "sigmas": round(sigmas, 1)})
    write_table(rng, trial, hidden, sizes, folder / "measurements.csv")
    about = {"robot": trial.robot.name, "design": trial.design, "noise": trial.worse, "stiffness": trial.stiffness.tolist()}
    (folder / "truth.json").write_text(json.dumps({"hidden": truth, **about}, indent=1))
    (folder / "said.txt").write_text(run(folder, "diagnose", "cell.yaml", "measurements.csv", "-o", "diagnosis.json"))
    if not (folder / "diagnosis.json").exists():
        return "no answer"
    said = json.loads((folder / "diagnosis.json").read_text())
    out = judged(said, hidden, max((x["sigmas"] for x in truth), default=0.0))
    names = [f"{x['effect']}[{x['joint']}]" for x in said["causes"]] + [x["mistake"] for x in said["mistakes"]]
    seen = ", ".join(f"{x['kind']} ({x['place']}, {x['sigmas']:g} sigma)" for x in truth) or "nothing"
    print(f"{folder.name}: {seen}; {trial.robot.name}, {trial.design}: {said['verdict']} {' '.join(names)} -> {out}",
          flush=True)
    return out


def main(cases: int, seed: int, folder: Path) -> None:
    """Half of the cases have one thing hidden, an eighth two, a quarter a slip of the table, an eighth nothing."""
    single = [kind for names in EFFECTS.values() for kind in names]
    table: dict[str, Counter[str]] = {}
    for n in range(cases):
        rng = np.random.default_rng(seed + n)
        what = ("one", "two", "one", "slip", "one", "nothing", "one", "slip")[n % 8]
        pick = [str(x) for x in rng.choice(single, 2, replace=False)]
        kinds = {"one": pick[:1], "two": pick, "slip": [str(rng.choice(MISTAKES))], "nothing": []}[what]
        table.setdefault(what, Counter())[case(rng, folder / f"{seed + n}", kinds)] += 1
    words = ("right", "right in part", "set", "unknown", "not to be seen", "missed", "wrong set", "wrong", "alarm", "no answer")
    print(f"\n{'hidden':8}" + "".join(f"{w:>15}" for w in words))
    for what, counts in table.items():
        print(f"{what:8}" + "".join(f"{counts[w]:15}" for w in words))
    print(f"in {folder}")


if __name__ == "__main__":
    if len(sys.argv) < 3:
        sys.exit(__doc__)
    main(int(sys.argv[1]), int(sys.argv[2]), Path(sys.argv[3] if len(sys.argv) > 3 else tempfile.mkdtemp(prefix="jury_")))

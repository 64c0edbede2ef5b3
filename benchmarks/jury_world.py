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
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).resolve().parent))
import numpy as np
from jury_arm import (
    ROBOTS,
    Arm,
    Array,
    Creep,
    Element,
    Gear,
    HeldPlay,
    Robot,
    Row,
    Rubbing,
    Shaped,
    Slip,
    beam,
    cross,
    diagonal,
    linear,
    rotation,
)

HERE = Path(__file__).resolve().parents[1]
G = 9.80665
CYCLE = (0, 1 / 3, 2 / 3, 1, 0.5, 0, -0.5, -1, -0.5, 0)
Rng = np.random.Generator
Law = Callable[[Array, Row], Array]


@dataclass
class Load:
    """A row of the plan: where, what is written as the force [N], when [s]."""

    pose: str
    q: Array
    force: Array
    time: float
    since: float
    dwell: float


@dataclass
class Trial:
    """A robot of a kind, its tool [m], plan and instruments: sigma of a reading, of re-seating [m], of a force (share)."""

    robot: Robot
    stiffness: Array
    tool: Array
    design: str
    most: float
    reading: float
    seating: float
    share: float
    stated: bool
    worse: float
    rounded: bool
    weighed: bool
    loads: list[Load] = field(default_factory=list)


@dataclass
class Hidden:
    """What is hidden, by its size s in `span`: in the arm, the true or the written force, the readings, the table, the cell."""

    name: str
    place: str
    names: tuple[str, ...]  # what would be right, as effect or effect[joint]
    arm: Callable[[Arm, float], None] | None = None
    force: Callable[[Array, float, Load, Array], Array] | None = None  # written, size, load, written before -> true
    record: Callable[[Array, float, Load], Array] | None = None
    read: Callable[[Array, float, list[Load]], Array] | None = None
    point: Callable[[float], Array] | None = None  # (3, 3): where each sensor reads beside the TCP, in tool axes [m]
    table: Callable[[list[dict[str, str]]], None] | None = None
    cell: Array | None = None
    span: tuple[float, float] = (0.005, 1.0)


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


def levers(trial: Trial, q: Array) -> Array:
    """How the TCP moves with each spring, (6, 3) [m/rad], at rest."""
    arm = Arm(trial.robot, [Gear(0)] * 6, trial.tool)
    frames, _, tcp = arm.chain(Row(q, trial.robot.axes(q), np.zeros(3), 0, 0, 0, 1), np.zeros(6), [])
    out = np.array([cross(f[:3, 2], tcp[:3, 3] - f[:3, 3]) for f in frames])
    if trial.robot.rod:
        out = out * np.array(trial.robot.sense)[:, None]
        out[1] -= out[2]
    return out


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


def gear(j: int, make: Callable[[float, float], Gear]) -> Callable[[Arm, float], None]:
    """Change the gear of joint j: of its compliance and the size."""

    def change(arm: Arm, s: float) -> None:
        arm.gears[j] = make(arm.gears[j].compliance, s)

    return change


def structure(place: int, law: Callable[[float], Law], ahead: bool = False) -> Callable[[Arm, float], None]:
    """Let a place of the chain give way."""
    return lambda arm, s: arm.elements.append(Element(place, law(s), ahead))


def of_gear(kind: str, rng: Rng, trial: Trial) -> Hidden:
    """What a gear does that no spring does; of a joint that the loads turn."""
    most = np.array([[abs(levers(trial, x.q) @ x.force)] for x in trial.loads]).max((0, 1))
    felt = most**2 / trial.stiffness
    j = int(rng.choice(np.flatnonzero(felt > 0.05 * felt.max())))
    if kind == "strain wave":
        j = int(rng.integers(3, 6))
    t, b, sign, phase = most[j], rng.uniform(0, 1), float(rng.choice([-1, 1])), rng.uniform(0, 2 * np.pi)
    half, n = t / trial.stiffness[j], int(rng.integers(1, 4))

    def shaped(f: Callable[[float, float, Row], float]) -> Callable[[float, float], Gear]:
        return lambda c, s: Shaped(c, lambda x, row: f(s, x, row))

    def clip(x: float, most: float) -> float:
        return max(-most, min(most, x))

    makes: dict[str, tuple[Callable[[float, float], Gear], tuple[str, ...], tuple[float, float]]] = {
        "play": (shaped(lambda s, x, r: x + s * t * np.tanh(x / (t * (0.005 + 0.025 * b)))), ("backlash",), (0.003, 1)),
        "play held": (lambda c, s: HeldPlay(c, s * half, t * (0.03 + 0.12 * b)), ("backlash",), (0.003, 1)),
        "soft below": (shaped(lambda s, x, r: x + s * clip(x, t * (0.1 + 0.3 * b))), ("soft_zone",), (0.05, 3)),
        "strain wave": (shaped(lambda s, x, r: x + s * (clip(x, 0.14 * t) + clip(x, 0.48 * t) / 2)), ("soft_zone",), (0.05, 3)),
        "soft beyond": (shaped(lambda s, x, r: x + s * (x - clip(x, t * (0.3 + 0.4 * b)))), ("soft_beyond",), (0.05, 3)),
        "dry friction": (lambda c, s: Rubbing(c, 2 + 4 * b, s * t), ("hysteresis",), (0.01, 0.6)),
        "Dahl friction": (lambda c, s: Rubbing(c, 2 + 4 * b, s * t, smooth=True), ("hysteresis",), (0.01, 0.6)),
        "creep of a gear": (lambda c, s: Creep(c, s, 10 ** (1 + 1.2 * b)), ("gear_creep",), (0.02, 1)),
        "soft at angles": (shaped(lambda s, x, r: x * (1 + s * np.sin(n * r.theta[j] + phase))), ("uneven_gear",), (0.02, 0.6)),
        "one sign softer": (shaped(lambda s, x, r: x + s * max(x, 0)), ("one_sided",), (0.02, 1.5)),
        "slip": (lambda c, s: Slip(c, t * (0.4 + 0.4 * b), s), ("hysteresis",), (0.02, 3)),
        "softer with time": (shaped(lambda s, x, r: x * (1 + sign * s * r.time / r.span)), ("softening",), (0.02, 0.6)),
    }
    make, names, span = makes[kind]
    # The dictionary's family of gears that are softer near zero, and its name for a gear 2 that is uneven.
    names += tuple({"backlash": "soft_zone", "soft_zone": "backlash"}.get(x, "gravity_compensator") for x in names
                   if x in ("backlash", "soft_zone") or (x, j) == ("uneven_gear", 1))
    marks = tuple(x if x == "softening" else f"{x}[{j + 1}]" for x in names)
    return Hidden(kind, f"joint {j + 1}", marks, arm=gear(j, make), span=span)


def of_structure(kind: str, rng: Rng, trial: Trial) -> Hidden:
    """What gives way beside the gears."""
    f, r = trial.most, trial.robot
    tilt, slide = 2.5e-4 / f, 5e-4 / f
    j, angle = int(rng.choice([2, 3])), rng.uniform(0, 2 * np.pi)
    n = np.array([np.cos(angle), np.sin(angle), 0])
    about = np.zeros((6, 6))
    about[3:, 3:] = np.outer(n, n)
    wrist, a3, d4 = int(rng.choice([4, 5, 6])), r.a3 / 1000, r.d4 / 1000
    pair = [(4, 5), (3, 4), (3, 5)][int(rng.integers(3))]

    def lower(s: float) -> Callable[[Array, Row], Array]:
        tip, at = beam(0, a3, a3 / (s * tilt)), np.array([a3, 0, 0])

        def law(wrench: Array, row: Row) -> Array:
            u = tip(np.concatenate([wrench[:3], wrench[3:] - cross(at, wrench[:3])]), row)
            return np.concatenate([u[:3] - cross(u[3:], at), u[3:]])

        return law

    def couple(arm: Arm, s: float) -> None:
        arm.coupling = (*pair, s * float(np.sqrt(arm.gears[pair[0]].compliance * arm.gears[pair[1]].compliance)))

    def play(s: float) -> Callable[[Array, Row], Array]:
        return lambda w, row: np.append(s * 2e-4 * np.tanh(w[:3] / (0.1 * f)) * [1, 1, 0], np.zeros(3))

    def lifts(s: float) -> Callable[[Array, Row], Array]:
        return lambda w, row: np.append(np.zeros(3), n * s * tilt * max(float(n @ w[3:]), 0.0))

    def rod(arm: Arm, s: float) -> None:
        c = arm.gears[2].compliance
        arm.gears[2] = Shaped(c, lambda x, row: x * (1 + s / max(np.cos(np.radians(row.q[2] - row.q[1])) ** 2, 0.1)))

    spring = gear(1, lambda c, s: Shaped(c, lambda x, row: x / (1 + s * (np.cos(row.theta[1] + np.pi / 2 - angle / 9) - 0.8))))
    flange = ("force_sensor_compliance", "bearing_tilt[6]")
    kinds: dict[str, tuple[Callable[[Arm, float], None], tuple[str, ...]]] = {
        "gas spring": (spring, ("gravity_compensator", "uneven_gear[2]")),
        "wrist coupled": (couple, ("wrist_coupling",)),
        "rod": (rod, ("parallelogram", "uneven_gear[3]")),
        "bearing of axis 1": (structure(1, lambda s: diagonal(0, 0, 0, s * tilt, s * tilt, 0)), ("bearing_tilt[1]",)),
        "bearing": (structure(j, lambda s: diagonal(0, 0, 0, s * tilt, s * tilt, 0)), (f"bearing_tilt[{j}]",)),
        "lower arm": (structure(2, lower), ("link_bending[2]",)),
        "forearm": (structure(4, lambda s: beam(2, d4, d4 / (s * tilt)), True), ("link_bending[3]",)),
        "bearing in the wrist": (structure(wrist, lambda s: diagonal(0, 0, 0, s * 4 * tilt, s * 4 * tilt, 0)),
                                 flange if wrist == 6 else (f"bearing_tilt[{wrist}]",)),
        "pedestal": (structure(0, lambda s: diagonal(0, 0, 0, s * tilt, s * tilt, 0)), ("base_rocking",)),
        "pedestal, one way": (structure(0, lambda s: linear(s * tilt * about)), ("base_rocking",)),
        "base lifts": (structure(0, lifts), ("base_rocking",)),
        "base slides": (structure(0, lambda s: diagonal(s * slide, s * slide, 0, 0, 0, 0)), ("base_shift",)),
        "base has play": (structure(0, play), ("base_shift",)),
        "spindle sideways": (structure(7, lambda s: diagonal(s * slide, s * slide, 0, 0, 0, 0)), ("spindle_compliance",)),
        "spindle along": (structure(7, lambda s: diagonal(0, 0, s * slide, 0, 0, 0)), ("spindle_compliance",)),
        "flange": (structure(6, lambda s: diagonal(0, 0, 0, s * 8 * tilt, s * 8 * tilt, 0)), flange),
        "force sensor": (structure(6, lambda s: diagonal(*(s * 0.4 * slide,) * 3, *(s * 6 * tilt,) * 3)), flange),
    }  # fmt: skip
    change, names = kinds[kind]
    place = f"joint {j}" if kind == "bearing" else kind
    return Hidden(kind, place, names, arm=change, span=(0.005, 3 if kind in ("gas spring", "rod") else 1))


def of_test(kind: str, rng: Rng, trial: Trial) -> Hidden:
    """What the load test itself brings in."""
    a, sign = int(rng.integers(3)), float(rng.choice([-1, 1]))
    b, unit = (a + 1 + int(rng.integers(2))) % 3, np.eye(3)
    v = rng.normal(size=3)
    v /= np.linalg.norm(v)
    mix = np.zeros((3, 3))
    mix[b, a] = sign
    late, sine, begin = rng.uniform(0.15, 0.4), rng.uniform(900, 2400), int(rng.uniform(0.2, 0.8) * len(trial.loads))
    contact, apart = rng.normal(size=(3, 3)) * 0.25 * (1 - unit), rng.normal(size=(3, 3))

    def clock(f: Callable[[Array, float], Array]) -> Callable[[Array, float, list[Load]], Array]:
        def read(d: Array, s: float, loads: list[Load]) -> Array:
            t, zero, end = np.array([x.time for x in loads]), np.array([x.since for x in loads]), loads[-1].time
            return d + np.outer(f(t, end) - f(zero, end), v) * s * 1e-3

        return read

    def stick(d: Array, s: float, loads: list[Load]) -> Array:
        out, at, pose = d.copy(), 0.0, ""
        for n, load in enumerate(loads):
            at, pose = (0.0 if load.pose != pose else at), load.pose
            at = float(np.clip(at, d[n, a] - s * 1e-4, d[n, a] + s * 1e-4))
            out[n, a] = at
        return out

    def bump(d: Array, s: float, loads: list[Load]) -> Array:
        hit = np.array([n >= begin and x.pose == loads[begin].pose for n, x in enumerate(loads)])
        return d + np.outer(hit, v) * s * 1e-3

    def longer(f: Array, by: float) -> Array:
        norm = float(np.linalg.norm(f))
        return f * (1 + by / norm) if norm > 1e-9 else f

    def beside(attribute: str) -> Callable[[Arm, float], None]:
        return lambda arm, s: setattr(arm, attribute, v * s * 0.1)

    H = Hidden
    point = ("tool_point", "hook_offset")
    kinds: dict[str, Callable[[], Hidden]] = {
        "force gain": lambda: H(kind, "xyz"[a], ("force_axis_gain",), force=lambda f, s, x, o: f / (1 + sign * s * unit[a])),
        "force cross-talk": lambda: H(kind, "xyz"[a], ("force_crosstalk", "force_misalignment"),
                                      force=lambda f, s, x, o: f - s * mix @ f),
        "force turned": lambda: H(kind, "xyz"[a], ("force_misalignment",), force=lambda f, s, x, o: rotation(s * unit[a]) @ f),
        "force zero": lambda: H(kind, "", ("force_offset",), record=lambda f, s, x: f + v * s * trial.most),
        "load beside the TCP": lambda: H(kind, "tool", point, arm=beside("beside_tool"), span=(0.02, 1.5)),
        "load on a hook": lambda: H(kind, "base", point, arm=beside("beside_base"), span=(0.02, 1.5)),
        "pulley": lambda: H(kind, "", ("load_friction",), force=lambda f, s, x, o: f * (1 - s if f @ f >= o @ o else 1 + s)),
        "hook's weight": lambda: H(kind, "", ("hook_weight",), force=lambda f, s, x, o: longer(f, s * 0.3 * trial.most)),
        "reading turned": lambda: H(kind, "xyz"[a], ("deflection_sensor_rotation",),
                                    read=lambda d, s, x: d @ rotation(s * unit[a]).T),
        "reading gain": lambda: H(kind, "xyz"[a], ("deflection_sensor_gain",),
                                  read=lambda d, s, x: d * (1 + sign * s * unit[a])),
        "gauge sticks": lambda: H(kind, "xyz"[a], ("gauge_friction",), read=stick),
        "stand": lambda: H(kind, "", ("stand_compliance", "base_shift"),
                           read=lambda d, s, x: d + s * 3e-4 / trial.most * np.array([y.force for y in x])),
        "drift": lambda: H(kind, "", ("drift",), read=clock(lambda t, end: t / end)),
        "warming up": lambda: H(kind, "", ("drift",), read=clock(lambda t, end: 1 - np.exp(-t / (late * end)))),
        "day and night": lambda: H(kind, "", ("drift",), read=clock(lambda t, end: 0.5 * np.sin(2 * np.pi * t / sine + a))),
        "bump": lambda: H(kind, f"row {begin + 1}", ("sensor_step",), read=bump),
        "reflector beside the TCP": lambda: H(kind, "", ("reading_point",), point=lambda s: np.tile(v * s * 0.15, (3, 1)),
                                              span=(0.02, 1)),
        "gauges beside the TCP": lambda: H(kind, "", ("reading_point",), point=lambda s: apart * s * 0.1, span=(0.02, 1)),
        "round target": lambda: H(kind, "", ("target_curvature", "deflection_sensor_crosstalk"),
                                  read=lambda d, s, x: d + s * (d @ contact.T + (d**2) @ (1 - unit) / 0.024), span=(0.02, 1)),
    }  # fmt: skip
    return kinds[kind]()


def of_table(kind: str, rng: Rng, trial: Trial) -> Hidden:
    """A slip of whoever wrote the table or the cell file; `names` are the mistakes that would be right."""
    a, j, sign = int(rng.integers(3)), int(rng.integers(6)), float(rng.choice([-1, 1]))
    poses = list(dict.fromkeys(x.pose for x in trial.loads))
    one, two = (str(x) for x in rng.choice(poses, 2, replace=False))
    late, axis, step = set(poses[len(poses) // 2 :]), "xyz"[a], float(rng.choice([10, 20, 40]))

    def angles(change: Callable[[dict[str, str]], None]) -> Callable[[list[dict[str, str]]], None]:
        def write(table: list[dict[str, str]]) -> None:
            for row in table:
                change(row)

        return write

    def add(row: dict[str, str], joint: int, by: float, factor: float = 1.0) -> None:
        row[f"q{joint + 1}_deg"] = f"{factor * float(row[f'q{joint + 1}_deg']) + by:.3f}"

    def exchange(table: list[dict[str, str]]) -> None:
        for row, other in zip([x for x in table if x["pose"] == one], [x for x in table if x["pose"] == two], strict=False):
            for c in (f"q{i}_deg" for i in range(1, 7)):
                row[c], other[c] = other[c], row[c]

    H, unit = Hidden, np.eye(3)
    kinds: dict[str, Callable[[], Hidden]] = {
        "sign of a force": lambda: H(kind, axis, (f"force_sign[{axis}]",), record=lambda f, s, x: f * (1 - 2 * unit[a])),
        "columns exchanged": lambda: H(kind, "yz", ("deflection_swapped",), read=lambda d, s, x: d[:, [0, 2, 1]]),
        "TCP": lambda: H(kind, axis, ("tcp",), cell=unit[a] * sign * rng.uniform(0.06, 0.2)),
        "zero of a joint": lambda: H(kind, f"{j + 1}", (f"joint_zero[{j + 1}]",),
                                     table=angles(lambda r: add(r, j, sign * step / 5))),
        "sense of a joint": lambda: H(kind, f"{j + 1}", (f"joint_sign[{j + 1}]",), table=angles(lambda r: add(r, j, 0, -1))),
        "angle of one pose": lambda: H(kind, one, ("bad_visit",),
                                       table=angles(lambda r: add(r, j, step if r["pose"] == one else 0))),
        "poses exchanged": lambda: H(kind, f"{one} {two}", ("bad_visit", "poses"), table=exchange),
        "kilograms in the second half": lambda: H(kind, "", ("force_unit",),
                                                  record=lambda f, s, x: f / G if x.pose in late else f),
    }
    return kinds[kind]()


EFFECTS = {
    of_gear: ("play", "play held", "soft below", "strain wave", "soft beyond", "dry friction", "Dahl friction",
              "creep of a gear", "soft at angles", "one sign softer", "slip", "softer with time"),
    of_structure: ("gas spring", "wrist coupled", "rod", "bearing of axis 1", "bearing", "lower arm", "forearm",
                   "bearing in the wrist", "pedestal", "pedestal, one way", "base lifts", "base slides", "base has play",
                   "spindle sideways", "spindle along", "flange", "force sensor"),
    of_test: ("force gain", "force cross-talk", "force turned", "force zero", "load beside the TCP", "load on a hook", "pulley",
              "hook's weight", "reading turned", "reading gain", "gauge sticks", "stand", "drift", "warming up",
              "day and night", "bump", "reflector beside the TCP", "gauges beside the TCP", "round target"),
}  # fmt: skip
MISTAKES = ("sign of a force", "columns exchanged", "TCP", "zero of a joint", "sense of a joint", "angle of one pose",
            "poses exchanged", "kilograms in the second half")  # fmt: skip
REMEMBERS = {"play", "play held", "dry friction", "Dahl friction", "creep of a gear", "slip", "pulley", "gauge sticks",
             "soft below"}  # fmt: skip


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

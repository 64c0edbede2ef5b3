"""Load tests of the sixth world as shops do them, their nuisance, and how far a hidden cause shows beyond six springs.

A trial has visits; each begins with a zero reading at the unloaded arm. `Hooks` is what a cause may change: gears, soft places,
the load that truly acts, the instrument, the table, the cell file.
"""

from __future__ import annotations

import copy
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from sixth_arm import ROBOTS, Arm, Bend, controller_angles, solve

DESIGNS = ["tracker_cylinder", "gauges_pulley", "one_gauge_pull", "two_gauges_hoist", "single_load", "tracker_weights", "box"]


@dataclass
class Table:
    """What is typed: rows of angles [deg], forces [N], deflections [m] (nan: not read), and robot and tool as stated."""

    arm: Arm
    q: np.ndarray
    force: np.ndarray
    read: np.ndarray
    visit: np.ndarray
    time: np.ndarray
    cell: dict = field(default_factory=dict)


@dataclass
class Trial:
    """What is really done. Rows with `zero` are the zero readings and are not typed."""

    arm: Arm
    design: str
    instrument: str  # tracker | gauges
    weights: bool
    q: np.ndarray  # (N, 6) [deg]
    force: np.ndarray  # (N, 3) [N]
    seen: np.ndarray  # (N, 3) bool
    visit: np.ndarray
    zero: np.ndarray
    time: np.ndarray
    noise: dict
    actual: np.ndarray  # (N, 3) force that is truly hung, with its errors


@dataclass
class Hooks:
    laws: dict[int, Callable[[np.ndarray], np.ndarray]] = field(default_factory=dict)
    bends: dict[str, Bend] = field(default_factory=dict)
    compliance: np.ndarray | None = None  # (N, 6)
    load: Callable | None = None  # (trial, force, tcp0, tcp, frame) -> point, force
    read: Callable | None = None  # (trial, z, state, state0) -> z
    table: Callable | None = None  # (table) -> None
    arm: Callable | None = None  # (arm as stated) -> None, changes a copy


def build(rng: np.random.Generator, robot: str | None = None, design: str | None = None, quiet: bool = False) -> Trial:
    """A trial with its nuisance drawn but not yet added."""
    robot = robot or str(rng.choice(list(ROBOTS), p=[0.22, 0.2, 0.2, 0.2, 0.1, 0.08]))
    lengths, maker, rod, k, masses, most = ROBOTS[robot]
    arm = Arm(
        robot,
        tuple(x / 1000 for x in lengths),
        maker,
        rod,
        np.array(k) * 1e6 * np.exp(rng.normal(0, 0.3, 6)),
        tuple(m * float(rng.uniform(0.8, 1.2)) for m in masses),
        np.round([rng.choice([0.1, 0.12, 0.15, 0.2]), rng.uniform(-0.05, 0.05), rng.uniform(0.18, 0.32)], 3),
    )
    design = design or str(rng.choice(DESIGNS))
    top = most * rng.uniform(0.6, 1.2)
    count = {
        "tracker_cylinder": (6, 9),
        "gauges_pulley": (7, 12),
        "one_gauge_pull": (8, 18),
        "two_gauges_hoist": (7, 12),
        "single_load": (14, 40),
        "tracker_weights": (6, 10),
        "box": (9, 14),
    }[design]
    visits = int(rng.integers(count[0], count[1] + 1))
    ladder = {
        "tracker_cylinder": [0.33, 0.67, 1, 0, -0.5, -1],
        "gauges_pulley": [0.4, 0.7, 1, 0.7, 0],
        "one_gauge_pull": [0.5, 1, 0][: rng.integers(2, 4)],
        "two_gauges_hoist": [0.3, 0.6, 1, 0.5],
        "single_load": [1],
        "tracker_weights": [0.3, 0.6, 1, 0.6, 0.3, 0],
        "box": [0.5, 1, -0.5, -1][: 4 if visits < 13 else 3],
    }[design]
    rows: dict[str, list] = {name: [] for name in ("q", "force", "seen", "visit", "zero", "time")}
    clock, pose = 0.0, np.zeros(6)
    for v in range(visits):
        if design != "box" or v % 3 == 0:
            pose = np.array(
                [
                    rng.uniform(-45, 45),
                    rng.uniform(-10, 45),
                    rng.uniform(-30, 40),
                    rng.uniform(-100, 100),
                    rng.choice([-1, 1]) * rng.uniform(25, 95),
                    rng.uniform(-150, 150),
                ]
            )
            if arm.rod:  # the rod's own limit on the forearm's angle
                pose[2] = max(pose[2], -15 - pose[1])
        axis = v % 3 if design in ("box", "one_gauge_pull", "tracker_cylinder") else int(rng.integers(3))
        way = np.eye(3)[axis] * rng.choice([-1, 1])
        if design == "gauges_pulley":
            way = (
                np.array([0, 0, -1.0])
                if v % 2 == 0
                else np.array([[1, 0, 0], [0, 1, 0], [0, -1, 0], [-1, 0, 0]][v // 2 % 4], float)
            )
        elif design == "two_gauges_hoist":
            way = np.array([0, 0, 1.0]) if v % 3 == 0 else np.eye(3)[v % 3 - 1] * rng.choice([-1, 1])
        elif design == "single_load":
            way = rng.normal(size=3)
            way = np.round(way / np.linalg.norm(way), 3)
        elif design == "tracker_weights":
            way = np.array([0, 0, -1.0])
        seen = np.ones(3, bool)
        if design == "one_gauge_pull":
            seen = np.abs(way) > 0.5
        elif design == "two_gauges_hoist":
            seen = (np.abs(way) > 0.5) | (np.arange(3) == (np.argmax(np.abs(way)) + 1 + v % 2) % 3)
        clock += 120
        for step, part in enumerate([None, *ladder]):
            rows["q"].append(controller_angles(arm, pose[None])[0])
            size = 0 if part is None else round(top * part, -1 if design != "tracker_weights" else 0)
            rows["force"].append(size * way)
            rows["seen"].append(seen)
            rows["visit"].append(v)
            rows["zero"].append(step == 0)
            rows["time"].append(clock)
            clock += 40
    a = {name: np.array(values) for name, values in rows.items()}
    a["q"] = np.round(a["q"], 4)
    tracker = design in ("tracker_cylinder", "single_load", "tracker_weights") or (design == "box" and rng.random() < 0.5)
    weights = design in ("gauges_pulley", "tracker_weights")
    if design == "tracker_weights":
        a["force"] = np.round(a["force"] / 9.80665, 1) * 9.80665
    noise = {
        "sensor": rng.uniform(3, 8) * 1e-6 if tracker else rng.uniform(1.2, 3) * 1e-6,
        "tails": rng.choice([4, 6, 30]),
        "memory": rng.choice([0, 0, 0.3, 0.6]),
        "seat": rng.uniform(1, 6) * 1e-6,
        "visit_force": rng.uniform(0.001, 0.008),
        "row_force": rng.uniform(0.001, 0.005),
        "drift": rng.choice([0, 3, 8]) * 1e-6,
        "grain": 0.1e-6 if tracker else rng.choice([1e-6, 1e-6, 2e-6]),
    }
    if quiet:
        noise = {
            **dict.fromkeys(noise, 1e-9),
            "tails": 30,
            "memory": 0,
            "drift": 0,
            "sensor": 0.2e-6,
            "seat": 0.1e-6,
            "visit_force": 1e-5,
            "row_force": 1e-5,
        }
    actual = (
        a["force"]
        * (
            1
            + noise["visit_force"] * rng.normal(size=visits)[a["visit"]]
            + noise["row_force"] * rng.normal(size=len(a["visit"]))
        )[:, None]
    )
    return Trial(
        arm,
        design,
        "tracker" if tracker else "gauges",
        weights,
        a["q"],
        a["force"],
        a["seen"],
        a["visit"],
        a["zero"],
        a["time"],
        noise,
        actual,
    )


def deflection(t: Trial, force: np.ndarray, hooks: Hooks, compliance: np.ndarray | None = None) -> np.ndarray:
    """Loaded minus unloaded TCP [m], (N, 3), of the arm as it is, as the instrument has it."""
    c = hooks.compliance if compliance is None else compliance

    def nothing(tcp: np.ndarray, frame: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return tcp, force * 0

    free = solve(t.arm, t.q, nothing, None, hooks.bends, c)

    def load(tcp: np.ndarray, frame: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return (tcp, force) if hooks.load is None else hooks.load(t, force, free.tcp, tcp, frame)

    state = solve(t.arm, t.q, load, hooks.laws, hooks.bends, c, 7 if hooks.load is None else 25)
    first = np.flatnonzero(t.zero)[t.visit]
    z = state.tcp - state.tcp[first]
    return z if hooks.read is None else hooks.read(t, z, state, first)


def disturb(rng: np.random.Generator, t: Trial) -> np.ndarray:
    """What the instruments add [m], (N, 3): noise with its tails and memory, re-seating a visit, a slow drift."""
    w = t.noise
    n = len(t.visit)
    e = rng.standard_t(w["tails"], (n, 3)) * np.sqrt((w["tails"] - 2) / w["tails"])
    for i in range(1, n):
        if t.visit[i] == t.visit[i - 1]:
            e[i] = w["memory"] * e[i - 1] + np.sqrt(1 - w["memory"] ** 2) * e[i]
    seat = rng.normal(size=(t.visit[-1] + 1, 3))[t.visit] * w["seat"]
    since = t.time - t.time[np.flatnonzero(t.zero)[t.visit]]
    return w["sensor"] * e + seat + rng.normal(size=3) * w["drift"] * since[:, None] / 600


def typed(t: Trial, z: np.ndarray, hooks: Hooks) -> Table:
    """The table of what was read, with the mistakes of whoever typed it."""
    keep = ~t.zero
    table = Table(
        copy.deepcopy(t.arm),
        t.q[keep].copy(),
        t.force[keep].copy(),
        np.where(t.seen, z, np.nan)[keep],
        t.visit[keep].copy(),
        t.time[keep].copy(),
    )
    if hooks.table:
        hooks.table(table)
    if hooks.arm:
        hooks.arm(table.arm)
    return table


def plain(table: Table, log_k: np.ndarray) -> np.ndarray:
    """What six springs say of a table, with the angles, forces and tool that are typed there."""
    arm = copy.copy(table.arm)
    arm.stiffness = np.exp(log_k)
    q, f = np.vstack([table.q, table.q]), np.vstack([table.force, table.force * 0])
    tcp = solve(arm, q, lambda x, frame: (x, f)).tcp
    n = len(table.q)
    return tcp[:n] - tcp[n:]


def sigmas(t: Trial, table: Table) -> float:
    """How far a noise-free table is from what six springs can follow, in standard deviations of the noise there really is."""
    seen = np.isfinite(table.read)
    start = np.log(t.arm.stiffness)
    base = plain(table, start)
    columns = np.stack([(plain(table, start + 0.02 * np.eye(6)[j]) - base)[seen] / 0.02 for j in range(6)], 1)
    visit, row = np.nonzero(seen)[0], np.nonzero(seen)[0]
    which, part, w = table.visit[visit], np.nonzero(seen)[1], t.noise
    true = base[seen]
    same = which[:, None] == which[None, :]
    cov = np.eye(len(true)) * w["sensor"] ** 2 + same * (part[:, None] == part[None, :]) * w["seat"] ** 2
    near = same & (part[:, None] == part[None, :]) & (row[:, None] != row[None, :])
    cov += near * w["sensor"] ** 2 * float(w["memory"]) ** np.abs(row[:, None] - row[None, :]) * (w["memory"] > 0)
    cov += (
        same * np.outer(true, true) * w["visit_force"] ** 2
        + (row[:, None] == row[None, :]) * np.outer(true, true) * w["row_force"] ** 2
    )
    root = np.linalg.inv(np.linalg.cholesky(cov + 1e-18 * np.eye(len(true))))
    log_k, gone = start.copy(), np.inf
    for _ in range(4):
        r = (table.read - plain(table, log_k))[seen]
        step = np.linalg.lstsq(np.vstack([root @ columns, np.eye(6) / 3]), np.append(root @ r, np.zeros(6)), rcond=None)[0]
        gone = min(gone, float(np.linalg.norm(root @ r)))
        log_k = np.clip(log_k + step, start - 3, start + 3)
    r = (table.read - plain(table, log_k))[seen]
    return min(gone, float(np.linalg.norm(root @ r)))


Made = tuple[str, float, float, Callable[[float], Hooks]] | None
UP_AND_DOWN = ("tracker_cylinder", "gauges_pulley", "two_gauges_hoist", "tracker_weights")


def direction(rng: np.random.Generator) -> np.ndarray:
    v = rng.normal(size=3)
    return v / np.linalg.norm(v)


def play(x: np.ndarray, visit: np.ndarray, width: float) -> np.ndarray:
    """The play operator of half width `width`, from the first reading of each visit on (N,)."""
    y = x.copy()
    for i in range(1, len(x)):
        if visit[i] == visit[i - 1]:
            y[i] = min(max(y[i - 1], x[i] - width), x[i] + width)
    return y

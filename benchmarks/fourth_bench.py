"""Load tests of fourth_world: robots, poses, designs of loads, instruments and their noise.

Used by: python benchmarks/fourth_world.py CASES SEED FOLDER
"""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from fourth_arm import GRAVITY, Arm, Array, frame, read_arm

Random = np.random.Generator
Keep = Callable[[Array], bool] | None  # which poses may be drawn, by angles in degrees
ROBOTS = {
    "irb6660-205-1.90": 1.0,
    "irb6700-200-2.60": 1.0,
    "irb6640-235-2.55": 0.9,
    "kr210-r2700-extra": 1.0,
    "irb4600-60-2.05": 0.4,
    "r2000ic-210f": 1.0,
}  # how stiff against the robot file's prior: engineering judgement
DESIGNS = ("single", "cycle", "three", "weights", "pulley", "wrench", "mixed", "again")
# name: sigma of a reading [um], smallest step of the display [um], re-seating [um]: engineering judgement
INSTRUMENTS = {
    "dial gauges": (2.0, 1.0, 3.0),
    "distance sensors": (2.0, 0.1, 4.0),
    "tracker": (6.0, 0.1, 5.0),
    "probing arm": (10.0, 1.0, 4.0),
}


@cache
def robot_files() -> dict[str, dict[str, Any]]:
    """The built-in robots as `compstiff robots --json` names their files."""
    run = subprocess.run([sys.executable, "-m", "compstiff", "robots", "--json"], capture_output=True, text=True, check=True)
    robots = json.loads(run.stdout)["result"]["robots"]
    return {r["name"]: yaml.safe_load(Path(r["file"]).read_text()) for r in robots}


@dataclass
class Row:
    """One reading: what the person at the robot writes down before the deflection."""

    visit: int
    q: Array  # controller's angles [rad]
    force: Array
    moment: Array
    mass: float | None
    time: int
    dwell: float
    way: list[Array] = field(default_factory=list)  # forces between the reading before and this one


@dataclass
class Bench:
    """A cell, its robot and its load test before anything is hidden in it."""

    robot: str
    design: str
    instrument: str
    sigma: float
    step: float
    reseat: float
    force_share: float
    force_noise: float
    tails: bool
    per_visit: bool  # a new zero at each pose
    arm: Arm
    tool_mm: list[int]
    rows: list[Row]
    labels: list[str]
    strength: float
    approach: Array  # sign of each joint's last turn, a visit
    cell: dict[str, Any]


def serial_to_controller(robot: dict[str, Any], serial: Array) -> Array:
    """Controller's angles of an arm whose lower arm leans and whose forearm nods by `serial`."""
    theta = serial + np.radians([0, -90, 0, 0, 0, 0])
    sense = np.array([j.get("sense", 1) for j in robot["joints"]], float)
    offset = np.radians([j.get("offset_deg", 0) for j in robot["joints"]])
    q = sense * (theta - offset)
    if coupling := robot.get("coupling"):
        i, o = coupling["joint"] - 1, coupling["driven_by"] - 1
        q[i] = sense[i] * (theta[i] - offset[i] - coupling["ratio"] * q[o])
    return np.asarray((q + np.pi) % (2 * np.pi) - np.pi)


def draw_pose(rng: Random, robot: dict[str, Any], arm: Arm, keep: Keep) -> Array:
    """A pose in front of the robot, inside the limits, with the wrist bent and the tool over the floor."""
    while True:
        low, high = np.array([-55, -25, -35, -150, 25, -170]), np.array([55, 45, 40, 150, 105, 170])
        serial = np.radians(rng.uniform(low, high))
        serial[4] *= rng.choice([-1, 1])
        q = np.radians(np.round(np.degrees(serial_to_controller(robot, serial)), 3))
        limits = np.radians([j["limits_deg"] for j in robot["joints"]])
        if np.any(q < limits[:, 0]) or np.any(q > limits[:, 1]):
            continue
        if keep is not None and not keep(np.degrees(q)):
            continue
        links, _ = arm.chain(arm.theta(q), [], [])
        place = (links[6] @ arm.tool)[:3, 3]
        if place[2] > 0.25 and np.hypot(place[0], place[1]) > 0.7 and place[0] > 0.4:
            return q


def loads(rng: Random, design: str, visit: int, strength: float) -> list[tuple[Array, Array, float | None]]:
    """Forces, moments and masses of one visit in their order; the zero readings with them."""
    zero = np.zeros(3)
    axis = np.eye(3)[visit % 3] * rng.choice([-1.0, 1.0])

    def weigh(kg: float) -> tuple[Array, Array, float | None]:
        return np.array([0, 0, -GRAVITY * kg]), zero, kg

    if design == "single":
        direction = rng.normal(size=3)
        push: Array = strength * rng.uniform(0.5, 1) * direction / np.linalg.norm(direction)
        return [(push.round(1), zero, None)]
    if design == "cycle":
        steps = [0, 0.33, 0.67, 1, 0.67, 0.33, 0, -0.5, -1, -0.5, 0]
        return [(np.round(s * strength * axis, 1), zero, None) for s in steps]
    if design in ("three", "again"):
        unit = [np.zeros(3)] + [s * e for e in np.eye(3) for s in (1.0, -1.0)]
        return [(np.round(strength * rng.choice([0.6, 1.0]) * u, 1), zero, None) for u in unit]
    if design == "weights":
        unit_kg = round(strength / GRAVITY / 3 / 5) * 5.0
        return [weigh(n * unit_kg) for n in (0, 1, 2, 3, 1, 0)]
    if design == "pulley":
        angle = [0, np.pi / 2, -np.pi / 2, np.pi][visit % 4]
        down = np.radians(15)
        direction = np.array([np.cos(angle) * np.cos(down), np.sin(angle) * np.cos(down), -np.sin(down)])
        unit_kg = round(strength / GRAVITY / 3 / 5) * 5.0
        return [(np.round(n * unit_kg * GRAVITY * direction, 1), zero, None) for n in (0, 1, 2, 3, 2, 1, 0)]
    if design == "wrench":
        result: list[tuple[Array, Array, float | None]] = [(zero, zero, None)]
        for e in np.eye(3):
            force = np.round(strength * 0.7 * e * rng.choice([-1.0, 1.0]), 1)
            lever = rng.choice([-0.3, 0.3]) * np.roll(e, 1)
            result.append((force, np.asarray(np.cross(lever, force).round(1), np.float64), None))
        return [*result, (zero, zero, None)]
    heavy = round(strength / GRAVITY / 2 / 5) * 5.0
    pushes = [(np.round(strength * s * np.eye(3)[(visit + n) % 2], 1), zero, None) for n, s in enumerate((0.7, -1.0))]
    return [weigh(0), weigh(heavy), weigh(2 * heavy), weigh(0), *pushes, (zero, zero, None)]


def draw_rows(
    rng: Random, robot: dict[str, Any], arm: Arm, design: str, strength: float, keep: Keep
) -> tuple[list[Row], list[str]]:
    count = {
        "single": (24, 30),
        "cycle": (15, 18),
        "three": (16, 20),
        "weights": (18, 22),
        "pulley": (16, 20),
        "wrench": (16, 20),
        "mixed": (15, 18),
        "again": (15, 18),
    }[design]
    visits = int(rng.integers(count[0], count[1] + 1))
    poses = [draw_pose(rng, robot, arm, keep) for _ in range(visits)]
    labels = [f"P{n + 1}" for n in range(visits)]
    if design == "again":  # the first poses once more at the end of the day
        poses, labels = poses + poses[:5], labels + labels[:5]
    rows, time = [], 300.0
    for visit, q in enumerate(poses):
        time += rng.uniform(100, 260)
        before = np.zeros(3)
        turn_over = design in ("three", "again", "wrench", "mixed", "single")  # over zero from load to load
        for force, moment, mass in loads(rng, design, visit, strength):
            dwell = float(rng.choice([10, 10, 15, 20, 60]))
            time += dwell + rng.uniform(10, 40)
            stops = [before, np.zeros(3), force] if turn_over else [before, force]
            way = [a + (b - a) * s for a, b in pairwise(stops) for s in (0.25, 0.5, 0.75, 1.0)]
            rows.append(Row(visit, q, force, moment, mass, round(time), dwell, way))
            before = force
    return rows, labels


def draw_bench(rng: Random, designs: tuple[str, ...], robots: tuple[str, ...], keep: Keep = None) -> Bench:
    """A cell with its load test."""
    name = str(rng.choice([r for r in ROBOTS if r in robots]))
    robot = robot_files()[name]
    tool_mm = [round(float(rng.uniform(90, 190))), round(float(rng.uniform(-70, 70))), round(float(rng.uniform(190, 320)))]
    prior = np.array(robot["prior"]["stiffness_nm_per_rad"], float)
    k = prior * ROBOTS[name] * np.exp(rng.normal(0, 0.35, 6))
    small = ROBOTS[name] < 0.5
    masses = np.array([400, 180, 150, 60, 30, 45.0]) * (0.35 if small else 1)  # engineering judgement
    arm = read_arm(robot, frame(np.array(tool_mm) / 1e3), k, masses)
    design = str(rng.choice(designs))
    strength = float(rng.choice([300, 400] if small else [500, 600, 800, 1000]))
    rows, labels = draw_rows(rng, robot, arm, design, strength, keep)
    instrument = str(rng.choice(list(INSTRUMENTS), p=[0.35, 0.3, 0.25, 0.1]))
    sigma, step, reseat = INSTRUMENTS[instrument]
    sigma *= float(rng.uniform(0.8, 1.2))
    hung = design in ("weights", "pulley")
    visits = rows[-1].visit + 1
    return Bench(
        name,
        design,
        instrument,
        sigma,
        step,
        reseat,
        0.001 if hung else float(rng.choice([0.002, 0.005])),
        0.0 if hung else float(rng.choice([0.0, 0.5, 1.0])),
        bool(rng.random() < 0.15),
        design != "single",
        arm,
        tool_mm,
        rows,
        labels,
        strength,
        rng.choice([-1.0, 1.0], size=(visits, 6)),
        state_cell(rng, name, tool_mm, sigma, reseat, hung),
    )


def state_cell(rng: Random, name: str, tool_mm: list[int], sigma: float, reseat: float, hung: bool) -> dict[str, Any]:
    """cell.yaml as a practical engineer writes it: noises stated, a little off, or partly left out."""
    off = float(rng.choice([1.0, 1.0, 0.75, 1.35]))
    measurement: dict[str, Any] = {"deflection_std_um": [round(sigma * off, 1)] * 3}
    if rng.random() < 0.7:
        measurement["pose_offset_std_um"] = [reseat] * 3
    if hung:
        measurement["force_relative_std"] = 0.001
    elif rng.random() < 0.7:
        measurement["force_relative_std"] = 0.005
    return {"robot": name, "tool": {"position_mm": tool_mm, "quaternion": [1, 0, 0, 0]}, "measurement": measurement}

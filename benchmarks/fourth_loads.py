"""Causes of fourth_world in what makes and reads the load.

Used by: python benchmarks/fourth_world.py CASES SEED FOLDER
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from fourth_arm import Array, Load, State, turn
from fourth_bench import Bench, Random, Row
from fourth_hidden import Hidden
from fourth_instruments import AXES, unit


def load_turned(rng: Random, bench: Bench) -> Hidden:
    axis = unit(rng)
    return Hidden(
        "the load acts along axes turned against those in the table (load cell, rig)",
        "load",
        "rad",
        0.01,
        0.3,
        load=lambda a, row, load, at: replace(load, force=turn(a * axis) @ load.force),
    )


def load_axis_gain(rng: Random, bench: Bench) -> Hidden:
    i, sign = int(rng.integers(3)), float(rng.choice([-1, 1]))
    return Hidden(
        f"channel f{AXES[i]} of the load cell has another gain than stated",
        f"f{AXES[i]}",
        "share",
        0.01,
        0.4,
        load=lambda e, row, load, at: replace(load, force=load.force * (1 + sign * e * (np.arange(3) == i))),
    )


def load_curved(rng: Random, bench: Bench) -> Hidden:
    sign = float(rng.choice([-1, 1]))
    return Hidden(
        "the load cell is not linear: real force = read force (1 + e |f|/fmax)",
        "load",
        "share",
        0.02,
        0.6,
        load=lambda e, row, load, at: replace(
            load, force=load.force * (1 + sign * e * float(np.linalg.norm(load.force)) / bench.strength)
        ),
    )


def off_the_tcp(rng: Random, bench: Bench) -> Hidden:
    lever = unit(rng)
    return Hidden(
        "the load acts at a point of the tool beside the TCP",
        "load",
        "m",
        0.003,
        0.15,
        load=lambda r, row, load, at: replace(load, lever=lever * r),
    )


def pulley_friction(rng: Random, bench: Bench) -> Hidden:
    before: dict[int, float] = {}
    for n, row in enumerate(bench.rows):
        last = bench.rows[n - 1] if n and bench.rows[n - 1].visit == row.visit else None
        rise = float(np.linalg.norm(row.force)) - (0.0 if last is None else float(np.linalg.norm(last.force)))
        before[row.time] = -1.0 if rise > 0 else 1.0
    return Hidden(
        "friction of the pulley: the cable pulls less than the weight while loading, more while unloading",
        "load",
        "share",
        0.01,
        0.25,
        load=lambda mu, row, load, at: replace(load, force=load.force * (1 + mu * before[row.time])),
    )


def cable_askew(rng: Random, bench: Bench) -> Hidden:
    middle = np.mean([_place(bench, r) for r in bench.rows], axis=0)

    def load(inverse: float, row: Row, load: Load, at: State) -> Load:
        size = float(np.linalg.norm(load.force))
        if size == 0:
            return load
        way = middle + load.force / size / inverse - at.place
        return replace(load, force=size * way / np.linalg.norm(way))

    return Hidden(
        "the cable runs to a fixed pulley, so its direction turns from pose to pose; the table has one direction",
        "load",
        "1/m",
        0.03,
        0.6,
        load=load,
    )


def _place(bench: Bench, row: Row) -> Array:
    links, _ = bench.arm.chain(bench.arm.theta(row.q), [], [])
    return np.asarray((links[6] @ bench.arm.tool)[:3, 3])


def pan_forgotten(rng: Random, bench: Bench) -> Hidden:
    return Hidden(
        "the hook and frame on which the weights hang are not in the table's masses",
        "load",
        "kg",
        0.5,
        15,
        load=lambda m, row, load, at: replace(load, force=load.force - np.array([0, 0, 9.80665 * m]) * bool(row.mass)),
    )


def second_disc_wrong(rng: Random, bench: Bench) -> Hidden:
    unit_kg = min(r.mass for r in bench.rows if r.mass)
    sign = float(rng.choice([-1, 1]))
    return Hidden(
        "the second disc of the set weighs otherwise than is stamped on it",
        "load",
        "kg",
        0.5,
        12,
        load=lambda m, row, load, at: replace(
            load, force=load.force - np.array([0, 0, 9.80665 * m * sign]) * (row.mass is not None and row.mass > 1.5 * unit_kg)
        ),
    )


def cylinder_leaks(rng: Random, bench: Bench) -> Hidden:
    return Hidden(
        "the cylinder loses pressure: the load was read when it was put on, the deflection after the dwell",
        "load",
        "1/s",
        2e-4,
        2e-2,
        load=lambda r, row, load, at: replace(load, force=load.force * np.exp(-r * row.dwell)),
    )


def sensor_crosstalk(rng: Random, bench: Bench) -> Hidden:
    cross = rng.normal(0, 0.6, (3, 3)) * (1 - np.eye(3))

    def load(e: float, row: Row, load: Load, at: State) -> Load:
        return replace(load, force=load.force + e * at.rotation @ (cross @ (at.rotation.T @ load.force)))

    return Hidden("channels of the force sensor on the flange talk into each other", "load", "share", 0.01, 0.4, load=load)


def base_not_level(rng: Random, bench: Bench) -> Hidden:
    way = float(rng.uniform(0, 2 * np.pi))
    axis = np.array([np.cos(way), np.sin(way), 0])
    return Hidden(
        "the robot's base stands inclined (wedge plate), which cell.yaml does not say: weights hang along another line",
        "base",
        "rad",
        0.01,
        0.4,
        load=lambda a, row, load, at: replace(load, force=turn(a * axis) @ load.force if row.mass else load.force),
    )


def payload_compensation(rng: Random, bench: Bench) -> Hidden:
    words = (
        "the controller knows of the hung weights (payload declared) and takes back a share of their sag, not that of pushes"
    )
    return Hidden(
        words,
        "controller",
        "share",
        0.03,
        0.6,
        load=lambda e, row, load, at: replace(load, force=load.force * (1 - e if row.mass else 1)),
    )


LOADING = {
    f.__name__: f
    for f in (
        load_turned,
        load_axis_gain,
        load_curved,
        off_the_tcp,
        pulley_friction,
        cable_askew,
        pan_forgotten,
        second_disc_wrong,
        cylinder_leaks,
        sensor_crosstalk,
        base_not_level,
        payload_compensation,
    )
}

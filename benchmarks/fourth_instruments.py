"""Causes of fourth_world in what reads the deflection.

Used by: python benchmarks/fourth_world.py CASES SEED FOLDER
"""

from __future__ import annotations

import numpy as np
from fourth_arm import Array, turn
from fourth_bench import Bench, Random, Row
from fourth_hidden import Hidden, Seen

AXES = "xyz"


def unit(rng: Random) -> Array:
    v = rng.normal(size=3)
    return np.asarray(v / np.linalg.norm(v))


def bracket_turned(rng: Random, bench: Bench) -> Hidden:
    axis = unit(rng)
    return Hidden(
        "the three gauges' bracket is turned against the base's axes",
        "gauges",
        "rad",
        0.01,
        0.25,
        read=lambda a, seen, rows: seen.moved @ turn(a * axis),
    )


def gauge_leans(rng: Random, bench: Bench) -> Hidden:
    i, j = rng.permutation(3)[:2]

    def read(a: float, seen: Seen, rows: list[Row]) -> Array:
        d = seen.moved.copy()
        d[:, i] = np.cos(a) * seen.moved[:, i] + np.sin(a) * seen.moved[:, j]
        return d

    return Hidden(
        f"one gauge, d{AXES[i]}, leans towards {AXES[j]}; the others stand right", f"d{AXES[i]}", "rad", 0.01, 0.3, read=read
    )


def gauge_gain(rng: Random, bench: Bench) -> Hidden:
    i = int(rng.integers(3))
    sign = float(rng.choice([-1, 1]))
    return Hidden(
        f"gauge d{AXES[i]} reads by a share too {'much' if sign > 0 else 'little'} (lever of the gauge, setting of the sensor)",
        f"d{AXES[i]}",
        "share",
        0.01,
        0.4,
        read=lambda e, seen, rows: seen.moved * (1 + sign * e * (np.arange(3) == i)),
    )


def round_target(rng: Random, bench: Bench) -> Hidden:
    def read(c: float, seen: Seen, rows: list[Row]) -> Array:
        d = seen.moved
        across = (d**2).sum(axis=1, keepdims=True) - d**2
        return np.asarray(d - across * c / 2)

    return Hidden(
        "the gauges touch a ball or shank: a sideways motion reads as one away from the gauge, s^2/(2 r)",
        "gauges",
        "1/m",
        25,
        2000,
        read=read,
    )


def reflector_beside(rng: Random, bench: Bench) -> Hidden:
    lever = unit(rng)
    return Hidden(
        "what is measured is not the TCP but a point beside it on the tool: the tool's turn comes in",
        "target",
        "m",
        0.01,
        0.6,
        read=lambda r, seen, rows: seen.moved + np.cross(seen.turned, seen.rotation @ (lever * r)),
    )


def stand_yields(rng: Random, bench: Bench) -> Hidden:
    shares = rng.permutation([1.0, 0.5, 0.1])
    return Hidden(
        "the gauges stand on what carries the loading device, which goes back under the reaction",
        "gauges",
        "m/N",
        1e-8,
        4e-7,
        read=lambda c, seen, rows: seen.moved + seen.force * shares * c,
    )


def gauge_sticky(rng: Random, bench: Bench) -> Hidden:
    i = int(rng.integers(3))

    def read(w: float, seen: Seen, rows: list[Row]) -> Array:
        d, at, visit = seen.moved.copy(), 0.0, -1
        for n, row in enumerate(rows):
            at = 0.0 if row.visit != visit else float(np.clip(at, d[n, i] - w, d[n, i] + w))
            visit, d[n, i] = row.visit, at
        return d

    return Hidden(
        f"plunger of gauge d{AXES[i]} sticks: it follows only after half a dead width",
        f"d{AXES[i]}",
        "m",
        2e-6,
        2e-4,
        read=read,
    )


def gauge_range(rng: Random, bench: Bench) -> Hidden:
    i = int(rng.integers(3))

    def read(share: float, seen: Seen, rows: list[Row]) -> Array:
        d = seen.moved.copy()
        limit = float(np.abs(d[:, i]).max()) * 0.6
        d[:, i] = np.clip(d[:, i], -limit, limit)
        return d

    return Hidden(
        f"gauge d{AXES[i]} comes to the end of its range", f"d{AXES[i]}", "of the largest", 0.6, 0.6, read=read, scaled=False
    )


def session(h: Hidden) -> Hidden:
    """One zero in the morning, none at the poses: drifts of hours are in the readings."""
    h.extra["one_zero"] = True
    return h


def progress(bench: Bench, rows: list[Row], tau: float) -> Array:
    end = bench.rows[-1].time
    times = np.array([r.time for r in rows])
    return np.asarray(((1 - np.exp(-times / tau / end)) / (1 - np.exp(-1 / tau)))[:, None])


def stand_warms(rng: Random, bench: Bench) -> Hidden:
    way = unit(rng)
    return session(
        Hidden(
            "the gauges' stand warms up: a drift that levels off, all along the day",
            "gauges",
            "m",
            5e-6,
            1e-3,
            read=lambda s, seen, rows: seen.moved + s * way * progress(bench, rows, 0.4),
        )
    )


def tripod_turns(rng: Random, bench: Bench) -> Hidden:
    axis, station = unit(rng) * [0.4, 0.4, 1], np.array([rng.uniform(3, 5), rng.uniform(-2, 2), 1.2])
    return session(
        Hidden(
            "the tracker's tripod turns slowly: a drift that grows with the distance from it",
            "tracker",
            "rad",
            2e-6,
            1e-3,
            read=lambda s, seen, rows: seen.moved + progress(bench, rows, 2.0) * np.cross(axis * s, seen.place - station),
        )
    )


def arm_grows(rng: Random, bench: Bench) -> Hidden:
    return session(
        Hidden(
            "the robot warms and grows: the TCP goes out in proportion to its distance from the foot",
            "robot",
            "share",
            3e-6,
            1e-3,
            read=lambda s, seen, rows: seen.moved + progress(bench, rows, 0.5) * s * seen.place,
        )
    )


def hall_temperature(rng: Random, bench: Bench) -> Hidden:
    way, period, phase = unit(rng), float(rng.uniform(1500, 2500)), float(rng.uniform(0, 6.28))
    return session(
        Hidden(
            f"heating of the hall goes on and off: readings swing with a period of {period / 60:.0f} min",
            "gauges",
            "m",
            5e-6,
            1e-3,
            read=lambda s, seen, rows: (
                seen.moved + s * way * np.array([[np.sin(2 * np.pi * r.time / period + phase) - np.sin(phase)] for r in rows])
            ),
        )
    )


def stand_bumped(rng: Random, bench: Bench) -> Hidden:
    at, way = int(rng.integers(len(bench.rows) // 4, len(bench.rows) * 3 // 4)), unit(rng)
    return session(
        Hidden(
            f"somebody bumped the stand before row {at + 1}: all readings are off by a step from there on",
            "gauges",
            "m",
            5e-6,
            2e-3,
            read=lambda s, seen, rows: seen.moved + s * way * (np.arange(len(rows)) >= at)[:, None],
        )
    )


def someone_stands(rng: Random, bench: Bench) -> Hidden:
    visits = bench.rows[-1].visit + 1
    chosen = {int(v) for v in rng.choice(visits, 2, replace=False)}
    way = np.array([rng.uniform(-0.4, 0.4), rng.uniform(-0.4, 0.4), -1.0])

    def read(s: float, seen: Seen, rows: list[Row]) -> Array:
        loaded = np.array([[r.visit in chosen and bool(np.any(r.force))] for r in rows])
        return np.asarray(seen.moved + s * way * loaded)

    return Hidden(
        f"at visits {sorted(v + 1 for v in chosen)} a person stood on the platform while loaded readings were taken",
        "floor",
        "m",
        2e-5,
        1e-3,
        read=read,
    )


READING = {
    f.__name__: f
    for f in (
        bracket_turned,
        gauge_leans,
        gauge_gain,
        round_target,
        reflector_beside,
        stand_yields,
        gauge_sticky,
        gauge_range,
        stand_warms,
        tripod_turns,
        arm_grows,
        hall_temperature,
        stand_bumped,
        someone_stands,
    )
}

"""Causes of fourth_world in gears, brakes, belts, balancers and drives: laws as in literature and catalogues.

Used by: python benchmarks/fourth_world.py CASES SEED FOLDER
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from fourth_arm import Array, GearLaw
from fourth_bench import Bench, Random, Row
from fourth_hidden import Hidden
from fourth_laws import BoucWen, Formula, Iwan, Play, Slow


def one(joint: int, law: Callable[[float], GearLaw]) -> Callable[[float], dict[int, GearLaw]]:
    return lambda size: {joint: law(size)}


def by_formula(joint: int, law: Callable[[float, float, float, Array, float], float]) -> Callable[[float], dict[int, GearLaw]]:
    """law(size, torque, k, q, seconds)."""
    return one(joint, lambda size: Formula(lambda t, k, q, s: law(size, t, k, q, s)))


def reach_torque(bench: Bench, joint: int) -> float:
    """A torque that the loads of the test put on a joint: its 80 % quantile [N m]."""
    arm = bench.arm.weightless()
    found = []
    for row in bench.rows:
        if np.any(row.force):
            links, _ = arm.chain(arm.theta(row.q), [], [])
            place = (links[6] @ arm.tool)[:3, 3]
            serial = [links[i + 1][:3, 2] @ (np.cross(place - links[i + 1][:3, 3], row.force) + row.moment) for i in range(6)]
            found.append(abs((arm.spread().T @ np.array(serial))[joint]))
    return float(np.quantile(found, 0.8))


def name(joint: int) -> str:
    return str(joint + 1)


def harmonic_three_slopes(rng: Random, bench: Bench) -> Hidden:
    j = int(rng.choice([0, 2, 3, 4]))
    t1 = reach_torque(bench, j) * rng.uniform(0.25, 0.4)

    def law(size: float, t: float, k: float, q: Array, s: float) -> float:
        k1, k2, x = k / (1 + size), k / (1 + 0.4 * size), abs(t)
        parts = min(x, t1) / k1 + max(min(x, 2.5 * t1) - t1, 0) / k2 + max(x - 2.5 * t1, 0) / k
        return float(np.sign(t) * parts)

    return Hidden(
        "strain wave gear stiffens with torque in three slopes K1 < K2 < K3", name(j), "K3/K1 - 1", 0.2, 3, by_formula(j, law)
    )


def lost_motion(rng: Random, bench: Bench) -> Hidden:
    j = int(rng.choice([0, 1, 2, 4]))
    width = reach_torque(bench, j) * 0.12
    return Hidden(
        "lost motion of a cycloidal gear: a soft part about zero torque, b tanh(t/t0)",
        name(j),
        "rad",
        1e-5,
        1e-3,
        by_formula(j, lambda b, t, k, q, s: t / k + b * np.tanh(t / width)),
    )


def free_play(rng: Random, bench: Bench) -> Hidden:
    j = int(rng.choice([0, 3, 4]))
    return Hidden(
        "backlash held by friction: the tooth goes across the gap only when the torque reverses",
        name(j),
        "rad, half",
        1e-5,
        1e-3,
        one(j, lambda gap: Play(gap, 0.12 * reach_torque(bench, j))),
    )


def bouc_wen(rng: Random, bench: Bench) -> Hidden:
    j = int(rng.choice([0, 1, 2, 4]))
    width = 0.5 * reach_torque(bench, j)
    return Hidden("hysteresis of one gear by Bouc and Wen", name(j), "rad", 1e-5, 1e-3, one(j, lambda b: BoucWen(b, width)))


def friction_iwan(rng: Random, bench: Bench) -> Hidden:
    return Hidden(
        "friction of the balancer and the seals holds axis 2 (Iwan elements beside the gear)",
        "2",
        "N m",
        20,
        3000,
        one(1, Iwan),
    )


def hysteresis_all(rng: Random, bench: Bench) -> Hidden:
    widths = [0.4 * reach_torque(bench, j) + 1 for j in range(6)]
    return Hidden(
        "every gear has hysteresis, in proportion to its own wind-up",
        "all",
        "of the wind-up",
        0.03,
        1.5,
        lambda b: {j: BoucWen(b * widths[j] / bench.arm.k[j], widths[j]) for j in range(6)},
    )


def stiffness_by_angle(rng: Random, bench: Bench) -> Hidden:
    j, phase = int(rng.choice([0, 1, 3, 5])), float(rng.uniform(0, 2 * np.pi))
    n = 3 if j in (0, 1) else 2
    return Hidden(
        f"compliance of the gear goes {n} times up and down in a turn of the joint (eccentric crank)",
        name(j),
        "share",
        0.1,
        0.8,
        by_formula(j, lambda e, t, k, q, s: t / k * (1 + e * np.cos(n * q[j] + phase))),
    )


def worn_teeth(rng: Random, bench: Bench) -> Hidden:
    j = int(rng.choice([0, 3]))
    q0, wide = float(rng.choice([r.q[j] for r in bench.rows])), np.radians(10.0 if j == 0 else 35.0)
    return Hidden(
        f"teeth worn near {np.degrees(q0):.0f} deg: the gear is softer there (a bell of {np.degrees(wide):.0f} deg)",
        name(j),
        "share",
        0.05,
        6,
        by_formula(j, lambda e, t, k, q, s: t / k * (1 + e * np.exp(-0.5 * ((q[j] - q0) / wide) ** 2))),
    )


def wrist_coupling(rng: Random, bench: Bench) -> Hidden:
    def gears(size: float) -> dict[int, GearLaw]:
        torque = [0.0, 0.0]
        cross = size / np.sqrt(bench.arm.k[4] * bench.arm.k[5])

        def fifth(t: float, k: float, q: Array, s: float) -> float:
            torque[0] = t
            return float(t / k + cross * torque[1])

        def sixth(t: float, k: float, q: Array, s: float) -> float:
            torque[1] = t
            return float(t / k + cross * torque[0])

        return {4: Formula(fifth), 5: Formula(sixth)}

    return Hidden(
        "hollow wrist: torque of axis 5 turns axis 6 too, and the other way round (shared bevel train)",
        "5, 6",
        "sqrt of share",
        0.1,
        0.9,
        gears,
    )


def belt_creep(rng: Random, bench: Bench) -> Hidden:
    j, tau = int(rng.choice([2, 4])), float(rng.uniform(12, 30))
    return Hidden(
        "toothed belt creeps under load (standard linear solid)",
        name(j),
        "share",
        0.05,
        2,
        one(j, lambda e: Slow(e, tau)),
        extra={"tau_s": tau},
    )


def belt_one_way(rng: Random, bench: Bench) -> Hidden:
    j = int(rng.choice([2, 4, 5]))
    return Hidden(
        "belt with a slack side: softer in one sense of the torque",
        name(j),
        "share",
        0.1,
        4,
        by_formula(j, lambda e, t, k, q, s: t / k * (1 + e * (t < 0))),
    )


def power_law(rng: Random, bench: Bench) -> Hidden:
    scale = [max(reach_torque(bench, j), 1.0) for j in range(6)]

    def gears(p: float) -> dict[int, GearLaw]:
        def make(j: int) -> Formula:
            return Formula(lambda t, k, q, s: float(np.sign(t)) * scale[j] / k * (abs(t) / scale[j]) ** (1 - p))

        return {j: make(j) for j in range(6)}

    return Hidden("all gears stiffen like rolling contacts: twist ~ torque^(1-p)", "all", "p", 0.02, 0.4, gears)


def brake_slip(rng: Random, bench: Bench) -> Hidden:
    j = int(rng.choice([0, 1, 2]))
    limit = reach_torque(bench, j) * rng.uniform(0.5, 0.7)
    return Hidden(
        "motors off, the brake's hub has play and slides once its torque is passed (soft beyond a threshold)",
        name(j),
        "share",
        0.2,
        8,
        by_formula(j, lambda e, t, k, q, s: t / k + e * np.sign(t) * max(abs(t) - limit, 0.0) / k),
    )


def servo_recovers(rng: Random, bench: Bench) -> Hidden:
    j, tau = int(rng.choice([0, 1])), float(rng.uniform(12, 30))
    return Hidden(
        "the servo's integrator takes back the motor's share of the deflection in some ten seconds",
        name(j),
        "share",
        0.1,
        3,
        one(j, lambda e: Slow(e, tau, taken_back=True)),
        extra={"tau_s": tau},
    )


def warming(rng: Random, bench: Bench) -> Hidden:
    end, start = bench.rows[-1].time, bench.rows[0].time
    tau = (end - start) * 0.45

    def stiffness(e: float, row: Row) -> Array:
        return np.full(6, 1 / (1 + e * (1 - np.exp(-(row.time - start) / tau))))

    return Hidden(
        "the gears warm up in the session and grow softer, all alike, exponentially",
        "all",
        "share",
        0.05,
        0.6,
        stiffness=stiffness,
    )


def crash(rng: Random, bench: Bench) -> Hidden:
    j, visits = int(rng.choice([0, 1, 2, 4])), bench.rows[-1].visit
    at = int(rng.integers(round(visits * 0.35), round(visits * 0.65)))
    return Hidden(
        f"something happened before visit {at + 1}: one gear is softer from then on",
        name(j),
        "share",
        0.1,
        3,
        stiffness=lambda e, row: np.where((np.arange(6) == j) & (row.visit >= at), 1 / (1 + e), 1.0),
    )


def rod_elastic(rng: Random, bench: Bench) -> Hidden:
    def law(e: float, t: float, k: float, q: Array, s: float) -> float:
        return float(t / k * (1 + e / max(np.cos(q[2] - q[1] + 0.25), 0.15) ** 2))

    return Hidden(
        "elastic rod of the parallelogram: axis 3 is softer the flatter the rod stands to its crank (1/sin^2)",
        "3",
        "share",
        0.05,
        6,
        by_formula(2, law),
    )


GEARS = {
    f.__name__: f
    for f in (
        harmonic_three_slopes,
        lost_motion,
        free_play,
        bouc_wen,
        friction_iwan,
        hysteresis_all,
        stiffness_by_angle,
        worn_teeth,
        wrist_coupling,
        belt_creep,
        belt_one_way,
        power_law,
        brake_slip,
        servo_recovers,
        warming,
        crash,
        rod_elastic,
    )
}

"""Causes of fourth_world in base, floor, bearings, links and what is on the flange.

Used by: python benchmarks/fourth_world.py CASES SEED FOLDER
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from fourth_arm import Array, Flex
from fourth_bench import Bench, Random, Row
from fourth_hidden import Hidden


def linear(matrix: Array) -> Callable[[Array, Array], Array]:
    return lambda wrench, rotation: matrix @ wrench


def turns(x: float, y: float, z: float) -> Array:
    """Compliance [rad/(N m)] about three axes."""
    return np.diag([0, 0, 0, x, y, z])


def beam(length: float, inertia: float, torsion: float, along: int) -> Array:
    """Compliance of a cantilever (Euler and Bernoulli) at its tip, for 1/E = 1; `along`: its axis."""
    c = np.zeros((6, 6))
    a, (u, v) = along, [(1, 2), (2, 0), (0, 1)][along]
    for n in (u, v):
        c[n, n], c[n + 3, n + 3] = length**3 / 3 / inertia, length / inertia
    c[u, v + 3] = c[v + 3, u] = length**2 / 2 / inertia
    c[v, u + 3] = c[u + 3, v] = -(length**2) / 2 / inertia
    c[a + 3, a + 3] = length / torsion
    return c


def rocking_base(rng: Random, bench: Bench) -> Hidden:
    ratio, twist = float(rng.uniform(0.5, 1.6)), float(rng.choice([0.0, 0.4]))
    return Hidden(
        "the base plate rocks on its grouting about two horizontal axes, unalike",
        "base",
        "rad/(N m)",
        2e-8,
        2e-6,
        flexes=lambda c: [Flex(0, np.array([0, 0, -0.05]), linear(turns(c, ratio * c, twist * c)))],
    )


def loose_bolt(rng: Random, bench: Bench) -> Hidden:
    way = float(rng.uniform(0, 2 * np.pi))
    axis = np.array([np.cos(way), np.sin(way), 0])
    held = -0.25 * bench.strength * 1.5

    def flexes(c: float) -> list[Flex]:
        def law(wrench: Array, rotation: Array) -> Array:
            moment = float(axis @ wrench[3:]) - weight - held
            return np.concatenate([np.zeros(3), axis * c * max(moment, 0.0)])

        return [Flex(0, np.zeros(3), law)]

    weight = float(np.mean([axis @ _weight_moment(bench, r) for r in bench.rows[:: max(len(bench.rows) // 12, 1)]]))
    return Hidden(
        "an anchor bolt is loose: the base lifts on that side only (tilts about one axis, one way)",
        "base",
        "rad/(N m)",
        5e-8,
        6e-6,
        flexes=flexes,
    )


def _weight_moment(bench: Bench, row: Row) -> Array:
    arm = bench.arm
    links, _ = arm.chain(arm.theta(row.q), [], [])
    total = np.zeros(3)
    for j in range(1, 7):
        centre = links[j][:3, 3] + links[j][:3, :3] @ arm.centres[j - 1]
        total += np.cross(centre, np.array([0, 0, -9.80665 * arm.masses[j - 1]]))
    return total


def soft_platform(rng: Random, bench: Bench) -> Hidden:
    corner = np.array([rng.uniform(0.2, 0.5), rng.uniform(-0.4, 0.4), -0.8])
    matrix = np.diag([1.0, 1.0, 0.5, 1.2, 0.8, 0.5])
    return Hidden(
        "robot on a steel platform with elastic feet: it shifts and rocks about a centre beside and under the base",
        "base",
        "m/N",
        1e-9,
        4e-7,
        flexes=lambda c: [Flex(0, corner, linear(matrix * c))],
    )


def carriage(rng: Random, bench: Bench) -> Hidden:
    m0 = bench.strength * 1.5

    def flexes(c: float) -> list[Flex]:
        def law(wrench: Array, rotation: Array) -> Array:
            m = float(wrench[3])
            return np.array([0, 0, 0, c * float(np.sign(m)) * m0 * (abs(m) / m0) ** (2 / 3), 0, 0])

        return [Flex(0, np.array([0, 0, -0.3]), law)]

    return Hidden(
        "carriage of the robot's track rolls about its rail (x), ball contacts by Hertz: roll ~ moment^(2/3)",
        "base",
        "rad/(N m)",
        3e-9,
        4e-6,
        flexes=flexes,
    )


def column_bearing(rng: Random, bench: Bench) -> Hidden:
    height = float(bench.arm.d[0]) * 0.5
    return Hidden(
        "bearing of axis 1 tilts, more across than along the arm (turns with the column)",
        "1",
        "rad/(N m)",
        2e-8,
        2e-6,
        flexes=lambda c: [Flex(1, np.array([0, 0, height - float(bench.arm.d[0])]), linear(turns(c, 0.5 * c, 0)))],
    )


def elbow_bearing(rng: Random, bench: Bench) -> Hidden:
    return Hidden(
        "bearing of axis 3 tilts out of the plane of the arm",
        "3",
        "rad/(N m)",
        1e-7,
        8e-6,
        flexes=lambda c: [Flex(3, np.zeros(3), linear(turns(c, c, 0)))],
    )


def lower_arm_beam(rng: Random, bench: Bench) -> Hidden:
    length = float(bench.arm.a[2])
    matrix = beam(length, 1.0, 0.6, 0)
    return Hidden(
        "the lower arm bends and twists as a beam (Euler-Bernoulli)",
        "2",
        "1/(E I) [1/(N m^2)]",
        2e-8,
        4e-6,
        flexes=lambda c: [Flex(2, np.array([length, 0, 0]), linear(matrix * c))],
    )


def forearm_beam(rng: Random, bench: Bench) -> Hidden:
    length = float(bench.arm.d[3])
    matrix = beam(length, 1.0, 2.0, 1)
    return Hidden(
        "the forearm bends as a beam (Euler-Bernoulli)",
        "3",
        "1/(E I) [1/(N m^2)]",
        5e-8,
        8e-6,
        flexes=lambda c: [Flex(3, np.array([bench.arm.a[3], length, 0]), linear(matrix * c))],
    )


def flange_bearing(rng: Random, bench: Bench) -> Hidden:
    return Hidden(
        "bearing of axis 6 tilts under the tool",
        "6",
        "rad/(N m)",
        2e-7,
        3e-5,
        flexes=lambda c: [Flex(6, np.array([0, 0, -0.06]), linear(turns(c, c, 0)))],
    )


def tool_beam(rng: Random, bench: Bench) -> Hidden:
    at = bench.arm.tool[:3, 3]
    way = [0, 0, 0]
    way[2] = 1
    matrix = beam(float(at[2]), 1.0, 3.0, 2)
    return Hidden(
        "slender tool bends as a beam from the flange to its tip",
        "tool",
        "1/(E I) [1/(N m^2)]",
        2e-7,
        1e-3,
        flexes=lambda c: [Flex(6, np.array([0, 0, float(at[2])]), linear(matrix * c))],
    )


def spindle_radial(rng: Random, bench: Bench) -> Hidden:
    at = bench.arm.tool[:3, 3]
    return Hidden(
        "spindle bearings give way across the tool's axis, and a third of it along",
        "tool",
        "m/N",
        1e-8,
        1e-6,
        flexes=lambda c: [Flex(6, at, linear(np.diag([c, c, c / 3, 0, 0, 0])))],
    )


def changer_play(rng: Random, bench: Bench) -> Hidden:
    axis = np.array([1.0, 0, 0]) if rng.random() < 0.5 else np.array([0, 1.0, 0])
    m0 = bench.strength * 0.03

    def flexes(c: float) -> list[Flex]:
        return [
            Flex(
                6,
                np.array([0, 0, 0.05]),
                lambda w, r: np.concatenate([np.zeros(3), axis * c * np.tanh(float(axis @ w[3:]) / m0)]),
            )
        ]

    return Hidden(
        "tool changer has clearance: the tool tips to and fro about one axis across the flange",
        "tool",
        "rad, half",
        2e-5,
        2e-3,
        flexes=flexes,
    )


def changer_opens(rng: Random, bench: Bench) -> Hidden:
    limit = bench.strength * float(rng.uniform(0.08, 0.12))

    def flexes(c: float) -> list[Flex]:
        def law(w: Array, r: Array) -> Array:
            across = np.array([w[3], w[4], 0])
            m = float(np.linalg.norm(across))
            return np.concatenate([np.zeros(3), across / max(m, 1e-9) * c * max(m - limit, 0.0)])

        return [Flex(6, np.array([0, 0, 0.02]), law)]

    return Hidden(
        "tool clamping opens once the tipping moment passes its preload", "tool", "rad/(N m)", 2e-7, 6e-5, flexes=flexes
    )


def force_sensor_soft(rng: Random, bench: Bench) -> Hidden:
    return Hidden(
        "force sensor between flange and tool is soft: tips and twists, and shifts a little",
        "tool",
        "rad/(N m)",
        2e-7,
        3e-5,
        flexes=lambda c: [Flex(6, np.array([0, 0, 0.03]), linear(np.diag([3e-4, 3e-4, 1e-4, 1, 1, 0.6]) * c))],
    )


def touches(rng: Random, bench: Bench) -> Hidden:
    visits = bench.rows[-1].visit + 1
    chosen = {int(v) for v in rng.choice(visits, max(visits // 5, 2), replace=False)}
    forces = {v: max((r.force for r in bench.rows if r.visit == v), key=lambda f: float(np.linalg.norm(f))) for v in chosen}
    way = {v: f / np.linalg.norm(f) for v, f in forces.items()}
    return Hidden(
        f"at {len(chosen)} poses the tool runs against the fixture while it yields (gap 60 um, then stiff)",
        "tool",
        "N/m",
        3e4,
        3e7,
        stop=lambda k, row: (way[row.visit], 60e-6, k) if row.visit in chosen else None,
        extra={"visits": sorted(chosen)},
    )


STRUCTURE = {
    f.__name__: f
    for f in (
        rocking_base,
        loose_bolt,
        soft_platform,
        carriage,
        column_bearing,
        elbow_bearing,
        lower_arm_beam,
        forearm_beam,
        flange_bearing,
        tool_beam,
        spindle_radial,
        changer_play,
        changer_opens,
        force_sensor_soft,
        touches,
    )
}

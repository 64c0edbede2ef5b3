"""What goes wrong in load tests, from the shop: its place, its realistic least and largest size, its physics.

`CAUSES[name](rng, trial)` gives `(place, least, largest, hooks of a size)`, or None where such a trial cannot have it. Least
equal to largest: the mistake has one size. Sizes are SI, degrees for angles of frames.
"""
from __future__ import annotations

from collections.abc import Callable

import numpy as np
from sixth_slips import SLIPS
from sixth_trial import UP_AND_DOWN, Hooks, Made, Trial, direction, play


# ---- gears ----
def lash(rng: np.random.Generator, t: Trial) -> Made:
    j, give = int(rng.choice([0, 3, 4, 5])), rng.uniform(3, 12)
    c = 1 / t.arm.stiffness[j]
    return f"{j + 1}", 1e-5, 8e-4, lambda a: Hooks(laws={j: lambda tau: c * tau + a * np.tanh(tau / give)})


def lost_motion(rng: np.random.Generator, t: Trial) -> Made:
    j, zone = int(rng.choice([0, 3, 4, 5])), rng.uniform(30, 90)
    c = 1 / t.arm.stiffness[j]
    return f"{j + 1}", .1, 4., lambda a: Hooks(laws={j: lambda tau: c * (tau + a * zone * np.tanh(tau / zone))})


def gear_friction(rng: np.random.Generator, t: Trial) -> Made:
    if t.design not in UP_AND_DOWN:
        return None
    j = int(rng.choice([1, 2, 0]))
    c = 1 / t.arm.stiffness[j]
    return f"{j + 1}", 3., 250., lambda a: Hooks(laws={j: lambda tau: c * play(tau, t.visit, a)})


def worn_sector(rng: np.random.Generator, t: Trial) -> Made:
    j = int(rng.choice([0, 1, 2]))
    middle = t.q[rng.integers(len(t.q)), j]
    near = np.exp(-.5 * ((t.q[:, j] - middle) / 8) ** 2)

    def hooks(a: float) -> Hooks:
        c = np.tile(1 / t.arm.stiffness, (len(t.q), 1))
        c[:, j] *= 1 + a * near
        return Hooks(compliance=c)
    return f"{j + 1}", .05, 1., hooks


def brake_slips(rng: np.random.Generator, t: Trial) -> Made:
    """The drives were off to save heat, the arm stands on its brakes, and one gives way under the largest load of a visit."""
    j, v = int(rng.choice([1, 2, 4])), int(rng.integers(t.visit[-1] + 1))
    c, mine = 1 / t.arm.stiffness[j], np.flatnonzero(t.visit == v)
    if len(mine) < 4:
        return None

    def law(a: float, tau: np.ndarray) -> np.ndarray:
        dq, d = c * tau, tau[mine] - tau[mine[0]]
        top = int(np.argmax(np.abs(d)))
        dq[mine[top:]] += a * np.sign(d[top])
        return dq
    return f"{j + 1}", 2e-5, 8e-4, lambda a: Hooks(laws={j: lambda tau: law(a, tau)})


def creep(rng: np.random.Generator, t: Trial) -> Made:
    if t.design == "single_load":
        return None
    j, slow = int(rng.choice([0, 1, 2])), rng.uniform(60, 200)
    c = 1 / t.arm.stiffness[j]

    def law(a: float, tau: np.ndarray) -> np.ndarray:
        h = tau.copy()
        for i in range(1, len(h)):
            if t.visit[i] == t.visit[i - 1]:
                h[i] = h[i - 1] + (tau[i] - h[i - 1]) * (1 - np.exp(-(t.time[i] - t.time[i - 1]) / slow))
        return c * (tau + a * h)
    return f"{j + 1}", .03, .8, lambda a: Hooks(laws={j: lambda tau: law(a, tau)})


def warming_gears(rng: np.random.Generator, t: Trial) -> Made:
    far = 1 - np.exp(-t.time / (.4 * t.time[-1]))
    return "", .03, .6, lambda a: Hooks(compliance=(1 + a * far[:, None]) / t.arm.stiffness)


def comes_loose(rng: np.random.Generator, t: Trial) -> Made:
    j, v = int(rng.choice([0, 1, 2])), int(rng.integers(t.visit[-1] // 3 + 1, t.visit[-1] * 3 // 4 + 1))
    after = np.outer(t.visit >= v, np.arange(6) == j)
    return f"{j + 1}", .05, 1.5, lambda a: Hooks(compliance=(1 + a * after) / t.arm.stiffness)


def soft_servo(rng: np.random.Generator, t: Trial) -> Made:
    """Soft servo was left on for one or two visits: everything is softer there."""
    v = int(rng.integers(t.visit[-1]))
    on = (t.visit >= v) & (t.visit <= v + rng.integers(2))
    return "", .1, 1.5, lambda a: Hooks(compliance=(1 + a * on[:, None]) / t.arm.stiffness)


# ---- structure ----
def _soft(place: str, matrix: np.ndarray, low: float, high: float, name: str = "") -> Made:
    return name, low, high, lambda a: Hooks(bends={place: lambda w: a * w @ matrix.T})


def _beam(length: float, along: int) -> np.ndarray:
    """A cantilever's tip compliance times E I, bending alone, about its two cross axes."""
    m, (u, v) = np.zeros((6, 6)), [(1, 2), (2, 0), (0, 1)][along]
    m[u, u] = m[v, v] = length ** 3 / 3
    m[3 + u, 3 + u] = m[3 + v, 3 + v] = length
    m[u, 3 + v] = m[3 + v, u] = length ** 2 / 2
    m[v, 3 + u] = m[3 + u, v] = -length ** 2 / 2
    return m


def forearm_bends(rng: np.random.Generator, t: Trial) -> Made:
    return _soft("wrist", _beam(t.arm.lengths[4], 0), 2e-8, 2e-6)


def lower_arm_twists(rng: np.random.Generator, t: Trial) -> Made:
    m = .3 * _beam(t.arm.lengths[2], 2)
    m[5, 5] = 1.6 * t.arm.lengths[2]
    return _soft("elbow", m, 2e-8, 2e-6)


def slew_bearing(rng: np.random.Generator, t: Trial) -> Made:
    return _soft("axis1", np.diag([0, 0, 0, 1, 1, 0.]), 1e-8, 1.5e-6)


def wrist_bearing(rng: np.random.Generator, t: Trial) -> Made:
    return _soft("axis5", np.diag([0, 0, 0, 1, 0, 1.]), 5e-8, 2e-5)


def pedestal(rng: np.random.Generator, t: Trial) -> Made:
    return _soft("base", np.diag([0, 0, 0, 1, rng.uniform(.4, 1), 0]), 1e-8, 1.5e-6)


def anchor_lifts(rng: np.random.Generator, t: Trial) -> Made:
    """One row of anchors has lost its pull: the plate tilts one way only, as soon as the moment goes that way."""
    i, way = int(rng.integers(3, 5)), float(rng.choice([-1, 1]))

    def bend(a: float, w: np.ndarray) -> np.ndarray:
        out = np.zeros_like(w)
        out[:, i] = a * way * np.maximum(way * w[:, i], 0)
        return out
    return "", 2e-8, 3e-6, lambda a: Hooks(bends={"base": lambda w: bend(a, w)})


def track_carriage(rng: np.random.Generator, t: Trial) -> Made:
    return _soft("base", np.diag([.2, 1, .1, .3, 0, 0]), 1e-8, 4e-7)


def spindle_bearings(rng: np.random.Generator, t: Trial) -> Made:
    return _soft("flange", np.diag([.2, 1, 1, 0, 0, 0]), 1e-8, 5e-7)


def sensor_behind_spindle(rng: np.random.Generator, t: Trial) -> Made:
    return _soft("flange", np.diag([2e-3, 5e-3, 5e-3, .5, 1, 1]), 2e-7, 2e-5)


def flange_screws(rng: np.random.Generator, t: Trial) -> Made:
    """The spindle plate rocks on loose screws: a gap that opens with the moment's sign."""
    i, give = int(rng.integers(4, 6)), rng.uniform(4, 15)

    def bend(a: float, w: np.ndarray) -> np.ndarray:
        out = np.zeros_like(w)
        out[:, i] = a * np.tanh(w[:, i] / give)
        return out
    return "", 2e-5, 1e-3, lambda a: Hooks(bends={"flange": lambda w: bend(a, w)})


def _stop(t: Trial, way: np.ndarray, only: np.ndarray, gap: float) -> Callable[[float], Hooks]:
    """A thing beside the tool, `a` N/m stiff, that holds it from a gap [m] on; found by halves, so that it settles."""
    def hooks(a: float) -> Hooks:
        held = np.zeros(len(only))

        def load(tr: Trial, force: np.ndarray, tcp0: np.ndarray, tcp: np.ndarray, frame: np.ndarray) -> tuple[np.ndarray, ...]:
            nonlocal held
            held = (held + a * only * np.maximum((tcp - tcp0) @ way - gap, 0)) / 2
            return tcp, force - np.outer(held, way)
        return Hooks(load=load)
    return hooks


def hose_package(rng: np.random.Generator, t: Trial) -> Made:
    """The dress pack is pulled tight in one direction and then carries a part of the load."""
    return "", 2e4, 4e5, _stop(t, direction(rng), np.ones(len(t.q)), rng.uniform(0, 1e-4))


def tool_touches(rng: np.random.Generator, t: Trial) -> Made:
    """In one visit the tool comes to lie against a clamp."""
    v = int(rng.integers(t.visit[-1] + 1))
    way = t.force[t.visit == v].sum(0)
    if not way.any():
        return None
    return "", 1e5, 6e5, _stop(t, way / np.linalg.norm(way), (t.visit == v) * 1.0, rng.uniform(2e-5, 2e-4))


CAUSES: dict[str, Callable[[np.random.Generator, Trial], Made]] = SLIPS | {f.__name__: f for f in (
    lash, lost_motion, gear_friction, worn_sector, brake_slips, creep, warming_gears, comes_loose, soft_servo,
    forearm_bends, lower_arm_twists, slew_bearing, wrist_bearing, pedestal, anchor_lifts, track_carriage, spindle_bearings,
    sensor_behind_spindle, flange_screws, hose_package, tool_touches)}

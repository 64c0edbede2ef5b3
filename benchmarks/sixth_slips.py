"""What goes wrong beside the robot: instruments, loads, people and files. `SLIPS[name](rng, trial)` as in sixth_causes.py."""
from __future__ import annotations

from collections.abc import Callable

import numpy as np
from sixth_arm import GRAVITY, Arm, turn
from sixth_trial import UP_AND_DOWN, Hooks, Made, Table, Trial, direction, play


def _axis(t: Trial, rng: np.random.Generator) -> int:
    """An axis of the instruments that is read often."""
    often = np.flatnonzero(t.seen.sum(0) >= .3 * len(t.seen))
    return int(rng.choice(often if len(often) else [np.argmax(t.seen.sum(0))]))


# ---- instruments ----
def sensors_turned(rng: np.random.Generator, t: Trial) -> Made:
    way = direction(rng)
    return "", .7, 12., lambda a: Hooks(read=lambda tr, z, s, f: z @ turn(np.radians(a) * way[None])[0])


def stand_yields(rng: np.random.Generator, t: Trial) -> Made:
    m = np.diag(rng.uniform(.3, 1, 3))
    return "", 5e-9, 6e-7, lambda a: Hooks(read=lambda tr, z, s, f: z + a * tr.force @ m)


def gauge_scale(rng: np.random.Generator, t: Trial) -> Made:
    i = _axis(t, rng)
    return "xyz"[i], .02, .5, lambda a: Hooks(read=lambda tr, z, s, f: z * (1 + a * (np.arange(3) == i)))


def gauge_sticks(rng: np.random.Generator, t: Trial) -> Made:
    if t.instrument != "gauges" or t.design not in (*UP_AND_DOWN, "box"):
        return None
    i = _axis(t, rng)

    def read(a: float, z: np.ndarray) -> np.ndarray:
        z = z.copy()
        z[:, i] = play(z[:, i], t.visit, a)
        return z
    return "xyz"[i], 3e-6, 3e-5, lambda a: Hooks(read=lambda tr, z, s, f: read(a, z))


def round_target(rng: np.random.Generator, t: Trial) -> Made:
    """Gauges touch the shank of the tool: what goes sideways reads along."""
    if t.instrument != "gauges":
        return None

    def read(a: float, z: np.ndarray) -> np.ndarray:
        return z - a * ((z ** 2).sum(1, keepdims=True) - z ** 2) / 2
    return "", 1 / .06, 1 / .004, lambda a: Hooks(read=lambda tr, z, s, f: read(a, z))


def knocked(rng: np.random.Generator, t: Trial) -> Made:
    i, v = _axis(t, rng), int(rng.integers(t.visit[-1] + 1))
    mine = np.flatnonzero(t.visit == v)
    if len(mine) < 4 or not t.seen[mine[0], i]:
        return None
    after = mine[int(rng.integers(2, len(mine))):]

    def read(a: float, z: np.ndarray) -> np.ndarray:
        z = z.copy()
        z[after, i] += a
        return z
    return "xyz"[i], 1e-5, 6e-4, lambda a: Hooks(read=lambda tr, z, s, f: read(a, z))


def end_of_travel(rng: np.random.Generator, t: Trial) -> Made:
    if t.instrument != "gauges":
        return None
    i = _axis(t, rng)

    def read(a: float, z: np.ndarray) -> np.ndarray:
        z, most = z.copy(), np.abs(z[t.seen[:, i], i]).max() * (1 - a)
        z[:, i] = np.clip(z[:, i], -most, most)
        return z
    return "xyz"[i], .05, .6, lambda a: Hooks(read=lambda tr, z, s, f: read(a, z))


def reflector_beside(rng: np.random.Generator, t: Trial) -> Made:
    way = direction(rng)
    return "", .01, .25, lambda a: Hooks(read=lambda tr, z, s, f: z + a * (s.frame - s.frame[f]) @ way)


def zero_once(rng: np.random.Generator, t: Trial) -> Made:
    """Zero was taken in the morning only, and hall and tracker drift."""
    way = direction(rng)
    return "", 5e-6, 4e-4, lambda a: Hooks(read=lambda tr, z, s, f: z + a * np.outer(tr.time / tr.time[-1], way))


def sun_on_the_arm(rng: np.random.Generator, t: Trial) -> Made:
    """Zero once, and the sun comes and goes: the drift swings."""
    way, beats = direction(rng), rng.uniform(1.2, 2.5)
    swing = np.sin(2 * np.pi * beats * t.time / t.time[-1])
    return "", 5e-6, 3e-4, lambda a: Hooks(read=lambda tr, z, s, f: z + a * np.outer(swing, way))


def stand_creeps(rng: np.random.Generator, t: Trial) -> Made:
    """The magnet stand settles after each zero."""
    way, slow = direction(rng), rng.uniform(50, 120)
    since = t.time - t.time[np.flatnonzero(t.zero)[t.visit]]
    return "", 5e-6, 1e-4, lambda a: Hooks(read=lambda tr, z, s, f: z + a * np.outer(1 - np.exp(-since / slow), way))


def noisy_hour(rng: np.random.Generator, t: Trial) -> Made:
    """A forklift works beside the cell during two or three visits: their readings scatter."""
    v, e = int(rng.integers(t.visit[-1] - 1)), rng.normal(size=(len(t.q), 3))
    on = ((t.visit >= v) & (t.visit <= v + 2) & ~t.zero)[:, None]
    return "", 5e-6, 8e-5, lambda a: Hooks(read=lambda tr, z, s, f: z + a * on * e)


# ---- loads ----
def _force(change: Callable[[float, np.ndarray], np.ndarray]) -> Callable[[float], Hooks]:
    return lambda a: Hooks(load=lambda t, force, tcp0, tcp, frame: (tcp, change(a, force)))


def cell_zero(rng: np.random.Generator, t: Trial) -> Made:
    """The load cell was zeroed with the hook pulling on it: each load is larger by that."""
    if t.weights:
        return None
    size = np.linalg.norm(t.force, axis=1, keepdims=True)
    unit = t.force / np.where(size > 0, size, 1)
    line = unit * np.where(unit.sum(1, keepdims=True) < 0, -1, 1)       # it adds one way, takes off the other
    return "", 3., 120., _force(lambda a, f: f + a * line)


def hook_uncounted(rng: np.random.Generator, t: Trial) -> Made:
    if not t.weights:
        return None
    hung = np.linalg.norm(t.force, axis=1, keepdims=True)
    return "", 3., 120., _force(lambda a, f: f + a * t.force / np.where(hung > 0, hung, 1))


def out_of_plumb(rng: np.random.Generator, t: Trial) -> Made:
    axis = int(np.argmax(np.abs(t.force).sum(0))) if rng.random() < .5 else int(rng.integers(3))
    mine = (np.abs(t.force).argmax(1) == axis) & (np.abs(t.force).max(1) > 0)
    side = np.cross(np.eye(3)[axis], direction(rng))
    side /= np.linalg.norm(side)
    return "xyz"[axis], 1., 15., _force(lambda a, f: f + np.tan(np.radians(a)) * np.outer(f[:, axis] * mine, side))


def pulley(rng: np.random.Generator, t: Trial) -> Made:
    if t.design != "gauges_pulley":
        return None
    size = np.linalg.norm(t.force, axis=1)
    up = np.sign(np.diff(size, prepend=0))
    side = np.abs(t.force[:, 2]) < 1
    return "", .01, .25, _force(lambda a, f: f * (1 - a * up * side)[:, None])


def seal_friction(rng: np.random.Generator, t: Trial) -> Made:
    """The load is read from the cylinder's pressure: the seal takes its share against the motion."""
    if t.design not in ("tracker_cylinder", "two_gauges_hoist"):
        return None
    moved = np.diff(t.force, axis=0, prepend=np.zeros((1, 3))) * ~t.zero[:, None]
    return "", 4., 120., _force(lambda a, f: f - a * np.sign(moved))


def hook_beside(rng: np.random.Generator, t: Trial) -> Made:
    way = direction(rng)
    return "", .005, .3, lambda a: Hooks(load=lambda tr, force, tcp0, tcp, frame: (tcp + a * frame @ way, force))


def mislabelled_weight(rng: np.random.Generator, t: Trial) -> Made:
    if not t.weights:
        return None
    size = np.round(np.linalg.norm(t.force, axis=1), 3)
    level = rng.choice(np.unique(size[size > 0]))
    return "", .02, .35, _force(lambda a, f: f * (1 - a * (size == level))[:, None])


def one_load(rng: np.random.Generator, t: Trial) -> Made:
    row = int(rng.choice(np.flatnonzero(np.abs(t.force).sum(1) > 0)))
    return "", .05, 1., _force(lambda a, f: f * (1 - a * (np.arange(len(f)) == row))[:, None])


def crosstalk(rng: np.random.Generator, t: Trial) -> Made:
    """The six-axis sensor shows a part of one component in another."""
    if t.weights:
        return None
    i, j = rng.permutation(3)[:2]
    return "", .015, .25, _force(lambda a, f: f + a * np.outer(f[:, i], np.eye(3)[j]))


def gain_drifts(rng: np.random.Generator, t: Trial) -> Made:
    """The load cell warms beside the hydraulic pump: its scale runs away during the day."""
    if t.weights:
        return None
    return "", .02, .4, _force(lambda a, f: f * (1 + a * t.time / t.time[-1])[:, None])


# ---- people and files ----
def _typed(change: Callable[[Table], None]) -> Callable[[float], Hooks]:
    return lambda a: Hooks(table=change)


def _visit(rng: np.random.Generator, t: Trial, least: int = 1) -> int:
    return int(rng.integers(least - 1, t.visit[-1] + 1))


def zero_forgotten(rng: np.random.Generator, t: Trial) -> Made:
    if t.design == "single_load":
        return None
    v = _visit(rng, t)

    def change(b: Table) -> None:
        mine = np.flatnonzero(b.visit == v)
        b.read[mine] -= b.read[mine[0]].copy()
    return "", 1, 1, _typed(change)


def kilograms(rng: np.random.Generator, t: Trial) -> Made:
    v = _visit(rng, t)

    def change(b: Table) -> None:
        b.force[b.visit == v] = np.round(b.force[b.visit == v] / GRAVITY, 1)
    return "", 1, 1, _typed(change)


def gauge_sign(rng: np.random.Generator, t: Trial) -> Made:
    i = _axis(t, rng)

    def change(b: Table) -> None:
        b.read[:, i] *= -1
    return "xyz"[i], 1, 1, _typed(change)


def gauges_swapped(rng: np.random.Generator, t: Trial) -> Made:
    pair = [(0, 1), (1, 2), (0, 2)][rng.integers(3)]
    if t.design in ("one_gauge_pull", "two_gauges_hoist"):
        return None

    def change(b: Table) -> None:
        b.read[:, list(pair)] = b.read[:, list(pair[::-1])]
    return "", 1, 1, _typed(change)


def decimal_slip(rng: np.random.Generator, t: Trial) -> Made:
    rows = int(rng.integers(0, (~t.zero).sum()))

    def change(b: Table) -> None:
        i = int(np.nanargmax(np.abs(b.read[rows])))
        b.read[rows, i] *= 10 if rows % 2 else .1
    return "", 1, 1, _typed(change)


def rows_swapped(rng: np.random.Generator, t: Trial) -> Made:
    v, first = _visit(rng, t), int(rng.integers(0, 3))

    def change(b: Table) -> None:
        mine = np.flatnonzero(b.visit == v)
        pair = [mine[first % len(mine)], mine[(first + 1) % len(mine)]]
        b.read[pair] = b.read[pair[::-1]]
    return ("", 1, 1, _typed(change)) if t.design != "single_load" else None


def angle_sign(rng: np.random.Generator, t: Trial) -> Made:
    v = _visit(rng, t)
    q = t.q[t.visit == v][0]
    j = int(rng.choice(np.flatnonzero(np.abs(q) > 12)))

    def change(b: Table) -> None:
        b.q[b.visit == v, j] *= -1
    return f"{j + 1}", 1, 1, _typed(change)


def poses_exchanged(rng: np.random.Generator, t: Trial) -> Made:
    v = _visit(rng, t, 2)

    def change(b: Table) -> None:
        one, two = b.q[b.visit == v - 1][0].copy(), b.q[b.visit == v][0].copy()
        b.q[b.visit == v - 1], b.q[b.visit == v] = two, one
    return "", 1, 1, _typed(change)


def tool_length(rng: np.random.Generator, t: Trial) -> Made:
    def hooks(a: float) -> Hooks:
        def arm(stated: Arm) -> None:
            stated.tool = stated.tool - np.array([0, 0, a])
        return Hooks(arm=arm)
    return "", .02, .2, hooks


def tool_turned(rng: np.random.Generator, t: Trial) -> Made:
    def arm(stated: Arm) -> None:
        x, y, z = stated.tool
        stated.tool = np.array([-y, x, z])
    return "", 1, 1, lambda a: Hooks(arm=arm)


def forces_in_the_work_object(rng: np.random.Generator, t: Trial) -> Made:
    way = float(rng.choice([-1, 1]))

    def hooks(a: float) -> Hooks:
        def change(b: Table) -> None:
            b.force = np.round(b.force @ turn(np.array([[0, 0, way * np.radians(a)]]))[0], 1)
        return Hooks(table=change)
    return ("", 3., 40., hooks) if t.design != "tracker_weights" else None


def reaction(rng: np.random.Generator, t: Trial) -> Made:
    v = _visit(rng, t)

    def change(b: Table) -> None:
        b.force[(b.visit == v) | (b.visit == v + 1)] *= -1
    return ("", 1, 1, _typed(change)) if not t.weights else None


def serial_angle(rng: np.random.Generator, t: Trial) -> Made:
    def change(b: Table) -> None:
        b.q[:, 2] -= b.q[:, 1]
    return ("3", 1, 1, _typed(change)) if t.arm.rod else None


def copied_visit(rng: np.random.Generator, t: Trial) -> Made:
    v = _visit(rng, t, 2)

    def change(b: Table) -> None:
        one, two = np.flatnonzero(b.visit == v - 1), np.flatnonzero(b.visit == v)
        b.read[two] = np.where(np.isfinite(b.read[two]), b.read[one], np.nan)
    return ("", 1, 1, _typed(change)) if t.design in ("gauges_pulley", "tracker_cylinder", "tracker_weights", "box") else None


def tool_frame_readings(rng: np.random.Generator, t: Trial) -> Made:
    if t.design in ("one_gauge_pull", "two_gauges_hoist"):
        return None
    return "", 1, 1, lambda a: Hooks(read=lambda tr, z, s, f: np.einsum("nji,nj->ni", s.frame[f], z))


def increments(rng: np.random.Generator, t: Trial) -> Made:
    def change(b: Table) -> None:
        whole = b.read.copy()
        later = np.flatnonzero(b.visit[1:] == b.visit[:-1]) + 1
        b.read[later] -= whole[later - 1]
    return ("", 1, 1, _typed(change)) if t.design != "single_load" else None


def mastering(rng: np.random.Generator, t: Trial) -> Made:
    """An axis was mastered wrong after its motor was changed: the pendant is off by degrees."""
    j = int(rng.choice([1, 2, 3, 4]))

    def hooks(a: float) -> Hooks:
        def change(b: Table) -> None:
            b.q[:, j] -= a
        return Hooks(table=change)
    return f"{j + 1}", .5, 12., hooks


def longer_arm(rng: np.random.Generator, t: Trial) -> Made:
    """The robot is the long version of the type that cell.yaml names."""
    short = t.arm.lengths
    t.arm.lengths = (*short[:4], short[4] + .25, short[5])

    def arm(stated: Arm) -> None:
        stated.lengths = short
    return "", 1, 1, lambda a: Hooks(arm=arm)


SLIPS: dict[str, Callable[[np.random.Generator, Trial], Made]] = {f.__name__: f for f in (
    sensors_turned, stand_yields, gauge_scale, gauge_sticks, round_target, knocked, end_of_travel, reflector_beside,
    zero_once, sun_on_the_arm, stand_creeps, noisy_hour, cell_zero, hook_uncounted, out_of_plumb, pulley, seal_friction,
    hook_beside, mislabelled_weight, one_load, crosstalk, gain_drifts, zero_forgotten, kilograms, gauge_sign,
    gauges_swapped, decimal_slip, rows_swapped, angle_sign, poses_exchanged, tool_length, tool_turned,
    forces_in_the_work_object, reaction, serial_angle, copied_visit, tool_frame_readings, increments, mastering, longer_arm)}

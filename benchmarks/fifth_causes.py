"""What the fifth judge hides: each cause a law of its own, whose size is a number that grows from nothing.

A cause draws what belongs to it (a joint, an axis, a row) from the generator, always the same for the same seed, and answers
for any size; `size` is one that physics calls plausible, `fixed` causes have that one only. Designs: where it can show.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from benchmarks.fifth_arm import Array, Gear, Loads, Seat, turning
from benchmarks.fifth_trial import DESIGNS, Hidden, Rng, Trial

CYCLIC = ("cycles", "cable", "dead weights", "push")
WITH_FORCES = ("cycles", "three loads", "cable", "push")


@dataclass(frozen=True)
class Cause:
    name: str
    of: str
    size: float
    make: Callable[[Rng, Trial, float], Hidden]
    designs: tuple[str, ...] = DESIGNS
    fixed: bool = False


CAUSES: list[Cause] = []
Make = Callable[[Rng, Trial, float], Hidden]


def cause(of: str, size: float, designs: tuple[str, ...] = DESIGNS, fixed: bool = False) -> Callable[[Make], Make]:
    def kept(make: Make) -> Make:
        CAUSES.append(Cause(make.__name__, of, size, make, designs, fixed))
        return make
    return kept


def play(values: Array, half: float | Array, visit: Array, first: Array | None = None) -> Array:
    """What lags its input (N, ...) by a half width; begun anew where a visit begins, in the middle or at `first`."""
    out = values.copy() if first is None else first.copy()
    for row in range(1, len(values)):
        if visit[row] == visit[row - 1]:
            out[row] = np.clip(out[row - 1], values[row] - half, values[row] + half)
    return out


def side(values: Array, least: float, visit: Array, start: Array) -> Array:
    """On which side of a gap (N,) a part lies: -1 or 1; it stays where it is while the load is under `least`."""
    out = np.where(np.abs(values) > least, np.sign(values), start)
    for row in range(1, len(values)):
        if visit[row] == visit[row - 1] and abs(values[row]) <= least:
            out[row] = out[row - 1]
    return out


def only(joint: int, values: Array) -> Array:
    turns = np.zeros((len(values), 6))
    turns[:, joint] = values
    return turns


def direction(rng: Rng) -> Array:
    u = rng.normal(size=3)
    return u / np.linalg.norm(u)


def drawn_joint(rng: Rng, one: Trial, among: tuple[int, ...] = (0, 1, 2, 3, 4, 5)) -> int:
    return int(rng.choice([j for j in among if not (j == 0 and one.design == "dead weights")]))


def geared(joint: int, law: Callable[[Trial, Array], Array]) -> Hidden:
    """A law of one joint alone: torque (N,) -> turn beyond its spring's (N,)."""
    def gear(one: Trial) -> Gear:
        return lambda torque: only(joint, law(one, torque[:, joint]))
    return Hidden(gear=gear, told={"joint": joint + 1})


def seated(frame: int, where: Array, law: Seat, **told: object) -> Hidden:
    return Hidden(seats=((frame, where, law),), told={"frame": frame} | told)


# Gears ------------------------------------------------------------------------------------------------------------------


@cause("gear", 3e-5, CYCLIC)
def backlash(rng: Rng, one: Trial, size: float) -> Hidden:
    """Teeth free in a gap of +-size [rad]; seals hold them where they are under 3 N m."""
    joint, start = drawn_joint(rng, one), rng.choice([-1.0, 1.0], int(one.visit.max()) + 1)
    return geared(joint, lambda t, torque: size * side(torque, 3.0, t.visit, start[t.visit]))


@cause("gear", 0.2, CYCLIC)
def friction_loop(rng: Rng, one: Trial, size: float) -> Hidden:
    """A share of the spring lies behind Coulomb friction: three sliders in series."""
    joint, width = drawn_joint(rng, one), float(rng.uniform(0.1, 0.3) * one.force.max())
    return geared(joint, lambda t, torque: size / t.stiffness[joint]
                  * sum(play(torque, width * part, t.visit) for part in (0.2, 0.5, 1.0)) / 3)


@cause("gear", 0.5)
def soft_at_zero(rng: Rng, one: Trial, size: float) -> Hidden:
    """A wave gear's flank: softer by the share `size` until the teeth bear, at some torque."""
    joint, bears = drawn_joint(rng, one), float(rng.uniform(0.1, 0.3) * np.abs(one.force).max())
    return geared(joint, lambda t, torque: size * bears / t.stiffness[joint] * np.tanh(torque / bears))


@cause("gear", 0.2)
def one_sided(rng: Rng, one: Trial, size: float) -> Hidden:
    """A worn flank: softer by a share in one sense of the torque."""
    joint, sense = drawn_joint(rng, one, (0, 3, 4, 5)), float(rng.choice([-1, 1]))
    return geared(joint, lambda t, torque: size / t.stiffness[joint] * sense * np.maximum(sense * torque, 0))


@cause("gear", 0.2)
def tooth_ripple(rng: Rng, one: Trial, size: float) -> Hidden:
    """An eccentric wheel: the compliance swings by the share `size` with the joint's angle, once to three times a turn."""
    joint, times, phase = drawn_joint(rng, one), int(rng.integers(1, 4)), rng.uniform(0, 6.28)
    return geared(joint, lambda t, torque: size / t.stiffness[joint] * np.cos(times * t.shown[:, joint] + phase) * torque)


@cause("gear", 0.15, CYCLIC)
def creep(rng: Rng, one: Trial, size: float) -> Hidden:
    """A share of the spring comes late, with a time constant of one to three minutes; loads stand 20 s before they are read."""
    joint, constant = drawn_joint(rng, one), rng.uniform(60, 180)

    def law(t: Trial, torque: Array) -> Array:
        out = torque - torque
        for v in np.unique(t.visit):
            rows = np.flatnonzero(t.visit == v)
            steps = np.diff(torque[rows], prepend=torque[rows[0]])
            since = t.time[rows][:, None] - (t.time[rows][None, :] - 20)
            out[rows] = np.where(since > 0, 1 - np.exp(-np.maximum(since, 0) / constant), 0) @ steps
        return size / t.stiffness[joint] * out
    return geared(joint, law)


@cause("gear", 0.3)
def wrist_cross(rng: Rng, one: Trial, size: float) -> Hidden:
    """Bevel gears of the wrist: the torque of axis 6 winds axis 5 too, and the other way round."""
    def gear(t: Trial) -> Gear:
        share = size / np.sqrt(t.stiffness[4] * t.stiffness[5])
        return lambda torque: share * (only(4, torque[:, 5]) + only(5, torque[:, 4]))
    return Hidden(gear=gear)


@cause("time", 0.1)
def gears_warm_up(rng: Rng, one: Trial, size: float) -> Hidden:
    """All gears get softer by a share from the first to the last row: grease and bearings get warm."""
    def gear(t: Trial) -> Gear:
        return lambda torque: size * (1 - np.exp(-2 * t.time / t.time.max()))[:, None] * torque / t.stiffness
    return Hidden(gear=gear)


# Structure --------------------------------------------------------------------------------------------------------------


@cause("base", 1e-8)
def base_rocking(rng: Rng, one: Trial, size: float) -> Hidden:
    """A floor that gives way under the base's edge, about one horizontal axis more than about the other."""
    soft = size * np.array([1, rng.uniform(0.4, 1), 0])
    return seated(0, np.zeros(3), lambda force, moment: (0 * force, soft * moment))


@cause("base", 2e-8)
def base_shift(rng: Rng, one: Trial, size: float) -> Hidden:
    """A base plate on its grout: it slides elastically, sideways."""
    soft = size * np.array([1, rng.uniform(0.5, 1), 0.1])
    return seated(0, np.zeros(3), lambda force, moment: (soft * force, 0 * force))


@cause("base", 3e-8, WITH_FORCES)
def loose_bolt(rng: Rng, one: Trial, size: float) -> Hidden:
    """One anchor is loose: the plate tilts about one axis, to one side, beyond what its preload holds."""
    turn, held = rng.uniform(0, 6.28), 0.25 * np.abs(one.force).max()
    u = np.array([np.cos(turn), np.sin(turn), 0])
    return seated(0, np.zeros(3), lambda force, moment: (0 * force, size * np.outer(np.maximum(moment @ u - held, 0), u)))


def beam(along: Array, length: float, soft: float, twist: float) -> Seat:
    """Slender beam clamped at one end, seen at the other: soft = length / EI [rad/(N m)], twist = length / GJ."""
    across = np.eye(3) - np.outer(along, along)

    def law(force: Array, moment: Array) -> tuple[Array, Array]:
        f, m = force @ across, moment @ across
        shift = soft * (length**2 / 3 * f + length / 2 * np.cross(m, along))
        return shift, soft * (m + length / 2 * np.cross(along, f)) + twist * np.outer(moment @ along, along)
    return law


@cause("link", 5e-8)
def lower_arm_bends(rng: Rng, one: Trial, size: float) -> Hidden:
    length = float(one.arm.a[2])
    return seated(2, np.array([length, 0, 0]), beam(np.array([1.0, 0, 0]), length, size, size))


@cause("link", 1e-7)
def forearm_bends(rng: Rng, one: Trial, size: float) -> Hidden:
    length = float(one.arm.d[3])
    return seated(3, np.array([one.arm.a[3], length, 0]), beam(np.array([0, 1.0, 0]), length, size, 0.5 * size))


@cause("link", 1e-7)
def bearing_tilts(rng: Rng, one: Trial, size: float) -> Hidden:
    """A main bearing gives way across its axis."""
    joint = drawn_joint(rng, one, (1, 2, 3, 4))
    soft = size * np.array([1, 1, 0])
    return seated(joint + 1, np.zeros(3), lambda force, moment: (0 * force, soft * moment), joint=joint + 1)


@cause("tool", 2e-7)
def adapter_tilts(rng: Rng, one: Trial, size: float) -> Hidden:
    """The spindle's bracket at the flange: a plate that tilts about its two axes, unlike."""
    soft = size * np.array([1, rng.uniform(0.2, 1), 0.2])
    return seated(6, np.zeros(3), lambda force, moment: (0 * force, soft * moment))


@cause("tool", 2e-8)
def shank_bends(rng: Rng, one: Trial, size: float) -> Hidden:
    """Spindle bearings and shank: the TCP gives way sideways, not along the tool."""
    soft = size * np.array([1, 1, 0.1])
    return seated(6, one.arm.tool, lambda force, moment: (soft * force, 0 * force))


@cause("tool", 5e-5, ("cycles", "cable", "push"))
def clamp_plays(rng: Rng, one: Trial, size: float) -> Hidden:
    """The spindle sits loose in its clamp: it tips about an axis of the flange by +-size [rad], held under 8 N m."""
    turn, start = rng.uniform(0, 6.28), rng.choice([-1.0, 1.0], int(one.visit.max()) + 1)
    u = np.array([np.cos(turn), np.sin(turn), 0])
    return seated(6, np.zeros(3), lambda force, moment: (
        0 * force, size * np.outer(side(moment @ u, 8.0, one.visit, start[one.visit]), u)))


# Load -------------------------------------------------------------------------------------------------------------------


def loaded(change: Callable[[Trial, Rng], Array], **told: object) -> Hidden:
    return Hidden(loads=lambda one, rng: Loads.at_tcp(change(one, rng)), told=dict(told))


@cause("load", 0.03, WITH_FORCES)
def force_turned(rng: Rng, one: Trial, size: float) -> Hidden:
    """The rig stands turned by `size` [rad] against the base's axes."""
    turn = turning(size * direction(rng)[None])[0]
    return loaded(lambda t, _: t.force @ turn.T)


@cause("load", 10.0, WITH_FORCES)
def load_cell_zero(rng: Rng, one: Trial, size: float) -> Hidden:
    """The load cell was not set to zero: every load is `size` [N] less than it shows, along its line."""
    def change(t: Trial, _: Rng) -> Array:
        amount = np.linalg.norm(t.force, axis=1, keepdims=True)
        return t.force * (1 - size / np.where(amount > 0, amount, np.inf))
    return loaded(change)


@cause("load", 0.03, ("cable",))
def pulley_rubs(rng: Rng, one: Trial, size: float) -> Hidden:
    """The sheave takes its share of the pull while the weight sinks, and adds it while it is lifted."""
    def change(t: Trial, _: Rng) -> Array:
        amount = np.linalg.norm(t.force, axis=1)
        return t.force * (1 - size * np.sign(np.diff(amount, prepend=0)))[:, None]
    return loaded(change)


@cause("load", 0.01)
def hook_off(rng: Rng, one: Trial, size: float) -> Hidden:
    """The load acts beside the TCP by `size` [m]; what is looked at is the TCP."""
    hook = size * direction(rng)
    return Hidden(loads=lambda t, _: Loads(t.force, 0 * t.force, hook))


@cause("load", 0.1, ("dead weights",))
def wrong_weight(rng: Rng, one: Trial, size: float) -> Hidden:
    """The heaviest stack weighs more than is written on it."""
    def change(t: Trial, _: Rng) -> Array:
        amount = np.linalg.norm(t.force, axis=1)
        return t.force * np.where(amount > 0.9 * amount.max(), 1 + size, 1)[:, None]
    return loaded(change)


@cause("load", 0.02, ("dead weights",))
def weight_swings(rng: Rng, one: Trial, size: float) -> Hidden:
    """The weight was read while it swung: a share of it sideways, by chance in each row."""
    def change(t: Trial, noise: Rng) -> Array:
        aside = noise.normal(size=(len(t.force), 2)) * size * np.linalg.norm(t.force, axis=1)[:, None]
        return t.force + np.column_stack([aside, np.zeros(len(aside))])
    return loaded(change)


# Instrument -------------------------------------------------------------------------------------------------------------


@cause("instrument", 0.03)
def bracket_turned(rng: Rng, one: Trial, size: float) -> Hidden:
    turn = turning(size * direction(rng)[None])[0]
    return Hidden(reading=lambda t, moved: moved @ turn)


@cause("instrument", 0.03)
def gauge_gain(rng: Rng, one: Trial, size: float) -> Hidden:
    """One sensor shows a share more than there is."""
    factor = 1 + size * np.eye(3)[rng.integers(3)]
    return Hidden(reading=lambda t, moved: moved * factor)


@cause("instrument", 4e-6, CYCLIC)
def gauge_sticks(rng: Rng, one: Trial, size: float) -> Hidden:
    """Plungers that stick: each reading stays behind by `size` [m]."""
    return Hidden(reading=lambda t, moved: play(moved, size, t.visit))


@cause("instrument", 100.0)
def round_target(rng: Rng, one: Trial, size: float) -> Hidden:
    """Gauges against a ball of the curvature `size` [1/m]: what moves sideways reads as away from the gauge."""
    toward = rng.choice([-1.0, 1.0], 3)
    return Hidden(reading=lambda t, moved: moved + toward * size / 2 * ((moved**2).sum(1, keepdims=True) - moved**2))


@cause("instrument", 0.01)
def reflector_off(rng: Rng, one: Trial, size: float) -> Hidden:
    """What is looked at is beside the TCP by `size` [m]; the load acts at the TCP."""
    return Hidden(target=size * direction(rng))


@cause("instrument", 2e-8)
def stand_drifts(rng: Rng, one: Trial, size: float) -> Hidden:
    """The sun on the stand: it bends steadily [m/s] from each zero reading on."""
    u = direction(rng)
    return Hidden(reading=lambda t, moved: moved + size * np.outer(t.time - t.time[t.first], u))


@cause("instrument", 2e-5)
def gauge_kicked(rng: Rng, one: Trial, size: float) -> Hidden:
    """Somebody touched one gauge: from one row of a visit on to its end it reads `size` [m] more."""
    axis, visit, share = int(rng.integers(3)), int(rng.integers(one.visit.max() + 1)), rng.uniform(0.3, 0.8)
    rows = np.flatnonzero(one.visit == visit)
    hit = rows[max(1, int(share * len(rows))):]

    def reading(t: Trial, moved: Array) -> Array:
        out = moved.copy()
        out[hit, axis] += size
        return out
    return Hidden(reading=reading, told={"row": int(hit[0]) + 1, "pose": f"P{visit + 1}"})


@cause("instrument", 0.1, CYCLIC)
def read_too_early(rng: Rng, one: Trial, size: float) -> Hidden:
    """A slow display: each reading keeps a share of the one before."""
    def reading(t: Trial, moved: Array) -> Array:
        before = np.where((t.first == np.arange(len(moved)))[:, None], moved, np.roll(moved, 1, axis=0))
        return (1 - size) * moved + size * before
    return Hidden(reading=reading)


# People -----------------------------------------------------------------------------------------------------------------


@cause("people", 0.05)
def angle_mistyped(rng: Rng, one: Trial, size: float) -> Hidden:
    """One angle of one pose was written down wrong by `size` [rad]."""
    joint, visit = int(rng.integers(1, 5)), int(rng.integers(one.visit.max() + 1))

    def table(t: Trial, told: dict[str, Array]) -> dict[str, Array]:
        told["shown"][t.visit == visit, joint] += size
        return told
    return Hidden(table=table, told={"joint": joint + 1, "pose": f"P{visit + 1}"})


@cause("people", 0.02)
def mastering_off(rng: Rng, one: Trial, size: float) -> Hidden:
    """One axis was mastered wrong by `size` [rad]: it truly stands elsewhere than the pendant shows."""
    joint = drawn_joint(rng, one, (1, 2, 3, 4, 5))
    return Hidden(truly=lambda t: (t.arm, t.shown + size * np.eye(6)[joint]), told={"joint": joint + 1})


@cause("people", 0.02)
def tool_mismeasured(rng: Rng, one: Trial, size: float) -> Hidden:
    """Load and reflector are where they should be, but cell.yaml has the TCP wrong by `size` [m]."""
    aside = size * direction(rng)
    return Hidden(truly=lambda t: (replace(t.arm, tool=t.arm.tool + aside), t.shown))


@cause("people", 1.0, fixed=True)
def angle_sign(rng: Rng, one: Trial, size: float) -> Hidden:
    """One wrist angle of all poses has the other sign."""
    joint = int(rng.choice([3, 4]))

    def table(t: Trial, told: dict[str, Array]) -> dict[str, Array]:
        told["shown"][:, joint] *= -1
        return told
    return Hidden(table=table, told={"joint": joint + 1})


@cause("people", 0.1, WITH_FORCES)
def table_turned(rng: Rng, one: Trial, size: float) -> Hidden:
    """Forces and deflections are in a frame of the hall, turned by `size` [rad] about the plumb line against the base."""
    turn = turning(np.array([[0, 0, size]]))[0]

    def table(t: Trial, told: dict[str, Array]) -> dict[str, Array]:
        return told | {"force": told["force"] @ turn, "moved": told["moved"] @ turn}
    return Hidden(table=table)

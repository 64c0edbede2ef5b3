"""What the fifth judge hides: a table of causes, each a law of its own whose size is a number that grows from nothing.

A cause draws what belongs to it (a joint, an axis, a row) from the generator, always the same for the same seed, and answers
for any size; `size` is one that physics calls plausible, `fixed` causes have that one only. Designs: where it can show.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from benchmarks.fifth_arm import Array, Seat, turning
from benchmarks.fifth_trial import DESIGNS, Hidden, Rng, Trial

CYCLIC = ("cycles", "cable", "dead weights", "push")
WITH_FORCES = ("cycles", "three loads", "cable", "push")
BOTH_WAYS = ("cycles", "cable", "push")
Law = Callable[[Array], Array]


@dataclass(frozen=True)
class Cause:
    name: str
    of: str
    size: float
    make: Callable[[Rng, Trial, float], Hidden]
    designs: tuple[str, ...] = DESIGNS
    fixed: bool = False


def direction(rng: Rng) -> Array:
    u = rng.normal(size=3)
    return u / np.linalg.norm(u)


def level(rng: Rng) -> Array:
    turn = rng.uniform(0, 6.28)
    return np.array([np.cos(turn), np.sin(turn), 0])


def drawn_joint(rng: Rng, one: Trial, among: tuple[int, ...] = (0, 1, 2, 3, 4, 5)) -> int:
    return int(rng.choice([j for j in among if not (j == 0 and one.design == "dead weights")]))


def play(values: Array, half: float, visit: Array) -> Array:
    """What lags its input (N, ...) by a half width; begun anew, in the middle, where a visit begins."""
    out = values.copy()
    for row in np.flatnonzero(np.diff(visit) == 0) + 1:
        out[row] = np.clip(out[row - 1], values[row] - half, values[row] + half)
    return out


def side(values: Array, least: float, visit: Array, start: Array) -> Array:
    """On which side of a gap (N,) a part lies: -1 or 1; it stays where it is while the load is under `least`."""
    out = np.where(np.abs(values) > least, np.sign(values), start)
    for row in np.flatnonzero((np.diff(visit) == 0) & (np.abs(values[1:]) <= least)) + 1:
        out[row] = out[row - 1]
    return out


def gap(half: float, least: float, one: Trial, rng: Rng) -> Law:
    """Free play of +-half, which friction holds while the load is under `least`; a visit begins on either side, by chance."""
    start = rng.choice([-1.0, 1.0], int(one.visit.max()) + 1)[one.visit]
    return lambda load: half * side(load, least, one.visit, start)


def sliders(share: float, width: float, one: Trial) -> Law:
    """A share of the spring behind Coulomb friction: three sliders in series."""
    return lambda torque: share * sum(play(torque, width * part, one.visit) for part in (0.2, 0.5, 1.0)) / 3


def late(share: float, constant: float, one: Trial) -> Law:
    """What comes of each step of the load with a time constant [s]; loads stand 20 s before they are read."""
    since = one.time[:, None] - one.time + 20
    here = (one.visit[:, None] == one.visit) & (since > 0)
    come = share * np.where(here, 1 - np.exp(-np.maximum(since, 0) / constant), 0)
    return lambda load: come @ np.where(one.begins, 0, np.diff(load, prepend=0))


def flank(share: float, bears: float) -> Law:
    return lambda torque: share * bears * np.tanh(torque / bears)


def unlike_senses(share: float) -> Law:
    """The spring is the mean of both senses; they differ by the share."""
    return lambda torque: share / 2 * np.abs(torque)


def beyond(soft: float, held: float) -> Law:
    return lambda load: soft * np.maximum(load - held, 0)


def about(u: Array, law: Law) -> Law:
    """A law of the moment about one axis alone: moments -> turns (N, 3)."""
    return lambda moment: np.outer(law(moment @ u), u)


def times(factor: Array | float) -> Law:
    return lambda values: factor * values


def against_ball(curvature: float, senses: Array) -> Law:
    return lambda moved: moved + senses * curvature / 2 * ((moved**2).sum(1, keepdims=True) - moved**2)


def beam(along: Array, length: float, soft: float, twist: float) -> Seat:
    """Slender beam clamped at one end, seen at the other: soft = length / EI [rad/(N m)], twist = length / GJ."""
    across = np.eye(3) - np.outer(along, along)

    def law(force: Array, moment: Array) -> tuple[Array, Array]:
        f, m = force @ across, moment @ across
        shift = soft * (length**2 / 3 * f + length / 2 * np.cross(m, along))
        return shift, soft * (m + length / 2 * np.cross(along, f)) + twist * np.outer(moment @ along, along)
    return law


def geared(joint: int, law: Law, stiffness: Array | None = None) -> Hidden:
    """A law of one joint's torque (N,): turn beyond its spring's, or where a stiffness is given a share of the spring's."""
    unit = 1.0 if stiffness is None else stiffness[joint]
    return Hidden(gear=lambda torque: np.outer(law(torque[:, joint]) / unit, np.eye(6)[joint]), told={"joint": joint + 1})


def tipping(frame: int, law: Law, **told: object) -> Hidden:
    """A link tips about its frame's origin: moment -> turn (N, 3)."""
    return Hidden(seats=((frame, np.zeros(3), lambda force, moment: (0 * force, law(moment))),), told=dict(told))


def sliding(frame: int, where: Array, soft: Array) -> Hidden:
    return Hidden(seats=((frame, where, lambda force, moment: (soft * force, 0 * force)),))


def loaded(one: Trial, factor: Array) -> Hidden:
    """The true forces, as factors (N, 1) of those that are written down."""
    return Hidden(force=lambda _: one.force * factor)


def shown(change: Law, **told: object) -> Hidden:
    """Other angles (N, 6) in the table than the robot had."""
    return Hidden(table=lambda table: table | {"shown": change(table["shown"])}, told=dict(told))


def tooth_ripple(rng: Rng, one: Trial, size: float) -> Hidden:
    """An eccentric wheel: the compliance swings by a share with the joint's angle, once to three times a turn."""
    joint, often, phase = drawn_joint(rng, one), int(rng.integers(1, 4)), rng.uniform(0, 6.28)
    return geared(joint, times(size * np.cos(often * one.shown[:, joint] + phase)), one.stiffness)


def wrist_cross(rng: Rng, one: Trial, size: float) -> Hidden:
    """Bevel gears of the wrist: the torque of axis 6 winds axis 5 too, and the other way round."""
    cross = np.zeros((6, 6))
    cross[4, 5] = cross[5, 4] = size / np.sqrt(one.stiffness[4] * one.stiffness[5])
    return Hidden(gear=lambda torque: torque @ cross)


def gears_warm_up(rng: Rng, one: Trial, size: float) -> Hidden:
    """All gears get softer by a share from the first to the last row: grease and bearings get warm."""
    warm = size * (1 - np.exp(-2 * one.time / one.time.max()))[:, None]
    return Hidden(gear=lambda torque: warm * torque / one.stiffness)


def force_turned(rng: Rng, one: Trial, size: float) -> Hidden:
    """The rig stands turned by `size` [rad] against the base's axes."""
    turn = turning(size * direction(rng)[None])[0]
    return Hidden(force=lambda _: one.force @ turn.T)


def bracket_turned(rng: Rng, one: Trial, size: float) -> Hidden:
    turn = turning(size * direction(rng)[None])[0]
    return Hidden(reading=lambda moved: moved @ turn)


def stand_drifts(rng: Rng, one: Trial, size: float) -> Hidden:
    """The sun on the stand: it bends steadily [m/s] from each zero reading on."""
    bent = size * np.outer(one.time - one.time[one.first], direction(rng))
    return Hidden(reading=lambda moved: moved + bent)


def weight_swings(rng: Rng, one: Trial, size: float) -> Hidden:
    """The weight was read while it swung: a share of it sideways, by chance in each row."""
    return Hidden(force=lambda noise: one.force + noise.normal(size=(len(one.force), 2)) @ np.eye(2, 3) * size * one.amount)


def gauge_kicked(rng: Rng, one: Trial, size: float) -> Hidden:
    """Somebody touched one gauge: from one row of a visit on to its end it reads `size` [m] more."""
    axis, visit, share = int(rng.integers(3)), int(rng.integers(one.visit.max() + 1)), rng.uniform(0.3, 0.8)
    rows = np.flatnonzero(one.visit == visit)
    hit = rows[max(1, int(share * len(rows))):]
    step = size * np.outer(np.isin(np.arange(len(one.visit)), hit), np.eye(3)[axis])
    return Hidden(reading=lambda moved: moved + step, told={"row": int(hit[0]) + 1, "pose": f"P{visit + 1}"})


def read_too_early(rng: Rng, one: Trial, size: float) -> Hidden:
    """A slow display: each reading keeps a share of the one before."""
    before = np.where(one.begins, np.arange(len(one.visit)), np.arange(len(one.visit)) - 1)
    return Hidden(reading=lambda moved: (1 - size) * moved + size * moved[before])


def angle_mistyped(rng: Rng, one: Trial, size: float) -> Hidden:
    """One angle of one pose was written down wrong by `size` [rad]."""
    joint, visit = int(rng.integers(1, 5)), int(rng.integers(one.visit.max() + 1))
    return shown(lambda q: q + size * np.outer(one.visit == visit, np.eye(6)[joint]), joint=joint + 1, pose=f"P{visit + 1}")


def mastering_off(rng: Rng, one: Trial, size: float) -> Hidden:
    """One axis was mastered wrong by `size` [rad]: it truly stands elsewhere than the pendant shows."""
    joint = drawn_joint(rng, one, (1, 2, 3, 4, 5))
    return Hidden(angles=one.shown + size * np.eye(6)[joint], told={"joint": joint + 1})


def angle_sign(rng: Rng, one: Trial, size: float) -> Hidden:
    """One wrist angle of all poses has the other sign."""
    joint = int(rng.choice([3, 4]))
    return shown(times(1 - 2 * np.eye(6)[joint]), joint=joint + 1)


def table_turned(rng: Rng, one: Trial, size: float) -> Hidden:
    """Forces and deflections are in a frame of the hall, turned by `size` [rad] about the plumb line against the base."""
    turn = turning(np.array([[0, 0, size]]))[0]
    return Hidden(table=lambda table: table | {"force": table["force"] @ turn, "moved": table["moved"] @ turn})


def bearing_tilts(rng: Rng, one: Trial, size: float) -> Hidden:
    """A main bearing gives way across its axis."""
    joint = drawn_joint(rng, one, (1, 2, 3, 4))
    return tipping(joint + 1, times(size * np.array([1, 1, 0])), joint=joint + 1)


CAUSES: tuple[Cause, ...] = (
    # Teeth free in a gap of +-size [rad]; seals hold them where they are under 3 N m.
    Cause("backlash", "gear", 3e-5, lambda rng, one, size: geared(drawn_joint(rng, one), gap(size, 3.0, one, rng)), CYCLIC),
    Cause("friction_loop", "gear", 0.2, lambda rng, one, size: geared(
        drawn_joint(rng, one), sliders(size, rng.uniform(0.1, 0.3) * one.force.max(), one), one.stiffness), CYCLIC),
    # A wave gear's flank: softer by a share until the teeth bear, at some torque.
    Cause("soft_at_zero", "gear", 0.5, lambda rng, one, size: geared(
        drawn_joint(rng, one), flank(size, rng.uniform(0.1, 0.3) * np.abs(one.force).max()), one.stiffness)),
    # A worn flank: softer by a share in one sense of the torque.
    Cause("one_sided", "gear", 0.2, lambda rng, one, size: geared(
        drawn_joint(rng, one, (0, 3, 4, 5)), unlike_senses(size * float(rng.choice([-1, 1]))), one.stiffness)),
    Cause("tooth_ripple", "gear", 0.2, tooth_ripple),
    # A share of the spring comes late, with a time constant of one to three minutes.
    Cause("creep", "gear", 0.15, lambda rng, one, size: geared(
        drawn_joint(rng, one), late(size, rng.uniform(60, 180), one), one.stiffness), CYCLIC),
    Cause("wrist_cross", "gear", 0.3, wrist_cross),
    Cause("gears_warm_up", "time", 0.1, gears_warm_up),
    # A floor that gives way under the base's edge, about one level axis more than about the other [rad/(N m)].
    Cause("base_rocking", "base", 1e-8, lambda rng, one, size: tipping(0, times(size * np.array([1, rng.uniform(0.4, 1), 0])))),
    # A base plate on its grout: it slides elastically [m/N].
    Cause("base_shift", "base", 2e-8, lambda rng, one, size: sliding(
        0, np.zeros(3), size * np.array([1, rng.uniform(0.5, 1), 0.1]))),
    # One anchor is loose: the plate tilts about one axis, to one side, beyond what its preload holds.
    Cause("loose_bolt", "base", 3e-8, lambda rng, one, size: tipping(
        0, about(level(rng), beyond(size, 0.25 * np.abs(one.force).max()))), WITH_FORCES),
    Cause("lower_arm_bends", "link", 5e-8, lambda rng, one, size: Hidden(seats=(
        (2, np.array([one.arm.a[2], 0, 0]), beam(np.array([1.0, 0, 0]), float(one.arm.a[2]), size, size)),))),
    Cause("forearm_bends", "link", 1e-7, lambda rng, one, size: Hidden(seats=(
        (3, np.array([one.arm.a[3], one.arm.d[3], 0]), beam(np.array([0, 1.0, 0]), float(one.arm.d[3]), size, 0.5 * size)),))),
    Cause("bearing_tilts", "link", 1e-7, bearing_tilts),
    # The spindle's bracket at the flange: a plate that tilts about its two axes, unlike.
    Cause("adapter_tilts", "tool", 2e-7, lambda rng, one, size: tipping(
        6, times(size * np.array([1, rng.uniform(0.2, 1), 0.2])))),
    # Spindle bearings and shank: the TCP gives way sideways, not along the tool.
    Cause("shank_bends", "tool", 2e-8, lambda rng, one, size: sliding(6, one.arm.tool, size * np.array([1, 1, 0.1]))),
    # The spindle sits loose in its clamp: it tips about an axis of the flange by +-size [rad], held under 8 N m.
    Cause("clamp_plays", "tool", 5e-5, lambda rng, one, size: tipping(
        6, about(level(rng), gap(size, 8.0, one, rng))), BOTH_WAYS),
    Cause("force_turned", "load", 0.03, force_turned, WITH_FORCES),
    # The load cell was not set to zero: every load is `size` [N] less than it shows, along its line.
    Cause("load_cell_zero", "load", 10.0, lambda rng, one, size: loaded(one, 1 - size / np.maximum(one.amount, 1e-3)),
          WITH_FORCES),
    # The sheave takes its share of the pull while the weight sinks, and adds it while it is lifted.
    Cause("pulley_rubs", "load", 0.03, lambda rng, one, size: loaded(
        one, 1 - size * np.sign(np.diff(one.amount, axis=0, prepend=0))), ("cable",)),
    # The load acts beside the TCP by `size` [m]; what is looked at is the TCP.
    Cause("hook_off", "load", 0.01, lambda rng, one, size: Hidden(hook=size * direction(rng))),
    # The heaviest stack weighs more than is written on it.
    Cause("wrong_weight", "load", 0.1, lambda rng, one, size: loaded(
        one, np.where(one.amount > 0.9 * one.amount.max(), 1 + size, 1)), ("dead weights",)),
    Cause("weight_swings", "load", 0.02, weight_swings, ("dead weights",)),
    Cause("bracket_turned", "instrument", 0.03, bracket_turned),
    # One sensor shows a share more than there is.
    Cause("gauge_gain", "instrument", 0.03, lambda rng, one, size: Hidden(
        reading=times(1 + size * np.eye(3)[rng.integers(3)]))),
    # Plungers that stick: each reading stays behind by `size` [m].
    Cause("gauge_sticks", "instrument", 4e-6, lambda rng, one, size: Hidden(
        reading=lambda moved: play(moved, size, one.visit)), CYCLIC),
    # Gauges against a ball of the curvature `size` [1/m]: what moves sideways reads as away from the gauge.
    Cause("round_target", "instrument", 100.0, lambda rng, one, size: Hidden(
        reading=against_ball(size, rng.choice([-1.0, 1.0], 3)))),
    # What is looked at is beside the TCP by `size` [m]; the load acts at the TCP.
    Cause("reflector_off", "instrument", 0.01, lambda rng, one, size: Hidden(target=size * direction(rng))),
    Cause("stand_drifts", "instrument", 2e-8, stand_drifts),
    Cause("gauge_kicked", "instrument", 2e-5, gauge_kicked),
    Cause("read_too_early", "instrument", 0.1, read_too_early, CYCLIC),
    Cause("angle_mistyped", "people", 0.05, angle_mistyped),
    Cause("mastering_off", "people", 0.02, mastering_off),
    # Load and reflector are where they should be, but cell.yaml has the TCP wrong by `size` [m].
    Cause("tool_mismeasured", "people", 0.02, lambda rng, one, size: Hidden(tool=one.arm.tool + size * direction(rng))),
    Cause("angle_sign", "people", 1.0, angle_sign, fixed=True),
    Cause("table_turned", "people", 0.1, table_turned, WITH_FORCES))

"""What the motion judge hides: each cause changes the drive that is simulated, or what is written down of it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from benchmarks.motion_drive import Axis, Friction


@dataclass(frozen=True)
class Reading:
    """How the channels of one joint tell what happened. Times in s, angles in rad, torques in Nm."""

    link_late: float = 0.0
    motor_late: float = 0.0
    torque_late: float = 0.0
    torque_lag: float = 0.0                                             # time constant of a first-order filter
    inertia: float = 0.0                                                # share of the motor's inertia left in the torque
    ratio: float = 0.0                                                  # relative error of the gear ratio in the motor's angle
    torque_gain: float = 0.0
    torque_zero: float = 0.0
    eccentric: tuple[float, float] = (0.0, 0.0)                         # amplitude, phase, once a turn of the joint
    zero: float = 0.0
    walk: tuple[float, float] = (0.0, 1.0)                              # the link's zero: size, time constant (share)
    slip: tuple[float, float] = (0.0, 0.5)                              # the link's zero jumps: size, when (share)
    saturation: tuple[float, float] = (0.0, 1.0)                        # torque told too high by this share at this torque
    side: float = 0.0                                                   # torque gain of one sign
    ripple: tuple[float, float] = (0.0, 1.0)                            # of the torque: amplitude, cycles a turn of the joint
    cross: float = 0.0                                                  # rad/Nm of another joint's torque in this link's angle
    lost: tuple[int, float] = (0, 0.5)                                  # the link's logger drops samples: how many, when


Change = Callable[[Axis, float, float, np.random.Generator], tuple[Axis, Reading]]      # axis, size, largest torque


@dataclass(frozen=True)
class Cause:
    """`size` is a plausible one, `most` the largest one; `fixed` where it cannot be scaled to be as visible as wanted."""

    kind: str
    size: float
    most: float
    make: Change
    drive: bool = False                                                 # the motion itself changes
    fixed: bool = False
    records: int = 1
    axes: int = 1
    everywhere: float = 0.0                                             # how often it is in all joints alike


def read(**fields: Callable[[float, float], object]) -> Change:
    """A cause of the record alone; each field of Reading by size and largest torque."""
    return lambda axis, size, peak, rng: (axis, Reading(**{name: law(size, peak) for name, law in fields.items()}))    # type: ignore[arg-type]


def friction(stiction: float) -> Change:
    def make(axis: Axis, size: float, peak: float, rng: np.random.Generator) -> tuple[Axis, Reading]:
        rubs = Friction(size * peak, size * peak * rng.uniform(0, 1), stiction, float(rng.uniform(0.01, 0.05)))
        return replace(axis, motor_friction=rubs), Reading()
    return make


def soft(axis: Axis, size: float, peak: float, rng: np.random.Generator) -> tuple[Axis, Reading]:
    return axis.with_gear(soft=(size, rng.uniform(0.1, 0.5) * peak / axis.gear.stiffness)), Reading()


def stages(axis: Axis, size: float, peak: float, rng: np.random.Generator) -> tuple[Axis, Reading]:
    first = float(rng.uniform(0.1, 0.25))
    return axis.with_gear(stages=((1 - size, first * peak), (1 - size / 2, 3 * first * peak))), Reading()


def slips(axis: Axis, size: float, peak: float, rng: np.random.Generator) -> tuple[Axis, Reading]:
    shares = rng.dirichlet(np.full(4, 2.0))
    angles = peak / axis.gear.stiffness * np.array([0.05, 0.1, 0.2, 0.35]) * rng.uniform(0.7, 1.4)
    elements = tuple((size * s * peak / a, size * s * peak) for s, a in zip(shares, angles, strict=True))
    return axis.with_gear(slips=elements), Reading()


def bouc_wen(axis: Axis, size: float, peak: float, rng: np.random.Generator) -> tuple[Axis, Reading]:
    return axis.with_gear(bouc_wen=(size, rng.uniform(0.15, 0.4) * peak / axis.gear.stiffness)), Reading()


def ripple(cycles: Callable[[float, np.random.Generator], float]) -> Change:
    def make(axis: Axis, size: float, peak: float, rng: np.random.Generator) -> tuple[Axis, Reading]:
        return axis.with_gear(ripples=((size, cycles(axis.ratio, rng), float(rng.uniform(0, 6.28))),)), Reading()
    return make


def eccentric(axis: Axis, size: float, peak: float, rng: np.random.Generator) -> tuple[Axis, Reading]:
    return axis, Reading(eccentric=(size, float(rng.uniform(0, 6.28))))


def dragging(axis: Axis, size: float, peak: float, rng: np.random.Generator) -> tuple[Axis, Reading]:
    return replace(axis, load_friction=Friction(size * peak, size * peak * rng.uniform(0, 1))), Reading()


def torque_ripple(axis: Axis, size: float, peak: float, rng: np.random.Generator) -> tuple[Axis, Reading]:
    return axis, Reading(ripple=(size * peak, axis.ratio * int(rng.choice([3, 4, 5, 6]))))


def crossed(axis: Axis, size: float, peak: float, rng: np.random.Generator) -> tuple[Axis, Reading]:
    return axis, Reading(cross=size / axis.gear.stiffness)


def warming(axis: Axis, size: float, peak: float, rng: np.random.Generator) -> tuple[Axis, Reading]:
    return axis.with_gear(warming=size), Reading()


def lost(axis: Axis, size: float, peak: float, rng: np.random.Generator) -> tuple[Axis, Reading]:
    return axis, Reading(lost=(max(1, round(size)), float(rng.uniform(0.25, 0.7))))


def gone_at(axis: Axis, size: float, peak: float, rng: np.random.Generator) -> tuple[Axis, Reading]:
    return axis, Reading(slip=(size, float(rng.uniform(0.25, 0.75))))


CAUSES = (
    Cause("late_link", 1e-3, 8e-3, read(link_late=lambda s, p: s), everywhere=0.5),
    Cause("late_motor", 1e-3, 8e-3, read(motor_late=lambda s, p: s), everywhere=0.5),
    Cause("late_torque", 5e-3, 0.03, read(torque_late=lambda s, p: s), everywhere=0.5),
    Cause("filtered_torque", 5e-3, 0.03, read(torque_lag=lambda s, p: s), everywhere=0.5),
    Cause("friction", 0.05, 0.3, friction(0.0), drive=True),
    Cause("stribeck", 0.05, 0.3, friction(0.4), drive=True),
    Cause("backlash", 3e-5, 3e-4, lambda a, s, p, r: (a.with_gear(half_gap=s), Reading()), drive=True),
    Cause("soft_zone", 0.3, 0.75, soft, drive=True),
    Cause("stages", 0.3, 0.75, stages, drive=True),
    Cause("maxwell_slip", 0.05, 0.25, slips, drive=True),
    Cause("bouc_wen", 0.1, 0.5, bouc_wen, drive=True),
    Cause("motor_inertia", 0.3, 1.0, read(inertia=lambda s, p: s)),
    Cause("ripple_motor_turn", 1e-5, 2e-4, ripple(lambda n, r: n), drive=True),
    Cause("ripple_multiple", 1e-5, 2e-4, ripple(lambda n, r: n * int(r.choice([2, 3, 4]))), drive=True),
    Cause("ripple_odd", 1e-5, 2e-4, ripple(lambda n, r: n * r.uniform(0.3, 0.9)), drive=True),
    Cause("eccentric", 1e-4, 3e-3, eccentric),
    Cause("wrong_ratio", 1e-4, 5e-3, read(ratio=lambda s, p: s)),
    Cause("zero_shift", 3e-5, 5e-4, read(), fixed=True, records=2),
    # What a spring takes in whole: nothing shows, whatever is said of it is said of nothing.
    Cause("load_friction", 0.07, 0.3, dragging, drive=True, fixed=True),
    Cause("torque_gain", 0.1, 0.3, read(torque_gain=lambda s, p: s), fixed=True),
    Cause("torque_zero", 0.03, 0.3, read(torque_zero=lambda s, p: s * p), fixed=True),
    # Of no dictionary that we know.
    Cause("warming", 0.05, 0.3, warming, drive=True),
    Cause("clock_jump", 2, 5, lost, fixed=True),
    Cause("zero_walks", 2e-5, 5e-4, read(walk=lambda s, p: (s, 0.4))),
    Cause("link_slips", 2e-5, 5e-4, gone_at),
    Cause("torque_saturates", 0.05, 0.4, read(saturation=lambda s, p: (s, p))),
    Cause("torque_side", 0.05, 0.4, read(side=lambda s, p: s)),
    Cause("torque_ripple", 0.01, 0.1, torque_ripple),
    Cause("crosstalk", 0.1, 0.7, crossed, axes=2))
BY_KIND = {cause.kind: cause for cause in CAUSES}
PAIRS = (("late_link", "friction"), ("backlash", "ripple_motor_turn"), ("motor_inertia", "friction"),
         ("maxwell_slip", "late_torque"), ("stages", "ripple_multiple"), ("friction", "ripple_odd"), ("late_link", "backlash"),
         ("motor_inertia", "late_torque"))

"""One axis of the motion judge's robots: motor, gear and load as two masses, integrated in time under a servo loop.

All on the gear's output side: motor inertia times ratio squared, motor torque times ratio. The gear is a spring with a damper,
and whatever `Gear` has besides; friction has a presliding spring, so that a motor at rest really rests.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from math import copysign, cos, exp, sin, tanh
from typing import Any

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Friction:
    """Coulomb [Nm], viscous [Nm s/rad], how much more before it slides (a share) below `stribeck` [rad/s]."""

    coulomb: float = 0.0
    viscous: float = 0.0
    stiction: float = 0.0
    stribeck: float = 0.01
    presliding: float = 5e-5            # rad until it slides


@dataclass(frozen=True)
class Gear:
    """What is between motor and load. Angles in rad, torques in Nm."""

    stiffness: float
    damping: float
    half_gap: float = 0.0
    soft: tuple[float, float] = (0.0, 1.0)                              # share missing at zero, width [rad]
    stages: tuple[tuple[float, float], ...] = ()                        # a catalogue's K1, K2: share of K3, up to where [Nm]
    slips: tuple[tuple[float, float], ...] = ()                         # Maxwell-slip: stiffness, torque when it slides
    bouc_wen: tuple[float, float] | None = None                         # share of the stiffness that yields, yield angle
    ripples: tuple[tuple[float, float, float], ...] = ()                # amplitude [rad], cycles a turn of the joint, phase
    warming: float = 0.0                                                # share of the stiffness lost at the end of the record


@dataclass(frozen=True)
class Axis:
    """An axis and its servo."""

    number: int
    ratio: float
    motor_inertia: float
    load_inertia: float
    gravity: float                                                      # Nm with the load level
    level: float                                                        # rad, where the axis begins
    torque_limit: float
    gear: Gear
    motor_friction: Friction = field(default_factory=Friction)
    load_friction: Friction = field(default_factory=Friction)
    bandwidth: float = 20.0                                             # rad/s of the position loop

    @property
    def resonance(self) -> float:
        """With the motor free [rad/s]."""
        return float(np.sqrt(self.gear.stiffness * (1 / self.motor_inertia + 1 / self.load_inertia)))

    def with_gear(self, **changes: Any) -> Axis:
        return replace(self, gear=replace(self.gear, **changes))


@dataclass(frozen=True)
class Motion:
    """What really happened, on the fine grid: angles [rad], torques [Nm], each (fine,)."""

    step: float
    motor: Array
    load: Array
    gear_torque: Array
    friction: Array
    acceleration: Array
    speed: Array


def spring(gear: Gear) -> list[float]:
    """Corner angles of a catalogue's stiffness stages, (2 a stage)."""
    corners, torque, angle = [], 0.0, 0.0
    for share, upto in gear.stages:
        angle += (upto - torque) / (share * gear.stiffness)
        torque = upto
        corners += [angle, torque]
    return corners


def run(axis: Axis, reference: Array, step: float, disturbance: Array) -> Motion:      # one loop, for speed
    """By the semi-implicit Euler rule; `reference` [rad] and `disturbance` (of other axes, on the load) [Nm], (fine,)."""
    gear, k, c = axis.gear, axis.gear.stiffness, axis.gear.damping
    velocity = np.gradient(reference, step)
    total = axis.motor_inertia + axis.load_inertia
    forward = np.gradient(velocity, step) * total + axis.gravity * np.cos(reference + axis.level)
    kp, kd, ki = total * axis.bandwidth**2, total * 2 * axis.bandwidth, total * axis.bandwidth**3 / 8
    corners, slips = spring(gear), [0.0] * len(gear.slips)
    z, soft, width = 0.0, *gear.soft
    fm, fl = axis.motor_friction, axis.load_friction
    pm = pl = 0.0
    qm = ql = float(reference[0])
    g0 = axis.gravity * cos(ql + axis.level)
    ql = qm - g0 / k + (-copysign(gear.half_gap, g0) if gear.half_gap else 0.0)        # it begins at rest
    vm = vl = whole = 0.0
    count = len(reference)
    out = np.empty((6, count))
    rows = [out[i] for i in range(6)]
    ref, vref, ff, dist = reference.tolist(), velocity.tolist(), forward.tolist(), disturbance.tolist()
    last = qm - ql
    span = count * step
    for i in range(count):
        d = qm - ql
        for amplitude, cycles, phase in gear.ripples:
            d += amplitude * sin(cycles * qm + phase)
        ddot = vm - vl
        if gear.half_gap:
            d = d - copysign(min(abs(d), gear.half_gap), d)
            if d == 0.0:
                ddot = 0.0
        kk = k * (1 - gear.warming * i * step / span) if gear.warming else k
        if corners:
            size, torque, at, base = abs(d), 0.0, 0.0, 0.0
            for j, (share, _) in enumerate(gear.stages):
                if size <= corners[2 * j]:
                    torque = base + share * kk * (size - at)
                    break
                at, base = corners[2 * j], corners[2 * j + 1]
            else:
                torque = base + kk * (size - at)
            torque = copysign(torque, d)
        elif gear.bouc_wen is not None:
            yielding, yield_angle = gear.bouc_wen
            delta = d - last
            z += delta * (1 - abs(z / yield_angle) * (0.6 * copysign(1.0, delta * z) + 0.4))
            torque = kk * ((1 - yielding) * d + yielding * z)
        else:
            torque = kk * (d - (soft * width * tanh(d / width) if soft else 0.0))
        for j, (ks, ws) in enumerate(gear.slips):
            slips[j] = max(-ws, min(ws, slips[j] + ks * (d - last)))
            torque += slips[j]
        last = d
        torque += c * ddot
        friction = 0.0
        if fm.coulomb or fm.viscous:
            limit = fm.coulomb * (1 + fm.stiction * exp(-((vm / fm.stribeck) ** 2)))
            pm = max(-1.0, min(1.0, pm + vm * step / fm.presliding))
            friction = limit * pm + fm.viscous * vm
        dragging = 0.0
        if fl.coulomb or fl.viscous:
            pl = max(-1.0, min(1.0, pl + vl * step / fl.presliding))
            dragging = fl.coulomb * pl + fl.viscous * vl
        error = ref[i] - qm
        whole += error * step
        drive = ff[i] + kp * error + kd * (vref[i] - vm) + ki * whole
        drive = max(-axis.torque_limit, min(axis.torque_limit, drive))
        am = (drive - torque - friction) / axis.motor_inertia
        al = (torque - axis.gravity * cos(ql + axis.level) - dragging - dist[i]) / axis.load_inertia
        rows[0][i], rows[1][i], rows[2][i], rows[3][i], rows[4][i], rows[5][i] = qm, ql, torque, friction, am, vm
        vm += am * step
        vl += al * step
        qm += vm * step
        ql += vl * step
    return Motion(step, *rows)

"""Laws of gears for fourth_world: hysteresis, friction, play and slow parts, as literature and catalogues write them.

Used by: python benchmarks/fourth_world.py CASES SEED FOLDER
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from fourth_arm import Array, GearLaw


@dataclass
class Formula(GearLaw):
    """A law without memory: twist by torque, stiffness, the robot's angles and the seconds under load."""

    law: Callable[[float, float, Array, float], float]

    def twist(self, torque: float, k: float, q: Array, seconds: float) -> float:
        return self.law(torque, k, q, seconds)


@dataclass
class BoucWen(GearLaw):
    """Spring with a hysteretic part by Bouc and Wen: dz = (1 - |z|^n (b sign(dt z) + 1 - b)) dt / t0."""

    amount: float  # rad
    width: float  # N m
    z: float = 0.0
    at: float = 0.0
    memory = True

    def step(self, torque: float) -> float:
        z, n = self.z, 24
        change = (torque - self.at) / self.width / n
        for _ in range(n):
            z += (1 - abs(z) ** 1.5 * (0.6 * np.sign(change * z) + 0.4)) * change
        return float(z)

    def twist(self, torque: float, k: float, q: Array, seconds: float) -> float:
        return torque / k + self.amount * self.step(torque)

    def arrive(self, torque: float, k: float, sign: float) -> None:
        self.z, self.at = 0.5 * sign, torque

    def commit(self, torque: float, k: float, seconds: float) -> None:
        self.z, self.at = self.step(torque), torque


@dataclass
class Iwan(GearLaw):
    """Friction beside the gear: Jenkins elements in parallel with the spring (Iwan), slipping one after the other."""

    friction: float  # N m, all elements together
    stiff: float = 4.0  # elements' stiffness over the gear's
    slips: Array = field(default_factory=lambda: np.zeros(8))
    memory = True

    def held(self, delta: float, k: float) -> Array:
        limits = np.linspace(0.3, 1.7, 8) * self.friction / 8
        return np.asarray(np.clip(self.stiff * k / 8 * (delta - self.slips), -limits, limits))

    def twist(self, torque: float, k: float, q: Array, seconds: float) -> float:
        low, high = (torque - 2 * self.friction) / k, (torque + 2 * self.friction) / k
        for _ in range(45):
            delta = 0.5 * (low + high)
            if k * delta + float(self.held(delta, k).sum()) > torque:
                high = delta
            else:
                low = delta
        return 0.5 * (low + high)

    def arrive(self, torque: float, k: float, sign: float) -> None:
        delta = (torque - 0.5 * sign * self.friction) / k
        limits = np.linspace(0.3, 1.7, 8) * self.friction / 8
        self.slips = delta - 0.5 * sign * limits / (self.stiff * k / 8)

    def commit(self, torque: float, k: float, seconds: float) -> None:
        delta = self.twist(torque, k, np.zeros(6), 0.0)
        self.slips = delta - self.held(delta, k) / (self.stiff * k / 8)


@dataclass
class Play(GearLaw):
    """Clearance that oil and friction hold where it was left: the play operator in series with the spring."""

    gap: float  # rad, half
    hold: float  # N m
    side: float = 0.0
    memory = True

    def next(self, torque: float) -> float:
        return float(np.clip(self.side, torque / self.hold - 1, torque / self.hold + 1).clip(-1, 1))

    def twist(self, torque: float, k: float, q: Array, seconds: float) -> float:
        return torque / k + self.gap * self.next(torque)

    def arrive(self, torque: float, k: float, sign: float) -> None:
        self.side = sign
        self.side = self.next(torque)

    def commit(self, torque: float, k: float, seconds: float) -> None:
        self.side = self.next(torque)


@dataclass
class Slow(GearLaw):
    """A part of the twist that comes by and by (standard linear solid), or that a controller takes back by and by."""

    share: float
    tau: float  # s
    taken_back: bool = False
    slow: float = 0.0
    memory = True

    def after(self, torque: float, k: float, seconds: float) -> float:
        end = self.share * torque / k
        return float(end + (self.slow - end) * np.exp(-seconds / self.tau))

    def twist(self, torque: float, k: float, q: Array, seconds: float) -> float:
        slow = self.after(torque, k, seconds)
        return torque / k + (self.share * torque / k - slow if self.taken_back else slow)

    def arrive(self, torque: float, k: float, sign: float) -> None:
        self.slow = self.share * torque / k

    def commit(self, torque: float, k: float, seconds: float) -> None:
        self.slow = self.after(torque, k, seconds)

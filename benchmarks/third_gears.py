"""What gears of the third judge (third_world.py) do beside a spring: each law adds to the angle of a joint.

A law of memory begins anew at each visit of a pose. The torques [N m] of the load and of the arm's weight come apart; the
angle [rad] is that of the whole joint, one step of the search before.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Rng = np.random.Generator
# A load stands so long when it is read [s].
STANDS_S = 15.0


class Law:
    """A gear that does nothing beside its spring."""

    def begin(self, angle: float, compliance: float, visit: int, rng: Rng) -> None:
        """A visit, counted from 0, at which the joint stands at `angle` [rad]; compliance [rad/(N m)]."""
        self.angle, self.compliance, self.visit = angle, compliance, visit

    def value(self, load: float, weight: float, time: float, turned: float) -> float:
        """What the law adds [rad]."""
        return 0.0

    def keep(self, load: float, weight: float, time: float, turned: float) -> None:
        """What is remembered of a row once it is solved."""


class Play(Law):
    """Backlash of +-half [rad] that friction holds up to `held` [N m]; the weight presses it, too."""

    def __init__(self, half: float, held: float) -> None:
        self.half, self.held = half, held

    def begin(self, angle: float, compliance: float, visit: int, rng: Rng) -> None:
        super().begin(angle, compliance, visit, rng)
        self.at: float | None = None

    def value(self, load: float, weight: float, time: float, turned: float) -> float:
        torque = load + weight
        if self.at is None or abs(torque) > self.held:
            return float(self.half * np.tanh(torque / max(self.held, 1.0)))
        return self.at

    def keep(self, load: float, weight: float, time: float, turned: float) -> None:
        self.at = self.value(load, weight, time, turned)


class Stages(Law):
    """Strain wave gear of three stiffnesses: softer below one torque, stiffer above another; pressed: whether by the weight."""

    def __init__(self, soft: float, hard: float, low: float, high: float, pressed: float) -> None:
        self.soft, self.hard, self.low, self.high, self.pressed = soft, hard, low, high, pressed

    def value(self, load: float, weight: float, time: float, turned: float) -> float:
        torque = load + self.pressed * weight
        size, way = abs(torque), np.sign(torque)
        return float(self.compliance * way * (self.soft * min(size, self.low) - self.hard * max(0, size - self.high)))


class Loop(Law):
    """Hysteresis of four play operators up to a torque (Prandtl and Ishlinskii), from any state at the begin of a visit."""

    def __init__(self, share: float, torque: float) -> None:
        self.share, self.widths = share, torque * np.arange(1, 5) / 4

    def begin(self, angle: float, compliance: float, visit: int, rng: Rng) -> None:
        super().begin(angle, compliance, visit, rng)
        self.at: Array = np.zeros(len(self.widths)) + rng.uniform(-1, 1) * self.widths

    def now(self, load: float) -> Array:
        return np.asarray(np.clip(self.at, load - self.widths, load + self.widths))

    def value(self, load: float, weight: float, time: float, turned: float) -> float:
        return float(self.share * self.compliance * self.now(load).mean())

    def keep(self, load: float, weight: float, time: float, turned: float) -> None:
        self.at = self.now(load)


class Friction(Law):
    """Dry friction beside the spring (a balancer's seal, a hose pack): up to `torque` [N m] after `give` [rad]."""

    def __init__(self, torque: float, give: float) -> None:
        self.torque, self.give = torque, give

    def begin(self, angle: float, compliance: float, visit: int, rng: Rng) -> None:
        super().begin(angle, compliance, visit, rng)
        self.held = rng.uniform(-0.5, 0.5) * self.torque
        self.at: float | None = None

    def now(self, turned: float) -> float:
        if self.at is None:
            return self.held
        return float(np.clip(self.held + self.torque / self.give * (turned - self.at), -self.torque, self.torque))

    def value(self, load: float, weight: float, time: float, turned: float) -> float:
        if self.at is None:
            return -self.compliance * self.held
        # Solved in closed form: angle = compliance (torque - friction at that angle).
        steep, free = self.torque / self.give, self.compliance * (load + weight)
        angle = (free - self.compliance * (self.held - steep * self.at)) / (1 + self.compliance * steep)
        friction = self.held + steep * (angle - self.at)
        if abs(friction) > self.torque:
            return -self.compliance * float(np.clip(friction, -self.torque, self.torque))
        return angle - free

    def keep(self, load: float, weight: float, time: float, turned: float) -> None:
        if self.at is not None:
            self.held = self.now(turned)
        self.at = turned


class Creep(Law):
    """Yields on by a share, with a time constant [s]; a negative share is what a servo brings back."""

    def __init__(self, share: float, constant: float) -> None:
        self.share, self.constant = share, constant

    def begin(self, angle: float, compliance: float, visit: int, rng: Rng) -> None:
        super().begin(angle, compliance, visit, rng)
        self.late = 0.0
        self.since: float | None = None

    def value(self, load: float, weight: float, time: float, turned: float) -> float:
        if self.since is None:
            return 0.0
        come = 1 - np.exp(-min(max(time - self.since, 0), STANDS_S) / self.constant)
        return float(self.late + (self.share * self.compliance * load - self.late) * come)

    def keep(self, load: float, weight: float, time: float, turned: float) -> None:
        self.late, self.since = self.value(load, weight, time, turned), time


class Settle(Law):
    """The largest load of a visit so far leaves a share of itself behind; nothing brings it back."""

    def __init__(self, share: float) -> None:
        self.share = share

    def begin(self, angle: float, compliance: float, visit: int, rng: Rng) -> None:
        super().begin(angle, compliance, visit, rng)
        self.most = 0.0

    def value(self, load: float, weight: float, time: float, turned: float) -> float:
        return self.share * self.compliance * (load if abs(load) > abs(self.most) else self.most)

    def keep(self, load: float, weight: float, time: float, turned: float) -> None:
        if abs(load) > abs(self.most):
            self.most = load


class Slip(Law):
    """A brake that slips above a torque, and stays there."""

    def __init__(self, limit: float, share: float) -> None:
        self.limit, self.share = limit, share

    def begin(self, angle: float, compliance: float, visit: int, rng: Rng) -> None:
        super().begin(angle, compliance, visit, rng)
        self.at = 0.0

    def value(self, load: float, weight: float, time: float, turned: float) -> float:
        over = float(np.sign(load) * max(0.0, abs(load) - self.limit) * self.compliance * self.share)
        further = abs(over) > abs(self.at) and over * self.at >= 0
        return over if further or over * self.at < 0 else self.at

    def keep(self, load: float, weight: float, time: float, turned: float) -> None:
        self.at = self.value(load, weight, time, turned)


class ByAngle(Law):
    """Softness that goes with the joint's angle, `waves` times a turn."""

    def __init__(self, share: float, waves: int, phase: float) -> None:
        self.share, self.waves, self.phase = share, waves, phase

    def value(self, load: float, weight: float, time: float, turned: float) -> float:
        return float(self.share * self.compliance * load * np.cos(self.waves * self.angle + self.phase))


class ByVisit(Law):
    """Softer at the visits from `first` to `last` (brakes hold in place of the motors, a damper is touched)."""

    def __init__(self, share: float, first: int, last: int = 999) -> None:
        self.share, self.first, self.last = share, first, last

    def value(self, load: float, weight: float, time: float, turned: float) -> float:
        return self.share * self.compliance * load if self.first <= self.visit <= self.last else 0.0


class Warming(Law):
    """Softer by a share as the arm warms up, with a time constant [s]."""

    def __init__(self, share: float, constant: float) -> None:
        self.share, self.constant = share, constant

    def value(self, load: float, weight: float, time: float, turned: float) -> float:
        return float(self.share * self.compliance * load * (1 - np.exp(-time / self.constant)))


class OneSided(Law):
    """Softer one way."""

    def __init__(self, share: float) -> None:
        self.share = share

    def value(self, load: float, weight: float, time: float, turned: float) -> float:
        return self.share * self.compliance * max(0.0, load)


class Stiffening(Law):
    """Stiffer with the torque, the weight's included: half of the share is reached at `torque`."""

    def __init__(self, share: float, torque: float) -> None:
        self.share, self.torque = share, torque

    def value(self, load: float, weight: float, time: float, turned: float) -> float:
        torque = load + weight
        return -self.share * self.compliance * torque * (torque / self.torque)**2 / (1 + (torque / self.torque)**2)

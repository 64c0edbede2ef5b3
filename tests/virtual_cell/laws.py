"""Spring laws beyond a constant compliance: what a gear or a structure gives more than `C tau`.

A law adds to the give `x` (e,) [rad, m] of the elastic joints from their torques (e,) [N m, N], gravity included. `rest` are
the torques of the unloaded arm in the same pose; it is None while that state itself is being found. Laws with a memory are
told when a pose begins and where each row has settled, and in between are pure functions, as the solver needs.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np


@dataclass(frozen=True)
class Row:
    """One reading: its number from 0, pose number, angles q (6,) [rad], time [s] since the reference, dwell [s], the force
    cell's force and that of the row before in the same pose (3,) [N] (zero at its start)."""

    number: int
    pose: int
    q: np.ndarray
    time: float
    dwell: float
    force: np.ndarray
    before: np.ndarray


class Law:
    """A law without memory; subclasses say what they add."""

    def begin(self) -> None:
        """A pose begins."""

    def add(self, x: np.ndarray, torque: np.ndarray, rest: np.ndarray | None, row: Row) -> None:
        """Adds to x what the law gives under `torque`."""
        raise NotImplementedError

    def settle(self, torque: np.ndarray, row: Row) -> None:
        """A row has come to rest under `torque`."""


def saturating(ratio: float) -> float:
    """A smooth saturation: odd, slope 1 at zero, bound 1, within 11 % of `clip(ratio, -1, 1)`."""
    return ratio / (1 + abs(ratio) ** 6) ** (1 / 6)


def iwan_slip(threshold: float, spread: float = 0.5, elements: int = 8) -> np.ndarray:
    """Slip torques (n,) [N m] of a parallel Iwan model whose initial slope is 1 / threshold, log-evenly spread."""
    relative = np.exp(spread * np.linspace(-1.2, 1.2, elements))
    return threshold * relative * np.mean(1 / relative)


@dataclass
class Backlash(Law):
    """Free play on both sides of the tooth [rad], crossed within a few `friction` [N m] of torque around zero."""

    joint: int
    half_gap: float
    friction: float

    def add(self, x: np.ndarray, torque: np.ndarray, rest: np.ndarray | None, row: Row) -> None:
        x[self.joint] += self.half_gap * np.tanh(torque[self.joint] / self.friction)


@dataclass
class SoftZone(Law):
    """A gear that gives `extra` [rad] more on the way to `threshold` [N m], smoothly."""

    joint: int
    extra: float
    threshold: float

    def add(self, x: np.ndarray, torque: np.ndarray, rest: np.ndarray | None, row: Row) -> None:
        x[self.joint] += self.extra * saturating(torque[self.joint] / self.threshold)


@dataclass
class Stiffening(Law):
    """A gear with `tau = k x (1 + (k x / threshold)^2)`."""

    joint: int
    compliance: float
    threshold: float

    def add(self, x: np.ndarray, torque: np.ndarray, rest: np.ndarray | None, row: Row) -> None:
        ratio = torque[self.joint] / self.threshold
        root = 2 / np.sqrt(3) * np.sinh(np.arcsinh(1.5 * np.sqrt(3) * ratio) / 3)      # u + u^3 = ratio
        x[self.joint] += self.compliance * self.threshold * (root - ratio)


@dataclass
class Hysteresis(Law):
    """An Iwan model: slipping elements of different strength in parallel, driven by the torque since the pose began.

    A positive amplitude is the dictionary's law `+ h q`: the twist runs ahead of the torque (after a positive load it comes
    back past zero), which round a cycle gives work instead of taking it. A negative amplitude is friction beside the spring,
    `tau = k x + tau_f q`: the twist lags, and something of it stays when the load has gone.
    """

    joint: int
    amplitude: float
    slip: np.ndarray
    state: np.ndarray = field(default_factory=lambda: np.zeros(1))
    last: float | None = None

    def begin(self) -> None:
        self.state, self.last = np.zeros(len(self.slip)), None

    def _moved(self, torque: np.ndarray) -> np.ndarray:
        change = 0.0 if self.last is None else torque[self.joint] - self.last
        return np.asarray(np.clip(self.state + change / self.slip, -1, 1))

    def add(self, x: np.ndarray, torque: np.ndarray, rest: np.ndarray | None, row: Row) -> None:
        x[self.joint] += self.amplitude * self._moved(torque).mean()

    def settle(self, torque: np.ndarray, row: Row) -> None:
        self.state, self.last = self._moved(torque), float(torque[self.joint])


@dataclass
class AngleDependent(Law):
    """A gear whose compliance varies with its own angle by the share `amplitude cos(order q + phase)`."""

    joint: int
    drive: int
    compliance: float
    amplitude: float
    order: int
    phase: float

    def add(self, x: np.ndarray, torque: np.ndarray, rest: np.ndarray | None, row: Row) -> None:
        angle = row.q[self.drive] + x[self.joint]
        x[self.joint] += self.compliance * self.amplitude * np.cos(self.order * angle + self.phase) * torque[self.joint]


@dataclass
class Creep(Law):
    """Delayed elasticity of everything that is elastic, by the load's part of the torque: Kelvin elements in series.

    With about one element a decade they follow `ratio log(1 + t / t0)` together to some per cent. without_memory: each
    reading starts from rest; else what crept under earlier loads of the pose recovers only as slowly as it came.
    """

    compliance: np.ndarray
    ratio: float
    time_constant: float
    without_memory: bool = True
    state: np.ndarray | None = None
    clock: float = 0.0
    last: np.ndarray | None = None
    rest: np.ndarray | None = None

    def __post_init__(self) -> None:
        step = 2.6      # of the logarithm of the rate: `log(1 + u)` is the integral of `(1 - exp(-s u)) exp(-s) / s` over s
        shares = np.exp(np.arange(-9.2, 2.6, step))
        self.weight, self.rate = np.exp(-shares) * step, shares / self.time_constant

    def begin(self) -> None:
        self.state = self.last = self.rest = None

    def _crept(self, load: np.ndarray, row: Row) -> np.ndarray:
        """State (elements, e): the torque each element has followed so far [N m]."""
        decay = np.exp(-self.rate * row.dwell)[:, None]
        if self.without_memory or self.state is None or self.last is None:
            return load * (1 - decay)
        pause = np.exp(-self.rate * max(row.time - row.dwell - self.clock, 0.0))[:, None]
        waiting = self.last + (self.state - self.last) * pause
        return load + (waiting - load) * decay

    def add(self, x: np.ndarray, torque: np.ndarray, rest: np.ndarray | None, row: Row) -> None:
        if rest is not None:
            self.rest = rest
            x += self.ratio * (self.compliance @ (self.weight @ self._crept(torque - rest, row)))

    def settle(self, torque: np.ndarray, row: Row) -> None:
        if self.without_memory or self.rest is None:
            return
        load = torque - self.rest
        self.state, self.last, self.clock = self._crept(load, row), load, row.time


@dataclass
class Warming(Law):
    """All gears soften while the cell warms up: compliance times `1 + rise (1 - exp(-t / time_constant))` for the load."""

    compliance: np.ndarray
    rise: float
    time_constant: float

    def add(self, x: np.ndarray, torque: np.ndarray, rest: np.ndarray | None, row: Row) -> None:
        if rest is not None:
            x += self.rise * (1 - np.exp(-row.time / self.time_constant)) * (self.compliance @ (torque - rest))


@dataclass
class Lifting(Law):
    """A floor bolt that holds one way only: the base rocks about (cos, sin)(direction) when the load lifts that side."""

    rock: tuple[int, int]
    compliance: float
    direction: float
    preload: float

    def add(self, x: np.ndarray, torque: np.ndarray, rest: np.ndarray | None, row: Row) -> None:
        if rest is None:
            return
        axis, rock = np.array([np.cos(self.direction), np.sin(self.direction)]), list(self.rock)
        lifting = axis @ (torque - rest)[rock] / self.preload
        x[rock] += self.compliance * self.preload * axis * (np.logaddexp(0, lifting) - np.log(2))

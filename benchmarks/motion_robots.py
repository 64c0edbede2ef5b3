"""The motion judge's robots, the cells they stand in, and the moves they make."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from benchmarks.motion_drive import Array, Axis, Gear
from benchmarks.motion_moves import KINDS, move

# By size: joint stiffness [Nm/rad], inertia of what the joint carries [kg m^2], gravity torque with the arm level [Nm],
# reduction, speed [rad/s], acceleration [rad/s^2].
SIZES: dict[str, tuple[tuple[float, ...], ...]] = {
    "small": ((3e4, 3.5e4, 2e4, 6e3), (3.0, 3.2, 1.0, 0.12), (0, 70, 26, 2), (100, 120, 100, 80), (2.5, 2.5, 3, 4),
              (10, 9, 12, 20)),
    "middle": ((3e5, 4e5, 2.2e5, 5e4), (80, 90, 30, 3), (0, 900, 330, 35), (153, 171, 141, 99), (2, 1.8, 2, 3.2),
               (6, 5, 7, 14)),
    "large": ((2e6, 3e6, 1.5e6, 3.5e5), (600, 720, 240, 12), (0, 6000, 2300, 160), (185, 206, 171, 122), (1.5, 1.4, 1.6, 2.2),
              (4, 3.5, 4, 8)),
    "heavy": ((5e6, 7e6, 3.5e6, 8e5), (2100, 2300, 800, 50), (0, 16000, 6500, 600), (230, 252, 219, 140), (1.1, 1.0, 1.2, 1.8),
              (2.5, 2, 2.5, 5))}
FINE = 4000.0                                                           # Hz, at least


@dataclass(frozen=True)
class Instruments:
    """White noise unless `memory` says over how many seconds it remembers itself."""

    rate: float
    duration: float
    link_std: float                                                     # rad
    link_bits: int
    motor_bits: int                                                     # a turn of the motor
    torque_std: float                                                   # share of the largest torque
    memory: float


@dataclass(frozen=True)
class Task:
    """One record's commands: fine grid, angle of each axis and what the others do to it."""

    step: float
    every: int
    references: tuple[Array, ...]
    disturbances: tuple[Array, ...]
    kinds: tuple[str, ...]


@dataclass(frozen=True)
class Robot:
    size: str
    axes: tuple[Axis, ...]
    speeds: tuple[float, ...]
    accelerations: tuple[float, ...]
    prior: tuple[float, ...]


def robot(rng: np.random.Generator) -> Robot:
    """A size drawn evenly, one to three of its axes, everything within a third of the table."""
    size = str(rng.choice(list(SIZES)))
    stiffness, inertia, gravity, ratio, speed, acceleration = SIZES[size]
    chosen = np.sort(rng.choice(4, int(rng.choice([1, 2, 3], p=[0.5, 0.4, 0.1])), replace=False))
    axes = []
    for i in chosen:
        k, load = stiffness[i] * np.exp(rng.normal(0, 0.3)), inertia[i] * np.exp(rng.normal(0, 0.2))
        motor = load * rng.uniform(0.3, 1.2)
        reduced = motor * load / (motor + load)
        weight = gravity[i] * rng.uniform(0.7, 1.2)
        resonance = np.sqrt(k / reduced)
        axes.append(Axis(int(i) + 1, float(np.round(ratio[i] * rng.uniform(0.9, 1.1), 2)), motor, load, weight,
                         float(rng.uniform(-0.6, 0.6)), 3 * weight + 2 * (motor + load) * acceleration[i],
                         Gear(k, 2 * rng.uniform(0.002, 0.01) * np.sqrt(k * reduced)),
                         bandwidth=float(np.clip(resonance * rng.uniform(0.1, 0.2), 6, 40))))
    prior = [*stiffness, stiffness[3] * 0.7, stiffness[3] * 0.3]
    return Robot(size, tuple(axes), tuple(speed[i] for i in chosen), tuple(acceleration[i] for i in chosen), tuple(prior))


def instruments(rng: np.random.Generator, size: str) -> Instruments:
    return Instruments(rate=float(rng.choice([100, 125, 250, 500, 1000])),
                       duration=float(np.round(np.exp(rng.uniform(np.log(6), np.log(40))))),
                       link_std=float(rng.choice([0.4e-6, 1e-6, 3e-6, 8e-6])) * (3 if size == "small" else 1),
                       link_bits=int(rng.choice([20, 22, 24, 26])), motor_bits=int(rng.choice([13, 17, 20])),
                       torque_std=float(rng.choice([0.001, 0.003, 0.01])), memory=float(rng.choice([0, 0, 0.02])))


def task(rng: np.random.Generator, one: Robot, tools: Instruments) -> Task:
    """Axes move together, or (a quarter) one after the other; what the others accelerate is felt."""
    every = int(np.ceil(FINE / tools.rate))
    step = 1 / tools.rate / every
    count = int(tools.duration * tools.rate) * every
    turns = len(one.axes) > 1 and rng.random() < 0.25
    kind = str(rng.choice(KINDS))
    kinds = [kind if rng.random() < 0.6 else str(rng.choice(KINDS)) for _ in one.axes]
    references = []
    for j, (_, what) in enumerate(zip(one.axes, kinds, strict=True)):
        override = rng.uniform(0.5, 1)
        if turns:
            part = count // len(one.axes)
            moved = move(rng, what, part, step, override * one.speeds[j], override * one.accelerations[j])
            path = np.zeros(count)
            path[j * part:(j + 1) * part] = moved
            path[(j + 1) * part:] = moved[-1]
        else:
            path = move(rng, what, count, step, override * one.speeds[j], override * one.accelerations[j])
        references.append(path)
    felt = [np.gradient(np.gradient(path, step), step) * axis.load_inertia
            for axis, path in zip(one.axes, references, strict=True)]
    total = np.sum(felt, axis=0)
    share = rng.uniform(0, 0.2)
    lightest = [min(axis.load_inertia / other.load_inertia for other in one.axes) for axis in one.axes]
    disturbances = tuple(share * min(1.0, w) * (total - f) for w, f in zip(lightest, felt, strict=True))
    return Task(step, every, tuple(references), disturbances, tuple(kinds))

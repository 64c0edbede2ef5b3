"""What can be hidden in the second cell, and what it is built into: the register that effects.py fills."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from tests.second_cell.arm import Arm
from tests.second_cell.chain import rotation
from tests.second_cell.plans import Plan


@dataclass
class World:
    """What an effect is built into: the arm, the plan as carried out; faults of force [N] and reading [m], rows (n, 3) to rows;
    table_q (n, 6) [rad]: the pose as it is written down."""

    arm: Arm
    plan: Plan
    table_q: np.ndarray
    force: list[Callable[[np.ndarray], np.ndarray]] = field(default_factory=list)
    reading: list[Callable[[np.ndarray], np.ndarray]] = field(default_factory=list)

    def across_tcp(self, joint: int, twist: np.ndarray) -> np.ndarray:
        """How far the TCP is off (n, 3) [m] when a joint (1-based) stands off by twist (n,) [rad]."""
        q = self.plan.q.copy()
        q[:, joint - 1] += twist
        return self.arm.robot.tcp(q, self.arm.tool) - self.arm.robot.tcp(self.plan.q, self.arm.tool)


Build = Callable[[World, int, float, np.random.Generator], None]


@dataclass(frozen=True)
class Effect:
    """joints: where it may sit, empty where it belongs to none; known_as: the dictionary's name."""

    build: Build
    joints: tuple[int, ...]
    known_as: str
    outside: bool
    rod: bool


EFFECTS: dict[str, Effect] = {}


def effect(name: str, joints: Sequence[int] = (), known_as: str = "", outside: bool = False, rod: bool = False
           ) -> Callable[[Build], Build]:
    """Registers what builds an effect: (world, joint or 0, factor, rng). rod: only where there is a parallel rod."""
    def register(build: Build) -> Build:
        EFFECTS[name] = Effect(build, tuple(joints), known_as or name, outside, rod)
        return build

    return register


def direction(rng: np.random.Generator) -> np.ndarray:
    """A random unit vector (3,)."""
    vector = rng.standard_normal(3)
    return np.asarray(vector / np.linalg.norm(vector))


def turn(vector: np.ndarray) -> np.ndarray:
    """Rotation matrix of a rotation vector (3,) [rad]."""
    angle = float(np.linalg.norm(vector))
    return rotation(vector / angle, np.array([angle]))[0]


# Gears.

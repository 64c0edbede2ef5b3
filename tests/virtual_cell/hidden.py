"""What can be hidden in a virtual cell: the dictionary of causes and, beyond it, plausible effects that it does not know.

An effect is two functions: one draws its parameters, at a multiple of the typical size, and one builds it into the plant.
Parameter names, meaning and signs are the dictionary's (docs/effects.md); the law is physics, near the dictionary's but not it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from tests.virtual_cell.designs import Design
from tests.virtual_cell.plant import Plant

Parameters = dict[str, Any]
ARCMIN = np.radians(1 / 60)


@dataclass(frozen=True)
class Hidden:
    """An effect to hide: its joint (1-based, None where it has none) and its size as a multiple of the typical size.

    parameters: given values win over drawn ones. A factor of 0 is the effect's absence.
    """

    effect: str
    joint: int | None = None
    factor: float = 1.0
    parameters: Parameters | None = None


@dataclass(frozen=True)
class Draw:
    """What the size of an effect is drawn from."""

    rng: np.random.Generator
    joint: int | None
    factor: float
    plant: Plant
    design: Design
    given: Parameters

    def direction(self) -> np.ndarray:
        """A random unit vector (3,)."""
        vector = self.rng.standard_normal(3)
        return np.asarray(vector / np.linalg.norm(vector))

    def vector(self, names: str, length: float) -> Parameters:
        """A random vector of that length times the factor, under three names."""
        return dict(zip(names.split(), (self.factor * length * self.direction()).tolist(), strict=True))

    def phase(self) -> float:
        """An angle [rad] in (-pi, pi)."""
        return float(self.rng.uniform(-np.pi, np.pi))


@dataclass(frozen=True)
class Effect:
    """joints: which it can sit at, empty where it belongs to none. known_as: the dictionary's name for it."""

    size: Callable[[Draw], Parameters]
    build: Callable[[Plant, int | None, Parameters], None]
    joints: tuple[int, ...] = ()
    known_as: str = ""


EFFECTS: dict[str, Effect] = {}


def effect(name: str, size: Callable[[Draw], Parameters], joints: Sequence[int] = (), known_as: str = ""
           ) -> Callable[..., Any]:
    """Registers the decorated function as what builds the effect."""
    def register(build: Callable[[Plant, int | None, Parameters], None]) -> Callable[[Plant, int | None, Parameters], None]:
        EFFECTS[name] = Effect(size, build, tuple(joints), known_as or name)
        return build

    return register


def install(plant: Plant, hidden: Hidden, rng: np.random.Generator, design: Design) -> Parameters:
    """Builds a hidden effect into the plant; returns the truth `{"effect", "joint", "parameters"}`."""
    entry = EFFECTS.get(hidden.effect)
    if entry is None:
        raise ValueError(f"no effect {hidden.effect!r}; there are {', '.join(sorted(EFFECTS))}")
    if hidden.joint not in (entry.joints or (None,)):
        raise ValueError(f"{hidden.effect} sits at {entry.joints or 'no joint'}, not at {hidden.joint}")
    given = hidden.parameters or {}
    parameters = entry.size(Draw(rng, hidden.joint, hidden.factor, plant, design, given)) | given
    entry.build(plant, hidden.joint, parameters)
    return {"effect": entry.known_as, "joint": hidden.joint, "parameters": parameters}

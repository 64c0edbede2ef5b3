"""Effects that the dictionary knows by name, under laws that are not its own: smooth zones, rounded play, bristles for slip.

A diagnosis may name them by the family's name (`known_as`); that it names the dictionary's law with certainty where another of
the same gear does as well is what these are for. Sizes are those of effects_robot.py; the shapes are made up for tests from the
literature's usual ones.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from tests.virtual_cell.effects_robot import ALL, SHARE
from tests.virtual_cell.hidden import ARCMIN, Draw, Parameters, effect
from tests.virtual_cell.laws import Law, Row
from tests.virtual_cell.plant import Plant


@dataclass
class SmoothZone(Law):
    """A gear that gives `extra` [rad] more, half of it by about half of `threshold` [N m]: tanh, without any corner."""

    joint: int
    extra: float
    threshold: float

    def add(self, x: np.ndarray, torque: np.ndarray, rest: np.ndarray | None, row: Row) -> None:
        x[self.joint] += self.extra * np.tanh(torque[self.joint] / self.threshold)


@dataclass
class RoundedPlay(Law):
    """Free play whose flanks meet softly: `half_gap 2/pi atan(torque / friction)`."""

    joint: int
    half_gap: float
    friction: float

    def add(self, x: np.ndarray, torque: np.ndarray, rest: np.ndarray | None, row: Row) -> None:
        x[self.joint] += self.half_gap * 2 / np.pi * np.arctan(torque[self.joint] / self.friction)


@dataclass
class Bristles(Law):
    """Bouc-Wen's loop beside the spring: `dz/dtau = (1 - |z|^1.5 sign(dtau z)) / slip`, from zero at the start of a pose."""

    joint: int
    amplitude: float
    slip: float
    state: float = 0.0
    last: float | None = None
    steps: int = field(default=24, repr=False)

    def begin(self) -> None:
        self.state, self.last = 0.0, None

    def _moved(self, torque: np.ndarray) -> float:
        change = 0.0 if self.last is None else float(torque[self.joint]) - self.last
        z, part = self.state, change / self.steps / self.slip
        for _ in range(self.steps):
            z += part * (1 - abs(z) ** 1.5 * np.sign(part * z))
        return float(np.clip(z, -1.0, 1.0))

    def add(self, x: np.ndarray, torque: np.ndarray, rest: np.ndarray | None, row: Row) -> None:
        x[self.joint] += self.amplitude * self._moved(torque)

    def settle(self, torque: np.ndarray, row: Row) -> None:
        self.state, self.last = self._moved(torque), float(torque[self.joint])


def _smooth_zone(draw: Draw) -> Parameters:
    threshold = float(np.exp(draw.rng.uniform(np.log(15), np.log(150)))) * SHARE[draw.joint - 1]
    return {"extra_rad": draw.factor * 0.8 * 100.0 * SHARE[draw.joint - 1] / draw.plant.stiffness[draw.joint - 1],
            "torque_nm": threshold}


@effect("smooth_zone", _smooth_zone, ALL, known_as="soft_zone")
def smooth_zone(plant: Plant, joint: int, parameters: Parameters) -> None:
    plant.laws.append(SmoothZone(plant.drive(joint), parameters["extra_rad"], parameters["torque_nm"]))


@effect("rounded_play", lambda draw: {"half_gap_rad": draw.factor * 0.5 * np.sqrt(0.1) * ARCMIN}, ALL, known_as="backlash")
def rounded_play(plant: Plant, joint: int, parameters: Parameters) -> None:
    plant.laws.append(RoundedPlay(plant.drive(joint), parameters["half_gap_rad"], 6.0 * SHARE[joint - 1]))


def _bristles(draw: Draw) -> Parameters:
    slip = draw.rng.uniform(20, 100) * SHARE[draw.joint - 1]
    return {"amplitude_rad": -draw.factor * 0.15 * ARCMIN, "torque_nm": slip}


@effect("bristles", _bristles, ALL, known_as="hysteresis")
def bristles(plant: Plant, joint: int, parameters: Parameters) -> None:
    """The twist lags behind the torque, as friction makes it."""
    plant.laws.append(Bristles(plant.drive(joint), parameters["amplitude_rad"], parameters["torque_nm"]))

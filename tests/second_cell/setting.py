"""How a cell may be set up beside the usual: how the robot stands, where the load pulls, how large loads and gauges are."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from tests.second_cell.arm import G
from tests.second_cell.chain import rotation
from tests.second_cell.noise import Noise
from tests.second_cell.plans import Plan

X, Y, Z = np.eye(3)


@dataclass(frozen=True)
class Setting:
    """base (3,): rotation vector of the robot's base in the world; tool (3,): of the TCP's axes in the flange; hook (3,) [m]:
    where the load pulls, from the TCP in the flange frame, as the table's moments say; loads, gauges: times the usual force,
    and noise of the readings."""

    base: np.ndarray = field(default_factory=lambda: np.zeros(3))
    tool: np.ndarray = field(default_factory=lambda: np.zeros(3))
    hook: np.ndarray = field(default_factory=lambda: np.zeros(3))
    loads: float = 1.0
    gauges: float = 1.0

    @property
    def fall(self) -> np.ndarray:
        """Gravity (3,) [m/s^2] in the base frame."""
        return np.asarray(matrix(self.base).T @ G)

    def carried_out(self, plan: Plan) -> Plan:
        """The plan with its loads."""
        return replace(plan, load=np.round(self.loads * plan.load, 1))

    def noisy(self, noise: Noise) -> Noise:
        """The noise of these gauges, stated as much larger as it is."""
        said = noise.stated and replace(noise.stated, sensor=self.gauges * noise.stated.sensor,
                                        seating=self.gauges * noise.stated.seating)
        return replace(noise, sensor=self.gauges * noise.sensor, seating=self.gauges * noise.seating,
                       digit=np.round(self.gauges) * noise.digit, stated=said)


def any_setting(size: float, rng: np.random.Generator) -> Setting:
    """Drawn: on the floor, tilted, at a wall or under the ceiling; the load at the TCP or up to 80 mm beside it; loads as a
    robot of that size may carry them; gauges from a good probe to a laser tracker, 1 to 12 times coarser."""
    base = [np.zeros(3), np.radians(rng.uniform(-15, 15)) * Y, np.pi / 2 * Y, np.pi * X][rng.choice(4, p=[0.5, 0.2, 0.1, 0.2])]
    hook = rng.uniform(-0.08, 0.08, 3) * (rng.random() < 0.3)
    return Setting(base, rng.uniform(-2, 2, 3), hook.round(4), float(size**1.5 * rng.uniform(0.6, 2.5)),
                   float(np.exp(rng.uniform(0, np.log(12)))))


def matrix(vector: np.ndarray) -> np.ndarray:
    """Rotation matrix of a rotation vector (3,) [rad]."""
    angle = float(np.linalg.norm(vector))
    return rotation(vector / angle, np.array([angle]))[0] if angle else np.eye(3)


def quaternion(vector: np.ndarray) -> list[float]:
    """Of a rotation vector (3,) [rad], w first."""
    angle = float(np.linalg.norm(vector))
    axis = vector / angle if angle else vector
    return [float(x) for x in np.round(np.append(np.cos(angle / 2), np.sin(angle / 2) * axis), 9)]

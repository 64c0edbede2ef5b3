"""JointLog: one joint of a log taken in motion, with encoders on both sides of the gear (docs/formats.md)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class JointLog:
    """n samples of one joint, evenly spaced: time (n,) [s], torque (n,) on the gear side [N m], speed (n,) [rad/s],
    deflection (n,) motor minus link angle [rad], angle (n,) of the motor as a joint angle [rad]; compliance of its spring
    [rad/(N m)]; others: torque (n,) [N m] of the other joints that the log has."""

    joint: int
    time: Array
    torque: Array
    speed: Array
    deflection: Array
    angle: Array
    compliance: float
    others: Mapping[int, Array] = field(default_factory=dict)

    @cached_property
    def step(self) -> float:
        """Time between two samples [s]."""
        return float(np.median(np.diff(self.time)))

    @cached_property
    def acceleration(self) -> Array:
        """Derivative of the speed (n,) [rad/s^2], central differences."""
        return np.gradient(self.speed, self.time)

    def delayed(self, seconds: float) -> Array:
        """The torque (n,) [N m] as it was so many seconds before, the ends held."""
        return np.interp(self.time - seconds, self.time, self.torque)

"""The parts of the noise, and how large each is: what is estimated of it (noise.py)."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
# No file states these: forces of one visit against the next, relative, and the odds rho / (1 - rho) of a sensor's memory.
USUAL_SETUP = 0.001
USUAL_ODDS = 0.1
# A part this much (ln) smaller or larger than usual is as good as nothing or all there is.
LARGEST_LOG = 7.0
# Nor is a part of the noise under a hundredth of what is stated: readings that agree better come from a computer.
SMALLEST_LOG = -4.6


class SetUp(IntEnum):
    """How the forces of one visit are off against those of the next: all components by one share, as by a load cell that is
    zeroed and loaded anew; each by its own; or turned as far as they are stretched."""

    SIZED = 0
    STRETCHED = 1
    TURNED = 2


@dataclass(frozen=True)
class VarianceComponents:
    """Square roots of the variance components of the parts, as multiples of what is stated of each (of what is usual where
    nothing is stated); memory: the odds rho / (1 - rho), likewise; and the Student degrees of freedom; set_up: how a
    visit's forces are off."""

    sensor: float = 1.0
    force: float = 1.0
    absolute: float = 1.0
    offset: float = 1.0
    setup: float = 0.0
    memory: float = 0.0
    degrees: float = np.inf
    set_up: SetUp = SetUp.TURNED

    @property
    def values(self) -> Array:
        """The six multiples, in the order of PARTS."""
        return np.array([getattr(self, part) for part in PARTS])

    @property
    def logs(self) -> Array:
        """ln of the multiples (6,), of one that is nothing the smallest."""
        return np.log(np.maximum(self.values, np.exp(SMALLEST_LOG)))

    @property
    def rho(self) -> float:
        """How alike neighbouring readings of the sensor are, 0 to 1."""
        return float(memory_of(np.array(self.memory)))

    @property
    def setup_relative(self) -> float:
        """By what share of the load forces differ from one set-up to the next."""
        return USUAL_SETUP * self.setup

    def within(self, stated: tuple[bool, ...]) -> VarianceComponents:
        """As stated, and these for the parts that are not stated."""
        return self.with_values(np.where(stated, 1.0, self.values))

    def at_most(self, multiple: float) -> VarianceComponents:
        """With no part but the sensor's above so many times the stated, or usual."""
        return self.with_values(np.append(self.values[:1], np.minimum(self.values[1:], multiple)))

    def of_the_usual_parts(self) -> VarianceComponents:
        """Without the parts that come in only where the rows ask for them."""
        return replace(self, setup=0.0, memory=0.0, set_up=SetUp.TURNED)

    def with_logs(self, logs: Array) -> VarianceComponents:
        """The same with multiples of these logarithms (6,)."""
        return self.with_values(np.exp(logs))

    def with_values(self, values: Array) -> VarianceComponents:
        """The same with other multiples (6,)."""
        sensor, force, absolute, offset, setup, memory = (float(value) for value in values)
        return VarianceComponents(sensor, force, absolute, offset, setup, memory, self.degrees, self.set_up)


PARTS = ("sensor", "force", "absolute", "offset", "setup", "memory")
SENSOR, FORCE, ABSOLUTE, OFFSET, SETUP, MEMORY = range(6)
# The parts of the noise that a row has by itself and by the one before.
OF_ROWS = (SENSOR, FORCE, ABSOLUTE, MEMORY)
# Parts that need not be there at all: no file states them.
OPTIONAL = (SETUP, MEMORY)


def memory_of(multiple: Array) -> Array:
    """rho of multiples of the usual odds."""
    odds = USUAL_ODDS * np.asarray(multiple)
    return np.asarray(odds / (1.0 + odds))

"""The loads of one run: which forces are applied, in which order, while the robot stands at one pose."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
AXES = "xyz"
# Up in three steps, back to zero, two steps to the other side: both signs, more than three magnitudes, a zero reading between.
CYCLE = (0.0, 1 / 3, 2 / 3, 1.0, 0.0, -0.5, -1.0)
SINGLE = (0.0, 1.0)
PROTOCOLS = {"cycle": CYCLE, "single": SINGLE}


@dataclass(frozen=True, eq=False)
class Slot:
    """name: the axes that are loaded, such as "y". forces (L, 3) [N] at the TCP in the base frame, in their order."""

    name: str
    forces: Array

    @cached_property
    def largest(self) -> Array:
        """Largest magnitude along each base axis (3,) [N]."""
        return np.asarray(np.abs(self.forces).max(axis=0))


    @cached_property
    def grouped(self) -> list[tuple[Array, Array]]:
        """Distinct forces up to their sign (3,) [N], and the signs of the rows that have them."""
        found: list[tuple[Array, list[float]]] = []
        for force in self.forces:
            for first, signs in found:
                if np.array_equal(first, force) or np.array_equal(first, -force):
                    signs.append(1.0 if np.array_equal(first, force) else -1.0)
                    break
            else:
                found.append((force, [1.0]))
        return [(force, np.array(signs)) for force, signs in found]


def slot(axes: str, protocol: str, force: float) -> Slot:
    """The protocol along each of `axes` in turn, one base axis at a time, up to +-force [N]."""
    steps = force * np.array(PROTOCOLS[protocol])
    return Slot(axes, np.concatenate([np.outer(steps, np.eye(3)[AXES.index(axis)]) for axis in axes]))

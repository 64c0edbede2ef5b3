"""What a cell does beside yielding: a smooth kinematic error over the work space, and a spindle that grows while it warms up.

Made up for tests; nothing in it comes from the packages, and none of it has the form of their remainder or of their drift: the
error is a sum of plane waves, the growth is exponential.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

WAVES = 12


@dataclass(frozen=True)
class Astray:
    """waves (W, 3) [rad/m], phase (W,) and vectors (W, 3) [mm] of the kinematic error; growth (3,) [mm] of the warm cell in the
    work object, time constant [s]."""

    waves: np.ndarray
    phase: np.ndarray
    vectors: np.ndarray
    growth: np.ndarray
    constant_s: float

    def displacement_mm(self, place_mm: np.ndarray, time_s: np.ndarray) -> np.ndarray:
        """How far the tool stands off its command (S, 3) [mm], work object, at places (S, 3) [mm] after so many seconds
        (S,)."""
        angle = 1e-3 * place_mm @ self.waves.T + self.phase
        return np.asarray(np.sin(angle) @ self.vectors + (1 - np.exp(-time_s / self.constant_s))[:, None] * self.growth)


def drawn(seed: int, size_mm: float = 0.2, growth_mm: float = 0.04, wavelength_mm: tuple[float, float] = (300.0, 1500.0),
          constant_s: float = 15.0) -> Astray:
    """An error of that size (largest within half a metre) with wavelengths in that range, and a growth along the spindle."""
    rng = np.random.default_rng([seed, 4711])
    direction = rng.standard_normal((WAVES, 3))
    length = np.exp(rng.uniform(*np.log(wavelength_mm), WAVES))
    waves = direction / np.linalg.norm(direction, axis=1)[:, None] * (2e3 * np.pi / length)[:, None]
    found = Astray(waves, rng.uniform(0, 2 * np.pi, WAVES), rng.standard_normal((WAVES, 3)), np.zeros(3), constant_s)
    box = rng.uniform(-250.0, 250.0, (4000, 3))
    largest = np.linalg.norm(found.displacement_mm(box, np.zeros(len(box))), axis=1).max()
    return Astray(waves, found.phase, found.vectors * size_mm / largest, np.array([0.25, 0.0, -1.0]) * growth_mm, constant_s)

"""The noise that replicates of the rows are drawn from."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from identification.fit.noise import NoiseModel
from identification.fit.noise_parts import SetUp, VarianceComponents
from identification.fit.optional_parts import possible
from identification.fit.posterior import Posterior
from identification.fit.variance_components import Trials

Array = NDArray[np.float64]


class Drawn(Protocol):
    """Noise that replicates are drawn from."""

    @property
    def readings(self) -> int:
        """How many numbers were measured."""
        ...

    def draw(self, rng: np.random.Generator, count: int) -> Array:
        """Noise (n, 3, count) in the coordinates of the rows."""
        ...


@dataclass(frozen=True, eq=False)
class FittedNoise:
    """Noise as it is fitted, or planned: its model, the variance components with the covariance (6, 6) of their ln, and the
    rows' weights (n,)."""

    model: NoiseModel
    components: VarianceComponents
    covariance: Array
    row_weight: Array

    @classmethod
    def of(cls, fitted: Posterior) -> FittedNoise:
        """Of a fitted model."""
        return cls(fitted.at_map.noise, fitted.components, fitted.components_covariance, fitted.row_weight)

    @property
    def readings(self) -> int:
        """How many numbers were measured."""
        return int(self.model.measured.sum())

    def draw(self, rng: np.random.Generator, count: int) -> Array:
        """Noise (n, 3, count) in the model's coordinates, each draw with variance components of their own."""
        logs = self.components.logs
        drawn = rng.multivariate_normal(logs, self.covariance, count, method="eigh")
        return self.model.draw(np.exp(np.clip(drawn, logs - 2.5, logs + 1.5)), self.row_weight, rng)


@dataclass(frozen=True, eq=False)
class AveragedNoise:
    """The noise that replicates of measured rows are drawn from: its model, trials of its variance components, and the rows'
    weights (n,)."""

    model: NoiseModel
    trials: Trials
    row_weight: Array

    @classmethod
    def of(cls, fitted: Posterior) -> AveragedNoise:
        """Of a fitted model."""
        return cls(fitted.at_map.noise, fitted.trials, fitted.row_weight)

    @property
    def readings(self) -> int:
        """How many numbers were measured."""
        return int(self.model.measured.sum())

    def draw(self, rng: np.random.Generator, count: int) -> Array:
        """Noise (n, 3, count) in the model's coordinates, each draw with variance components of their own."""
        share = np.cumsum(self.trials.weight)
        number = np.searchsorted(share, share[-1] * rng.random(count))
        set_up, drawn = self.trials.set_up[number], []
        for way in SetUp:
            noise = self.model.with_parts(*possible(self.model), set_up=way)
            drawn.append(noise.draw(np.exp(self.trials.logs[number[set_up == way]]), self.row_weight, rng))
        return np.concatenate(drawn, axis=2)

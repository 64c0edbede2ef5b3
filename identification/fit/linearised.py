"""The fitted model linearised: what the likelihood needs of the rows near one x."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from identification.fit.noise import NoiseModel, Weights
from identification.fit.noise_parts import VarianceComponents
from identification.fit.priors import PriorModel

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Linearised:
    """The n fitted rows at x (6 + P,), in the coordinates of `noise`: design (n, 3, 6 + P) by x and residual (n, 3), whitened
    by the sensor's sigma; row_weight (n,). prior: of x, the terms' parameters included."""

    noise: NoiseModel
    design: Array
    residual: Array
    row_weight: Array
    prior: PriorModel
    x: Array

    @property
    def columns(self) -> Array:
        """Design and residual side by side (n, 3, 7 + P)."""
        return np.concatenate([self.design, self.residual[:, :, None]], axis=2)

    def weights(self, components: VarianceComponents) -> Weights:
        """Sigma^-1 of the rows, weighted."""
        return self.noise.weights(components, self.row_weight)

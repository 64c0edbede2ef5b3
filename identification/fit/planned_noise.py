"""How well rows that are not measured yet will tell the parts of their noise."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from identification.fit.linearised import Linearised
from identification.fit.load_test import LoadTest
from identification.fit.noise import NoiseModel
from identification.fit.noise_parts import VarianceComponents
from identification.fit.variance_components import ComponentPosterior, log_covariance

Array = NDArray[np.float64]


def planned_covariance(data: LoadTest, log_compliance: Array, noise: NoiseModel, design: Array) -> Array:
    """Covariance (6, 6) of ln of the parts, where they are what the cell file states: by a draw of that noise about the model
    at ln c (6,), whose design (n, 3, 6) is in the noise's coordinates."""
    stated, alike = VarianceComponents(), np.ones(len(data.rows))
    drawn = noise.draw(stated.values[None], alike, np.random.default_rng(0))[:, :, 0]
    return log_covariance(ComponentPosterior(Linearised(noise, design, drawn, alike, data.prior, log_compliance)), stated)

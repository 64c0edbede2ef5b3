"""How much of a misfit a model with causes explains, the noise not larger than ordinary."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from identification.fit.noise import noise_model
from identification.fit.posterior import Posterior

Array = NDArray[np.float64]
# Components up to so many times the stated ones when it is asked how much of a misfit is explained.
ORDINARY = 1.5


@dataclass(frozen=True)
class Explained:
    """excess: chi-squared a reading of the plain model, 1 where it explains the data; share of what is above 1 that the
    extended model takes away."""

    excess: float
    share: float


def explained(plain: Posterior, extended: Posterior) -> Explained:
    """How much of the plain model's misfit the extended one explains, against noise no larger than ordinary."""
    noise = noise_model(extended.data, extended.compliance)
    components = extended.components
    weights = noise.weights(components.at_most(ORDINARY))

    def chi2(model: Posterior) -> float:
        whitened = np.einsum("nij,nj->ni", noise.whitening, np.nan_to_num(model.residual))[:, :, None]
        return float(weights.inner(whitened, whitened)[0, 0]) / max(plain.readings - 6, 1)

    before, after = chi2(plain), chi2(extended)
    return Explained(before, 1.0 - max(after - 1.0, 0.0) / max(before - 1.0, 1e-9))

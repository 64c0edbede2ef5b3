"""Is the noise that the data need still the noise that was stated? What no cause explains ends up in it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from identification.fit.noise import noise_model
from identification.fit.posterior import Posterior

Array = NDArray[np.float64]
PARTS = ("sensor noise", "force error", "absolute force error", "re-seating")
# Data sheets are nominal: a named cause may leave this many times the stated noise, a plain model that much more.
GRANTED_AFTER_NAMING = 3.0
GRANTED = 4.0
# Components up to so many times the stated ones when it is asked how much of a misfit is explained.
ORDINARY = 1.5
ONE_SIDED_95 = 1.645


def beyond_stated(fitted: Posterior, granted: float) -> dict[str, float]:
    """The parts of the noise that cell.yaml (or the rows) state and that the data put above `granted` times that, with 95 %
    confidence: how many times the stated size each is."""
    cell, rows = fitted.data.cell, fitted.data.rows
    if np.any(rows.machined_pass != ""):
        # What is stated holds for a reading at rest, not for the mean of a stretch of a pass.
        return {}
    stated = (cell.noise.deflection_stated or not np.isnan(rows.sigma).all(), *fitted.at_map.noise.stated[1:4])
    components, log_std = fitted.components, fitted.components_log_std
    multiples = (components.sensor, components.force, components.absolute, components.offset)
    return {name: multiple for name, multiple, std, known in zip(PARTS, multiples, log_std[:4], stated, strict=True)
            if known and np.log(multiple / granted) > ONE_SIDED_95 * std}


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
        whitened = np.einsum("nij,nj->ni", noise.rotation, np.nan_to_num(model.residual))[:, :, None]
        return float(weights.inner(whitened, whitened)[0, 0]) / max(plain.readings - 6, 1)

    before, after = chi2(plain), chi2(extended)
    return Explained(before, 1.0 - max(after - 1.0, 0.0) / max(before - 1.0, 1e-9))

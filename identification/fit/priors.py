"""The prior in x: ln c of the six joints, then the parameters of the effects in force, in their own units."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from identification.model.effects_in_force import EFFECTS, SPRINGS
from identification.model.robot import Prior

Array = NDArray[np.float64]
PriorKind = Literal["lognormal", "gaussian"]


def _none() -> Array:
    return np.empty(0)


@dataclass(frozen=True, eq=False)
class PriorModel:
    """The prior in x = (ln c, parameters of effects): median stiffness (6,), std / mean of k (6,); kind "lognormal", or
    "gaussian" in k with gamma. term_mean, term_std, term_low, term_high (P,): normal prior and bounds of the effects'
    parameters."""

    prior: Prior
    kind: PriorKind = "lognormal"
    gamma: float = 1.0
    term_mean: Array = field(default_factory=_none)
    term_std: Array = field(default_factory=_none)
    term_low: Array = field(default_factory=_none)
    term_high: Array = field(default_factory=_none)

    def value(self, x: Array) -> float:
        """-ln prior, without its constant (paper eq. 11; log-normal: docs/architecture.md, Inference)."""
        terms = 0.5 * float(np.sum(((x[EFFECTS] - self.term_mean) / self.term_std) ** 2))
        if self.kind == "lognormal":
            return terms + float(0.5 * np.sum(((x[SPRINGS] + np.log(self.prior.stiffness)) / self.prior.log_std) ** 2))
        share = (np.exp(-x[SPRINGS]) / self.prior.stiffness - 1) / self.prior.relative_std
        return terms + float(0.5 * self.gamma * np.sum(share**2))

    def gradient(self, x: Array) -> Array:
        """Derivative (6 + P,) of -ln prior by x."""
        terms = (x[EFFECTS] - self.term_mean) / self.term_std**2
        if self.kind == "lognormal":
            return np.concatenate([(x[SPRINGS] + np.log(self.prior.stiffness)) / self.prior.log_std**2, terms])
        k = np.exp(-x[SPRINGS])
        width = (self.prior.relative_std * self.prior.stiffness) ** 2
        return np.concatenate([-self.gamma * k * (k - self.prior.stiffness) / width, terms])

    def precision(self, x: Array) -> Array:
        """Gauss-Newton curvature (6 + P, 6 + P) of -ln prior by x."""
        if self.kind == "lognormal":
            joints = 1 / self.prior.log_std**2
        else:
            joints = self.gamma * (np.exp(-x[SPRINGS]) / (self.prior.relative_std * self.prior.stiffness)) ** 2
        return np.diag(np.concatenate([joints, 1 / self.term_std**2]))

    def search_curvature(self, x: Array) -> Array:
        """Curvature (6 + P, 6 + P) for the search: the full second derivative where it is positive, else `precision`."""
        curvature = self.precision(x)
        if self.kind == "lognormal":
            return curvature
        k = np.exp(-x[SPRINGS])
        full = self.gamma * k * (2 * k - self.prior.stiffness) / (self.prior.relative_std * self.prior.stiffness) ** 2
        joints = np.arange(6)
        curvature[joints, joints] = np.maximum(full, 0.2 * curvature[joints, joints])
        return curvature

    def inside(self, x: Array) -> Array:
        """x (..., 6 + P) with the effects' parameters moved inside their bounds."""
        return np.concatenate([x[..., SPRINGS], np.clip(x[..., EFFECTS], self.term_low, self.term_high)], axis=-1)

    def pressed(self, x: Array, upwards: Array) -> NDArray[np.bool_]:
        """Parameters of x (6 + P,) that stand at a bound and would leave it in the direction `upwards` (6 + P,)."""
        x, direction = x[EFFECTS], upwards[EFFECTS]
        out = ((x <= self.term_low) & (direction < 0)) | ((x >= self.term_high) & (direction > 0))
        return np.concatenate([np.zeros(6, dtype=bool), out])

    @property
    def log_std(self) -> Array:
        """Standard deviation (6,) of ln k before the measurements."""
        if self.kind == "lognormal":
            return self.prior.log_std
        return np.asarray(self.prior.relative_std / np.sqrt(self.gamma))

"""Cutting stiffness: how the force across the feed grows with the depth, with its error and its posterior from logged passes.

Two passes of one program with other offsets show at every target a change dF_n of the force along n and a change t of the depth
(engagement.py). In stretch j of the path

    dF_n = (K + u_j) t + c . n + e,    u_j ~ N(0, spread^2),    c ~ N(0, ZERO^2),    e ~ N(0, r_j s^2):

K differs from place to place (in a full slot nothing grows across the feed, at a wall it does), c is what the sensor's zeros
differ by in the two passes, s the standard error of the mean forces, r_j >= 1 by how much the stretch scatters more than that,
with its autocorrelation. K and c are integrated out exactly, the spread over a grid, flat up to twice the stretches' own
scatter (A. Gelman, Bayesian Analysis 1, 2006: flat in the spread for five groups or more). K is not negative.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from compensator.correction.settings import Estimate
from identification.common.arrays import Array
from identification.common.autocorrelation import autocorrelation_time
from identification.common.quantities import two_sigma

Origin = Literal["stated", "cell.yaml", "material", "depth", "passes"]
# Sensor zeros after a tare: their drift in the minutes between tare and cut [N]; engineering judgement.
ZERO = 2.0
# No mean force is known better [N].
LEAST_ERROR = 0.05
STRETCHES, FEWEST_IN_ONE = 20, 8
# A correction follows a cutting stiffness that is so many standard errors from zero.
SURE = 2.0


@dataclass(frozen=True)
class CuttingStiffness:
    """value [N/m] with the standard error std of what any place of a path has; spread: how much places differ, a part of it.
    origin: what it rests on; climb_only: it is that of climb milling (cut_kind.py), and no other place is corrected by it;
    pairs: logged pairs of passes behind it; mean_std: standard error of the mean over places."""

    value: float
    std: float
    origin: Origin
    spread: float = 0.0
    mean_std: float = 0.0
    pairs: int = 0
    climb_only: bool = False

    @property
    def followed(self) -> bool:
        """Whether a correction makes the force follow it: else its size alone counts in what is expected on the part."""
        return self.value > 0 and self.value >= SURE * self.std

    @property
    def size(self) -> float:
        """Root mean square [N/m]."""
        return float(np.hypot(self.value, self.std))

    def as_dict(self) -> dict[str, Any]:
        """JSON values, N/mm."""
        return {"n_per_mm": 1e-3 * self.value, "std_n_per_mm": 1e-3 * self.std, "spread_n_per_mm": 1e-3 * self.spread,
                "origin": self.origin, "climb_only": self.climb_only, "pairs": self.pairs, "followed": self.followed}

    def words(self) -> str:
        """For people."""
        places = f", of which {1e-3 * two_sigma(self.spread):.2g} from place to place" if self.spread > 0.1 * self.std else ""
        if not self.std:
            return f"{1e-3 * self.value:.3g} N/mm, taken as exact"
        return f"{1e-3 * self.value:.3g} +- {1e-3 * two_sigma(self.std):.2g} N/mm (2 sigma{places})"


@dataclass(frozen=True, eq=False)
class PassPair:
    """Two logged passes of one program at n targets in the order of the path: how much deeper the second cut, depth (n,) [m];
    change (n,) [N] of the force along direction (n, 3), the unit vectors n; error (n,) [N], 1 sigma of the change by the
    scatter of both logs; climb, slot (n,): share of climb milling, and of a slot, in the first (cut_kind.py)."""

    depth: Array
    change: Array
    direction: Array
    error: Array
    climb: Array
    slot: Array

    def where(self, mask: NDArray[np.bool_]) -> PassPair:
        """The targets of mask (n,) alone."""
        return PassPair(self.depth[mask], self.change[mask], self.direction[mask], self.error[mask], self.climb[mask],
                        self.slot[mask])


@dataclass(frozen=True, eq=False)
class _Stretches:
    """Normal equations of S stretches of one pair in (K, c): a (S, 4, 4), b (S, 4)."""

    a: Array
    b: Array


def posterior(prior: Estimate, pairs: Sequence[PassPair]) -> CuttingStiffness:
    """K of the cut in these pairs, each of at least 2 FEWEST_IN_ONE targets. prior [N/m]: mean and standard error."""
    mean, error, spread = _marginal(prior, pairs)
    mean, error = _not_negative(mean, error)
    return CuttingStiffness(mean, float(np.hypot(error, spread)), "passes", spread, error, len(pairs))


def of_either_sign(prior: Estimate, pairs: Sequence[PassPair]) -> Estimate:
    """The mean over places [N/m] with its standard error, which may be negative: then the force falls with the depth."""
    mean, error, _ = _marginal(prior, pairs)
    return Estimate(mean, error)


def _marginal(prior: Estimate, pairs: Sequence[PassPair]) -> tuple[float, float, float]:
    """Mean of K and its standard error with the spread integrated out, and the spread's root mean square."""
    stretches = [_stretches(pair) for pair in pairs]
    own = np.concatenate([one.b[:, 0] / np.maximum(one.a[:, 0, 0], 1e-300) for one in stretches])
    known = np.concatenate([one.a[:, 0, 0] for one in stretches])
    centre = float(own @ known / max(known.sum(), 1e-300))
    widest = 2 * float(np.sqrt(known @ (own - centre) ** 2 / max(known.sum(), 1e-300))) + 1e-6 * abs(centre)
    spreads = np.linspace(0.0, widest, 41)
    solved = np.array([_given(spread, prior, stretches) for spread in spreads])
    weight = np.exp(solved[:, 2] - solved[:, 2].max())
    weight /= weight.sum()
    mean = float(weight @ solved[:, 0])
    variance = float(weight @ (solved[:, 1] + (solved[:, 0] - mean) ** 2))
    return mean, float(np.sqrt(variance)), float(np.sqrt(weight @ spreads**2))


def _stretches(pair: PassPair) -> _Stretches:
    """With each stretch's own scatter."""
    count = max(min(STRETCHES, len(pair.depth) // FEWEST_IN_ONE), 1)
    a, b = np.zeros((count, 4, 4)), np.zeros((count, 4))
    for j, rows in enumerate(np.array_split(np.arange(len(pair.depth)), count)):
        x = np.column_stack([pair.depth[rows], pair.direction[rows]])
        error = np.maximum(pair.error[rows], LEAST_ERROR)
        flat = np.column_stack([pair.depth[rows], np.ones(len(rows))]) / error[:, None]
        scaled = pair.change[rows] / error
        left = scaled - flat @ np.linalg.lstsq(flat, scaled, rcond=None)[0]
        scatter = float(left @ left) / max(len(rows) - 2, 1) * autocorrelation_time(left).values
        weight = 1 / (error**2 * max(scatter, 1.0))
        a[j], b[j] = (x * weight[:, None]).T @ x, x.T @ (weight * pair.change[rows])
    return _Stretches(a, b)


def _given(spread: float, prior: Estimate, pairs: Sequence[_Stretches]) -> tuple[float, float, float]:
    """Mean and variance of K for this spread, and the logarithm of the spread's likelihood."""
    information, right = 1 / prior.std**2, prior.value / prior.std**2
    likelihood = 0.0
    for pair in pairs:
        first = pair.a[:, 0, 0]
        taken = spread**2 / (1 + spread**2 * first)
        a = (pair.a - taken[:, None, None] * pair.a[:, :, :1] * pair.a[:, :1, :]).sum(axis=0)
        b = (pair.b - (taken * pair.b[:, 0])[:, None] * pair.a[:, :, 0]).sum(axis=0)
        likelihood += 0.5 * float(np.sum(taken * pair.b[:, 0] ** 2) - np.sum(np.log1p(spread**2 * first)))
        # The zeros of this pair are integrated out.
        zeros = a[1:, 1:] + np.eye(3) / ZERO**2
        across = np.linalg.solve(zeros, np.column_stack([a[1:, 0], b[1:]]))
        information += float(a[0, 0] - a[0, 1:] @ across[:, 0])
        right += float(b[0] - a[0, 1:] @ across[:, 1])
        likelihood += 0.5 * float(b[1:] @ across[:, 1]) - 0.5 * float(np.linalg.slogdet(zeros)[1])
    likelihood += 0.5 * right**2 / information - 0.5 * float(np.log(information))
    return right / information, 1 / information, likelihood


def _not_negative(mean: float, std: float) -> tuple[float, float]:
    """Mean and standard deviation of N(mean, std^2) above zero."""
    from scipy.special import log_ndtr

    low = -mean / std
    ratio = float(np.exp(-0.5 * low**2 - 0.5 * np.log(2 * np.pi) - log_ndtr(-low)))
    return mean + std * ratio, std * float(np.sqrt(max(1 + low * ratio - ratio**2, 0.0)))

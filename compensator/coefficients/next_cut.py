"""What short cut would tell most of the coefficients that are not known: slots and shoulders at several feeds, worked out."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from compensator.cutting.chips import SHEAR, integrals, weights
from compensator.cutting.cutter import Cutter
from identification.common.arrays import Array

# Shares of the diameter across the feed; climb or conventional; factors on the feed.
WIDTHS, FEEDS = (0.1, 0.5, 1.0), (0.5, 1.0, 2.0)


@dataclass(frozen=True)
class TestCut:
    """width: share of the diameter; climb: the stock is on the right; chip [m]: feed a tooth. before, after: the largest 1
    sigma of a mean force among such cuts, as a share of it, as it is known and with this cut logged."""

    width: float
    climb: bool
    chip: float
    before: float = 0.0
    after: float = 0.0

    def words(self) -> str:
        """For people."""
        sense = "climb" if self.climb else "conventional"
        kind = "a full slot" if self.width == 1 else f"{sense} milling {100 * self.width:.0f} % of the diameter wide"
        return f"{kind} at {1e3 * self.chip:.3g} mm a tooth"

    def weight(self, cutter: Cutter, depth: float) -> Array:
        """A (3, 6) of the mean force, with the feed in it."""
        reach = np.arccos(1 - 2 * self.width)
        ends = (-0.5 * np.pi, -0.5 * np.pi + reach) if self.climb else (0.5 * np.pi - reach, 0.5 * np.pi)
        low, high = (np.array([end]) for end in ends)
        matrix = weights(integrals(low, high), np.array([depth]), np.ones(1), np.array([depth]), cutter.teeth)[0]
        matrix[:, SHEAR] *= self.chip
        return np.asarray(matrix)


def next_cut(mean: Array, covariance: Array, cutter: Cutter, depth: float, chip: float, noise: float) -> TestCut:
    """Of the candidates the one after which the worst known of them all is known best. noise [N]: 1 sigma of a mean force of
    such a cut, each component."""
    cuts = [TestCut(width, climb, factor * chip) for width in WIDTHS for climb in (True, False) for factor in FEEDS
            if climb or width < 1]
    matrices = np.stack([cut.weight(cutter, depth) for cut in cuts])
    before = _worst(matrices, mean, covariance)
    after = []
    for matrix in matrices:
        gain = covariance @ matrix.T @ np.linalg.inv(matrix @ covariance @ matrix.T + noise**2 * np.eye(3))
        after.append(_worst(matrices, mean, covariance - gain @ matrix @ covariance))
    best = int(np.argmin(after))
    chosen = cuts[best]
    return TestCut(chosen.width, chosen.climb, chosen.chip, before, after[best])


def _worst(matrices: Array, mean: Array, covariance: Array) -> float:
    """The largest 1 sigma of a force, as a share of it."""
    spread = np.sqrt(np.maximum(np.einsum("cij,jk,cik->c", matrices, covariance, matrices), 0.0))
    return float(np.max(spread / np.maximum(np.linalg.norm(matrices @ mean, axis=1), 1e-12)))

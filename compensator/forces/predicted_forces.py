"""PredictedForces: what is known of forces that were worked out from the stock and not logged, and of the cut they are of."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from identification.common.arrays import Array, read_only

Indices = NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class StockCut:
    """The cut that predicted forces are of, as it is stated: in words, its width (N,) across the feed at the targets and the
    cutter's diameter [m], what the edges need of the force (N, 3) [N] there, whatever the chip, and what the force changes by
    for each metre that the top of the stock is higher (N, 3) [N/m], base frame."""

    words: str
    width: Array
    diameter: float
    of_edges: Array
    of_top: Array


@dataclass(frozen=True, eq=False)
class PredictedForces:
    """Of forces that were worked out in S steps of a path, base frame. step (M,): that of each row of the log; covariance
    (S, 3, 3) [N^2]: what is not known of them along a whole stretch; follows (S, 3, 3) [N/m]: what they change by where the
    tool stands off its plan. cut: None where nothing is cut."""

    step: Indices
    covariance: Array
    follows: Array
    cut: StockCut | None = None

    def __post_init__(self) -> None:
        read_only(self.step, self.covariance, self.follows)

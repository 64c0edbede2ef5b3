"""Is there a remainder at all, or would chance show as much? The likelihood ratio against its own distribution under chance.

The statistic is the largest likelihood ratio over lengths and amplitudes, noise and physical terms as they are without any
remainder. Where an amplitude of zero is at the edge and the length then means nothing, no table has its distribution: it is
drawn, rows of that model without a remainder.
"""

from __future__ import annotations

import numpy as np

from compensator.learning.sizes import LENGTHS, Sizes, noise_covariance
from compensator.learning.terms import Terms
from identification.common.arrays import Array

# A remainder is said to be there where chance alone would show as much in so small a share of parts.
FALSE_RATE = 0.01
DRAWS = 999
AMPLITUDES = np.geomspace(1e-6, 5e-4, 28)


def chance_of_remainder(terms: Terms, alone: Sizes, seed: int = 0) -> tuple[float, float]:
    """The probability that rows without a remainder, noise as `alone`, show as large a ratio, at least 1 / (DRAWS + 1); and the
    length [m] at which the ratio is largest."""
    from scipy.linalg import solve_triangular

    known = terms.physical @ terms.physical_prior @ terms.physical.T
    factor = np.linalg.cholesky(known + noise_covariance(terms, alone))
    seen = solve_triangular(factor, terms.residual, lower=True, check_finite=False)
    drawn = np.random.default_rng(seed).standard_normal((len(seen), DRAWS))
    everything = np.column_stack([seen, drawn])
    ratios = []
    for length in LENGTHS:
        _, slopes = terms.remainder(length)
        white = solve_triangular(factor, slopes @ terms.free(slopes), lower=True, check_finite=False)
        ratios.append(_ratio(white, everything))
    best = np.max(ratios, axis=0)
    return float((1 + (best[1:] >= best[0]).sum()) / (DRAWS + 1)), LENGTHS[int(np.argmax([ratio[0] for ratio in ratios]))]


def _ratio(slopes: Array, rows: Array) -> Array:
    """Largest 2 ln of the likelihood ratio (b,) over amplitudes, of whitened rows (n, b) and slopes (n, k)."""
    left, size, _ = np.linalg.svd(slopes, full_matrices=False)
    squares = (left.T @ rows) ** 2
    grown = (AMPLITUDES[:, None] * size) ** 2
    ratio = (grown / (1 + grown)) @ squares - np.log1p(grown).sum(axis=1)[:, None]
    return np.asarray(np.maximum(ratio.max(axis=0), 0.0))

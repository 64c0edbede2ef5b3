"""Where a full correction might do harm: it is held back where it is smaller than what is known of it, and where it would step.

A predicted deviation d with covariance S is corrected by the share

    a = 2 (1 - z s / |d|), at most 1, at least 0,     s = sqrt(d' S d) / |d| ,   z the normal quantile of the confidence.

It is the largest share after which the tool is nearer to the plan than before with that probability: the true deviation t is
N(d, S), the correction moves the tool by -a d, and |t - a d| > |t| exactly where t.d < a |d|^2 / 2. A share of 1 from
|d| = 2 z s on, 0 at |d| = z s.

Steps: an offset o(s) along the path has a slope of at most L where o = (u + l) / 2 with u(s) = min over s' of o(s') + L |s -
s'| and l likewise with max and minus (McShane's extensions): where o kept the limit it stays what it was. Next to air moves,
which are never moved, the offset grows from zero.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
TINY = 1e-15
SAME = 1e-9         # [m]: rounding of path lengths of kilometres stays below


def confident_share(deviation: Array, covariance: Array, confidence: float) -> Array:
    """Share (M,) of the correction that makes the point better with probability `confidence` (0.5 to 1).

    deviation (M, 3) [m], covariance (M, 3, 3) [m^2]. A confidence of 0.5 takes everything: the expected value is the best
    guess.
    """
    from scipy.special import ndtri

    size, std = _along(deviation, deviation, covariance)
    return np.clip(2.0 * (1.0 - float(ndtri(confidence)) * std / np.maximum(size, TINY)), 0.0, 1.0)


def chance_of_harm(deviation: Array, covariance: Array, offset: Array) -> Array:
    """Probability (M,) that a point is farther from the plan with the offset (M, 3) [m] than without: P(2 t.o + |o|^2 > 0)."""
    from scipy.special import ndtr

    size, std = _along(offset, deviation, covariance)
    toward = np.einsum("ni,ni->n", deviation, offset) / np.maximum(size, TINY)
    return np.where(size > TINY, ndtr((toward + 0.5 * size) / np.maximum(std, TINY)), 0.0)


def _along(direction: Array, deviation: Array, covariance: Array) -> tuple[Array, Array]:
    """Length (M,) of the directions (M, 3), and the deviation's standard deviation (M,) along them."""
    size = np.linalg.norm(direction, axis=1)
    unit = direction / np.maximum(size, TINY)[:, None]
    return size, np.sqrt(np.maximum(np.einsum("ni,nij,nj->n", unit, covariance, unit), 0.0))


def limited_steps(offset: Array, length: Array, air: Mask, slope: float) -> Array:
    """The offsets (N, 3) [m] at path lengths (N,) [m], ascending, with a slope of at most `slope` in each coordinate.

    air (N,): stays zero; from there the offset grows with the slope.
    """
    if not len(offset):
        return offset
    away = np.minimum(length - np.maximum.accumulate(np.where(air, length, -np.inf)),
                      np.minimum.accumulate(np.where(air, length, np.inf)[::-1])[::-1] - length)
    size = np.linalg.norm(offset, axis=1)
    held = offset * np.minimum(1.0, slope * away / np.maximum(size, TINY))[:, None]
    rise = slope * length[:, None]
    above, below = _least(held, rise), -_least(-held, rise)
    return np.asarray(np.where(above - below < -SAME, 0.5 * (above + below), held))


def _least(values: Array, rise: Array) -> Array:
    """min over j of values_j + |rise_i - rise_j| for every i, rise ascending (N, 3)."""
    before = np.minimum.accumulate(values - rise, axis=0) + rise
    after = np.minimum.accumulate((values + rise)[::-1], axis=0)[::-1] - rise
    return np.asarray(np.minimum(before, after))

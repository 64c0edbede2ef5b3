"""Where a full correction might do harm: it is held back where it is smaller than what is known of it, and where it would step.

A predicted deviation d with covariance S is corrected by the share

    a = 2 (1 - z s / |d|), at most 1, at least 0,     s = sqrt(d' S d) / |d| ,   z the normal quantile of the confidence.

It is the largest share after which the tool is nearer to the plan than before with that probability: the true deviation t is
N(d, S), the correction moves the tool by -a d, and |t - a d| > |t| exactly where t.d < a |d|^2 / 2. A share of 1 from
|d| = 2 z s on, 0 at |d| = z s.

Corners: where the path turns sharply the force turns with it, and one target serves the deviation before it and that behind it.
What the means over both ask for may make the side worse that yields less. There the offset goes towards what that side asks
for, until it is no farther off than uncorrected by more than one sigma of its own: both sides can have that, since the step
between them is never more than what both yield together.

Steps: each coordinate of an offset becomes the largest function of slope L or less that is nowhere larger, min over s' of
|o(s')| + L |s - s'|: where o kept the limit it stays what it was, and no point is moved farther than it asks for. Next to air
moves, which are never moved, and where the sign changes it grows from zero.
"""

from __future__ import annotations

from collections.abc import Sequence
from statistics import NormalDist

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
    size, std = _along(deviation, deviation, covariance)
    return np.clip(2.0 * (1.0 - NormalDist().inv_cdf(confidence) * std / np.maximum(size, TINY)), 0.0, 1.0)


def _along(direction: Array, deviation: Array, covariance: Array) -> tuple[Array, Array]:
    """Length (M,) of the directions (M, 3), and the deviation's standard deviation (M,) along them."""
    size = np.linalg.norm(direction, axis=1)
    unit = direction / np.maximum(size, TINY)[:, None]
    return size, np.sqrt(np.maximum(np.einsum("ni,nij,nj->n", unit, covariance, unit), 0.0))


def fair_to_both(offset: Array, sides: Sequence[tuple[Array, Array]]) -> Array:
    """The offsets (C, 3) [m] at sharp corners, moved just so far that neither side is left farther off than uncorrected by more
    than its own sigma; sides: the offsets (C, 3) [m] that each asks for, and 1 sigma (C,) [m] of them."""
    for side, sigma in sides:
        off = side - offset
        size = np.linalg.norm(off, axis=1)
        excess = np.maximum(size - np.linalg.norm(side, axis=1) - sigma, 0.0)
        offset = offset + (excess / np.maximum(size, TINY))[:, None] * off
    return offset


def limited_steps(offset: Array, length: Array, air: Mask, slope: float) -> Array:
    """The offsets (N, 3) [m] at path lengths (N,) [m], ascending, with a slope of at most `slope` in each coordinate.

    air (N,): stays zero; from there the offset grows with the slope.
    """
    if not len(offset):
        return offset
    zero = np.where(air, length, np.nan)
    size = np.linalg.norm(offset, axis=1)
    held = offset * np.minimum(1.0, slope * _away(zero, zero, length) / np.maximum(size, TINY))[:, None]
    return np.column_stack([_held(values, length, slope) for values in held.T])


def _held(values: Array, length: Array, slope: float) -> Array:
    """One coordinate (N,) [m] with the slope limited."""
    size, rise = np.abs(values), slope * length
    crossing = np.full(len(values), np.nan)
    flips = np.flatnonzero(values[1:] * values[:-1] < 0)
    share = size[flips] / (size[flips] + size[flips + 1])
    crossing[flips] = length[flips] + share * np.diff(length)[flips]
    before = np.insert(crossing[:-1], 0, np.nan)
    least = np.minimum(size, slope * _away(before, crossing, length))
    least = np.minimum(np.minimum.accumulate(least - rise) + rise, np.minimum.accumulate((least + rise)[::-1])[::-1] - rise)
    return np.where(size - least > SAME, np.sign(values) * least, values)


def _away(before: Array, after: Array, length: Array) -> Array:
    """Path length (N,) from each point to the nearest zero: `before` and `after` (N,), those next to it on either side, NaN
    where there is none."""
    behind = np.maximum.accumulate(np.where(np.isnan(before), -np.inf, before))
    ahead = np.minimum.accumulate(np.where(np.isnan(after), np.inf, after)[::-1])[::-1]
    return np.minimum(length - behind, ahead - length)

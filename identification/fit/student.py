"""Student distributions: how rare it is to be as far off as a row is, in the tails that the other rows leave open."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from identification.common.tails import chi2_tail, f_tail
from identification.fit.noise import NoiseModel, Weights
from identification.fit.noise_parts import VarianceComponents

Array = NDArray[np.float64]
# Degrees of freedom that are tried; the last is the normal distribution, the prior's favourite.
DEGREES = (3.0, 4.0, 6.0, 10.0, 20.0, 50.0, np.inf)
# How often each doubles the heaviness of a distribution that is as good as normal.
DOUBLINGS = np.log2(100.0 / np.minimum(DEGREES, 100.0))
# What a doubling costs, in ln, where a row may be called bad: sensors that now and then jump are no rarity.
OPEN = 0.5


def distances(
    model: NoiseModel, components: VarianceComponents, weights: Weights, residual: Array
) -> tuple[Array, NDArray[np.int_]]:
    """Squared distance (n,) of each row's residual (n, 3), what its visit shares taken out, in its own noise, and the count of
    its components."""
    own = np.where(model.measured, residual - weights.shared(residual[:, :, None])[:, :, 0], 0.0)
    return np.einsum("ni,nij,nj->n", own, model.of_rows_alone(components), own), model.measured.sum(axis=1)


def probability_beyond(squared: float, components: int, distance: Array, count: NDArray[np.int_]) -> float:
    """That a row of so many components is as far off as this squared distance, or farther, where others are at `distance` (n,),
    of `count` components: over all degrees of freedom that these leave open, beforehand each doubling of heaviness as much less
    likely as OPEN says."""
    value, scale = _tried(distance, count)
    value = value - OPEN * DOUBLINGS
    weight = np.exp(value - value.max())
    beyond = [chi2_tail(squared / s, components) if np.isinf(degrees) else f_tail(squared / s / components, components, degrees)
              for degrees, s in zip(DEGREES, scale, strict=True)]
    return float(weight @ beyond / weight.sum())


def _tried(distance: Array, count: NDArray[np.int_]) -> tuple[Array, Array]:
    """ln likelihood of each of DEGREES and its best scale."""
    scale = _student_scales(distance, count)
    heavy = _student_log_density(distance / scale[:-1, None], count, np.array(DEGREES[:-1])[:, None])
    density = np.concatenate([heavy, _student_log_density(distance / scale[-1], count, np.inf)[None]])
    return np.sum(density - 0.5 * count * np.log(scale)[:, None], axis=1), scale


def _student_scales(distance: Array, count: NDArray[np.int_]) -> Array:
    """Common factor on the variances that fits best with each of DEGREES, by fixed-point iteration."""
    total, degrees, scale = np.sum(count), np.array(DEGREES[:-1])[:, None], np.ones((len(DEGREES) - 1, 1))
    weighted = (degrees + count) * distance
    for _ in range(30):
        scale = np.maximum(np.sum(weighted / (degrees + distance / scale), axis=1, keepdims=True) / total, 1e-12)
    # Of the normal distribution every row weighs the same.
    return np.append(scale, max(float(np.sum(distance) / total), 1e-12))


def _student_log_density(distance: Array, count: NDArray[np.int_], degrees: float | Array) -> Array:
    """ln density of multivariate Student (normal where degrees is infinite) at a squared distance (..., n)."""
    from scipy.special import gammaln

    if np.all(np.isinf(degrees)):
        return np.asarray(-0.5 * distance - 0.5 * count * np.log(2 * np.pi))
    return np.asarray(gammaln(0.5 * (degrees + count)) - gammaln(0.5 * degrees) - 0.5 * count * np.log(degrees * np.pi)
                      - 0.5 * (degrees + count) * np.log1p(distance / degrees))

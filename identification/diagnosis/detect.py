"""Is there anything wrong at all? The largest score over the dictionary and over patterns no cause is needed for, with its
probability by parametric bootstrap under the fitted noise (docs/effects.md, steps 2 and 4).

Replicates are drawn from the fitted three-part noise, its sizes drawn from their own posterior, and scored with the same
weights; each is divided by its own residual variance, as the data's is.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from identification.diagnosis.dictionary import Dictionary
from identification.diagnosis.patterns import Pattern
from identification.diagnosis.projection import Base, information_blocks
from identification.fit.noise import NoiseModel, NoiseSize

Array = NDArray[np.float64]
REPLICATES = 199
# ln probabilities below this are all the same to a bootstrap of a few hundred.
SMALLEST = -700.0


@dataclass(frozen=True, eq=False)
class Detection:
    """p_value: family-wise, resolution: the smallest it can be. entries, patterns: surprise of each,
    -log10 of its own probability; critical: the surprise that 5 % of the replicates reach."""

    p_value: float
    resolution: float
    entries: Array
    patterns: dict[str, float]
    critical: float

    @property
    def seen_patterns(self) -> tuple[str, ...]:
        """The patterns that 5 % of the replicates would not show, the clearest first."""
        order = sorted(self.patterns, key=lambda name: -self.patterns[name])
        return tuple(name for name in order if self.patterns[name] >= self.critical)


def detect(
    base: Base, words: Dictionary, patterns: tuple[Pattern, ...], noise: NoiseModel, size: NoiseSize, size_spread: Array,
    row_weight: Array, rng: np.random.Generator, replicates: int = REPLICATES,
) -> Detection:
    """Scores of the data against those of replicates of the fitted model. size_spread (3, 3): covariance of the ln sizes."""
    drawn = draw_noise(noise, size, size_spread, row_weight, rng, replicates)
    # The data themselves are the first column.
    residual = np.concatenate([base.residual[:, :, None], drawn], axis=2)
    shift = np.zeros((base.design.shape[2], replicates + 1))
    shift[:, 0] = base.shift
    weighted = base.weights.apply(residual).reshape(-1, replicates + 1)
    pulled = base.design.reshape(-1, base.design.shape[2]).T @ weighted + base.precision @ shift
    step = base.inverse @ pulled
    readings = int(noise.measured.sum())
    quadratic = np.sum(residual.reshape(-1, replicates + 1) * weighted, axis=0) - np.sum(pulled * step, axis=0)
    quadratic[0] += float(base.shift @ base.precision @ base.shift)
    variance = np.maximum(quadratic, 1e-12) / max(readings - base.design.shape[2], 1)
    entries = entry_surprise(base, words, weighted, step, variance)
    left = weighted - base.weighted_design.reshape(-1, base.design.shape[2]) @ step
    observed_patterns = np.array([pattern.surprise(base, left, variance) for pattern in patterns]).reshape(len(patterns), -1)
    total = np.maximum(entries.max(axis=0, initial=0.0), observed_patterns.max(axis=0, initial=0.0))
    p_value = (1 + int(np.sum(total[1:] >= total[0]))) / (replicates + 1)
    named = {pattern.name: float(value) for pattern, value in zip(patterns, observed_patterns[:, 0], strict=True)}
    return Detection(p_value, 1 / (replicates + 1), entries[:, 0], named, float(np.quantile(total[1:], 0.95)))


def entry_surprise(base: Base, words: Dictionary, weighted: Array, step: Array, variance: Array) -> Array:
    """-log10 of each entry's own probability (entries, B): chi-squared of its best signature, times how many it has."""
    from scipy.stats import chi2

    n, _, count, width = words.columns.shape
    flat = words.columns.reshape(-1, count * width)
    b = flat.T @ weighted - base.cross(words.columns.reshape(n, 3, -1)).T @ step
    b = b.reshape(count, width, -1)
    inverse = np.linalg.inv(information_blocks(base, words) + 1e-9 * np.eye(width))
    coefficients = inverse @ b
    ratio = np.sum(b * coefficients, axis=1) / variance
    ratio[words.positive] *= coefficients[words.positive, 0] > 0
    halved = np.where(words.positive, np.log(0.5), 0.0)
    log_p = np.maximum(chi2.logsf(ratio, words.widths[:, None]) + halved[:, None], SMALLEST)
    result = np.empty((len(words.entries), ratio.shape[1]))
    for k, entry in enumerate(words.entries):
        members = log_p[entry.signatures.start: entry.signatures.stop]
        tried = max(1.0, 0.5 * len(entry.signatures))
        result[k] = -(members.min(axis=0) + np.log(tried)) / np.log(10)
    return np.maximum(result, 0.0)


def draw_noise(
    noise: NoiseModel, size: NoiseSize, size_spread: Array, row_weight: Array, rng: np.random.Generator, count: int
) -> Array:
    """Noise (n, 3, count) in the model's coordinates, each draw with sizes of their own."""
    logs = rng.multivariate_normal(size.logs, size_spread, count, method="cholesky")
    sensor, force, offset = np.exp(np.clip(logs, size.logs - 2.5, size.logs + 1.5)).T
    own = sensor**2 + force**2 * np.where(noise.measured, noise.force, 0.0)[:, :, None]
    drawn = np.sqrt(own / row_weight[:, None, None]) * rng.standard_normal((*noise.measured.shape, count))
    seat = noise.offset[:, None] * offset * rng.standard_normal((noise.visits, 3, count))
    return np.asarray(np.where(noise.measured[:, :, None], drawn + noise.rotation @ seat[noise.visit], 0.0))



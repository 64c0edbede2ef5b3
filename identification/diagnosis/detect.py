"""Is there anything wrong at all? The largest score over the dictionary and over patterns no cause is needed for, with its
probability by parametric bootstrap under the fitted noise (docs/effects.md, steps 2 and 4).

Replicates are drawn from the fitted noise, its variance components drawn from their own posterior, and as many over all ways in
which the parts may be there that need not be (fit/optional_parts.py): forces that are set up a little otherwise at each visit,
too little for the rows to ask for that part, had been an alarm. All are scored with the same weights; each is divided by its
own residual variance, as the data's is.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from identification.common.tails import chi2_surprise
from identification.diagnosis.dictionary import Dictionary, dictionary_of
from identification.diagnosis.patterns import Pattern, patterns_of
from identification.diagnosis.projection import Base, information_blocks, room
from identification.diagnosis.replicates import AveragedNoise, Drawn, FittedNoise
from identification.fit.discrepancy import other_ways
from identification.fit.posterior import Posterior
from identification.fit.sag import sag_columns
from identification.model.effects import Effect

Array = NDArray[np.float64]
REPLICATES = 199
# Between these probabilities so many replicates do not tell on which side of 5 %, of 2.5 % or of 0.5 % the data lie; so many
# times as many do.
OPEN = (0.005, 0.09)
MORE = 5


@dataclass(frozen=True, eq=False)
class Detection:
    """p_value: family-wise, resolution: the smallest it can be. patterns: surprise of each, -log10 of its own probability;
    critical: the surprise that 5 % of the replicates reach."""

    p_value: float
    resolution: float
    patterns: dict[str, float]
    critical: float

    @property
    def seen_patterns(self) -> tuple[str, ...]:
        """The patterns that 5 % of the replicates would not show, the clearest first."""
        order = sorted(self.patterns, key=lambda name: -self.patterns[name])
        return tuple(name for name in order if self.patterns[name] >= self.critical)


def goodness_of_fit(
    fitted: Posterior, catalogue: dict[str, Effect], rng: np.random.Generator, replicates: int = REPLICATES
) -> Detection:
    """Whether the fitted model explains its rows, the laws of its terms free within their shapes."""
    state, at = fitted.load_state, fitted.at_map
    dictionary = dictionary_of(state, at.noise, catalogue)
    patterns = patterns_of(state, at.noise)
    noises = (FittedNoise.of(fitted), AveragedNoise.of(fitted))
    return detect(base_of(fitted, dictionary), dictionary, patterns, noises, rng, replicates)


def base_of(fitted: Posterior, dictionary: Dictionary) -> Base:
    """The fitted model linearised; free beside it what the arm's unknown weight may do, and the laws of its terms within their
    shapes."""
    state, at, precision = fitted.load_state, fitted.at_map, fitted.prior.precision(fitted.map)
    shift = np.asarray(-np.linalg.solve(precision, fitted.prior.gradient(fitted.map)))
    base = Base(at.design, at.residual, fitted.weights, precision, shift).extended(sag_columns(state, at.noise))
    for term, values in zip(fitted.terms, fitted.term_values, strict=True):
        entry = next(k for k, entry in enumerate(dictionary.entries) if entry.label == term.label)
        shapes = dictionary.shapes(entry, dictionary.nearest(entry, term.effect, values))
        base = base.extended(room(term.typical_sizes(values)) * shapes)
        base = base.freed(dictionary.undecided(state, term.joint), state.visit)
    found = (replace(term, start=values) for term, values in zip(fitted.terms, fitted.term_values, strict=True))
    return base.unsure_of(other_ways(state, at.noise, found))


def detect(
    base: Base, dictionary: Dictionary, patterns: tuple[Pattern, ...], noises: Sequence[Drawn], rng: np.random.Generator,
    replicates: int = REPLICATES,
) -> Detection:
    """Scores of the data against those of so many replicates of the fitted model under each of the noises: they are no rarer
    than under any. Where so many leave open on which side of a limit that is, `MORE` times as many are drawn."""
    drawn = np.zeros((len(noises), 0))
    for _ in range(MORE):
        total, of_patterns = surprise(base, dictionary, patterns, noises[0].readings,
                                      [noise.draw(rng, replicates) for noise in noises])
        drawn = np.concatenate([drawn, total[1:].reshape(len(noises), replicates)], axis=1)
        p_value = (1 + int(np.sum(drawn >= total[0], axis=1).max())) / (drawn.shape[1] + 1)
        if not OPEN[0] < p_value < OPEN[1]:
            break
    named = {pattern.name: float(value) for pattern, value in zip(patterns, of_patterns[:, 0], strict=True)}
    return Detection(p_value, 1 / (drawn.shape[1] + 1), named, float(np.quantile(drawn, 0.95, axis=1).max()))


def surprise(
    base: Base, dictionary: Dictionary, patterns: tuple[Pattern, ...], readings: int, replicates: Sequence[Array],
) -> tuple[Array, Array]:
    """-log10 of the smallest probability among entries and patterns (1 + B,), and that of each pattern (P, 1 + B), of the data,
    which are so many readings, and of replicates (n, 3, B) in all."""
    residual = np.concatenate([base.residual[:, :, None], *replicates], axis=2)
    count = residual.shape[2]
    shift = np.zeros((base.design.shape[2], count))
    shift[:, 0] = base.shift
    weighted = base.weights.apply(residual).reshape(-1, count)
    pulled = base.design.reshape(-1, base.design.shape[2]).T @ weighted + base.precision @ shift
    step = base.inverse @ pulled
    quadratic = np.sum(residual.reshape(-1, count) * weighted, axis=0) - np.sum(pulled * step, axis=0)
    quadratic[0] += float(base.shift @ base.precision @ base.shift)
    variance = np.maximum(quadratic, 1e-12) / max(readings - base.free, 1)
    entries = entry_surprise(base, dictionary, weighted, step, variance)
    left = weighted - base.weighted_design.reshape(-1, base.design.shape[2]) @ step
    of_patterns = np.array([pattern.surprise(base, left, variance) for pattern in patterns]).reshape(len(patterns), count)
    return np.maximum(entries.max(axis=0, initial=0.0), of_patterns.max(axis=0, initial=0.0)), of_patterns


def entry_surprise(base: Base, dictionary: Dictionary, weighted: Array, step: Array, variance: Array) -> Array:
    """-log10 of the smallest probability that an entry has by itself (kinds, B), of each kind of signature: chi-squared of the
    best one, times how many its entry has. A kind has as many coefficients and the same share in all its entries."""
    every = dictionary.columns.reshape(len(weighted), -1).T @ weighted - base.cross(dictionary.columns).T @ step
    blocks, share, result = information_blocks(base, dictionary), shares(dictionary), []
    for some, places in dictionary.alike:
        b, width, positive = every[places], places.shape[1], dictionary.positive[some]
        coefficients = np.linalg.inv(blocks[some, :width, :width] + 1e-9 * np.eye(width)) @ b
        ratio = np.einsum("sib,sib->sb", b, coefficients) / variance
        ratio[positive] *= coefficients[positive, 0] > 0
        for each in np.unique(share[some]):
            # Of signatures alike the largest ratio is the least probable: one tail, which costs more than all before it.
            surprise = chi2_surprise(ratio[share[some] == each].max(axis=0), width)
            result.append(np.maximum(surprise - np.log(each) / np.log(10), 0.0))
    return np.array(result).reshape(len(result), weighted.shape[1])


def shares(dictionary: Dictionary) -> Array:
    """By what a signature's own probability (S,) is multiplied: how many its entry has, half where its sign is known."""
    tried = np.array([max(1.0, 0.5 * len(entry.signatures)) for entry in dictionary.entries])
    return np.asarray(tried[dictionary.entry_of] * np.where(dictionary.positive, 0.5, 1.0))

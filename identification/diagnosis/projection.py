"""What the residual says of a signature once the stiffnesses are free: score, information, likelihood ratio, evidence.

Linearised about a fitted model, residual = D step + E a + noise, with the prior on the step: eliminating the step leaves

    b = E^T W r - E^T W D (D^T W D + P)^-1 (D^T W r + P shift),   G = E^T W E - E^T W D (D^T W D + P)^-1 D^T W E

for each signature E, W = Sigma^-1; the generalised likelihood ratio is b^T G^-1 b, the best coefficients G^-1 b. With a mixture
of normal priors on the coefficients (half of each where the sign is known) the evidence against no effect is exact.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from identification.diagnosis.dictionary import WIDEST, Dictionary
from identification.model.kinematics import chunks

Array = NDArray[np.float64]
# Prior standard deviation of a coefficient in typical sizes: effects between a half and twice their typical size are the rule.
PRIOR_SIZES = 1.5
# Some are far larger: so often (ln) the standard deviation is so many times that.
LARGER = ((np.log(0.9), 1.0), (np.log(0.08), 4.0), (np.log(0.02), 16.0))
# Information under which an effect of its typical size stays far inside the noise: it can be neither named nor ruled out.
INVISIBLE = 0.25
# Signatures that are weighted at once.
AT_ONCE = 64


class Weighing(Protocol):
    """Sigma^-1 of the rows."""

    def apply(self, columns: Array) -> Array:
        """Sigma^-1 columns (n, 3, q) in the noise's coordinates."""
        ...

    def freed(self, moved: Array) -> Weighing:
        """Where each visit, by itself, may move the tool by displacements (N, 3, p) [m] too, 1 sigma each."""
        ...


@dataclass(frozen=True, eq=False)
class Base:
    """The fitted model the signatures come on top of, linearised: design (n, 3, q), residual (n, 3) in the noise's coordinates,
    prior precision (q, q) and shift (q,) of the step. by_visit: how many coefficients more the weights have been freed of."""

    design: Array
    residual: Array
    weights: Weighing
    precision: Array
    shift: Array
    by_visit: int = 0

    @property
    def free(self) -> int:
        """How many coefficients are free."""
        return int(self.design.shape[2]) + self.by_visit

    @cached_property
    def weighted_design(self) -> Array:
        """Sigma^-1 D (n, 3, q)."""
        return self.weights.apply(self.design)

    @cached_property
    def inverse(self) -> Array:
        """(D^T W D + P)^-1 (q, q)."""
        return np.asarray(np.linalg.inv(_flat(self.design).T @ _flat(self.weighted_design) + self.precision), dtype=float)

    def extended(self, columns: Array) -> Base:
        """The model with further columns (n, 3, p), in typical sizes, whose coefficients are free within their prior."""
        more = columns.shape[2]
        if not more:
            return self
        size = len(self.precision)
        precision = np.zeros((size + more, size + more))
        precision[:size, :size] = self.precision
        precision[size:, size:] = np.eye(more) / PRIOR_SIZES**2
        larger = Base(np.concatenate([self.design, columns], axis=2), self.residual, self.weights, precision,
                      np.concatenate([self.shift, np.zeros(more)]), self.by_visit)
        vars(larger)["weighted_design"] = np.concatenate([self.weighted_design, self.weights.apply(columns)], axis=2)
        return larger

    def unsure_of(self, columns: Array) -> Base:
        """The model with further columns (n, 3, p) that are 1 sigma each."""
        return self.extended(columns / PRIOR_SIZES)

    def freed(self, moved: Array, visit: NDArray[np.intp]) -> Base:
        """The model with displacements moved (N, 3, p) [m], in typical sizes, of which each visit (N,) has coefficients of its
        own, free within their prior: as part of the noise, since as columns they would be as many as the visits."""
        count = moved.shape[2] * len(np.unique(visit[np.any(moved, axis=(1, 2))]))
        return replace(self, weights=self.weights.freed(PRIOR_SIZES * moved), by_visit=self.by_visit + count) if count else self

    def cross(self, columns: Array) -> Array:
        """D^T W E (q, m) for columns (n, 3, m)."""
        return np.asarray(_flat(self.weighted_design).T @ _flat(columns))

    def score(self, columns: Array, residual: Array, shift: Array | None = None, cross: Array | None = None) -> Array:
        """b (m, B) for columns (n, 3, m) and residuals (n, 3, B); cross: that of the columns, where it is at hand."""
        weighted = _flat(self.weights.apply(residual))
        pulled = _flat(self.design).T @ weighted
        if shift is not None:
            pulled = pulled + (self.precision @ shift)[:, None]
        cross = self.cross(columns) if cross is None else cross
        return np.asarray(_flat(columns).T @ weighted - cross.T @ (self.inverse @ pulled))

    def gram(self, columns: Array) -> Array:
        """G (m, m) for columns (n, 3, m)."""
        cross = self.cross(columns)
        return np.asarray(_flat(columns).T @ _flat(self.weights.apply(columns)) - cross.T @ self.inverse @ cross)

    def step(self, residual: Array) -> Array:
        """Best step (q,) for a residual (n, 3)."""
        pulled = _flat(self.design).T @ self.weights.apply(residual[:, :, None]).reshape(-1)
        return np.asarray(self.inverse @ (pulled + self.precision @ self.shift))


def _flat(columns: Array) -> Array:
    return columns.reshape(-1, columns.shape[2])


@dataclass(frozen=True, eq=False)
class Scores:
    """Of all S signatures: evidence (S,), ln of the Bayes factor against no effect; visible (S,), whether the rows could show
    it at its typical size; ratio (S,), the generalised likelihood ratio, zero where the best coefficient has the wrong sign;
    size (S,), the first best coefficient, without its sign."""

    evidence: Array
    ratio: Array
    visible: NDArray[np.bool_]
    size: Array


def scores(base: Base, dictionary: Dictionary, grams: Array | None = None) -> Scores:
    """The residual of the fitted model against every signature; grams (S, 6, 6): `own_grams`, where they are at hand."""
    cross, count = base.cross(dictionary.columns), len(dictionary.widths)
    every = base.score(dictionary.columns, base.residual[:, :, None], base.shift, cross)[:, 0]
    blocks = _blocks(base, dictionary, cross, own_grams(base.weights, dictionary) if grams is None else grams)
    (evident, ratio, size), visible = np.empty((3, count)), np.empty(count, dtype=bool)
    ridge = 1e-9 * np.einsum("sii->s", blocks) + 1e-12
    for some, places in dictionary.alike:
        b, width, positive = every[places], places.shape[1], dictionary.positive[some]
        information = blocks[some, :width, :width]
        best = np.linalg.solve(information + ridge[some, None, None] * np.eye(width), b[..., None])[..., 0]
        ratio[some] = np.where(positive & (best[:, 0] < 0), 0.0, np.sum(b * best, axis=1))
        visible[some] = np.einsum("sii->si", information).max(axis=1) > INVISIBLE
        evident[some], size[some] = evidence(information, b, positive), np.abs(best[:, 0])
    return Scores(evident, ratio, visible, size)


def own_grams(weights: Weighing, dictionary: Dictionary) -> Array:
    """E^T W E (S, 6, 6) of every signature: whatever the model beside it, so that a search makes them once."""
    grams = np.zeros((len(dictionary.widths), WIDEST, WIDEST))
    for alike, places in dictionary.alike:
        width = places.shape[1]
        for part in chunks(len(alike), AT_ONCE):
            some, columns = alike[part], dictionary.columns[:, :, places[part].ravel()]
            own, weighted = (each.reshape(-1, len(some), width) for each in (columns, weights.apply(columns)))
            grams[some, :width, :width] = own.transpose(1, 2, 0) @ weighted.transpose(1, 0, 2)
    return grams


def information_blocks(base: Base, dictionary: Dictionary) -> Array:
    """G (S, 6, 6) of every signature by itself; the identity where a coefficient is not used."""
    return _blocks(base, dictionary, base.cross(dictionary.columns), own_grams(base.weights, dictionary))


def _blocks(base: Base, dictionary: Dictionary, cross: Array, grams: Array) -> Array:
    own, taken = np.repeat(np.eye(WIDEST)[None], len(grams), axis=0), base.inverse @ cross
    for some, places in dictionary.alike:
        width = places.shape[1]
        own[some, :width, :width] = grams[some, :width, :width] - (
            cross[:, places].transpose(1, 2, 0) @ taken[:, places].transpose(1, 0, 2))
    return own


def room(size: float) -> float:
    """By what the columns of an effect of this many typical sizes are multiplied, so that its prior takes it in."""
    return max(1.0, size / PRIOR_SIZES)


def evidence(information: Array, b: Array, positive: NDArray[np.bool_]) -> Array:
    """ln Bayes factor (S,) of an effect against none, its coefficients ~ N(0, PRIOR_SIZES^2), or now and then far larger
    (LARGER); information (S, p, p), score b (S, p); positive: half of these normals."""
    each = [share + _of_normal(information, b, positive, PRIOR_SIZES * times) for share, times in LARGER]
    return np.asarray(np.logaddexp.reduce(each))


def _of_normal(information: Array, b: Array, positive: NDArray[np.bool_], deviation: float) -> Array:
    from scipy.special import log_ndtr

    width = b.shape[1]
    precision = information + np.eye(width) / deviation**2
    mean = np.linalg.solve(precision, b[..., None])[..., 0]
    value = 0.5 * np.sum(b * mean, axis=1) - 0.5 * np.linalg.slogdet(precision)[1] - width * np.log(deviation)
    # Where next to no noise is left, numbers cancel to less than nothing.
    spread = np.sqrt(np.maximum(np.linalg.inv(precision)[:, 0, 0], 1e-300))
    return np.asarray(value + np.where(positive, np.log(2.0) + log_ndtr(mean[:, 0] / spread), 0.0))

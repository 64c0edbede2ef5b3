"""Which causes, alone or together: the evidence of every effect, of pairs and of triples, seen from a fitted model.

Beam search over sets of effects: the evidence of a set and one more effect is that of the set plus the new one's given the
set, so each level takes one scan of the dictionary for each set of the beam. The prior of a set depends on its size alone.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import comb

import numpy as np
from numpy.typing import NDArray

from identification.diagnosis.dictionary import Dictionary, dictionary
from identification.diagnosis.projection import Base, scores
from identification.diagnosis.sag import sag_columns
from identification.fit.fitted_model import Term, response, situation_of
from identification.fit.noise import NoiseModel, Weights
from identification.fit.posterior import Posterior
from identification.fit.priors import PriorModel
from identification.measurements import Measurements
from identification.model.cell import Cell
from identification.model.effects import Effect
from identification.model.load_state import LoadState

Array = NDArray[np.float64]
# Sets of effects that are carried from one level to the next.
BEAM = 4
# How often one, two and three causes act at once, before the data.
PRIOR_OF_SIZE = (0.9, 0.09, 0.01)


@dataclass(frozen=True, eq=False)
class Hypothesis:
    """A set of effects: entries of the dictionary in the order they were taken, and the best signature and coefficients
    (3,), typical sizes, of each. log_evidence: against the plain model; probability: among all that were looked at."""

    entries: tuple[int, ...]
    signatures: tuple[int, ...]
    log_evidence: float
    probability: float = 0.0

    @property
    def key(self) -> frozenset[int]:
        """Whatever the order."""
        return frozenset(self.entries)


@dataclass(frozen=True, eq=False)
class Survey:
    """All hypotheses, the likeliest first, as seen from one fitted model; base: the plain model linearised there."""

    where: LoadState
    words: Dictionary
    base: Base
    hypotheses: tuple[Hypothesis, ...]

    def terms(self, hypothesis: Hypothesis) -> tuple[Term, ...]:
        """The effects in force with their best coefficients, as a start for the fit."""
        columns = [_columns(self.words, signature) for signature in hypothesis.signatures]
        base = self.base.extended(np.concatenate(columns, axis=2))
        step = base.step(base.residual)[len(self.base.precision):]
        found, place = [], 0
        for signature, column in zip(hypothesis.signatures, columns, strict=True):
            width = column.shape[2]
            coefficients = step[place: place + width]
            if self.words.positive[signature]:
                coefficients = np.maximum(coefficients, 0.01)
            found.append(self.words.term(self.where, signature, np.pad(coefficients, (0, 3 - width))))
            place += width
        return tuple(found)


def base_at(
    cell: Cell, rows: Measurements, prior: PriorModel, log_compliance: Array, noise: NoiseModel, weights: Weights
) -> Base:
    """The plain model linearised at ln c (6,)."""
    position, slope = response(cell, rows, log_compliance)
    residual = np.einsum("nij,nj->ni", noise.rotation, np.nan_to_num(rows.deflection) - position)
    precision = prior.precision(log_compliance)
    shift = np.asarray(-np.linalg.solve(precision, prior.gradient(log_compliance)))
    return Base(noise.rotation @ slope, residual, weights, precision, shift)


def survey(
    cell: Cell, rows: Measurements, prior: PriorModel, fitted: Posterior, catalogue: dict[str, Effect], levels: int
) -> Survey:
    """All single effects, the pairs and triples that the beam reaches; levels: how many effects at most together.

    fitted: the model whose stiffnesses, noise sizes and row weights are taken. prior: of the plain model.
    """
    where = situation_of(cell, rows, np.exp(fitted.map[:6]))
    noise, weights = fitted.at_map.noise, fitted.at_map.weights
    words = dictionary(where, noise, catalogue)
    base = base_at(cell, rows, prior, fitted.map[:6], noise, weights).extended(sag_columns(where, noise))
    found: dict[frozenset[int], Hypothesis] = {}
    beam = [Hypothesis((), (), 0.0)]
    for _ in range(levels):
        grown: dict[frozenset[int], Hypothesis] = {}
        for hypothesis in beam:
            for one in _grown(base, words, hypothesis, where, noise):
                if one.key not in grown or grown[one.key].log_evidence < one.log_evidence:
                    grown[one.key] = one
        found |= grown
        beam = sorted(grown.values(), key=lambda one: -one.log_evidence)[:BEAM]
    return Survey(where, words, base, _weighed(list(found.values()), len(words.entries)))


def _grown(
    base: Base, words: Dictionary, hypothesis: Hypothesis, where: LoadState, noise: NoiseModel
) -> list[Hypothesis]:
    """The hypothesis with each further entry, which must explain what no shape of the others' laws can."""
    if hypothesis.signatures:
        base = base.extended(np.concatenate([words.shapes(entry, signature) for entry, signature in zip(
            hypothesis.entries, hypothesis.signatures, strict=True)], axis=2))
    found, visible = _without_doubt(base, words, where, noise)
    grown = []
    # Two laws of one gear are one law that is not exactly the dictionary's.
    geared = {words.entries[k].joint for k in hypothesis.entries if words.entries[k].effect.gear_law}
    for k, entry in enumerate(words.entries):
        if k in hypothesis.entries or (entry.effect.gear_law and entry.joint in geared):
            continue
        members = np.arange(entry.signatures.start, entry.signatures.stop)
        if not visible[members].any():
            continue
        value, best = _entry_evidence(found[members], members)
        grown.append(Hypothesis((*hypothesis.entries, k), (*hypothesis.signatures, best), hypothesis.log_evidence + value))
    return grown


def _without_doubt(
    base: Base, words: Dictionary, where: LoadState, noise: NoiseModel
) -> tuple[Array, NDArray[np.bool_]]:
    """Evidence (S,) of every signature, and whether these rows could show it at its typical size (S,).

    The laws of one gear share out what they have together by the rows in which no force error decides on which side of its
    play the gear rests: those rows tell play from friction by chance alone.
    """
    told = scores(base, words)
    found, visible = told.evidence, told.visible
    for joint in range(1, 7):
        undecided = words.undecided(where, noise, joint)
        if not undecided.shape[2]:
            continue
        entries = [k for k, entry in enumerate(words.entries) if entry.joint == joint and entry.effect.gear_law]
        signatures = [s for k in entries for s in words.entries[k].signatures]
        share = np.concatenate([np.full(len(words.entries[k].signatures), -np.log(len(words.entries[k].signatures)))
                                for k in entries])
        decided = scores(base.extended(undecided), words.part(entries)).evidence
        found[signatures] = decided + np.logaddexp.reduce(found[signatures] + share) - np.logaddexp.reduce(decided + share)
    return found, visible


def _entry_evidence(values: Array, members: NDArray[np.intp]) -> tuple[float, int]:
    """ln of the mean Bayes factor of an entry's signatures, and the best of them."""
    top = float(values.max())
    return top + float(np.log(np.mean(np.exp(values - top)))), int(members[np.argmax(values)])


def _columns(words: Dictionary, signature: int) -> Array:
    """A signature's columns (n, 3, p)."""
    return words.columns[:, :, signature, : words.widths[signature]]


def _weighed(found: list[Hypothesis], entries: int) -> tuple[Hypothesis, ...]:
    """With probabilities, the likeliest first."""
    if not found:
        return ()
    logs = np.array([one.log_evidence + np.log(PRIOR_OF_SIZE[len(one.entries) - 1] / comb(entries, len(one.entries)))
                     for one in found])
    weight = np.exp(logs - logs.max())
    weight /= weight.sum()
    order = np.argsort(-logs)
    return tuple(Hypothesis(found[k].entries, found[k].signatures, found[k].log_evidence, float(weight[k])) for k in order)

"""Which causes, alone or together: the evidence of every effect, of pairs and of triples, seen from a fitted model.

Beam search over sets of effects: the evidence of a set and one more effect is that of the set plus the new one's given the
set, so each level takes one scan of the dictionary for each set of the beam. The prior of a set depends on its size alone.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache, cached_property
from math import comb
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from identification.diagnosis.dictionary import Dictionary, Entry, dictionary_of
from identification.diagnosis.projection import PRIOR_SIZES, Base, Weighing, own_grams, room, scores
from identification.fit.discrepancy import other_ways
from identification.fit.fitted_model import Term, response
from identification.fit.load_test import LoadTest
from identification.fit.noise import NoiseModel, Weights
from identification.fit.posterior import Posterior
from identification.fit.sag import sag_columns
from identification.fit.sight import Sight
from identification.model.effects import Effect
from identification.model.load_state import LoadState

Array = NDArray[np.float64]
# Sets of effects that are carried from one level to the next.
BEAM = 4
# How often one, two and three causes act at once, before the data.
PRIOR_OF_SIZE = (0.9, 0.09, 0.01)
# How far a gear's law may be off the dictionary's, as a share of its size: laws of real gears differ by some ten per cent
# (discrepancy.py).
LAW_SHARE = 0.3
# Of what laws have in common, what is under this share of the largest part is left out.
ALIKE = 1e-3
# ln Bayes factor of the best law of a gear under which it does not matter how its laws share it out.
WORTH_SHARING = 1.0
# Up to so many rows what is seen from a fitted model is kept as long as that: those who look for causes begin at the same one.
ROWS_KEPT = 1000


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

    state: LoadState
    dictionary: Dictionary
    base: Base
    hypotheses: tuple[Hypothesis, ...]

    def name(self, hypothesis: Hypothesis) -> str:
        """The labels of its effects."""
        return " + ".join(self.dictionary.entries[k].label for k in hypothesis.entries)

    def without(self, keys: set[frozenset[int]], beyond: frozenset[int] | None = None) -> Survey:
        """All but the hypotheses of these keys, and those that have all of `beyond` among their causes."""
        kept = [hypothesis for hypothesis in self.hypotheses
                if hypothesis.key not in keys and (beyond is None or not beyond <= hypothesis.key)]
        if len(kept) == len(self.hypotheses):
            return self
        return replace(self, hypotheses=_weighed(kept, len(self.dictionary.entries)))

    def instead(self, others: dict[frozenset[int], Hypothesis]) -> Survey:
        """With these hypotheses in the place of those of their keys, if any."""
        kept = [hypothesis for hypothesis in self.hypotheses if hypothesis.key not in others]
        return replace(self, hypotheses=_weighed([*kept, *others.values()], len(self.dictionary.entries)))

    def unweighed(self, hypothesis: Hypothesis) -> Hypothesis | None:
        """The hypothesis with the best signatures of laws that no weight presses on, where one that nobody stated presses on
        one of its gears; None where there is none."""
        dictionary, signatures = self.dictionary, list(hypothesis.signatures)
        for place, (k, signature) in enumerate(zip(hypothesis.entries, hypothesis.signatures, strict=True)):
            first, free = dictionary.entries[k].signatures.start, dictionary.unweighed(dictionary.entries[k])
            if not dictionary.signatures[signature].weight or not free:
                continue
            others = [dictionary.of(s) for at, s in enumerate(signatures) if at != place]
            base = self.base.extended(np.concatenate(others, axis=2)) if others else self.base
            laws = dictionary.part([k])
            evidence = scores(base, laws, own_grams(base.weights, laws)).evidence
            signatures[place] = max(free, key=lambda s: evidence[s - first])
        return replace(hypothesis, signatures=tuple(signatures)) if tuple(signatures) != hypothesis.signatures else None

    def terms(self, hypothesis: Hypothesis) -> tuple[Term, ...]:
        """The effects in force with their best coefficients, as a start for the fit."""
        columns = [self.dictionary.of(signature) for signature in hypothesis.signatures]
        base = self.base.extended(np.concatenate(columns, axis=2))
        step = base.step(base.residual)[len(self.base.precision):]
        terms, place = [], 0
        for signature, column in zip(hypothesis.signatures, columns, strict=True):
            width = column.shape[2]
            coefficients = step[place: place + width]
            if self.dictionary.positive[signature]:
                coefficients = np.maximum(coefficients, 0.01)
            terms.append(self.dictionary.term(self.state, signature, coefficients))
            place += width
        return tuple(terms)


def base_at(data: LoadTest, log_compliance: Array, noise: NoiseModel, weights: Weights) -> Base:
    """The plain model linearised at ln c (6,)."""
    position, slope = response(data, log_compliance)
    residual = np.einsum("nij,nj->ni", noise.whitening, np.nan_to_num(data.rows.deflection) - position)
    precision = data.prior.precision(log_compliance)
    shift = np.asarray(-np.linalg.solve(precision, data.prior.gradient(log_compliance)))
    return Base(noise.whitening @ slope, residual, weights, precision, shift)


_KEPT: WeakKeyDictionary[Posterior, list[tuple[dict[str, Effect], int, Survey]]] = WeakKeyDictionary()


def survey(fitted: Posterior, catalogue: dict[str, Effect], levels: int) -> Survey:
    """All single effects, the pairs and triples that the beam reaches; levels: how many effects at most together.

    fitted: the model whose stiffnesses, variance components and row weights are taken.
    """
    kept = _KEPT.setdefault(fitted, [])
    for of, size, known in kept:
        if of is catalogue and size == levels:
            return known
    state, noise = fitted.load_state, fitted.at_map.noise
    base = base_at(fitted.data, fitted.log_compliance, noise, fitted.weights).extended(sag_columns(state, noise))
    seen = searched(base, dictionary_of(state, noise, catalogue), state, noise, levels)
    if len(state) <= ROWS_KEPT:
        kept.append((catalogue, levels, seen))
    return seen


def searched(base: Base, dictionary: Dictionary, state: LoadState, sight: Sight, levels: int) -> Survey:
    """All single effects of a dictionary beside a model, the pairs and triples that the beam reaches; state: the arm in the
    rows that `sight` sees."""
    scan = _Scan(base, dictionary, state, sight)
    grown_from: Callable[[Hypothesis], list[Hypothesis]] = cache(scan.grown)
    every: dict[frozenset[int], Hypothesis] = {}
    beam = [Hypothesis((), (), 0.0)]
    alone: dict[int, float] = {}
    for _ in range(levels):
        grown: dict[frozenset[int], Hypothesis] = {}
        for hypothesis in beam:
            for larger in grown_from(hypothesis):
                # The further effect of a set is the one that has least by itself: taken first, it would find what the other
                # does by a law a little different, and be a second cause of it.
                other = grown.get(larger.key)
                if other is None or alone[larger.entries[-1]] < alone[other.entries[-1]]:
                    grown[larger.key] = larger
        grown |= _exchanged(grown, every, grown_from)
        alone = alone or {hypothesis.entries[0]: hypothesis.log_evidence for hypothesis in grown.values()}
        every |= grown
        beam = sorted(grown.values(), key=lambda hypothesis: -hypothesis.log_evidence)[:BEAM]
    return Survey(state, dictionary, base, _weighed(list(every.values()), len(dictionary.entries)))


def _exchanged(
    grown: dict[frozenset[int], Hypothesis], smaller: dict[frozenset[int], Hypothesis],
    grown_from: Callable[[Hypothesis], list[Hypothesis]],
) -> dict[frozenset[int], Hypothesis]:
    """Sets that have one effect of the best set exchanged for another, where they are likelier than they were taken for: how
    much likelier than the best is told beside the effects that both have. Taken in another order each would be told beside
    another effect, whose law may take up more or less of it."""
    likelier: dict[frozenset[int], Hypothesis] = {}
    if not grown:
        return likelier
    best = max(grown.values(), key=lambda hypothesis: hypothesis.log_evidence)
    for entry in best.entries:
        rest = smaller.get(best.key - {entry})
        others = {larger.key: larger for larger in grown_from(rest)} if rest else {}
        if best.key not in others:
            continue
        for key, other in others.items():
            if key == best.key:
                # Its value is the one it has: the last digit would say in which order it was taken.
                continue
            value = best.log_evidence + other.log_evidence - others[best.key].log_evidence
            if all(value > each[key].log_evidence for each in (grown, likelier) if key in each):
                likelier[key] = replace(other, log_evidence=value)
    return likelier


@dataclass(frozen=True, eq=False)
class _Undecided:
    """The weights beside what a gear may do in the rows in which a force error decides it, of how many coefficients more, and
    the grams (S, 6, 6) of its laws' signatures with them."""

    weights: Weighing
    by_visit: int
    grams: Array

    def beside(self, base: Base) -> Base:
        """A model, with that free too."""
        return replace(base, weights=self.weights, by_visit=self.by_visit)


@dataclass(frozen=True, eq=False)
class _Scan:
    """The dictionary beside the plain model."""

    base: Base
    dictionary: Dictionary
    state: LoadState
    sight: Sight

    @cached_property
    def _unit_mixture(self) -> Callable[[int], Array]:
        """Of each joint, worked out once."""
        return cache(self._mixture_of_one)

    @cached_property
    def grams(self) -> Array:
        """Of every signature by itself (S, 6, 6)."""
        return own_grams(self.base.weights, self.dictionary)

    @cached_property
    def undecided(self) -> dict[int, _Undecided]:
        """Of each joint whose gear a force error decides in some of the rows."""
        found = {}
        for joint in range(1, 7):
            freed = self.base.freed(self.dictionary.undecided(self.state, joint), self.state.visit)
            if freed is not self.base:
                laws = self.dictionary.part(self.dictionary.gear_laws(joint))
                found[joint] = _Undecided(freed.weights, freed.by_visit, own_grams(freed.weights, laws))
        return found

    def grown(self, hypothesis: Hypothesis) -> list[Hypothesis]:
        """The hypothesis with each further entry, which must explain what no shape of the others' laws can."""
        base, dictionary, grams = self.base, self.dictionary, self.grams
        if hypothesis.signatures:
            sizes = self._sizes(hypothesis)
            base = self._as_told(hypothesis)
            grams = grams if base is self.base else own_grams(base.weights, dictionary)
            shapes = [room(float(np.linalg.norm(size))) * dictionary.shapes(entry, signature)
                      for entry, signature, size in zip(hypothesis.entries, hypothesis.signatures, sizes, strict=True)]
            shapes += [self._mixture(dictionary.entries[k].joint or 0, float(abs(size[0])) * dictionary.amplitude(signature))
                       for k, signature, size in zip(hypothesis.entries, hypothesis.signatures, sizes, strict=True)
                       if dictionary.entries[k].effect.law_family]
            base = base.extended(np.concatenate([*shapes, self._other_ways(hypothesis, sizes) / PRIOR_SIZES], axis=2))
        evidence, visible = self._without_doubt(base, grams)
        grown = []
        # Two laws of one gear are one law that is not exactly the dictionary's.
        geared = {dictionary.entries[k].joint for k in hypothesis.entries if self._of_gear(dictionary.entries[k])}
        for k, entry in enumerate(dictionary.entries):
            if k in hypothesis.entries or (self._of_gear(entry) and entry.joint in geared):
                continue
            members = np.arange(entry.signatures.start, entry.signatures.stop)
            if not visible[members].any():
                continue
            value, best = _entry_evidence(evidence[members], dictionary.log_share[members], members)
            grown.append(Hypothesis((*hypothesis.entries, k), (*hypothesis.signatures, best),
                                    hypothesis.log_evidence + value))
        return grown

    def _of_gear(self, entry: Entry) -> bool:
        """Whether an entry is a law of its joint's gear; in an arm of unknown weight, which the gear may stiffen under, what
        carries that weight looks like one."""
        return entry.effect.gear_law or (entry.effect.carries_weight and self.state.robot.link_mass is None)

    def _sizes(self, hypothesis: Hypothesis) -> list[Array]:
        """The best coefficients of each of its signatures together, in typical sizes."""
        base = self.base.extended(self.dictionary.of(*hypothesis.signatures))
        sizes = base.step(base.residual)[len(self.base.precision):]
        return np.split(sizes, np.cumsum(self.dictionary.widths[list(hypothesis.signatures)])[:-1])

    def _other_ways(self, hypothesis: Hypothesis, sizes: list[Array]) -> Array:
        """What the structures of a hypothesis of these sizes may do otherwise than their linear law (n, 3, m)."""
        terms = (self.dictionary.term(self.state, k, size) for k, size in zip(hypothesis.signatures, sizes, strict=True))
        return other_ways(self.state, self.sight, terms)

    def _as_told(self, hypothesis: Hypothesis) -> Base:
        """The plain model as the evidence of a hypothesis sees it: free in what its gears may do in rows that tell nothing of
        them. A further effect that explains these rows would count what the gear's law has been granted."""
        base = self.base
        for k in hypothesis.entries:
            entry = self.dictionary.entries[k]
            if entry.effect.gear_law and entry.joint in self.undecided:
                base = base.freed(self.dictionary.undecided(self.state, entry.joint), self.state.visit)
        return base

    def _mixture(self, joint: int, size: float) -> Array:
        """What a gear of this size may do by all the laws that imitate each other at once (n, 3, m), a law each alike: each may
        differ by a mixture of all of them, of LAW_SHARE of its size."""
        return size * self._unit_mixture(joint)

    def _mixture_of_one(self, joint: int) -> Array:
        """`_mixture` of a size of one."""
        dictionary = self.dictionary
        signatures = [s for k in dictionary.gear_laws(joint) if dictionary.entries[k].effect.law_family
                      for s in dictionary.entries[k].signatures]
        of_share = LAW_SHARE / np.sqrt(len(signatures)) / PRIOR_SIZES
        columns = np.concatenate([of_share / dictionary.amplitude(s) * dictionary.of(s)[:, :, :1] for s in signatures], axis=2)
        # Many laws do nearly the same: what they have in common, and what little more.
        own, strength, _ = np.linalg.svd(columns.reshape(-1, columns.shape[2]), full_matrices=False)
        kept = strength > ALIKE * strength[0]
        return np.asarray((own * strength)[:, kept].reshape(*columns.shape[:2], -1))

    def _without_doubt(self, base: Base, own: Array) -> tuple[Array, NDArray[np.bool_]]:
        """Evidence (S,) of every signature, and whether these rows could show it at its typical size (S,); own: the grams
        (S, 6, 6) of every signature by itself under the weights of `base`.

        The laws of one gear share out what they have together by the rows in which no force error decides on which side of its
        play the gear rests: those rows tell play from friction by chance alone. Laws that imitate each other share it out by
        what tells them apart whatever the gear's real law, which is none of the dictionary's exactly: each may differ by a
        mixture of all of them, of LAW_SHARE of its size.
        """
        dictionary, scored = self.dictionary, scores(base, self.dictionary, own)
        evidence = scored.evidence
        for joint in range(1, 7):
            laws, grams = dictionary.gear_laws(joint), own
            if joint in self.undecided:
                undecided = self.undecided[joint]
                decided, grams = undecided.beside(base), grams.copy()
                grams[[s for k in laws for s in dictionary.entries[k].signatures]] = undecided.grams
                self._share(evidence, decided, laws, grams)
            else:
                decided = base
            family = [k for k in laws if dictionary.entries[k].effect.law_family]
            signatures = [s for k in family for s in dictionary.entries[k].signatures]
            if not signatures or evidence[signatures].max() < WORTH_SHARING:
                continue
            likeliest = signatures[int(np.argmax(evidence[signatures]))]
            size = scored.size[likeliest] * dictionary.amplitude(likeliest)
            self._share(evidence, decided.extended(self._mixture(joint, size)), family, grams)
        return evidence, scored.visible

    def _share(self, evidence: Array, doubted: Base, laws: list[int], grams: Array) -> None:
        """Shares out the evidence (S,) that these laws have together by what they have where more is free; grams (S, 6, 6):
        with its weights."""
        dictionary = self.dictionary
        signatures = [s for k in laws for s in dictionary.entries[k].signatures]
        share = dictionary.log_share[signatures]
        decided = scores(doubted, dictionary.part(laws), grams[signatures]).evidence
        together = np.logaddexp.reduce(evidence[signatures] + share)
        evidence[signatures] = decided + together - np.logaddexp.reduce(decided + share)


def _entry_evidence(values: Array, log_share: Array, members: NDArray[np.intp]) -> tuple[float, int]:
    """ln of the mean Bayes factor of an entry's signatures, each by its share, and the best of them."""
    return float(np.logaddexp.reduce(values + log_share)), int(members[np.argmax(values)])


def log_prior(terms: int, entries: int) -> float:
    """ln prior of one set of so many causes among `entries`."""
    size = min(terms, len(PRIOR_OF_SIZE))
    return float(np.log(PRIOR_OF_SIZE[size - 1] / comb(entries, size)))


def _weighed(hypotheses: list[Hypothesis], entries: int) -> tuple[Hypothesis, ...]:
    """With probabilities, the likeliest first."""
    if not hypotheses:
        return ()
    sizes = [len(hypothesis.entries) for hypothesis in hypotheses]
    logs = np.array([hypothesis.log_evidence + np.log(PRIOR_OF_SIZE[size - 1] / comb(entries, size))
                     for hypothesis, size in zip(hypotheses, sizes, strict=True)])
    weight = np.exp(logs - logs.max())
    weight /= weight.sum()
    return tuple(replace(hypotheses[k], probability=float(weight[k])) for k in np.argsort(-logs))

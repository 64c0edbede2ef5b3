"""Terms of a fitted model that are no cause: of nothing, needless, or slight beside others and of no use."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import product

import numpy as np

from identification.common.arrays import Array
from identification.common.tails import chi2_above, chi2_tail
from identification.diagnosis.attempt import attempt
from identification.diagnosis.extended_model import with_free_laws
from identification.diagnosis.gain import AGAINST, gain
from identification.diagnosis.judgement import Cause
from identification.diagnosis.naming import CERTAIN, LIKELIER
from identification.fit.fitted_model import Term
from identification.fit.load_test import LoadTest
from identification.fit.mistakes.evidence import log_evidence
from identification.fit.posterior import Posterior
from identification.model.effects_in_force import SPRINGS
from identification.model.law_of import uncertain

# An effect under this share of its typical size is no name beside others: what it explains something else may do as well.
SLIGHT = 0.4
# So many of its own standard deviations from nothing is nothing.
NOTHING = 2.0
# ln of how much likelier the rows are with what is needed.
NEEDED = float(np.log(1000.0))
# Nor is one of this share of the signal of an effect whose law is uncertain by more.
BESIDE = 0.15
# Nor does it count as more than their laws where it brings less than this share of the evidence that all have against none:
# real laws differ from the dictionary's in shapes that are not among the free ones too.
BEYOND_SHARE = 0.1
# Weights that are tried instead of one that was found, in shares of it.
OTHER_WEIGHTS = (0.65, 1.5)


def needless(extended: Posterior, choices: int) -> set[str]:
    """The label of a term without which the rows are as likely, once all laws are free within what real ones differ by from the
    dictionary's and the choice among so many effects is counted; empty where there is none."""
    if len(extended.terms) < 2:
        return set()
    free = log_evidence(with_free_laws(extended)) - np.log(choices)
    for term in extended.terms:
        others = _without(extended, {term.label})
        if others is not extended and log_evidence(with_free_laws(others)) > free:
            return {term.label}
    return set()


def without_slight(
    data: LoadTest, extended: Posterior, choices: int, rng: np.random.Generator,
) -> tuple[Posterior, frozenset[str]]:
    """The extended model without terms of nothing, and without those that stand for what the others' laws do not give exactly;
    and the labels of those that stay in it without being a name: small against their typical size, or brought along by another,
    yet of use on rows that were not fitted. data: all rows; choices: how many effects it was chosen among."""
    extended = _without(extended, of_nothing(extended))
    extended = _without(extended, needless(extended, choices))
    small = {term.label for term, values in zip(extended.terms, extended.term_values, strict=True)
             if term.typical_sizes(values) < SLIGHT} | set(brought_along(extended))
    if len(small) == len(extended.terms):
        small = set()
    useless = {label for label in small if _of_no_use(data, extended, label, rng)}
    extended = weighed_anew(_without(extended, useless | _slight_beside(data, extended, rng)))
    return extended, frozenset(small & {term.label for term in extended.terms})


def no_names(
    slight: frozenset[str], names: Sequence[Cause], plain: Posterior, extended: Posterior, choices: int,
) -> frozenset[str]:
    """Of labels of small terms those that are no names: all but the certain ones that no law of the others explains."""
    return slight - {cause.label for cause in names if cause.label in slight and cause.probability >= CERTAIN
                     and beyond_laws(plain, extended, cause.label, choices)}


def beyond_laws(plain: Posterior, extended: Posterior, label: str, choices: int) -> bool:
    """Whether the rows need a small term far more than what the laws of the others may be off by, the choice among so many
    effects counted: then it is a cause, however small."""
    without = _without(extended, {label})
    if without is extended or label in brought_along(extended):
        return False
    free = log_evidence(with_free_laws(extended))
    gained = free - log_evidence(with_free_laws(without))
    return gained > max(NEEDED + float(np.log(choices)), BEYOND_SHARE * (free - log_evidence(plain)))


def weighed_anew(extended: Posterior) -> Posterior:
    """The extended model, or the same from another weight where that is far likelier once the laws are free: a law that is not
    quite the gear's may fit best under a wrong one, from which no slope leads to the other."""
    if not any(term.effect.weighed for term in extended.terms):
        return extended
    tried = [extended, *(attempt(extended.data, _under(extended, factor), extended) for factor in OTHER_WEIGHTS)]
    fits = [fitted for fitted in tried if fitted is not None]
    values = [log_evidence(with_free_laws(fitted)) for fitted in fits]
    likeliest = int(np.argmax(values))
    return fits[likeliest] if values[likeliest] > values[0] + LIKELIER else extended


def _under(extended: Posterior, factor: float) -> list[Term]:
    """The terms of a model, to be fitted from so many times the weights that were found."""
    return [replace(term, start=values * np.append(np.ones(len(values) - 1), factor) if term.effect.weighed else values)
            for term, values in zip(extended.terms, extended.term_values, strict=True)]


def brought_along(extended: Posterior) -> dict[str, str]:
    """Labels of terms that another term brings along in their size, with that one's label: no term that begins at a row, or is
    at one pose alone."""
    pairs = list(zip(extended.terms, extended.term_values, strict=True))
    everywhere = [(term, values) for term, values in pairs if not term.effect.where
                  or np.any(term.contribution(extended.load_state, values) != 0, axis=1).all()]
    found = {}
    for (term, values), (other, of_other) in product(everywhere, pairs):
        sizes = other.effect.brings(of_other)
        if _size(term, values) < sizes.get(term.effect.stored, sizes.get(term.effect.name, 0.0)):
            found[term.label] = other.label
    return found


def _size(term: Term, values: Array) -> float:
    """The norm of the parameters (P,) that say how large it is, from where it is absent."""
    of_size = np.array([not parameter.shape for parameter in term.effect.parameters])
    return float(np.linalg.norm((values - term.neutral)[of_size]))


def _without(extended: Posterior, slight: set[str]) -> Posterior:
    """The extended model without the terms of these labels; as it is where none would be left."""
    if not slight or len(slight) == len(extended.terms):
        return extended
    kept = [term for term in extended.terms if term.label not in slight]
    return attempt(extended.data, kept, extended) or extended


def _slight_beside(data: LoadTest, extended: Posterior, rng: np.random.Generator) -> set[str]:
    """Labels of terms that are small beside an effect whose law is uncertain, in the rows they touch, and of no use on rows
    that were not fitted."""
    slight, added = set(), {}
    for term, values in zip(extended.terms, extended.term_values, strict=True):
        added[term.label] = extended.at_map.noise.whitening @ term.contribution(extended.load_state, values)[:, :3, None]

    def strength(label: str, at: np.ndarray) -> float:
        moved = added[label] * at[:, None, None]
        return float(np.sqrt(extended.weights.inner(moved, moved)[0, 0]))

    for term in extended.terms:
        if not uncertain(term.effect):
            continue
        for other in extended.terms:
            at = np.any(added[other.label] != 0, axis=(1, 2)) | (not other.effect.where)
            if other is term or strength(other.label, at) >= BESIDE * strength(term.label, at):
                continue
            # What begins at a row, or is at one pose, nobody can tell there from a law that is off.
            if not at.all() or _of_no_use(data, extended, other.label, rng):
                slight.add(other.label)
    return slight


def _of_no_use(data: LoadTest, extended: Posterior, label: str, rng: np.random.Generator) -> bool:
    """Whether rows that were not fitted are predicted as well without the term."""
    without = attempt(extended.data, [term for term in extended.terms if term.label != label], extended)
    return without is not None and gain(data, without, extended, rng).support < -AGAINST


def of_nothing(extended: Posterior) -> set[str]:
    """Labels of terms whose parameters, but for those that only shape them, all lie within two of their own standard deviations
    of nothing, one by one and together: several that the rows know by their sum alone are something. So is one whose size
    trades with its shape, and without which the rows are unlikely."""
    place, nothing = len(extended.mean[SPRINGS]), set()
    for term in extended.terms:
        size = len(term.effect.parameters)
        of_size = place + np.flatnonzero([not parameter.shape for parameter in term.effect.parameters])
        place += size
        off = extended.mean[of_size] - term.neutral[of_size - place + size]
        covariance = extended.covariance[np.ix_(of_size, of_size)]
        if not beyond_nothing(off, covariance):
            nothing.add(term.label)
    return {label for label in nothing if not _needed(extended, label)}


def _needed(extended: Posterior, label: str) -> bool:
    """Whether the rows are far less likely without the term."""
    without = attempt(extended.data, [term for term in extended.terms if term.label != label], extended)
    return without is not None and log_evidence(extended) > log_evidence(without) + NEEDED


def beyond_nothing(off: Array, covariance: Array) -> bool:
    """Whether parameters (p,), counted from where they do nothing, are more than two standard deviations off, one by one or
    together."""
    alone = np.all(np.abs(off) < NOTHING * np.sqrt(np.diag(covariance)))
    together = off @ np.linalg.solve(covariance, off) < chi2_above(float(chi2_tail(NOTHING**2, 1)), len(off))
    return not (alone and together)

"""Names for a misfit: the best set of causes, fitted, and how sure each name is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from identification.diagnosis.discrepancy import discrepancies, uncertain
from identification.diagnosis.gain import gain
from identification.diagnosis.judgement import Cause
from identification.diagnosis.search import Hypothesis, Survey, survey
from identification.fit.fitted_model import Term
from identification.fit.load_test import LoadTest
from identification.fit.posterior import Posterior, posterior
from identification.model.effects import Effect

# A name is given when this much probability is on it; the set of names holds as much.
CERTAIN = 0.95
# An effect under this share of its typical size is no cause beside others.
SLIGHT = 0.4
# Nor is one of this share of the signal of an effect whose law is uncertain by more.
BESIDE = 0.15
# ln of how much likelier rows that were not fitted must be without a name for it to be withdrawn.
AGAINST = -3.0
# How often the best set of causes is fitted and the dictionary looked through again from there.
MAX_ROUNDS = 4


def converged(
    fitted: Posterior, catalogue: dict[str, Effect], levels: int
) -> tuple[Survey, Hypothesis | None, Posterior]:
    """The best set of causes, fitted, and everything seen from there: fitted and looked at again until it stays the best."""
    tried: set[frozenset[int]] = set()
    best = None
    for _ in range(MAX_ROUNDS):
        seen = survey(fitted, catalogue, levels)
        if not seen.hypotheses or (best is not None and seen.hypotheses[0].key == best.key):
            break
        best = seen.hypotheses[0]
        if best.key in tried:
            break
        tried.add(best.key)
        fitted = posterior(fitted.data, seen.terms(best), fitted.log_compliance)
    return seen, best, fitted


def without_slight(data: LoadTest, extended: Posterior, rng: np.random.Generator) -> Posterior:
    """The extended model without the terms that stand for what the others' laws do not give exactly; data: all rows."""
    slight = _slight_terms(data, extended, rng)
    if not slight or len(slight) == len(extended.terms):
        return extended
    return posterior(extended.data, [term for term in extended.terms if term.label not in slight], extended.log_compliance)


def _slight_terms(data: LoadTest, extended: Posterior, rng: np.random.Generator) -> set[str]:
    """Labels of terms that are small against their typical size, or small in these rows beside an effect whose law is uncertain
    and of no use on rows that were not fitted."""
    slight, strength = set(), {}
    for term, values in zip(extended.terms, extended.term_values, strict=True):
        if _typical_sizes(term, values) < SLIGHT:
            slight.add(term.label)
        added = extended.at_map.noise.rotation @ term.contribution(extended.load_state, values)[:, :3, None]
        strength[term.label] = float(np.sqrt(extended.weights.inner(added, added)[0, 0]))
    for term in extended.terms:
        if not uncertain(term.effect):
            continue
        for label in [label for label, value in strength.items() if value < BESIDE * strength[term.label]]:
            others = [other for other in extended.terms if other.label != label]
            without = posterior(extended.data, others, extended.log_compliance)
            if gain(data, without, extended, rng).support < -AGAINST:
                slight.add(label)
    return slight


def _typical_sizes(term: Term, values: np.ndarray) -> float:
    """How large the effect is, in typical sizes: the norm of the parameters that say how large it is."""
    of_size = np.array([not parameter.shape for parameter in term.effect.parameters])
    return float(np.linalg.norm((values - term.neutral)[of_size] / term.scale[of_size]))


def with_free_laws(extended: Posterior) -> Posterior:
    """The extended model fitted again with the laws of its effects free within what real ones differ by."""
    terms = tuple(replace(term, start=values) for term, values in zip(extended.terms, extended.term_values, strict=True))
    free = discrepancies(extended.load_state, terms)
    return posterior(extended.data, (*terms, *free), extended.log_compliance) if free else extended


def inclusion(seen: Survey) -> tuple[Cause, ...]:
    """Every entry with the probability that it is at work, alone or with others; the likeliest first."""
    entries = seen.dictionary.entries
    total = np.zeros(len(entries))
    for hypothesis in seen.hypotheses:
        total[list(hypothesis.entries)] += hypothesis.probability
    return tuple(Cause(entries[k].effect, entries[k].joint, float(min(total[k], 1.0))) for k in np.argsort(-total))


def credible(seen: Survey) -> tuple[Cause, ...]:
    """The names in the likeliest hypotheses that hold CERTAIN of the probability together."""
    held = 0.0
    names: set[int] = set()
    for hypothesis in seen.hypotheses:
        names |= hypothesis.key
        held += hypothesis.probability
        if held >= CERTAIN:
            break
    labels = {seen.dictionary.entries[k].label for k in names}
    return tuple(cause for cause in inclusion(seen) if cause.label in labels)


def only_local(seen: Survey, best: Hypothesis) -> bool:
    """Whether every effect touches one pose only, so that no other pose can tell of it."""
    return all(seen.dictionary.signatures[signature].local for signature in best.signatures)

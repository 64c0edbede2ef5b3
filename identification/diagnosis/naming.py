"""Names for a misfit: the best set of causes, fitted, and how sure each name is."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from identification.diagnosis.attempt import attempt
from identification.diagnosis.judgement import Cause
from identification.diagnosis.search import Hypothesis, Survey, log_prior, survey
from identification.fit.fitted_model import Term, predicted_deflection
from identification.fit.mistakes.evidence import log_evidence
from identification.fit.posterior import Posterior
from identification.model.effects import Effect

# A name is given when this much probability is on it; the set of names holds as much.
CERTAIN = 0.95
# A law of the same gear that is less likely is not said to do as well.
OPEN_LAW = 0.01
# How often the best set of causes is fitted and the dictionary looked through again from there.
MAX_ROUNDS = 4
# ln of how much likelier the fit of another set must be, to be the better one.
LIKELIER = 3.0
# A cause moves a reading that it moves by more than this [m], and so many of one visit are several.
LEAST_MOVED, SEVERAL = 1e-9, 3
# So many sets whose fit does not converge, and there is no use in trying further.
MOST_LOST = 8


@dataclass(frozen=True, eq=False)
class Named:
    """What the search comes to. seen: everything, seen from the fit; best: the likeliest set of causes, None where there is
    none; fitted: the model with it. lost: sets whose fit did not converge, which are no candidates."""

    seen: Survey
    best: Hypothesis | None
    fitted: Posterior
    lost: tuple[str, ...] = ()


def converged(
    fitted: Posterior, catalogue: dict[str, Effect], levels: int, rejected: frozenset[int] | None = None,
) -> Named:
    """The best set of causes, fitted, and everything seen from there: fitted and looked at again until it stays the best, or
    that of the fits which is far likelier. rejected: a set that is no candidate, alone or with more, because what it leaves is
    not noise."""
    fits: dict[tuple[frozenset[int], tuple[float, ...]], tuple[Posterior, frozenset[int]]] = {}
    lost: dict[frozenset[int], str] = {}
    best = None

    def seen_from(fit: Posterior) -> Survey:
        return survey(fit, catalogue, levels).without(set(lost), rejected)

    while True:
        seen = seen_from(fitted)
        if not seen.hypotheses:
            return Named(seen, best, fitted, tuple(lost.values()))
        likeliest = seen.hypotheses[0]
        # A gear under another weight is another start: no slope leads from one to the other.
        as_weighed = (likeliest.key, tuple(seen.dictionary.signatures[k].weight for k in likeliest.signatures))
        if as_weighed in fits:
            # It stays the best, or has been it before: the sets take turns.
            found, key = fits[as_weighed]
            kept = next((each for each in seen.hypotheses if each.key == key), likeliest)
            return _by_their_fits(Named(seen, kept, found, tuple(lost.values())), list(fits.values()), seen_from)
        if len(fits) == MAX_ROUNDS or len(lost) == MOST_LOST:
            return Named(seen, best, fitted, tuple(lost.values()))
        # Laws that imitate each other share out what they have alike: which of them fits is seen by fitting them. A weight that
        # was searched beside a noise that has grown may be none.
        alike = [start for kin in kindred(seen, likeliest) if kin.probability >= OPEN_LAW * likeliest.probability
                 for start in (kin, seen.unweighed(kin)) if start is not None]
        fits_alike = [(fit, start) for start in alike if (fit := attempt(fitted.data, seen.terms(start), fitted)) is not None]
        if not fits_alike:
            lost[likeliest.key] = seen.name(likeliest)
            continue
        fitted, best = _clearly_best(fits_alike)
        fits[as_weighed] = fitted, best.key
        # Its dictionary makes room for that of the next.
        del seen


def _by_their_fits(
    found: Named, fits: list[tuple[Posterior, frozenset[int]]], seen_from: Callable[[Posterior], Survey],
) -> Named:
    """What is found, or that of the fits on the way there which is far likelier: what a look grants a set whose shape is not
    among those that are tried (the torque at which a gear slips) is less than what its fit comes to. Sets that were fitted are
    as likely then as their fits are. Beside a cause that every visit begins anew a look tells little of all others: such are
    held against such alone (begun.py has the rest)."""
    fits = [pair for pair in fits if _begun_anew(pair[0]) == _begun_anew(found.fitted)]
    if len(fits) == 1:
        return found
    entries = len(found.seen.dictionary.entries)

    def value(fit: Posterior) -> float:
        return log_evidence(fit) + log_prior(len(fit.terms), entries)

    fitted, key = max(fits, key=lambda pair: value(pair[0]))
    if value(fitted) <= value(found.fitted) + LIKELIER:
        return found
    seen = seen_from(fitted)
    sets = {each.key: each for each in seen.hypotheses}
    if key not in sets:
        return found
    by_fit: dict[frozenset[int], float] = {}
    for fit, other in fits:
        by_fit[other] = max(by_fit.get(other, -np.inf), log_evidence(fit))
    less = {other: sets[other].log_evidence - sets[key].log_evidence + by_fit[key] - by_fit[other]
            for other in by_fit if other in sets and not other <= key}
    # A set and one more is seen beside the set, and is less likely with it.
    taken = {each.key: max((less[other] for other in less if other <= each.key), default=0.0) for each in seen.hypotheses}
    seen = seen.instead({each.key: replace(each, log_evidence=each.log_evidence - taken[each.key])
                         for each in seen.hypotheses if taken[each.key]})
    return replace(found, seen=seen, best=next(each for each in seen.hypotheses if each.key == key), fitted=fitted)


def _begun_anew(fitted: Posterior) -> bool:
    """Whether every visit begins one of its causes in a state of its own."""
    return any(term.effect.by_visit for term in fitted.terms)


def _clearly_best(fits: list[tuple[Posterior, Hypothesis]]) -> tuple[Posterior, Hypothesis]:
    """The first of these fits, or the likeliest of the others where that is far likelier."""
    if len(fits) == 1:
        return fits[0]
    values = [log_evidence(fit) for fit, _ in fits]
    place = int(np.argmax(values))
    return fits[place if values[place] > values[0] + LIKELIER else 0]


def with_plainer_effects(found: Named) -> Named:
    """What is found, with an effect's plainer kin in its place where the rows are likelier with that: shares that are large
    enough are no turn to first order, as which a turn is seen before it is fitted."""
    if found.best is None:
        return found
    places = {entry.label: k for k, entry in enumerate(found.seen.dictionary.entries)}
    for term in found.fitted.terms:
        number = places.get(term.effect.plainer)
        if number is None or number in found.best.key:
            continue
        effect, state = found.seen.dictionary.entries[number].effect, found.fitted.load_state
        kin = Term(effect, None, effect.neutral(state), effect.typical(state, None), effect.neutral(state))
        terms = [kin if each.label == term.label else replace(each, start=values)
                 for each, values in zip(found.fitted.terms, found.fitted.term_values, strict=True)]
        fitted = attempt(found.fitted.data, terms, found.fitted)
        if fitted is not None and log_evidence(fitted) > log_evidence(found.fitted):
            swap = partial(_in_its_place, seen=found.seen, number=places[term.label], other=number)
            (best,), hypotheses = swap((found.best,)), swap(found.seen.hypotheses)
            found = replace(found, seen=replace(found.seen, hypotheses=hypotheses), best=best, fitted=fitted)
    return found


def _in_its_place(each_of: Sequence[Hypothesis], seen: Survey, number: int, other: int) -> tuple[Hypothesis, ...]:
    """These hypotheses with one effect in the place of another; of two that are the same then the likelier, with the
    probability of both."""
    signature = seen.dictionary.entries[other].signatures.start
    merged: dict[frozenset[int], Hypothesis] = {}
    for each in each_of:
        pairs = [(other, signature) if k == number else (k, s) for k, s in zip(each.entries, each.signatures, strict=True)]
        pairs = list(dict(pairs).items())
        placed = replace(each, entries=tuple(k for k, _ in pairs), signatures=tuple(s for _, s in pairs))
        before = merged.get(placed.key)
        merged[placed.key] = placed if before is None else replace(before, probability=before.probability + each.probability)
    return tuple(sorted(merged.values(), key=lambda each: -each.probability))


def inclusion(seen: Survey) -> tuple[Cause, ...]:
    """Every entry with the probability that it is at work, alone or with others; the likeliest first."""
    entries = seen.dictionary.entries
    total = np.zeros(len(entries))
    for hypothesis in seen.hypotheses:
        total[list(hypothesis.entries)] += hypothesis.probability
    return tuple(Cause(entries[k].effect, entries[k].joint, float(min(total[k], 1.0))) for k in np.argsort(-total))


def kindred(seen: Survey, best: Hypothesis) -> tuple[Hypothesis, ...]:
    """The hypotheses that differ from the best at most in which of the laws that imitate each other a gear follows, the
    likeliest first; the best among them."""
    family = _family(seen, best)
    return tuple(hypothesis for hypothesis in seen.hypotheses if _family(seen, hypothesis) == family)


def _family(seen: Survey, hypothesis: Hypothesis) -> frozenset[tuple[str, int | None]]:
    entries = [seen.dictionary.entries[k] for k in hypothesis.entries]
    return frozenset((entry.effect.law_family or entry.effect.name, entry.joint) for entry in entries)


def with_open_laws(seen: Survey, causes: tuple[Cause, ...]) -> tuple[Cause, ...]:
    """The causes, each with the laws of its gear that do as well; the probability is that of any of them."""
    found = []
    for cause in causes:
        kin = [other for other in inclusion(seen) if other.joint == cause.joint and other.label != cause.label
               and cause.effect.law_family and other.effect.law_family == cause.effect.law_family]
        laws = {other.effect.name: other.probability for other in kin if other.probability >= OPEN_LAW}
        found.append(replace(cause, probability=min(cause.probability + sum(laws.values()), 1.0), open_laws=laws))
    return tuple(found)


def credible(seen: Survey, best: Hypothesis) -> tuple[Cause, ...]:
    """The names in the likeliest hypotheses that hold CERTAIN of the probability together, and in the one that was fitted."""
    held, names = 0.0, set(best.key)
    for hypothesis in seen.hypotheses:
        names |= hypothesis.key
        held += hypothesis.probability
        if held >= CERTAIN:
            break
    labels = {seen.dictionary.entries[k].label for k in names}
    return tuple(cause for cause in inclusion(seen) if cause.label in labels)


def told_by_one_visit(fitted: Posterior) -> bool:
    """Whether its causes move several readings of one visit and none of any other: what makes the other poses no likelier, and
    yet is neither one reading's tail nor that visit's zero."""
    data = fitted.data
    by_causes = fitted.predicted(data) - predicted_deflection(data, fitted.log_compliance)
    moved = np.any(np.abs(by_causes) > LEAST_MOVED, axis=1)
    return bool(moved.sum() >= SEVERAL) and len(np.unique(data.rows.visit[moved])) == 1


def only_local(seen: Survey, best: Hypothesis) -> bool:
    """Whether every effect touches one pose only, so that no other pose can tell of it."""
    return all(seen.dictionary.signatures[signature].local for signature in best.signatures)

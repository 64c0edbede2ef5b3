"""Sets of causes held against each other by their own fits, each with the noise that it needs itself.

A noise that has grown for want of the cause takes up what tells another cause, and the usual one leaves that for a wrong cause
to explain: as seen from one fit the other sets are less likely than they are.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from identification.diagnosis.attempt import attempt
from identification.diagnosis.dictionary import Dictionary
from identification.diagnosis.naming import LIKELIER, OPEN_LAW, Named
from identification.diagnosis.search import Hypothesis, Survey, log_prior, survey
from identification.fit.mistakes.evidence import log_evidence
from identification.fit.posterior import Posterior
from identification.model.effects import Effect

# Of other sets of causes that are likely too so many are fitted, where the best does not explain the rows.
MOST_TRIED = 4
# ln of how much likelier a set becomes at most by a noise of its own, beside what a look at it tells.
BY_NOISE = 25.0


def likeliest_fit(start: Posterior, catalogue: dict[str, Effect], levels: int) -> Posterior:
    """Of the likeliest sets of one, two, ... causes, as seen from a fitted model, the one whose own fit, with its own noise, is
    likeliest; the model itself where none converges."""
    seen = survey(start, catalogue, levels)
    fits = [fit for hypothesis in _likeliest_of_each_size(seen, levels)
            if (fit := attempt(start.data, seen.terms(hypothesis), start)) is not None]
    entries = len(seen.dictionary.entries)
    return max(fits, key=lambda fit: log_evidence(fit) + log_prior(len(fit.terms), entries), default=start)


def likelier_fit(found: Named) -> Posterior | None:
    """Of the other sets of as many causes that are likely too, the one whose fit is likelier than the best one's; None where
    there is none."""
    if found.best is None:
        return None
    others = [hypothesis for hypothesis in found.seen.hypotheses
              if hypothesis.probability >= OPEN_LAW and len(hypothesis.entries) == len(found.best.entries)
              and hypothesis.key != found.best.key]
    tried = (attempt(found.fitted.data, found.seen.terms(hypothesis), found.fitted) for hypothesis in others[:MOST_TRIED])
    values = [(log_evidence(fitted), fitted) for fitted in tried if fitted is not None]
    value, likeliest = max(values, key=lambda pair: pair[0], default=(-np.inf, found.fitted))
    return likeliest if value > log_evidence(found.fitted) + LIKELIER else None


def held_against(found: Named, plain: Posterior, catalogue: dict[str, Effect]) -> tuple[Named, Posterior | None]:
    """What is found, with the sets of no more causes that are likeliest beside the noise of the plain model as likely as their
    own fits are; and the likeliest of these fits where it is likelier than what was found, else None."""
    if found.best is None:
        return found, None
    value, size = log_evidence(found.fitted), len(found.best.entries)
    seen, likelier, best = survey(plain, catalogue, size), dict[frozenset[int], Hypothesis](), found.fitted
    known = {hypothesis.key: hypothesis.log_evidence for hypothesis in found.seen.hypotheses}
    for looked_at in _likeliest_of_each_size(seen, size):
        hypothesis = _in_dictionary(looked_at, seen.dictionary, found.seen.dictionary)
        hopeless = log_evidence(plain) + looked_at.log_evidence + BY_NOISE < value
        if hypothesis is None or hopeless or hypothesis.key == found.best.key:
            continue
        fitted = attempt(plain.data, seen.terms(looked_at), plain)
        evidence = found.best.log_evidence + log_evidence(fitted) - value if fitted is not None else -np.inf
        if fitted is not None and evidence > known.get(hypothesis.key, -np.inf):
            likelier[hypothesis.key] = replace(hypothesis, log_evidence=evidence)
            best = max(best, fitted, key=log_evidence)
    return replace(found, seen=found.seen.instead(likelier)), best if log_evidence(best) > value + LIKELIER else None


def _in_dictionary(hypothesis: Hypothesis, dictionary: Dictionary, other: Dictionary) -> Hypothesis | None:
    """A hypothesis of one dictionary as one of another of the same rows; None where that has no such effect."""
    places = {entry.label: k for k, entry in enumerate(other.entries)}
    entries, signatures = [], []
    for k, signature in zip(hypothesis.entries, hypothesis.signatures, strict=True):
        entry = dictionary.entries[k]
        place = places.get(entry.label)
        if place is None or len(other.entries[place].signatures) != len(entry.signatures):
            return None
        entries.append(place)
        signatures.append(other.entries[place].signatures[signature - entry.signatures.start])
    return replace(hypothesis, entries=tuple(entries), signatures=tuple(signatures))


def _likeliest_of_each_size(seen: Survey, size: int) -> list[Hypothesis]:
    """Of the sets of one, two, ... up to `size` causes the MOST_TRIED likeliest of each."""
    return [hypothesis for count in range(1, size + 1)
            for hypothesis in [each for each in seen.hypotheses if len(each.entries) == count][:MOST_TRIED]]

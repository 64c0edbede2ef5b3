"""Causes of which every visit begins in a state of its own: play and friction that the way to a pose left anywhere.

The look at all effects (search.py) knows nothing of that state, and where a load seldom turns such a cause over, what it leaves
looks like readings that are off by visits. Here each of them is fitted by itself, the state free at each visit.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from identification.diagnosis.attempt import attempt
from identification.diagnosis.naming import Named
from identification.diagnosis.projection import own_grams, scores
from identification.diagnosis.search import Hypothesis, Survey, survey
from identification.fit.fitted_model import Term
from identification.fit.mistakes.evidence import log_evidence
from identification.fit.posterior import Posterior
from identification.model.effects import Effect

# Of so many such causes, the likeliest at a look, so many starts are fitted.
CAUSES, STARTS = 4, 2


def named_by_fits(plain: Posterior, catalogue: dict[str, Effect]) -> Named | None:
    """All causes, alone and in pairs, as seen from a plain model, with the evidence of such causes by their fits, where one of
    these is the likeliest of all; else None."""
    seen = survey(plain, catalogue, 2)
    fits, likelier = {}, {}
    for starts in _starts(seen):
        fitted = [(fit, start) for start in starts
                  if (fit := attempt(plain.data, [_of_size(seen.terms(start)[0])], plain)) is not None]
        if fitted:
            fit, start = max(fitted, key=lambda pair: log_evidence(pair[0]))
            fits[start.key] = fit
            likelier[start.key] = replace(start, log_evidence=log_evidence(fit) - log_evidence(plain))
    seen = seen.instead(likelier)
    best = seen.hypotheses[0] if seen.hypotheses else None
    return Named(seen, best, fits[best.key]) if best is not None and best.key in fits else None


def _starts(seen: Survey) -> list[list[Hypothesis]]:
    """Of each cause the signatures that explain most at a look, the likeliest causes first."""
    dictionary = seen.dictionary
    evidence = scores(seen.base, dictionary, own_grams(seen.base.weights, dictionary)).evidence
    found = []
    for k, entry in enumerate(dictionary.entries):
        begun = [s for s in entry.signatures if dictionary.signatures[s].effect.by_visit]
        best = sorted(begun, key=lambda s: -evidence[s])[:STARTS]
        found.append([Hypothesis((k,), (s,), float(evidence[s])) for s in best])
    return sorted(filter(None, found), key=lambda some: -some[0].log_evidence)[:CAUSES]


def _of_size(term: Term) -> Term:
    """The term begun no smaller than is typical: of nothing no visit begins anywhere."""
    shape = np.array([parameter.shape for parameter in term.effect.parameters])
    start = np.where(term.start < 0, -1.0, 1.0) * np.maximum(np.abs(term.start), term.scale)
    return replace(term, start=np.where(shape, term.start, start))

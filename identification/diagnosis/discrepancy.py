"""How far a named effect's real law may be off the dictionary's: a term beside the effect that is integrated out (law_of.py).

Its shapes are free, each within a share of the effect's own size. Without them the stiffnesses take up what the law does not
give, and their intervals are too narrow for it.
"""

from __future__ import annotations

import numpy as np

from identification.fit.fitted_model import WIDE, Term
from identification.model.law_of import LawOf, uncertain
from identification.model.load_state import LoadState

# Another shape's coefficient, 1 sigma, as a share of the effect's own size: laws of real gears differ by some ten per cent.
SHARE = 0.3


def discrepancies(rows: LoadState, terms: tuple[Term, ...]) -> tuple[Term, ...]:
    """One more term for each whose effect has shapes; its size comes from the term's start."""
    free = []
    for term in terms:
        if not uncertain(term.effect):
            continue
        law = LawOf(term.effect)
        size = SHARE * abs(float(term.start[0] - term.neutral[0])) / float(term.effect.typical(rows, term.joint)[0])
        zero = np.zeros(len(law.shapes))
        free.append(Term(law, term.joint, scale=np.full(len(zero), max(size, 1e-6) / WIDE), start=zero,
                         neutral=zero))
    return tuple(free)

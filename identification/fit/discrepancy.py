"""How far a named effect's real law may be off the dictionary's: a term beside the effect that is integrated out (law_of.py).

Its shapes are free, each within a share of the effect's own size. Without them the stiffnesses take up what the law does not
give, and their intervals are too narrow for it.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from identification.common.arrays import Array
from identification.fit.fitted_model import WIDE, Term
from identification.fit.sight import Sight
from identification.model.effects import effects
from identification.model.law_of import LawOf, stiffening_ways, uncertain
from identification.model.load_state import LoadState

# Another shape's coefficient, 1 sigma, as a share of the effect's own size: laws of real gears differ by some ten per cent.
SHARE = 0.3
# One of three axes off by g: they differ from their mean by 2/3 and 1/3 of that, and the mean, which nobody sees, is off by
# g / 3: 0.45 to 0.71 of the norm of what is told of two of them.
COMMON = 0.6
# Each way in which a structure may stiffen, 1 sigma, as a share of what it does: about 28 % in all.
STIFFENS = 0.15


def discrepancies(rows: LoadState, terms: tuple[Term, ...]) -> tuple[Term, ...]:
    """One more term for each whose effect has shapes, and for each that leaves something open; its size comes from the term's
    start."""
    free = []
    for term in terms:
        if term.effect.leaves_open:
            # Where one axis of three is off, the three are so in common by about this share of how unlike they are.
            other, width = effects()[term.effect.leaves_open], COMMON * float(np.linalg.norm(term.start - term.neutral))
            neutral = other.neutral(rows)
            free.append(Term(other, None, start=neutral, scale=np.full(len(neutral), max(width, 1e-6) / WIDE), neutral=neutral))
        if not uncertain(term.effect):
            continue
        law = LawOf(term.effect)
        size = abs(float(term.start[0] - term.neutral[0])) / float(term.effect.typical(rows, term.joint)[0])
        zero, start = np.zeros(len(law.parameters)), np.zeros(len(law.parameters))
        ways = term.effect.ways
        share = np.concatenate([np.full(len(law.shapes), SHARE), np.ones(ways),
                                np.full(len(zero) - len(law.shapes) - ways, STIFFENS)])
        if term.effect.weighed:
            start[-1] = term.start[-1]
        free.append(Term(law, term.joint, scale=share * max(size, 1e-6) / WIDE, start=start, neutral=zero))
    return tuple(free)


def other_ways(rows: LoadState, sight: Sight, terms: Iterable[Term]) -> Array:
    """Columns (n, 3, m) in the noise's coordinates, 1 sigma each: how structures as large as the terms' starts say may yield
    otherwise than their linear law."""
    columns = [np.zeros((len(rows), 3, 0))]
    for term in terms:
        if term.effect.stiffens:
            columns.append(STIFFENS * stiffening_ways(rows, term.contribution(rows, term.start)[:, :3]))
        if term.effect.ways:
            columns.append(term.effect.further_ways(rows, term.joint, term.start)[:, :3])
    return sight.whitened(np.concatenate(columns, axis=2))

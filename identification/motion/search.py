"""Which causes, alone or together, a joint's log speaks for: all sets of up to four effects, each with its best shape.

The evidence of a set is the Bayesian information criterion of generalised least squares, but that a delay of the link's
encoder is known beforehand to a few milliseconds. The noise's autoregression is that beside the whole dictionary, the same
for all sets, so no set gains by calling a misfit noise. A set in which a coefficient with a known sign has the other, or
the compliance is negative, is judged without that coefficient. Free play and a soft zone are never in one set: a real
gear's compliance is neither exactly, and the two together would be a law, not two causes. Nor are a gear that is damped and
a torque that was recorded early: they are one column.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from identification.model.effects.channel_delay import ChannelDelay
from identification.model.effects.joint_friction import JointFriction
from identification.motion.axis import Axis, Solved
from identification.motion.dictionary import EXCLUSIVE, LINK_DELAY, Shape
from identification.motion.products import Products, products

Array = NDArray[np.float64]
MOST_CAUSES = 4
# Probability that an effect is at work, before the data.
AT_WORK = 0.15
# Columns that are closer to one another than this are one: what they say cannot be divided between them.
SAME = 1e-4


@dataclass(frozen=True, eq=False)
class Hypothesis:
    """A set of effects: entries of the dictionary, their shapes, which columns each keeps, the answer, the evidence against
    the plain spring (ln), the probability among all sets that were looked at."""

    entries: tuple[int, ...]
    shapes: tuple[Shape, ...]
    kept: tuple[tuple[int, ...], ...]
    solved: Solved
    log_evidence: float
    probability: float = 0.0

    def columns(self, axis: Axis) -> Array:
        """Columns (n, p): the plain spring's, then the effects'."""
        return np.column_stack([axis.plain, *(shape.columns[:, list(kept)]
                                              for shape, kept in zip(self.shapes, self.kept, strict=True))])

    @property
    def names(self) -> tuple[str, ...]:
        """The effects' names."""
        return tuple(shape.name for shape in self.shapes)


def survey(axis: Axis, most: int = MOST_CAUSES) -> tuple[Hypothesis, ...]:
    """All sets of effects, the likeliest first; the plain spring is among them."""
    groups, all_products = axis.dictionary, products(axis)
    shortlists = _shortlists(all_products, groups)
    plain = all_products.solve(all_products.places((), ()))
    hypotheses = [Hypothesis((), (), (), plain, 0.0)]
    for size in range(1, min(most, len(groups)) + 1):
        for entries in itertools.combinations(range(len(groups)), size):
            if any({groups[a][0].name, groups[b][0].name} in EXCLUSIVE for a, b in itertools.combinations(entries, 2)):
                continue
            options = [fitted(all_products, entries, chosen, plain)
                       for chosen in itertools.product(*(shortlists[entry] for entry in entries))]
            possible = [option for option in options if option is not None]
            if possible:
                hypotheses.append(max(possible, key=lambda option: option.log_evidence))
    prior = np.array([len(hypothesis.entries) * np.log(AT_WORK / (1 - AT_WORK)) for hypothesis in hypotheses])
    logs = np.array([hypothesis.log_evidence for hypothesis in hypotheses]) + prior
    weight = np.exp(logs - logs.max())
    weight /= weight.sum()
    return tuple(replace(hypotheses[k], probability=float(weight[k])) for k in np.argsort(-logs))


def _shortlists(of_all: Products, groups: list[list[Shape]]) -> list[list[Shape]]:
    """The shapes of each effect worth trying in sets: the best beside the plain spring, and the best beside all others."""
    middle = [group[len(group) // 2] for group in groups]
    lists = []
    for group, mine in zip(groups, middle, strict=True):
        if len(group) == 1:
            lists.append(group)
            continue
        others = [shape for shape in middle if shape is not mine]
        picked = [min(range(len(group)), key=lambda k: of_all.solve(of_all.places(*_whole([*beside, group[k]]))).chi2)
                  for beside in ([], others)]
        lists.append([group[k] for k in dict.fromkeys(picked)])
    return lists


def _whole(shapes: list[Shape]) -> tuple[list[Shape], list[range]]:
    return shapes, [range(shape.columns.shape[1]) for shape in shapes]


def fitted(of_all: Products, entries: tuple[int, ...], chosen: tuple[Shape, ...], plain: Solved) -> Hypothesis | None:
    """The set with columns of the wrong sign left out; None where an effect has nothing left, or doubles another's column.
    Viscous friction and a delay of the link are nearly one column: beside it friction keeps its own only where that pays."""
    kept = [list(range(shape.columns.shape[1])) for shape in chosen]
    names = [shape.name for shape in chosen]
    found = _with(of_all, entries, chosen, plain, kept)
    if LINK_DELAY not in names or JointFriction.name not in names:
        return found
    without = [mine[:1] if name == JointFriction.name else mine for name, mine in zip(names, kept, strict=True)]
    dry = _with(of_all, entries, chosen, plain, without)
    if found is None or dry is None or len(found.solved.coefficients) == len(dry.solved.coefficients):
        return dry or found
    pays = 0.5 * found.solved.count * (np.log(dry.solved.chi2 / found.solved.chi2)) - 0.5 * np.log(found.solved.count)
    return replace(found, log_evidence=dry.log_evidence + float(pays)) if pays > 0 else dry


def _with(
    of_all: Products, entries: tuple[int, ...], chosen: tuple[Shape, ...], plain: Solved, columns: list[list[int]]
) -> Hypothesis | None:
    """The set with these columns of each shape, or fewer."""
    kept = [list(mine) for mine in columns]
    while all(kept):
        places = of_all.places(chosen, kept)
        if of_all.doubled(places, SAME):
            if not _drop_doubled(kept):
                return None
            continue
        solved = of_all.solve(places)
        if solved.coefficients[of_all.plain - 1] <= 0 and chosen and any(shape.through_spring for shape in chosen):
            return None
        wrong = _wrong_sign(solved, of_all.plain, chosen, kept)
        if wrong is None:
            names = [shape.name for shape, mine in zip(chosen, kept, strict=True) for _ in mine]
            std = np.sqrt(np.diag(solved.covariance)[of_all.plain:])
            price = sum(_price(name, float(each), solved.count) for name, each in zip(names, std, strict=True))
            gain = 0.5 * solved.count * np.log(plain.chi2 / solved.chi2) - price
            return Hypothesis(entries, chosen, tuple(tuple(mine) for mine in kept), solved, float(gain))
        del kept[wrong[0]][wrong[1]]
    return None


def _price(name: str, std: float, count: int) -> float:
    """ln of what a free coefficient costs a set: by the information criterion, or by how much better the data know it than it
    was known before, where that is known. Recorders are off by milliseconds: one that is off by a microsecond is unlikely."""
    price = 0.5 * float(np.log(count))
    if name != LINK_DELAY:
        return price
    return max(price, float(np.log(2 * ChannelDelay.parameters[0].typical / (np.sqrt(2 * np.pi) * max(std, 1e-300)))))


def _wrong_sign(
    solved: Solved, base: int, chosen: tuple[Shape, ...], kept: list[list[int]]
) -> tuple[int, int] | None:
    """The coefficient that is furthest on the wrong side of zero: (shape, place among those it keeps); None: all are right."""
    sigma = solved.coefficients[base:] / np.sqrt(np.maximum(np.diag(solved.covariance)[base:], 1e-300))
    places = [(k, position, shape.signs[column]) for k, shape in enumerate(chosen)
              for position, column in enumerate(kept[k])]
    wrong = [(float(sign * value), k, position) for value, (k, position, sign) in zip(sigma, places, strict=True)
             if sign * value < 0]
    return min(wrong)[1:] if wrong else None


def _drop_doubled(kept: list[list[int]]) -> bool:
    """Leaves out the last column of the last effect that has more than one (viscous friction beside the link's delay)."""
    for mine in reversed(kept):
        if len(mine) > 1:
            mine.pop()
            return True
    return False

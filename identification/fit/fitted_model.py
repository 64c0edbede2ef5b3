"""The model that is fitted: six springs, and the effects beyond them that are in force.

x = (ln c (6,), parameters of each term). With no terms it is the plain model of compliance.py.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from identification.fit.load_test import LoadTest
from identification.fit.priors import PriorModel
from identification.model.compliance import sensitivity
from identification.model.effects_in_force import (
    EFFECTS,
    SPRINGS,
    STEP,
    EffectInForce,
    added,
    added_by_each,
    as_felt,
    slopes_by_springs,
    split,
    together,
)
from identification.model.law_of import LawOf
from identification.model.load_state import LoadState

Array = NDArray[np.float64]
# The prior of a parameter is this many typical sizes wide: what is met in practice, and generous; and as wide as it is large
# where the search begins.
WIDE = 5.0
# Differences ahead and behind that differ by such a factor may reach over a jump; then a step so much shorter is tried.
UNLIKE, SHORTER = 10.0, 0.125


@dataclass(frozen=True, eq=False)
class Term(EffectInForce):
    """An effect that is fitted. start (P,): where the search begins; scale (P,): typical sizes of the parameters here; neutral
    (P,): where the effect is absent."""

    start: Array
    scale: Array
    neutral: Array

    def typical_sizes(self, values: Array) -> float:
        """How large the effect is with values (P,), in typical sizes: the norm of the parameters that say how large it is."""
        of_size = np.array([not parameter.shape for parameter in self.effect.parameters])
        return float(np.linalg.norm((values - self.neutral)[of_size] / self.scale[of_size]))


def predicted_deflection(data: LoadTest, x: Array, terms: Sequence[Term] = ()) -> Array:
    """Readings (n, 3) [m] the model gives for these rows; x (6 + P,)."""
    state = data.load_state(np.exp(x[SPRINGS]))
    if not terms and state.robot.link_mass is None:
        return state.elastic_position
    return np.asarray(state.elastic_position + state.of_weight[:, :3] + added(state, terms, x[EFFECTS])[:, :3])


def response(data: LoadTest, x: Array, terms: Sequence[Term] = ()) -> tuple[Array, Array]:
    """Readings (n, 3) [m] and their derivative (n, 3, 6 + P) by x: exact for the springs (eq. 14), differences for terms."""
    cell, compliance, values = data.cell, np.exp(x[SPRINGS]), x[EFFECTS]
    state = data.load_state(compliance)
    position, slope = sensitivity(cell.robot, state.theta, cell.flange_from_tcp, state.wrench, compliance, state.at_rest)
    slope = slope * compliance
    position = position + state.of_weight[:, :3]
    if not terms:
        return position, slope
    felt = as_felt(state, terms, values)
    each = added_by_each(state, felt, terms, values)
    by_springs = slopes_by_springs(state, felt, terms, values, each)[:, :3]
    by_parameter = [_by_own(state, felt, terms, values, each, which) for which in range(len(terms))]
    return position + together(state, each)[:, :3], np.concatenate([slope + by_springs, *by_parameter], axis=2)


def _by_own(
    state: LoadState, felt: LoadState, terms: Sequence[Term], values: Array, each: Sequence[Array], which: int,
) -> Array:
    """Slope (n, 3, p) of what all terms add, which is `each` (n, 6) at values (P,), by the parameters of one of them; felt: as
    in `added_by_each`."""
    term, parts = terms[which], split(values, terms)
    own, place = parts[which], sum(len(part) for part in parts[:which])
    of_force = term.effect.true_wrench(state, term.joint, own) is not None
    rows = felt if term.effect.of_robot else state
    if isinstance(term.effect, LawOf):
        return term.effect.columns(rows, term.joint, own)[:, :3]                        # linear in its coefficients

    def moved(share: float, k: int) -> Array:
        """Slope (n, 3) over this share of the step of its parameter k."""
        ahead, step = values.copy(), share * STEP * term.scale[k]
        ahead[place + k] += step
        if of_force:
            # All terms together: what the force is changes what the others feel.
            return np.asarray((added(state, terms, ahead) - here)[:, :3] / step)
        return np.asarray((term.contribution(rows, split(ahead, terms)[which]) - here)[:, :3] / step)

    here, slope = together(state, each) if of_force else each[which], np.empty((len(state), 3, len(own)))
    for k in range(len(own)):
        sides = np.array([moved(1.0, k), moved(-1.0, k)])
        # A force that is felt otherwise can set teeth on their other side: what jumps has no slope there.
        jumps = of_force and len(terms) > 1
        slope[:, :, k] = _beside_jumps(sides, partial(moved, k=k)) if jumps else sides.mean(axis=0)
    return slope


def _beside_jumps(sides: Array, moved: Callable[[float], Array]) -> Array:
    """Slope (n, 3) by differences that may reach over a jump. sides (2, n, 3): ahead and behind; moved: slope by a share of the
    step."""
    def size(slopes: Array) -> Array:
        return np.asarray(np.linalg.norm(slopes, axis=2, keepdims=True))

    sizes = size(sides)
    if not np.any(sizes.max(axis=0) > UNLIKE * sizes.min(axis=0)):
        return np.asarray(sides.mean(axis=0))
    nearer = np.array([moved(SHORTER), moved(-SHORTER)])
    # A jump is as large for a shorter step, its slope the larger; beyond the shorter step it is not seen.
    inside = size(nearer) > 0.5 / SHORTER * sizes
    taken = np.where(size(nearer) < 0.5 * sizes, nearer, sides) * ~inside
    return np.asarray(taken.sum(axis=0) / np.maximum((~inside).sum(axis=0), 1))


def with_terms(prior: PriorModel, terms: Sequence[Term]) -> PriorModel:
    """The prior with the effects' parameters: about the values where an effect is absent (about the start for those that do
    not enter linearly), several typical sizes wide, inside their bounds."""
    if not terms:
        return prior
    parameters = [parameter for term in terms for parameter in term.effect.parameters]
    start, scale, neutral = (np.concatenate([getattr(term, name) for term in terms]) for name in ("start", "scale", "neutral"))
    shape = np.array([parameter.shape for parameter in parameters])
    return replace(
        prior, term_mean=np.where(shape, start, neutral),
        term_std=np.where(shape, np.maximum(scale, np.abs(start)), np.maximum(WIDE * scale, np.abs(start - neutral))),
        term_low=np.array([parameter.low for parameter in parameters]),
        term_high=np.array([parameter.high for parameter in parameters]))

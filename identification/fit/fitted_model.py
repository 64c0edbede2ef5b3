"""The model that is fitted: six springs, and the effects beyond them that are in force.

x = (ln c (6,), parameters of each term). With no terms it is the plain model of compliance.py.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from identification.fit.load_test import LoadTest
from identification.fit.priors import PriorModel
from identification.model.compliance import equilibrium, sensitivity
from identification.model.effects_in_force import (
    EFFECTS,
    SPRINGS,
    STEP,
    EffectInForce,
    added,
    slopes_by_springs,
    split,
)

Array = NDArray[np.float64]
# The prior of a parameter is this many typical sizes wide: what is met in practice, and generous.
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


def predicted_deflection(data: LoadTest, x: Array, terms: Sequence[Term] = ()) -> Array:
    """Readings (n, 3) [m] the model gives for these rows; x (6 + P,)."""
    cell, rows, compliance = data.cell, data.rows, np.exp(x[SPRINGS])
    if not terms and cell.robot.link_mass is None:
        return equilibrium(cell.robot, rows.theta, cell.flange_from_tcp, rows.wrench, compliance).position
    state = data.load_state(compliance)
    return np.asarray((state.elastic + state.of_weight + added(state, terms, x[EFFECTS]))[:, :3])


def response(data: LoadTest, x: Array, terms: Sequence[Term] = ()) -> tuple[Array, Array]:
    """Readings (n, 3) [m] and their derivative (n, 3, 6 + P) by x: exact for the springs (eq. 14), differences for terms."""
    cell, compliance, values = data.cell, np.exp(x[SPRINGS]), x[EFFECTS]
    state = data.load_state(compliance)
    position, slope = sensitivity(cell.robot, state.theta, cell.flange_from_tcp, data.rows.wrench, compliance)
    slope = slope * compliance
    position = position + state.of_weight[:, :3]
    if not terms:
        return position, slope
    base = added(state, terms, values)
    by_springs = slopes_by_springs(state, terms, values, base)[:, :3]
    # All terms together: one of the force's measurement changes what the others feel.
    by_parameter = np.empty((len(state), 3, len(values)))
    felt = np.concatenate([np.full(len(own), term.effect.true_wrench(state, term.joint, own) is not None)
                           for term, own in zip(terms, split(values, terms), strict=True)])
    for k, size in enumerate(np.concatenate([term.scale for term in terms])):
        def moved(share: float, k: int = k, size: float = size) -> Array:
            step = np.zeros_like(values)
            step[k] = share * STEP * size
            return np.asarray((added(state, terms, values + step) - base)[:, :3] / step[k])

        sides = np.array([moved(1.0), moved(-1.0)])
        # A force that is felt otherwise can set teeth on their other side: what jumps has no slope there.
        by_parameter[:, :, k] = _beside_jumps(sides, moved) if felt[k] and len(terms) > 1 else sides.mean(axis=0)
    return position + base[:, :3], np.concatenate([slope + by_springs, by_parameter], axis=2)


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
        term_std=np.where(shape, np.maximum(scale, np.abs(start)), WIDE * scale),
        term_low=np.array([parameter.low for parameter in parameters]),
        term_high=np.array([parameter.high for parameter in parameters]))

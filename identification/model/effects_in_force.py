"""Effects in force beyond the six springs: what they add to the deviation, and its derivatives (docs/architecture.md).

The plain robot comes to rest at `theta~ + L dq` (compliance.py). There each effect in force contributes a displacement e of the
TCP (load_state.py), and the tool stands at `p = p_plain + e_p`, `R = Rot(e_r) R_plain`. What was identified is
x = (ln c (6,), parameters of the effects in their order, each in its own unit).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import accumulate

import numpy as np
from numpy.typing import NDArray

from identification.model.effects import Effect
from identification.model.law_of import LawOf
from identification.model.load_state import LoadState
from identification.model.rotations import Frame, rotation_matrix

Array = NDArray[np.float64]
# Relative step of the differences by ln c and by the parameters: truncation and rounding both far under the noise.
STEP = 1e-3
# The parts of x, and of all that has one entry, row or column for each parameter of it.
SPRINGS, EFFECTS = slice(0, 6), slice(6, None)


@dataclass(frozen=True, eq=False)
class EffectInForce:
    """An effect at a joint (1-based, None where it belongs to none)."""

    effect: Effect
    joint: int | None

    @property
    def label(self) -> str:
        """backlash[1], or the effect's name where it belongs to no joint."""
        return self.effect.name if self.joint is None else f"{self.effect.name}[{self.joint}]"

    @property
    def sentence(self) -> str:
        """The cause in plain words."""
        return self.effect.told(self.joint)

    @property
    def names(self) -> list[str]:
        """The parameters' names as in stiffness.json: backlash[1].half_gap_rad."""
        return [f"{self.label}.{parameter.name}" for parameter in self.effect.parameters]

    def contribution(self, rows: LoadState, values: Array) -> Array:
        """What it adds to the deviation (n, 6): position [m] and rotation vector [rad]; values of its parameters (P,)."""
        return self.effect.contribution(rows, self.joint, values)


def split(values: Array, effects: Sequence[EffectInForce]) -> list[Array]:
    """The parameter values of each effect, from those of all (P,)."""
    ends = list(accumulate(len(term.effect.parameters) for term in effects))
    return [values[start: end] for start, end in zip([0, *ends], ends, strict=False)]


def added(rows: LoadState, effects: Sequence[EffectInForce], values: Array) -> Array:
    """What the effects add to the deviation (n, 6): position [m] and rotation vector [rad], base frame; values (P,).

    The rows stand in the order in which the loads come: that order is the history of effects with a memory. Those of the robot
    feel the force that really acted, where another is one of the force's measurement.
    """
    return together(rows, added_by_each(rows, as_felt(rows, effects, values), effects, values))


def added_by_each(rows: LoadState, felt: LoadState, effects: Sequence[EffectInForce], values: Array) -> list[Array]:
    """What each of the effects adds (n, 6); felt: the rows under the force that really acted."""
    return [_one(rows, felt, term, own) for term, own in zip(effects, split(values, effects), strict=True)]


def together(rows: LoadState, each: Sequence[Array]) -> Array:
    """The sum (n, 6) of what effects add."""
    return np.asarray(sum(each, start=np.zeros((len(rows), 6))))


def _one(rows: LoadState, felt: LoadState, term: EffectInForce, own: Array) -> Array:
    """What one effect adds (n, 6), with values (P,) of its parameters; felt: the rows under the force that really acted."""
    return term.contribution(felt if term.effect.of_robot else rows, own)


def as_felt(rows: LoadState, effects: Sequence[EffectInForce], values: Array) -> LoadState:
    """The rows under the force that really acted, where another is one of the effects; values (P,)."""
    felt = rows
    for term, parameters in zip(effects, split(values, effects), strict=True):
        wrench = term.effect.true_wrench(rows, term.joint, parameters)
        if wrench is not None:
            felt = replace(felt, wrench=felt.wrench + wrench - rows.wrench)
    return felt


def displaced(pose: Frame, moved: Array) -> Frame:
    """Poses (n) displaced by moved (n, 6): position [m] and rotation vector [rad] in the outer frame."""
    return Frame(rotation_matrix(moved[:, 3:]) @ pose.rotation, pose.position + moved[:, :3])


def slopes_by_springs(
    rows: LoadState, felt: LoadState, effects: Sequence[EffectInForce], values: Array, each: Sequence[Array],
) -> Array:
    """Derivative (n, 6, 6) of what the effects add, which is `each` (n, 6), by ln c, by differences at the loaded pose: where
    that goes with softer springs changes what is small beside the deviation by as little again. felt: as in `added_by_each`."""
    result, softer = np.zeros((len(rows), 6, 6)), _softer(rows, felt, range(6))
    # What stays as it is where all springs are softer does not ask how soft they are: a wrench, an angle, a gear's own play.
    moved = [(term, own, here) for term, own, here in zip(effects, split(values, effects), each, strict=True)
             if not np.array_equal(_one(*softer, term, own), here)]
    if not moved:
        return result
    rest = together(rows, [here for _, _, here in moved])
    for joint in range(6):
        softer = _softer(rows, felt, [joint])
        result[:, :, joint] = (together(rows, [_one(*softer, term, own) for term, own, _ in moved]) - rest) / STEP
    return result


def _softer(rows: LoadState, felt: LoadState, joints: Sequence[int]) -> tuple[LoadState, LoadState]:
    """The rows and those under the force that really acted where the springs of these joints are softer by a step."""
    compliance = rows.compliance.copy()
    compliance[joints] *= np.exp(STEP)
    softer = rows.with_compliance(compliance)
    return softer, softer if felt is rows else felt.with_compliance(compliance)


def slopes(rows: LoadState, effects: Sequence[EffectInForce], values: Array) -> Array:
    """Derivative (n, 6, 6 + P) of what the effects add by x, by differences, the loaded pose held; rows at their loaded pose.

    Where a parameter changes the state a load history leaves behind, it is the derivative along that history.
    """
    result = np.empty((len(rows), 6, 6 + len(values)))
    felt = as_felt(rows, effects, values)
    result[:, :, SPRINGS] = slopes_by_springs(rows, felt, effects, values, added_by_each(rows, felt, effects, values))
    place = 6
    for term, own in zip(effects, split(values, effects), strict=True):
        if isinstance(term.effect, LawOf):
            # Linear in its coefficients.
            result[:, :, place: place + len(own)] = term.effect.columns(rows, term.joint, own)
            place += len(own)
            continue
        for k, size in enumerate(term.effect.typical(rows, term.joint)):
            step = np.zeros(len(own))
            step[k] = STEP * size
            ahead, behind = term.contribution(rows, own + step), term.contribution(rows, own - step)
            result[:, :, place] = (ahead - behind) / (2 * step[k])
            place += 1
    return result


@dataclass(frozen=True, eq=False)
class OfEffects:
    """slopes (N, 6, 6 + P): `slopes` of the rows; squares (N, 2): `squares`."""

    slopes: Array
    squares: Array

    def of(self, rows: NDArray[np.intp]) -> OfEffects:
        """Those of these rows alone."""
        return OfEffects(self.slopes[rows], self.squares[rows])


def squares(rows: LoadState, effects: Sequence[EffectInForce], values: Array) -> Array:
    """Squares of what each effect adds, its own law with it, position [m^2] and rotation [rad^2], summed over the effects
    (n, 2)."""
    alone: dict[tuple[str, int | None], Array] = {}
    for term, own in zip(effects, split(values, effects), strict=True):
        effect = term.effect.of if isinstance(term.effect, LawOf) else term.effect
        key = (effect.stored, term.joint)
        alone[key] = alone.get(key, np.zeros((len(rows), 6))) + term.contribution(rows, own)
    return np.asarray(np.sum([sizes(each) for each in alone.values()], axis=0))


def sizes(moved: Array) -> Array:
    """Squared norms (n, 2) of position and rotation (n, 6)."""
    return np.asarray((moved**2).reshape(-1, 2, 3).sum(axis=2))


def turned(side: Array) -> NDArray[np.bool_]:
    """True (n,) where an effect rests at another end of its play (side: -1 or 1, 0 in between) than it last did."""
    known = np.flatnonzero(side)
    changed = np.zeros(len(side), dtype=bool)
    changed[known[1:]] = side[known[1:]] != side[known[:-1]]
    return changed

"""A named effect's real law is not exactly the dictionary's: what its other shapes, and those of the laws near it, add.

The model to correct with carries the shapes' coefficients beside the effect, as they were identified, with their covariance: a
prediction follows the law that the data show, and its standard deviation has what the data leave open of the law.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from identification.model.effects import Effect, Parameter, effects
from identification.model.load_state import LoadState

Array = NDArray[np.float64]
PREFIX = "law_of_"
# Coefficients are shares of the typical size; a law a hundred times that is none.
BOUND = 100.0
# How many ways there are in which a structure may stiffen (`stiffening_ways`).
WAYS = 18


# Load [N] at which a structure that stiffens with the load has changed by its whole coefficient.
LOAD_N = 300.0


class LawOf(Effect):
    """`sum_k a_k shape_k`, each shape for the typical size of its law. Not in the dictionary: it comes with the effect `of`."""

    family = "gear"
    sentence = "the law of the named effect is not exactly the dictionary's"
    settles = ""
    formula_source = "the effect's own law and those near it (docs/effects.md), superposed: engineering judgement"

    def __init__(self, of: Effect) -> None:
        self.of = of
        self.name = f"{PREFIX}{of.name}"
        self.law = of.law
        self.of_robot = of.of_robot
        self.joints = of.joints
        near = [law for name in of.near_laws if name in effects() for law in (effects()[name], *effects()[name].other_laws)
                if law.law == (of.law if of.weighed else "")]
        self.shapes = [(law, choice) for law in (of, *near) if near or _shaped(law)
                       for choice in itertools.product(*(parameter.grid or (None,) for parameter in _but_the_weight(law)))]
        count = len(self.shapes) + of.ways + of.stiffens * WAYS
        self.parameters = tuple(Parameter(f"shape_{k + 1}", "1", 1.0, -BOUND, BOUND) for k in range(count))
        if of.weighed:
            # The weight under which its shapes are those of the effect: it is carried, not fitted.
            self.parameters += (of.parameters[-1],)

    def contribution(self, rows: LoadState, joint: int | None, values: Array) -> Array:
        moved = np.zeros((len(rows), 6))
        for value, (law, size) in zip(values, self._of_typical_size(rows, joint, values), strict=False):
            moved += value * law.contribution(rows, joint, size)
        if self.of.ways:
            moved += self._further(rows, joint) @ values[len(self.shapes):][:self.of.ways]
        if self.of.stiffens:
            along, share, by = _directions(rows, self._linear(rows, joint))
            moved[:, :3] += np.einsum("kn,kin->ni", share * (values[-WAYS:].reshape(3, -1) @ by), along)
        return moved

    def columns(self, rows: LoadState, joint: int | None, values: Array) -> Array:
        """What each shape adds at its typical size (n, 6, m): position [m] and rotation [rad]; values (m,)."""
        columns = np.zeros((len(rows), 6, len(self.parameters)))
        for k, (law, size) in enumerate(self._of_typical_size(rows, joint, values)):
            columns[:, :, k] = law.contribution(rows, joint, size)
        if self.of.ways:
            columns[:, :, len(self.shapes):][:, :, :self.of.ways] = self._further(rows, joint)
        if self.of.stiffens:
            columns[:, :3, -WAYS:] = stiffening_ways(rows, self._linear(rows, joint))
        return columns

    def _of_typical_size(self, rows: LoadState, joint: int | None, values: Array) -> Iterator[tuple[Effect, Array]]:
        """The law of each shape, and its values (P,); values (m,): this law's own."""
        for law, choice in self.shapes:
            size = next(k for k, value in enumerate(choice) if value is None)
            own = np.array([0.0 if value is None else value for value in choice])
            own[size] = law.typical(rows, joint)[size]
            yield law, np.append(own, values[-1]) if law.weighed else own

    def _further(self, rows: LoadState, joint: int | None) -> Array:
        return self.of.further_ways(rows, joint, self.of.typical(rows, joint))

    def _linear(self, rows: LoadState, joint: int | None) -> Array:
        """What a structure of typical size that does not stiffen adds to the position (n, 3) [m]."""
        return self.of.contribution(rows, joint, self.of.typical(rows, joint))[:, :3]


def stiffening_ways(rows: LoadState, moved: Array) -> Array:
    """What a structure that moves the tool by `moved` (n, 3) [m] adds (n, 3, WAYS) [m] where it yields otherwise: more or less
    along the arm, across it and upright, alike everywhere, with the angles of joints 2 and 3, which set the weight it carries,
    and with the size of the load; each for a coefficient of 1. Rotations stay those of the linear law."""
    along, share, by = _directions(rows, moved)
    return np.asarray(np.einsum("kn,kin,fn->nikf", share, along, by).reshape(len(moved), 3, WAYS))


def _directions(rows: LoadState, moved: Array) -> tuple[Array, Array, Array]:
    """The three directions (3, 3, n), the share of `moved` in each (3, n) [m], and what they stiffen with (6, n)."""
    q1, q2, q3 = rows.loaded[:, :3].T
    zero, one = np.zeros_like(q1), np.ones_like(q1)
    along = np.array([[np.cos(q1), np.sin(q1), zero], [-np.sin(q1), np.cos(q1), zero], [zero, zero, one]])
    by = np.array([one, np.sin(q2), np.cos(q2), np.sin(q3), np.cos(q3), np.linalg.norm(rows.wrench[:, :3], axis=1) / LOAD_N])
    return along, np.einsum("kin,ni->kn", along, moved), by


def uncertain(effect: Effect) -> bool:
    """Whether an effect's law has a shape that real ones need not follow."""
    return (effect.stiffens or effect.ways > 0 or bool(effect.near_laws) or _shaped(effect)) and not effect.where


def _shaped(effect: Effect) -> bool:
    return any(parameter.grid for parameter in _but_the_weight(effect))


def _but_the_weight(effect: Effect) -> tuple[Parameter, ...]:
    return effect.parameters[:-1] if effect.weighed else effect.parameters


def known(name: str) -> Effect | None:
    """The effect that stiffness.json stores under this name, or the law of one; None where there is none."""
    plain, _, law = name.removeprefix(PREFIX).partition(".")
    named = effects().get(plain)
    of = next((one for one in (named, *named.other_laws) if one.law == law), None) if named else None
    if not name.startswith(PREFIX):
        return of
    return LawOf(of) if of is not None and uncertain(of) else None

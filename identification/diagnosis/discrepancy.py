"""A named effect's real law is not exactly the dictionary's: how far it may be off, as a term that is integrated out.

The effect's other shapes (and those of the laws near it) are free beside it, each within a share of its own size. Without
them the stiffnesses take up what the law does not give, and their intervals are too narrow for it.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from identification.fit.fitted_model import WIDE, Term
from identification.model.effects import Effect, Parameter, effects
from identification.model.load_state import LoadState

Array = NDArray[np.float64]
# Another shape's coefficient, 1 sigma, as a share of the effect's own size: laws of real gears differ by some ten per cent.
SHARE = 0.3


class LawDiscrepancy(Effect):
    """What the shapes of an effect add, one coefficient each, in typical sizes. Not in the dictionary."""

    family = "gear"
    of_robot = False
    sentence = "the law of the named effect is not exactly the dictionary's"
    settles = ""

    def __init__(self, of: Effect, shapes: int) -> None:
        # An effect of the dictionary is a class with a name and parameters of its own; these are one for each effect in force.
        self.of = of
        self.name = f"law_of_{of.name}"                                                     # type: ignore[misc]
        self.parameters = tuple(                                                            # type: ignore[misc]
            Parameter(f"shape_{k + 1}", "1", 1.0, -100.0, 100.0) for k in range(shapes))

    def contribution(self, rows: LoadState, joint: int | None, values: Array) -> Array:
        moved = np.zeros((len(rows), 6))
        moved[:, :3] = shapes(self.of, rows, joint) @ values
        return moved


def shapes(effect: Effect, rows: LoadState, joint: int | None) -> Array:
    """Columns (n, 3, m) [m] of an effect's shapes and of the laws near it, each for its typical size."""
    near = [effects()[name] for name in effect.near_laws if name in effects()]
    signatures = [signature for law in (effect, *near) for signature in law.signatures(rows, joint)]
    return np.stack([signature.rows[:, :, 0] * signature.scale[0] for signature in signatures], axis=2)


def discrepancies(rows: LoadState, terms: tuple[Term, ...]) -> tuple[Term, ...]:
    """One more term for each whose effect has shapes; its size comes from the term's start."""
    free = []
    for term in terms:
        effect = term.effect
        if effect.where or not uncertain(effect):
            continue
        count = shapes(effect, rows, term.joint).shape[2]
        size = SHARE * abs(float(term.start[0] - term.neutral[0])) / float(effect.typical(rows, term.joint)[0])
        zero = np.zeros(count)
        free.append(Term(LawDiscrepancy(effect, count), term.joint, scale=np.full(count, max(size, 1e-6) / WIDE), start=zero,
                         neutral=zero))
    return tuple(free)


def uncertain(effect: Effect) -> bool:
    """Whether an effect's law has a shape that real ones need not follow."""
    return bool(effect.near_laws) or any(parameter.grid for parameter in effect.parameters)

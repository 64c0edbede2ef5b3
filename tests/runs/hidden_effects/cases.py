"""Which cases the benchmark and the tests share: one seed, one case of each kind."""

from __future__ import annotations

import numpy as np

from tests.virtual_cell.cell import DICTIONARY, OUTSIDE, Hidden, draw

KINDS = ("single", "null", "outside", "pair")


def hidden_in(seed: int, kind: str) -> tuple[Hidden, ...]:
    """What is hidden: drawn from the seed, the same for every design. A pair is of two different effects."""
    rng = np.random.default_rng([seed, 99])
    if kind == "null":
        return ()
    first = draw(rng, OUTSIDE if kind == "outside" else None)
    if kind != "pair":
        return (first,)
    return (first, draw(rng, [name for name in DICTIONARY if name != first.effect]))

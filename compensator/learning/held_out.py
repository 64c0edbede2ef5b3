"""What was learned, tried on stretches of the path that it was not learned from."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from compensator.learning.posterior import expected, posterior
from compensator.learning.sizes import Sizes, with_remainder, without_remainder
from compensator.learning.terms import Terms
from identification.common.arrays import rms

# The path is left out in so many stretches, one after the other; neighbours are too alike to be left out one by one.
STRETCHES, FEWEST_PLACES = 8, 16
TRIES = 4


@dataclass(frozen=True)
class HeldOut:
    """RMS [m] over all rows, each in a stretch that was left out. known: what the model as it was leaves; physical: with
    springs, set-up and drift learned from the other stretches; learned: with the remainder, too. better: mean of the squares
    gained by a stretch over its standard error."""

    known: float
    physical: float
    learned: float
    better: float
    stretches: int

    @property
    def gain(self) -> float:
        """Share of the RMS that the model as it was leaves and learning takes away; negative: it makes it worse."""
        return 1.0 - self.learned / self.known if self.known > 0 else 0.0

    def as_dict(self) -> dict[str, Any]:
        """JSON values."""
        return {"stretches": self.stretches, "known_um": 1e6 * self.known, "physical_um": 1e6 * self.physical,
                "learned_um": 1e6 * self.learned, "gain": self.gain, "standard_errors": self.better}


def held_out(terms: Terms, sizes: Sizes) -> HeldOut | None:
    """Each stretch by what the others teach, noise and remainder sized anew by them; None: too few places."""
    rows = terms.rows
    places = np.unique(rows.place)
    if len(places) < FEWEST_PLACES:
        return None
    stretch = np.empty(len(rows), dtype=np.intp)
    for number, part in enumerate(np.array_split(places, STRETCHES)):
        stretch[np.isin(rows.place, part)] = number
    physical, learned = np.empty(len(rows)), np.empty(len(rows))
    for number in range(STRETCHES):
        out = stretch == number
        rest, left = terms.select(~out), terms.select(out)
        alone = without_remainder(rest, sizes, TRIES)
        physical[out] = left.residual - expected(left, posterior(rest, alone))
        learned[out] = physical[out]
        if sizes.amplitude > 0:
            with_it = with_remainder(rest, sizes, sizes.length, TRIES)
            learned[out] = left.residual - expected(left, posterior(rest, with_it))
    won = terms.residual**2 - learned**2
    by_stretch = np.array([won[stretch == number].mean() for number in range(STRETCHES)])
    error = float(by_stretch.std(ddof=1) / np.sqrt(STRETCHES))
    return HeldOut(rms(terms.residual), rms(physical), rms(learned), float(by_stretch.mean() / max(error, 1e-30)), STRETCHES)

"""How large a cause must be for rows to show it: what an `adequate` is worth.

A cause of a typical sizes gives its score a noncentrality a^2 G once the springs are free (projection.py), with G its
information under the noise of the rows. A score is noticed where it passes what five in a hundred data sets without any cause
reach. The noise is fitted to rows that have the cause in them, and its parts grow by what they can take of it: in ln of each,
their covariance times the gradient -a^2/2 dG/dln (one part alone with E of d numbers grows by ln(1 + E/d)/2). Of several
parameters a cause may have any direction: G is that of all but the worst fifth of them. Of several shapes the one in the middle
of the range counts: not the easiest, not the hardest.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from identification.diagnosis.detect import base_of, shares
from identification.diagnosis.dictionary import Entry, dictionary_of
from identification.diagnosis.projection import Base, information_blocks
from identification.fit.gram import NoiseGram
from identification.fit.noise import SMALLEST_LOG
from identification.fit.posterior import Posterior
from identification.model.effects import Effect

Array = NDArray[np.float64]
# What is called noticed or named is so with this probability, over the noise and over the cause's direction.
POWER = 0.8
# Beyond so many typical sizes it is never noticed.
NEVER = 1e3
# So much information is none.
NOTHING = 1e-12
# Sizes that are tried, as multiples of what would show in a noise that is known; differences in ln of a part of the noise.
SIZES = np.geomspace(1.0, 10.0, 16)
STEP = 0.1


@dataclass(frozen=True, eq=False)
class Showing:
    """From which size on [typical sizes] a cause would have been noticed, with 80 % probability; typical: that size on this
    robot, in the unit of the parameter that says how large it is; largest [m]: how far the tool moves at `size` in the row in
    which it moves most."""

    entry: Entry
    size: float
    typical: float
    largest: float

    @property
    def of_typical_size(self) -> bool:
        """Whether one of its typical size would have been."""
        return self.size <= 1.0

    @property
    def typical_largest(self) -> float:
        """How far one of its typical size moves the tool [m], in the row in which it moves most."""
        return self.largest / self.size

    def as_dict(self) -> dict[str, Any]:
        """JSON values; sizes are null where it is never noticed."""
        parameter = self.entry.effect.size_parameter
        never = self.size >= NEVER
        return {"effect": self.entry.effect.name, "joint": self.entry.joint, "parameter": parameter.name,
                "unit": parameter.unit, "typical": self.typical, "noticed_from": None if never else self.size * self.typical,
                "noticed_from_typical_sizes": None if never else self.size,
                "noticed_from_um": None if never else 1e6 * self.largest, "typical_um": 1e6 * self.typical_largest}


def showing(fitted: Posterior, catalogue: dict[str, Effect], critical: float) -> tuple[Showing, ...]:
    """Of every effect of the catalogue at every joint, beside the fitted springs; critical: the surprise that is noticed
    (detect.py)."""
    dictionary = dictionary_of(fitted.load_state, fitted.at_map.noise, catalogue)
    base = base_of(fitted)
    information, tail = information_blocks(base, dictionary), np.minimum(10.0**-critical / shares(dictionary), 0.5)
    found = []
    for entry in dictionary.entries:
        each = [(*weakest(information[s, : dictionary.widths[s], : dictionary.widths[s]]), s)
                for s in dictionary.unweighed(entry)]
        _, way, middle = sorted(each, key=lambda item: item[0])[len(each) // 2]
        signal = dictionary.columns[:, :, middle, : len(way)] @ way
        size = _size(fitted, base, signal, needed(float(tail[middle]), len(way)))
        shape = dictionary.signatures[middle]
        moved = np.linalg.norm((shape.rows[:, :3] * shape.scale) @ way, axis=1).max()
        found.append(Showing(entry, size, dictionary.amplitude(entry.signatures.start), size * float(moved)))
    return tuple(found)


def _size(fitted: Posterior, base: Base, signal: Array, distance: float) -> float:
    """At which size a signal (n, 3), of a typical one, is at this distance from the springs in the noise that is fitted beside
    it; NEVER beyond the largest that is tried."""
    gram, logs = NoiseGram(fitted.at_map.noise, fitted.row_weight, base.design, signal), fitted.components.logs

    def left(at: Array) -> Array:
        """G (S,) of the signal, the springs free, for the logarithms (S, 6) of the noise's parts."""
        products = gram(np.maximum(at, SMALLEST_LOG))[0]
        cross = products[:, :-1, -1:]
        taken = np.linalg.solve(products[:, :-1, :-1] + base.precision, cross)
        return np.asarray(products[:, -1, -1] - np.sum(cross * taken, axis=(1, 2)))

    unit = STEP * np.eye(len(logs))
    here, ahead, behind = np.split(left(logs + np.concatenate([0 * unit[:1], unit, -unit])), [1, 1 + len(unit)])
    if here[0] < NOTHING:
        return NEVER
    sizes = distance / np.sqrt(here[0]) * SIZES
    pull = fitted.components_covariance @ (behind - ahead) / (4 * STEP)
    grown = np.multiply.outer(sizes**2, pull)
    grown = np.where(grown > 0, 0.5 * np.log1p(2 * np.maximum(grown, 0)), np.maximum(grown, -1.0))
    passed = sizes * np.sqrt(np.maximum(left(logs + grown), 0.0))
    first = int(np.argmax(passed >= distance))
    if passed[first] < distance:
        return NEVER
    if first == 0:
        return float(sizes[0])
    return float(np.interp(distance, passed[first - 1: first + 1], sizes[first - 1: first + 1]))


def needed(tail: float, degrees: int) -> float:
    """Root of the noncentrality with which chi-squared of so many degrees passes, in POWER of the draws, what it passes with
    probability `tail` by itself."""
    from scipy.special import chdtri, chndtrinc

    return float(np.sqrt(chndtrinc(chdtri(degrees, tail), degrees, 1.0 - POWER)))


def weakest(information: Array) -> tuple[float, Array]:
    """Root of the information (p, p) of a block, what a cause of unit size gives in all but the worst fifth of the directions
    that it may have; and the direction (p,) at that fifth."""
    directions = _directions(len(information))
    along = np.einsum("di,ij,dj->d", directions, information, directions)
    at = int(np.argsort(along)[int((1.0 - POWER) * len(along))])
    return float(np.sqrt(max(along[at], NOTHING))), directions[at]


@cache
def _directions(width: int) -> Array:
    """Unit vectors (400, width), evenly at random; of a single parameter the one."""
    if width == 1:
        return np.ones((1, 1))
    drawn = np.random.default_rng(0).standard_normal((400, width))
    return np.asarray(drawn / np.linalg.norm(drawn, axis=1, keepdims=True))

"""How large a cause must be for rows to show it: what an answer is worth that sees nothing more.

A cause of a typical sizes gives its score a noncentrality a^2 G once the springs, and what is named, are free (projection.py),
with G its information under the noise of the rows. A score is noticed where it passes what five in a hundred data sets without
any cause reach, in four cases of five over the noise, over the directions that a cause of several parameters may have, and over
what its real law may be where that is not known exactly. The noise is fitted to rows that have the cause in them, and its parts
grow by what they can take of it: in ln of each, their covariance times the gradient -a^2/2 dG/dln (one part alone with E of d
numbers grows by ln(1 + E/d)/2). Of several shapes the one in the middle of the range counts: not the easiest, not the hardest.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cache, cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from identification.diagnosis.detect import base_of, shares
from identification.diagnosis.dictionary import Dictionary, Entry, dictionary_of
from identification.diagnosis.projection import Base, information_blocks
from identification.diagnosis.replicates import FittedNoise
from identification.diagnosis.search import LAW_SHARE
from identification.fit.gram import NoiseGram
from identification.fit.noise import Weights
from identification.fit.noise_parts import SMALLEST_LOG
from identification.fit.posterior import Posterior
from identification.model.effects import Effect
from identification.model.effects_in_force import SPRINGS
from identification.model.law_of import uncertain

Array = NDArray[np.float64]
# What is called noticed or named is so with this probability.
POWER = 0.8
# Beyond so many typical sizes it is never noticed.
NEVER = 1e3
# So much information is none.
NOTHING = 1e-12
# Sizes that are tried, as multiples of what would show in a noise that is known, AT_ONCE of them together; differences in ln
# of a part of the noise.
SIZES = np.geomspace(0.5, 20.0, 24)
AT_ONCE = 8
STEP = 0.1


@dataclass(frozen=True, eq=False)
class Showing:
    """From which size on [typical sizes] a cause would have been noticed, with 80 % probability; typical: that size on this
    robot, in the unit of the parameter that says how large it is; largest [m]: how far the tool moves at `size` in the row in
    which it moves most. springs (6,): what one of typical size leaves each stiffness off by, in ln k, where six springs are
    fitted to it. weighed: whether all this is only so where no weight, which nobody stated, holds its gear on one side."""

    entry: Entry
    size: float
    typical: float
    largest: float
    springs: Array
    weighed: bool

    @property
    def of_typical_size(self) -> bool:
        """Whether one of its typical size would have been."""
        return self.size <= 1.0

    @property
    def typical_largest(self) -> float:
        """How far one of its typical size moves the tool [m], in the row in which it moves most."""
        return self.largest / self.size

    @property
    def unnoticed(self) -> Array:
        """What the largest one that would not have been noticed, of typical size at most, leaves each stiffness off by (6,),
        in ln k."""
        return self.springs * min(self.size, 1.0)

    def leaves_off(self, joint: int | None = None) -> str:
        """The same of one stiffness, counted from 0, or of the one it leaves off most, in words."""
        which = int(np.argmax(self.unnoticed)) if joint is None else joint
        percent = 100 * float(np.expm1(self.unnoticed[which]))
        return f"k{which + 1} by {percent:.0f} %" if percent >= 99.5 else f"k{which + 1} by {percent:.2g} %"

    def as_dict(self) -> dict[str, Any]:
        """JSON values; sizes are null where it is never noticed."""
        parameter = self.entry.effect.size_parameter
        never = self.size >= NEVER
        return {"effect": self.entry.effect.name, "joint": self.entry.joint, "parameter": parameter.name,
                "unit": parameter.unit, "typical": self.typical, "noticed_from": None if never else self.size * self.typical,
                "noticed_from_typical_sizes": None if never else self.size,
                "noticed_from_um": None if never else 1e6 * self.largest, "typical_um": 1e6 * self.typical_largest,
                "typical_stiffness_percent": [round(100 * float(np.expm1(off)), 2) for off in self.springs],
                "unless_held_by_weight": self.weighed}


def showing(fitted: Posterior, catalogue: dict[str, Effect], critical: float) -> tuple[Showing, ...]:
    """Of every effect of the catalogue at every joint, beside the fitted model, but those that it has and other laws of gears
    that have one in it; critical: the surprise that is noticed (detect.py)."""
    dictionary = dictionary_of(fitted.load_state, fitted.at_map.noise, catalogue)
    labels = {term.label for term in fitted.terms}
    geared = {entry.joint for entry in dictionary.entries if entry.label in labels and entry.effect.gear_law}
    others = [entry for entry in dictionary.entries
              if entry.label not in labels and not (entry.effect.gear_law and entry.joint in geared)]
    return noticed_from(base_of(fitted, dictionary), dictionary, others, FittedNoise.of(fitted), critical)


def noticed_from(
    base: Base, dictionary: Dictionary, entries: Iterable[Entry], noise: FittedNoise, critical: float,
) -> tuple[Showing, ...]:
    """Of these entries of the dictionary, beside a linearised model."""
    information, tail = information_blocks(base, dictionary), np.minimum(10.0**-critical / shares(dictionary), 0.5)
    looked_at = []
    for entry in entries:
        each = {s: along(information[s, : dictionary.widths[s], : dictionary.widths[s]]) for s in dictionary.unweighed(entry)}
        middle = in_the_middle({s: float(strength[worst_fifth(strength)]) for s, strength in each.items()})
        way = directions(int(dictionary.widths[middle]))[worst_fifth(each[middle])]
        looked_at.append((entry, len(each) < len(entry.signatures), middle, each[middle], way))
    if not looked_at:
        return ()
    signals = [dictionary.of(middle) @ way for _, _, middle, _, way in looked_at]
    beside = _FittedBeside(base, noise, np.stack(signals, axis=2))
    springs = np.abs(base.inverse @ base.cross(beside.signals))[SPRINGS]
    found = []
    for k, (entry, weighed, middle, strength, way) in enumerate(looked_at):
        asked, unit = needed(float(tail[middle]), len(way)), strength[worst_fifth(strength)]
        size = NEVER
        if unit**2 > NOTHING:
            differs = LAW_SHARE if uncertain(entry.effect) else 0.0
            size = beside.noticed_from(k, asked / unit * SIZES, strength, asked, differs)
        shape = dictionary.signatures[middle]
        moved = np.linalg.norm((shape.rows * shape.scale) @ way, axis=1).max()
        found.append(Showing(entry, size, dictionary.amplitude(entry.signatures.start), size * float(moved),
                             springs[:, k], weighed))
    return tuple(found)


@dataclass(frozen=True, eq=False)
class _FittedBeside:
    """The noise that is fitted beside signals (n, 3, E), each by itself."""

    base: Base
    noise: FittedNoise
    signals: Array

    def noticed_from(self, signal: int, sizes: Array, strength: Array, asked: float, differs: float) -> float:
        """The smallest of these sizes (S,) at which a signal is noticed; strength, asked, differs: as of `chance`."""
        noticed = np.zeros(0)
        # One after the other would be slow, and most are noticed at one of the smallest.
        for some in np.split(sizes, range(AT_ONCE, len(sizes), AT_ONCE)):
            distance = np.multiply.outer(some * self._left(signal, some), strength)
            noticed = np.append(noticed, chance(distance, asked, differs))
            if np.any(noticed >= POWER):
                break
        return _reached(sizes, noticed)

    def _left(self, signal: int, sizes: Array) -> Array:
        """Distance of a signal of these sizes (S,) from the springs in the noise that is fitted beside it, as a share of that
        in the noise as it is (S,)."""
        here, pull = self._pulls
        grown = np.multiply.outer(sizes**2, pull[signal])
        grown = np.where(grown > 0, 0.5 * np.log1p(2 * np.maximum(grown, 0)), np.maximum(grown, -1.0))
        alone = self._information(self.signals[:, :, signal: signal + 1], self.noise.components.logs + grown)
        return np.asarray(np.sqrt(alone[:, 0] / here[signal]))

    @cached_property
    def _pulls(self) -> tuple[Array, Array]:
        """Information (E,) in the noise as it is, and where each signal of unit size pulls its parts (E, 6)."""
        logs = self.noise.components.logs
        unit = STEP * np.eye(len(logs))
        every = self._information(self.signals, logs + np.concatenate([0 * unit[:1], unit, -unit]))
        here, ahead, behind = np.split(every, [1, 1 + len(unit)])
        return here[0], (behind - ahead).T @ self.noise.covariance / (4 * STEP)

    def _information(self, signals: Array, at: Array) -> Array:
        """G (S, E) of each signal (n, 3, E), the springs free, for the logarithms (S, 6) of the noise's parts."""
        base = self.base
        assert isinstance(base.weights, Weights)
        q, columns = len(base.precision), np.concatenate([base.design, signals], axis=2)
        gram = NoiseGram(base.weights.model, self.noise.row_weight, columns[:, :, :-1], columns[:, :, -1])
        products = gram(np.maximum(at, SMALLEST_LOG))[0]
        cross = products[:, :q, q:]
        taken = np.linalg.solve(products[:, :q, :q] + base.precision, cross)
        own = np.diagonal(products[:, q:, q:], axis1=1, axis2=2)
        return np.asarray(np.maximum(own - np.sum(cross * taken, axis=1), 0.0))


def _reached(sizes: Array, noticed: Array) -> float:
    """The smallest of the sizes (S,) at which this share, of the first of them, is POWER; NEVER beyond the largest."""
    first = int(np.argmax(noticed >= POWER))
    if noticed[first] < POWER:
        return NEVER
    if first == 0:
        return float(sizes[0])
    return float(np.exp(np.interp(POWER, noticed[first - 1: first + 1], np.log(sizes[first - 1: first + 1]))))


def chance(distance: Array, asked: float, differs: float) -> Array:
    """With what probability a cause at a distance (..., directions) from the springs is noticed, all directions alike, where
    one at `asked` is with POWER; differs: by what share, 1 sigma, its real law's distance is off the dictionary's."""
    from scipy.special import ndtr, ndtri

    return np.asarray(np.mean(ndtr((distance - asked + ndtri(POWER)) / np.hypot(1.0, differs * distance)), axis=-1))


def needed(tail: float, degrees: int) -> float:
    """Root of the noncentrality with which chi-squared of so many degrees passes, in POWER of the draws, what it passes with
    probability `tail` by itself."""
    from scipy.special import chdtri, chndtrinc

    return float(np.sqrt(chndtrinc(chdtri(degrees, tail), degrees, 1.0 - POWER)))


def along(information: Array) -> Array:
    """Root of the information (..., p, p) of a block along each direction that a cause may have (..., directions): what one of
    unit size gives."""
    ways = directions(information.shape[-1])
    return np.asarray(np.sqrt(np.maximum(np.sum(ways @ information * ways, axis=-1), NOTHING)))


def in_the_middle(strength: dict[int, float]) -> int:
    """The shape in the middle of the range, not the easiest and not the hardest; of two the harder."""
    return sorted(strength, key=lambda shape: strength[shape])[(len(strength) - 1) // 2]


def worst_fifth(strength: Array) -> int:
    """The direction of those (directions,) that all but the worst fifth surpass."""
    return int(np.argsort(strength)[int((1.0 - POWER) * len(strength))])


def weakest(information: Array) -> Array:
    """What a cause of unit size gives in all but the worst fifth of the directions (...), from the information (..., p, p)."""
    strength = along(information)
    place = int((1.0 - POWER) * strength.shape[-1])
    return np.asarray(np.partition(strength, place, axis=-1)[..., place])


@cache
def directions(width: int) -> Array:
    """Unit vectors (400, width), evenly at random; of a single parameter the one."""
    if width == 1:
        return np.ones((1, 1))
    drawn = np.random.default_rng(0).standard_normal((400, width))
    return np.asarray(drawn / np.linalg.norm(drawn, axis=1, keepdims=True))

"""Which targets the correction is expected to leave farther off the plan than they were: all that is known to be unknown.

Uncorrected the tool stands at b + e off the plan, corrected at r + e + f u. b: deviation of the program as it was given; r:
what the correction leaves of that by the same model; e ~ N(0, S): what is wrong with the deviation itself, in both passes;
f ~ N(0, s^2) along u, the deviation's direction: by how much more or less than followed the force grows where the corrected
tool stands deeper, which the corrected pass alone has. With m = r - b a target gets worse where

    |r + e + f u| > |b + e|,    that is    (m + f u) . (2 b + m + f u + 2 e) > 0 .

Given f the left side is a normal number, so the probability is a value of its distribution function, averaged over f. e holds
the covariance of the prediction (stiffnesses, effects and what the diagnosis left ambiguous, scatter of the force and the
sensor's zero, a predicted force, what was learned or no measured part shows), the sensor's gain and the robot in motion, both
in proportion to the deviation, how the sensor is turned, where the robot stands without load, and what lies between targets,
for whoever stands beside one. Where a program that yields meets another force than one on its plan S is the mean of both
passes', and by what the corrected one's is wider across m goes into the mean of the left side.

Springs that are known to a factor make of -m . (b + e) a number that is not normal: where it is positive a log-normal one of
the same mean and variance (wide_springs.py), to which the other causes are added: a shifted log-normal of mean, variance and
third moment of the sum, which is the normal number where springs are known well.

Assumed: otherwise normal errors, the causes independent of each other; what lies between targets along the deviation, as where
a force begins or ends; the growth of the force in proportion to how much of the correction is made, and of either sign; in
what was b when the log is that of a corrected pass, no error of the cutting stiffness. Targets depend on each other: their sum
is the number that is expected, and says nothing of how far it scatters.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from itertools import pairwise
from math import erfc, sqrt
from typing import Any

import numpy as np
from numpy.typing import NDArray

from compensator.correction.correction import Correction
from compensator.correction.engagement import CorrectedPass
from compensator.correction.expected_left import in_proportion
from compensator.correction.predict import Predicted
from compensator.correction.prediction import Prediction
from identification.common.arrays import Array, directions
from identification.model.compliance import CHUNK
from identification.model.kinematics import chunks

TINY = 1e-15
Indices = NDArray[np.intp]
# f so far out, and what so many sigma leave of a probability, is nothing.
OUTMOST, NOTHING = 4.5, 6.5
# A log-normal distribution whose sigma is under this share of its mean is a normal one.
ROUND = 1e-5
PLACES, WEIGHTS = np.polynomial.legendre.leggauss(8)


@dataclass(frozen=True, eq=False)
class Risk:
    """What the probabilities take of the M targets, without what lies between them, by the names above: mm |m|^2, bm = b . m,
    um = u . m, ub = u . b, [m^2] and [m]; mem, ueu and uem [m^4], [m^2], [m^3]: S seen along m and u; aside [m^2]:
    by how much the corrected pass's variance across m is more; grows: s [m]; spread, lift: of what the springs alone make of
    -m . (b + e), if they are known to a factor, its sigma by its mean, and by what share of that of the median springs its mean
    is more."""

    mm: Array
    bm: Array
    um: Array
    ub: Array
    mem: Array
    uem: Array
    ueu: Array
    aside: Array
    grows: Array
    spread: Array
    lift: Array

    def worse(self, between: Array) -> Array:
        """Probability (M,) that a target is farther off the plan than without correction; between (M,) [m]: 1 sigma of what is
        left beside it."""
        found = np.zeros(len(between))
        for part in chunks(len(between), CHUNK):
            found[part] = Risk(*(getattr(self, one.name)[part].astype(float) for one in fields(self)))._worse(between[part])
        return found

    def _worse(self, between: Array) -> Array:
        """Of few targets. Where f takes back what the correction does the answer turns round, and where it brings a target as
        far off as it was without one, the better it is known otherwise the steeper: from one of these to the next it is smooth.
        """
        mem, uem, ueu = (squared + between**2 * by for squared, by in (
            (self.mem, self.um**2), (self.uem, self.um), (self.ueu, 1.0)))

        def size(f: Array, of: Indices) -> Array:
            return np.asarray((2 * self.bm + self.mm + self.aside)[of] + 2 * f * (self.ub + self.um)[of] + f**2)

        # |r + f u|^2 - |b|^2 has its largest value at an end of the values of f: most targets can be seen to be safe at once.
        far, found = OUTMOST * self.grows, np.zeros(len(between))
        every = np.arange(len(between))
        most = np.maximum(size(far, every), size(-far, every)) + 2 * NOTHING * (np.sqrt(mem) + far * np.sqrt(ueu))
        some = np.flatnonzero((most > 0) & (self.mm > TINY**2))
        middle = self.ub + self.um
        apart = np.sqrt(np.maximum(middle**2 - (2 * self.bm + self.mm + self.aside), 0.0))
        turns = np.array([-self.um, -middle - apart, -middle + apart]) / np.maximum(self.grows, TINY)
        ends = np.full((1, len(between)), OUTMOST)
        edges = np.vstack([-ends, np.sort(np.clip(turns, -OUTMOST, OUTMOST), axis=0), ends])
        total = np.zeros(len(between))
        for start, end in pairwise(edges):
            of = some[end[some] > start[some]]
            half, about = 0.5 * (end - start)[of], 0.5 * (end + start)[of]
            for place, weight in zip(PLACES, WEIGHTS, strict=True):
                value = about + half * place
                likely = weight * half * np.exp(-0.5 * value**2)
                f = value * self.grows[of]
                std = np.maximum(np.sqrt(np.maximum(mem[of] + 2 * f * uem[of] + f**2 * ueu[of], 0.0)), TINY**2)
                along = np.maximum(-(self.bm[of] + f * self.ub[of]), 0.0)
                mean, spread = (1 + self.lift[of]) * along, self.spread[of]
                third = (3 + spread**2) * spread * np.minimum(spread * mean / std, 1.0) ** 3
                found[of] += likely * _normal(_as_normal((0.5 * size(f, of) - self.lift[of] * along) / std, third))
                total[of] += likely
        return found / np.maximum(total, TINY)


def risk(
    before: Array, of_before: Array, after: Array, of_after: Array, grows: Array, springs: tuple[Array, Array] | None = None
) -> Risk:
    """Of targets that stand at `before` (M, 3) [m] uncorrected and at `after` (M, 3) [m] corrected, with the same error in
    both, of these covariances (M, 3, 3) [m^2], and 1 sigma (M,) [m] more along the deviation in the corrected pass. springs:
    where they are known to a factor, shift (M, 3) [m] of the mean and covariance (M, 3, 3) [m^2] of what they make, which is in
    the other covariances."""
    moved, along, covariance, more = after - before, directions(before), 0.5 * (of_before + of_after), of_after - of_before
    seen, across = np.einsum("nij,nj->ni", covariance, moved), directions(moved)

    def by(one: Array, other: Array) -> Array:
        return np.asarray(np.einsum("ni,ni->n", one, other))

    spread, lift = np.zeros((2, len(before)))
    if springs is not None:
        shift, of_springs = springs
        median = -by(before, moved)
        mean = median - by(shift, moved)
        std = np.sqrt(np.einsum("ni,nij,nj->n", moved, of_springs, moved))
        one_way = (median > 0) & (mean >= median)
        spread[one_way] = std[one_way] / mean[one_way]
        lift[one_way] = mean[one_way] / median[one_way] - 1
    return Risk(by(moved, moved), by(before, moved), by(along, moved), by(along, before), by(moved, seen), by(along, seen),
                np.einsum("ni,nij,nj->n", along, covariance, along),
                np.trace(more, axis1=1, axis2=2) - np.einsum("ni,nij,nj->n", across, more, across), grows, spread, lift)


def risk_of(
    predicted: Predicted, cut: CorrectedPass, prediction: Prediction, correction: Correction, unloaded: Array | None
) -> Risk:
    """Of a corrected program, the prediction of the deviation that the corrected pass has, and the covariance (M, 3, 3) [m^2]
    of where the robot stands without load, if it is stated."""
    planned, path, share = predicted.prediction, predicted.path, sum(in_proportion(predicted))
    # A target that is held back stands less deep than one on the plan, and one that is not moved meets the force it met.
    made = np.minimum(correction.share, 1.0)

    def of(part: slice) -> Risk:
        before = planned.at_rest[part] * cut.uncorrected[part, None]
        moved = path.base_from_object[correction.targets[part]].rotation @ correction.offset[part, :, None]
        after = before + made[part, None] * (prediction.position[part] - before) + moved[:, :, 0]
        along = directions(prediction.position[part])
        of_both = share * np.einsum("ni,nj->nij", before, before)
        if planned.turned is not None:
            of_both += planned.turned[part] * cut.uncorrected[part, None, None] ** 2
        if unloaded is not None:
            of_both += unloaded[part]
        of_before, of_after, springs = planned.at_rest_covariance[part], prediction.covariance[part], None
        if planned.wide is not None and prediction.wide is not None:
            of_before, of_after = of_before + planned.wide.more[part], of_after + prediction.wide.more[part]
            times = cut.uncorrected[part, None]
            springs = times * planned.wide.shift[part], times[:, :, None] ** 2 * planned.wide.covariance[part]
        of_cut = np.einsum("n,ni,nj->nij", cut.in_covariance[part] ** 2, along, along)
        return risk(before, of_before + of_both, after, of_after - of_cut + of_both, made[part] * cut.left[part], springs)

    # Held until the program is written: in single precision, which is enough of a probability.
    known: Any = np.empty((len(fields(Risk)), len(made)), dtype=np.float32)
    for part in chunks(len(made), CHUNK):
        some = of(part)
        known[:, part] = [getattr(some, one.name) for one in fields(Risk)]
    return Risk(*known)


def _as_normal(values: Array, third: Array) -> Array:
    """Of values (M,) of a number of no mean, unit variance and this third moment (M,), at least nothing, those of a standard
    normal one that is below them as often: by the log-normal distribution, shifted, that has these moments."""
    root = np.cbrt(0.5 * (third + np.sqrt(third**2 + 4)))
    width = root - 1 / root                 # (width^2 + 3) width is the third moment
    skewed = width > ROUND
    found = values.copy()
    inner = 1 + (width * values)[skewed]
    sigma = np.sqrt(np.log1p(width[skewed] ** 2))
    with np.errstate(divide="ignore"):
        found[skewed] = np.log(np.maximum(inner, 0.0)) / sigma + 0.5 * sigma
    return found


def _normal(values: Array) -> Array:
    """Distribution function of the standard normal (M,): SciPy's takes longer to import than a program to correct."""
    found = np.zeros(len(values))
    some = np.flatnonzero(values > -NOTHING)
    found[some] = 0.5 * np.fromiter(map(erfc, (-sqrt(0.5) * values[some]).tolist()), np.float64, len(some))
    return found

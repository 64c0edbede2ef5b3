"""What an ambiguous answer leaves open: the candidates' disagreement, as uncertainty of the one that is carried.

Candidates that predict the same, as two laws of neighbouring bearings with another spring each, differ in nothing that a
correction could get wrong, however far apart their springs are. So the covariance is that of what they predict, seen as springs
and effects of the carried one; the intervals of the stiffnesses hold those of every candidate.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from identification.common.arrays import Array
from identification.diagnosis.discrimination import probing_rows
from identification.diagnosis.judgement import Rival
from identification.fit.fitted_model import Term, response
from identification.fit.force_gain import delivered
from identification.fit.load_test import LoadTest
from identification.fit.marginal import Draws
from identification.fit.posterior import Posterior
from identification.model.effects_in_force import SPRINGS


@dataclass(frozen=True, eq=False)
class RobotPart:
    """What of a fitted model is the robot's: its springs and the effects of the robot. kept: their places in x."""

    fitted: Posterior
    terms: tuple[Term, ...]
    kept: Array

    @classmethod
    def of(cls, fitted: Posterior) -> RobotPart:
        """That of a model with all its terms."""
        kept, place = list(range(6)), 6
        for term in fitted.terms:
            if term.effect.of_robot:
                kept += range(place, place + len(term.start))
            place += len(term.start)
        return cls(fitted, tuple(term for term in fitted.terms if term.effect.of_robot), np.array(kept))

    @property
    def covariance(self) -> Array:
        """Of its own parameters (6 + P, 6 + P)."""
        return np.asarray(self.draws.covariance[np.ix_(self.kept, self.kept)])

    @cached_property
    def draws(self) -> Draws:
        """Those of the model, the scale of the load cell drawn with them."""
        return delivered(self.fitted)

    @property
    def prior_precision(self) -> Array:
        """Of its own parameters (6 + P, 6 + P), as little as is known without the rows."""
        return np.asarray(self.fitted.prior.precision(self.fitted.likeliest)[np.ix_(self.kept, self.kept)])

    @property
    def centre(self) -> Array:
        """The likeliest of its parameters (6 + P,) where it has effects, else their mean: parameters that do not enter linearly
        can trade with the springs along a curve, and then the mean lies off it: a model that is none of the likely ones."""
        return np.asarray((self.fitted.likeliest if self.terms else self.fitted.mean)[self.kept])

    def seen(self, rows: LoadTest) -> tuple[Array, Array]:
        """Predicted deviations (n,) [m] of these rows, components one after the other, and their slopes (n, 6 + P)."""
        position, slope = response(rows, self.centre, self.terms)
        return position.ravel(), slope.reshape(position.size, -1)


def left_open(carried: RobotPart, rivals: Sequence[Rival]) -> tuple[Array, Array]:
    """Covariance (6 + P, 6 + P) about its centre, and 95 % intervals (6 + P, 2), of the model that is carried: its own,
    and where it has rivals theirs beside, each with its probability."""
    draws = carried.draws
    interval = draws.interval(0.95)[carried.kept]
    if not rivals:
        return carried.covariance, interval
    own = 1.0 - sum(rival.probability for rival in rivals)
    rows = carried.fitted.data.with_rows(probing_rows(carried.fitted.data))
    predicted, slopes = carried.seen(rows)
    # As if the rival's predictions had been measured, with the sensor's noise: its prior holds what they hardly tell.
    noise = float(np.mean(carried.fitted.data.cell.noise.deflection))
    as_carried = np.linalg.solve(slopes.T @ slopes / noise**2 + carried.prior_precision, slopes.T / noise**2)
    covariance, springs, weight = own * carried.covariance, [draws.x[:, SPRINGS]], [own * draws.weight]
    for rival in rivals:
        part = RobotPart.of(rival.fitted)
        of_it, its_slopes = part.seen(rows)
        off, turned = as_carried @ (of_it - predicted), as_carried @ its_slopes
        covariance += rival.probability * (turned @ part.covariance @ turned.T + np.outer(off, off))
        springs.append(part.draws.x[:, SPRINGS])
        weight.append(rival.probability * part.draws.weight)
    interval[SPRINGS] = Draws(np.concatenate(springs), np.concatenate(weight), 0.0).interval(0.95)
    return covariance, interval
